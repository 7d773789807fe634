// Patches that carry places in the sample: where they lie, what they cover, what they show, what continues them.
// Gather only. patches.py holds the NumPy references, which these kernels match bit for bit where they say so.
//
//   -DCHANNELS  of the sample that is drawn: 1 where it is grey, else 3
//   -DMASKED    1 where pixels without texture are given, else 0
//   -DREACH2    square of a patch's reach, over its radius squared
//   -DALONG     what a patch's squared extent along the flow counts: 1 / elongation; -DACROSS: elongation
//   -DFINE      places of the enlarged sample in a pixel of the sample
//   -DTILE      16: the edge of a tile; the lanes of a work-item are a row of it, or its 4 x 4 sites
//   -DFIELDS    floats of a patch in its table

#pragma OPENCL FP_CONTRACT OFF  // a fused multiply-add would round differently from the reference

#define NEVER 1e30f
#define FARTHEST 1e29f  // where nothing reaches, even that lies far behind
#define LANES (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)

// A patch's table: fraction of its centre beyond its cell, axis t, bends, anchor in the sample, 1 / r^2, steepness,
// what growth has still to add, the same a frame earlier, radius, square of the distance up to which nothing hides it.
enum { FX, FY, TX, TY, BEND_T, BEND_N, AX, AY, INVERSE, STEEP, BIAS, BEFORE, RADIUS, NEAR };

inline int16 whole16(float16 v) {
    const int16 towards_zero = convert_int16(v);
    // true is -1 in a vector
    return towards_zero + (v < convert_float16(towards_zero));
}

inline int whole(float v) {
    const int towards_zero = (int)v;
    return towards_zero - (v < (float)towards_zero);
}

#if MASKED
#define CLEAR(i, j) clear[clamp(j, 0, size.y - 1) * size.x + clamp(i, 0, size.x - 1)]
#define OPEN(i, j) (CLEAR(i, j) > 0.0f)

// Whether no masked pixel lies between place (x + gx, y + gy) and that plus (dx, dy): half-pixel steps; a step over a
// corner needs both pixels beside it. Beyond the picture its border's pixels go on. `clear` is how far each pixel is
// from the nearest masked one: steps that stay nearer than that are not looked at, which changes nothing.
inline bool sees(global const float *restrict clear, int2 size, int x, int y, float gx, float gy, float dx, float dy) {
    const int steps = 2 * ((int)fmax(fabs(dx), fabs(dy)) + 1);
    int px = x + whole(gx + 0.5f), py = y + whole(gy + 0.5f);
    if (!OPEN(px, py)) return false;
    for (int k = 1; k <= steps; k++) {
        // a step is at most 0.71 pixels long; 3 for what rounding adds, and the corners
        const int free = min((int)(1.4f * (CLEAR(px, py) - 3.0f)), steps - k);
        k += max(free, 0);
        const float f = (float)k / (float)steps;
        const int i = x + whole(gx + dx * f + 0.5f), j = y + whole(gy + dy * f + 0.5f);
        if (!OPEN(i, j)) return false;
        if (free <= 0 && i != px && j != py && !(OPEN(px, j) && OPEN(i, py))) return false;
        px = i;
        py = j;
    }
    return true;
}

// Of the lanes where `asked`, those that see the patch's centre from (x + gx, y + gy); (dx, dy) leads from the centre.
inline int16 seen(global const float *restrict clear, int2 size, int16 asked, int16 x, int16 y, float16 gx, float16 gy,
                  float16 dx, float16 dy) {
    int ask[16], xs[16], ys[16];
    float gxs[16], gys[16], dxs[16], dys[16];
    vstore16(asked, 0, ask);
    vstore16(x, 0, xs);
    vstore16(y, 0, ys);
    vstore16(gx, 0, gxs);
    vstore16(gy, 0, gys);
    vstore16(dx, 0, dxs);
    vstore16(dy, 0, dys);
    for (int l = 0; l < 16; l++)
        if (ask[l]) ask[l] = sees(clear, size, xs[l], ys[l], gxs[l], gys[l], -dxs[l], -dys[l]) ? -1 : 0;
    return vload16(0, ask);
}
#endif

