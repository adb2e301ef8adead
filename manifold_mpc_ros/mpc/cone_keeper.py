# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cones of a controller: where they are, and what they leave of the terminal set."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.config.cones import directions, tightened
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.compiled import CompiledMpc
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.terminal.cone_cut import cut_level, spread, target_margins_rad
from manifold_mpc_ros.terminal.design import TerminalDesign


class ConeKeeper:
    """Hands cones, and the level that they leave, to the solver."""

    def __init__(self, config: AttitudeMpcConfig, terminal: TerminalDesign, solver: CompiledMpc
                 ) -> None:
        """Begin with the configuration's directions and the identity as target."""
        self._config, self._terminal, self._solver = config, terminal, solver
        self._unit, self._spread = scaling_of(config).cost, spread(config, terminal.P)
        self._R_ND, self._directions_N = np.eye(3), np.zeros(0)
        self._margins: dict[str, float] = {}
        self._kept, self._configured = config.kept_cones, False
        self._level, self._share, self._allowed = terminal.c, 1.0, True
        self.set_directions(None)

    def set_directions(self, directions_N: Mapping[str, ArrayLike] | None) -> None:
        """Set directions by name, (3,) or (N + 1, 3); the configuration's for all other cones."""
        config = self._config
        if not directions_N and (self._configured or not self._kept):
            return
        given = directions(config.cones, directions_N, config.horizon)
        self._configured = not directions_N
        if np.array_equal(given, self._directions_N):
            return
        steps = np.linalg.norm(np.diff(given, axis=0), axis=-1).max(axis=0)
        self._kept = tightened(config.cones, config.between_samples, steps.tolist())
        self._directions_N = given
        self._solver.set_cones(self._kept, given)
        self.aim(self._R_ND)

    def aim(self, R_ND: Array) -> None:
        """Cut the terminal set of a target so that none of it violates a cone; or know it gone."""
        self._R_ND = R_ND
        if not self._kept:
            return
        self._margins = target_margins_rad(self._config, self._kept, R_ND, self._directions_N)
        level = cut_level(self._terminal.c, self._margins, self._spread)
        self._allowed = level > 0.0
        self._level = level or self._terminal.c
        self._set_level()

    def leave(self, share: float) -> None:
        """Use only this part of the terminal level from now on."""
        self._share = share
        self._set_level()

    def _set_level(self) -> None:
        """Hand the level to the solver."""
        part = self._share * self._level if self._config.terminal_constraint else self._terminal.c
        self._solver.set_level(part / self._unit, allowed=self._allowed)

    @property
    def target_margins_rad(self) -> dict[str, float]:
        """By which angle the target keeps each cone or group [rad]; negative: missing."""
        return self._margins
