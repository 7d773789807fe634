// Tiles carried along a flow; sampled_reference in carried.py is the specification. Defines: PHASES.

#pragma OPENCL FP_CONTRACT OFF

// A texel of a tile that repeats, between texels linear along x, then y.
inline float at(__global const float *tile, int rows, int columns, float x, float y) {
    float fx = floor(x), fy = floor(y);
    float tx = x - fx, ty = y - fy;
    // exact for the whole numbers here, and faster than the remainder of integers
    int x0 = (int)(fx - columns * floor(fx / columns));
    int y0 = (int)(fy - rows * floor(fy / rows));
    x0 = x0 >= columns ? 0 : x0;
    y0 = y0 >= rows ? 0 : y0;
    int x1 = x0 + 1 == columns ? 0 : x0 + 1;
    int y1 = y0 + 1 == rows ? 0 : y0 + 1;
    float low = (1.0f - tx) * tile[y0 * columns + x0] + tx * tile[y0 * columns + x1];
    float high = (1.0f - tx) * tile[y1 * columns + x0] + tx * tile[y1 * columns + x1];
    return (1.0f - ty) * low + ty * high;
}

// Frames f of a picture (height, width): the sum over phases of weight times the tile's slice at
// A (pixel + displacement) + offset, A = (a b; c d). phases (frames, PHASES, 3): offset x, y, weight.
__kernel void sampled(__global const float *tile, __global const float *displacement, __global const float *phases,
                      __global const int *slices, __global float *out, float a, float b, float c, float d,
                      int rows, int columns, int width, int height) {
    int x = get_global_id(0), y = get_global_id(1), f = get_global_id(2);
    if (x >= width) return;
    __global const float *slice = tile + (size_t)slices[f] * rows * columns;
    float total = 0.0f;
    for (int i = 0; i < PHASES; i++) {
        __global const float *by = displacement + 2 * (((size_t)y * width + x) * PHASES + i);
        __global const float *p = phases + 3 * (f * PHASES + i);
        float px = x + by[0], py = y + by[1];
        total += p[2] * at(slice, rows, columns, a * px + b * py + p[0], c * px + d * py + p[1]);
    }
    out[((size_t)f * height + y) * width + x] = total;
}