// How far places (s, m) in a patch's axes are from it, in the measure that the nearest patch wins; NEVER out of reach.
inline float16 remoteness(float16 s, float16 m, global const float *restrict p, float bias) {
    const float16 rho = (s * s * ALONG + m * m * ACROSS) * p[INVERSE];
    const float16 t = rho * (1.0f / REACH2), t2 = t * t;
    const float16 e = p[STEEP] * rho + bias + t2 * t2 / (1.0f - t);
    return select((float16)(NEVER), e, t < 1.0f);
}

// The weight of a patch that is `behind` the nearest one by so much.
inline float16 weight(float16 behind) {
    const float16 left = fmax(1.0f - 0.25f * behind, 0.0f), squared = left * left;
    return squared * squared;
}

// The place in the sample that a patch shows at (s, m), in pixels of the sample, folded back at its edges.
inline void place(float16 s, float16 m, global const float *restrict p, float2 turn, float2 last, float16 *x,
                  float16 *y) {
    const float16 u = s + p[BEND_T] * s * m + 0.5f * p[BEND_N] * m * m;
    const float16 v = m - 0.5f * p[BEND_T] * s * s - p[BEND_N] * s * m;
    const float16 i = fabs(p[AX] + (turn.x * u - turn.y * v));
    const float16 j = fabs(p[AY] + (turn.y * u + turn.x * v));
    *x = fmax(last.x - fabs(last.x - i), 0.0f);
    *y = fmax(last.y - fabs(last.y - j), 0.0f);
}

// Where (U, V) lies in a patch's axes (s, m): the inverse of its bend, by four steps.
inline void unbent(float16 U, float16 V, global const float *restrict p, float16 *s, float16 *m) {
    *s = U;
    *m = V;
    for (int step = 0; step < 4; step++) {
        const float16 next = U - p[BEND_T] * *s * *m - 0.5f * p[BEND_N] * *m * *m;
        *m = V + 0.5f * p[BEND_T] * *s * *s + p[BEND_N] * *s * *m;
        *s = next;
    }
}

// The enlarged sample, (rows, columns, COUNT) with 4 bytes a value, at places in pixels of the sample: bilinear.
#define READ_(COUNT)                                                                                              \
    inline void read##COUNT(global const float *restrict sample, int columns, int rows, float16 x, float16 y,     \
                            float16 *out) {                                                                       \
        const float16 fx = x * (float)FINE, fy = y * (float)FINE;                                                 \
        const int16 i = min(convert_int16(fx), columns - 2), j = min(convert_int16(fy), rows - 2);                \
        const float16 u = fx - convert_float16(i), v = fy - convert_float16(j);                                   \
        int at[16];                                                                                               \
        vstore16(j * columns + i, 0, at);                                                                         \
        float a[COUNT][16], b[COUNT][16], c[COUNT][16], d[COUNT][16];                                             \
        for (int l = 0; l < 16; l++) {                                                                            \
            global const float *q = sample + at[l] * COUNT, *above = q + columns * COUNT;                         \
            for (int k = 0; k < COUNT; k++) {                                                                     \
                a[k][l] = q[k];                                                                                   \
                b[k][l] = q[k + COUNT];                                                                           \
                c[k][l] = above[k];                                                                               \
                d[k][l] = above[k + COUNT];                                                                       \
            }                                                                                                     \
        }                                                                                                         \
        for (int k = 0; k < COUNT; k++) {                                                                         \
            const float16 left = vload16(0, a[k]), high = vload16(0, c[k]);                                       \
            const float16 low = left + u * (vload16(0, b[k]) - left);                                             \
            out[k] = low + v * ((high + u * (vload16(0, d[k]) - high)) - low);                                    \
        }                                                                                                         \
    }
#define READ(n) READ_(n)
READ(1)
#if CHANNELS != 1
READ(CHANNELS)
#endif
#define READ_COLOUR_(n) read##n
#define READ_COLOUR(n) READ_COLOUR_(n)

