# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Model predictive attitude control on SO(3): the core, importable without ROS.

A public name is imported from its module when it is first used, so that ``import
manifold_mpc_ros`` alone loads no CasADi, SciPy or NumPy.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from manifold_mpc_ros.config.cones import Cone
    from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
    from manifold_mpc_ros.config.wheels import WheelArray
    from manifold_mpc_ros.dynamics.lgvi import lgvi_step
    from manifold_mpc_ros.errors import ManifoldMpcError
    from manifold_mpc_ros.lab.batch.batch_mpc import BatchMpc
    from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
    from manifold_mpc_ros.mpc.reference import Reference
    from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution, SolveStatus
    from manifold_mpc_ros.terminal.design import TerminalDesign

__all__ = [
    'AttitudeMpc', 'AttitudeMpcConfig', 'AttitudeMpcSolution', 'BatchMpc', 'Cone',
    'ManifoldMpcError', 'Reference', 'SolveStatus', 'TerminalDesign', 'WheelArray', 'lgvi_step',
]

# The module of each public name, as above, where type checkers read it.
_MODULES = {
    'AttitudeMpc': 'mpc.attitude_mpc', 'AttitudeMpcConfig': 'config.control_law',
    'AttitudeMpcSolution': 'mpc.solution', 'BatchMpc': 'lab.batch.batch_mpc',
    'Cone': 'config.cones', 'ManifoldMpcError': 'errors', 'Reference': 'mpc.reference',
    'SolveStatus': 'mpc.solution', 'TerminalDesign': 'terminal.design',
    'WheelArray': 'config.wheels', 'lgvi_step': 'dynamics.lgvi',
}


def __getattr__(name: str) -> object:
    """Import a public name from its module; raises AttributeError for any other name."""
    if name not in _MODULES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value: object = getattr(importlib.import_module(f'{__name__}.{_MODULES[name]}'), name)
    globals()[name] = value  # found without this function from now on
    return value


def __dir__() -> list[str]:
    """Return what the module has, the public names included."""
    return sorted({*globals(), *__all__})
