// Best matches in PCA space (ma09 §3.1 exact, §3.7 k-coherence).
// -D DIMS   dimensions of the space, a multiple of 16
// -D BLOCK  queries a work-item treats together, 16 at most
// -D BOX    dimensions in which a block of points has a box
// -D CANDIDATES  similar neighbourhoods each match suggests
// -D DAMPING  of the sub-cell step, as a share of its matrix's trace

#define HUGE_DISTANCE 3.0e38f

// How far sixteen queries, one to a lane, lie from a box at least: squared, in the first BOX dimensions.
inline float16 outside(__global const float *box, const float16 *lanes) {
    float16 sum = (float16)(0.0f);
    for (int d = 0; d < BOX; d++) {
        const float16 away = max(max(box[d] - lanes[d], lanes[d] - box[BOX + d]), (float16)(0.0f));
        sum = fma(away, away, sum);
    }
    return sum;
}

// All blocks of 32 points that may hold a nearest one, sixteen points to a vector lane, BLOCK queries to a work-item,
// so that every load of the exemplar serves BLOCK fused multiply-adds. With half = |e|^2 / 2,
// |q - e|^2 = |q|^2 + 2 (half - q.e). A block is passed over where its box lies farther from each of the queries than
// what the block with the nearest box holds. The loops over BLOCK are unrolled, or the compiler keeps the sums in
// memory.
// points (blocks, DIMS, 32): 32 points side by side; half (blocks, 32), huge in the padding; index (blocks, 32) of
// each point; boxes (blocks, 2, BOX), least and greatest; queries (count, DIMS)
__kernel void exact(__global const float *points, __global const float *half_norm, __global const int *index,
                    __global const float *boxes, int blocks, __global const float *queries, int count,
                    __global int *best, __global float *distance) {
    const int first = get_global_id(0) * BLOCK;
    float q[DIMS][BLOCK], norm[16], bound[16];
    float16 lanes[BOX];
    int nearest[16];
    for (int b = 0; b < BLOCK; b++) {
        __global const float *query = queries + min(first + b, count - 1) * DIMS;
        norm[b] = 0.0f;
        for (int d = 0; d < DIMS; d++) {
            q[d][b] = -query[d];
            norm[b] = fma(query[d], query[d], norm[b]);
        }
    }
    for (int d = 0; d < BOX; d++) {
        float lane[16];
        for (int b = 0; b < 16; b++) lane[b] = -q[d][min(b, BLOCK - 1)];
        lanes[d] = vload16(0, lane);
    }
    float16 closest = (float16)(HUGE_DISTANCE);
    int16 block = (int16)(0);
    for (int e = 0; e < blocks; e++) {
        const float16 away = outside(boxes + e * 2 * BOX, lanes);
        block = select(block, (int16)(e), away < closest);
        closest = min(closest, away);
    }
    vstore16(block, 0, nearest);
    for (int b = 0; b < BLOCK; b++) {
        const int e = nearest[b] * 32;
        float16 left = vload16(0, half_norm + e), right = vload16(0, half_norm + e + 16);
        for (int d = 0; d < DIMS; d++) {
            left = fma((float16)(q[d][b]), vload16(0, points + e * DIMS + d * 32), left);
            right = fma((float16)(q[d][b]), vload16(0, points + e * DIMS + d * 32 + 16), right);
        }
        float values[16], value = HUGE_DISTANCE;
        vstore16(min(left, right), 0, values);
        for (int lane = 0; lane < 16; lane++) value = min(value, values[lane]);
        const float squared = norm[b] + 2.0f * value;
        // more than rounding can take away
        bound[b] = squared + 2e-5f * (norm[b] + fabs(squared));
    }
    for (int b = BLOCK; b < 16; b++) bound[b] = bound[BLOCK - 1];
    const float16 reach = vload16(0, bound);

    float16 least[BLOCK];
    int16 where[BLOCK];
#pragma unroll
    for (int b = 0; b < BLOCK; b++) {
        least[b] = (float16)(HUGE_DISTANCE);
        where[b] = (int16)(0);
    }
    for (int e = 0; e < blocks * 32; e += 32) {
        if (!any(outside(boxes + e / 32 * 2 * BOX, lanes) <= reach)) continue;
        float16 left[BLOCK], right[BLOCK];
#pragma unroll
        for (int b = 0; b < BLOCK; b++) {
            left[b] = vload16(0, half_norm + e);
            right[b] = vload16(0, half_norm + e + 16);
        }
        for (int d = 0; d < DIMS; d++) {
            const float16 x = vload16(0, points + e * DIMS + d * 32);
            const float16 y = vload16(0, points + e * DIMS + d * 32 + 16);
#pragma unroll
            for (int b = 0; b < BLOCK; b++) {
                left[b] = fma((float16)(q[d][b]), x, left[b]);
                right[b] = fma((float16)(q[d][b]), y, right[b]);
            }
        }
#pragma unroll
        for (int b = 0; b < BLOCK; b++) {
            int16 closer = left[b] < least[b];
            least[b] = select(least[b], left[b], closer);
            where[b] = select(where[b], (int16)(e), closer);
            closer = right[b] < least[b];
            least[b] = select(least[b], right[b], closer);
            where[b] = select(where[b], (int16)(e + 16), closer);
        }
    }
#pragma unroll
    for (int b = 0; b < BLOCK; b++) {
        if (first + b >= count) continue;
        float values[16];
        int starts[16];
        vstore16(least[b], 0, values);
        vstore16(where[b], 0, starts);
        float value = values[0];
        int found = index[starts[0]];
        // equal distances go to the lowest index, whatever lane they were seen in
        for (int lane = 1; lane < 16; lane++) {
            const int at = index[starts[lane] + lane];
            if (values[lane] < value || (values[lane] == value && at < found)) {
                value = values[lane];
                found = at;
            }
        }
        best[first + b] = found;
        distance[first + b] = max(0.0f, norm[b] + 2.0f * value);
    }
}