// What every kernel that runs over the pixels of a tile needs: one work-item is 16 pixels of a row.
#define TILED                                                                                                     \
    const int column = get_global_id(0), y = get_global_id(1), x = column * TILE;                                 \
    if (y >= size.y) return;                                                                                      \
    const int tile = (y / TILE + 1) * (size.x / TILE + (size.x % TILE != 0) + 2) + column + 1;                    \
    const int first = starts[tile], end = starts[tile + 1]

// From the centre of patch k to the 16 pixels, and the same in the patch's axes.
#define FROM_CENTRE                                                                                               \
    global const float *restrict p = patches + members[k] * FIELDS;                                               \
    const int2 cell = cells[members[k]];                                                                          \
    const float16 dx = (convert_float(x - cell.x) + LANES) - p[FX];                                               \
    const float dy = convert_float(y - cell.y) - p[FY];                                                           \
    const float16 s = dx * p[TX] + dy * p[TY], m = dy * p[TX] - dx * p[TY]

#if MASKED
// `e` where the patch is not seen is NEVER; only lanes are asked where it would count.
#define HIDE(e, counts)                                                                                           \
    if (p[NEAR] < NEVER) {                                                                                        \
        const int16 asked = (e < NEVER) & (dx * dx + dy * dy > p[NEAR]) & (counts);                               \
        if (any(asked))                                                                                           \
            e = select(e, (float16)(NEVER), asked & ~seen(clear, size, asked, x + convert_int16(LANES), (int16)(y), \
                       (float16)(0.0f), (float16)(0.0f), dx, (float16)(dy)));                                     \
    }
#else
#define HIDE(e, counts)
#endif

// The picture (Y, X, CHANNELS): mean + gain * (sum of w (colour - mean)), where the gain goes by `blend` from 1 to
// 1 / sqrt(sum of w^2) as far as the patches differ, within [low, high]; zero where masked. tones: mean, low, high of
// each channel, and UNLIKE over the sample's variance. Equal to the reference bit for bit.
// starts (tiles + 1), members: the patches that reach each tile, in order; cells (P, 2): the pixel before each centre;
// patches (P, FIELDS); sample (rows, columns, CHANNELS), enlarged; clear (Y, X): pixels to the nearest masked one
kernel void draw(global const int *restrict starts, global const int *restrict members,
                 global const int2 *restrict cells, global const float *restrict patches,
                 global const float *restrict sample, const int2 enlarged, const float2 turn, const float2 last,
                 global const float *restrict tones, const float blend, global const float *restrict clear,
                 const int2 size, global float *restrict picture) {
    TILED;
#include "texture/blend.h"
    float out[CHANNELS][16];
    int shown[16];
    vstore16(covered, 0, shown);
    for (int c = 0; c < CHANNELS; c++) vstore16(colour[c], 0, out[c]);
    for (int l = 0; l < min(TILE, size.x - x); l++) {
#if MASKED
        const bool show = shown[l] && clear[y * size.x + x + l] > 0.0f;
#else
        const bool show = shown[l];
#endif
        for (int c = 0; c < CHANNELS; c++) picture[(y * size.x + x + l) * CHANNELS + c] = show ? out[c][l] : 0.0f;
    }
}

