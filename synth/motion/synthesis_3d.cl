// Synthesis in 3-D (ma09 §3.4): what a new frame takes over from the frame before, one voxel to a work-item.
// Fields are (Z, Y, X) float4 in local coordinates, the last component unused.

// The O(x) of Eq. 1: x held to the frame before, warped, by `coherence` (Z, Y, X).
__kernel void hold(__global float4 *x, __global const float4 *prior, __global const float *coherence) {
    const int i = get_global_id(0);
    x[i] = (x[i] + coherence[i] * prior[i]) / (1.0f + coherence[i]);
}

inline float4 catmull_rom(float t) {
    return 0.5f * (float4)(((2.0f - t) * t - 1.0f) * t, (3.0f * t - 5.0f) * t * t + 2.0f,
                           ((4.0f - 3.0f * t) * t + 1.0f) * t, (t - 1.0f) * t * t);
}

// The frame before, carried by the flow: displacement (Z, Y, X, 3) to where each cell's content comes from.
__kernel void carry_3d(__global const float4 *field, __global const float *displacement, __global float4 *out) {
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    const int4 size = (int4)(get_global_size(0), get_global_size(1), get_global_size(2), 1);
    const int here = (z * size.y + y) * size.x + x;
    const float4 at = clamp((float4)(x, y, z, 0.0f) + (float4)(vload3(here, displacement), 0.0f), (float4)(0.0f),
                            convert_float4(size - 1));
    const int4 low = convert_int4(at);
    const float4 t = at - convert_float4(low);
    float wx[4], wy[4], wz[4];
    vstore4(catmull_rom(t.x), 0, wx);
    vstore4(catmull_rom(t.y), 0, wy);
    vstore4(catmull_rom(t.z), 0, wz);
    float4 sum = (float4)(0.0f);
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < 4; j++) {
            __global const float4 *row =
                field + (clamp(low.z + k - 1, 0, size.z - 1) * size.y + clamp(low.y + j - 1, 0, size.y - 1)) * size.x;
            float4 along = (float4)(0.0f);
            for (int i = 0; i < 4; i++) along += wx[i] * row[clamp(low.x + i - 1, 0, size.x - 1)];
            sum += wz[k] * wy[j] * along;
        }
    out[here] = sum;
}
