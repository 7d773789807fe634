"""Scenes of photographs that flow (okabe11): synth.photo as artifacts.

In the order data passes through them:

    tables      the tables of a scene but its clips
    own         a user's own clips, read from videos and checked
    library     own clips in a folder: flowloom clips add, list
    clips       [clips]: the clips of the database, made or a user's, and their index; artifacts clip-fall-01,
                index-fall-01 …
    sheet       clips to be looked at: flowloom clips sheet
    made        targets that are made: a fire, smoke, a painting
    target      the photograph, its matte, what stands still in it, what the user wants
    frames      synth: the assignment, the motion, the frames and their mattes
    outputs     what a compositor or a paint program takes: the motion, the speed map
    views       pictures of the photograph, of what the user wants, of the motion, of the database
    pieces      pictures of what is known of pieces of clips
    neighbours  pictures of two neighbours before and after integration
    scene       all tables of a scene file, and what does not fit together
    panels      the panels of a figure
    method      all of it as one record
"""
