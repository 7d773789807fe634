// Catmull-Rom samples of fields of two components, or of one. Catmull-Rom interpolates (is exact at cells) and, unlike
// linear weights, does not blur between them.
// -D BORDER    cells by which the field was continued on each side
// -D CHANNELS  1: a field of one component; else of two

#if CHANNELS == 1
typedef float cell;
typedef float4 cells4;
#define EACH(a, b, c, d) (float4)(a, b, c, d)
#define LOAD4(cells) vload4(0, cells)
#else
typedef float2 cell;
typedef float8 cells4;
#define EACH(a, b, c, d) (float8)(a, a, b, b, c, c, d, d)
#define LOAD4(cells) vload8(0, (__global const float *)(cells))
#endif

// The weights of the cells at -1, 0, 1, 2 are cubics in t. Four cells of a row are one vector, each weight there once
// for each component; what is returned is to be added up over the cells: many samples first, which is cheaper.
inline cells4 spread_sample(__global const cell *field, int pitch, float2 at) {
    // continued, at lies right of and above the first cell: cutting off is rounding down, without the cost of floor
    at += BORDER;
    const int2 low = convert_int2(at);
    const float2 t = at - convert_float2(low);
    const float4 w = ((float4)(-0.5f, 1.5f, -1.5f, 0.5f) * t.y + (float4)(1.0f, -2.5f, 2.0f, -0.5f)) * t.y * t.y +
                     (float4)(-0.5f, 0.0f, 0.5f, 0.0f) * t.y + (float4)(0.0f, 1.0f, 0.0f, 0.0f);
    const cells4 along = (EACH(-0.5f, 1.5f, -1.5f, 0.5f) * t.x + EACH(1.0f, -2.5f, 2.0f, -0.5f)) * t.x * t.x +
                         EACH(-0.5f, 0.0f, 0.5f, 0.0f) * t.x + EACH(0.0f, 1.0f, 0.0f, 0.0f);
    __global const cell *row = field + (low.y - 1) * pitch + low.x - 1;
    return along * (w.x * LOAD4(row) + w.y * LOAD4(row + pitch) + w.z * LOAD4(row + 2 * pitch) +
                    w.w * LOAD4(row + 3 * pitch));
}

#if CHANNELS == 1
inline float added(float4 s) {
    return (s.x + s.y) + (s.z + s.w);
}
#else
inline float2 added(float8 s) {
    return (s.s01 + s.s23) + (s.s45 + s.s67);
}
#endif
