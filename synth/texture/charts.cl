// The charts of vertices of a mesh. charts.py holds the NumPy reference, which this kernel matches bit for bit.
//
//   -DWAYS  from each vertex, at most

#pragma OPENCL FP_CONTRACT OFF  // a fused multiply-add would round differently from the reference

inline float dot_of(float3 a, float3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

// Where the vertices of chart c lie in it: places[first[c]] to places[first[c + 1]], the nearest vertex first; each at
// the mean of the ways from nearer ones. One work-item is a chart.
// vertex, away: of each entry, its vertex and how far it is; entry (charts, count + 1): of each vertex its entry, -1
// where it has none; beside, to, normal, size (count, WAYS): as in charts.py; bases (count, 2) and normals (count)
kernel void lay(global const int *restrict first, global const int *restrict vertex, global const float *restrict away,
                global const int *restrict entry, global const int *restrict beside, global const float *restrict to,
                global const float *restrict normal, global const float *restrict size, const int count,
                global const float *restrict bases, global const float *restrict normals,
                global float2 *restrict places) {
    const int c = get_global_id(0), source = vertex[first[c]];
    const float3 along = vload3(2 * source, bases), across = vload3(2 * source + 1, bases);
    const float3 up = vload3(source, normals);
    places[first[c]] = (float2)(0.0f);
    for (int k = first[c] + 1; k < first[c + 1]; k++) {
        float2 sum = (float2)(0.0f);
        float total = 0.0f;
        for (int j = 0; j < WAYS; j++) {
            const int way = vertex[k] * WAYS + j, from = entry[c * (count + 1) + beside[way]];
            if (from < 0 || from >= k) continue;
            const float3 e = vload3(way, to), n = vload3(way, normal), middle = n + up;
            const float share = dot_of(e, middle) / fmax(1.0f + dot_of(n, up), 0.05f);
            const float3 turned = e - share * middle;
            const float gain = (away[k] - away[from]) / size[way], squared = gain * gain, w = squared * squared;
            sum += w * (places[from] + (float2)(dot_of(turned, along), dot_of(turned, across)));
            total += w;
        }
        places[k] = sum / (total > 0.0f ? total : 1.0f);
    }
}
