/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * A closed loop: half a turn about z, the body stepped by what the controller predicts.
 */
#include <math.h>
#include <stdio.h>

#include "manifold_mpc.h"

static double memory[MANIFOLD_MPC_MEMORY_DOUBLES];

/* Write the quaternion (x, y, z, w) of a rotation, row by row. */
static void quaternion(const double *R, double q[4])
{
    double most[4] = {1.0 + R[0] - R[4] - R[8], 1.0 - R[0] + R[4] - R[8],
                      1.0 - R[0] - R[4] + R[8], 1.0 + R[0] + R[4] + R[8]};
    int best = 0;
    for (int i = 1; i < 4; ++i)
        if (most[i] > most[best])
            best = i;
    double rows[4][4] = {{most[0], R[1] + R[3], R[2] + R[6], R[7] - R[5]},
                         {R[1] + R[3], most[1], R[5] + R[7], R[2] - R[6]},
                         {R[2] + R[6], R[5] + R[7], most[2], R[3] - R[1]},
                         {R[7] - R[5], R[2] - R[6], R[3] - R[1], most[3]}};
    double norm = 2.0 * sqrt(most[best]);
    for (int i = 0; i < 4; ++i)
        q[i] = rows[best][i] / norm;
}

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
        if (status == MANIFOLD_MPC_FAILED)
            break;
        quaternion(r.rotations_NB + 9, x.attitude_xyzw);
        for (int i = 0; i < 3; ++i)
            x.rate_rad_s[i] = r.rates_rad_s[3 + i];
    }
    return status == MANIFOLD_MPC_FAILED;
}
