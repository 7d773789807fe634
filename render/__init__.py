"""Pixels: fields, densities and meshes in, pictures out. No file; one renderer, behind one door.

In the order data passes through them:

    lic       a vector field by line integral convolution and by colour
    arrows    a vector field by arrows on such a picture
    sheet     light through a sheet of smoke, layer by layer
    smoke     a density as a lit sheet, as ink on paper, or as a volume
    particles particles as foam on a river, obstacles as stones
    surface   meshes, cameras and lamps as Mitsuba takes them
    water     light under water: caustics, fog, shafts, sand
    seaweed   blades under water, by path tracing
    school     fish in a cube of water
    noodles   threads as noodles on a plate
    papers    sheets as paper in the air
    beads     particles of the plane as beads on paper, past obstacles
    studio    what a volume is photographed in: camera, lights, backdrop, bowl
    backend   the one home of Mitsuba and Dr.Jit
    march     light carried through a volume without noise: the picture of an animation
    denoise   path-traced smoke without its noise
    film      linear light to display values to eight bits
    layout    panels, labels, insets and legends as one figure

Fields and densities have y up, row 0 the lowest; pictures have their top row first. Renderers return linear
Rec.709 light, `film` turns it into sRGB display values in [0, 1]; field pictures are display values at once.
"""
