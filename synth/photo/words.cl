// Eq. 1 of words.py: of each of `nodes` histograms, how many points it has in common with each of TILE others.
// first (nodes + 1): where a histogram's words begin in `word` and `count`; only those that it has are there.
// theirs (tiles, words, TILE) uchar, counts. out (nodes, tiles, TILE). One work-item is a tile. Sums are below 256.
kernel void common(global const int *restrict first, global const ushort *restrict word,
                   global const uchar *restrict count, global const uchar16 *restrict theirs, const int words,
                   const int nodes, global uchar16 *restrict out) {
    const size_t tile = get_global_id(0), tiles = get_global_size(0);
    global const uchar16 *own = theirs + tile * words * (TILE / 16);
    for (int p = 0; p < nodes; p++) {
        uchar16 sum[TILE / 16];
        for (int j = 0; j < TILE / 16; j++) sum[j] = 0;
        for (int k = first[p]; k < first[p + 1]; k++) {
            const uchar16 most = count[k];
            for (int j = 0; j < TILE / 16; j++) sum[j] += min(own[word[k] * (TILE / 16) + j], most);
        }
        for (int j = 0; j < TILE / 16; j++) out[(p * tiles + tile) * (TILE / 16) + j] = sum[j];
    }
}
