/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The controller's memory, and the level of the terminal set: what disturbance, reference, wheels
 * and cones leave of it. Plain C99, no allocation.
 */

enum { STATUS_CONVERGED, STATUS_FEASIBLE, STATUS_INFEASIBLE, STATUS_FAILED };

/* A start of the search: signs or axis of a lean (x, y, z), and whether it goes the long way. */
typedef double start[4];

/* A plan that was kept, and how far its solve was. */
typedef struct {
    double *memory;
    double cost, residual;
    long flag;
} plan;

typedef struct controller {
    solve s;
    plan kept, best, other;     /* of the last tick; of this one; while that is compared */
    const start *starts;
    double *answer;             /* STATUS .. LOCAL_S, torques (N, 3), R_NB (N + 1, 9), rates (N + 1, 3) */
    const double *reported;     /* the plan that the report in g is of */
    double *ways;               /* (VIAS, 2): ways round cones, what they violate and their length */
    const double *cones, *wheels, *follow;  /* numbers of cones.c, wheels.c, reference.c */
    const double *periods;      /* of every step, NULL for equal ones */
    double *reference;          /* attitudes (N + 1, 9) and rates (N + 1, 3) of a target that moves */
    double *momentum;           /* (2, n): of wheels, those given and those planned with [N m s] */
    double time_s, torque_n_m, rate_rad_s, cost;    /* units */
    double step_s, quickest, linear_rad, guard_squared, level;
    double disturbance_n_m[3];
    double value_bound, deadline_s, local_s;
    /* c without cones and with them; its part that is used, by wheels alone and in all. */
    double whole_level, cone_level, wheel_share, share;
    /* Parts of the limits that a reference uses, and the largest in all. */
    double rate_share, limits_used;
    double torque_limit_n_m[3], torque_share[3], aimed[9];
    /* allowed: the terminal set exists. warm: there is a plan to begin from. inside: the last plan
     * ended in the set. violating: it violated a limit. free: none held it back. tracking: a reference moves; rests: not at
     * the end of the horizon. missing: one and the place of a cone of which nothing is left.
     * as_configured: cones have the directions of the configuration. held: plans keep to what wheels
     * give whose null space rests. */
    long start_count, wheel_count, cone_count, allowed, warm, inside, violating, free, passes, searched;
    long tracking, rests, missing, as_configured, held;
} controller;

enum { STATUS, PASSES, SEARCHED, COST, RESIDUAL, WORST, PROMISED, RATIO, LOCAL_S, TORQUES };

static void use_set(controller *c, int with)
{
    c->s.g[PARAMETER + TERMINAL_LEVEL] = with ? c->level : NO_LEVEL / c->cost;
}

/* What limits leave for the local law shrinks its set: c by the square of the part that the
 * largest use of a limit leaves. A reference at rest at the end of the horizon uses none there. */
static void set_level(controller *c)
{
    double acting = 0.0, both = c->rate_share;
    for (int i = 0; i < 3; ++i) {
        double part = fabs(c->disturbance_n_m[i]) / c->torque_limit_n_m[i];
        acting = fmax(acting, part);
        both = fmax(both, c->torque_share[i] + part);
    }
    double left = fmax(LEAST_SHARE, 1.0 - (c->rests ? acting : both));
    c->limits_used = both;
    c->share = left * left * c->wheel_share;
    c->level = (HAS_TERMINAL_SET ? c->share * c->cone_level : c->whole_level) / c->cost;
}

/* Plan in the net torque under a disturbance (3,) [N m]: the torque box moves. */
static void disturb(controller *c, const double d[3])
{
    for (int i = 0; i < 3; ++i) {
        c->disturbance_n_m[i] = d[i];
#ifdef SHIFTED_TORQUE_BOX_DATA
        c->s.g[SHIFTED_TORQUE_BOX_DATA + 3 + i] = d[i] / c->torque_n_m;
#endif
    }
    set_level(c);
}

