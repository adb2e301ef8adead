# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The smallest horizon N from which every sampled attitude at rest reaches the terminal set.

``D_N`` grows with N (the terminal set is invariant under the local law), so N is found by
doubling and bisection. The answer holds for the sampled attitudes; it is not a certificate for
those between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from manifold_mpc_ros.config import AttitudeMpcConfig
from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.scaling import Array
from manifold_mpc_ros.mpc.solution import SolveStatus
from manifold_mpc_ros.problems.registry import terminal_design

# Axes spread over the half sphere, and the angles [deg] tried about each.
_AXES, _ANGLES_DEG = 30, (180.0, 150.0, 120.0, 90.0)
_LARGEST_HORIZON = 160

Progress = Callable[[str], None]


@dataclass(frozen=True)
class HorizonReport:
    """The smallest N, the attitude (rotation vector, rad) that needs it, and what was tried.

    ``tried`` maps each N to the number of attitudes found feasible before the first that was
    not; ``attitudes`` is how many there were.
    """

    smallest: int
    hardest: Array
    attitudes: int
    tried: dict[int, int] = field(default_factory=dict)


def rest_attitudes() -> Array:
    """Return rotation vectors (n, 3): principal axes and a spiral of axes, several angles."""
    index = np.arange(_AXES) + 0.5
    height, turn = 1 - index / _AXES, np.pi * (1 + np.sqrt(5)) * index
    ring = np.sqrt(1 - height ** 2)
    spiral = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
    axes = np.vstack([np.eye(3), spiral])
    return np.concatenate([np.radians(angle) * axes for angle in _ANGLES_DEG])


def smallest_horizon(config: AttitudeMpcConfig, *, largest: int = _LARGEST_HORIZON,
                     cache_dir: str | Path | None = None, progress: Progress | None = None
                     ) -> HorizonReport:
    """Map a configuration (its own horizon is ignored) to the smallest sufficient N.

    Raises
    ------
    DesignError
        When ``largest`` steps are not enough for some attitude.

    """
    config = replace(config, terminal_constraint=True)
    terminal = terminal_design(config)
    attitudes = rest_attitudes()
    order, tried, hardest = list(range(len(attitudes))), {}, attitudes[0]

    def suffices(n: int) -> bool:
        nonlocal hardest
        mpc = AttitudeMpc(replace(config, horizon=n), cache_dir=cache_dir, terminal=terminal)
        tried[n] = 0
        for index in tuple(order):
            mpc.reset()
            solution = mpc.solve(so3.exp(attitudes[index]), np.zeros(3))
            if solution.status in (SolveStatus.INFEASIBLE, SolveStatus.FAILED):
                order.remove(index)
                order.insert(0, index)
                hardest = attitudes[index]
                break
            tried[n] += 1
        if progress is not None:
            progress(f'N = {n}: {tried[n]} of {len(attitudes)} attitudes feasible'
                     + ('' if tried[n] == len(attitudes) else ', then one was not'))
        return tried[n] == len(attitudes)

    low, high = 0, 4
    while not suffices(min(high, largest)):
        if high >= largest:
            raise DesignError(
                f'horizon {largest} is not enough to reach the terminal set from every attitude '
                'at rest; allow more torque or rate, or a longer step')
        low, high = high, 2 * high
    high = min(high, largest)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if suffices(middle) else (middle, high)
    return HorizonReport(high, hardest, len(attitudes), dict(sorted(tried.items())))
