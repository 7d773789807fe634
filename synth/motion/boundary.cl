// The soft boundary condition (ma09 §3.6, Eq. 3), cell by cell of those near a wall.
// -D DIMENSION  components of a vector, 2 or 3
// -D STRIDE     numbers in a cell of x, as many or one unused one more

// cells (K) flat indices, each once; normal (K, DIMENSION); target, weight (K): b and lambda; hold: how strongly a
// cell is held to the frame before; x: changed in place
__kernel void impose(__global const int *cells, __global const float *normal, __global const float *target,
                     __global const float *weight, __global const float *hold, __global float *x) {
    const int k = get_global_id(0), cell = cells[k];
    float missing = target[k];
    for (int i = 0; i < DIMENSION; i++) missing -= normal[k * DIMENSION + i] * x[cell * STRIDE + i];
    const float shift = weight[k] / (1.0f + hold[cell] + weight[k]) * missing;
    for (int i = 0; i < DIMENSION; i++) x[cell * STRIDE + i] += shift * normal[k * DIMENSION + i];
}
