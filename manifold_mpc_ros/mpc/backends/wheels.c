/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * The reaction wheels of a controller: what those that work give and store, as facets of zonotopes
 * (their normals are w_i x w_j, bounds sum_i |n . w_i| limit_i), the momentum of body and wheels,
 * and the part of the terminal level that it leaves.
 */

/* Numbers of all wheels: inertia, K P^-1 K^T, J (P^-1)_ww J, the largest rate, turn and J omega of
 * xi' P xi <= 1, 1 and c; and of each: axis, largest torque and momentum, whether it works. */
enum { INERTIA, TORQUE_SPREAD = 9, MOMENTUM_SPREAD = 18, LARGEST_RATE = 27, LARGEST_TURN,
       LARGEST_MOMENTUM, ALL_WHEELS };
enum { MOST_TORQUE = 3, MOST_MOMENTUM, AVAILABLE, ONE_WHEEL };

/* Axes that span less than this, or facets that differ by less, count as flat, as one. */
#define LEAST_SPREAD 1e-6
/* What is left of a facet that the momentum at the target is beyond; of motors, whose torque is
 * taken, a start has this part of the room at least. */
#define LEAST_ROOM 1e-3
#define LEAST_FREE 0.2

typedef struct {
    double normals[WHEEL_FACETS][3], torques[WHEEL_FACETS], momenta[WHEEL_FACETS];
    int count;
} facets;

/* v_B = R^T v_N. */
static void turned_back(const double *R, const double v[3], double to[3])
{
    double product[3];
    for (int i = 0; i < 3; ++i)
        product[i] = R[i] * v[0] + R[3 + i] * v[1] + R[6 + i] * v[2];
    for (int i = 0; i < 3; ++i)
        to[i] = product[i];
}

static const double *wheel(const controller *c, long i)
{
    return c->wheels + ALL_WHEELS + ONE_WHEEL * i;
}

static int works(const controller *c, long i, int all)
{
    return wheel(c, i)[AVAILABLE] != 0.0 && (all || c->momentum[i] == c->momentum[i]);
}

/* Whether the least singular value of the axes that work is above the least spread: the pivots of
 * W W^T less its square are positive. */
static int spans_space(const controller *c)
{
    double a[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0}, least = LEAST_SPREAD * LEAST_SPREAD;
    for (long i = 0; i < c->wheel_count; ++i) {
        const double *w = wheel(c, i);
        if (works(c, i, 0)) {
            a[0] += w[0] * w[0];
            a[1] += w[0] * w[1];
            a[2] += w[0] * w[2];
            a[3] += w[1] * w[1];
            a[4] += w[1] * w[2];
            a[5] += w[2] * w[2];
        }
    }
    double first = a[0] - least;
    if (!(first > 0.0))
        return 0;
    double second = a[3] - least - a[1] * a[1] / first, mixed = a[4] - a[1] * a[2] / first;
    return second > 0.0 && a[5] - least - a[2] * a[2] / first - mixed * mixed / second > 0.0;
}

static void add_facet(facets *f, const double one[3], const double other[3])
{
    double normal[3], off[3];
    cross(one, other, normal);
    double length = length_of(normal);
    if (!(length > LEAST_SPREAD) || f->count == WHEEL_FACETS)
        return;
    for (int j = 0; j < 3; ++j)
        normal[j] /= length;
    for (int k = 0; k < f->count; ++k) {
        cross(normal, f->normals[k], off);
        if (!(length_of(off) > LEAST_SPREAD))
            return;
    }
    for (int j = 0; j < 3; ++j)
        f->normals[f->count][j] = normal[j];
    f->torques[f->count] = f->momenta[f->count] = 0.0;
    ++f->count;
}

