// Solid synthesis (ma09 §3.2): neighbourhoods of a 3-D field as the views see them, and their assignment.
// One view at a time. A site's legs are the directions, in the domain, of what the view calls right and up, and of
// its normal: (S, 3) float4. Fields are (Z, Y, X) float4 in local coordinates, the last component unused.
// -D VOLUME     0: the exemplar is a picture of two components; 1: it is a volume of three
// -D RADIUS     half width of the neighbourhoods
// -D FOOT       half width of what a match is laid down on
// -D SPACING    distance of the sites on their grid, FIRST: position of the first
// -D BORDER     cells by which a picture was continued toroidally on each side
// -D SEEN       0: a cell is the average of all matches that cover it, 1: of those of the eight sites round it
// and what search.cl needs.

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

// field of `size`; legs (S, 3); sites first … -> out (count, SIDE, SIDE, 2), of a volume (count, SIDE, SIDE, SIDE, 3):
// what the view sees round each site, projected on its right and up (§3.2, Project)
__kernel void gather(__global const float4 *field, int4 size, __global const float4 *legs, int4 grid, int first,
                     float4 right, float4 up, float slab, __global float *out) {
    const int s = first + get_global_id(0);
    const float4 centre = site(s, grid), a = legs[3 * s], b = legs[3 * s + 1];
#if VOLUME
    const float4 c = legs[3 * s + 2];
    out += get_global_id(0) * SIDE * SIDE * SIDE * 3;
    for (int k = -RADIUS; k <= RADIUS; k++)
        for (int j = -RADIUS; j <= RADIUS; j++)
            for (int i = -RADIUS; i <= RADIUS; i++, out += 3)
                vstore3(PROJECTED(trilinear(field, size, centre + i * a + j * b + k * c)).xyz, 0, out);
#else
    // a slab deeper than the sites are apart is seen as a whole, the mean of three planes
    const float4 away = slab > SPACING ? 0.5f * slab * legs[3 * s + 2] : (float4)(0.0f);
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
inline int shifted(float4 way, int match, int4 exemplar) {
    const int x = wrapped_to(match % exemplar.x + convert_int_rte(way.x), exemplar.x);
    const int y = wrapped_to(match / exemplar.x % exemplar.y + convert_int_rte(way.y), exemplar.y);
    const int z = wrapped_to(match / (exemplar.x * exemplar.y) + convert_int_rte(way.z), exemplar.z);
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
inline int shifted(float4 way, int match, int4 exemplar) {
    return wrapped(match % exemplar.x + convert_int_rte(way.x), match / exemplar.x + convert_int_rte(way.y),
                   exemplar.xy);
}
#define SHOWN(at, o) spread_sample(exemplar, exemplar_size.x, (at) + (o).xy)
#define ADDED(s) ((float4)(added(s), 0.0f, 0.0f))
typedef float2 texel;
#endif

// k-coherence in 3-D [Dong 2008]: the candidates of a site are the k most similar neighbourhoods of what it and the
// six sites beside it matched, each shifted by the way from that site, as the view sees it.
// points (E, DIMS); similar (E, K), each row beginning with itself; match (S) of the last search
__kernel void coherent_solid(__global const float *points, __global const int *similar, int4 exemplar,
                             __global const float *queries, __global const float4 *legs, int4 grid, int first,
                             __global const int *match, __global int *best, __global float *distance) {
    const int s = first + get_global_id(0);
    const int x = s % grid.x, y = s / grid.x % grid.y, z = s / (grid.x * grid.y);
    const float4 a = legs[3 * s], b = legs[3 * s + 1], c = legs[3 * s + 2];
    queries += get_global_id(0) * DIMS;
    float least = HUGE_DISTANCE;
    int index = 0;
    for (int n = 0; n < 7; n++) {
        const int dx = (n == 1) - (n == 2), dy = (n == 3) - (n == 4), dz = (n == 5) - (n == 6);
        if (x + dx < 0 || y + dy < 0 || z + dz < 0 || x + dx >= grid.x || y + dy >= grid.y || z + dz >= grid.z) continue;
        const float4 way = -SPACING * (float4)(dx, dy, dz, 0.0f);
        const float4 seen = (float4)(dot(a, way), dot(b, way), dot(c, way), 0.0f);
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

// Which sites a cell at coordinate i of an axis of n sites looks at: from the first to the last.
#if SEEN
#define FROM(i, n) clamp((i - FIRST) / SPACING, 0, n - 1)
#define TO(i, n) min(FROM(i, n) + 1, n - 1)
#define TOO_FAR(way) false
#else
// no match reaches further than `reach`: the corner of its foot, half a slab from its plane
#define FROM(i, n) (max(0, i - reach - FIRST + SPACING - 1) / SPACING)
#define TO(i, n) min(n - 1, (i + reach - FIRST) / SPACING)
#define TOO_FAR(way) (dot(way, way) > furthest)
#endif

#define EACH_SITE(body)                                                              \
    for (int k = FROM(z, grid.z); k <= TO(z, grid.z); k++)                           \
        for (int j = FROM(y, grid.y); j <= TO(y, grid.y); j++)                       \
            for (int i = FROM(x, grid.x); i <= TO(x, grid.x); i++) {                 \
                const int s = (k * grid.y + j) * grid.x + i;                         \
                const float4 way = (float4)(x - (i * SPACING + FIRST), y - (j * SPACING + FIRST), \
                                            z - (k * SPACING + FIRST), 0.0f);        \
                if (TOO_FAR(way)) continue;                                          \
                const float4 o = (float4)(dot(legs[3 * s], way), dot(legs[3 * s + 1], way), \
                                          dot(legs[3 * s + 2], way), 0.0f);          \
                body                                                                 \
            }

// How much a match counts at offset o from its centre: most there, less towards the edges of its foot. A picture's
// reaches `slab` to the front and to the back: one spacing at least, where the next plane of sites has taken over.
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

// Eq. 2: what one view says, added to out (the first view: in its place). m0, m1, m2: what a unit of its right, up
// (, normal) makes of the voxel. Where no match reaches, the view says what stands there already.
__kernel void average(__global const texel *exemplar, int4 exemplar_size, __global const place *position,
                      __global const float *weight, __global const float4 *legs, int4 grid, float4 right, float4 up,
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
    const float4 said = m0 * mean.x + m1 * mean.y + m2 * mean.z;
    out[here] = begin ? said : out[here] + said;
}

#if SEEN
// Pseudocode 2, Assign: of the matches round a cell the one most similar to the average of all views.
__kernel void nearest(__global const texel *exemplar, int4 exemplar_size, __global const place *position,
                      __global const float4 *legs, int4 grid, float4 right, float4 up, float4 m0, float4 m1,
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
    const float4 said = m0 * best.x + m1 * best.y + m2 * best.z;
    out[here] = begin ? said : out[here] + said;
}

#endif
