// Droplets as streaks of light; drops_reference in drops.py is the specification.
//
// The sums are of integers: in whatever order the work-items add, the bits are the same.

#pragma OPENCL FP_CONTRACT OFF

// where a droplet of this velocity, gravity and drag has come after `age` frames, along one axis
inline float path(float x, float v, float g, float drag, float age) {
    float decayed = (1.0f - exp(-drag * age)) / drag;
    return x + (g / drag) * age + (v - g / drag) * decayed;
}

// drops (n, 11): x, y, velocity x, y, gravity x, y, drag, birth, life, weight, fade; light (frames, height, width) in UNITs
__kernel void streaks(__global const float *drops, __global int *light, int count, int frames, float shutter,
                      int width, int height) {
    int i = get_global_id(0), t = get_global_id(1);
    if (i >= count) return;
    __global const float *d = drops + 11 * i;
    float age = t - d[7];
    age -= frames * floor(age / frames);
    for (; age < d[8]; age += frames) {
        float open = fmax(age - shutter, 0.0f);
        float x0 = path(d[0], d[2], d[4], d[6], open), x1 = path(d[0], d[2], d[4], d[6], age);
        float y0 = path(d[1], d[3], d[5], d[6], open), y1 = path(d[1], d[3], d[5], d[6], age);
        int samples = min(1 + (int)(fmax(fabs(x1 - x0), fabs(y1 - y0)) * 1.5f), MOST);
        float fading = fmin(1.0f, (d[8] - age) / (d[10] * d[8]));
        float share = d[9] * fading * UNIT / samples;
        for (int k = 0; k < samples; k++) {
            float s = (k + 0.5f) / samples;
            float x = x0 + s * (x1 - x0), y = y0 + s * (y1 - y0);
            float fx = floor(x), fy = floor(y);
            float tx = x - fx, ty = y - fy;
            int column = (int)fx, row = (int)fy;
            for (int corner = 0; corner < 4; corner++) {
                int c = column + (corner & 1), r = row + (corner >> 1);
                float part = ((corner & 1) ? tx : 1.0f - tx) * ((corner >> 1) ? ty : 1.0f - ty);
                if (c >= 0 && c < width && r >= 0 && r < height)
                    atomic_add(light + ((size_t)t * height + r) * width + c, (int)(share * part + 0.5f));
            }
        }
    }
}
