# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The public slews: their data, what others published, and the configuration that flies each.

B1, B1b: J. Guid. Control Dyn. G007456, a pointing slew of a body with four wheels round the Sun
cones of two boresights, below a limit of the kinetic energy. B2: arXiv 2509.22422, rolls of a body
of the size of Hubble. B3: Kulumani and Lee (IJCAS), four cones and an unknown constant torque.
B4: Basilisk's scenarioAttitudeConstrainedManeuver, a star tracker that avoids the Sun and two Sun
sensors of which one has to see it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array


@dataclass(frozen=True)
class Slew:
    """A slew at rest to a target attitude, or of ``axis_B`` to a target direction.

    ``law`` holds what the predictor is told beside cones, wheels and target; ``margin_rad`` is
    kept back of the cones. Settled: error, rate and torque below ``settled_*`` for good.
    ``profile``: the setpoint is turned to by a slew profile, as in what flies.
    ``observed``: the disturbance is estimated. Body torques act ideally where there are no wheels.
    """

    name: str
    start: Array
    target: Array
    law: Mapping[str, Any]
    ticks: int
    cones: tuple[Cone, ...] = ()
    margin_rad: float = 0.0
    axis_B: Array | None = None
    wheels: WheelArray | None = None
    energy_form: Array | None = None
    disturbance_n_m: Array | float = 0.0
    settled_deg: float = 0.1
    settled_deg_s: float = np.inf
    settled_n_m: float = np.inf
    profile: bool = False
    observed: bool = False
    others_s: tuple[float, ...] = ()
    within: float | None = None
    bound: str = ''
    plant_inertia: Array | None = None

    @property
    def inertia(self) -> Array:
        """J (3, 3) of the plant [kg m^2]."""
        return np.asarray(self.law['inertia_kg_m2'] if self.plant_inertia is None
                          else self.plant_inertia)

    @property
    def step_s(self) -> float:
        """Period of control [s]."""
        return float(self.law['step_s'])

    def config(self, turned: Array) -> AttitudeMpcConfig:
        """Return the configuration in an inertial frame that is turned (3, 3)."""
        aimed: dict[str, Any] = {} if self.axis_B is None else {
            'target': 'pointing', 'pointing_axis_B': self.axis_B}
        return AttitudeMpcConfig(**self.law, **aimed, wheels=self.wheels, cones=[
            Cone(each.name, each.axis_B, turned @ each.direction_N,
                 each.half_angle_rad + each.sign * self.margin_rad, each.kind, each.group)
            for each in self.cones])


def _mrp(*sigma: float) -> Array:
    """Return R_NB (3, 3) of modified Rodrigues parameters."""
    s = np.array(sigma)
    square = float(s @ s)
    return so3.rotation_from_quaternion(np.array([1.0 - square, *(2.0 * s)]) / (1.0 + square))


def _past_the_sun(name: str, half_angle_rad: float, start: tuple[float, ...],
                  others_s: tuple[float, ...]) -> Slew:
    """Return B1 or B1b. Kept back for the disturbance: 3 % of the energy, 0.05 degrees."""
    J, form = np.diag([0.167174901, 0.125963211, 0.0612346508]), np.diag(
        [0.16715194, 0.12594025, 0.06121169]) / 5.0917e-5
    p1, p2, sun = np.ones(3) / 3 ** 0.5, np.array([-0.8660254, 0.5, 0.0]), np.eye(3)[0]
    q = np.array(start)
    wheels = WheelArray(
        np.array([[0, 0, -1], [0, -0.942809, 1 / 3], [0.816497, 0.471405, 1 / 3],
                  [-0.816497, 0.471405, 1 / 3]]), np.full(4, 7e-4), np.full(4, 0.01082))
    return Slew(
        name, so3.rotation_from_quaternion(q / np.linalg.norm(q)),
        np.array([0, -1, -1]) / 2 ** 0.5,
        {'inertia_kg_m2': J, 'step_s': 2.0, 'horizon': 60, 'attitude_weight': np.eye(3),
         'rate_weight': 0.01 * np.eye(3), 'torque_weight': 1e2 * np.eye(3),
         'max_torque_n_m': 6.9e-4, 'rate_ellipsoid_s2': form / 0.97,
         'terminal_constraint': False}, 75,
        (Cone('p1', p1, sun, half_angle_rad), Cone('p2', p2, sun, half_angle_rad)),
        np.radians(0.05), p1, wheels, form, 1e-5, others_s=others_s, within=1.05, bound=name)


