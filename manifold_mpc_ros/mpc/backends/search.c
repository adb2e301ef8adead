/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * From a measured state to a plan around the local solver: warm start, global search, the problem
 * without the terminal set, status. Plain C99, no allocation.
 */

/* Keep the trajectory under way; the solver goes on in the memory of what was kept before. */
static void keep(controller *c, plan *to)
{
    solve *s = &c->s;
    double *freed = to->memory;
    to->memory = s->plan;
    s->plan = freed;
    to->cost = s->cost;
    to->residual = s->products > s->stationarity ? s->products : s->stationarity;
    to->flag = s->flag;
}

static void swap(plan *a, plan *b)
{
    plan held = *a;
    *a = *b;
    *b = held;
}

static void report_on(controller *c, const plan *p)
{
    if (c->reported == p->memory)
        return;
    use_set(c, 1);
    report(&c->s, p->memory);
    c->reported = p->memory;
}

/* By how much, relative to its level, a plan misses the terminal set. */
static double missed(controller *c, const plan *p)
{
    report_on(c, p);
    return HAS_TERMINAL_SET ? fmax(0.0, c->s.g[LAST_LEVEL] - 1.0) : 0.0;
}

static int reaches_set(controller *c, const plan *p)
{
    return c->allowed && missed(c, p) <= VIOLATION;
}

/* ... and keeps every limit. */
static int is_inside(controller *c, const plan *p)
{
    return reaches_set(c, p) && c->s.g[LARGEST_VIOLATION] <= VIOLATION;
}

/* How many steps a bang-bang slew takes, by torque limits alone: 2 sqrt(angle / acceleration). */
static double slew_steps(const controller *c)
{
    const double *state = c->s.g + STATE_REPORT;
    if (!(c->quickest > 0.0))
        return 0.0;
    return 2.0 * sqrt((state[2] + state[3]) * state[5] / c->quickest) / c->step_s;
}

/* How many components of torque a start leans to. */
static int leans(const double *from)
{
    return (from[0] != 0.0) + (from[1] != 0.0) + (from[2] != 0.0);
}

/* Whether the weights make a turn nearly time-optimal: its torque costs little beside it. With many
 * steps such a turn has more minima, so less is enough. */
static int is_quick(const controller *c)
{
    const double *state = c->s.g + STATE_REPORT;
    double far = c->s.horizon > MANY_STEPS ? FAR_TURN_OF_MANY : FAR_TURN;
    return state[2] + state[3] > far * c->linear_rad;
}

/* Whether a plan has many local minima: that of a nearly time-optimal turn, that of a slew of many
 * steps on a horizon of many, and any on a very long one, where the way of a start is rarely that of
 * the slew. */
static int has_many_minima(const controller *c)
{
    return is_quick(c) || c->s.horizon > LONG_HORIZON
        || (c->s.horizon > MANY_STEPS && slew_steps(c) > LONG_SLEW_STEPS);
}

/* Whether a start can lead to the best plan from a state. The short way always can; the long way
 * when enough is left to turn. Out of the plane it is better where the slew's own torque is nearly
 * a single component, so that the other two can help, the more so the weaker that component is
 * against what they can do; anywhere beside the half turn for a body that is much quicker about
 * another axis; and in any long turn whose slew is all but one component, or that has many minima;
 * then along single axes and with two components too, and the long way round where that is little
 * longer. Found by comparison with all starts (docs/solver.md), not proved. */
static int is_due(const controller *c, const double *from)
{
    const double *state = c->s.g + STATE_REPORT;
    double turn = state[2] + state[3], second = state[4], weakness = state[5];
    if (!leans(from))
        return from[3] == 0.0 || turn > LONG_WAY_RAD;
    if (POINTING)
        return turn > POINTING_RAD;
    if ((from[3] != 0.0 || leans(from) < 3) && !has_many_minima(c))
        return 0;
    if (from[3] != 0.0)
        return turn > LEAN_LONG_RAD;
    double beside = PI - turn;
    return (second < 0.25 && beside < 0.05 + 0.17 * (weakness - 1.0))
        || (turn > LEAN_RAD && (second < ALONE || has_many_minima(c)))
        || (second < ALONE && is_quick(c))
        || (beside < 0.035 && weakness > 2.0);
}

static void flip(solve *s)
{
    for (int i = 0; i < 4; ++i)
        s->g[START + i] *= -1.0;
}

