"""Fluid animation from a single image (Okabe, Anjyo, Onai 2011: "okabe11"): a photograph gets the motion of clips.

In the order data passes through them, first the clips of the database (§4). The paper's were bought. These are made,
each with its true velocity, and each repeats: frame T is frame 0.

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

Targets that are made, since no photograph of fire or smoke may be shipped:

    rising    where and when what rises left the ground, in space
    flames    a wood fire, for `render.bonfire`
    plume     the smoke of a stack, for `render.chimney`
    painting  a landscape in oils

Then the database (§4), the assignment (§5) and the synthesis (§6):

    pieces      squares of scaled, turned and mirrored clips, and their pixels
    words       SIFT on a grid, the codebook, histograms of words, what two have in common (Eq. 1)
    motion      optical flow, its mean and spectrum, textureness
    index       what is known of the pieces of a clip
    guides      strokes to an orientation map (fig. 8)
    minimize    minimizers of an energy over labels: TRW-S, α-expansion, ICM (Eq. 4)
    assign      a piece of a clip for each piece of the target (Eqs. 2 to 6)
    fit         pieces fitted to the edges of the target
    integrate   differences from averages, blended band by band; the motion field (fig. 9)
    appearance  the average image, gains, histograms: the look of the target
    photograph  the photograph carried along the motion (beyond the paper)
    boundary    the matte that moves with fire and smoke (fig. 10), what is seen behind it
    animate     the whole, from target to frames
    steps       inner steps, as figures show them (figs. 5 to 7, 9)

Notation:

    T  frames of a clip               U  velocity of a current, pixels per frame
    s  place along the lip of a fall  A  texels of a tile per pixel of a picture, (2, 2)
    H  histogram of visual words      I  what two have in common (Eq. 1)
    V  data term   W  smoothness term  λ, σ, ρ their weights (Eqs. 2 to 6)
    α  matte       B_i that of a frame τ  how far it moves

Pictures are (Y, X) and clips (T, Y, X), row 0 the lowest, y up, display-encoded grey in 0..1. Lengths and speeds in
signatures are pixels at a picture 240 high, and scale with it; angles are radians, counter-clockwise from x.
"""
