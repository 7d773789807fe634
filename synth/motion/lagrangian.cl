// Detail at scattered samples (ma09 §5, "equally applicable to Lagrangian particles").
// -D RADIUS  half width of the neighbourhoods
// -D BORDER  cells by which the exemplar was continued toroidally on each side
// -D BIN     edge of a square bin, in cells: of samples in `gather`, of sites in `assign`
// -D REACH   cells from its centre as far as a sample is seen
// -D NEAR    squared distance, in cells, below which a sample counts no more

#include "motion/sample.h"

#define SIDE (2 * RADIUS + 1)

inline float sum8(float8 v) {
    const float4 s = v.lo + v.hi;
    return (s.x + s.y) + (s.z + s.w);
}

// The value at a point: the plane fitted to the samples within REACH [moving least squares], nearer ones weighing
// more. Where they lie on one line the plane is level. Samples are sorted by bin, and seen in that order, eight
// together; eight of no meaning follow the last.
// at (P + 8), value (P + 8); first (bins + 1): where each bin's samples begin
inline float2 fitted(__global const float2 *at, __global const float2 *value, __global const int *first, int2 bins,
                     float2 point) {
    const int2 middle = clamp(convert_int2(point / BIN), (int2)(0), bins - 1);
    float8 w_ = (float8)(0.0f), wx = w_, wy = w_, wxx = w_, wxy = w_, wyy = w_;
    float8 u_ = w_, ux = w_, uy = w_, v_ = w_, vx = w_, vy = w_;
    for (int by = max(middle.y - 1, 0); by <= min(middle.y + 1, bins.y - 1); by++) {
        // the three bins of a row lie one after the other
        const int begin = first[by * bins.x + max(middle.x - 1, 0)];
        const int end = first[by * bins.x + min(middle.x + 1, bins.x - 1) + 1];
        for (int p = begin; p < end; p += 8) {
            const float16 places = vload16(0, (__global const float *)(at + p));
            const float16 values = vload16(0, (__global const float *)(value + p));
            const float8 x = places.even - point.x, y = places.odd - point.y;
            const float8 squared = x * x + y * y, rest = max(1.0f - squared / (REACH * REACH), 0.0f);
            const int8 counts = (int8)(0, 1, 2, 3, 4, 5, 6, 7) < end - p;
            const float8 w = select((float8)(0.0f), rest * rest / (squared + NEAR), counts);
            const float8 x_ = w * x, y_ = w * y;
            w_ += w;
            wx += x_;
            wy += y_;
            wxx += x_ * x;
            wxy += x_ * y;
            wyy += y_ * y;
            u_ += w * values.even;
            ux += x_ * values.even;
            uy += y_ * values.even;
            v_ += w * values.odd;
            vx += x_ * values.odd;
            vy += y_ * values.odd;
        }
    }
    const float total = sum8(w_);
    if (!(total > 0.0f)) return (float2)(0.0f);
    // the slopes' 2 x 2 system about the weighted mean of the samples
    const float x = sum8(wx) / total, y = sum8(wy) / total;
    const float xx = sum8(wxx) / total - x * x + NEAR;
    const float xy = sum8(wxy) / total - x * y;
    const float yy = sum8(wyy) / total - y * y + NEAR;
    const float2 mean = (float2)(sum8(u_), sum8(v_)) / total;
    const float2 right_x = (float2)(sum8(ux), sum8(vx)) / total - x * mean;
    const float2 right_y = (float2)(sum8(uy), sum8(vy)) / total - y * mean;
    const float det = xx * yy - xy * xy;
    const float2 slope_x = (yy * right_x - xy * right_y) / det, slope_y = (xx * right_y - xy * right_x) / det;
    return mean - x * slope_x - y * slope_y;
}

// sites (S) float2, axis (S), the local x axis there -> out (S, SIDE, SIDE); points beyond `size` cells are clamped
__kernel void gather(__global const float2 *at, __global const float2 *value, __global const int *first, int2 bins,
                     int2 size, __global const float2 *sites, __global const float2 *axis, __global float2 *out) {
    const int s = get_global_id(0);
    const float2 centre = sites[s], e = axis[s], last = convert_float2(size - 1);
    for (int j = -RADIUS; j <= RADIUS; j++)
        for (int i = -RADIUS; i <= RADIUS; i++) {
            const float2 point = clamp(centre + (float2)(e.x * i - e.y * j, e.y * i + e.x * j), (float2)(0.0f), last);
            out[(s * SIDE + j + RADIUS) * SIDE + i + RADIUS] = fitted(at, value, first, bins, point);
        }
}

// Each sample (P) becomes the weighted average of the matches that cover it, as cells do in `average`.
// sites (S) sorted by bin, position (S) of their matches in the exemplar, weight (S), axis (S); first (bins + 1)
__kernel void assign(__global const float2 *exemplar, int pitch, float falloff, __global const float2 *sites,
                     __global const float2 *position, __global const float *weight, __global const float2 *axis,
                     __global const int *first, int2 bins, __global const float2 *at, __global const float2 *prior,
                     __global const float *coherence, __global float2 *out) {
    const int p = get_global_id(0);
    const float2 point = at[p];
    const int2 middle = clamp(convert_int2(point / BIN), (int2)(0), bins - 1);
    float8 sum = (float8)(0.0f);
    float total = 0.0f;
    for (int by = max(middle.y - 1, 0); by <= min(middle.y + 1, bins.y - 1); by++) {
        const int begin = first[by * bins.x + max(middle.x - 1, 0)];
        const int end = first[by * bins.x + min(middle.x + 1, bins.x - 1) + 1];
        for (int s = begin; s < end; s++) {
            const float2 e = axis[s], offset = point - sites[s];
            const float2 o = (float2)(e.x * offset.x + e.y * offset.y, e.x * offset.y - e.y * offset.x);
            if (max(fabs(o.x), fabs(o.y)) > RADIUS) continue;
            const float w = exp(-falloff * dot(o, o)) * weight[s];
            sum = fma(w, spread_sample(exemplar, pitch, position[s] + o), sum);
            total += w;
        }
    }
    const float hold = coherence[p];
    out[p] = total > 0.0f ? (added(sum) / total + hold * prior[p]) / (1.0f + hold) : prior[p];
}
