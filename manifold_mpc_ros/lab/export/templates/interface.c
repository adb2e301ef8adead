
/* The interface of manifold_mpc.h. */

struct manifold_mpc {
    controller c;
};

typedef char struct_fits[sizeof(manifold_mpc) <= 64 * sizeof(double) ? 1 : -1];

static const start starts[] = MANIFOLD_MPC_STARTS;

/* Shares of the limits below this are not left to the local law. */
#define LEAST_SHARE @LEAST_SHARE@
/* A quaternion whose norm is farther than this from 1 is none. */
#define NORM_DEFECT 1e-3

static void set_numbers(double *g)
{
@SET_NUMBERS@
}

static double *slice(double **from, size_t doubles)
{
    double *part = *from;
    *from += doubles;
    return part;
}

manifold_mpc *manifold_mpc_init(void *memory, size_t bytes)
{
    const long n = MANIFOLD_MPC_HORIZON;
    const size_t stages = MANIFOLD_MPC_HORIZON + 3;
    const double unit[4] = MANIFOLD_MPC_UNITS;
    if (memory == NULL || bytes < MANIFOLD_MPC_MEMORY_DOUBLES * sizeof(double)
        || (uintptr_t)memory % sizeof(double) != 0)
        return NULL;
    double *next = memory;
    for (size_t i = 0; i < MANIFOLD_MPC_MEMORY_DOUBLES; ++i)
        next[i] = 0.0;
    manifold_mpc *mpc = memory;
    controller *c = &mpc->c;
    static const controller empty;
    *c = empty;
    next += 64;
    c->s.g = slice(&next, GLOBAL_ROWS);
    c->s.model = slice(&next, stages * MODEL_ROWS);
    double **plans[5];
    plans[0] = &c->s.plan;
    plans[1] = &c->s.fresh;
    plans[2] = &c->kept.memory;
    plans[3] = &c->best.memory;
    plans[4] = &c->other.memory;
    for (int i = 0; i < 5; ++i)
        *plans[i] = slice(&next, stages * TRAJECTORY_ROWS);
    c->answer = next;
    c->s.horizon = n;
    c->starts = starts;
    c->start_count = (long)(sizeof starts / sizeof *starts);
    c->time_s = unit[0];
    c->torque_n_m = unit[1];
    c->rate_rad_s = unit[2];
    c->cost = unit[3];
    c->step_s = MANIFOLD_MPC_STEP_S;
    c->quickest = MANIFOLD_MPC_QUICKEST_RAD_S2;
    c->linear_rad = MANIFOLD_MPC_LINEAR_RAD;
    c->guard_squared = MANIFOLD_MPC_GUARD_SQUARED;
    c->deadline_s = INFINITY;
    c->allowed = c->inside = 1;
    set_numbers(c->s.g);
    c->level = c->s.g[PARAMETER + TERMINAL_LEVEL];
    for (int i = 0; i < 18; ++i)
        c->s.g[FORESEEN + i] = i % 9 % 4 == 0;
    prepare(&c->s);
    return mpc;
}

void manifold_mpc_reset(manifold_mpc *mpc)
{
    mpc->c.warm = 0;
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

/* Plan in the net torque under a disturbance: the torque box moves, and the terminal level is cut
 * by the square of what the disturbance leaves of the limits. Return whether it is below them. */
static int disturb(controller *c, const double d[3])
{
    for (int i = 0; i < 3; ++i) {
        if (!(fabs(d[i]) < INFINITY))
            return 0;
        c->disturbance_n_m[i] = d[i];
    }
#ifdef SHIFTED_TORQUE_BOX_DATA
    static const double limit_n_m[3] = MANIFOLD_MPC_MAX_TORQUE_N_M;
    double used = 0.0;
    for (int i = 0; i < 3; ++i) {
        if (!(fabs(d[i]) < limit_n_m[i]))
            return 0;
        used = fmax(used, fabs(d[i]) / limit_n_m[i]);
        c->s.g[SHIFTED_TORQUE_BOX_DATA + 3 + i] = d[i] / c->torque_n_m;
    }
    double left = fmax(LEAST_SHARE, 1.0 - used);
    if (HAS_TERMINAL_SET)
        c->level = left * left * MANIFOLD_MPC_TERMINAL_LEVEL / c->cost;
#endif
    return 1;
}

int manifold_mpc_solve(manifold_mpc *mpc, const manifold_mpc_state *state,
                       manifold_mpc_result *result)
{
    controller *c = &mpc->c;
    double *g = c->s.g;
    const double *answer = c->answer;
    const long n = c->s.horizon;
    for (int i = 0; i < 3; ++i)
        g[MEASURED + 18 + i] = state->rate_rad_s[i];
    if (write_rotation(state->attitude_xyzw, g + MEASURED)
        && write_rotation(state->target_xyzw, g + MEASURED + 9)
        && disturb(c, state->disturbance_n_m)) {
        answer_state(c, 0);
    } else {
        c->warm = 0;
        c->answer[STATUS] = STATUS_FAILED;
        c->answer[PASSES] = c->answer[SEARCHED] = 0.0;
    }
    result->status = (int32_t)answer[STATUS];
    result->passes = (int32_t)answer[PASSES];
    result->searched = (int32_t)answer[SEARCHED];
    int failed = result->status == MANIFOLD_MPC_FAILED;
    for (int i = 0; i < 3; ++i)
        result->torque_n_m[i] = failed ? 0.0 : answer[TORQUES + i];
    result->cost = failed ? NAN : answer[COST];
    result->promised_cost = failed ? NAN : answer[PROMISED];
    result->kkt_residual = failed ? INFINITY : answer[RESIDUAL];
    result->violation = failed ? INFINITY : answer[WORST];
    result->terminal_ratio = failed ? NAN : answer[RATIO];
    result->torques_n_m = failed ? NULL : answer + TORQUES;
    result->rotations_NB = failed ? NULL : answer + TORQUES + 3 * n;
    result->rates_rad_s = failed ? NULL : answer + TORQUES + 3 * n + 9 * (n + 1);
    return result->status;
}