/* Begin a cold start of a slew of so many periods. */
static void begin_start(solve *s, const double *from, double steps)
{
    double part = leans(from) == 2 ? LEAN_PART_OF_TWO : LEAN_PART;
    double held = fmax((double)LEAN_STEPS, rint(part * steps));
    long most = 0;
    for (double time = 0.0; most < s->horizon / 2 && time < held; ++most)
        time += s->model[AT(MODEL_ROWS, INNER, most)];
    if (from[3] != 0.0)
        flip(s);
    begin_slew(s, COLD_BARRIER, from, most > 1 ? most : 1);
    if (from[3] != 0.0)
        flip(s);
}

/* The first torque of a plan, rounded to 1e-6 of its largest component. */
static void rounded(const double *memory, double torque[3])
{
    double largest = 1e-12;
    for (int i = 0; i < 3; ++i) {
        torque[i] = memory[AT(TRAJECTORY_ROWS, TORQUE + i, 0)];
        largest = fmax(largest, fabs(torque[i]));
    }
    for (int i = 0; i < 3; ++i)
        torque[i] = rint(torque[i] / largest * 1e6) / 1e6;
}

/* Whether the trajectory under way comes before a plan that costs the same: by the order of the
 * rounded first torques. At 180 degrees both sides cost the same, and this picks the same one
 * whatever the noise in the attitude's sign. */
static int goes_before(const solve *s, const plan *other)
{
    double mine[3], its[3];
    rounded(s->plan, mine);
    rounded(other->memory, its);
    for (int i = 0; i < 3; ++i)
        if (mine[i] != its[i])
            return mine[i] < its[i];
    return 0;
}

/* Whether a start that is under way ends above the least cost: by so many times the decrease that
 * the models of its last passes expect, and by the gap that the barrier leaves, its cost does not
 * come down to that. */
static int is_hopeless(const solve *s, const double falls[3], double least, double times)
{
    double fall = fmax(falls[0], fmax(falls[1], falls[2]));
    double gap = BARRIER_GAP * (double)s->horizon * s->mu;
    return s->cost - times * fall - gap > least + HOPELESS * fabs(least);
}

/* Run a start to its end, or until it cannot win against the least cost. Return whether it gave
 * a plan. */
static int run_start(controller *c, double least, double times)
{
    solve *s = &c->s;
    double falls[3] = {INFINITY, INFINITY, INFINITY};
    iterate(s, least < INFINITY ? JUDGED_PASSES - 3 : MOST_PASSES, c->deadline_s);
    while (s->flag == RUNNING && s->passes < MOST_PASSES
           && !is_hopeless(s, falls, least, times)) {
        iterate(s, s->passes + 1, c->deadline_s);
        falls[s->passes % 3] = s->decrease;
    }
    c->passes += s->passes;
    return s->passes > 0 && fabs(s->cost) < INFINITY;
}

/* Take the trajectory under way where it is better; return the least cost. */
static double take_better(controller *c, plan *best, double least)
{
    double cost = c->s.cost, lowest = fmin(least, cost);
    double limit = lowest + TIE * fmax(fabs(lowest), 1.0);
    if (!(least < INFINITY) || (cost <= limit && (best->cost > limit || goes_before(&c->s, best))))
        keep(c, best);
    return lowest;
}

/* Copy the stages of a plan, so many later. */
static void copy_stages(const controller *c, double *to, const double *from, long later)
{
    for (long k = c->s.horizon; k >= 0; --k)
        for (int row = 0; row < TRAJECTORY_ROWS; ++row)
            to[AT(TRAJECTORY_ROWS, row, k + later)] = from[AT(TRAJECTORY_ROWS, row, k)];
}

/* Run a start with the terminal set to its end, and keep as the best plan the cheapest below a cost
 * that keeps every limit and ends in the set; lower the cost to its. At the edge of D_N such plans
 * lie on the way of a start whose end has bought a violation. Return whether it gave a plan. */
static int run_inside(controller *c, double *inside)
{
    solve *s = &c->s;
    for (;;) {
        plan under_way = {s->plan, s->cost, s->products > s->stationarity ? s->products
                          : s->stationarity, s->flag};
        c->reported = NULL;
        if (s->cost < *inside && is_inside(c, &under_way)) {
            copy_stages(c, c->best.memory, s->plan, 0);
            under_way.memory = c->best.memory;
            c->best = under_way;
            *inside = s->cost;
        }
        if (s->flag != RUNNING || s->passes >= MOST_PASSES)
            break;
        iterate(s, s->passes + LOOK_PASSES, c->deadline_s);
    }
    c->reported = NULL;
    c->passes += s->passes;
    return s->passes > 0 && fabs(s->cost) < INFINITY;
}