/* Write the quaternion of a rotation: of the rows of 4 q q^T that with the largest diagonal
 * element, normalised. Its sign is that row's. */
static void quaternion_of(const double *R, double q[4])
{
    double outer[4][4] = {
        {1.0 + R[0] + R[4] + R[8], R[7] - R[5], R[2] - R[6], R[3] - R[1]},
        {R[7] - R[5], 1.0 + R[0] - R[4] - R[8], R[1] + R[3], R[2] + R[6]},
        {R[2] - R[6], R[1] + R[3], 1.0 - R[0] + R[4] - R[8], R[5] + R[7]},
        {R[3] - R[1], R[2] + R[6], R[5] + R[7], 1.0 - R[0] - R[4] + R[8]}};
    int row = 0;
    for (int i = 1; i < 4; ++i)
        if (outer[i][i] > outer[row][row])
            row = i;
    double sum = 0.0;
    for (int i = 0; i < 4; ++i)
        sum += outer[row][i] * outer[row][i];
    double length = sqrt(sum);
    for (int i = 0; i < 4; ++i)
        q[i] = outer[row][i] / length;
}

/* Write R(q) row by row; return whether q is a unit quaternion but for rounding. */
static int write_rotation(const double q[4], double *R)
{
    double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (!(fabs(norm - 1.0) <= NORM_DEFECT))
        return 0;
    double x = q[0] / norm, y = q[1] / norm, z = q[2] / norm, w = q[3] / norm;
    R[0] = 1.0 - 2.0 * (y * y + z * z);
    R[1] = 2.0 * (x * y - w * z);
    R[2] = 2.0 * (x * z + w * y);
    R[3] = 2.0 * (x * y + w * z);
    R[4] = 1.0 - 2.0 * (x * x + z * z);
    R[5] = 2.0 * (y * z - w * x);
    R[6] = 2.0 * (x * z - w * y);
    R[7] = 2.0 * (y * z + w * x);
    R[8] = 1.0 - 2.0 * (x * x + y * y);
    return 1;
}

/* Move the state in globals, g[MEASURED] and its rate [rad/s], on under a torque (3,) [N m] that acts
 * for so long [s], in equal steps no longer than the controller's; g may be memory of its own.
 * The attitude is that of the quaternion xyzw then. Return 0 where the implicit step is not
 * guaranteed. */
static int move_on(const controller *c, double *g, const double torque_n_m[3], double seconds,
                   double xyzw[4])
{
    double steps = ceil(seconds / c->step_s), part = seconds / steps;
    if (!(seconds > 0.0 && steps < 1e6))
        return 0;
    for (int i = 0; i < 9; ++i)
        g[BODY + i] = c->s.g[PARAMETER + i];
    for (int i = 0; i < 3; ++i) {
        g[BODY + 9 + i] = 0.0;
        g[APPLIED + i] = torque_n_m[i] / c->torque_n_m * (part / c->time_s) * (part / c->time_s);
        g[MEASURED + 18 + i] *= part;
    }
    for (double done = 0.0; done < steps; done += 1.0) {
        double squared = 0.0;
        for (int i = 0; i < 3; ++i) {
            double momentum = 0.5 * g[APPLIED + i];
            for (int j = 0; j < 3; ++j)
                momentum += g[BODY + 3 * i + j] * g[MEASURED + 18 + j];
            squared += momentum * momentum;
        }
        if (!(squared < c->guard_squared))
            return 0;
        run_motion(NULL, NULL, NULL, g, 0);
    }
    double q[4];
    quaternion_of(g + MEASURED, q);
    for (int i = 0; i < 4; ++i)
        xyzw[i] = q[(i + 1) % 4];
    for (int i = 0; i < 3; ++i)
        g[MEASURED + 18 + i] /= part;
    return write_rotation(xyzw, g + MEASURED);
}
