// Assignment (ma09 §3.1, the "E-step" of [Kwatra 2005]): each output cell is the weighted average of the
// matches that cover it, each match laid down in the local frame of its site.
// -D RADIUS   half width of the neighbourhoods
// -D SPACING  distance of the sites on their grid
// -D FIRST    position of the first site
// -D BORDER   cells by which the exemplar was continued toroidally on each side

// Catmull-Rom: interpolates (exact at cells) and, unlike linear weights, does not blur between them
inline float4 catmull_rom(float t) {
    return 0.5f * (float4)(((2.0f - t) * t - 1.0f) * t, (3.0f * t - 5.0f) * t * t + 2.0f,
                           ((4.0f - 3.0f * t) * t + 1.0f) * t, (t - 1.0f) * t * t);
}

inline float2 sample(__global const float2 *exemplar, int pitch, float2 at) {
    const float2 low = floor(at);
    const float4 wx = catmull_rom(at.x - low.x), wy = catmull_rom(at.y - low.y);
    __global const float2 *e = exemplar + ((int)low.y - 1 + BORDER) * pitch + (int)low.x - 1 + BORDER;
    float2 sum = wy.x * (wx.x * e[0] + wx.y * e[1] + wx.z * e[2] + wx.w * e[3]);
    e += pitch;
    sum += wy.y * (wx.x * e[0] + wx.y * e[1] + wx.z * e[2] + wx.w * e[3]);
    e += pitch;
    sum += wy.z * (wx.x * e[0] + wx.y * e[1] + wx.z * e[2] + wx.w * e[3]);
    e += pitch;
    return sum + wy.w * (wx.x * e[0] + wx.y * e[1] + wx.z * e[2] + wx.w * e[3]);
}

// exemplar continued by BORDER; position (S) where a site's match lies in it; weight (S); axis (S), the frame at
// the sites; prior (Y, X): the frame before, warped.
__kernel void average(__global const float2 *exemplar, int pitch, __global const float2 *position,
                      __global const float *weight, __global const float2 *axis, int2 grid, float falloff,
                      __global const float2 *prior, __global const float *coherence,
                      __global float2 *out) {
    const int x = get_global_id(0), y = get_global_id(1), width = get_global_size(0);
    const float reach = 1.41421357f * RADIUS;
    const int left = max(0, (int)ceil((x - reach - FIRST) / SPACING));
    const int right = min(grid.x - 1, (int)floor((x + reach - FIRST) / SPACING));
    const int bottom = max(0, (int)ceil((y - reach - FIRST) / SPACING));
    const int top = min(grid.y - 1, (int)floor((y + reach - FIRST) / SPACING));
    float2 sum = (float2)(0.0f);
    float total = 0.0f;
    for (int gy = bottom; gy <= top; gy++)
        for (int gx = left; gx <= right; gx++) {
            const int s = gy * grid.x + gx;
            const float2 way = (float2)(x - (gx * SPACING + FIRST), y - (gy * SPACING + FIRST));
            const float2 e = axis[s];
            const float2 o = (float2)(e.x * way.x + e.y * way.y, e.x * way.y - e.y * way.x);
            if (max(fabs(o.x), fabs(o.y)) > RADIUS + 0.001f) continue;
            const float g = exp(-falloff * dot(o, o));
            sum += g * weight[s] * sample(exemplar, pitch, position[s] + o);
            total += g * weight[s];
        }
    const float2 before = prior[y * width + x];
    const float hold = coherence[y * width + x];
    out[y * width + x] = total > 0.0f ? (sum / total + hold * before) / (1.0f + hold) : before;
}

// The frame before, carried by the flow: field continued by BORDER, displacement (Y, X) to where each cell's
// content comes from. Linear interpolation, a little every frame, would wear the detail down.
__kernel void carry(__global const float2 *field, int pitch, __global const float2 *displacement,
                    __global float2 *out) {
    const int x = get_global_id(0), y = get_global_id(1), width = get_global_size(0);
    const float2 last = (float2)(width - 1, get_global_size(1) - 1);
    const float2 at = clamp((float2)(x, y) + displacement[y * width + x], (float2)(0.0f), last);
    out[y * width + x] = sample(field, pitch, at);
}