def _roll(degrees: float, others_s: tuple[float, ...], *, profile: bool) -> Slew:
    """Return B2 from one roll."""
    return Slew(
        f'B2, {degrees:g} deg' + (', profile' if profile else ''),
        so3.exp([np.radians(degrees), 0.0, 0.0]), np.eye(3),
        {'inertia_kg_m2': np.diag([31046.0, 77217.0, 78754.0]),
         'step_s': 2.5 if profile else 5.0, 'horizon': 100, 'attitude_weight': np.eye(3),
         'rate_weight': (1.0 if profile else 17.0) ** 2 * np.eye(3),
         'torque_weight': (np.radians(0.004 if profile else 0.3) / 1.2) ** 2 * np.eye(3),
         'max_torque_n_m': 1.2,
         'max_rate_rad_s': np.radians([0.5, 0.2, 0.2]), 'terminal_constraint': False},
        200 if profile else 150, settled_deg=0.3, settled_deg_s=1e-3, settled_n_m=1e-3,
        profile=profile, others_s=others_s, within=1.06, bound=f'B2, {degrees:g} deg')


def _hexrotor() -> Slew:
    """Return B3. Torque and rate limits are ours: the problem has none.

    No rigid body has the published inertia, whose largest moment is above the sum of the others:
    the plant has it all the same, the predictor one that a body can have.
    """
    cones = (((0.174, -0.934, -0.034), 40), ((0.0, 0.7071, 0.7071), 40),
             ((-0.853, 0.436, -0.286), 40), ((-0.122, -0.140, -0.983), 20))
    J = np.array([[5.5, 0.06, -0.03], [0.06, 5.5, 0.01], [-0.03, 0.01, 0.1]]) * 1e-3
    possible = J + np.diag([0.0, 0.0, 3e-5])
    return Slew(
        'B3', so3.exp([0.0, 0.0, np.radians(225.0)]), np.eye(3),
        {'inertia_kg_m2': possible, 'step_s': 2e-3, 'horizon': 150,
         'attitude_weight': np.eye(3),
         'rate_weight': 2e-3 * np.eye(3), 'torque_weight': 0.2 * np.eye(3),
         'max_torque_n_m': (1.0, 1.0, 0.5), 'max_rate_rad_s': 5.0,
         'terminal_constraint': False}, 500,
        tuple(Cone(f'object{i}', np.eye(3)[0], np.array(direction), np.radians(degrees))
              for i, (direction, degrees) in enumerate(cones)),
        np.radians(0.5), disturbance_n_m=np.full(3, 0.2), observed=True,
        plant_inertia=J)


def _star_tracker(number: int, start: Array, target: Array) -> Slew:
    """Return one slew of B4.

    The rate limit is ours, and a fifth of the motors' torque is kept back.
    """
    sun = np.array([0.4191, -0.8330, -0.3611])
    x, y, z = np.eye(3)
    return Slew(
        f'B4, slew {number}', start, target,
        {'inertia_kg_m2': np.diag([0.02, 0.1256, 0.1256]) / 3.0, 'step_s': 0.5, 'horizon': 100,
         'attitude_weight': np.eye(3), 'rate_weight': 1.0 * np.eye(3),
         'torque_weight': 1e2 * np.eye(3), 'max_torque_n_m': 8e-4,
         'max_rate_rad_s': 0.08, 'terminal_constraint': False}, 160,
        (Cone('star_tracker', x, sun, np.radians(20.0)),
         Cone('sensor_y', y, sun, np.radians(70.0), 'keep_in', 'sun'),
         Cone('sensor_z', z, sun, np.radians(70.0), 'keep_in', 'sun')),
        np.radians(0.05), wheels=WheelArray(np.eye(3), np.full(3, 1e-3), np.full(3, 0.01)))


def slews() -> tuple[Slew, ...]:
    """Return all of them."""
    rolls = {110: (2354.7, 4566.0), 90: (2278.0, 4071.0), 75: (2194.8, 3855.0)}
    turns = [((.314, -.251, .228), (.326, -.206, -.823)), ((-.378, .119, -.176),
             (.350, .220, -.440)), ((-.412, .044, -.264), (.350, .220, -.440))]
    return (
        _past_the_sun('B1', np.pi / 4, (0.5, 0.5, 0.5, 0.5), (207.0, 338.8, 803.6)),
        _past_the_sun('B1b', 0.95, (0.5, 0.5, 0.9, 0.5), (374.2, 1079.6)),
        *(_roll(degrees, others, profile=profile) for profile in (False, True)
          for degrees, others in rolls.items()),
        _hexrotor(),
        *(_star_tracker(i + 1, _mrp(*a), _mrp(*b)) for i, (a, b) in enumerate(turns)))
