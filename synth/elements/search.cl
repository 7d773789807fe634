// The search step of ma13 (§4.1): for each output sample the exemplar samples with the nearest neighbourhoods (Eq. 4,
// with the falloff of Eq. 9), the Hungarian matching of their other samples, and the candidates of k-coherence.
//
// Defines: D dimensions; K other samples at most in each of B frames; F tied samples; N matches; C candidates at most
// (k-coherence) and SIMILAR; ROWS, COLUMNS of an element; FRAMES, COUNT of the output; IN_FRAMES, IN_COUNT of the
// exemplar; SAMPLES = ROWS * COLUMNS. Indices count samples, then elements, then frames.

#define SIZE (COUNT * SAMPLES)
#define IN_SIZE (IN_COUNT * SAMPLES)
#define IN_ALL (IN_FRAMES * IN_SIZE)

// Index of the sample at an offset (frames, rows, columns) from `s`, or -1 where there is none. An exemplar of one
// frame stands for all times.
int at_offset(int s, __constant const int *offset, int frames, int size) {
    const int frame = s / size, column = s % COLUMNS, row = s / COLUMNS % ROWS;
    const int there = frame + (frames == 1 && size == IN_SIZE ? 0 : offset[0]);
    if (there < 0 || there >= frames || row + offset[1] < 0 || row + offset[1] >= ROWS || column + offset[2] < 0 ||
        column + offset[2] >= COLUMNS)
        return -1;
    return s + (there - frame) * size + offset[1] * COLUMNS + offset[2];
}

// The least cost of matching n rows with m columns: a pair costs cost[j][k], a row without a partner unmatched[j], a
// column without one column_unmatched[k], as if its partner had left the neighbourhood. Jonker and Volgenant's shortest
// augmenting paths over rows; besides the m columns each row has one of its own, for staying unmatched. `partner[j]`
// becomes the column of row j, or -1.
float hungarian(int n, int m, const float *cost, const float *unmatched, const float *column_unmatched, int *partner) {
    float u[K + 1], v[K + 1], least[K + 1];
    int row_of[K + 1], previous[K + 1];
    bool used[K + 1];
    for (int k = 0; k <= m; k++) {
        v[k] = 0.0f;
        row_of[k] = -1;
    }
    for (int j = 0; j < n; j++)
        u[j] = 0.0f;
    for (int j = 0; j < n; j++) {
        // column m is where the path starts
        int column = m, last = -1;
        row_of[m] = j;
        float least_unmatched = INFINITY;
        for (int k = 0; k <= m; k++) {
            least[k] = INFINITY;
            used[k] = false;
        }
        for (;;) {
            used[column] = true;
            const int row = row_of[column];
            int next = -1;
            float delta = INFINITY;
            if (unmatched[row] - u[row] < least_unmatched) {
                least_unmatched = unmatched[row] - u[row];
                last = column;
            }
            for (int k = 0; k < m; k++) {
                if (used[k])
                    continue;
                const float reduced = cost[row * K + k] - column_unmatched[k] - u[row] - v[k];
                if (reduced < least[k]) {
                    least[k] = reduced;
                    previous[k] = column;
                }
                if (least[k] < delta) {
                    delta = least[k];
                    next = k;
                }
            }
            const bool ends_unmatched = least_unmatched <= delta;
            if (ends_unmatched)
                delta = least_unmatched;
            for (int k = 0; k <= m; k++)
                if (used[k]) {
                    u[row_of[k]] += delta;
                    if (k < m)
                        v[k] -= delta;
                } else
                    least[k] -= delta;
            least_unmatched -= delta;
            column = ends_unmatched ? last : next;
            if (ends_unmatched || row_of[column] < 0)
                break;
        }
        // each row on the path moves to the next column; the last one to a free column, or stays unmatched
        for (; column != m; column = previous[column])
            row_of[column] = row_of[previous[column]];
    }
    float sum = 0.0f;
    for (int j = 0; j < n; j++)
        partner[j] = -1;
    for (int k = 0; k < m; k++)
        if (row_of[k] >= 0)
            partner[row_of[k]] = k;
        else
            sum += column_unmatched[k];
    for (int j = 0; j < n; j++)
        sum += partner[j] < 0 ? unmatched[j] : cost[j * K + partner[j]];
    return sum;
}

