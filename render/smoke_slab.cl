/* Light through a slab of smoke in layers: see smoke_slab.py, whose NumPy functions these kernels must equal.
   Sizes: WIDTH x HEIGHT pixels, x fastest, y up. The stride of rows is PITCH, a multiple of 16 that is not a power of
   two, and that of the LAYERS layers is LAYER: otherwise rows and layers evict each other from the cache. */

#define HERE (y * PITCH + x)
#define LAYER (HEIGHT * PITCH)

/* Optical depth of each layer, front first, and its weight for the eye; 16 pixels at a time. */
kernel void split(global const float *depth, global const float *relief, global float *layers, global float *seen,
                  global float *passed) {
    const int x = get_global_id(0) * 16, y = get_global_id(1);
    const float16 half_thickness = vload16(0, relief + HERE), total = vload16(0, depth + HERE);
    float16 before = (float16)(1.0f), sum = (float16)(0.0f);
    for (int k = 0; k < LAYERS; k++) {
        const float z = fabs(2.0f * (k + 0.5f) / LAYERS - 1.0f);
        const float16 layer = total / LAYERS * clamp((half_thickness - z) * (LAYERS / SOFT_LAYERS) + 0.5f,
                                                     (float16)(0.0f), (float16)(1.0f));
        sum += layer;
        const float16 after = exp(-sum);
        vstore16(layer, 0, layers + k * LAYER + HERE);
        vstore16(before - after, 0, seen + k * LAYER + HERE);
        before = after;
    }
    vstore16(before, 0, passed + HERE);
}

#define INSIDE ((y + PAD) * (WIDTH + 2 * PAD) + x + PAD)

/* One layer of a slanted light: the light that passed the layer before, read at an offset of (ix + fx, iy + fy), is
   added to the picture and attenuated. first, deep: before and after, with a border of PAD pixels of full light. */
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
    const float half_first = exp(-0.5f * slant * layers[k * LAYER + HERE]);
    const float half_deep = sqrt(sqrt(half_first));
    total[HERE] += seen[k * LAYER + HERE] * (first * half_first + deep * half_deep);
    first_out[INSIDE] = first * half_first * half_first;
    deep_out[INSIDE] = deep * half_deep * half_deep;
}

/* One layer of the sky: added to the picture and attenuated ... */
kernel void sink(global const float *layers, global const float *seen, global float *light, global float *total,
                 const int k) {
    const int x = get_global_id(0), y = get_global_id(1);
    if (x >= WIDTH)
        return;
    const float layer = layers[k * LAYER + HERE];
    total[HERE] += seen[k * LAYER + HERE] * light[HERE] * exp(-0.35f * layer);
    light[HERE] *= exp(-0.7f * layer);
}

/* ... then averaged along x, 16 pixels at a time where the window is inside the picture ... */
kernel void spread_x(global const float *light, global float *across) {
    const int x = get_global_id(0) * 16, y = get_global_id(1);
    if (x >= CONE && x + 15 + CONE < WIDTH) {
        float16 sum = (float16)(0.0f);
        for (int s = -CONE; s <= CONE; s++)
            sum += vload16(0, light + HERE + s);
        vstore16(sum / (2 * CONE + 1), 0, across + HERE);
    } else {
        for (int i = x; i < min(x + 16, WIDTH); i++) {
            float sum = 0.0f;
            for (int s = -CONE; s <= CONE; s++)
                sum += light[y * PITCH + clamp(i + s, 0, WIDTH - 1)];
            across[y * PITCH + i] = sum / (2 * CONE + 1);
        }
    }
}

/* ... and along y. */
kernel void spread_y(global const float *across, global float *light) {
    const int x = get_global_id(0) * 16, y = get_global_id(1);
    float16 sum = (float16)(0.0f);
    for (int s = -CONE; s <= CONE; s++)
        sum += vload16(0, across + clamp(y + s, 0, HEIGHT - 1) * PITCH + x);
    vstore16(sum / (2 * CONE + 1), 0, light + HERE);
}