// The two strongest patches of each pixel: (Y, X, 6) u, v, weight of each; u and v over the sample in 0..1, weights of
// all patches of a pixel together 1. Equal to the reference bit for bit.
kernel void strongest(global const int *restrict starts, global const int *restrict members,
                      global const int2 *restrict cells, global const float *restrict patches, const float2 turn,
                      const float2 last, global const float *restrict clear, const int2 size,
                      global float *restrict maps) {
    TILED;
    float16 nearest = (float16)(FARTHEST);
    for (int k = first; k < end; k++) {
        FROM_CENTRE;
        float16 e = remoteness(s, m, p, p[BIAS]);
        HIDE(e, e < nearest);
        nearest = fmin(nearest, e);
    }
    float16 sum = (float16)(0.0f), found[6];
    for (int c = 0; c < 6; c++) found[c] = sum;
    for (int k = first; k < end; k++) {
        FROM_CENTRE;
        float16 e = remoteness(s, m, p, p[BIAS]);
        if (!any(e < nearest + 4.0f)) continue;
        HIDE(e, e < nearest + 4.0f);
        const float16 w = weight(e - nearest);
        float16 px, py;
        place(s, m, p, turn, last, &px, &py);
        px = (px + 0.5f) / (last.x + 1.0f);
        py = (py + 0.5f) / (last.y + 1.0f);
        sum += w;
        const int16 best = w > found[2], second = w > found[5];
        found[3] = select(select(found[3], px, second), found[0], best);
        found[4] = select(select(found[4], py, second), found[1], best);
        found[5] = select(select(found[5], w, second), found[2], best);
        found[0] = select(found[0], px, best);
        found[1] = select(found[1], py, best);
        found[2] = select(found[2], w, best);
    }
    sum = select((float16)(1.0f), sum, sum > 0.0f);
    found[2] /= sum;
    found[5] /= sum;
    float out[6][16];
    for (int c = 0; c < 6; c++) vstore16(found[c], 0, out[c]);
    for (int l = 0; l < min(TILE, size.x - x); l++)
        for (int c = 0; c < 6; c++) {
#if MASKED
            const bool show = clear[y * size.x + x + l] > 0.0f;
#else
            const bool show = true;
#endif
            maps[(y * size.x + x + l) * 6 + c] = show ? out[c][l] : 0.0f;
        }
}

// The nearest patch of each pixel (Y, X) int32, the first of equals; -1 where none reaches. `when`: BIAS or BEFORE.
kernel void owners(global const int *restrict starts, global const int *restrict members,
                   global const int2 *restrict cells, global const float *restrict patches, const int when,
                   global const float *restrict clear, const int2 size, global int *restrict owner) {
    TILED;
    float16 nearest = (float16)(FARTHEST);
    int16 who = (int16)(-1);
    for (int k = first; k < end; k++) {
        FROM_CENTRE;
        float16 e = remoteness(s, m, p, p[when]);
        HIDE(e, e < nearest);
        const int16 closer = e < nearest;
        who = select(who, (int16)(members[k]), closer);
        nearest = fmin(nearest, e);
    }
    int out[16];
    vstore16(who, 0, out);
    for (int l = 0; l < min(TILE, size.x - x); l++) owner[y * size.x + x + l] = out[l];
}

// Which of the 4 x 4 sites of each tile no living patch has within `distance` radii, the smaller of its own and the
// site's: (tiles, 16) uchar. radii (tiles, 16); living (P); one work-item is a tile. Sites are TILE / 4 pixels apart.
kernel void bare(global const int *restrict starts, global const int *restrict members,
                 global const int2 *restrict cells, global const float *restrict patches,
                 global const uchar *restrict living, global const float *restrict radii, const float distance,
                 const int columns, global const float *restrict clear, const int2 size, global uchar *restrict out) {
    const int tile = get_global_id(0), x = (tile % columns - 1) * TILE, y = (tile / columns - 1) * TILE;
    const int16 along = (int16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3) * (TILE / 4);
    const int16 up = (int16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3) * (TILE / 4);
    const float16 own = vload16(tile, radii);
    int16 missing = (int16)(-1);
    for (int k = starts[tile]; k < starts[tile + 1]; k++) {
        if (!living[members[k]]) continue;
        global const float *restrict p = patches + members[k] * FIELDS;
        const int2 cell = cells[members[k]];
        const float16 dx = convert_float16(x - cell.x + along) - p[FX], dy = convert_float16(y - cell.y + up) - p[FY];
        const float16 s = dx * p[TX] + dy * p[TY], m = dy * p[TX] - dx * p[TY];
        const float16 limit = fmin(own, p[RADIUS]) * distance;
        int16 near = s * s * ALONG + m * m * ACROSS <= limit * limit;
#if MASKED
        near &= missing;
        const int16 asked = near & (dx * dx + dy * dy > p[NEAR]);
        if (any(asked))
            near &= ~asked | seen(clear, size, asked, x + along, y + up, (float16)(0.0f), (float16)(0.0f), dx, dy);
#endif
        missing &= ~near;
    }
    vstore16(convert_uchar16(missing & 1), tile, out);
}