// The neighbourhood of one output sample, gathered once.
typedef struct {
    float other[B * K * D];
    float falloff[B * K];
    float unmatched[B * K];
    int others[B];
    float tied[(F > 0 ? F : 1) * D];
    int tie[F > 0 ? F : 1];  // 1: there; 0: not there; -1: its frame does not exist yet, not compared
    float detail[D];
    float control;
    int allowed;
} Neighborhood;

// The distance (Eq. 9) to the exemplar's neighbourhood `in`; INFINITY as soon as it is known to be `limit` or more.
float distance_to(const Neighborhood *o, int in, float limit, int *partner, __global const float *in_other,
                  __global const float *in_falloff, __global const float *in_unmatched, __global const int *in_others,
                  __global const float *in_tied, __global const char *in_tie, __constant const float *tied_weight,
                  __global const float *in_detail, __global const float *in_control, __global const int *in_label,
                  float centre_weight, float control_weight, float missing) {
    if (!(o->allowed & in_label[in]))
        return INFINITY;
    const float difference = o->control - in_control[in];
    float sum = control_weight * difference * difference;
    for (int d = 0; d < D; d++) {
        const float delta = o->detail[d] - in_detail[in * D + d];
        sum += centre_weight * delta * delta;
    }
    for (int f = 0; f < F; f++) {
        if (o->tie[f] < 0)
            continue;
        if (o->tie[f] != in_tie[in * F + f]) {
            sum += tied_weight[f] * missing;
            continue;
        }
        float squared = 0.0f;
        for (int d = 0; o->tie[f] && d < D; d++) {
            const float delta = o->tied[f * D + d] - in_tied[(in * F + f) * D + d];
            squared += delta * delta;
        }
        sum += tied_weight[f] * squared;
    }
    for (int b = 0; b < B; b++) {
        const int n = o->others[b], m = in_others[in * B + b], base = in * B * K + b * K;
        if (n < 0)
            continue;
        if (sum >= limit)
            return INFINITY;
        float cost[K * K];
        float column_unmatched[K], nearest[K];
        for (int k = 0; k < m; k++)
            column_unmatched[k] = nearest[k] = in_unmatched[base + k];
        // a lower bound: no matching costs less than the cheapest choice of each row, or of each column
        float by_rows = 0.0f, by_columns = 0.0f;
        for (int j = 0; j < n; j++) {
            float least = o->unmatched[b * K + j];
            for (int k = 0; k < m; k++) {
                float squared = 0.0f;
                for (int d = 0; d < D; d++) {
                    const float delta = o->other[(b * K + j) * D + d] - in_other[(base + k) * D + d];
                    squared += delta * delta;
                }
                const float pair = 0.5f * (o->falloff[b * K + j] + in_falloff[base + k]) * squared;
                cost[j * K + k] = pair;
                least = fmin(least, pair);
                nearest[k] = fmin(nearest[k], pair);
            }
            by_rows += least;
        }
        for (int k = 0; k < m; k++)
            by_columns += nearest[k];
        if (sum + fmax(by_rows, by_columns) >= limit)
            return INFINITY;
        sum += hungarian(n, m, cost, o->unmatched + b * K, column_unmatched, partner + b * K);
    }
    return sum < limit ? sum : INFINITY;
}