/* The first of so many starts that begins with this cost, -1 where none does. */
static long twin_of(const double *begins, long count, double cost)
{
    for (long i = 0; i < count; ++i)
        if (fabs(begins[i] - cost) <= MIRRORED * fabs(cost))
            return i;
    return -1;
}

/* A search under way: its least cost, the start that leads to it, and what run_inside has found. */
typedef struct {
    double least, times, *inside;
    long won;
} race;

static void run_in(controller *c, plan *best, race *r, long i)
{
    const double *before = best->memory;
    if (r->inside ? run_inside(c, r->inside) : run_start(c, r->least, r->times))
        r->least = take_better(c, best, r->least);
    if (best->memory != before)
        r->won = i;
}

/* Find the best of the starts that are due, with `inside` of all, none of which ends for its cost
 * (run_inside); return whether there is one. After the deadline no further start begins.
 *
 * Leaning ones come first, since the slew itself costs more where they are due. A turn from rest
 * about a principal axis is its own mirror image, and so are starts in pairs, which begin and end
 * with the same costs: of the second ones only that of the best plan runs, since the order of plans
 * decides between the two. */
static int search_starts(controller *c, plan *best, double steps, double *inside)
{
    race r = {INFINITY, has_many_minima(c) ? EXPECTED_FALLS_MANY : EXPECTED_FALLS, inside, -1};
    double begun_s = now_s(), begins[MOST_STARTS];
    long twins[MOST_STARTS];
    for (long i = 0; i < c->start_count; ++i) {
        begins[i] = INFINITY;
        twins[i] = -1;
    }
    for (int slews = 0; slews < 2; ++slews)
        for (long i = 0; i < c->start_count; ++i) {
            if (slews != !leans(c->starts[i]) || (!inside && !is_due(c, c->starts[i])))
                continue;
            if (r.least < INFINITY && is_over(c->deadline_s))
                break;
            begin_start(&c->s, c->starts[i], steps);
            twins[i] = inside ? -1 : twin_of(begins, c->start_count, c->s.cost);
            begins[i] = c->s.cost;
            if (twins[i] < 0)
                run_in(c, best, &r, i);
        }
    for (long i = 0, won = r.won; i < c->start_count && !is_over(c->deadline_s); ++i)
        if (won >= 0 && twins[i] == won) {
            begin_start(&c->s, c->starts[i], steps);
            run_in(c, best, &r, i);
        }
    c->local_s += now_s() - begun_s;
    return r.least < INFINITY;
}

static int touches_cone(controller *c, const plan *p)
{
    report_on(c, p);
    return c->s.g[LEAST_CONE_SLACK] < TOUCHED;
}

/* The same over ways round cones, if one touches the best plan or is in the straight way. */
static int search_ways(controller *c, int found, int with_set)
{
#ifdef AIM
    double least = found ? c->best.cost : INFINITY, begun_s = now_s();
    if (found && !touches_cone(c, &c->best) && is_straight_way_free(&c->s))
        return found;
    score_ways(&c->s, c->ways);
    use_set(c, with_set);
    for (long i = 0; i < MOST_WAYS; ++i) {
        double by[4];
        if (least < INFINITY && is_over(c->deadline_s))
            break;
        via(take_way(c->ways), by);
        begin_way(&c->s, by);
        if (run_start(c, least, EXPECTED_FALLS))
            least = take_better(c, &c->best, least);
    }
    c->local_s += now_s() - begun_s;
    c->reported = NULL;
    return least < INFINITY;
#else
    (void)c;
    (void)with_set;
    return found;
#endif
}

/* Find the best of the global search and the shifted plan. */
static int search(controller *c, int with_set)
{
    c->searched = 1;
    c->reported = NULL;
    use_set(c, with_set);
    int found = search_ways(c, search_starts(c, &c->best, slew_steps(c), NULL), with_set);
    if (found && c->warm) {
        use_set(c, with_set);
        begin_shift(&c->s, SHIFTED_BARRIER, c->kept.memory);
        if (c->s.cost < c->best.cost) {
            keep(c, &c->best);
            c->reported = NULL;
        }
    }
    return found;
}

