"""Scenes of moving textures (wang05): synth.texture as artifacts.

In the order data passes through them:

    samples   the kinds of [sample], and the sample
    surfaces  the kinds of [surface], and the surface with its field
    tables    the tables of the synthesis
    frames    synth: the frames of the texture, its holes; render: the lines of the flow
    looks     render: the pictures of a surface
    scene     all tables of a scene file, and what does not fit together
    panels    the panels of a figure
    method    all of it as one record
"""