inline float sum16(float16 v) {
    const float8 s8 = v.lo + v.hi;
    const float4 s4 = s8.lo + s8.hi;
    return (s4.x + s4.y) + (s4.z + s4.w);
}

inline float squared_distance(__global const float *a, __global const float *b) {
    float16 sum = (float16)(0.0f);
    for (int d = 0; d < DIMS; d += 16) {
        const float16 difference = vload16(0, a + d) - vload16(0, b + d);
        sum = fma(difference, difference, sum);
    }
    return sum16(sum);
}

inline int wrapped(int x, int y, int2 exemplar) {
    x %= exemplar.x;
    y %= exemplar.y;
    return (y < 0 ? y + exemplar.y : y) * exemplar.x + (x < 0 ? x + exemplar.x : x);
}

// k-coherence [Tong 2002; Han 2006]: the candidates of a site are the k most similar neighbourhoods of what
// its 3 x 3 neighbouring sites matched, each shifted by the offset from that site along this one's local axes.
// points (N * M, DIMS); similar (N * M, K), each row beginning with itself; match (count) of the last search
__kernel void coherent(__global const float *points, __global const int *similar, int2 exemplar,
                       __global const float *queries, __global const int2 *sites, __global const float2 *axis,
                       int2 grid, __global const int *match, __global int *best, __global float *distance) {
    const int gx = get_global_id(0), gy = get_global_id(1), s = gy * grid.x + gx;
    const float2 e = axis[s];
    float least = HUGE_DISTANCE;
    int index = 0;
    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            const int nx = gx + dx, ny = gy + dy;
            if (nx < 0 || ny < 0 || nx >= grid.x || ny >= grid.y) continue;
            const int n = ny * grid.x + nx;
            const float2 offset = convert_float2(sites[s] - sites[n]);
            const int i = convert_int_rte(e.x * offset.x + e.y * offset.y);
            const int j = convert_int_rte(e.x * offset.y - e.y * offset.x);
            const int centre = wrapped(match[n] % exemplar.x + i, match[n] / exemplar.x + j, exemplar);
            for (int k = 0; k < CANDIDATES; k++) {
                const int candidate = similar[centre * CANDIDATES + k];
                const float d = squared_distance(queries + s * DIMS, points + candidate * DIMS);
                if (d < least || (d == least && candidate < index)) {
                    least = d;
                    index = candidate;
                }
            }
        }
    best[s] = index;
    distance[s] = least;
}

// Sub-cell position of the match: one Gauss-Newton step on |q - p(x)|^2, the slopes of p from its four
// neighbours. Unlike the parabola through three distances it leaves an exact match where it is.
__kernel void refine(__global const float *points, int2 exemplar, __global const float *queries,
                     __global const int *best, __global float2 *position) {
    const int s = get_global_id(0), x = best[s] % exemplar.x, y = best[s] / exemplar.x;
    __global const float *q = queries + s * DIMS, *p = points + best[s] * DIMS;
    __global const float *west = points + wrapped(x - 1, y, exemplar) * DIMS;
    __global const float *east = points + wrapped(x + 1, y, exemplar) * DIMS;
    __global const float *south = points + wrapped(x, y - 1, exemplar) * DIMS;
    __global const float *north = points + wrapped(x, y + 1, exemplar) * DIMS;
    float16 xx = (float16)(0.0f), xy = xx, yy = xx, rx = xx, ry = xx;
    for (int d = 0; d < DIMS; d += 16) {
        const float16 left = vload16(0, q + d) - vload16(0, p + d);
        const float16 dx = 0.5f * (vload16(0, east + d) - vload16(0, west + d));
        const float16 dy = 0.5f * (vload16(0, north + d) - vload16(0, south + d));
        xx = fma(dx, dx, xx);
        xy = fma(dx, dy, xy);
        yy = fma(dy, dy, yy);
        rx = fma(left, dx, rx);
        ry = fma(left, dy, ry);
    }
    const float trace = sum16(xx) + sum16(yy);
    // along a stripe the match may slide: damping keeps it where it is
    const float a = sum16(xx) + DAMPING * trace, b = sum16(xy), c = sum16(yy) + DAMPING * trace;
    const float det = a * c - b * b;
    const float2 shift = (float2)(c * sum16(rx) - b * sum16(ry), a * sum16(ry) - b * sum16(rx)) / det;
    position[s] = (float2)(x, y) + (det > 0.0f ? clamp(shift, -0.5f, 0.5f) : (float2)(0.0f));
}
