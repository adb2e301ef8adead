/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The local solver's loop around the generated phases: no allocation, no global state. Plain C99.
 */

typedef struct {
    double *plan, *fresh, *model, *g;
    double cost, logs, mu, exact;
    double stationarity, products, decrease, least_residual;
    /* by_tenths: the barrier falls by tenths only. creeping: short steps in succession.
     * from_afar: the plan before was too far away to begin near its limits. watchdog: steps may
     * raise the merit while the residual halves; unhalved: passes since it did. */
    long horizon, flag, passes, total_passes, by_tenths, creeping, from_afar, watchdog, unhalved;
} solve;

static void take_fresh(solve *s)
{
    double *swapped = s->plan;
    s->plan = s->fresh;
    s->fresh = swapped;
    s->cost = s->g[SUMS];
    s->logs = s->g[SUMS + 1];
}

/* What stays the same for a memory: which stages are inner and later ones. */
static void prepare(solve *s)
{
    for (long k = -LANES; k <= s->horizon + LANES; ++k) {
        s->model[AT(MODEL_ROWS, INNER, k)] = k < s->horizon;
        s->model[AT(MODEL_ROWS, LATER, k)] = k > 0;
#ifdef AIM
        s->model[AT(MODEL_ROWS, AIM, k)] = 1.0;
#endif
    }
}

static int is_over(double deadline_s)
{
    return deadline_s < INFINITY && now_s() > deadline_s;
}

static void begin(solve *s)
{
    take_fresh(s);
    s->flag = s->g[SUMS + 2] > 0.0 ? RUNNING : STALLED;
    s->stationarity = s->products = s->decrease = INFINITY;
    s->least_residual = INFINITY;
    s->exact = 1.0;
    s->by_tenths = s->watchdog = 0;
    s->passes = s->creeping = s->unhalved = 0;
}

/* Start from the slew law, leaning for the first steps. */
static void begin_slew(solve *s, double mu, const double *lean, long lean_steps)
{
    s->g[BARRIER] = s->mu = mu;
    for (long k = 0; k <= s->horizon; ++k)
        for (int i = 0; i < 3; ++i)
            s->model[AT(MODEL_ROWS, LEAN + i, k)] = k < lean_steps ? lean[i] : 0.0;
    run_slew(s->plan, s->fresh, s->model, s->g, s->horizon);
    run_cold(s->plan, s->fresh, s->model, s->g, s->horizon);
    begin(s);
}

/* Start from the torques and multipliers of another plan, one stage ahead. */
static void begin_shift(solve *s, double mu, const double *kept)
{
    s->g[BARRIER] = s->mu = mu;
    run_shift(kept, s->fresh, s->model, s->g, s->horizon);
    run_warm(kept, s->fresh, s->model, s->g, s->horizon);
    begin(s);
    s->by_tenths = CURVED;
    if (CURVED)
        s->exact = WARM_BLEND;
}

/* Set the state from what was measured. */
static void set_state(solve *s)
{
    run_set_state(s->plan, s->fresh, s->model, s->g, s->horizon);
}

/* Say what the caller wants to know of a plan. */
static void report(solve *s, const double *kept)
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

/* Whether the last pass expected the cost to fall by much. */
static int is_far(const solve *s)
{
    return s->decrease >= FAR_DECREASE * fabs(s->cost) + BARRIER_READY * s->mu;
}

/* Whether a watchdog takes a step at which the merit rises: near the optimum a whole step along a
 * limit that curves violates it to second order, which the merit punishes by more than the step
 * gains. */
static int dares(const solve *s)
{
    return s->watchdog && s->mu < WATCHDOG_BARRIER && s->g[SUMS + 2] > 0.0 && !is_far(s);
}

/* Shorten the step until the merit falls; return its length, 0 when no length will do. */
static double search_length(solve *s)
{
    double reach = s->g[LARGEST_REACH];
    double length = reach > BOUNDARY ? BOUNDARY / reach : 1.0;
    for (; length > SMALLEST_STEP; length *= BACKTRACK) {
        s->g[LENGTH] = length;
        run_trial_step(s->plan, s->fresh, s->model, s->g, s->horizon);
        if (accepts(s, length) || dares(s))
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

static double lowered(double exact)
{
    return exact > SMALLEST_BLEND ? BLEND_DOWN * exact : 0.0;
}

static void one_pass(solve *s)
{
    model_plan(s);
    double residual = fmax(s->stationarity, s->products);
    if (residual < TOLERANCE) {
        s->flag = CONVERGED;
        return;
    }
    s->unhalved = residual < 0.5 * s->least_residual ? 0 : s->unhalved + 1;
    s->least_residual = fmin(s->least_residual, residual);
    if (s->unhalved > WATCHDOG_PASSES && s->mu < WATCHDOG_BARRIER)
        s->watchdog = 0;
    double length = s->g[RESIDUALS + 3] > SMALLEST_PIVOT ? search_length(s) : 0.0;
    if (length == 0.0) {
        if (s->exact == 0.0)
            s->flag = STALLED;
        s->exact = lowered(s->exact);
        return;
    }
    take_fresh(s);
    s->creeping = length < READY_LENGTH ? s->creeping + 1 : 0;
    if (s->creeping == CREEP_PASSES) {
        s->creeping = 0;
        s->mu = fmin(RAISED_BARRIER, BARRIER_RAISE * s->mu);
    } else if (length >= READY_LENGTH && s->decrease < BARRIER_READY * s->mu) {
        s->mu = fmax(SMALLEST_BARRIER,
                     fmin(BARRIER_FACTOR, s->by_tenths ? 1.0 : sqrt(s->mu)) * s->mu);
    }
    s->exact = length < SHORT_LENGTH
        ? lowered(s->exact)
        : fmin(1.0, fmax(BLEND_UP * s->exact, SMALLEST_BLEND));
}

/* Run up to `most` passes in all, until the flag says why it ended or the deadline is over. */
static void iterate(solve *s, long most, double deadline_s)
{
    while (s->flag == RUNNING && s->passes < most) {
        if (s->passes && is_over(deadline_s))
            s->flag = OUT_OF_TIME;
        else
            one_pass(s);
    }
}

static int is_converged(const solve *s)
{
    return s->flag == CONVERGED || (s->flag == STALLED
        && fmax(s->stationarity, s->products) < ACCEPTABLE_RESIDUAL);
}

/* Improve a plan, one stage ahead; return whether that gave a plan to use. `is_free`: no limit
 * holds the plan back. Of a plan that is far the first ones end after a pass; the last but one only
 * where that leaves the limits, so that every step would end at them. */
static int improve(solve *s, const double *kept, int is_free, double deadline_s)
{
    static const struct { double mu; long most; } starts[] = {WARM_STARTS};
    s->total_passes = 0;
    enum { NEAR = 1, AFAR, LAST };
    for (size_t i = is_free ? 0 : NEAR; i <= LAST; ++i) {
        s->from_afar = i >= AFAR;
        begin_shift(s, starts[i].mu, kept);
        s->watchdog = 1;
        if (i == AFAR)
            s->exact = fmin(s->exact, AFAR_BLEND);
        iterate(s, 1, deadline_s);
        if (!is_far(s) || i == LAST || (i == AFAR && s->g[LARGEST_REACH] <= LEAVING_REACH))
            iterate(s, starts[i].most, deadline_s);
        s->total_passes += s->passes;
        if (is_converged(s) || s->flag == OUT_OF_TIME)
            return 1;
    }
    return 0;
}
