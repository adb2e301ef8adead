/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The cones of a controller: their directions at every node, what keeps them between samples too
 * (docs/theory.md (23), (24b)), and the level that they leave to the terminal set (section 13).
 */

/* Numbers of all cones: how far axes bend, swing and turn between samples, the squared error angle
 * over c; and of each: its place in the configuration, axis in body axes, sign (1 for keep-out),
 * half angle as declared and so that it holds between samples of a fixed direction, whether it
 * counts for the target, direction. */
enum { BEND, SWING, TURN_BETWEEN, SPREAD, ALL_CONES };
enum { WHICH, AXIS, SIGN = AXIS + 3, HALF, HELD, COUNTS, DIRECTION, ONE_CONE = DIRECTION + 3 };

/* Rounds of the bound between samples, each valid. */
#define BETWEEN_ROUNDS 5

static const double *cone_numbers(const controller *c, int i)
{
    return c->cones + ALL_CONES + ONE_CONE * i;
}

/* Write the direction of cone i at node k to s: as given (N + 1, n, 3), or as configured. */
static int direction_at(const controller *c, const double *given, int i, long k, double s[3])
{
    const double *own = cone_numbers(c, i);
    const double *from = given ? given + 3 * (k * c->cone_count + (long)own[WHICH])
                               : own + DIRECTION;
    double length = length_of(from);
    for (int j = 0; j < 3; ++j)
        s[j] = from[j] / length;
    return length > 1e-9 && length < INFINITY;
}

/* Return the half angle that holds between samples of a direction that moves by so much at most;
 * not above 0 where nothing of the cone is left. */
static double held_rad(const controller *c, int i, double moved)
{
    const double *own = cone_numbers(c, i);
    double edge = own[SIGN] * cos(own[HALF]), sine = 1.0, bound = -1.0;
    if (moved == 0.0)
        return own[HELD];
    if (cone_places[i].grouped)
        return own[HALF] - c->cones[TURN_BETWEEN]
            - 2.0 * atan2(moved / 2.0, sqrt(fmax(0.0, 1.0 - moved * moved / 4.0)));
    for (int round = 0; round < BETWEEN_ROUNDS; ++round) {
        bound = edge - c->cones[BEND] - moved - c->cones[SWING] * sine;
        sine = bound >= 0.0 && bound < 1.0 ? sqrt(1.0 - bound * bound) : 1.0;
    }
    return bound > -1.0 ? atan2(sqrt(1.0 - bound * bound), own[SIGN] * bound) : -1.0;
}

/* Set the directions (N + 1, n, 3) of all cones in the order of the configuration, or those of the
 * configuration. Return whether they are directions, and something is left of every cone; else
 * nothing changes, and `missing` says of which not. */
static int set_directions(controller *c, const double *given)
{
    double held[CONE_COUNT], s[3];
    if (!given && c->as_configured)
        return 1;
    c->missing = 0;
    for (int i = 0; i < CONE_COUNT; ++i) {
        double last[3] = {0.0, 0.0, 0.0}, moved = 0.0;
        for (long k = 0; k <= c->s.horizon; ++k) {
            if (!direction_at(c, given, i, k, s))
                return 0;
            double step[3] = {s[0] - last[0], s[1] - last[1], s[2] - last[2]};
            if (k)
                moved = fmax(moved, length_of(step));
            for (int j = 0; j < 3; ++j)
                last[j] = s[j];
        }
        held[i] = held_rad(c, i, moved);
        if (!(held[i] > 0.0)) {
            c->missing = 1 + (long)cone_numbers(c, i)[WHICH];
            return 0;
        }
    }
    for (int i = 0; i < CONE_COUNT; ++i) {
        const double *own = cone_numbers(c, i);
        double *data = c->s.g + cone_places[i].data, cosine = cos(held[i]);
        double scale = cone_places[i].grouped ? 1.0 / (1.0 + cosine) : own[SIGN] / sin(held[i]);
        for (int j = 0; j < 3; ++j)
            data[j] = scale * own[AXIS + j];
        data[3] = scale * (cone_places[i].grouped ? -1.0 : cosine);
        for (long k = 0; k < c->s.horizon + LANES; ++k) {   /* beyond the last node it again */
            direction_at(c, given, i, k < c->s.horizon ? k : c->s.horizon, s);
            for (int j = 0; j < 3; ++j)
                c->s.model[AT(MODEL_ROWS, cone_places[i].direction_N + j, k)] = s[j];
        }
    }
    c->as_configured = !given;
    c->aimed[0] = NAN;
    return 1;
}

/* Take, of each member of a group, the cone that makes its mean of power 32 above 1 by itself, as
 * plans keep the mean: 1 + cos theta' = n^(1/32) (1 + cos theta), next to nothing where none does. */
static void take_alone(cone cones[CONE_COUNT])
{
    for (int i = 0; i < CONE_COUNT; ++i) {
        double mean = 0.0;
        for (int k = 0; k < CONE_COUNT; ++k)
            mean += cone_places[k].value == cone_places[i].value;
        for (int k = 0; k < 5; ++k)
            mean = sqrt(mean);
        double cosine = fmin(1.0, mean * (1.0 - cos(cones[i].half_angle_rad)) - 1.0);
        if (cone_places[i].grouped)
            cones[i].half_angle_rad = PI - fmax(1e-9, atan2(sqrt(1.0 - cosine * cosine), cosine));
    }
}

/* Cut c so that no attitude of the set of the target R_ND violates a cone, where that is new. */
static void aim(controller *c, const double *R_ND)
{
    double least = INFINITY, best = -INFINITY;
    cone cones[CONE_COUNT];
    int same = 1;
    for (int i = 0; i < 9; ++i) {
        same &= c->aimed[i] == R_ND[i];
        c->aimed[i] = R_ND[i];
    }
    if (same)
        return;
    read_cones(&c->s, cones);
    take_alone(cones);
    for (long k = 0; k <= c->s.horizon; ++k)
        for (int i = 0; i < CONE_COUNT; ++i) {
            double axis[3], s[3], normal[3];
            for (int j = 0; j < 3; ++j)
                s[j] = c->s.model[AT(MODEL_ROWS, cone_places[i].direction_N + j, k)];
            turned(R_ND, cones[i].axis_B, axis);
            cross(axis, s, normal);
            double angle = atan2(length_of(normal), inner(axis, s));
            best = fmax(best, cone_numbers(c, i)[COUNTS] != 0.0
                        ? angle - cones[i].half_angle_rad : INFINITY);
            if (i + 1 == CONE_COUNT || cone_places[i + 1].value != cone_places[i].value) {
                least = fmin(least, best);
                best = -INFINITY;
            }
        }
    least = fmax(least, 0.0);
    double cut = fmin(c->whole_level, SAFETY * (least * least) / c->cones[SPREAD]);
    c->allowed = cut >= LEAST_PART * c->whole_level;
    c->cone_level = c->allowed ? cut : c->whole_level;
    set_level(c);
}
