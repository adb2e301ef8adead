/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Model predictive attitude control on SO(3): one call from a measured state to a torque. No
 * allocation, no recursion, no global state; a controller is for one thread at a time.
 *
 * Quaternions are (x, y, z, w) and map body to inertial components, v_N = R(q) v_B; q and -q are
 * the same attitude. Rates and torques are in body axes. SI units and radians.
 */
#ifndef MANIFOLD_MPC_H
#define MANIFOLD_MPC_H

#include <stddef.h>
#include <stdint.h>

#include "manifold_mpc_data.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Memory of one controller, in doubles. */
#define MANIFOLD_MPC_MEMORY_DOUBLES \
    (@FIXED_DOUBLES@ + (MANIFOLD_MPC_HORIZON + 3) * (@MODEL_ROWS@ + 5 * @TRAJECTORY_ROWS@) \
     + @NODE_DOUBLES@ * (MANIFOLD_MPC_HORIZON + 1) + 2 * MANIFOLD_MPC_WHEEL_COUNT)

/* CONVERGED: the optimality conditions hold. FEASIBLE: every limit holds, no better plan than
 * this one was found. INFEASIBLE: no plan was found that meets the state limits and ends in the
 * terminal set; this one violates them as little as an exact penalty says, and keeps the torque
 * limits. FAILED: the state cannot be predicted from; the torque is zero. */
enum {
    MANIFOLD_MPC_CONVERGED,
    MANIFOLD_MPC_FEASIBLE,
    MANIFOLD_MPC_INFEASIBLE,
    MANIFOLD_MPC_FAILED
};

typedef struct manifold_mpc manifold_mpc;

/* What was measured, what is commanded, and a known torque that acts unasked (0 without one). The
 * pointers may be NULL, and have to be where the exported problem has no such thing:
 *
 * wheel_momentum_n_m_s  (wheels); NaN for one that does not work and keeps its last momentum; NULL:
 *                       all at rest
 * wheel_null_space_rests  1: plans keep to what wheels give and store without a motion that turns
 *                       nothing, so that any allocation of motor torques can follow them
 * cone_directions_N     (N + 1, cones, 3), at every node, in the order of the parameters, of any
 *                       length above 0; NULL: those of the parameters
 * reference_xyzw        (N + 1, 4), attitudes of a target that moves, at every node: in place of
 *                       target_xyzw; NULL: it does not move
 * reference_rad_s       (N + 1, 3), its rates in its own axes */
typedef struct {
    double attitude_xyzw[4];
    double rate_rad_s[3];
    double target_xyzw[4];
    double disturbance_n_m[3];
    int32_t wheel_null_space_rests;
    const double *wheel_momentum_n_m_s;
    const double *cone_directions_N;
    const double *reference_xyzw;
    const double *reference_rad_s;
} manifold_mpc_state;

/* The torque to command now, and the plan that it begins. The plan's arrays are in the memory of
 * the controller and stay until its next call.
 *
 * status          one of the above
 * passes          of the local solver, over all starts
 * searched        1 when the global search ran
 * cost            value of the plan; promised_cost bounds that of the next tick
 * kkt_residual    dimensionless
 * violation       the largest relative one of a state limit or of the terminal set, 0 for none
 * terminal_ratio  xi' P xi / c of the measured state, at most 1 inside the terminal set
 * limits_used     the largest part of a torque or rate limit that disturbance and reference use */
typedef struct {
    double torque_n_m[3];
    double cost, promised_cost, kkt_residual, violation, terminal_ratio,
        limits_used;
    int32_t status, passes, searched;
    const double *torques_n_m;  /* (N, 3) */
    const double *rotations_NB; /* (N + 1, 9), row by row */
    const double *rates_rad_s;  /* (N + 1, 3) */
} manifold_mpc_result;

/* Return a controller in memory of at least MANIFOLD_MPC_MEMORY_DOUBLES doubles; NULL when it is
 * smaller, or not aligned as doubles are. */
manifold_mpc *manifold_mpc_init(void *memory, size_t bytes);

/* Forget the plan of the last tick: the next call searches. */
void manifold_mpc_reset(manifold_mpc *mpc);

/* Map a state to a torque; return the status. */
int manifold_mpc_solve(manifold_mpc *mpc, const manifold_mpc_state *state,
                       manifold_mpc_result *result);

/* Move a state on: attitude and rate after a torque that acts for so long, with the disturbance of
 * the state. Where torques act late, move a measured state on by the delay, through the torques
 * that were sent and act until then, and solve for the state that results. Return 0, and change
 * nothing, for a state that cannot be moved on. */
int manifold_mpc_advance(manifold_mpc *mpc, manifold_mpc_state *state, const double torque_n_m[3],
                         double seconds);

#ifdef __cplusplus
}
#endif

#endif
