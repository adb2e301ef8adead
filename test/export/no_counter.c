/* Copyright 2026 The manifold_mpc_ros authors
 * SPDX-License-Identifier: Apache-2.0
 */
double count_instructions(void);

double count_instructions(void)
{
    return 0.0;
}
