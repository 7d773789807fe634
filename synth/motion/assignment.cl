// Assignment (ma09 §3.1, the "E-step" of [Kwatra 2005]): each output cell is the weighted average of the
// matches that cover it, each match placed along the local axes of its site.
// -D RADIUS   half width of the neighbourhoods
// -D SPACING  distance of the sites on their grid
// -D FIRST    position of the first site
// -D REACH    cells from its centre to its corner, rounded up
// -D BORDER   cells by which the exemplar was continued toroidally on each side
// -D CHANNELS of the fields: 2, vectors, or 1, their potential

#include "motion/sample.h"

// squared distances (S) of matches -> weights (S) of the robust error
__kernel void robust(__global const float *squared, float scale, float exponent, __global float *weight) {
    const int s = get_global_id(0);
    weight[s] = pow(1.0f + scale * squared[s], exponent);
}

// exemplar continued by BORDER; position (S) where a site's match lies in it; weight (S); axis (S), the local x axis
// at the sites; falloff: factors of a match's weight at 0, 1, 2... cells from its centre along one axis; prior
// (Y, X): the frame before, warped.
__kernel void average(__global const cell *exemplar, int pitch, __global const float *falloff,
                      __global const float2 *position, __global const float *weight, __global const float2 *axis,
                      int2 grid, __global const cell *prior, __global const float *coherence,
                      __global cell *out) {
    const int x = get_global_id(0), y = get_global_id(1), width = get_global_size(0);
    // the sites whose neighbourhoods, however rotated, may reach here lie in a circle
    const int bottom = max(0, y - REACH - FIRST + SPACING - 1) / SPACING;
    const int top = min(grid.y - 1, (y + REACH - FIRST) / SPACING);
    cells4 sum = (cells4)(0.0f);
    float total = 0.0f;
    for (int gy = bottom; gy <= top; gy++) {
        const int offset_y = y - (gy * SPACING + FIRST);
        const int half_row = sqrt((float)(REACH * REACH - offset_y * offset_y));
        const int left = max(0, x - half_row - FIRST + SPACING - 1) / SPACING;
        const int right = min(grid.x - 1, (x + half_row - FIRST) / SPACING);
        for (int gx = left; gx <= right; gx++) {
            const int offset_x = x - (gx * SPACING + FIRST), s = gy * grid.x + gx;
            const float2 e = axis[s];
            const float2 o = (float2)(e.x * offset_x + e.y * offset_y, e.x * offset_y - e.y * offset_x);
            if (max(fabs(o.x), fabs(o.y)) > RADIUS + 0.001f) continue;
            const float w = falloff[abs(offset_x)] * falloff[abs(offset_y)] * weight[s];
            sum = fma(w, spread_sample(exemplar, pitch, position[s] + o), sum);
            total += w;
        }
    }
    const cell before = prior[y * width + x];
    const float hold = coherence[y * width + x];
    out[y * width + x] = total > 0.0f ? (added(sum) / total + hold * before) / (1.0f + hold) : before;
}

// The frame before, carried by the flow: field continued by BORDER, displacement (Y, X) to where each cell's
// content comes from. Linear interpolation, a little every frame, would wear the detail down.
__kernel void carry(__global const cell *field, int pitch, __global const float2 *displacement,
                    __global cell *out) {
    const int x = get_global_id(0), y = get_global_id(1), width = get_global_size(0);
    const float2 last = (float2)(width - 1, get_global_size(1) - 1);
    const float2 at = clamp((float2)(x, y) + displacement[y * width + x], (float2)(0.0f), last);
    out[y * width + x] = added(spread_sample(field, pitch, at));
}
