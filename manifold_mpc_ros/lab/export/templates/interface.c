/* The interface of manifold_mpc.h. */

struct manifold_mpc {
    controller c;
};

typedef char struct_fits[sizeof(manifold_mpc) <= @STRUCT_DOUBLES@ * sizeof(double) ? 1 : -1];

static const start starts[] = MANIFOLD_MPC_STARTS;
@ARRAYS@

/* A quaternion whose norm is farther than this from 1 is none. */

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
    const size_t n = MANIFOLD_MPC_HORIZON, stages = n + 3;
    const double unit[4] = MANIFOLD_MPC_UNITS, torque_limit_n_m[3] = MANIFOLD_MPC_MAX_TORQUE_N_M;
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
    next += @STRUCT_DOUBLES@;
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
    c->answer = slice(&next, 21 + 15 * n);
#ifdef AIM
    c->ways = slice(&next, 2 * VIAS);
#endif
#ifdef REFERENCE
    c->reference = slice(&next, 12 * (n + 1));
#endif
    c->momentum = slice(&next, 2 * MANIFOLD_MPC_WHEEL_COUNT);
    c->s.horizon = MANIFOLD_MPC_HORIZON;
    c->starts = starts;
    c->start_count = (long)(sizeof starts / sizeof *starts);
    c->wheel_count = MANIFOLD_MPC_WHEEL_COUNT;
    c->cone_count = MANIFOLD_MPC_CONE_COUNT;
    c->time_s = unit[0];
    c->torque_n_m = unit[1];
    c->rate_rad_s = unit[2];
    c->cost = unit[3];
    c->step_s = MANIFOLD_MPC_STEP_S;
    c->quickest = MANIFOLD_MPC_QUICKEST_RAD_S2;
    c->linear_rad = MANIFOLD_MPC_LINEAR_RAD;
    c->guard_squared = MANIFOLD_MPC_GUARD_SQUARED;
    c->whole_level = MANIFOLD_MPC_TERMINAL_LEVEL;
    for (int i = 0; i < 3; ++i)
        c->torque_limit_n_m[i] = torque_limit_n_m[i];
@POINT@
    set_numbers(c->s.g);
    begin_controller(c);
    return mpc;
}

void manifold_mpc_reset(manifold_mpc *mpc)
{
    mpc->c.warm = 0;
}

/* Whether a disturbance is below the limits on the torque; then it is planned with. */
static int take_disturbance(controller *c, const double d[3])
{
    for (int i = 0; i < 3; ++i)
        if (!(fabs(d[i]) < c->torque_limit_n_m[i]))
            return 0;
    disturb(c, d);
    return 1;
}

/* Whether a reference can be planned about; none can. Its first attitude is the target then. */
static int take_reference(controller *c, const manifold_mpc_state *state)
{
#ifdef REFERENCE
    const long n = c->s.horizon;
    const double *q = state->reference_xyzw, *rates = state->reference_rad_s;
    double *to = c->reference + 9 * (n + 1);
    if (q && !rates)
        return 0;
    for (long k = 0; q && k <= n; ++k)
        if (!write_rotation(q + 4 * k, c->reference + 9 * k))
            return 0;
    for (long i = 0; q && i < 3 * (n + 1); ++i) {
        if (!(fabs(rates[i]) < INFINITY))
            return 0;
        to[i] = rates[i];
    }
    if (q)
        for (int i = 0; i < 9; ++i)
            c->s.g[MEASURED + 9 + i] = c->reference[i];
    set_reference(c, q != NULL);
    return 1;
#else
    (void)c;
    return state->reference_xyzw == NULL;
#endif
}

static int take_directions(controller *c, const double *directions_N)
{
#ifdef AIM
    return set_directions(c, directions_N);
#else
    (void)c;
    return directions_N == NULL;
#endif
}

/* Whether momenta of wheels are numbers, NaN among them; none: all at rest. */
static int take_momenta(controller *c, const manifold_mpc_state *state)
{
    const double *momentum_n_m_s = state->wheel_momentum_n_m_s;
    c->held = state->wheel_null_space_rests;
    for (long i = 0; i < c->wheel_count; ++i) {
        c->momentum[i] = momentum_n_m_s ? momentum_n_m_s[i] : 0.0;
        if (fabs(c->momentum[i]) == INFINITY)
            return 0;
    }
    return c->wheel_count > 0 || momentum_n_m_s == NULL;
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
        && (state->reference_xyzw || write_rotation(state->target_xyzw, g + MEASURED + 9))
        && take_disturbance(c, state->disturbance_n_m)
        && take_directions(c, state->cone_directions_N)
        && take_momenta(c, state) && take_reference(c, state)) {
        answer_state(c, 0);
#ifdef REFERENCE
        if (state->reference_xyzw)
            (void)write_rotation(state->reference_xyzw + 4, g + FORESEEN + 9);
#endif
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
    result->limits_used = c->limits_used;
    result->torques_n_m = failed ? NULL : answer + TORQUES;
    result->rotations_NB = failed ? NULL : answer + TORQUES + 3 * n;
    result->rates_rad_s = failed ? NULL : answer + TORQUES + 3 * n + 9 * (n + 1);
    return result->status;
}

int manifold_mpc_advance(manifold_mpc *mpc, manifold_mpc_state *state, const double torque_n_m[3],
                         double seconds)
{
    controller *c = &mpc->c;
    double *g = c->s.g, xyzw[4], torque[3];
    if (seconds == 0.0)
        return 1;
    if (!write_rotation(state->attitude_xyzw, g + MEASURED))
        return 0;
    for (int i = 0; i < 3; ++i) {
        g[MEASURED + 18 + i] = state->rate_rad_s[i];
        torque[i] = torque_n_m[i] + state->disturbance_n_m[i];
    }
    if (!move_on(c, g, torque, seconds, xyzw))
        return 0;
    for (int i = 0; i < 4; ++i)
        state->attitude_xyzw[i] = xyzw[i];
    for (int i = 0; i < 3; ++i)
        state->rate_rad_s[i] = g[MEASURED + 18 + i];
    return 1;
}
