// What two histograms have in common, words.py's Eq. 1: out (P, N) ushort, sums of the least of two counts.
// ours (P, 16 blocks), theirs (N, 16 blocks) uchar. One work-item is a pair. Counts of a histogram are below 2^16 in all.
kernel void common(global const uchar *restrict ours, global const uchar *restrict theirs, const int blocks,
                   global ushort *restrict out) {
    const int n = get_global_id(0), p = get_global_id(1), count = get_global_size(0);
    ushort16 sum = (ushort16)(0);
    for (int k = 0; k < blocks; k++)
        sum += convert_ushort16(min(vload16(p * blocks + k, ours), vload16(n * blocks + k, theirs)));
    const ushort8 eight = sum.lo + sum.hi;
    const ushort4 four = eight.lo + eight.hi;
    const ushort2 two = four.lo + four.hi;
    out[p * count + n] = two.x + two.y;
}
