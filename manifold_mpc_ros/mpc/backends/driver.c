/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The solver's loop around the generated phases: no allocation, no callback, no global state.
 */

enum { RUNNING, CONVERGED, STALLED, OUT_OF_TIME };

typedef struct {
    double *plan, *fresh, *model, *g;
    double cost, logs, mu, exact;
    double stationarity, products, decrease, elapsed_s;
    long horizon, flag, passes, total_passes;
} solve;

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void take_fresh(solve *s)
{
    double *swapped = s->plan;
    s->plan = s->fresh;
    s->fresh = swapped;
    s->cost = s->g[SUMS];
    s->logs = s->g[SUMS + 1];
}

long mpc_lane_count(void)
{
    return LANES;
}

/* What stays the same for a memory: which stages are inner and later ones. */
void mpc_prepare(solve *s)
{
    for (long k = -LANES; k <= s->horizon + LANES; ++k) {
        s->model[AT(MODEL_ROWS, INNER, k)] = k < s->horizon;
        s->model[AT(MODEL_ROWS, LATER, k)] = k > 0;
    }
}

static void begin(solve *s)
{
    take_fresh(s);
    s->flag = s->g[SUMS + 2] > 0.0 ? RUNNING : STALLED;
    s->stationarity = s->products = s->decrease = INFINITY;
    s->exact = 1.0;
    s->passes = 0;
}

/* Start from the slew law, leaning for the first steps. */
void mpc_begin_slew(solve *s, double mu, const double *lean, long lean_steps)
{
    double begun_s = now_s();
    s->g[BARRIER] = s->mu = mu;
    for (long k = 0; k <= s->horizon; ++k)
        for (int i = 0; i < 3; ++i)
            s->model[AT(MODEL_ROWS, LEAN + i, k)] = k < lean_steps ? lean[i] : 0.0;
    run_slew(s->plan, s->fresh, s->model, s->g, s->horizon);
    run_cold(s->plan, s->fresh, s->model, s->g, s->horizon);
    begin(s);
    s->elapsed_s += now_s() - begun_s;
}

/* Start from the torques and multipliers of another plan, one stage ahead. */
void mpc_begin_shift(solve *s, double mu, const double *kept)
{
    double begun_s = now_s();
    s->g[BARRIER] = s->mu = mu;
    run_shift(kept, s->fresh, s->model, s->g, s->horizon);
    run_warm(kept, s->fresh, s->model, s->g, s->horizon);
    begin(s);
    s->elapsed_s += now_s() - begun_s;
}

/* Set the state from what was measured. */
void mpc_set_state(solve *s)
{
    run_set_state(s->plan, s->fresh, s->model, s->g, s->horizon);
}

/* Say what the caller wants to know of a plan. */
void mpc_report(solve *s, const double *kept)
{
    run_report(kept, s->fresh, s->model, s->g, s->horizon);
}

static int accepts(const solve *s, double length)
{
    const double *sums = s->g + SUMS;
    double merit = s->cost - s->mu * s->logs;
    double noise = COST_NOISE * fabs(s->cost) + BARRIER_NOISE * fabs(s->mu * s->logs);
    return sums[2] > 0.0 && sums[0] - s->mu * sums[1] <= merit - ARMIJO * length * s->decrease
        + noise;
}

/* Shorten the step until the merit falls; return its length, 0 when no length will do. */
static double search_length(solve *s)
{
    double reach = s->g[LARGEST_REACH];
    double length = reach > BOUNDARY ? BOUNDARY / reach : 1.0;
    for (; length > SMALLEST_STEP; length *= BACKTRACK) {
        s->g[LENGTH] = length;
        run_trial_step(s->plan, s->fresh, s->model, s->g, s->horizon);
        if (accepts(s, length))
            return length;
    }
    return 0.0;
}

static void model_plan(solve *s)
{
    const double *residuals = s->g + RESIDUALS;
    s->g[BARRIER] = s->mu;
    s->g[EXACT] = s->exact;
    run_backward(s->plan, s->fresh, s->model, s->g, s->horizon);
    s->stationarity = residuals[0] / fmax(1.0, residuals[4] / LARGE_FORCE);
    s->products = residuals[1];
    s->decrease = residuals[2];
    ++s->passes;
}

/* Model the trajectory with the exact Hessian, and try a step along the model's: what a test lays
 * open to hold the model against differences of trials. */
void mpc_model(solve *s, double mu)
{
    s->mu = mu;
    s->exact = 1.0;
    model_plan(s);
}

void mpc_try_step(solve *s, double length)
{
    s->g[LENGTH] = length;
    run_trial_step(s->plan, s->fresh, s->model, s->g, s->horizon);
}

