# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of the inequalities that a problem can have; a further one is one entry here."""

from __future__ import annotations

from functools import cache

import casadi as ca

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.mpc.program.phase import Read, Structure
from manifold_mpc_ros.mpc.stages.barrier import join
from manifold_mpc_ros.mpc.stages.cone import AnyOf2, AnyOf3, AnyOf4, ConeInequality
from manifold_mpc_ros.mpc.stages.inequality import (
    Inequality,
    NodeInequality,
    RateInequality,
    TorqueInequality,
)
from manifold_mpc_ros.mpc.stages.rate_limits import RateBox, RateEllipsoid
from manifold_mpc_ros.mpc.stages.terminal_level import TerminalLevel
from manifold_mpc_ros.mpc.stages.torque_box import ShiftedTorqueBox, TorqueBox
from manifold_mpc_ros.mpc.stages.wheel_limits import MotorTorque, StoredMomentum

KINDS: tuple[type[Inequality], ...] = (
    TorqueBox, StoredMomentum, MotorTorque, RateBox, RateEllipsoid, ConeInequality, AnyOf2, AnyOf3,
    AnyOf4, TerminalLevel)
#: What takes the place of a kind where a disturbance torque acts.
DISTURBED: dict[type[Inequality], type[Inequality]] = {TorqueBox: ShiftedTorqueBox}


def structure_of(config: AttitudeMpcConfig, *, disturbed: bool = False,
                 moving: bool = False) -> Structure:
    """Map a configuration to the structure that its solver is generated for."""
    kinds = [DISTURBED.get(kind, kind) for kind in KINDS] if disturbed else KINDS
    rows = ((kind.name, kind.rows_in(config)) for kind in kinds)
    return Structure(config.forcing == 'symmetric', config.target == 'pointing',
                     tuple((name, count) for name, count in rows if count), moving,
                     config.horizon_s > 0.0)


@cache
def inequalities_of(structure: Structure) -> tuple[Inequality, ...]:
    """Return the inequalities of a structure."""
    kinds = {kind.name: kind for kind in (*KINDS, *DISTURBED.values())}
    return tuple(kinds[name](rows, structure.graded) for name, rows in structure.rows)


def torque_inequalities(structure: Structure) -> tuple[TorqueInequality, ...]:
    """Return those of a stage's torque."""
    return tuple(each for each in inequalities_of(structure) if isinstance(each, TorqueInequality))


def node_inequalities(structure: Structure) -> tuple[NodeInequality, ...]:
    """Return those of a node's state."""
    return tuple(each for each in inequalities_of(structure) if isinstance(each, NodeInequality))


def rate_inequalities(structure: Structure) -> tuple[RateInequality, ...]:
    """Return those of a node's rate alone."""
    return tuple(each for each in inequalities_of(structure) if isinstance(each, RateInequality))


def torque_box(structure: Structure, read: Read) -> ca.SX | None:
    """Return the half widths (3,) of a box of torques that all limits allow, None without one."""
    boxes = [each.box(read) for each in inequalities_of(structure)
             if isinstance(each, (TorqueInequality, MotorTorque))]
    return join(ca.fmin, boxes) if boxes else None


def rate_box(structure: Structure, read: Read) -> ca.SX | None:
    """Return the half widths (3,) of a box of rates that every limit allows, None without one."""
    boxes = [each.box(read) for each in rate_inequalities(structure)]
    return join(ca.fmin, boxes) if boxes else None


def terminal_level(structure: Structure) -> TerminalLevel | None:
    """Return that of the last node, None without a terminal set."""
    return next((each for each in inequalities_of(structure)
                 if isinstance(each, TerminalLevel)), None)


def cone_inequalities(structure: Structure) -> tuple[ConeInequality, ...]:
    """Return those of cones and of their groups."""
    return tuple(each for each in inequalities_of(structure) if isinstance(each, ConeInequality))


def wheel_inequalities(structure: Structure) -> tuple[StoredMomentum, ...]:
    """Return those of reaction wheels: momentum and motor torque, nothing without wheels."""
    return tuple(each for each in inequalities_of(structure) if isinstance(each, StoredMomentum))


def of_attitude(structure: Structure) -> bool:
    """Return whether a node's inequalities depend on its attitude."""
    return any(each.of_attitude for each in node_inequalities(structure))
