/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Answers states: reads records of 15 doubles from states.bin (whether to reset, attitude, rate,
 * target, disturbance), writes 12 to answers.bin (status, passes, searched, cost, residual,
 * violation, promised cost, level of the state, torque, instructions).
 */
#include <stdio.h>

#include "manifold_mpc.h"

double count_instructions(void);

static double memory[MANIFOLD_MPC_MEMORY_DOUBLES];

int main(void)
{
    double in[15], out[12];
    FILE *states = fopen("states.bin", "rb"), *answers = fopen("answers.bin", "wb");
    char *misaligned = (char *)memory + 4;
    if (!states || !answers)
        return 2;
    if (manifold_mpc_init(memory, sizeof memory - 1) || manifold_mpc_init(NULL, sizeof memory)
        || manifold_mpc_init(misaligned, sizeof memory))
        return 3;
    manifold_mpc *mpc = manifold_mpc_init(memory, sizeof memory);
    if (!mpc)
        return 4;
    while (fread(in, sizeof in, 1, states) == 1) {
        manifold_mpc_state x;
        manifold_mpc_result r;
        if (in[0] > 0.0)
            manifold_mpc_reset(mpc);
        for (int i = 0; i < 4; ++i) {
            x.attitude_xyzw[i] = in[1 + i];
            x.target_xyzw[i] = in[8 + i];
        }
        for (int i = 0; i < 3; ++i) {
            x.rate_rad_s[i] = in[5 + i];
            x.disturbance_n_m[i] = in[12 + i];
        }
        double begin = count_instructions();
        out[0] = manifold_mpc_solve(mpc, &x, &r);
        out[11] = count_instructions() - begin;
        out[1] = r.passes;
        out[2] = r.searched;
        out[3] = r.cost;
        out[4] = r.kkt_residual;
        out[5] = r.violation;
        out[6] = r.promised_cost;
        out[7] = r.terminal_ratio;
        for (int i = 0; i < 3; ++i)
            out[8 + i] = r.torque_n_m[i];
        if (fwrite(out, sizeof out, 1, answers) != 1)
            return 5;
    }
    return fclose(states) || fclose(answers);
}
