"""Scenes of motion fields (ma09): synth.motion and render.smoke, lic … as artifacts.

In the order data passes through them:

    tables     the tables of the synthesis
    exemplars  the kinds of [exemplar], and I
    fields     synth: the smoke O of the coarse motion, and H
    bake       bake: F and what it moves, the density, particles or blades of seaweed
    looks      the kinds of [render], and their pictures
    scene      all tables of a scene file, and what does not fit together
    panels     the panels of a figure, and pictures of fields
    method     all of it as one record
"""
