/* Light transport in smoke without noise: see march.py, whose NumPy functions these kernels must equal.

   A grid is (Z, Y, X), x fastest. `arrive` and `sweep` cross it plane by plane, away from the light: axis m is
   normal to the planes, a and b lie in them, each with a count of cells and a stride. */

/* One plane of `arriving`: the optical depth to a point of a lamp, and the light that arrives from there in cells
   with smoke. Points are (m, a, b) in cells; sign: direction along m to the lamp; facing: the lamp's normal;
   area: of the lamp, cells squared, over 4 pi. */
kernel void arrive(global const float *sigma, global float *depth, global float *seen, global float *spread,
                   const int m, const int sign, const int nm, const int na, const int nb,
                   const int sm, const int sa, const int sb, const float lamp_m, const float lamp_a,
                   const float lamp_b, const float facing_m, const float facing_a, const float facing_b,
                   const float eye_m, const float eye_a, const float eye_b, const float area,
                   const float forward, const float reduced) {
    const int b = get_global_id(0), a = get_global_id(1);
    if (b >= nb)
        return;
    const int here = m * sm + a * sa + b * sb;
    const float wm = lamp_m - m, wa = lamp_a - a, wb = lamp_b - b;
    const float distance_to_lamp = sqrt(wm * wm + wa * wa + wb * wb);
    float sum = 0.0f;
    if (m + sign >= 0 && m + sign < nm) {
        const float pa = a + wa / fabs(wm), pb = b + wb / fabs(wm);
        const float floor_a = floor(pa), floor_b = floor(pb);
        const float fa = pa - floor_a, fb = pb - floor_b;
        const int ia = (int)floor_a, ib = (int)floor_b;
        const float half_step = 0.5f * distance_to_lamp / fabs(wm);
        const int a0 = clamp(ia, 0, na - 1) * sa, a1 = clamp(ia + 1, 0, na - 1) * sa;
        const int b0 = clamp(ib, 0, nb - 1) * sb, b1 = clamp(ib + 1, 0, nb - 1) * sb;
        const float wa0 = ia >= 0 && ia < na ? 1 - fa : 0.0f, wa1 = ia >= -1 && ia < na - 1 ? fa : 0.0f;
        const float wb0 = ib >= 0 && ib < nb ? 1 - fb : 0.0f, wb1 = ib >= -1 && ib < nb - 1 ? fb : 0.0f;
        global const float *deep = depth + (m + sign) * sm, *thick = sigma + (m + sign) * sm;
        const float before = wa0 * (wb0 * deep[a0 + b0] + wb1 * deep[a0 + b1])
            + wa1 * (wb0 * deep[a1 + b0] + wb1 * deep[a1 + b1]);
        const float there = wa0 * (wb0 * thick[a0 + b0] + wb1 * thick[a0 + b1])
            + wa1 * (wb0 * thick[a1 + b0] + wb1 * thick[a1 + b1]);
        sum = before + half_step * (there + sigma[here]);
    }
    depth[here] = sum;
    if (sigma[here] == 0.0f)
        return;
    const float em = eye_m - m, ea = eye_a - a, eb = eye_b - b;
    const float cosine = -(wm * em + wa * ea + wb * eb) / (distance_to_lamp * sqrt(em * em + ea * ea + eb * eb));
    const float base = 1 + forward * forward - 2 * forward * cosine;
    const float phase = (1 - forward * forward) / (base * sqrt(base));
    const float angle = area * fabs(wm * facing_m + wa * facing_a + wb * facing_b)
        / (distance_to_lamp * distance_to_lamp * distance_to_lamp);
    const float passed = exp(-sum), passed_reduced = exp(-reduced * sum);
    seen[here] += angle * (phase * passed + passed_reduced - passed);
    spread[here] += angle * passed_reduced;
}

/* Adds the light of one lamp in its colour. */
kernel void tint(global const float *light, global float4 *total, const int count, const float red,
                 const float green, const float blue) {
    const int i = get_global_id(0);
    if (i < count)
        total[i] += light[i] * (float4)(red, green, blue, 0.0f);
}

/* Extinction and light at half the resolution: means over 2 x 2 x 2 cells, the light weighted by extinction.
   A coarse cell is twice as wide, so its extinction is twice the mean. (hx, hy): size of the coarse grid. */