// One output sample: its N nearest of all the exemplar (C = 0) or of its candidates.
__kernel void nearest(__global const int *samples,        // (M) output samples to match
                      __global const float *position,     // (all, D)
                      __global const float *detail,       // (all, D)
                      __global const float *axes,         // (all, D, D), or one number if there are none
                      int rotated, int known,             // frames from 0 to known - 1 are synthesized
                      __constant const float *period,     // (D), 0 along axes that do not repeat
                      __global const int *neighbors,      // (M, B * K)
                      __constant const int *offsets,      // (F, 3)
                      __constant const int *times,        // (B)
                      __constant const float *tied_weight,  // (F)
                      __global const float *control,      // (M)
                      __global const int *allowed,        // (M)
                      float radius, float sigma, __constant const float *time_falloff,  // (B)
                      float centre_weight, float control_weight, float missing,
                      __global const float *in_other,     // (in, B * K, D)
                      __global const float *in_falloff,   // (in, B * K)
                      __global const float *in_unmatched, // (in, B * K)
                      __global const int *in_others,      // (in, B)
                      __global const float *in_tied,      // (in, F, D)
                      __global const char *in_tie,        // (in, F)
                      __global const float *in_detail,    // (in, D)
                      __global const float *in_control,   // (in)
                      __global const int *in_label,       // (in)
                      __global const int *candidates,     // (M, C), -1 for none
                      __global int *match,                // (M, N)
                      __global float *distance,           // (M, N)
                      __global int *slot)                 // (M, N, B * K): place in the match's own list, or -1
{
    const int i = get_global_id(0), s = samples[i];
    Neighborhood o;
    float R[D * D];
    for (int d = 0; d < D * D; d++)
        R[d] = rotated ? axes[s * D * D + d] : (d % (D + 1) == 0 ? 1.0f : 0.0f);
    for (int b = 0; b < B; b++) {
        const int there = s / SIZE + times[b];
        o.others[b] = there < 0 || there >= known ? -1 : 0;
        for (int k = 0; k < K && o.others[b] >= 0; k++) {
            const int other = neighbors[i * B * K + b * K + k];
            if (other < 0)
                continue;
            float away[D], squared = 0.0f;
            for (int d = 0; d < D; d++) {
                away[d] = position[other * D + d] - position[s * D + d];
                if (period[d] > 0.0f)
                    away[d] -= period[d] * rint(away[d] / period[d]);
                squared += away[d] * away[d];
            }
            const int j = b * K + o.others[b]++;
            for (int d = 0; d < D; d++) {
                float sum = 0.0f;
                for (int e = 0; e < D; e++)
                    sum += R[e * D + d] * away[e];
                o.other[j * D + d] = sum;
            }
            o.falloff[j] = exp(-squared / sigma) * time_falloff[b];
            const float rest = fmax(0.0f, radius - sqrt(squared));
            o.unmatched[j] = o.falloff[j] * rest * rest;
        }
    }
    for (int d = 0; d < D; d++)
        o.detail[d] = detail[s * D + d];
    for (int f = 0; f < F; f++) {
        const int other = at_offset(s, offsets + 3 * f, FRAMES, SIZE), frame = s / SIZE + offsets[3 * f];
        o.tie[f] = frame < 0 || frame >= known ? -1 : other >= 0;
        for (int d = 0; d < D && o.tie[f] == 1; d++)
            o.tied[f * D + d] = detail[other * D + d] - detail[s * D + d];
    }
    o.control = control[i];
    o.allowed = allowed[i];

    int best[N], partner[B * K];
    float least[N];
    for (int n = 0; n < N; n++) {
        best[n] = -1;
        least[n] = INFINITY;
    }
    const int many = C > 0 ? C : IN_ALL;
    for (int c = 0; c < many; c++) {
        const int in = C > 0 ? candidates[i * C + c] : c;
        if (in < 0)
            continue;
        const float found = distance_to(&o, in, least[N - 1], partner, in_other, in_falloff, in_unmatched, in_others,
                                        in_tied, in_tie, tied_weight, in_detail, in_control, in_label, centre_weight,
                                        control_weight, missing);
        if (!(found < least[N - 1]))
            continue;
        int n = N - 1;
        for (; n > 0 && found < least[n - 1]; n--) {
            least[n] = least[n - 1];
            best[n] = best[n - 1];
        }
        least[n] = found;
        best[n] = in;
    }
    for (int n = 0; n < N; n++) {
        for (int k = 0; k < B * K; k++)
            partner[k] = -1;
        if (best[n] >= 0)
            distance_to(&o, best[n], INFINITY, partner, in_other, in_falloff, in_unmatched, in_others, in_tied, in_tie,
                        tied_weight, in_detail, in_control, in_label, centre_weight, control_weight, missing);
        match[i * N + n] = best[n];
        distance[i * N + n] = least[n];
        for (int k = 0; k < B * K; k++)
            slot[(i * N + n) * B * K + k] = partner[k];
    }
}