/* Improve a plan, one stage ahead; return whether that gave a plan, then in `to`. */
static int improve_into(controller *c, plan *to, const plan *from, int with_set)
{
    c->reported = NULL;
    use_set(c, with_set);
    double begun_s = now_s();
    int usable = improve(&c->s, from->memory, from == &c->kept && c->free, c->deadline_s);
    c->local_s += now_s() - begun_s;
    c->passes += c->s.total_passes;
    if (usable)
        keep(c, to);
    return usable;
}

/* Find a plan into the terminal set near the best one, which misses it, else near any start. */
static int bend(controller *c, double steps)
{
    double inside = INFINITY;
    copy_stages(c, c->other.memory, c->best.memory, 1);     /* shifted, it begins with it */
    int found = improve_into(c, &c->other, &c->other, 1) && is_inside(c, &c->other);
    if (!found) {
        c->reported = NULL;
        use_set(c, 1);
        found = search_starts(c, &c->other, steps, &inside) && (inside < INFINITY
            ? is_inside(c, &c->other) : reaches_set(c, &c->other));
    }
    if (found)
        swap(&c->best, &c->other);
    return found || inside < INFINITY;
}

/* Find the best plan that ends in the terminal set, else the best without it. Where the horizon has
 * many steps the set stops most starts on their way, so the search goes without it first: a
 * plan that ends in it is as good with it, and one that does not leads to one that does. */
static int search_both(controller *c)
{
    c->inside = c->allowed;
    if (!c->inside)
        return search(c, 0);
    if (!HAS_TERMINAL_SET || c->s.horizon <= MANY_STEPS) {
        int found = search(c, 1);
        if (!HAS_TERMINAL_SET || (found && reaches_set(c, &c->best)))
            return found;
    }
    int found = search(c, 0);
    if (!found || reaches_set(c, &c->best))
        return found;
    c->inside = !is_over(c->deadline_s) && bend(c, slew_steps(c));
    return 1;
}

/* Whether a plan is as good as was promised, but for this part of it. */
static int keeps_value_bound(const controller *c, double cost, double slack)
{
    return cost <= c->value_bound + slack * fmax(fabs(c->value_bound), LEAST_VALUE);
}

/* Whether an improved plan needs no search: it is as good as was promised, or no other side could
 * win; unless the state has jumped, and it is on one. */
static int is_good(const controller *c, double cost, double near_rad)
{
    return keeps_value_bound(c, cost, VALUE_SLACK) || (c->s.g[STATE_REPORT + 2] < near_rad
        && (!c->s.from_afar || keeps_value_bound(c, cost, JUMP_SLACK)));
}

/* The same round cones, which may hold it back. */
static int stands(controller *c, const plan *p)
{
    double near_rad = SEARCH_ANGLE_RAD;
    if (touches_cone(c, p)) {
        near_rad = CONE_ANGLE_RAD;
        if (!c->violating && c->s.g[LARGEST_VIOLATION] > VIOLATION)
            return 0;
    }
    return is_good(c, p->cost, near_rad);
}

/* Find the best plan: with the terminal set; when that cannot be reached, without it. From outside
 * D_N the set is tried again at every tick, from the shifted plan only. */
static int find(controller *c)
{
    int was_inside = (int)c->inside;
    if (c->warm && c->allowed && improve_into(c, &c->best, &c->kept, 1)
        && reaches_set(c, &c->best) && (!was_inside || stands(c, &c->best))) {
        c->inside = 1;
        return 1;
    }
    if (!c->warm || (was_inside && c->allowed)) {
        int found = search_both(c);
        if (c->inside || !c->warm)
            return found;
    }
    int found = improve_into(c, &c->best, &c->kept, !HAS_TERMINAL_SET)
        && stands(c, &c->best);
    if (!found)
        found = search(c, !HAS_TERMINAL_SET);
    c->inside = found && reaches_set(c, &c->best);
    return found;
}

/* Find the plan of one cold start, the short way. */
static int find_locally(controller *c)
{
    static const start short_way = {0.0, 0.0, 0.0, 0.0};
    c->inside = 1;
    c->reported = NULL;
    double begun_s = now_s();
    begin_start(&c->s, short_way, 0.0);
    int found = run_start(c, INFINITY, EXPECTED_FALLS);
    c->local_s += now_s() - begun_s;
    if (found)
        keep(c, &c->best);
    return found;
}

