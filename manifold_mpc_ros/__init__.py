# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Model predictive attitude control on SO(3): the core, importable without ROS."""

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.batch_mpc import BatchMpc
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus
from manifold_mpc_ros.terminal.design import TerminalDesign

__all__ = [
    'AttitudeMpc', 'AttitudeMpcConfig', 'AttitudeMpcSolution', 'BatchMpc', 'ManifoldMpcError',
    'SolveStatus', 'TerminalDesign', 'lgvi_step',
]