kernel void halve(global const float *sigma, global const float4 *light, global float *half_sigma,
                  global float4 *half_light, const int hx, const int hy, const int nx, const int ny, const int nz,
                  const float share) {
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    if (x >= hx)
        return;
    float depth = 0.0f;
    float4 seen = 0.0f;
    for (int corner = 0; corner < 8; corner++) {
        const int cx = 2 * x + (corner & 1), cy = 2 * y + (corner >> 1 & 1), cz = 2 * z + (corner >> 2);
        if (cx < nx && cy < ny && cz < nz) {
            const int i = (cz * ny + cy) * nx + cx;
            depth += sigma[i];
            seen += sigma[i] * light[i];
        }
    }
    const int here = (z * hy + y) * hx + x;
    half_sigma[here] = 0.25f * share * depth;
    half_light[here] = depth > 0.0f ? seen / depth : 0.0f;
}

/* The light that each cell scatters times its extinction, which is the fourth component; cells as a flat array. */
kernel void send(global const float *sigma, global const float4 *direct, global const float4 *arrived,
                 global float4 *sent, const int count, const float red, const float green, const float blue) {
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const float4 light = direct[i] + arrived[i];
    sent[i] = sigma[i] * (float4)(light.x * red, light.y * green, light.z * blue, 1.0f);
}

/* One plane of `scattered`: the light that arrives from four directions, (+-slope, +-slope) from plane to plane.
   before, after: its values in the last and in this plane, one direction after the other; border: from outside. */
kernel void sweep(global const float4 *sent, global const float4 *before, global float4 *after,
                  global float4 *arrived, constant float4 *border, const int m, const int sign, const int nm,
                  const int na, const int nb, const int sm, const int sa, const int sb, const float slope,
                  const float half_step, const float share) {
    const int b = get_global_id(0), a = get_global_id(1);
    if (b >= nb)
        return;
    const int here = m * sm + a * sa + b * sb, plane = na * nb, place = a * nb + b;
    const bool first = m + sign < 0 || m + sign >= nm;
    const float4 sent_here = sent[here];
    float4 sum = 0.0f;
    for (int quadrant = 0; quadrant < 4; quadrant++) {
        const int da = quadrant >> 1 ? 1 : -1, db = quadrant & 1 ? 1 : -1;
        float4 light = border[quadrant];
        if (!first) {
            float4 there = 0.0f, arriving = 0.0f;
            for (int corner = 0; corner < 4; corner++) {
                const int ca = a + (corner >> 1 ? da : 0), cb = b + (corner & 1 ? db : 0);
                const float weight = (corner >> 1 ? slope : 1 - slope) * (corner & 1 ? slope : 1 - slope);
                const bool inside = ca >= 0 && cb >= 0 && ca < na && cb < nb;
                const int ia = clamp(ca, 0, na - 1), ib = clamp(cb, 0, nb - 1);
                arriving += weight * (inside ? before[quadrant * plane + ia * nb + ib] : border[quadrant]);
                there += (inside ? weight : 0.0f) * sent[(m + sign) * sm + ia * sa + ib * sb];
            }
            const float depth = half_step * (sent_here.w + there.w), passed = exp(-depth);
            const float mean = depth > 1e-3f ? (1 - passed) / depth : 1 - 0.5f * depth;
            const float near = sent_here.w > 0.0f ? (there.w > 0.0f ? 1 - mean : 1 - passed) / sent_here.w : 0.0f;
            const float far = there.w > 0.0f ? (sent_here.w > 0.0f ? mean - passed : 1 - passed) / there.w : 0.0f;
            light = passed * arriving + near * sent_here + far * there;
        }
        after[quadrant * plane + place] = light;
        sum += light;
    }
    arrived[here] += share * sum;
}

