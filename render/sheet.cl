/* Light through a sheet of smoke in layers: see sheet.py, whose NumPy functions these kernels must equal.
   Sizes: WIDTH x HEIGHT pixels, x fastest, y up; LAYERS layers, each HEIGHT * WIDTH apart. */

#define HERE (y * WIDTH + x)

/* Optical depth of each layer, front first, and the weight with which the eye sees it. */
kernel void split(global const float *depth, global const float *relief, global float *layers, global float *seen,
                  global float *passed) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= WIDTH)
        return;
    const float half_thickness = relief[HERE], whole = depth[HERE];
    float before = 1.0f, sum = 0.0f;
    for (int k = 0; k < LAYERS; k++) {
        const float z = fabs(2.0f * (k + 0.5f) / LAYERS - 1.0f);
        const float layer = whole / LAYERS * clamp((half_thickness - z) * (LAYERS / SOFT_LAYERS) + 0.5f, 0.0f, 1.0f);
        sum += layer;
        const float after = exp(-sum);
        layers[k * HEIGHT * WIDTH + HERE] = layer;
        seen[k * HEIGHT * WIDTH + HERE] = before - after;
        before = after;
    }
    passed[HERE] = before;
}

#define INSIDE ((y + PAD) * (WIDTH + 2 * PAD) + x + PAD)

/* One layer of a slanted light: what the layer before let through, read at an offset of (ix + fx, iy + fy), is
   seen and dimmed. first, deep: light before and after this layer, with a border of PAD pixels of full light. */
kernel void traverse(global const float *layers, global const float *seen, global const float *first_in,
                     global const float *deep_in, global float *first_out, global float *deep_out,
                     global float *total, const int k, const int ix, const int iy, const float fx, const float fy,
                     const float slant) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= WIDTH)
        return;
    const int low = INSIDE + iy * (WIDTH + 2 * PAD) + ix, high = low + WIDTH + 2 * PAD;
    const float first = (first_in[low] * (1 - fx) + first_in[low + 1] * fx) * (1 - fy)
        + (first_in[high] * (1 - fx) + first_in[high + 1] * fx) * fy;
    const float deep = (deep_in[low] * (1 - fx) + deep_in[low + 1] * fx) * (1 - fy)
        + (deep_in[high] * (1 - fx) + deep_in[high + 1] * fx) * fy;
    const float half_first = exp(-0.5f * slant * layers[k * HEIGHT * WIDTH + HERE]);
    const float half_deep = sqrt(sqrt(half_first));
    total[HERE] += seen[k * HEIGHT * WIDTH + HERE] * (first * half_first + deep * half_deep);
    first_out[INSIDE] = first * half_first * half_first;
    deep_out[INSIDE] = deep * half_deep * half_deep;
}

/* One layer of the sky: seen and dimmed ... */
kernel void sink(global const float *layers, global const float *seen, global float *light, global float *total,
                 const int k) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= WIDTH)
        return;
    const float layer = layers[k * HEIGHT * WIDTH + HERE];
    total[HERE] += seen[k * HEIGHT * WIDTH + HERE] * light[HERE] * exp(-0.35f * layer);
    light[HERE] *= exp(-0.7f * layer);
}

/* ... then averaged along x ... */
kernel void spread_x(global const float *light, global float *across) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= WIDTH)
        return;
    float sum = 0.0f;
    for (int s = -CONE; s <= CONE; s++)
        sum += light[y * WIDTH + clamp(x + s, 0, WIDTH - 1)];
    across[HERE] = sum / (2 * CONE + 1);
}

/* ... and along y. */
kernel void spread_y(global const float *across, global float *light) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= WIDTH)
        return;
    float sum = 0.0f;
    for (int s = -CONE; s <= CONE; s++)
        sum += across[clamp(y + s, 0, HEIGHT - 1) * WIDTH + x];
    light[HERE] = sum / (2 * CONE + 1);
}
