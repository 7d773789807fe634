// Filling of cells from rotated copies of the sample (wang05 §2.1, §2.2.3, §2.3).
// -D REACH    boundary width D of Eq. 1, pixels
// -D COLUMNS  of a rotated copy, with 16 at the right that are no sample
// -D ROWS     of a rotated copy, with TOGETHER rows above that are no sample
// -D TOGETHER rows of places a work-item compares together
//
// A job is eight ints: the rectangle x0, y0, x1, y1 (its far side not included) with the hole and the boundary around
// it, the rotated copy, its number, whether its error is that of the whole rectangle, and a seed.
// `start` is where a job's pixels begin in what holds one value for each pixel of each job's rectangle.
// The rectangles of the jobs of one launch do not meet: each pixel is written by one work-item.

#define HUGE_ERROR 3.0e38f
#define PITCH (COLUMNS + 16)
#define COPY ((ROWS + TOGETHER) * PITCH)
// strides in which a mask is gone through: its pixels far from each other come first, and most places drop out soon
#define PASSES 8

// §2.2.3: the image mask of each job, with the weight of Eq. 1.
// owner (Y, X): the number of the job whose hole a pixel lies in; weight_of: B for a squared distance 0 ... REACH^2.
// weight: B of each pixel of the rectangle, 1 in the hole, 0 where nothing is written. offset, value: the pixels that
// the error is measured at, as their place in a copy from the rectangle's corner and their luminance; length: how many.
__kernel void masks(__global const int *owner, __global const uchar *valid, __global const float4 *picture, int2 shape,
                    __global const int8 *jobs, __global const int *start, int first, __global const float *weight_of,
                    __global float *weight, __global int *offset, __global float *value, __global int *length) {
    const int number = first + get_global_id(0);
    const int8 job = jobs[number];
    const int width = job.s2 - job.s0, height = job.s3 - job.s1, own = job.s5;
    weight += start[number];
    offset += start[number];
    value += start[number];
    // squared distance along the row, then over the rows
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            __global const int *row = owner + (job.s1 + j) * shape.x + job.s0;
            int nearest = REACH + 1;
            for (int k = max(i - REACH, 0); k <= min(i + REACH, width - 1); k++)
                if (row[k] == own) nearest = min(nearest, max(i - k, k - i));
            offset[j * width + i] = nearest * nearest;
        }
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            const int at = (job.s1 + j) * shape.x + job.s0 + i;
            int squared = (REACH + 1) * (REACH + 1);
            for (int k = max(j - REACH, 0); k <= min(j + REACH, height - 1); k++)
                squared = min(squared, offset[k * width + i] + (j - k) * (j - k));
            const bool written = owner[at] == own || (valid[at] && squared <= REACH * REACH);
            weight[j * width + i] = written ? weight_of[squared] : 0.0f;
        }
    int count = 0;
    for (int pass = 0; pass < PASSES; pass++)
        for (int p = pass; p < width * height; p += PASSES) {
            const int j = p / width, i = p % width, at = (job.s1 + j) * shape.x + job.s0 + i;
            if (weight[p] > 0.0f && valid[at] && (job.s6 || owner[at] != own)) {
                offset[count] = j * PITCH + i;
                value[count] = picture[at].w;
                count++;
            }
        }
    length[number] = count;
}

inline uint16 scrambled(uint16 h) {
    h = (h ^ (h >> 16)) * 0x7feb352du;
    h = (h ^ (h >> 15)) * 0x846ca68bu;
    return h ^ (h >> 16);
}

