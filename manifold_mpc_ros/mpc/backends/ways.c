/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Ways round cones: by way of one of VIAS attitudes that are the same every time, straight twice.
 * The MOST_WAYS that violate cones least, the shortest of them, lead starts of the search to its
 * plans. Quaternions are (w, x, y, z), of attitudes in the target's axes. Plain C99.
 */

/* A keep-out cone: its axis in body axes, of length 1, and its half angle [rad]. Keep-in about
 * an axis is keep-out about its opposite, by the rest of pi. */
typedef struct {
    double axis_B[3], half_angle_rad;
} cone;

/* Where numbers and directions of a cone lie (in the target's axes and in inertial ones), the value
 * of the inequality that it is of, and whether that is of a group of keep-in cones. */
typedef struct {
    int data, direction, direction_N, value, grouped;
} cone_place;

static const cone_place cone_places[CONE_COUNT] = CONES;

static void multiply(const double a[4], const double b[4], double ab[4])
{
    double product[4] = {
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
    for (int i = 0; i < 4; ++i)
        ab[i] = product[i];
}

/* R(q) v, by t = 2 q_v x v: v + w t + q_v x t. */
static void rotate(const double q[4], const double v[3], double to[3])
{
    double t[3] = {2.0 * (q[2] * v[2] - q[3] * v[1]), 2.0 * (q[3] * v[0] - q[1] * v[2]),
                   2.0 * (q[1] * v[1] - q[2] * v[0])};
    to[0] = v[0] + q[0] * t[0] + (q[2] * t[2] - q[3] * t[1]);
    to[1] = v[1] + q[0] * t[1] + (q[3] * t[0] - q[1] * t[2]);
    to[2] = v[2] + q[0] * t[2] + (q[1] * t[1] - q[2] * t[0]);
}

/* Write the quaternion of a part of a turn (a rotation vector) in body axes. */
static void part_of(const double turn[3], double part, double q[4])
{
    double angle = length_of(turn), half = 0.5 * part * angle;
    double scale = angle > 0.0 ? sin(half) / angle : 0.0;
    q[0] = cos(half);
    for (int i = 0; i < 3; ++i)
        q[1 + i] = scale * turn[i];
}

/* Write the turn in body axes from an attitude to another, the short way. */
static void turn_between(const double from[4], const double to[4], double turn[3])
{
    const double back[4] = {from[0], -from[1], -from[2], -from[3]};
    double q[4];
    multiply(back, to, q);
    double sine = length_of(q + 1);
    double angle = 2.0 * atan2(sine, fabs(q[0]));
    double scale = sine > 0.0 ? (q[0] < 0.0 ? -angle : angle) / sine : 0.0;
    for (int i = 0; i < 3; ++i)
        turn[i] = scale * q[1 + i];
}

/* Write the turn from an attitude to the nearest one that meets the target. */
static void turn_to_target(const solve *s, const double from[4], double turn[3])
{
    if (!POINTING) {
        static const double target[4] = {1.0, 0.0, 0.0, 0.0};
        turn_between(from, target, turn);
        return;
    }
    const double *axis = s->g + PARAMETER + POINTING_AXIS;
    const double back[4] = {from[0], -from[1], -from[2], -from[3]};
    double gamma[3];
    rotate(back, axis, gamma);
    double normal[3] = {gamma[1] * axis[2] - gamma[2] * axis[1],
                        gamma[2] * axis[0] - gamma[0] * axis[2],
                        gamma[0] * axis[1] - gamma[1] * axis[0]};
    double sine = length_of(normal);
    double angle = atan2(sine, gamma[0] * axis[0] + gamma[1] * axis[1] + gamma[2] * axis[2]);
    for (int i = 0; i < 3; ++i)
        turn[i] = -angle * normal[i] / fmax(sine, 1e-12);
}

/* Attitude i of VIAS spread evenly over SO(3): super-Fibonacci spirals, two circles of the unit
 * quaternions, turned at the irrational rates 1/sqrt 2 and 1/psi, psi^4 = psi + 4, the squared
 * radii going from 0 to 1. */
static void via(long i, double q[4])
{
    double at = (double)i + 0.5;
    double first = sqrt(at / VIAS), second = sqrt(1.0 - at / VIAS);
    double a = 2.0 * PI * at / sqrt(2.0), b = 2.0 * PI * at / 1.533751168755204288118041;
    q[0] = first * sin(a);
    q[1] = first * cos(a);
    q[2] = second * sin(b);
    q[3] = second * cos(b);
}

/* Read the cones from the numbers of their inequalities: an axis over sin of the half angle and
 * its cotangent, of groups over 1 + cos and the negative of one over that. */
static void read_cones(const solve *s, cone cones[CONE_COUNT])
{
    for (int i = 0; i < CONE_COUNT; ++i) {
        const double *data = s->g + cone_places[i].data;
        double length = length_of(data), sign = cone_places[i].grouped ? -1.0 : 1.0;
        double cosine = cone_places[i].grouped ? 1.0 - 1.0 / length : data[3] / length;
        for (int k = 0; k < 3; ++k)
            cones[i].axis_B[k] = sign * data[k] / length;
        cones[i].half_angle_rad = atan2(sqrt(fmax(0.0, 1.0 - cosine * cosine)), cosine);
    }
}

/* By which angle an attitude keeps a cone, at the begin, the middle and the end of the horizon. */
static double margin_rad(const solve *s, const cone *kept, int direction, const double q[4])
{
    const long nodes[3] = {0, s->horizon / 2, s->horizon};
    double axis[3], largest = -1.0;
    rotate(q, kept->axis_B, axis);
    for (int j = 0; j < 3; ++j) {
        double cosine = 0.0;
        for (int i = 0; i < 3; ++i)
            cosine += axis[i] * s->model[AT(MODEL_ROWS, direction + i, nodes[j])];
        largest = fmax(largest, cosine);
    }
    return atan2(sqrt(fmax(0.0, 1.0 - largest * largest)), largest) - kept->half_angle_rad;
}

/* The largest angle by which an attitude violates a cone, or all of a group. */
static double violation_rad(const solve *s, const cone cones[CONE_COUNT], const double q[4])
{
    double least = 0.0, best = -INFINITY;
    for (int i = 0; i < CONE_COUNT; ++i) {
        best = fmax(best, margin_rad(s, &cones[i], cone_places[i].direction, q));
        if (i + 1 == CONE_COUNT || cone_places[i + 1].value != cone_places[i].value) {
            least = fmin(least, best);
            best = -INFINITY;
        }
    }
    return -least;
}

/* How far beyond BENT_RAD, which the solver bends, a straight part of a way violates cones: the
 * sum over WAY_PARTS attitudes of it. */
static double violation_along(const solve *s, const cone cones[CONE_COUNT], const double from[4],
                              const double turn[3], double bent_rad)
{
    double q[4] = {from[0], from[1], from[2], from[3]}, part[4], sum = 0.0;
    part_of(turn, 1.0 / (WAY_PARTS - 1), part);
    for (int i = 0; i < WAY_PARTS; ++i) {
        sum += fmax(violation_rad(s, cones, q) - bent_rad, 0.0);
        multiply(q, part, q);
    }
    return sum;
}

static int is_straight_way_free(const solve *s)
{
    cone cones[CONE_COUNT];
    double turn[3];
    read_cones(s, cones);
    turn_to_target(s, s->g + START, turn);
    return violation_along(s, cones, s->g + START, turn, 0.0) == 0.0;
}

/* Write violation and length of every way, (VIAS, 2). */
static void score_ways(const solve *s, double *scores)
{
    cone cones[CONE_COUNT];
    read_cones(s, cones);
    for (long i = 0; i < VIAS; ++i) {
        double q[4], first[3], last[3];
        via(i, q);
        turn_between(s->g + START, q, first);
        turn_to_target(s, q, last);
        scores[2 * i] = violation_along(s, cones, s->g + START, first, BENT_RAD)
            + violation_along(s, cones, q, last, BENT_RAD);
        scores[2 * i + 1] = length_of(first) + length_of(last);
    }
}

/* Take the best way that is left, and strike it off; return which. */
static long take_way(double *scores)
{
    long best = 0;
    for (long i = 1; i < VIAS; ++i)
        if (scores[2 * i] < scores[2 * best]
            || (scores[2 * i] == scores[2 * best] && scores[2 * i + 1] < scores[2 * best + 1]))
            best = i;
    scores[2 * best] = INFINITY;
    return best;
}

/* Begin a start that goes by way of an attitude: the slew law aims, stage by stage, at where it is
 * on the way ahead of the body, by as much as it would still go at this rate. */
static void begin_way(solve *s, const double by[4])
{
    static const double straight[4] = {1.0, 0.0, 0.0, 0.0}, none[3] = {0.0, 0.0, 0.0};
    double corners[2][4], turns[2][3], angles[2], part[4];
    double *axes = s->g + WAY;
    const double *limits = s->g + WAY_LIMITS;
    for (int i = 0; i < 4; ++i)
        corners[0][i] = s->g[START + i];
    turn_between(corners[0], by, turns[0]);
    part_of(turns[0], 1.0, part);
    multiply(corners[0], part, corners[1]);
    turn_to_target(s, corners[1], turns[1]);
    for (int i = 0; i < 2; ++i) {
        angles[i] = fmax(length_of(turns[i]), 1e-9);
        for (int j = 0; j < 3; ++j)
            axes[3 * i + j] = turns[i][j] / angles[i];
    }
    run_way(s->plan, s->fresh, s->model, s->g, s->horizon);
    double rate = limits[0], ahead = rate * rate / (2.0 * limits[1]) + 2.0 * rate;
    for (long k = 0; k <= s->horizon; ++k) {
        double place = fmin(rate * (double)k + ahead, angles[0] + angles[1]), q[4];
        int leg = place > angles[0];
        part_of(turns[leg], (leg ? place - angles[0] : place) / angles[leg], part);
        multiply(corners[leg], part, q);
        for (int i = 0; i < 4; ++i)
            s->model[AT(MODEL_ROWS, AIM + i, k)] = q[i];
    }
    begin_slew(s, COLD_BARRIER, none, 0);
    for (long k = 0; k <= s->horizon; ++k)
        for (int i = 0; i < 4; ++i)
            s->model[AT(MODEL_ROWS, AIM + i, k)] = straight[i];
}
