# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rigorous enclosure of the double integrator's loop: linear, so one box proves it all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from flint import arb, arb_mat

from manifold_mpc_ros.lab.certification.enclosure import Loop, MeanValueForms, exact
from manifold_mpc_ros.lab.certification.jets import Jet
from manifold_mpc_ros.lie.arrays import Array


class DoubleIntegratorEnclosure:
    """The loop of `double_integrator_problem` under ``u = K xi``; L is quadratic, W its form."""

    dimension = 2
    chart_radii: Sequence[tuple[int, arb]] = ((2, arb.pos_inf()),)

    def __init__(self, gain: Array, *, step_s: float = 0.5, position_weight: float = 1.0,
                 velocity_weight: float = 1.0, input_weight: float = 1.0,
                 max_input: float | None = None, max_velocity: float | None = None) -> None:
        """Take the arguments of the problem and K (1, 2)."""
        h, k = arb(step_s), exact(gain)
        self._loop = arb_mat(2, 2, [1, h, 0, 1]) + arb_mat(2, 1, [h * h / 2, h]) * k
        self.weight = arb_mat(2, 2, [arb(position_weight), 0, 0, arb(velocity_weight)]
                              ) + k.transpose() * k * arb(input_weight)
        self.control_limits = None if max_input is None else np.array([max_input])
        self.control_facets = None
        self.cone_radii: Mapping[str, arb] = {}
        self._max_velocity = max_velocity

    def check_cost(self) -> str | None:
        """Return nothing: L is ``xi^T (lambda W) xi / 2``."""
        return None

    def advance(self, xi: list[Jet], forms: MeanValueForms) -> Loop:  # noqa: ARG002
        """Map the coordinates of a box over one step."""
        following = [self._loop[i, 0] * xi[0] + self._loop[i, 1] * xi[1] for i in range(2)]
        if self._max_velocity is None:
            return Loop(following, {})
        return Loop(following, {'velocity': abs(xi[1].value) / arb(self._max_velocity)})
