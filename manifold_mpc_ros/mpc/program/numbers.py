# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers of a problem: as they lie in the solver's memory, and beside it for the C sources.

Those beside it are what cones.c, wheels.c and reference.c, each at its head, say in which order.
"""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.rate_limits import RateBox
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Structure
from manifold_mpc_ros.mpc.reference import reference_margins
from manifold_mpc_ros.mpc.scaling import flat_parameters, scaling_of
from manifold_mpc_ros.mpc.stages.inequalities import (
    cone_inequalities,
    inequalities_of,
    rate_inequalities,
)
from manifold_mpc_ros.terminal.cone_cut import counts_for_target, spread
from manifold_mpc_ros.terminal.design import TerminalDesign


def numbers_of(config: AttitudeMpcConfig, terminal: TerminalDesign, structure: Structure
               ) -> dict[Field, Array]:
    """Map a configuration and its terminal design to the global fields."""
    unit = scaling_of(config)
    limits = {each.data: each.numbers(config.planned, unit)
              for each in inequalities_of(structure) if each.data.size}
    return {f.PARAMETER: flat_parameters(config, terminal.P, terminal.K, terminal.c), **limits}


def numbers_beside(config: AttitudeMpcConfig, terminal: TerminalDesign, structure: Structure
                   ) -> dict[str, Array]:
    """Map them to the arrays of the controller in C that the problem has, by name."""
    found = {}
    if config.cones:
        found['cones'] = _of_cones(config, terminal, structure)
    if config.wheels is not None:
        found['wheels'] = _of_wheels(config, terminal)
    if structure.moving:
        found['follow'] = _of_limits(config, structure)
    if structure.graded:
        found['periods'] = np.asarray(config.steps.periods, dtype=float)
    return found


def _of_cones(config: AttitudeMpcConfig, terminal: TerminalDesign, structure: Structure) -> Array:
    """Return the numbers of cones.c."""
    cones, kept, between = config.cones, config.kept_cones, config.between_samples
    counts = counts_for_target(config, cones)
    order = [i for each in cone_inequalities(structure) for i in each.places(cones)]
    return np.concatenate([
        np.array([*between, between.turn_rad, spread(config, terminal.P)]),
        *(np.concatenate([
            [i], cones[i].axis_B,
            [cones[i].sign, cones[i].half_angle_rad, kept[i].half_angle_rad, counts[i]],
            cones[i].direction_N])
          for i in order)])


def _of_wheels(config: AttitudeMpcConfig, terminal: TerminalDesign) -> Array:
    """Return the numbers of wheels.c."""
    wheels, J = config.wheels, config.inertia_kg_m2
    assert wheels is not None
    inverse = np.linalg.inv(terminal.P)
    momenta = J @ inverse[-3:, -3:] @ J
    rate, turn, momentum = (
        float(np.linalg.eigvalsh(each)[-1]) ** 0.5
        for each in (inverse[-3:, -3:], inverse[:-3, :-3], momenta))
    return np.concatenate([
        J.ravel(), (terminal.K @ inverse @ terminal.K.T).ravel(), momenta.ravel(),
        [rate, turn, momentum * terminal.c ** 0.5],
        np.column_stack([wheels.axes_B, wheels.max_torque_n_m, wheels.max_momentum_n_m_s,
                         wheels.available]).ravel()])


def _of_limits(config: AttitudeMpcConfig, structure: Structure) -> Array:
    """Return the numbers of reference.c."""
    unit, margins, planned = scaling_of(config), reference_margins(config), config.planned
    boxes = [(limit, margin) for limit, margin in zip(planned.rate_limits, margins, strict=True)
             if isinstance(limit, RateBox)]
    shapes = planned.rate_ellipsoids_s2
    largest, beside = np.full(3, np.inf), np.zeros(3)
    for limit, margin in boxes:
        largest = limit.max_rate_rad_s
        beside = np.array([margin.get(f'rate {axis}', 0.0) for axis in 'xyz'])
    return np.concatenate([
        config.inertia_kg_m2.ravel(), [len(shapes)], largest, beside,
        [max(margin.values(), default=0.0) for margin in margins[len(boxes):]], shapes.ravel(),
        *(each.numbers(limits, unit) for limits in (planned, config.within_rate_margins)
          for each in rate_inequalities(structure))])
