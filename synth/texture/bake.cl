// Patches on a surface: what they show at places of its triangles, and where places of a patch lie in triangles.
// bake.py holds the NumPy references, which these kernels match bit for bit.
//
// Places are in blocks of 16 of one triangle. `starts`, `members`, `corners`: the triangles in the charts of patches,
// as `Pieces` has them. Beside these, arguments are those of the kernels of patches.cl.

#include "texture/patches.cl"

// Where the 16 places lie in the axes of the k-th patch of their triangle.
#define ON_PIECE                                                                                                  \
    global const float *restrict p = patches + members[k] * FIELDS, *restrict c = corners + k * 6;                \
    const float16 s = c[0] + u * c[2] + v * c[4], m = c[1] + u * c[3] + v * c[5]

#undef FROM_CENTRE
#define FROM_CENTRE ON_PIECE

// The colours of the places, (blocks, CHANNELS, 16); zero where no patch reaches. faces (blocks); places (blocks, 2, 16)
kernel void bake(global const int *restrict faces, global const float *restrict places,
                 global const int *restrict starts, global const int *restrict members,
                 global const float *restrict corners, global const float *restrict patches,
                 global const float *restrict sample, const int2 enlarged, const float2 turn, const float2 last,
                 global const float *restrict tones, const float blend, global float *restrict out) {
    const int block = get_global_id(0), first = starts[faces[block]], end = starts[faces[block] + 1];
    const float16 u = vload16(2 * block, places), v = vload16(2 * block + 1, places);
#include "texture/blend.h"
    for (int c = 0; c < CHANNELS; c++)
        vstore16(select((float16)(0.0f), colour[c], covered), block * CHANNELS + c, out);
}

#undef FROM_THIS
#define FROM_THIS                                                                                                 \
    if (rank[members[k]] >= round || members[k] == without[block]) continue;                                      \
    ON_PIECE;                                                                                                     \
    float16 e = remoteness(s, m, p, p[BIAS])

// The luminance of the places as patches of rank below `round` show it, each block without one of them: (blocks, 2, 16),
// the second 1 where there is any.
kernel void show(global const int *restrict faces, global const float *restrict places,
                 global const int *restrict without, global const int *restrict starts,
                 global const int *restrict members, global const float *restrict corners,
                 global const int *restrict rank, const int round, global const float *restrict patches,
                 global const float *restrict sample, const int2 enlarged, const float2 turn, const float2 last,
                 global float *restrict out) {
    const int block = get_global_id(0), first = starts[faces[block]], end = starts[faces[block] + 1];
    const float16 u = vload16(2 * block, places), v = vload16(2 * block + 1, places);
#include "texture/mean.h"
    const int16 there = sum > 0.0f;
    const float16 mean = total / select((float16)(1.0f), sum, there);
    vstore16(select((float16)(0.0f), mean, there), 2 * block, out);
    vstore16(select((float16)(0.0f), (float16)(1.0f), there), 2 * block + 1, out);
}

// Where places (U, V) of patches lie: of query q, patch who[q], the first of its triangles starts[q] ... that holds each
// place, -1 where none does, and the barycentric coordinates there. places (2, P16); found (queries, P16);
// out (queries, 2, P16). One work-item is 16 places.
kernel void locate(global const int *restrict who, global const int *restrict starts,
                   global const float *restrict corners, global const float *restrict patches,
                   global const float *restrict places, global int *restrict found, global float *restrict out) {
    const int block = get_global_id(0), q = get_global_id(1), blocks = get_global_size(0);
    global const float *restrict own = patches + who[q] * FIELDS;
    float16 s, m;
    unbent(vload16(block, places), vload16(blocks + block, places), own, &s, &m);
    int16 in = (int16)(-1);
    float16 u = (float16)(0.0f), v = u;
    for (int k = starts[q]; k < starts[q + 1]; k++) {
        global const float *restrict c = corners + k * 6;
        const float area = c[2] * c[5] - c[3] * c[4];
        const float16 x = s - c[0], y = m - c[1];
        const float16 b = (x * c[5] - y * c[4]) / area, d = (y * c[2] - x * c[3]) / area;
        const int16 holds = (in < 0) & (b >= -EDGE) & (d >= -EDGE) & (b + d <= 1.0f + EDGE);
        in = select(in, (int16)(k), holds);
        u = select(u, b, holds);
        v = select(v, d, holds);
    }
    vstore16(in, q * blocks + block, found);
    vstore16(u, (q * 2) * blocks + block, out);
    vstore16(v, (q * 2 + 1) * blocks + block, out);
}
