// Views of a 3-D field (ma09 §3.2): its neighbourhoods as a view sees them, and their assignment. One view at a time.
// A site's basis is the view's right, up and normal there, in the axes of the domain: (S, 3) float4. Fields are (Z, Y, X) float4 in local coordinates, the last component unused.
// -D VOLUME     0: the exemplar is 2-D, of two components; 1: it is a volume, of three
// -D RADIUS     half width of the neighbourhoods
// -D FOOT       half width of the footprint of a match
// -D SPACING    distance of the sites on their grid, FIRST: position of the first
// -D BORDER     cells by which a 2-D exemplar was continued toroidally on each side
// -D SEEN       0: a cell is the average of all matches that cover it, 1: of those of the eight sites round it
// and the defines of search.cl.

#include "motion/search.cl"
#include "motion/sample.h"

#define SIDE (2 * RADIUS + 1)

inline float4 site(int s, int4 grid) {
    return (float4)(s % grid.x * SPACING + FIRST, s / grid.x % grid.y * SPACING + FIRST,
                    s / (grid.x * grid.y) * SPACING + FIRST, 0.0f);
}

inline float4 trilinear(__global const float4 *field, int4 size, float4 at) {
    at = clamp(at, (float4)(0.0f), convert_float4(size - 1));
    const int4 low = min(convert_int4(at), size - 2);
    const float4 t = at - convert_float4(low);
    __global const float4 *f = field + (low.z * size.y + low.y) * size.x + low.x;
    const int row = size.x, layer = size.x * size.y;
    const float4 a = (1.0f - t.x) * f[0] + t.x * f[1], b = (1.0f - t.x) * f[row] + t.x * f[row + 1];
    const float4 c = (1.0f - t.x) * f[layer] + t.x * f[layer + 1];
    const float4 d = (1.0f - t.x) * f[layer + row] + t.x * f[layer + row + 1];
    return (1.0f - t.z) * ((1.0f - t.y) * a + t.y * b) + t.z * ((1.0f - t.y) * c + t.y * d);
}

// P v: the components that the view sees (§3.2, figure 3)
#if VOLUME
#define PROJECTED(v) (float4)(dot(v, right), dot(v, up), dot(v, cross(right, up)), 0.0f)
#else
#define PROJECTED(v) (float4)(dot(v, right), dot(v, up), 0.0f, 0.0f)
#endif

// field of `size`; basis (S, 3); sites from `first` on -> out (count, SIDE, SIDE, 2), of a volume (count, SIDE, SIDE, SIDE, 3):
// what the view sees round each site, projected on its right and up (§3.2, Project)
__kernel void gather(__global const float4 *field, int4 size, __global const float4 *basis, int4 grid, int first,
                     float4 right, float4 up, float slab, __global float *out) {
    const int s = first + get_global_id(0);
    const float4 centre = site(s, grid), a = basis[3 * s], b = basis[3 * s + 1];
#if VOLUME
    const float4 c = basis[3 * s + 2];
    out += get_global_id(0) * SIDE * SIDE * SIDE * 3;
    for (int k = -RADIUS; k <= RADIUS; k++)
        for (int j = -RADIUS; j <= RADIUS; j++)
            for (int i = -RADIUS; i <= RADIUS; i++, out += 3)
                vstore3(PROJECTED(trilinear(field, size, centre + i * a + j * b + k * c)).xyz, 0, out);
#else
    // a slab deeper than the spacing of the sites is seen as the mean of three planes
    const float4 away = slab > SPACING ? 0.5f * slab * basis[3 * s + 2] : (float4)(0.0f);
    out += get_global_id(0) * SIDE * SIDE * 2;
    for (int j = -RADIUS; j <= RADIUS; j++)
        for (int i = -RADIUS; i <= RADIUS; i++, out += 2) {
            const float4 at = centre + i * a + j * b;
            float4 v = trilinear(field, size, at);
            if (slab > SPACING)
                v = (v + trilinear(field, size, at + away) + trilinear(field, size, at - away)) / 3.0f;
            vstore2(PROJECTED(v).xy, 0, out);
        }
#endif
}

