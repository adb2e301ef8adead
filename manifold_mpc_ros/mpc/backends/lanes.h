/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Vector lanes and the memory layout of the generated phases, with the extensions of GCC and
 * Clang; one_lane.h is the same in plain C99.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

#if defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX__)
#define LANES 4
#else
#define LANES 2
#endif

typedef double lanes __attribute__((vector_size(8 * LANES)));
typedef int64_t mask __attribute__((vector_size(8 * LANES)));

/* Row `row` of stage k; one block of lanes lies before stage 0, so that k = -1 exists. */
#define BLOCK(rows, row, k) (((k) / LANES + 1) * (rows) * LANES + (row) * LANES)
#define AT(rows, row, k) ((((k) + LANES) / LANES) * (rows) * LANES + (row) * LANES \
                          + ((k) + LANES) % LANES)

/* Seconds of the clock that deadlines are given by, time.monotonic in Python. */
static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static inline lanes splat(double value)
{
    return value - (lanes){};
}

/* A row one stage later or earlier: `step` is from one block to the next. */
static inline lanes after(const double *row, long step)
{
    lanes value;
    memcpy(&value, row + 1, sizeof value);
    value[LANES - 1] = row[step];
    return value;
}

static inline lanes before(const double *row, long step)
{
    lanes value;
    memcpy(&value, row - 1, sizeof value);
    value[0] = row[LANES - 1 - step];
    return value;
}

static inline lanes choose(mask where, lanes yes, lanes no)
{
    return (lanes)((where & (mask)yes) | (~where & (mask)no));
}

static inline lanes truth(mask where)
{
    return (lanes)(where & (mask)splat(1.0));
}

static inline lanes root(lanes a)
{
    lanes value;
    for (int i = 0; i < LANES; ++i)
        value[i] = sqrt(a[i]);
    return value;
}

static inline lanes lanes_lt(lanes a, lanes b) { return truth(a < b); }
static inline lanes lanes_le(lanes a, lanes b) { return truth(a <= b); }
static inline lanes lanes_eq(lanes a, lanes b) { return truth(a == b); }
static inline lanes lanes_ne(lanes a, lanes b) { return truth(a != b); }
static inline lanes lanes_and(lanes a, lanes b) { return truth((a != 0.0) & (b != 0.0)); }
static inline lanes lanes_or(lanes a, lanes b) { return truth((a != 0.0) | (b != 0.0)); }
static inline lanes lanes_not(lanes a) { return truth(a == 0.0); }
static inline lanes lanes_min(lanes a, lanes b) { return choose(a < b, a, b); }
static inline lanes lanes_max(lanes a, lanes b) { return choose(a > b, a, b); }
static inline lanes lanes_if(lanes a, lanes b) { return (lanes)((a != 0.0) & (mask)b); }
static inline lanes lanes_abs(lanes a) { return choose(a < 0.0, -a, a); }

static inline double one_lt(double a, double b) { return a < b; }
static inline double one_le(double a, double b) { return a <= b; }
static inline double one_eq(double a, double b) { return a == b; }
static inline double one_ne(double a, double b) { return a != b; }
static inline double one_and(double a, double b) { return a != 0.0 && b != 0.0; }
static inline double one_or(double a, double b) { return a != 0.0 || b != 0.0; }
static inline double one_not(double a) { return a == 0.0; }
static inline double one_min(double a, double b) { return a < b ? a : b; }
static inline double one_max(double a, double b) { return a > b ? a : b; }
static inline double one_if(double a, double b) { return a != 0.0 ? b : 0.0; }
static inline double m_sign(double a) { return (a > 0.0) - (a < 0.0); }

#define EITHER(a, name) _Generic((a), lanes: lanes_##name, default: one_##name)
#define m_lt(a, b) EITHER(a, lt)(a, b)
#define m_le(a, b) EITHER(a, le)(a, b)
#define m_eq(a, b) EITHER(a, eq)(a, b)
#define m_ne(a, b) EITHER(a, ne)(a, b)
#define m_and(a, b) EITHER(a, and)(a, b)
#define m_or(a, b) EITHER(a, or)(a, b)
#define m_not(a) EITHER(a, not)(a)
#define m_min(a, b) EITHER(a, min)(a, b)
#define m_max(a, b) EITHER(a, max)(a, b)
#define m_if(a, b) EITHER(a, if)(a, b)
#define m_sqrt(a) _Generic((a), lanes: root, default: sqrt)(a)
#define m_abs(a) _Generic((a), lanes: lanes_abs, default: fabs)(a)
