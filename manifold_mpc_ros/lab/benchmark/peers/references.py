# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""IPOPT on exactly our formulation, from our plan and from the slew: what the best cost is."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lab.benchmark.peers import problem
from manifold_mpc_ros.lab.benchmark.peers.oracle import Oracle, steps_of
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

#: Beyond any value of the terminal form: there is no terminal set here.
_NO_LEVEL = 1e12


class OnTheGroup:
    """The LGVI with other unknowns, which shares nothing with our solver."""

    def __init__(self, horizon: int) -> None:
        """Write the problem down for IPOPT."""
        self._config = problem.comparison_config(horizon)
        self._model = problem.quaternion_model()
        self._oracle = Oracle(self._config, self._model.terminal_weight, _NO_LEVEL)

    def improve(self, state: Array, torques_n_m: Array) -> float:
        """Return the least cost that IPOPT finds from torques (N, 3) and from the slew."""
        slew = problem.slew(self._model, state, self._config.horizon)[1]
        return min(self._from(state, torques_n_m, polish=True),
                   self._from(state, slew, polish=False))

    def _from(self, state: Array, torques: Array, *, polish: bool) -> float:
        """Return the cost of the local optimum that starts from torques; inf without one."""
        config, J = self._config, self._config.inertia_kg_m2
        attitudes, rates = [so3.rotation_from_quaternion(state[:4])], [state[4:7]]
        for torque in torques:
            R_NB, omega = lgvi_step(attitudes[-1], rates[-1], torque, inertia_kg_m2=J,
                                    step_s=config.step_s)
            attitudes.append(R_NB)
            rates.append(omega)
        steps = steps_of(np.array(attitudes), np.array(rates), config)
        return self._oracle.solve(attitudes[0], rates[0], steps, polish=polish).cost