/* What the wheels that work give and store. */
static void find_facets(const controller *c, int all, facets *f)
{
    f->count = 0;
    for (long i = 0; i < c->wheel_count; ++i)
        for (long k = i + 1; k < c->wheel_count; ++k)
            if (works(c, i, all) && works(c, k, all))
                add_facet(f, wheel(c, i), wheel(c, k));
    for (int k = 0; k < f->count; ++k)
        for (long i = 0; i < c->wheel_count; ++i)
            if (works(c, i, all)) {
                double reach = fabs(inner(f->normals[k], wheel(c, i)));
                f->torques[k] += reach * wheel(c, i)[MOST_TORQUE];
                f->momenta[k] += reach * wheel(c, i)[MOST_MOMENTUM];
            }
}

/* Solve W W^T x = v of the wheels that work, by the adjugate. */
static void solve_gram(const controller *c, int all, const double v[3], double x[3])
{
    double a[9] = {0.0}, cofactors[9];
    for (long i = 0; i < c->wheel_count; ++i)
        for (int j = 0; works(c, i, all) && j < 9; ++j)
            a[j] += wheel(c, i)[j / 3] * wheel(c, i)[j % 3];
    for (int i = 0; i < 3; ++i)
        cross(a + 3 * ((i + 1) % 3), a + 3 * ((i + 2) % 3), cofactors + 3 * i);
    double determinant = inner(a, cofactors);
    for (int i = 0; i < 3; ++i)
        x[i] = inner(cofactors + 3 * i, v) / determinant;
}

/* What they give and store without a motion that turns nothing: |W^+ t|_i <= limit_i, of momenta
 * what that motion leaves; these two (3,) are among them. */
static void find_held_facets(const controller *c, int all, const double *one, const double *other,
                             facets *f)
{
    const double *momentum = c->momentum + c->wheel_count;
    double stored[3] = {0.0, 0.0, 0.0}, along[3], row[3];
    for (long i = 0; i < c->wheel_count; ++i)
        for (int j = 0; works(c, i, all) && j < 3; ++j)
            stored[j] += wheel(c, i)[j] * momentum[i];
    solve_gram(c, all, stored, along);
    f->count = 0;
    for (long i = 0; i < c->wheel_count; ++i) {
        const double *own = wheel(c, i);
        if (!works(c, i, all) || f->count == WHEEL_FACETS)
            continue;
        solve_gram(c, all, own, row);
        double length = length_of(row), nu = momentum[i] - inner(own, along);
        double left = fmax(own[MOST_MOMENTUM] - fabs(nu),
                           fmax(fabs(inner(row, one)), fabs(inner(row, other))));
        for (int j = 0; j < 3; ++j)
            f->normals[f->count][j] = row[j] / length;
        f->torques[f->count] = own[MOST_TORQUE] / length;
        f->momenta[f->count++] = left / length;
    }
}

/* Write normals over bounds, column by column, the last again for facets that are not there, and
 * an offset (3,). */
static void write_facets(const facets *f, const double *bounds, const double offset[3],
                         double unit, double *data)
{
    for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < WHEEL_FACETS; ++k) {
            int from = k < f->count ? k : f->count - 1;
            data[WHEEL_FACETS * j + k] = f->normals[from][j] / bounds[from] * unit;
        }
        data[3 * WHEEL_FACETS + j] = offset[j] / unit;
    }
}

/* Write half widths (3,) of a box of torques inside the facets, in the proportions of the reach
 * along body axes, of the part that the torque `taken` leaves. */
static void write_box(const controller *c, const facets *f, const double taken[3], double *box)
{
    double reach[3] = {INFINITY, INFINITY, INFINITY}, gauge = 0.0, part = INFINITY;
    for (int k = 0; k < f->count; ++k) {
        gauge = fmax(gauge, fabs(inner(f->normals[k], taken)) / f->torques[k]);
        for (int j = 0; j < 3; ++j)
            if (f->normals[k][j] != 0.0)
                reach[j] = fmin(reach[j], f->torques[k] / fabs(f->normals[k][j]));
    }
    for (int k = 0; k < f->count; ++k) {
        double sum = 0.0;
        for (int j = 0; j < 3; ++j)
            sum += fabs(f->normals[k][j]) * reach[j];
        part = fmin(part, f->torques[k] / sum);
    }
    for (int j = 0; j < 3; ++j)
        box[j] = (1.0 - fmin(1.0 - LEAST_FREE, gauge)) * reach[j] * part / c->torque_n_m;
}

