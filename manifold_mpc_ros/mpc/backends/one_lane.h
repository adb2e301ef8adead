/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * One lane and no clock: lanes.h in plain C99, for any processor. Deadlines never end.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#define LANES 1
typedef double lanes;

/* Row `row` of stage k; one stage lies before stage 0, so that k = -1 exists. */
#define AT(rows, row, k) (((k) + 1) * (rows) + (row))
#define BLOCK(rows, row, k) AT(rows, row, k)

static double now_s(void)
{
    return 0.0;
}

/* CasADi's instructions: comparisons give 1.0 or 0.0. Arguments are names, evaluated twice. */
#define splat(value) (value)
#define after(row, step) (row)[step]
#define before(row, step) (row)[-(step)]
#define m_lt(a, b) ((double)((a) < (b)))
#define m_le(a, b) ((double)((a) <= (b)))
#define m_eq(a, b) ((double)((a) == (b)))
#define m_ne(a, b) ((double)((a) != (b)))
#define m_and(a, b) ((double)((a) != 0.0 && (b) != 0.0))
#define m_or(a, b) ((double)((a) != 0.0 || (b) != 0.0))
#define m_not(a) ((double)((a) == 0.0))
#define m_min(a, b) ((a) < (b) ? (a) : (b))
#define m_max(a, b) ((a) > (b) ? (a) : (b))
#define m_if(a, b) ((a) != 0.0 ? (b) : 0.0)
#define m_sign(a) ((double)(((a) > 0.0) - ((a) < 0.0)))
#define m_sqrt sqrt
#define m_abs fabs
