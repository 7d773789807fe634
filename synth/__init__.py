"""The methods. Arrays in, arrays out: no file, no process, no renderer.

In the order data passes through them:

    field       a field that knows its grid and its units
    opencl      the one home of OpenCL: device, build, launch
    advect      semi-Lagrangian advection [Stam 1999]
    noise       curl noise [Bridson et al. 2007]
    obstacle    obstacles, as a signed distance field
    projection  Helmholtz-Hodge projection, exact in a box, and past obstacles
    wake        a river past a round stone [Bridson et al. 2007]
    smoke       a simulated plume [Stam 1999; Fedkiw et al. 2001]
    optical_flow  the motion in a clip
    pyramid     image pyramids of fields
    motion/     motion field texture synthesis (ma09)
    elements/   dynamic element textures (ma13)
    texture/    directional moving texture (wang05)
    photo/      fluid animation from a single image (okabe11)
    particles   particles carried by a motion field, past obstacles
    seaweed     a bed of seaweed that a motion field bends

Arrays are C order float32: (Y, X[, 2]) or (Z, Y, X[, 3]), components x, y, z, row 0 the lowest, cell
centres at integers, velocities in cells per frame. The domain is one world unit high, its floor at y = 0,
centred on x and z.
"""
