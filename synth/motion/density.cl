// Smoke densities of several windows at once: LANES = CHANNELS floats per cell, interleaved. A departure point is
// found once and serves all of them, and a cell's lanes are one vector load. advect.cl gives the interpolation.

#include "advect.cl"

// Inject a source into every lane: hold q between `lowest` and `highest` in a box of the grid, of size (width, …)
// and with its first cell at (x0, y0, z0).
kernel void inject(global float *restrict q, global const float *restrict lowest,
                   global const float *restrict highest, const int x0, const int y0, const int z0,
                   const int width, const int X, const int Y)
{
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    if (x >= width) return;
    const int cell = ((z0 + z) * Y + y0 + y) * X + x0 + x;
    const int here = (z * (int)get_global_size(1) + y) * width + x;
    const quantity above = fmax(LOAD(cell, q), (quantity)(lowest[here]));
    STORE(fmin(above, (quantity)(highest[here])), cell, q);
}

#if CHANNELS == 1
#define ANY(condition) (condition)
#else
#define ANY(condition) any(condition)
#endif

// Of each row of cells (y, z): the first and the last x from `begin` to `end` - 1 with smoke in any lane; with
// none, `end` and `begin` - 1. extents is (Z, Y, 2).
kernel void extent(global const float *restrict q, global int *restrict extents, const int begin, const int end,
                   const int X, const int Y)
{
    const int row = get_global_id(1) * Y + get_global_id(0);
    int first = begin, last = end - 1;
    while (first < end && !ANY(LOAD(row * X + first, q) != 0.0f)) first++;
    while (last >= first && !ANY(LOAD(row * X + last, q) != 0.0f)) last--;
    extents[2 * row] = first;
    extents[2 * row + 1] = first < end ? last : begin - 1;
}

// One step of every lane, out = q carried along d, where smoke thinner than THINNEST is gone. Lane `take` is
// copied to `taken`, then lane `put` begins anew from `fresh`; a negative lane is none.
kernel void step_lanes(global const float *restrict q, global const float *restrict displacements,
                       global float *restrict out, global const float *restrict fresh,
                       global float *restrict taken, const int take, const int put, const int X, const int Y,
                       const int Z)
{
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    if (x >= X) return;
    const int cell = (z * Y + y) * X + x;
    const quantity value = at_departure(q, displacements, x, y, z, X, Y, Z);
    STORE(value * step((quantity)(THINNEST), value), cell, out);
    if (take >= 0) taken[cell] = out[cell * CHANNELS + take];
    if (put >= 0) out[cell * CHANNELS + put] = fresh[cell];
}

#if CHANNELS == DIMS
// Where the content of each cell comes from when the detail moves along with L: back along the detail alone, as seen
// from a point carried by L, in `substeps` of displacement `detail` each; then back along L. All are (cells, DIMS).
kernel void ride(global const float *restrict detail, global const float *restrict coarse,
                 global float *restrict displacements, const int substeps, const int X, const int Y, const int Z)
{
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    if (x >= X) return;
    const int cell = (z * Y + y) * X + x;
    velocity displacement = LOAD(cell, detail);
    for (int i = 1; i < substeps; i++) displacement += displaced(detail, displacement, x, y, z, X, Y, Z);
    STORE(displacement + displaced(coarse, displacement, x, y, z, X, Y, Z), cell, displacements);
}
#endif
