// A photograph carried along the motion; carried_reference in photograph.py is the specification. Defines: LIVES, STARTS.

#pragma OPENCL FP_CONTRACT OFF

// Catmull-Rom's weight at distance t from a pixel.
inline float cubic(float t) {
    t = fabs(t);
    return t < 1.0f ? (1.5f * t - 2.5f) * t * t + 1.0f : t < 2.0f ? ((2.5f - 0.5f * t) * t - 4.0f) * t + 2.0f : 0.0f;
}

// detail (height, width, 4) between pixels; the border's pixels go on beyond it.
inline float4 between(__global const float4 *detail, int width, int height, float2 at) {
    float2 low = floor(at);
    int x = (int)low.x, y = (int)low.y;
    float4 total = 0.0f;
    for (int j = -1; j <= 2; j++) {
        __global const float4 *row = detail + clamp(y + j, 0, height - 1) * width;
        float4 along = 0.0f;
        for (int i = -1; i <= 2; i++) along += cubic(at.x - low.x - i) * row[clamp(x + i, 0, width - 1)];
        total += cubic(at.y - low.y - j) * along;
    }
    return total;
}

// One frame (height, width, 4). where (ages, height, width, 2): where a pixel was, each frame before. pixels (height,
// width, 4): how many of its lives the first copy has lived at frame 0; the pixel's life, a number between those of
// lives (LIVES frames each, falling); how far copies begin from it; 0. starts (LIVES, 2, STARTS, 2): where to, for each
// life of a copy in turn. own: pixels over which detail is like itself.
__kernel void carried(__global const float4 *detail, __global const float2 *where, __global const float4 *pixels,
                      __global const float *lives, __global const float2 *starts, __global float4 *out, float frame,
                      float length, float own, int width, int height) {
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= width) return;
    size_t pixel = (size_t)y * width + x, all = (size_t)width * height;
    float turn = pixels[pixel].x, place = pixels[pixel].y, far = pixels[pixel].z;
    int longer = min((int)place, LIVES - 2);
    float part = place - longer;
    float2 from[4];
    float weight[4];
    float4 total = 0.0f;
    for (int c = 0; c < 4; c++) {
        float life = lives[longer + c / 2];
        float lived = turn + frame / life + 0.5f * (c % 2);
        int number = (int)lived % (int)rint(length / life);
        lived -= floor(lived);
        float age = lived * life;
        int low = (int)age;
        float t = age - low;
        from[c] = (1.0f - t) * where[low * all + pixel] + t * where[(low + 1) * all + pixel]
                + far * starts[((longer + c / 2) * 2 + c % 2) * STARTS + number];
        float rise = 1.0f - fabs(2.0f * lived - 1.0f);
        weight[c] = sqrt((c < 2 ? 1.0f - part : part) * rise * rise * (3.0f - 2.0f * rise));
        if (weight[c] > 0.0f) total += weight[c] * between(detail, width, height, from[c]);
    }
    // copies from nearly the same place add up, others do not
    float power = 0.0f;
    for (int c = 0; c < 4; c++)
        for (int d = 0; d < 4; d++) {
            float2 apart = (from[c] - from[d]) / own;
            float near = 1.0f / (1.0f + apart.x * apart.x + apart.y * apart.y);
            power += weight[c] * weight[d] * near * near;
        }
    out[pixel] = total / sqrt(power);
}