static double lowered(double exact)
{
    return exact > SMALLEST_BLEND ? BLEND_DOWN * exact : 0.0;
}

static void one_pass(solve *s)
{
    model_plan(s);
    if (fmax(s->stationarity, s->products) < TOLERANCE) {
        s->flag = CONVERGED;
        return;
    }
    double length = s->g[RESIDUALS + 3] > SMALLEST_PIVOT ? search_length(s) : 0.0;
    if (length == 0.0) {
        if (s->exact == 0.0)
            s->flag = STALLED;
        s->exact = lowered(s->exact);
        return;
    }
    take_fresh(s);
    if (length >= READY_LENGTH && s->decrease < BARRIER_READY * s->mu)
        s->mu = fmax(SMALLEST_BARRIER, fmin(BARRIER_FACTOR * s->mu, s->mu * sqrt(s->mu)));
    s->exact = length < SHORT_LENGTH
        ? lowered(s->exact)
        : fmin(1.0, fmax(BLEND_UP * s->exact, SMALLEST_BLEND));
}

/* Run up to `most` passes in all, until the flag says why it ended or the deadline is over. */
void mpc_iterate(solve *s, long most, double deadline_s)
{
    double begun_s = now_s();
    while (s->flag == RUNNING && s->passes < most) {
        if (s->passes && now_s() > deadline_s)
            s->flag = OUT_OF_TIME;
        else
            one_pass(s);
    }
    s->elapsed_s += now_s() - begun_s;
}

static int is_converged(const solve *s)
{
    return s->flag == CONVERGED || (s->flag == STALLED
        && fmax(s->stationarity, s->products) < ACCEPTABLE_RESIDUAL);
}

/* Whether the last pass expected the cost to fall by much. */
static int is_far(const solve *s)
{
    return s->decrease >= FAR_DECREASE * fabs(s->cost) + BARRIER_READY * s->mu;
}

/* Improve a plan, one stage ahead; return whether that gave a plan to use. */
long mpc_improve(solve *s, const double *kept, double deadline_s)
{
    static const struct { double mu; long most; } starts[] = {WARM_STARTS};
    s->total_passes = 0;
    for (size_t i = 0; i < sizeof starts / sizeof *starts; ++i) {
        mpc_begin_shift(s, starts[i].mu, kept);
        mpc_iterate(s, 1, deadline_s);
        if (i > 0 || !is_far(s))
            mpc_iterate(s, starts[i].most, deadline_s);
        s->total_passes += s->passes;
        if (is_converged(s) || s->flag == OUT_OF_TIME)
            return 1;
    }
    return 0;
}

typedef struct {
    double near_rad, violation, value_slack, least_value;
    double value_bound;
    double *states, *torques, *costs;
    long *passes;
    long ticks;
} course;

static int keeps_value_bound(const solve *s, const course *c)
{
    double slack = c->value_slack * fmax(fabs(c->value_bound), c->least_value);
    return s->cost <= c->value_bound + slack;
}

static void record(const solve *s, course *c, long tick)
{
    c->costs[tick] = s->cost - s->g[PENALTIES];
    c->passes[tick] = s->total_passes;
    for (int i = 0; i < 3; ++i)
        c->torques[3 * tick + i] = s->g[APPLIED + i] = s->plan[AT(TRAJECTORY_ROWS, TORQUE + i, 0)];
    memcpy(c->states + 12 * tick, s->g + MEASURED, 9 * sizeof(double));
    memcpy(c->states + 12 * tick + 9, s->g + MEASURED + 18, 3 * sizeof(double));
    c->value_bound = s->cost - s->g[FIRST_COST];
}

/* Apply the first torque of a plan to the body: the next measured state. */
void mpc_advance(solve *s)
{
    run_plant(s->plan, s->fresh, s->model, s->g, s->horizon);
}

/* Close the loop from tick `first` on while every warm start gives a plan within the value bound
 * of the one before; return the first tick that needs more than that. */
long mpc_follow(solve *s, double *kept, course *c, long first)
{
    size_t size = BLOCK(TRAJECTORY_ROWS, 0, s->horizon + LANES) * sizeof(double);
    for (long tick = first; tick < c->ticks; ++tick) {
        mpc_set_state(s);
        if (!mpc_improve(s, kept, INFINITY))
            return tick;
        mpc_report(s, s->plan);
        if (s->g[MISSED] > c->violation || s->g[VIOLATION] > c->violation
            || !(s->g[STATE_REPORT + 2] < c->near_rad || keeps_value_bound(s, c)))
            return tick;
        memcpy(kept, s->plan, size);
        record(s, c, tick);
        mpc_advance(s);
    }
    return c->ticks;
}