/* Set the state from what was measured, g[MEASURED]; return whether it can be predicted from. */
static int measure(controller *c)
{
    double *g = c->s.g, sum = 0.0;
    for (int i = 0; i < 21; ++i)
        sum += g[MEASURED + i];
    if (!(fabs(sum) < INFINITY))
        return 0;
    set_state(&c->s);
    int usable = g[STATE_REPORT] <= ROTATION_DEFECT && g[STATE_REPORT + 1] < c->guard_squared;
#ifdef AIM
    if (usable)
        aim(c, g + MEASURED + 9);
#endif
    use_set(c, 1);
    return usable;
}

/* Make the best plan the next tick's start, and the answer in SI units. */
static void answer_with_best(controller *c)
{
    const double *g = c->s.g;
    double *answer = c->answer;
    long n = c->s.horizon;
    double beyond = missed(c, &c->best), violation = fmax(g[LARGEST_VIOLATION], beyond);
    double cost = c->best.cost - g[PENALTIES];
    swap(&c->best, &c->kept);
    c->warm = 1;
    c->value_bound = c->kept.cost - g[FIRST_COST];
    c->violating = g[LARGEST_VIOLATION] > VIOLATION;
    c->free = g[LARGEST_MULTIPLIER] < FREE_MULTIPLIER;
    answer[COST] = cost * c->cost;
    answer[RESIDUAL] = c->kept.residual;
    answer[WORST] = violation;
    answer[PROMISED] = (cost - g[FIRST_COST]) * c->cost;
    answer[RATIO] = g[FIRST_LEVEL];
    answer[STATUS] = violation > VIOLATION || !c->inside ? STATUS_INFEASIBLE
        : c->kept.flag == CONVERGED
            || (c->kept.flag == STALLED && c->kept.residual < ACCEPTABLE_RESIDUAL)
        ? STATUS_CONVERGED : STATUS_FEASIBLE;
    run_poses(c->kept.memory, c->s.fresh, c->s.model, c->s.g, n);
    double *to = answer + TORQUES;
    for (long k = 0; k < n; ++k) {
        const double *torque = c->kept.memory + AT(TRAJECTORY_ROWS, TORQUE, k);
        for (int i = 0; i < 3; ++i)
            *to++ = torque[i * LANES] * c->torque_n_m - c->disturbance_n_m[i];
    }
    for (long k = 0; k <= n; ++k) {
        const double *pose = c->s.model + AT(MODEL_ROWS, POSE, k);
        for (int i = 0; i < 9; ++i)
            to[9 * k + i] = pose[i * LANES];
        for (int i = 0; i < 3; ++i)
            to[9 * (n + 1) + 3 * k + i] = pose[(9 + i) * LANES] * c->rate_rad_s;
    }
}

/* Answer a measured state, g[MEASURED], whose rate is in rad/s. `local`: by one cold start. */
static void answer_state(controller *c, int local)
{
    double *g = c->s.g;
#ifdef TOTAL_MOMENTUM
    hold_wheels(c, g + MEASURED + 18);
#endif
    for (int i = 0; i < 3; ++i)
        g[MEASURED + 18 + i] *= c->time_s;
    c->passes = c->searched = 0;
    c->local_s = 0.0;
    int found = measure(c);
    if (found) {
        if (g[STATE_REPORT + 6] > SETPOINT_MOVED_RAD)
            c->warm = 0;
        for (int i = 0; i < 18; ++i)
            g[FORESEEN + i] = g[MEASURED + 9 + i % 9];
        found = local ? find_locally(c) : find(c);
    }
    if (found) {
        answer_with_best(c);
    } else {
        c->warm = 0;
        c->answer[STATUS] = STATUS_FAILED;
    }
    c->answer[PASSES] = (double)c->passes;
    c->answer[SEARCHED] = (double)c->searched;
    c->answer[LOCAL_S] = c->local_s;
}

/* Begin in memory that holds the numbers of a problem: nothing is known, nothing moves. */
static void begin_controller(controller *c)
{
    prepare(&c->s);
    for (long k = 0; c->periods && k < c->s.horizon; ++k)
        c->s.model[AT(MODEL_ROWS, INNER, k)] = c->periods[k];
    for (int i = 0; i < 18; ++i)
        c->s.g[FORESEEN + i] = i % 9 % 4 == 0;
    c->deadline_s = INFINITY;
    c->allowed = c->inside = c->rests = 1;
    c->wheel_share = 1.0;
    c->cone_level = c->whole_level;
    set_level(c);
#ifdef AIM
    set_directions(c, NULL);
#endif
#ifdef REFERENCE
    c->tracking = 1;
    set_reference(c, 0);
#endif
}
