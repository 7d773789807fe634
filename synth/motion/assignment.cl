// Assignment (ma09 §3.1, the "E-step" of [Kwatra 2005]): each output cell is the weighted average of the
// matches that cover it, each match laid down in the local frame of its site.
// -D RADIUS   half width of the neighbourhoods
// -D SPACING  distance of the sites on their grid
// -D FIRST    position of the first site
// -D BORDER   cells by which the exemplar was continued toroidally on each side

// Catmull-Rom: interpolates (exact at cells) and, unlike linear weights, does not blur between them. Four cells
// of a row are one vector; a, b, c, d weigh the cells at -1, 0, 1, 2 along x and along y.
inline float2 sample(__global const float2 *field, int pitch, float2 at) {
    const float2 low = floor(at), t = at - low;
    const float2 a = 0.5f * ((2.0f - t) * t - 1.0f) * t, b = 0.5f * ((3.0f * t - 5.0f) * t * t + 2.0f);
    const float2 c = 0.5f * ((4.0f - 3.0f * t) * t + 1.0f) * t, d = 0.5f * (t - 1.0f) * t * t;
    const int first = ((int)low.y - 1 + BORDER) * pitch + (int)low.x - 1 + BORDER;
    __global const float *row = (__global const float *)(field + first);
    const float8 sum = a.y * vload8(0, row) + b.y * vload8(0, row + 2 * pitch) + c.y * vload8(0, row + 4 * pitch) +
                       d.y * vload8(0, row + 6 * pitch);
    return a.x * sum.s01 + b.x * sum.s23 + c.x * sum.s45 + d.x * sum.s67;
}

// squared distances (S) of matches -> weights (S) of the robust error
__kernel void robust(__global const float *squared, float scale, float exponent, __global float *weight) {
    const int s = get_global_id(0);
    weight[s] = pow(1.0f + scale * squared[s], exponent);
}

// exemplar continued by BORDER; position (S) where a site's match lies in it; weight (S); axis (S), the frame at
// the sites; falloff: factors of a match's weight at 0, 1, 2... cells from its centre along one axis; prior
// (Y, X): the frame before, warped.
__kernel void average(__global const float2 *exemplar, int pitch, __global const float *falloff,
                      __global const float2 *position, __global const float *weight, __global const float2 *axis,
                      int2 grid, __global const float2 *prior, __global const float *coherence,
                      __global float2 *out) {
    const int x = get_global_id(0), y = get_global_id(1), width = get_global_size(0);
    const float reach = 1.41421357f * RADIUS;
    const int left = max(0, (int)ceil((x - reach - FIRST) / SPACING));
    const int right = min(grid.x - 1, (int)floor((x + reach - FIRST) / SPACING));
    const int bottom = max(0, (int)ceil((y - reach - FIRST) / SPACING));
    const int top = min(grid.y - 1, (int)floor((y + reach - FIRST) / SPACING));
    float2 sum = (float2)(0.0f);
    float total = 0.0f;
    for (int gy = bottom; gy <= top; gy++) {
        const int way_y = y - (gy * SPACING + FIRST);
        for (int gx = left; gx <= right; gx++) {
            const int way_x = x - (gx * SPACING + FIRST), s = gy * grid.x + gx;
            const float2 e = axis[s];
            const float2 o = (float2)(e.x * way_x + e.y * way_y, e.x * way_y - e.y * way_x);
            if (max(fabs(o.x), fabs(o.y)) > RADIUS + 0.001f) continue;
            const float w = falloff[abs(way_x)] * falloff[abs(way_y)] * weight[s];
            sum += w * sample(exemplar, pitch, position[s] + o);
            total += w;
        }
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
