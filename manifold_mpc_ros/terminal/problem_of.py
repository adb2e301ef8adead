# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which problem a configuration poses, and its terminal design."""

from __future__ import annotations

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.terminal.attitude_problem import attitude_problem
from manifold_mpc_ros.terminal.cone_cut import cut_design
from manifold_mpc_ros.terminal.design import TerminalDesign, design_terminal
from manifold_mpc_ros.terminal.pointing_problem import pointing_problem
from manifold_mpc_ros.terminal.problem import ManifoldProblem


def problem_of(config: AttitudeMpcConfig) -> ManifoldProblem:
    """Map a configuration to the problem of its ``target``: on SO(3) x SO(3), or S^2 x SO(3)."""
    return pointing_problem(config) if config.target == 'pointing' else attitude_problem(config)


def terminal_design(config: AttitudeMpcConfig) -> TerminalDesign:
    """Map a configuration to the terminal design of its problem, for the identity as target.

    Raises
    ------
    DesignError
        When the design does not exist; the message names the condition that fails.

    """
    design = design_terminal(problem_of(config))
    return cut_design(config, design) if config.cones else design
