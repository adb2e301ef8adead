/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 *
 * Answers states: reads records of doubles from states.bin (whether to reset, attitude, rate,
 * target, disturbance, whether directions and a reference are given, for how long which torque
 * acts first, whether the null space rests; momenta of wheels, directions, reference where the controller has such), writes 12 to answers.bin (status, passes, searched, cost, residual,
 * violation, promised cost, level of the state, torque, instructions).
 */
#include <stdio.h>

#include "manifold_mpc.h"

double count_instructions(void);

static double memory[MANIFOLD_MPC_MEMORY_DOUBLES];

enum { NODES = MANIFOLD_MPC_HORIZON + 1, MOMENTA = 22,
       DIRECTIONS = MOMENTA + MANIFOLD_MPC_WHEEL_COUNT,
       ATTITUDES = DIRECTIONS + 3 * MANIFOLD_MPC_CONE_COUNT * NODES,
       RATES = ATTITUDES + 4 * MANIFOLD_MPC_MOVING * NODES,
       RECORD = RATES + 3 * MANIFOLD_MPC_MOVING * NODES };

static double in[RECORD];

int main(void)
{
    double out[12];
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
        x.wheel_null_space_rests = in[21] > 0.0;
        x.wheel_momentum_n_m_s = MANIFOLD_MPC_WHEEL_COUNT ? in + MOMENTA : NULL;
        x.cone_directions_N = in[15] > 0.0 ? in + DIRECTIONS : NULL;
        x.reference_xyzw = in[16] > 0.0 ? in + ATTITUDES : NULL;
        x.reference_rad_s = in[16] > 0.0 ? in + RATES : NULL;
        if (!manifold_mpc_advance(mpc, &x, in + 18, in[17]))
            return 6;
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
