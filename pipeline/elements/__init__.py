"""Scenes of elements (ma13): synth.elements and render.beads, school … as artifacts.

In the order data passes through them:

    tables     the tables of the synthesis
    exemplars  the kinds of [exemplar], and I
    coarse     the coarse motion C of threads and sheets
    controls   the user controls of points: domain, flow, orientation, maps, hard positions
    output     synth: O
    looks      the kinds of [render]: meshes, pictures
    scene      all tables of a scene file, and what does not fit together
    panels     the panels of a figure
    method     all of it as one record
"""
