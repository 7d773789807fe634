// Local axes of a flow in 3-D (ma09 §3.3), one voxel to a work-item.
// -D ALONG  the local axis that follows L: 0 or 1

inline float3 lattice_sample(__global const float *lattice, int3 size, float3 at) {
    at = clamp(at, (float3)(0.0f), convert_float3(size - 1));
    const int3 low = min(convert_int3(at), max(size - 2, (int3)(0)));
    const int3 step = min((int3)(1), size - 1 - low);
    const float3 t = at - convert_float3(low);
    const int first = (low.z * size.y + low.y) * size.x + low.x;
    const int dx = step.x, dy = step.y * size.x, dz = step.z * size.x * size.y;
    const float3 a = mix(vload3(first, lattice), vload3(first + dx, lattice), t.x);
    const float3 b = mix(vload3(first + dy, lattice), vload3(first + dy + dx, lattice), t.x);
    const float3 c = mix(vload3(first + dz, lattice), vload3(first + dz + dx, lattice), t.x);
    const float3 d = mix(vload3(first + dz + dy, lattice), vload3(first + dz + dy + dx, lattice), t.x);
    return mix(mix(a, b, t.y), mix(c, d, t.y), t.z);
}

// L (Z, Y, X, 3); lattice (z, y, x, 3): the second direction on cells `stride` times as wide; -> R (Z, Y, X, 3, 3)
__kernel void axes_3d(__global const float *L, float scale, float still, __global const float *lattice,
                          int3 size, float stride, __global float *R) {
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    const size_t voxel = ((size_t)z * get_global_size(1) + y) * get_global_size(0) + x;
    const float3 rest = ALONG == 0 ? (float3)(1.0f, 0.0f, 0.0f) : (float3)(0.0f, 1.0f, 0.0f);
    float3 l = scale * vload3(voxel, L) + still * rest;
    const float length_l = sqrt(dot(l, l));
    l = length_l > 1e-12f ? l / length_l : rest;
    const float3 at = ((float3)(x, y, z) + 0.5f) / stride - 0.5f;
    float3 n = lattice_sample(lattice, size, at);
    n -= dot(n, l) * l;
    float length_n = sqrt(dot(n, n));
    if (length_n < 1e-6f) {  // along L itself: any direction across, the one of the domain that is least along L
        n = fabs(l.z) < 0.9f ? (float3)(0.0f, 0.0f, 1.0f) : (float3)(1.0f, 0.0f, 0.0f);
        n -= dot(n, l) * l;
        length_n = sqrt(dot(n, n));
    }
    n /= length_n;
    n = normalize(n - dot(n, l) * l);  // again: what was left of a vector nearly along L is mostly rounding
    const float3 third = ALONG == 0 ? cross(n, l) : cross(l, n);
    const float3 a = ALONG == 0 ? l : third, b = ALONG == 0 ? third : l;
    R += 9 * voxel;
    vstore3((float3)(a.x, b.x, n.x), 0, R);
    vstore3((float3)(a.y, b.y, n.y), 1, R);
    vstore3((float3)(a.z, b.z, n.z), 2, R);
}
