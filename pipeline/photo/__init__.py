"""Scenes of photographs that flow (okabe11): synth.photo as artifacts.

In the order data passes through them:

    tables    the tables of a scene but its clips
    clips     [clips]: the clips of the database, made or a user's, and their index; artifacts clip-001, index-001 …
    made      targets that are made: a fire, smoke, a painting
    target    the photograph, its matte, what stands still in it, what the user wants
    frames    synth: the assignment, the motion, the frames and their mattes
    scene     all tables of a scene file, and what does not fit together
    panels    the panels of a figure
    method    all of it as one record
"""
