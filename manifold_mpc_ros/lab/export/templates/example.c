/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A closed loop: half a turn about z, the body stepped by what the controller predicts.
 */
#include <stdio.h>

#include "manifold_mpc.h"

static double memory[MANIFOLD_MPC_MEMORY_DOUBLES];

int main(void)
{
    static const char *const names[] = {"converged", "feasible", "infeasible", "failed"};
    manifold_mpc *mpc = manifold_mpc_init(memory, sizeof memory);
    manifold_mpc_state x = {
        .attitude_xyzw = {0.0, 0.0, 1.0, 0.0}, .target_xyzw = {0.0, 0.0, 0.0, 1.0}};
    manifold_mpc_result r;
    int status = MANIFOLD_MPC_FAILED;
    if (mpc == NULL)
        return 1;
    for (int tick = 0; tick < 40; ++tick) {
        status = manifold_mpc_solve(mpc, &x, &r);
        printf("%5.1f s  %-10s  passes %3d  torque % .6f % .6f % .6f N m\n",
               tick * MANIFOLD_MPC_STEP_S, names[status], (int)r.passes, r.torque_n_m[0],
               r.torque_n_m[1], r.torque_n_m[2]);
        if (status == MANIFOLD_MPC_FAILED
            || !manifold_mpc_advance(mpc, &x, r.torque_n_m, MANIFOLD_MPC_STEP_S))
            break;
    }
    return status == MANIFOLD_MPC_FAILED;
}