#if VOLUME
typedef float4 place;   // in the exemplar, cells
typedef float4 spread;
inline int wrapped_to(int i, int n) {
    i %= n;
    return i < 0 ? i + n : i;
}
inline int shifted(float4 offset, int match, int4 exemplar) {
    const int x = wrapped_to(match % exemplar.x + convert_int_rte(offset.x), exemplar.x);
    const int y = wrapped_to(match / exemplar.x % exemplar.y + convert_int_rte(offset.y), exemplar.y);
    const int z = wrapped_to(match / (exemplar.x * exemplar.y) + convert_int_rte(offset.z), exemplar.z);
    return (z * exemplar.y + y) * exemplar.x + x;
}
inline float4 shown(__global const float4 *exemplar, int4 size, float4 at) {
    const float4 low = floor(at), t = at - low;
    const int4 i = convert_int4(low);
    const int x0 = wrapped_to(i.x, size.x), x1 = wrapped_to(i.x + 1, size.x);
    float4 sum = (float4)(0.0f);
    for (int dz = 0; dz < 2; dz++)
        for (int dy = 0; dy < 2; dy++) {
            __global const float4 *row = exemplar + (wrapped_to(i.z + dz, size.z) * size.y +
                                                     wrapped_to(i.y + dy, size.y)) * size.x;
            sum += (dz ? t.z : 1.0f - t.z) * (dy ? t.y : 1.0f - t.y) * ((1.0f - t.x) * row[x0] + t.x * row[x1]);
        }
    return sum;
}
#define SHOWN(at, o) shown(exemplar, exemplar_size, (at) + (o))
#define ADDED(s) (s)
typedef float4 texel;
#else
typedef float2 place;
typedef float8 spread;
inline int shifted(float4 offset, int match, int4 exemplar) {
    return wrapped(match % exemplar.x + convert_int_rte(offset.x), match / exemplar.x + convert_int_rte(offset.y),
                   exemplar.xy);
}
#define SHOWN(at, o) spread_sample(exemplar, exemplar_size.x, (at) + (o).xy)
#define ADDED(s) ((float4)(added(s), 0.0f, 0.0f))
typedef float2 texel;
#endif

// k-coherence in 3-D [Dong 2008]: the candidates of a site are the k most similar neighbourhoods of what it and the
// six sites beside it matched, each shifted by the offset from that site, as the view sees it.
// points (E, DIMS); similar (E, K), each row beginning with itself; match (S) of the last search
__kernel void coherent_3d(__global const float *points, __global const int *similar, int4 exemplar,
                             __global const float *queries, __global const float4 *basis, int4 grid, int first,
                             __global const int *match, __global int *best, __global float *distance) {
    const int s = first + get_global_id(0);
    const int x = s % grid.x, y = s / grid.x % grid.y, z = s / (grid.x * grid.y);
    const float4 a = basis[3 * s], b = basis[3 * s + 1], c = basis[3 * s + 2];
    queries += get_global_id(0) * DIMS;
    float least = HUGE_DISTANCE;
    int index = 0;
    for (int n = 0; n < 7; n++) {
        const int dx = (n == 1) - (n == 2), dy = (n == 3) - (n == 4), dz = (n == 5) - (n == 6);
        if (x + dx < 0 || y + dy < 0 || z + dz < 0 || x + dx >= grid.x || y + dy >= grid.y || z + dz >= grid.z) continue;
        const float4 offset = -SPACING * (float4)(dx, dy, dz, 0.0f);
        const float4 seen = (float4)(dot(a, offset), dot(b, offset), dot(c, offset), 0.0f);
        const int centre = shifted(seen, match[s + (dz * grid.y + dy) * grid.x + dx], exemplar);
        for (int k = 0; k < CANDIDATES; k++) {
            const int candidate = similar[centre * CANDIDATES + k];
            const float d = squared_distance(queries, points + candidate * DIMS);
            if (d < least || (d == least && candidate < index)) {
                least = d;
                index = candidate;
            }
        }
    }
    best[s] = index;
    distance[s] = least;
}

// The sites that a cell at coordinate i considers along an axis of n sites: from the first to the last.
#if SEEN
#define FROM(i, n) clamp((i - FIRST) / SPACING, 0, n - 1)
#define TO(i, n) min(FROM(i, n) + 1, n - 1)
#define TOO_FAR(offset) false
#else
// no match reaches further than `reach`: the corner of its footprint, half a slab from its plane
#define FROM(i, n) (max(0, i - reach - FIRST + SPACING - 1) / SPACING)
#define TO(i, n) min(n - 1, (i + reach - FIRST) / SPACING)
#define TOO_FAR(offset) (dot(offset, offset) > furthest)
#endif

