"""Fluid animation from a single image (Okabe, Anjyo, Onai 2011: "okabe11"): the clips of its database (§4).

The paper's clips were bought. These are made, each with its true velocity, and each repeats: frame T is frame 0.

In the order data passes through them:

    clip     a clip: frames, velocity, coverage
    tiles    textures that repeat: noise, foam
    rock     what stands still: rock faces, stones, pebbles
    drops    droplets that fly on their own
    carried  tiles carried along a flow
    current  a current past stones, with eddies
    sea      waves of deep water
    falls    falls
    surface  running water from above: white water, rivers
    calm     shallows, bays, lakes
    fumes    fire, smoke, clouds
    clips    the families, and the catalogue of 150 clips
    checks   what a clip must fulfil

Notation:

    T  frames of a clip               U  velocity of a current, pixels per frame
    s  place along the lip of a fall  A  texels of a tile per pixel of a picture, (2, 2)

Pictures are (Y, X) and clips (T, Y, X), row 0 the lowest, y up, display-encoded grey in 0..1. Lengths and speeds in
signatures are pixels at a picture 240 high, and scale with it; angles are radians, counter-clockwise from x.
"""