// The picture's luminance at places laid out in a patch's own axes: query q is patch `who[q]`, its places are those of
// u, v (P16) with index in [from[q], to[q]), and it sees the patches `members[starts[q]]`... of rank below `round`, but
// not patch without[q]. out (queries, P16, 2): luminance, and 1 where there is any. One work-item is 16 places.
// Equal to the reference bit for bit.
kernel void rectify(global const int *restrict who, global const int *restrict without, global const int *restrict from,
                    global const int *restrict to, global const float *restrict u, global const float *restrict v,
                    global const int *restrict starts, global const int *restrict members,
                    global const int *restrict rank, const int round, global const int2 *restrict cells,
                    global const float *restrict patches, global const float *restrict sample, const int2 enlarged,
                    const float2 turn, const float2 last, global const float *restrict clear, const int2 size,
                    global float *restrict out) {
    const int block = get_global_id(0), q = get_global_id(1), blocks = get_global_size(0);
    if (block * 16 >= to[q] || block * 16 + 15 < from[q]) return;
    global const float *restrict own = patches + who[q] * FIELDS;
    const int2 home = cells[who[q]];
    const float16 U = vload16(block, u), V = vload16(block, v);
    float16 a, b;
    unbent(U, V, own, &a, &b);
    const float16 x = a * own[TX] - b * own[TY], y = a * own[TY] + b * own[TX];
    int16 visible = (int16)(-1);
#if MASKED
    visible = seen(clear, size, visible, (int16)(home.x), (int16)(home.y), own[FX] + x, own[FY] + y, x, y);
    if (!any(visible)) visible = (int16)(0);
#endif
#define FROM_THIS                                                                                                 \
    if (rank[members[k]] >= round || members[k] == without[q]) continue;                                          \
    global const float *restrict p = patches + members[k] * FIELDS;                                               \
    const int2 cell = cells[members[k]];                                                                          \
    const float16 dx = x + (convert_float(home.x - cell.x) + (own[FX] - p[FX]));                                  \
    const float16 dy = y + (convert_float(home.y - cell.y) + (own[FY] - p[FY]));                                  \
    const float16 s = dx * p[TX] + dy * p[TY], m = dy * p[TX] - dx * p[TY];                                       \
    float16 e = remoteness(s, m, p, p[BIAS])
#if MASKED
#define HIDE_PLACES(counts)                                                                                       \
    if (p[NEAR] < NEVER) {                                                                                        \
        const int16 asked = (e < NEVER) & visible & (dx * dx + dy * dy > p[NEAR]) & (counts);                     \
        if (any(asked))                                                                                           \
            e = select(e, (float16)(NEVER), asked & ~seen(clear, size, asked, (int16)(home.x), (int16)(home.y),   \
                       own[FX] + x, own[FY] + y, dx, dy));                                                        \
    }
#else
#define HIDE_PLACES(counts)
#endif
    const int first = starts[q], end = starts[q + 1];
#include "texture/mean.h"
    const int16 any_there = (sum > 0.0f) & visible;
    sum = select((float16)(1.0f), sum, any_there);
    float values[16];
    int there[16];
    vstore16(total / sum, 0, values);
    vstore16(any_there, 0, there);
    for (int l = 0; l < 16; l++) {
        global float *restrict to_pair = out + ((q * blocks + block) * 16 + l) * 2;
        to_pair[0] = there[l] ? values[l] : 0.0f;
        to_pair[1] = there[l] ? 1.0f : 0.0f;
    }
}

