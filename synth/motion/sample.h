// Catmull-Rom samples of fields of two components. Catmull-Rom interpolates (is exact at cells) and, unlike linear
// weights, does not blur between them.
// -D BORDER   cells by which the field was continued on each side

// The weights of the cells at -1, 0, 1, 2 are cubics in t. Four cells of a row are one vector, each weight there
// twice; what is returned is to be added up over the cells: many samples first, which is cheaper.
inline float8 spread_sample(__global const float2 *field, int pitch, float2 at) {
    // continued, at lies right of and above the first cell: cutting off is rounding down, without the cost of floor
    at += BORDER;
    const int2 low = convert_int2(at);
    const float2 t = at - convert_float2(low);
    const float4 w = ((float4)(-0.5f, 1.5f, -1.5f, 0.5f) * t.y + (float4)(1.0f, -2.5f, 2.0f, -0.5f)) * t.y * t.y +
                     (float4)(-0.5f, 0.0f, 0.5f, 0.0f) * t.y + (float4)(0.0f, 1.0f, 0.0f, 0.0f);
    const float8 along =
        ((float8)(-0.5f, -0.5f, 1.5f, 1.5f, -1.5f, -1.5f, 0.5f, 0.5f) * t.x +
         (float8)(1.0f, 1.0f, -2.5f, -2.5f, 2.0f, 2.0f, -0.5f, -0.5f)) * t.x * t.x +
        (float8)(-0.5f, -0.5f, 0.0f, 0.0f, 0.5f, 0.5f, 0.0f, 0.0f) * t.x +
        (float8)(0.0f, 0.0f, 1.0f, 1.0f, 0.0f, 0.0f, 0.0f, 0.0f);
    __global const float *row = (__global const float *)(field + (low.y - 1) * pitch + low.x - 1);
    return along * (w.x * vload8(0, row) + w.y * vload8(0, row + 2 * pitch) + w.z * vload8(0, row + 4 * pitch) +
                    w.w * vload8(0, row + 6 * pitch));
}

inline float2 added(float8 s) {
    return (s.s01 + s.s23) + (s.s45 + s.s67);
}
