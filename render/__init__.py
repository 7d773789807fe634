"""The renderer: fields, densities and meshes in, pictures out. It reads and writes no files.

In the order data passes through them:

    lic             vector fields by line integral convolution and by colour
    arrows          vector fields by arrows over such a picture
    backend         Mitsuba and Dr.Jit: the only module that imports them
    studio          cameras, shots and lights; the backdrop and the bowl of volumes
    mitsuba_shapes  meshes, cameras and lights as Mitsuba takes them; the integrator of noodles, paper and beads
    smoke_slab      light through a slab of smoke, layer by layer
    march           light in a volume, ray-marched without noise
    denoise         path-traced volumes without their noise, guided by march
    smoke           a density as a lit slab, as ink on paper, or as a volume
    screen_motion   the motion of a volume in pixels
    film            lens and film of a photograph
    bonfire         flames over logs at dusk
    chimney         smoke of a stack in the low sun
    particles       particles as foam on a river, obstacles as stones
    water           light under water: caustics, fog, shafts, sand
    seaweed         blades under water
    school          fish in a cube of water
    noodles         threads as noodles on a plate
    ceramic         a glazed surface that shows a texture
    paper           sheets of paper in the air
    beads           particles of the plane as beads on paper, around obstacles
    tonemap         linear light to display values, and these to eight bits
    speed_map       speed as colour over a texture, and its legend
    layout          panels, labels, insets and legends as one figure
    contact_sheet   clips of fluids on one sheet
    steps           inner steps of a photograph that flows: pieces, motion, strokes
    plot            curves over axes

Fields and densities have y up, row 0 the lowest; pictures have their top row first. Pictures are linear Rec.709 light,
which `tonemap` turns into sRGB display values in [0, 1]; `lic` and `arrows` give display values at once.
"""
