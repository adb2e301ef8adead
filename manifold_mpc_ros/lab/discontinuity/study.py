# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is measured of one law: across 180 degrees about an axis, about all axes, on S^2.

Why it must jump (paper section 4): the attitudes are not contractible and have Euler
characteristic 0, the directions 2; a continuous law with one attractor needs 1. On S^2 it can be
seen with the naked eye: around the antipode the first torque winds round once, so a law that is
continuous inside has zero torque across the axis somewhere in there, and the axis rests.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from manifold_mpc_ros.lab.discontinuity import discontinuity as d
from manifold_mpc_ros.lab.discontinuity.discontinuity import ColdController, Jump
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.terminal.manifold import tangent_basis

# Samples along the turn (even: 180 degrees itself is none of them) and around a circle.
TURN_SAMPLES = 80
CIRCLE_SAMPLES = 72
# Radii of the circles around the antipode [deg]. Much closer to it all sides cost the same to
# the solver's tie tolerance (1e-7), and its rule for ties decides instead of the cost.
RADII_DEG = (20.0, 10.0, 5.0, 1.0, 0.1)
FIELD_RINGS = 9
# How finely a jump is located about each axis of the map, and around a circle [deg].
MAP_WIDTH_DEG = 0.01
CIRCLE_FINEST_DEG = 1e-6
Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class AxisStudy:
    """A law along ``exp(theta n)`` at rest: samples, jumps, and a place where it is continuous."""

    axis: Array                    # (3,) the unit vector n
    theta_deg: Array               # (n,)
    torque_B_n_m: Array            # (n, 3)
    cost: Array                    # (n,)
    jumps: tuple[Jump, ...]
    jump_costs: Array              # (number of jumps,) the cost there
    smooth_at_deg: float
    smooth_widths_deg: Array       # (k,)
    smooth_differences_n_m: Array  # (k,)

    @property
    def side_jump(self) -> Jump | None:
        """The jump at which the side of the turn, the sign of ``tau . n``, changes."""
        sides = [jump for jump in self.jumps
                 if (jump.below_n_m @ self.axis > 0) != (jump.above_n_m @ self.axis > 0)]
        return max(sides, key=lambda jump: jump.size_n_m, default=None)

    @property
    def steepest_elsewhere(self) -> float:
        """The largest rate of change between samples with no jump between them [N m/deg]."""
        rates = np.linalg.norm(np.diff(self.torque_B_n_m, axis=0), axis=1) / np.diff(
            self.theta_deg)
        for jump in self.jumps:
            rates[np.searchsorted(self.theta_deg, jump.at_deg) - 1] = 0.0
        return float(rates.max())


@dataclass(frozen=True, eq=False)
class JumpMap:
    """The jump about many axes: where the side changes and how large the jump is; NaN: nowhere."""

    axes: Array       # (n, 3)
    at_deg: Array     # (n,)
    jump_n_m: Array   # (n,)


@dataclass(frozen=True, eq=False)
class Circle:
    """The first torque around the antipode at one radius.

    ``winding`` counts its turns, jumps taken the short way; on a circle without jumps it is the
    degree of the law. ``least_opposite_n_m`` is the least ``|tau(phase) - tau(phase + 180)|``:
    what is left of the jump across the antipode however small the circle.
    """

    radius_deg: float
    phase_deg: Array       # (n,) without 360
    torque_B_n_m: Array    # (n, 3)
    angle_rad: Array       # (n,) of the torque's part across the axis
    winding: int
    largest_step_rad: float
    jumps: tuple[Jump, ...]
    least_across_n_m: float
    least_opposite_n_m: float

    @property
    def shows_discontinuity(self) -> bool:
        """Whether no law that agrees on the circle is continuous inside without a rest there."""
        return bool(self.jumps) or self.winding != 0