/* `name`(values, where): linear, clamped at the border. */
#define INTERPOLATE(name, type)                                                                                   \
    type name(global const type *values, const float3 where, const int nx, const int ny, const int nz) {           \
        const float x = clamp(where.x, 0.0f, nx - 1.0f), y = clamp(where.y, 0.0f, ny - 1.0f);                      \
        const float z = clamp(where.z, 0.0f, nz - 1.0f);                                                           \
        const int ix = clamp((int)x, 0, max(nx - 2, 0)), iy = clamp((int)y, 0, max(ny - 2, 0));                    \
        const int iz = clamp((int)z, 0, max(nz - 2, 0));                                                           \
        const float fx = x - ix, fy = y - iy, fz = z - iz;                                                         \
        const int east = nx > 1, up = ny > 1 ? nx : 0;                                                             \
        global const type *low = values + (iz * ny + iy) * nx + ix, *high = low + (nz > 1 ? nx * ny : 0);          \
        const type bottom = (1 - fy) * ((1 - fx) * low[0] + fx * low[east])                                        \
            + fy * ((1 - fx) * low[up] + fx * low[up + east]);                                                     \
        const type top = (1 - fy) * ((1 - fx) * high[0] + fx * high[east])                                         \
            + fy * ((1 - fx) * high[up] + fx * high[up + east]);                                                   \
        return (1 - fz) * bottom + fz * top;                                                                       \
    }
INTERPOLATE(at, float4)
INTERPOLATE(at_one, float)

/* `coarse` on cells half as large, of which there are nx x ny x nz. */
kernel void refine(global const float4 *coarse, global float4 *fine, const int nx, const int ny, const int hx,
                   const int hy, const int hz) {
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    if (x < nx)
        fine[(z * ny + y) * nx + x] = at(coarse, 0.5f * ((float3)(x, y, z) - 0.5f), hx, hy, hz);
}

/* Where a ray is inside the grid: (entry, exit) along it, exit before entry if nowhere. */
float2 crossing(const float3 start, const float3 ray, const float end, const int nx, const int ny, const int nz) {
    const float3 safe = select(ray, (float3)(1e-12f), fabs(ray) < 1e-12f);
    const float3 low = (-0.5f - start) / safe, high = ((float3)(nx, ny, nz) - 0.5f - start) / safe;
    const float3 near = fmin(low, high), far = fmax(low, high);
    return (float2)(fmax(fmax(near.x, near.y), fmax(near.z, 0.0f)), fmin(fmin(far.x, far.y), fmin(far.z, end)));
}

/* The light of the smoke along each ray, and the transmittance (the fourth component).
   source: light times extinction, and extinction; rays: unit vectors in cells, and their lengths. */
kernel void radiance(global const float4 *source, global const float4 *rays, global float4 *result, const int count,
                     const int nx, const int ny, const int nz, const float start_x, const float start_y,
                     const float start_z, const float step) {
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const float3 start = (float3)(start_x, start_y, start_z), ray = rays[i].xyz;
    const float2 span = crossing(start, ray, rays[i].w, nx, ny, nz);
    float3 light = 0.0f;
    float passed = 1.0f;
    for (int k = (int)(span.x / step); fmax(k * step, span.x) < span.y && passed > LEAST; k++) {
        const float from = fmax(k * step, span.x), until = fmin((k + 1) * step, span.y);
        const float4 there = at(source, start + 0.5f * (from + until) * ray, nx, ny, nz);
        if (there.w > 0.0f) {
            const float through = exp(-there.w * (until - from));
            light += passed * (1 - through) / there.w * there.xyz;
            passed *= through;
        }
    }
    result[i] = (float4)(light, passed);
}

/* Mean transmittance from each place to the points of a lamp; places and points in cells. */
kernel void shade(global const float *sigma, global const float4 *places, constant float4 *points,
                  global float *result, const int count, const int points_count, const int nx, const int ny,
                  const int nz, const float step) {
    const int i = get_global_id(0);
    if (i >= count)
        return;
    const float3 start = places[i].xyz;
    float sum = 0.0f;
    for (int p = 0; p < points_count; p++) {
        const float3 offset = points[p].xyz - start;
        const float end = length(offset);
        const float3 ray = offset / end;
        const float2 span = crossing(start, ray, end, nx, ny, nz);
        float depth = 0.0f;
        for (int k = (int)(span.x / step); fmax(k * step, span.x) < span.y; k++) {
            const float from = fmax(k * step, span.x), until = fmin((k + 1) * step, span.y);
            depth += (until - from) * at_one(sigma, start + 0.5f * (from + until) * ray, nx, ny, nz);
        }
        sum += exp(-depth);
    }
    result[i] = sum / points_count;
}
