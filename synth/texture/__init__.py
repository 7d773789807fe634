"""Directional moving texture (Wang, Wang, Sun, Yong 2005: "wang05"): a small sample becomes a texture that follows a
flow and moves with it.

In the order data passes through them:

    procedural  canes, straw, scales: samples by procedure (figures 8 to 10)
    sample      what is compared, the main direction, the rotated copies (§2.1)
    flow        direction of the flow, its speed within limits, motion along it (§2.2, §3)
    cells       squares over which direction or velocity differ little, for the paper's method (§2.1, §2.2.1)
    kept        states as arrays, for runs that go on
    paper       the paper's method: colours that are carried in cells (§2)
    patches     what patches of a sample cover and show, and which place of it continues a picture
    anchors     which places of the sample patches may take
    carry       ours: places in the sample that are carried in patches
    loop        carry with lives of patches that repeat: the last frame leads into the first
    mesh        triangle meshes: tangent fields on them, motion over them
    shapes      surfaces by procedure, fields on surfaces
    charts      each patch's surroundings on a surface, laid into the plane
    atlas       a place in one picture for each triangle
    bake        what patches on a surface show
    surface     carry on a surface
    measures    how near a frame is to its sample, and how well it moves

Notation:

    v      flow, pixels per frame          θ      its direction, θ(x) at a pixel
    θ_s    main direction of the sample    n      number of rotated copies (§2.1)
    T_i    texture of frame i              D      width of the mask round a hole, in pixels (§2.2.3)
    B(d)   weight of blending at distance d from a hole (Eq. 1)
    E      error of a patch (Eq. 2)        s      standard deviation of the sample's luminance

Pictures are (Y, X[, 3]) float32, row 0 the lowest, in linear light; searches and measures see display-encoded
luminance in 0..1. Angles are radians, counter-clockwise from x.
"""