// Eq. 2 at every place (u, v) of the job's copy at which the whole rectangle is sample; the least error, and of equal
// ones the lowest place v COLUMNS + u. Without a mask any place will do: that with the least of seeded random numbers.
// A place whose sum is above the least so far is given up: no sum can shrink.
// luminance: of the copies; outside (copies, ROWS + TOGETHER + 1, PITCH + 1): how many pixels below and left are no
// sample; error, place: (jobs of this launch, parts), each part every so many rows.
__kernel void best_fit(__global const float *luminance, __global const int *outside, __global const int8 *jobs,
                       __global const int *start, int first, __global const int *offset, __global const float *value,
                       __global const int *length, __global float *error, __global int *place) {
    const int number = first + get_global_id(1), part = get_global_id(0), parts = get_global_size(0);
    const int8 job = jobs[number];
    const int width = job.s2 - job.s0, height = job.s3 - job.s1, count = length[number];
    luminance += job.s4 * COPY;
    outside += job.s4 * (ROWS + TOGETHER + 1) * (PITCH + 1);
    offset += start[number];
    value += start[number];
    const int16 lane = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    float least = HUGE_ERROR;
    int where = INT_MAX;
    for (int v = part * TOGETHER; v + height <= ROWS; v += parts * TOGETHER)
        for (int u = 0; u + width <= COLUMNS; u += 16) {
            float16 sum[TOGETHER];
            float16 smallest = (float16)(HUGE_ERROR);
#pragma unroll
            for (int r = 0; r < TOGETHER; r++) {
                __global const int *low = outside + (v + r) * (PITCH + 1) + u, *high = low + height * (PITCH + 1);
                const int16 missing = vload16(0, high + width) - vload16(0, high)
                    - vload16(0, low + width) + vload16(0, low);
                const uint16 hash = scrambled(convert_uint16((v + r) * COLUMNS + u + lane) ^ (uint)job.s7);
                const float16 begin = count ? (float16)(0.0f) : convert_float16(hash >> 8);
                sum[r] = select(begin, (float16)(HUGE_ERROR), missing > 0);
                smallest = min(smallest, sum[r]);
            }
            if (!any(smallest < HUGE_ERROR)) continue;
            __global const float *corner = luminance + v * PITCH + u;
            for (int m = 0; m < count;) {
                for (const int end = min(m + 16, count); m < end; m++) {
                    const float16 F = (float16)(value[m]);
#pragma unroll
                    for (int r = 0; r < TOGETHER; r++) {
                        const float16 difference = F - vload16(0, corner + offset[m] + r * PITCH);
                        sum[r] = fma(difference, difference, sum[r]);
                    }
                }
                smallest = sum[0];
#pragma unroll
                for (int r = 1; r < TOGETHER; r++) smallest = min(smallest, sum[r]);
                if (!any(smallest <= least)) break;
            }
            if (!any(smallest <= least)) continue;
#pragma unroll
            for (int r = 0; r < TOGETHER; r++) {
                float sums[16];
                vstore16(sum[r], 0, sums);
                for (int k = 0; k < 16; k++) {
                    const int at = (v + r) * COLUMNS + u + k;
                    if (sums[k] < least || (sums[k] == least && sums[k] < HUGE_ERROR && at < where)) {
                        least = sums[k];
                        where = at;
                    }
                }
            }
        }
    error[get_global_id(1) * parts + part] = least;
    place[get_global_id(1) * parts + part] = where;
}

// §2.2.3: paste the best fit into the hole and blend it with what surrounds it by Eq. 1.
// What is pasted has gone through no blending, what is blended through one more (`counts`: 1, or 0 where blendings of
// this kind do not count). The texture has the copy's direction where the copy weighs more.
__kernel void paste(__global const float4 *copies, __global const int8 *jobs, __global const int *start, int first,
                    __global const float *weight, __global const float *error, __global const int *place, int parts,
                    int counts, int2 shape, __global const int *owner, __global float4 *picture,
                    __global uchar *valid, __global int *blendings, __global int *direction) {
    const int number = first + get_global_id(0);
    const int8 job = jobs[number];
    const int width = job.s2 - job.s0, height = job.s3 - job.s1;
    weight += start[number];
    float least = HUGE_ERROR;
    int where = INT_MAX;
    for (int k = get_global_id(0) * parts; k < ((int)get_global_id(0) + 1) * parts; k++)
        if (error[k] < least || (error[k] == least && place[k] < where)) {
            least = error[k];
            where = place[k];
        }
    copies += job.s4 * COPY + where / COLUMNS * PITCH + where % COLUMNS;
    for (int j = 0; j < height; j++)
        for (int i = 0; i < width; i++) {
            const int at = (job.s1 + j) * shape.x + job.s0 + i;
            const float B = weight[j * width + i];
            if (owner[at] == job.s5) {
                picture[at] = copies[j * PITCH + i];
                valid[at] = 1;
                blendings[at] = 0;
                direction[at] = job.s4;
            } else if (B > 0.0f) {
                picture[at] = B * copies[j * PITCH + i] + (1.0f - B) * picture[at];
                blendings[at] += counts;
                if (B > 0.5f) direction[at] = job.s4;
            }
        }
}
