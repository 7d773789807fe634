// Oriented neighbourhoods of a 2-D field and their projection on a PCA basis (ma09 §3.1, §3.3).
// -D RADIUS  half width r of the neighbourhood, (2r+1)^2 samples
// -D DIMS    number of PCA dimensions kept, a multiple of 16
// -D SITES   neighbourhoods a work-item projects together
// -D CHANNELS  of the field: 2, a vector, or 1, its potential

#define SIDE (2 * RADIUS + 1)
#define LENGTH (CHANNELS * SIDE * SIDE)

#if CHANNELS == 1
typedef float cell;
#else
typedef float2 cell;
#endif

inline cell bilinear_clamped(__global const cell *field, int2 size, float2 at) {
    at = clamp(at, (float2)(0.0f), convert_float2(size - 1));
    const int2 low = min(convert_int2(at), max(size - 2, (int2)(0)));
    const int2 high = min(low + 1, size - 1);
    const float2 t = at - convert_float2(low);
    const cell a = (1.0f - t.x) * field[low.y * size.x + low.x] + t.x * field[low.y * size.x + high.x];
    const cell b = (1.0f - t.x) * field[high.y * size.x + low.x] + t.x * field[high.y * size.x + high.x];
    return (1.0f - t.y) * a + t.y * b;
}

// field (Y, X) cell; sites (S) int2; axis (S) float2, the local x axis there -> out (S, SIDE, SIDE) cell
__kernel void gather(__global const cell *field, int2 size, __global const int2 *sites,
                     __global const float2 *axis, __global cell *out) {
    const int s = get_global_id(0);
    const float2 centre = convert_float2(sites[s]), e = axis[s];
    for (int j = -RADIUS; j <= RADIUS; j++)
        for (int i = -RADIUS; i <= RADIUS; i++) {
            const float2 at = centre + (float2)(e.x * i - e.y * j, e.y * i + e.x * j);
            out[(s * SIDE + j + RADIUS) * SIDE + i + RADIUS] = bilinear_clamped(field, size, at);
        }
}

// SITES sites and sixteen dimensions to a work-item: out[s, d] = sum over c of patches[s, c] * basis[c, d], less
// what the mean neighbourhood gives. The loops over SITES are unrolled, or the compiler keeps the sums in memory.
// patches (S, LENGTH), S a multiple of SITES; basis (LENGTH, DIMS); mean (DIMS) -> out (count, DIMS)
__kernel void project(__global const float *patches, __global const float *basis, __global const float *mean,
                      int count, __global float *out) {
    const int d = get_global_id(0) * 16, s = get_global_id(1) * SITES;
    patches += s * LENGTH;
    float16 sum[SITES];
#pragma unroll
    for (int q = 0; q < SITES; q++) sum[q] = -vload16(0, mean + d);
    for (int c = 0; c < LENGTH; c++) {
        const float16 b = vload16(0, basis + c * DIMS + d);
#pragma unroll
        for (int q = 0; q < SITES; q++) sum[q] = fma((float16)(patches[q * LENGTH + c]), b, sum[q]);
    }
#pragma unroll
    for (int q = 0; q < SITES; q++)
        if (s + q < count) vstore16(sum[q], 0, out + (s + q) * DIMS + d);
}
