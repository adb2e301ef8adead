# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The terminal set ``xi^T P xi <= c`` of the last node, elastic."""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.scaling import Scaling
from manifold_mpc_ros.mpc.stages.inequality import Inequality


class TerminalLevel(Inequality):
    """Value ``xi^T P xi / c - 1``; its phases are in :mod:`.terminal`. No data of its own."""

    name = 'terminal_level'
    data_size = 0
    penalty = 1e3

    @classmethod
    def rows_in(cls, config: AttitudeMpcConfig) -> int:
        """Return 1, or 0 without a terminal set."""
        return int(config.terminal_constraint)

    def numbers(self, config: AttitudeMpcConfig, unit: Scaling) -> Array:
        """Return nothing: P and c are parameters of every problem."""
        return np.zeros(0)
