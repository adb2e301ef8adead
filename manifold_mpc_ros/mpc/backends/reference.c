/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A target that moves: attitudes R_ND and rates omega_DN_D of the nodes become the numbers that
 * costs are about, and the parts of the limits that the reference uses.
 */

/* Numbers: inertia; how many ellipsoids limit the rate; largest rates about the axes and margins
 * to them, relative; margins to the ellipsoids; E of each; the limits' own numbers for a target
 * that is fixed, and smaller by the margins for one that moves. */
enum { BODY_INERTIA, ELLIPSOIDS = 9, LARGEST_RATES, MARGINS = LARGEST_RATES + 3,
       SHAPES = MARGINS + 3 };

/* Of a step of a half turn, whose torque is then beyond all limits, and not infinite. */
#define LEAST_TRACE 1e-12

/* Of a node: quaternions of E = R_0^T R_k and of the step of its rate, rate, torque. */
enum { TURNED, STEPPED = 4, RATE = 8, OWN_TORQUE = 11, NODE = 14 };

static const struct { int row, size; } rate_places[] = RATE_LIMITS;

/* Put the limits on the rate where the solver reads them. */
static void set_rate_limits(controller *c)
{
    const double *from = c->follow + SHAPES + 10 * (long)c->follow[ELLIPSOIDS];
    if (c->tracking)
        for (size_t i = 0; i < sizeof rate_places / sizeof *rate_places; ++i)
            from += rate_places[i].size;
    for (size_t i = 0; i < sizeof rate_places / sizeof *rate_places; ++i)
        for (int k = 0; k < rate_places[i].size; ++k)
            c->s.g[rate_places[i].row + k] = *from++;
}

/* The largest part of a rate limit, its margin included, that a rate uses. */
static double rate_part(const double *follow, const double rate[3])
{
    long count = (long)follow[ELLIPSOIDS];
    double most = 0.0;
    for (int i = 0; i < 3; ++i)
        if (follow[LARGEST_RATES + i] < INFINITY)
            most = fmax(most, fabs(rate[i]) / follow[LARGEST_RATES + i] + follow[MARGINS + i]);
    for (long k = 0; k < count; ++k) {
        const double *E = follow + SHAPES + count + 9 * k;
        double form = 0.0;
        for (int i = 0; i < 3; ++i)
            form += rate[i] * (E[3 * i] * rate[0] + E[3 * i + 1] * rate[1] + E[3 * i + 2] * rate[2]);
        most = fmax(most, sqrt(form) + follow[SHAPES + k]);
    }
    return most;
}

static void momentum_of(const double *J, const double rate[3], double to[3])
{
    for (int i = 0; i < 3; ++i)
        to[i] = J[3 * i] * rate[0] + J[3 * i + 1] * rate[1] + J[3 * i + 2] * rate[2];
}

/* Write A^T B of rotations row by row. */
static void product_behind(const double *A, const double *B, double *to)
{
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            to[3 * i + j] = A[i] * B[j] + A[3 + i] * B[3 + j] + A[6 + i] * B[6 + j];
}

/* Write the torque that makes the momentum of the second of two nodes of that of the first, with
 * B = R_1^T R_0: (Pi_1 - B Pi_0) / h, for the symmetric forcing with (2 / h) (I + B)^-1 in the place
 * of 1 / h, (I + B)^-1 = (I - c^x) / 2, c the Cayley parameter of B. */
static void torque_between(const controller *c, const double *R, const double *rate, double tau[3])
{
    const double *J = c->follow + BODY_INERTIA;
    double B[9], before[3], after_it[3], change[3], cayley[3] = {0.0, 0.0, 0.0};
    product_behind(R + 9, R, B);
    momentum_of(J, rate, before);
    momentum_of(J, rate + 3, after_it);
    for (int i = 0; i < 3; ++i)
        change[i] = (after_it[i] - B[3 * i] * before[0] - B[3 * i + 1] * before[1]
                     - B[3 * i + 2] * before[2]) / c->step_s;
    if (SYMMETRIC) {
        double trace = fmax(1.0 + B[0] + B[4] + B[8], LEAST_TRACE);
        cayley[0] = (B[7] - B[5]) / trace;
        cayley[1] = (B[2] - B[6]) / trace;
        cayley[2] = (B[3] - B[1]) / trace;
    }
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        tau[i] = change[i] - (cayley[j] * change[k] - cayley[k] * change[j]);
    }
}

