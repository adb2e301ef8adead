/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * What Python calls: answers, closed loops on the model, and the parts of a solve one by one.
 */

long mpc_lane_count(void)
{
    return LANES;
}

void mpc_begin(controller *c)
{
    begin_controller(c);
}

void mpc_disturb(controller *c, const double *disturbance_n_m)
{
    disturb(c, disturbance_n_m);
}

/* Set directions (N + 1, n, 3) of all cones, or those of the configuration; return whether that
 * can be. */
long mpc_set_directions(controller *c, const double *directions_N)
{
#ifdef AIM
    return set_directions(c, directions_N);
#else
    (void)c;
    return directions_N == NULL;
#endif
}

/* Plan about the reference in memory, or about the target alone. */
void mpc_set_reference(controller *c, long moves)
{
#ifdef REFERENCE
    set_reference(c, (int)moves);
#else
    (void)c;
    (void)moves;
#endif
}

void mpc_answer(controller *c, double deadline_s, long local)
{
    c->deadline_s = deadline_s;
    answer_state(c, (int)local);
}

/* Set the state; its rate is dimensionless. */
long mpc_set_state(controller *c)
{
    return measure(c);
}

double mpc_slew_steps(controller *c)
{
    return slew_steps(c);
}

void mpc_use_set(controller *c, long with)
{
    use_set(c, (int)with);
}

void mpc_begin_start(controller *c, const double *from, double steps)
{
    begin_start(&c->s, from, steps);
}

void mpc_begin_slew(controller *c, double mu)
{
    static const double none[3] = {0.0, 0.0, 0.0};
    begin_slew(&c->s, mu, none, 0);
}

/* Begin a start by way of an attitude (4,); nothing without cones. */
void mpc_begin_way(controller *c, const double *by)
{
#ifdef AIM
    begin_way(&c->s, by);
#else
    (void)c;
    (void)by;
#endif
}

void mpc_iterate(controller *c, long most, double deadline_s)
{
    iterate(&c->s, most, deadline_s);
}

/* Report on the trajectory under way, poses included. */
void mpc_report(controller *c)
{
    double level = c->s.g[PARAMETER + TERMINAL_LEVEL];
    use_set(c, 1);
    report(&c->s, c->s.plan);
    run_poses(c->s.plan, c->s.fresh, c->s.model, c->s.g, c->s.horizon);
    c->s.g[PARAMETER + TERMINAL_LEVEL] = level;
    c->reported = NULL;
}

/* Model the trajectory with the exact Hessian, and try a step along the model's: what a test lays
 * open to hold the model against differences of trials. */
void mpc_model(controller *c, double mu)
{
    c->s.mu = mu;
    c->s.exact = 1.0;
    model_plan(&c->s);
}

void mpc_try_step(controller *c, double length)
{
    c->s.g[LENGTH] = length;
    run_trial_step(c->s.plan, c->s.fresh, c->s.model, c->s.g, c->s.horizon);
}

/* Apply a torque, g[APPLIED], to the body: the next measured state. */
void mpc_advance(controller *c)
{
    run_plant(c->s.plan, c->s.fresh, c->s.model, c->s.g, c->s.horizon);
}

/* Move attitude and rate (12,) [rad/s] on under a torque (3,) [N m]; return whether that can be.
 * Another thread may solve meanwhile. */
long mpc_move_on(const controller *c, double *state, const double *torque_n_m, double seconds)
{
    double g[GLOBAL_ROWS] = {0.0}, xyzw[4];
    memcpy(g + MEASURED, state, 9 * sizeof(double));
    memcpy(g + MEASURED + 18, state + 9, 3 * sizeof(double));
    int moved = move_on(c, g, torque_n_m, seconds, xyzw);
    memcpy(state, g + MEASURED, 9 * sizeof(double));
    memcpy(state + 9, g + MEASURED + 18, 3 * sizeof(double));
    return moved;
}

/* Ticks of a closed loop: states (T, 12), torques (T, 3), costs and passes (T,). */
typedef struct {
    double *states, *torques, *costs;
    long *passes;
    long ticks;
} loop_record;

static void record(const controller *c, loop_record *r, long tick)
{
    const solve *s = &c->s;
    r->costs[tick] = s->cost - s->g[PENALTIES];
    r->passes[tick] = s->total_passes;
    for (int i = 0; i < 3; ++i)
        r->torques[3 * tick + i] = s->g[APPLIED + i] = s->plan[AT(TRAJECTORY_ROWS, TORQUE + i, 0)];
    memcpy(r->states + 12 * tick, s->g + MEASURED, 9 * sizeof(double));
    memcpy(r->states + 12 * tick + 9, s->g + MEASURED + 18, 3 * sizeof(double));
}

/* Close the loop from tick `first` on while every warm start gives a plan within the value bound
 * of the one before; return the first tick that needs more than that. */
long mpc_follow(controller *c, loop_record *r, long first)
{
#ifdef AIM
    const double near_rad = CONE_ANGLE_RAD;
#else
    const double near_rad = SEARCH_ANGLE_RAD;
#endif
    solve *s = &c->s;
    use_set(c, 1);
    c->reported = NULL;
    for (long tick = first; tick < r->ticks && c->inside && c->warm; ++tick) {
        set_state(s);
        if (!improve(s, c->kept.memory, (int)c->free, INFINITY))
            return tick;
        report(s, s->plan);
        if (s->g[MISSED] > VIOLATION || s->g[LARGEST_VIOLATION] > VIOLATION
            || !is_good(c, s->cost, near_rad))
            return tick;
        record(c, r, tick);
        keep(c, &c->kept);
        c->value_bound = s->cost - s->g[FIRST_COST];
        c->violating = 0;
        c->free = s->g[LARGEST_MULTIPLIER] < FREE_MULTIPLIER;
        mpc_advance(c);
    }
    return c->inside && c->warm ? r->ticks : first;
}
