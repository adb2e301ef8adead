# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The smallest horizon N from which every sampled state at rest reaches the terminal set.

The short form of :mod:`.domain`: few states, and only the largest of their smallest N. The answer
holds for the sampled states; it is not a certificate for those between.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS
from manifold_mpc_ros.errors import DesignError
from manifold_mpc_ros.lab.domain.domain import (
    NONE,
    Round,
    Settings,
    smallest_horizons,
)
from manifold_mpc_ros.lab.domain.states import States, half_turns, uniform_states
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.design import TerminalDesign
from manifold_mpc_ros.terminal.problem_of import terminal_design

# Axes of exact half turns beside x, y and z, and points of the uniform grid.
_HALF_TURNS, _GRID = 30, 100
# The first N that is tried, and the last: as many as the parameter may be.
_FIRST = 4
LARGEST_HORIZON = next(int(each.high) for each in CONTROLLER_PARAMETERS
                       if each.name == 'mpc.horizon' and each.high is not None)
# Factors on the torque weight that are suggested.
_GENTLER = (4.0, 16.0, 64.0)

Progress = Callable[[str], None]


@dataclass(frozen=True)
class HorizonReport:
    """The smallest N, the attitude (rotation vector, rad) that needs it, and what was tried.

    ``tried`` maps each N to the number of states found inside D_N among those that were tried
    with it; ``attitudes`` is how many there are in all.
    """

    smallest: int
    hardest: Array
    attitudes: int
    tried: dict[int, int] = field(default_factory=dict)


def rest_states(config: AttitudeMpcConfig) -> list[States]:
    """Return the states that are asked: exact half turns and a coarse uniform grid."""
    return [half_turns(config, _HALF_TURNS), uniform_states(config, _GRID)]


def smallest_horizon(
    config: AttitudeMpcConfig, *, terminal: TerminalDesign | None = None,
    largest: int = LARGEST_HORIZON, cache_dir: str | Path | None = None,
    progress: Progress | None = None,
) -> HorizonReport:
    """Map a configuration (its own horizon is ignored) to the smallest sufficient N.

    Raises DesignError when ``largest`` steps are not enough for some state.
    """
    tried: dict[int, int] = {}
    states = rest_states(config)

    def advance(now: Round) -> None:
        if now.tried == now.to_try:
            (n,) = now.horizons
            tried[n] = now.found
            if progress is not None:
                progress(f'N = {n}: {now.found} of {now.tried} states at rest are in D_N')

    found = smallest_horizons(
        replace(config, horizon=_FIRST), terminal or terminal_design(config), states,
        settings=Settings(largest=largest, cache_dir=cache_dir), only_largest=True,
        progress=advance)
    if any(domain.largest == NONE for domain in found):
        raise DesignError(
            f'horizon {largest} is not enough to reach the terminal set from every state at '
            'rest; allow more torque or rate, a longer step, or a larger torque_weight (a gentler '
            'local law has a larger terminal set)')
    hardest = max(found, key=lambda domain: domain.largest)
    return HorizonReport(hardest.largest, hardest.states.vectors[hardest.hardest],
                         sum(map(len, states)), dict(sorted(tried.items())))


def gentler_torque_weight(config: AttitudeMpcConfig, *, cache_dir: str | Path | None = None
                          ) -> float | None:
    """Return the least factor tried on the torque weight that makes the configured N enough.

    A gentler local law stays within the torque limits farther from the target, so its terminal
    set is larger and nearer. None when no factor does, or its design does not exist.
    """
    for factor in _GENTLER:
        gentler = replace(config, torque_weight=factor * config.torque_weight)
        try:
            found = smallest_horizons(
                gentler, terminal_design(gentler), rest_states(config), only_largest=True,
                settings=Settings(largest=config.horizon, cache_dir=cache_dir))
        except DesignError:
            continue
        if all(domain.largest != NONE for domain in found):
            return factor
    return None
