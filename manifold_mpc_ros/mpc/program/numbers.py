# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The numbers of a problem, as they lie in the solver's memory."""

from __future__ import annotations

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program.phase import Field, Structure
from manifold_mpc_ros.mpc.scaling import flat_parameters, scaling_of
from manifold_mpc_ros.mpc.stages.inequalities import inequalities_of
from manifold_mpc_ros.terminal.design import TerminalDesign


def numbers_of(config: AttitudeMpcConfig, terminal: TerminalDesign, level: float,
               structure: Structure) -> dict[Field, Array]:
    """Map a configuration, its terminal design and a terminal level to the global fields."""
    unit = scaling_of(config)
    limits = {each.data: each.numbers(config, unit)
              for each in inequalities_of(structure) if each.data.size}
    return {f.PARAMETER: flat_parameters(config, terminal.P, terminal.K, level), **limits}
