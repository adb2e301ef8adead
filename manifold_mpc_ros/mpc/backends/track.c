/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * References that move: from attitudes and rates of what is commanded to the numbers that costs
 * are about. Plain C99.
 */

/* Of a step of a half turn, whose torque is then beyond all limits, and not infinite. */
#define LEAST_TRACE 1e-12

/* Write A^T B, matrices row by row. */
static void transposed_times(const double *A, const double *B, double *to)
{
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            to[3 * i + j] = A[i] * B[j] + A[3 + i] * B[3 + j] + A[6 + i] * B[6 + j];
}

/* Write the unit quaternion of a rotation, on the side of another: the row of 4 q q^T with the
 * largest diagonal entry, normalised. */
static void quaternion_of(const double R[9], const double side[4], double q[4])
{
    const double a = R[7] - R[5], b = R[2] - R[6], c = R[3] - R[1];
    const double d = R[1] + R[3], e = R[2] + R[6], f = R[5] + R[7];
    const double outer[4][4] = {
        {1.0 + R[0] + R[4] + R[8], a, b, c}, {a, 1.0 + R[0] - R[4] - R[8], d, e},
        {b, d, 1.0 - R[0] + R[4] - R[8], f}, {c, e, f, 1.0 - R[0] - R[4] + R[8]}};
    int row = 0;
    double size = 0.0, along = 0.0;
    for (int i = 1; i < 4; ++i)
        row = outer[i][i] > outer[row][row] ? i : row;
    for (int i = 0; i < 4; ++i) {
        size += outer[row][i] * outer[row][i];
        along += outer[row][i] * side[i];
    }
    for (int i = 0; i < 4; ++i)
        q[i] = outer[row][i] / (along < 0.0 ? -sqrt(size) : sqrt(size));
}

/* Write J omega. */
static void momentum_of(const double J[9], const double omega[3], double to[3])
{
    for (int i = 0; i < 3; ++i)
        to[i] = J[3 * i] * omega[0] + J[3 * i + 1] * omega[1] + J[3 * i + 2] * omega[2];
}

/* Write the torque [N m] that makes the momentum of node 1 of that of node 0, B = R_1^T R_0:
 * (Pi_1 - B Pi_0) / h, for the symmetric forcing with (2 / h) (I + B)^-1 in the place of 1 / h,
 * (I + B)^-1 = (I - c^x) / 2, c the Cayley parameter of B. */
static void torque_between(const double *R, const double *omega, const double J[9],
                           double step_s, int symmetric, double torque[3])
{
    double B[9], before[3], after_it[3], change[3], c[3] = {0.0, 0.0, 0.0};
    transposed_times(R + 9, R, B);
    momentum_of(J, omega, before);
    momentum_of(J, omega + 3, after_it);
    for (int i = 0; i < 3; ++i)
        change[i] = (after_it[i] - B[3 * i] * before[0] - B[3 * i + 1] * before[1]
                     - B[3 * i + 2] * before[2]) / step_s;
    if (symmetric) {
        double trace = fmax(1.0 + B[0] + B[4] + B[8], LEAST_TRACE);
        c[0] = (B[7] - B[5]) / trace;
        c[1] = (B[2] - B[6]) / trace;
        c[2] = (B[3] - B[1]) / trace;
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        torque[i] = change[i] - (c[j] * change[k] - c[k] * change[j]);
    }
}

/* Set what costs are about at every node: quaternions of E_k = R_0^T R_k and exp(h omega_k),
 * rate, torque. R (N + 1, 9), omega (N + 1, 3) [rad/s], J (3, 3) [kg m^2]; beyond the last node
 * that one again. Write to `used` the largest |torque| (3,) [N m] and |omega| (3,) [rad/s]. */
static void track(controller *c, const double *R, const double *omega, const double *J,
                  int symmetric, double used[6])
{
    long n = c->s.horizon, stages = (n / LANES + 2) * LANES;
    double node[14] = {1.0}, torque[3] = {0.0}, E[9];
    for (int i = 0; i < 6; ++i)
        used[i] = 0.0;
    for (long k = 0; k < stages; ++k) {
        if (k <= n) {
            const double *rate = omega + 3 * k;
            double half[3], size = 0.0;
            double side[4] = {node[0], node[1], node[2], node[3]};
            transposed_times(R, R + 9 * k, E);
            quaternion_of(E, side, node);
            if (k < n)
                torque_between(R + 9 * k, rate, J, c->step_s, symmetric, torque);
            for (int i = 0; i < 3; ++i) {
                half[i] = 0.5 * c->step_s * rate[i];
                size += half[i] * half[i];
                node[8 + i] = rate[i] / c->rate_rad_s;
                node[11 + i] = torque[i] / c->torque_n_m;
                used[i] = fmax(used[i], fabs(torque[i]));
                used[3 + i] = fmax(used[3 + i], fabs(rate[i]));
            }
            size = sqrt(size);
            node[4] = cos(size);
            for (int i = 0; i < 3; ++i)
                node[5 + i] = (size > 0.0 ? sin(size) / size : 1.0) * half[i];
        }
        for (int i = 0; i < 14; ++i)
            c->s.model[AT(MODEL_ROWS, REFERENCE + i, k)] = node[i];
    }
}
