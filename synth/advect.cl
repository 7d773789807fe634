// Semi-Lagrangian advection [Stam 1999] on a grid of X * Y * Z cells; 2-D is Z = 1.
// One work-item per cell, gather only. advect.py holds the NumPy reference, which these kernels match bit for bit.
//
//   -DDIMS      2 or 3: components of a velocity, axes of the interpolation
//   -DCHANNELS  1, 2, 3, 4, 8 or 16: floats per cell of the advected quantity, interleaved
//   -DBORDER    CLAMP, ZERO or TOROIDAL: what lies beyond the last cell

#pragma OPENCL FP_CONTRACT OFF  // a fused multiply-add would round differently from the reference

#define CLAMP 0
#define ZERO 1
#define TOROIDAL 2

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#if CHANNELS == 1
typedef float quantity;
#define LOAD(cell, q) (q)[cell]
#define STORE(value, cell, q) (q)[cell] = (value)
#else
typedef JOIN(float, CHANNELS) quantity;
#define LOAD(cell, q) JOIN(vload, CHANNELS)(cell, q)
#define STORE(value, cell, q) JOIN(vstore, CHANNELS)(value, cell, q)
#endif

typedef JOIN(float, DIMS) velocity;
#define LOAD_VELOCITY(cell, v) JOIN(vload, DIMS)(cell, v)

// Index of the cell that stands for coordinate i of an axis of n cells.
inline int inside(int i, int n)
{
#if BORDER == TOROIDAL
    i %= n;
    return i < 0 ? i + n : i;
#else
    return clamp(i, 0, n - 1);
#endif
}

// floor() as an integer: two conversions and a comparison, which CPU devices vectorise where they call floor().
inline int whole(float d)
{
    const int towards_zero = (int)d;
    return towards_zero - (d < (float)towards_zero);
}

// Where a departure point lies: the cell before it along an axis, and the fraction of a cell beyond that.
// The fraction is taken from the displacement alone, so it has the same precision everywhere on the grid.
#define SPLIT(base, fraction, cell, displacement)   \
    const int base = (cell) + whole(displacement);  \
    const float fraction = (displacement) - (float)whole(displacement)

// (1 - t) a + t b is exact at t = 0 and t = 1; mix() is not.
#define LERP(a, b, t) ((1.0f - (t)) * (a) + (t) * (b))

#if BORDER == ZERO
#define OUTSIDE(i, n) ((i) < 0 || (i) >= (n))
#define CORNER(i, j, k) \
    (OUTSIDE(i, X) || OUTSIDE(j, Y) || OUTSIDE(k, Z) ? (quantity)(0.0f) \
                                                     : LOAD(((k) * Y + (j)) * X + (i), q))
#else
#define CORNER(i, j, k) LOAD((inside(k, Z) * Y + inside(j, Y)) * X + inside(i, X), q)
#endif

#define NEAR(i, j, k) LOAD(((k) * Y + (j)) * X + (i), q)  // where no border is in the way

#define SQUARE(value, k)                                                     \
    LERP(LERP(value(i, j, k), value(i + 1, j, k), u), LERP(value(i, j + 1, k), value(i + 1, j + 1, k), u), v)

// Displacement from each cell centre back to where its content was dt frames ago, by the midpoint rule (RK2):
// d = -dt velocity(x - dt/2 velocity(x)). Both arrays are (cells, DIMS), in cells.
kernel void departure(global const float *restrict velocities, global float *restrict displacements,
                      const float dt, const int X, const int Y, const int Z)
{
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    if (x >= X) return;  // rows are padded to whole work-groups
    const int cell = (z * Y + y) * X + x;
    const velocity half_way = (-0.5f * dt) * LOAD_VELOCITY(cell, velocities);
    SPLIT(i, u, x, half_way.x);
    SPLIT(j, v, y, half_way.y);
#define VELOCITY(i, j, k) LOAD_VELOCITY((inside(k, Z) * Y + inside(j, Y)) * X + inside(i, X), velocities)
#if DIMS == 3
    SPLIT(k, w, z, half_way.z);
    const velocity middle = LERP(SQUARE(VELOCITY, k), SQUARE(VELOCITY, k + 1), w);
#else
    const velocity middle = SQUARE(VELOCITY, z);
#endif
    JOIN(vstore, DIMS)(-dt * middle, cell, displacements);
}

// q(x + d), linearly interpolated; q is (cells, CHANNELS).
inline quantity displaced(global const float *restrict q, const velocity d, const int x, const int y, const int z,
                          const int X, const int Y, const int Z)
{
    SPLIT(i, u, x, d.x);
    SPLIT(j, v, y, d.y);
#if DIMS == 3
    SPLIT(k, w, z, d.z);
    const bool interior = i >= 0 & i < X - 1 & j >= 0 & j < Y - 1 & k >= 0 & k < Z - 1;
    return interior ? LERP(SQUARE(NEAR, k), SQUARE(NEAR, k + 1), w)
                    : LERP(SQUARE(CORNER, k), SQUARE(CORNER, k + 1), w);
#else
    const bool interior = i >= 0 & i < X - 1 & j >= 0 & j < Y - 1;
    return interior ? SQUARE(NEAR, z) : SQUARE(CORNER, z);
#endif
}

// q(x + d(x)); d is (cells, DIMS).
inline quantity at_departure(global const float *restrict q, global const float *restrict displacements,
                             const int x, const int y, const int z, const int X, const int Y, const int Z)
{
    return displaced(q, LOAD_VELOCITY((z * Y + y) * X + x, displacements), x, y, z, X, Y, Z);
}

// One step: out = q carried along d.
kernel void advect(global const float *restrict q, global const float *restrict displacements,
                   global float *restrict out, const int X, const int Y, const int Z)
{
    const int x = get_global_id(0), y = get_global_id(1), z = get_global_id(2);
    if (x >= X) return;
    STORE(at_departure(q, displacements, x, y, z, X, Y, Z), (z * Y + y) * X + x, out);
}