/* The least root of c at which the local law keeps facets of which `taken` is taken: with theta,
 * omega and p the largest turn, rate and J omega of the set, docs/theory.md (27),
 * |n K xi| + omega (|H| + p) <= bound - |n d| and |n J xi_w| + theta |H| <= bound - |n (H - o)|.
 * For pointing the roll is free; the momentum of another one is not promised. */
static double least_part(const facets *f, const double *bounds, const double *spread,
                         double beside, const double taken[3])
{
    double least = INFINITY, to[3];
    for (int k = 0; k < f->count; ++k) {
        turned(spread, f->normals[k], to);
        double room = fmax(bounds[k] - fabs(inner(f->normals[k], taken)), LEAST_ROOM * bounds[k]);
        least = fmin(least, room / (sqrt(inner(f->normals[k], to)) + beside));
    }
    return least;
}

/* Plan with the wheels' momenta: those given, NaN for one that is not there, which keeps its last.
 * All count as there where too few would be left. The state is that measured, in rad/s. */
static void hold_wheels(controller *c, const double omega[3])
{
    const double *k = c->wheels, *R_NB = c->s.g + MEASURED, *R_ND = R_NB + 9;
    double stored[3] = {0.0, 0.0, 0.0}, dead[3] = {0.0, 0.0, 0.0};
    double total[3], taken[3], torque[3], off[3], against[3], live[3];
    int all = !spans_space(c);
    facets f;
    for (long i = 0; i < c->wheel_count; ++i) {
        double *held = c->momentum + c->wheel_count + i;
        if (c->momentum[i] == c->momentum[i])
            *held = c->momentum[i];
        for (int j = 0; j < 3; ++j) {
            stored[j] += wheel(c, i)[j] * *held;
            dead[j] += works(c, i, all) ? 0.0 : wheel(c, i)[j] * *held;
        }
    }
    turned(k + INERTIA, omega, total);
    cross(omega, stored, taken);
    for (int j = 0; j < 3; ++j) {
        total[j] += stored[j];
        torque[j] = c->disturbance_n_m[j];
        against[j] = -torque[j];
        taken[j] = torque[j] - taken[j];
    }
    turned(R_NB, total, total);
    turned_back(R_ND, total, total);
    for (int j = 0; j < 3; ++j) {
        c->s.g[TOTAL_MOMENTUM + j] = total[j] / (c->torque_n_m * c->time_s);
        off[j] = total[j] - dead[j];
        live[j] = stored[j] - dead[j];
    }
    if (c->held)
        find_held_facets(c, all, live, off, &f);
    else
        find_facets(c, all, &f);
    write_facets(&f, f.momenta, dead, c->torque_n_m * c->time_s, c->s.g + WHEEL_MOMENTUM_DATA);
    write_facets(&f, f.torques, against, c->torque_n_m, c->s.g + MOTOR_TORQUE_DATA);
    write_box(c, &f, taken, c->s.g + MOTOR_TORQUE_DATA + 3 * WHEEL_FACETS + 3);
    double size = length_of(total);
    double least = fmin(
        least_part(&f, f.torques, k + TORQUE_SPREAD,
                   k[LARGEST_RATE] * (size + k[LARGEST_MOMENTUM]), torque),
        least_part(&f, f.momenta, k + MOMENTUM_SPREAD, k[LARGEST_TURN] * size, off));
    c->wheel_share = fmin(1.0, least * least / c->whole_level);
    set_level(c);
}
