// The mosaic that a synthesis starts from (ma09 §3.4): which tile, a square rotated with the flow, holds a cell.

// For each of cells (P, as x, y) in each mosaic the centre from which it is least far in the greater of its two
// local coordinates there, the lowest number of several; and its local coordinates (offset).
// centres, axis (mosaics, count) in order of the buckets that they lie in, name (mosaics, count) their numbers;
// starts (mosaics, buckets + 1) where each bucket begins; buckets (grid), row by row, are `edge` cells wide.
__kernel void owners(__global const float2 *cells, __global const float2 *centres, __global const float2 *axis,
                     __global const int *name, __global const int *starts, int count, int2 grid, float edge,
                     __global int *owner, __global float2 *offset) {
    const int p = get_global_id(0), mosaic = get_global_id(1);
    const float2 cell = cells[p];
    const int2 home = min(convert_int2(cell / edge), grid - 1);
    centres += mosaic * count;
    axis += mosaic * count;
    name += mosaic * count;
    starts += mosaic * (grid.x * grid.y + 1);
    float least = MAXFLOAT;
    float2 nearest = (float2)(0.0f);
    int found = -1;
    const int rings = max(grid.x, grid.y);
    // ring by ring of buckets; what lies beyond ring r is r * edge away at least, and a square's corner is
    // sqrt(2) times as far as its side
    for (int ring = 0; ring < rings && (ring < 2 || least * 1.4143f > (ring - 1) * edge); ring++)
        for (int y = home.y - ring; y <= home.y + ring; y++) {
            if (y < 0 || y >= grid.y) continue;
            const int step = y == home.y - ring || y == home.y + ring ? 1 : 2 * ring;
            for (int x = home.x - ring; x <= home.x + ring; x += step) {
                if (x < 0 || x >= grid.x) continue;
                const int bucket = y * grid.x + x;
                for (int c = starts[bucket]; c < starts[bucket + 1]; c++) {
                    const float2 from_centre = cell - centres[c], e = axis[c];
                    const float2 o = (float2)(e.x * from_centre.x + e.y * from_centre.y, e.x * from_centre.y - e.y * from_centre.x);
                    const float away = max(fabs(o.x), fabs(o.y));
                    if (away < least || (away == least && name[c] < found)) {
                        least = away;
                        nearest = o;
                        found = name[c];
                    }
                }
            }
        }
    owner[mosaic * get_global_size(0) + p] = found;
    offset[mosaic * get_global_size(0) + p] = nearest;
}
