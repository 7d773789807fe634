// Oriented neighbourhoods of a 2-D field and their projection on a PCA basis (ma09 §3.1, §3.3).
// -D RADIUS  half width r of the neighbourhood, (2r+1)^2 samples
// -D DIMS    number of PCA dimensions kept, a multiple of 16

#define SIDE (2 * RADIUS + 1)
#define LENGTH (2 * SIDE * SIDE)

inline float2 bilinear_clamped(__global const float2 *field, int2 size, float2 at) {
    at = clamp(at, (float2)(0.0f), convert_float2(size - 1));
    const int2 low = min(convert_int2(at), max(size - 2, (int2)(0)));
    const int2 high = min(low + 1, size - 1);
    const float2 t = at - convert_float2(low);
    const float2 a = (1.0f - t.x) * field[low.y * size.x + low.x] + t.x * field[low.y * size.x + high.x];
    const float2 b = (1.0f - t.x) * field[high.y * size.x + low.x] + t.x * field[high.y * size.x + high.x];
    return (1.0f - t.y) * a + t.y * b;
}

// field (Y, X) float2; frame (Y, X) float2, the local x axis; sites (S) int2 -> out (S, SIDE, SIDE) float2
__kernel void gather(__global const float2 *field, __global const float2 *frame, int2 size,
                     __global const int2 *sites, __global float2 *out) {
    const int k = get_global_id(0), s = get_global_id(1);
    const int2 p = sites[s];
    const float2 e = frame[p.y * size.x + p.x];
    const float i = k % SIDE - RADIUS, j = k / SIDE - RADIUS;
    const float2 at = convert_float2(p) + (float2)(e.x * i - e.y * j, e.y * i + e.x * j);
    out[s * SIDE * SIDE + k] = bilinear_clamped(field, size, at);
}

// Four sites and sixteen dimensions at a time: out[s, d] = sum over c of (patches[s, c] - mean[c]) * basis[c, d]
__kernel void project(__global const float *patches, __global const float *mean, __global const float *basis,
                      int count, __global float *out) {
    const int d = get_global_id(0) * 16, s = get_global_id(1) * 4;
    float16 sum[4] = {(float16)(0.0f), (float16)(0.0f), (float16)(0.0f), (float16)(0.0f)};
    for (int c = 0; c < LENGTH; c++) {
        const float16 b = vload16(0, basis + c * DIMS + d);
        for (int q = 0; q < 4; q++) {
            const int row = min(s + q, count - 1);
            sum[q] = fma((float16)(patches[row * LENGTH + c] - mean[c]), b, sum[q]);
        }
    }
    for (int q = 0; q < 4; q++)
        if (s + q < count) vstore16(sum[q], 0, out + (s + q) * DIMS + d);
}
