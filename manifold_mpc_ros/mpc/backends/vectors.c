/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Vectors (3,), and what a rotation makes of them.
 */

/* v_N = R v_B of a rotation row by row. */
static void turned(const double *R, const double v[3], double to[3])
{
    double product[3];
    for (int i = 0; i < 3; ++i)
        product[i] = R[3 * i] * v[0] + R[3 * i + 1] * v[1] + R[3 * i + 2] * v[2];
    for (int i = 0; i < 3; ++i)
        to[i] = product[i];
}

static double inner(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double to[3])
{
    double product[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                         a[0] * b[1] - a[1] * b[0]};
    for (int i = 0; i < 3; ++i)
        to[i] = product[i];
}

static double length_of(const double v[3])
{
    return sqrt(inner(v, v));
}