#if C > 0
// Append to the list unless it is there.
int added(__global int *list, int length, int sample) {
    if (sample < 0 || length == C)
        return length;
    for (int c = 0; c < length; c++)
        if (list[c] == sample)
            return length;
    list[length] = sample;
    return length + 1;
}

// The candidates of one output sample: its own matches, those that its neighbours' matches suggest, and the exemplar's
// samples most similar to these [Tong et al. 2002].
__kernel void coherent(__global const int *samples,      // (M)
                       __global const int *neighbors,    // (all, B * K) of all samples that have a match
                       __global const int *match,        // (all, N), -1 for none
                       __global const int *slot,         // (all, N, B * K)
                       __constant const int *offsets,    // (F, 3)
                       __global const int *in_neighbors, // (in, B * K)
                       __global const int *similar,      // (in, SIMILAR)
                       __global int *candidates)         // (M, C)
{
    const int i = get_global_id(0), s = samples[i];
    __global int *list = candidates + i * C;
    int length = 0;
    for (int n = 0; n < N; n++)
        length = added(list, length, match[s * N + n]);
    for (int f = 0; f < F; f++) {
        // adjacent samples are enough: they pass on what lies farther
        if (abs(offsets[3 * f]) > 1 || abs(offsets[3 * f + 1]) > 1 || abs(offsets[3 * f + 2]) > 1)
            continue;
        const int other = at_offset(s, offsets + 3 * f, FRAMES, SIZE);
        if (other < 0 || match[other * N] < 0)
            continue;
        // back by the same offset
        const int in = match[other * N], frame = in / IN_SIZE - (IN_FRAMES == 1 ? 0 : offsets[3 * f]);
        const int row = in / COLUMNS % ROWS - offsets[3 * f + 1], column = in % COLUMNS - offsets[3 * f + 2];
        if (frame >= 0 && frame < IN_FRAMES && row >= 0 && row < ROWS && column >= 0 && column < COLUMNS)
            length = added(list, length, frame * IN_SIZE + in % IN_SIZE / SAMPLES * SAMPLES + row * COLUMNS + column);
    }
    for (int k = 0; k < B * K; k++) {
        const int other = neighbors[s * B * K + k];
        if (other < 0 || match[other * N] < 0)
            continue;
        for (int back = 0; back < B * K; back++) {
            const int self = neighbors[other * B * K + back];
            if (self < 0 || self / SAMPLES != s / SAMPLES || slot[other * N * B * K + back] < 0)
                continue;
            const int in = in_neighbors[match[other * N] * B * K + back / K * K + slot[other * N * B * K + back]];
            // its list holds the nearest sample of each element: go from there along the element
            const int column = in % SAMPLES + s - self;
            if (column >= 0 && column < SAMPLES)
                length = added(list, length, in + s - self);
            break;
        }
    }
    const int coherent_ones = length;
    for (int r = 0; r < SIMILAR; r++)
        for (int c = 0; c < coherent_ones; c++)
            length = added(list, length, similar[list[c] * SIMILAR + r]);
    for (; length < C; length++)
        list[length] = -1;
}
#endif