@dataclass(frozen=True, eq=False)
class AntipodeStudy:
    """A pointing law at rest around the antipode -b of its axis b."""

    circles: tuple[Circle, ...]
    field_deg: Array     # (n, 2) positions beside the antipode, along the basis across b
    field_n_m: Array     # (n, 2) torque across b in the same basis


def study_axis(mpc: ColdController, axis: ArrayLike, span_deg: float) -> AxisStudy:
    """Follow a law from ``180 - span`` to ``180 + span`` degrees about an axis (3,)."""
    n, law = d.unit(axis), d.turn_law(mpc, axis)
    theta = np.linspace(180.0 - span_deg, 180.0 + span_deg, TURN_SAMPLES)
    answers = [d.cold_solution(mpc, so3.exp(np.radians(angle) * n)) for angle in theta]
    torques = np.array([answer.torque_B_n_m for answer in answers])
    jumps = tuple(d.find_jumps(law, theta, torques))
    smooth_at = 180.0 - span_deg / 2
    widths = np.asarray((theta[1] - theta[0]) * 0.5 ** np.arange(0, 30, 2), dtype=float)
    there = [d.cold_solution(mpc, so3.exp(np.radians(jump.at_deg) * n)).cost for jump in jumps]
    return AxisStudy(n, theta, torques, np.array([answer.cost for answer in answers]), jumps,
                     np.array(there), smooth_at, widths, d.differences_at(law, smooth_at, widths))


def map_jumps(mpc: ColdController, axes: Array, span_deg: float,
              progress: Progress | None = None) -> JumpMap:
    """Measure the jump about each of the axes (n, 3)."""
    found = np.full((len(axes), 2), np.nan)
    for k, axis in enumerate(axes):
        jump = d.jump_of_side(mpc, axis, span_deg, MAP_WIDTH_DEG)
        if jump is not None:
            found[k] = jump
        if progress is not None:
            progress(k + 1, len(axes))
    return JumpMap(axes, found[:, 0], found[:, 1])


def study_antipode(mpc: ColdController, radii_deg: Sequence[float] = RADII_DEG,
                   samples: int = CIRCLE_SAMPLES, rings: int = FIELD_RINGS) -> AntipodeStudy:
    """Follow a pointing law around the antipode on circles, and sample it inside the largest."""
    config = mpc.config
    points = d.disk(max(radii_deg), rings)
    radius, phase = np.linalg.norm(points, axis=1), np.arctan2(points[:, 1], points[:, 0])
    attitudes = d.attitude_of_direction(config, radius, np.degrees(phase))
    torques = np.array([d.cold_solution(mpc, R).torque_B_n_m for R in attitudes])
    circles = tuple(study_circle(mpc, radius, samples) for radius in radii_deg)
    return AntipodeStudy(circles, points, torques @ tangent_basis(config.pointing_axis_B))


def study_circle(mpc: ColdController, radius_deg: float, samples: int = CIRCLE_SAMPLES
                 ) -> Circle:
    """Follow a pointing law once around the antipode, by an even number of samples."""
    law = d.circle_law(mpc, radius_deg)
    # Half a step off the axes of the basis, where a body is likely to have its symmetry planes.
    phases = (np.arange(samples + 1) + 0.5) * 360.0 / samples
    torques = np.array([law(phase) for phase in phases])
    jumps = tuple(d.find_jumps(law, phases, torques, finest_deg=CIRCLE_FINEST_DEG))
    closed, torques = torques, torques[:-1]
    assert np.allclose(closed[0], closed[-1], atol=1e-6)
    angles = d.phases_across(mpc.config, torques)
    turns, largest = d.winding(angles)
    opposite = torques - np.roll(torques, samples // 2, axis=0)
    across = torques @ tangent_basis(mpc.config.pointing_axis_B)
    return Circle(radius_deg, phases[:-1], torques, angles, turns, largest, jumps,
                  float(np.linalg.norm(across, axis=1).min()),
                  float(np.linalg.norm(opposite, axis=1).min()))