#define EACH_SITE(body)                                                              \
    for (int k = FROM(z, grid.z); k <= TO(z, grid.z); k++)                           \
        for (int j = FROM(y, grid.y); j <= TO(y, grid.y); j++)                       \
            for (int i = FROM(x, grid.x); i <= TO(x, grid.x); i++) {                 \
                const int s = (k * grid.y + j) * grid.x + i;                         \
                const float4 offset = (float4)(x - (i * SPACING + FIRST), y - (j * SPACING + FIRST), \
                                            z - (k * SPACING + FIRST), 0.0f);        \
                if (TOO_FAR(offset)) continue;                                          \
                const float4 o = (float4)(dot(basis[3 * s], offset), dot(basis[3 * s + 1], offset), \
                                          dot(basis[3 * s + 2], offset), 0.0f);          \
                body                                                                 \
            }

// The weight of a match at offset o from its centre: most there, less towards the edges of its footprint. That of a
// 2-D exemplar reaches `slab` to the front and back: at least one spacing, where the next plane of sites takes over.
inline float falloff(float4 o, float slab) {
    const float4 away = fabs(o), edge = (float4)(FOOT + 1.0f);
#if VOLUME
    const float4 share = 1.0f - away * away / (edge * edge);
    const float depth = share.z;
    const bool covered = max(max(away.x, away.y), away.z) <= FOOT + 0.001f;
#else
    const float4 share = 1.0f - away * away / (edge * edge);
    const float depth = 1.0f - away.z / slab;
    const bool covered = max(away.x, away.y) <= FOOT + 0.001f && depth > 0.0f;
#endif
#if SEEN
    return max(share.x, 0.1f) * max(share.y, 0.1f) * max(depth, 0.1f);
#else
    return covered ? share.x * share.y * depth : 0.0f;
#endif
}

// Eq. 2: the contribution of one view, added to out (by the first view written to it). m0, m1, m2: the columns of M_i,
// for a unit along right, up (, normal). Where no match reaches, the view contributes the present value.
__kernel void average(__global const texel *exemplar, int4 exemplar_size, __global const place *position,
                      __global const float *weight, __global const float4 *basis, int4 grid, float4 right, float4 up,
                      float4 m0, float4 m1, float4 m2, float slab, int begin, __global const float4 *field,
                      __global float4 *out) {
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    const int here = (z * get_global_size(1) + y) * get_global_size(0) + x;
    const float furthest = 2.0f * FOOT * FOOT + slab * slab + 0.1f;
    const int reach = (int)sqrt(furthest);
    spread sum = (spread)(0.0f);
    float total = 0.0f;
    EACH_SITE({
        const float w = falloff(o, slab) * weight[s];
        if (w > 0.0f) {
            sum += w * SHOWN(position[s], o);
            total += w;
        }
    })
    float4 mean = ADDED(sum) / total;
    if (total <= 0.0f) mean = PROJECTED(field[here]);
    const float4 contribution = m0 * mean.x + m1 * mean.y + m2 * mean.z;
    out[here] = begin ? contribution : out[here] + contribution;
}

#if SEEN
// Pseudocode 2, Assign: of the matches round a cell the one most similar to the average of all views.
__kernel void nearest(__global const texel *exemplar, int4 exemplar_size, __global const place *position,
                      __global const float4 *basis, int4 grid, float4 right, float4 up, float4 m0, float4 m1,
                      float4 m2, int begin, __global const float4 *average, __global float4 *out) {
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    const int here = (z * get_global_size(1) + y) * get_global_size(0) + x;
    const float4 mean = PROJECTED(average[here]);
    float4 best = (float4)(0.0f);
    float least = HUGE_DISTANCE;
    EACH_SITE({
        const float4 value = ADDED(SHOWN(position[s], o));
        const float4 difference = value - mean;
        const float d = dot(difference, difference);
        if (d < least) {
            least = d;
            best = value;
        }
    })
    const float4 contribution = m0 * best.x + m1 * best.y + m2 * best.z;
    out[here] = begin ? contribution : out[here] + contribution;
}

#endif