/* Turn attitudes and rates about the pointing axis by the roll that the body has, so that rates
 * are compared in its axes. */
static void roll(const controller *c, double *R, double *rates)
{
    const double *b = c->s.g + PARAMETER + POINTING_AXIS;
    double error[9], q[4], turn[9], rolled[9], rate[3];
    product_behind(R, c->s.g + MEASURED, error);
    quaternion_of(error, q);
    double angle = 2.0 * atan2(q[1] * b[0] + q[2] * b[1] + q[3] * b[2], q[0]);
    double sine = sin(angle), rest = 1.0 - cos(angle);
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            turn[3 * i + j] = rest * b[i] * b[j] + (i == j ? 1.0 - rest : 0.0);
    for (int i = 0; i < 3; ++i) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        turn[3 * k + j] += sine * b[i];
        turn[3 * j + k] -= sine * b[i];
    }
    for (long node = 0; node <= c->s.horizon; ++node, R += 9, rates += 3) {
        for (int i = 0; i < 3; ++i) {
            rate[i] = turn[i] * rates[0] + turn[3 + i] * rates[1] + turn[6 + i] * rates[2];
            for (int j = 0; j < 3; ++j)
                rolled[3 * i + j] = R[3 * i] * turn[j] + R[3 * i + 1] * turn[3 + j]
                    + R[3 * i + 2] * turn[6 + j];
        }
        for (int i = 0; i < 9; ++i)
            R[i] = rolled[i];
        for (int i = 0; i < 3; ++i)
            rates[i] = rate[i];
    }
}

/* Plan about the reference in memory, attitudes (N + 1, 9) and rates (N + 1, 3), whose first
 * attitude is the target then; or, with none, about the target alone. */
static void set_reference(controller *c, int moves)
{
    const long n = c->s.horizon;
    double *R = c->reference, *rates = R + 9 * (n + 1), last[4] = {1.0, 0.0, 0.0, 0.0};
    if (!moves && !c->tracking)
        return;
    if (moves != (int)c->tracking) {
        c->tracking = moves;
        set_rate_limits(c);
    }
    if (POINTING && moves)
        roll(c, R, rates);
    c->rate_share = 0.0;
    c->rests = !moves || (rates[3 * n] == 0.0 && rates[3 * n + 1] == 0.0
                          && rates[3 * n + 2] == 0.0);
    for (int i = 0; i < 3; ++i)
        c->torque_share[i] = 0.0;
    double tau[3] = {0.0, 0.0, 0.0};
    double node[NODE] = {1.0, 0.0, 0.0, 0.0, 1.0}, error[9];
    for (long k = 0; k < n + LANES; ++k) {  /* beyond the last node it again */
        const double *rate = rates + 3 * k;
        if (moves && k <= n) {
            if (k < n)
                torque_between(c, R + 9 * k, rate, tau);
            product_behind(R, R + 9 * k, error);
            quaternion_of(error, node + TURNED);
            double sign = node[0] * last[0] + node[1] * last[1] + node[2] * last[2]
                + node[3] * last[3] < 0.0 ? -1.0 : 1.0;
            double half = 0.5 * c->step_s * sqrt(rate[0] * rate[0] + rate[1] * rate[1]
                                                 + rate[2] * rate[2]);
            double scale = 0.5 * c->step_s * (half > 0.0 ? sin(half) / half : 1.0);
            for (int i = 0; i < 4; ++i)
                last[i] = node[TURNED + i] *= sign;
            node[STEPPED] = cos(half);
            for (int i = 0; i < 3; ++i) {
                node[STEPPED + 1 + i] = scale * rate[i];
                node[RATE + i] = rate[i] / c->rate_rad_s;
                node[OWN_TORQUE + i] = tau[i] / c->torque_n_m;
                c->torque_share[i] = fmax(c->torque_share[i],
                                          fabs(tau[i]) / c->torque_limit_n_m[i]);
            }
            c->rate_share = fmax(c->rate_share, rate_part(c->follow, rate));
        }
        for (int i = 0; i < NODE; ++i)
            c->s.model[AT(MODEL_ROWS, REFERENCE + i, k)] = node[i];
    }
    if (moves)
        for (int i = 0; i < 9; ++i)
            c->s.g[MEASURED + 9 + i] = R[i];
    set_level(c);
}