// The best anchor of each query in each row of the sample: least (error + FLOOR) * (1 + dear), the leftmost of equals.
// wanted (queries, P16, 2) as rectify gives it; offsets (P16): of each place from the anchor in `luminance`, which has
// `stride` floats a row and whose pixel 0, 0 is at `origin`; room and dear (rows, stride), of each anchor; needs
// (queries): the room each needs. best (queries, rows, 2): error, column.
// Equal to the reference bit for bit. Hot in the first frame only: bound by arithmetic and unaligned loads.
kernel void match(global const float *restrict wanted, global const int *restrict from, global const int *restrict to,
                  global const int *restrict offsets, const int places, global const float *restrict luminance,
                  const int origin, const int stride, const int columns, global const float *restrict room,
                  global const float *restrict dear, global const float *restrict needs, const float least_error,
                  global float *restrict best) {
    const int row = get_global_id(0), q = get_global_id(1), rows = get_global_size(0);
    float error = NEVER;
    int found = 0;
    for (int x = 0; x < columns; x += 32) {
        const int16 fits = vload16(0, room + row * stride + x) >= needs[q];
        const int16 fits_too = vload16(0, room + row * stride + x + 16) >= needs[q];
        if (!any(fits | fits_too)) continue;
        float16 sum = (float16)(0.0f), sum_too = sum;
        float count = 0.0f;
        global const float *restrict here = luminance + origin + row * stride + x;
        for (int i = from[q]; i < to[q]; i++) {
            global const float *restrict pair = wanted + (q * places + i) * 2;
            if (pair[1] == 0.0f) continue;
            const float16 d = vload16(0, here + offsets[i]) - pair[0];
            const float16 d_too = vload16(0, here + offsets[i] + 16) - pair[0];
            sum += d * d;
            sum_too += d_too * d_too;
            count += 1.0f;
        }
        count = fmax(count, 1.0f);
        sum = (sum / count + least_error) * (1.0f + vload16(0, dear + row * stride + x));
        sum_too = (sum_too / count + least_error) * (1.0f + vload16(0, dear + row * stride + x + 16));
        float values[32];
        vstore16(select((float16)(NEVER), sum, fits), 0, values);
        vstore16(select((float16)(NEVER), sum_too, fits_too), 1, values);
        for (int l = 0; l < 32; l++)
            if (values[l] < error) {
                error = values[l];
                found = x + l;
            }
    }
    best[(q * rows + row) * 2] = error;
    best[(q * rows + row) * 2 + 1] = (float)found;
}

// The flow's direction at points (M, 2), x and y: out (M, 4): cosine and sine of its angle, and the angle's change per
// pixel along it and to its left. v (Y, X, 2) is read bilinearly, beyond its border from the border.
inline float2 flow_at(global const float2 *restrict v, int2 size, float x, float y) {
    x = clamp(x, 0.0f, (float)(size.x - 1));
    y = clamp(y, 0.0f, (float)(size.y - 1));
    const int i = min((int)x, max(size.x - 2, 0)), j = min((int)y, max(size.y - 2, 0));
    const int right = min(i + 1, size.x - 1), above = min(j + 1, size.y - 1);
    const float fx = x - (float)i, fy = y - (float)j;
    const float2 low = v[j * size.x + i] * (1.0f - fx) + v[j * size.x + right] * fx;
    const float2 high = v[above * size.x + i] * (1.0f - fx) + v[above * size.x + right] * fx;
    return low * (1.0f - fy) + high * fy;
}

inline float turned(float2 from, float2 to) {
    return atan2(from.x * to.y - from.y * to.x, from.x * to.x + from.y * to.y);
}

kernel void directions(global const float2 *restrict v, const int2 size, global const float2 *restrict points,
                       const int count, const float step, global float4 *restrict out) {
    const int k = get_global_id(0);
    if (k >= count) return;
    const float x = points[k].x, y = points[k].y;
    const float2 here = flow_at(v, size, x, y);
    const float speed = sqrt(here.x * here.x + here.y * here.y);
    const float2 t = speed > 0.0f ? here / speed : (float2)(1.0f, 0.0f);
    const float along_x = turned(flow_at(v, size, x - step, y), flow_at(v, size, x + step, y)) / (2.0f * step);
    const float along_y = turned(flow_at(v, size, x, y - step), flow_at(v, size, x, y + step)) / (2.0f * step);
    out[k] = (float4)(t, along_x * t.x + along_y * t.y, along_y * t.x - along_x * t.y);
}
