# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the generated code depends on, and the symbols that its stage functions share."""

from __future__ import annotations

from typing import NamedTuple

import casadi as ca

from manifold_mpc_ros.mpc import stage
from manifold_mpc_ros.mpc.scaling import PARAMETERS

# Cost of one unit of relative violation of a rate limit and of the terminal level, in units
# of tr(Qg)/3: exact penalties as long as they exceed the multipliers of the hard problem.
RATE_PENALTY = 1e4
TERMINAL_PENALTY = 1e3


class Structure(NamedTuple):
    """What the generated code depends on; all numbers are run-time parameters."""

    horizon: int
    symmetric: bool
    torque_box: bool
    rate_box: bool
    terminal_set: bool
    pointing: bool = False

    @property
    def stage_duals(self) -> int:
        """Return the length of one stage's barrier vector: torque (y, s), rate (y, t, s)."""
        return 12 * self.torque_box + 18 * self.rate_box

    @property
    def terminal_duals(self) -> int:
        """Return the length of the terminal barrier vector (y, t, s)."""
        return 3 * self.terminal_set


def split_duals(dual: ca.SX, structure: Structure) -> list[ca.SX]:
    """Return torque (y, s) and rate (y, t, s), each (6,), empty where not present."""
    torque, rate = 6 * structure.torque_box, 6 * structure.rate_box
    return list(ca.vertsplit(dual, [0, torque, 2 * torque, 2 * torque + rate,
                                    2 * (torque + rate), 2 * torque + 3 * rate]))


def dense(*values: ca.SX) -> list[ca.SX]:
    """Return the values without structural zeros, as the horizon's buffers want them."""
    return [ca.densify(value) for value in values]


class StageInputs(NamedTuple):
    """Symbols shared by the stage functions."""

    node: ca.SX
    node_next: ca.SX
    step_cayley: ca.SX
    torque: ca.SX
    dual: ca.SX
    mu: ca.SX
    flat: ca.SX


def stage_inputs(structure: Structure) -> StageInputs:
    """Return fresh symbols for one stage."""
    return StageInputs(
        ca.SX.sym('node', stage.NODE), ca.SX.sym('node_next', stage.NODE),
        ca.SX.sym('step_cayley', 3), ca.SX.sym('torque', 3),
        ca.SX.sym('dual', structure.stage_duals), ca.SX.sym('mu'),
        ca.SX.sym('flat', PARAMETERS))
