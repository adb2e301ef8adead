# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Configuration of the controller: one frozen value, checked as a whole when it is built."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.config.checks import CORNERS
from manifold_mpc_ros.config.cones import (
    Between,
    Cone,
    best_margin_rad,
    between_samples,
    cones_from,
    tightened,
    unique_cones,
)
from manifold_mpc_ros.config.parameter import (
    Value,
    by_field,
    named_as_parameter,
    read_values,
)
from manifold_mpc_ros.config.rate_limits import (
    RateBox,
    RateEllipsoid,
    RateLimit,
    check_steps,
    rate_margins,
)
from manifold_mpc_ros.config.simulator import SimulatorConfig
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, CONTROLLER_PARAMETERS
from manifold_mpc_ros.config.target_parameters import HorizonSteps
from manifold_mpc_ros.config.thrusters import ThrusterArray
from manifold_mpc_ros.config.wheel_parameters import wheels_of
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie.arrays import Array

__all__ = ['AttitudeMpcConfig', 'SimulatorConfig']

_CHECKS: dict[str, checks.Check] = {
    'inertia_kg_m2': checks.inertia, 'step_s': checks.positive,
    'horizon': partial(checks.integer, low=1), 'horizon_s': checks.non_negative,
    'attitude_weight': partial(checks.trace_weight, definite=False),
    'rate_weight': partial(checks.trace_weight, definite=False),
    'torque_weight': partial(checks.trace_weight, definite=True),
    'terminal_scale': checks.fraction, 'max_torque_n_m': checks.limit,
    'max_rate_rad_s': checks.limit, 'rate_ellipsoid_s2': checks.ellipsoids,
    'max_rate_norm_rad_s': checks.bound, 'max_kinetic_energy_j': checks.bound,
    'keep_rate_between_samples': checks.boolean,
    'forcing': partial(checks.choice, choices=('symmetric', 'paper')),
    'terminal_constraint': checks.boolean, 'pointing_axis_B': checks.direction,
    'target': partial(checks.choice, choices=('attitude', 'pointing')),
    'pointing_weight': checks.positive}


@dataclass(frozen=True, eq=False)
class AttitudeMpcConfig:
    """Everything that defines the control law; immutable, arrays are read-only.

    The stage cost is ``tr(Qg (I - g)) + tr(Qf (I - f)) / h^2 + tr(u^T R u) / 2`` with u = tau^x.

    Arguments
    ---------
    inertia_kg_m2
        J about the mass centre in body axes, 3x3 (3 numbers: its diagonal) [kg m^2].
    step_s
        Control period h, and step of the prediction [s].
    horizon
        Number of steps N.
    horizon_s
        Time that the N steps cover together [s], more than ``horizon * step_s``: the first
        last h each, the others grow by a constant factor (:class:`.HorizonSteps`). 0: all last h.
    attitude_weight, rate_weight, torque_weight
        Qg, Qf [s^2], R [1/(N m)^2]; symmetric 3x3 (3 numbers: the diagonal).
    terminal_scale
        lambda in (0, 1): the terminal cost is designed for the stage cost divided by lambda.
    max_torque_n_m, max_rate_rad_s
        Half widths of the boxes about zero, body axes; one number or three, inf for no limit
        on an axis, None for no limit at all.
    rate_ellipsoid_s2
        E of the limit ``omega^T E omega <= 1``, symmetric positive definite 3x3 [s^2], or several
        (n, 3, 3); None for none.
    max_rate_norm_rad_s, max_kinetic_energy_j
        Limits on |omega| and on ``omega^T J omega / 2``: ellipsoids too; None or inf for none.
    keep_rate_between_samples
        Keep the rate limits between samples too, under torque that is constant over a step.
    forcing
        'symmetric' for a physical plant under zero-order hold, 'paper' for the paper's form.
    terminal_constraint
        False keeps the terminal cost and drops the terminal set.
    target
        'attitude' (SO(3)), or 'pointing' (S^2): one body axis to its commanded direction, roll
        about it free. The stage cost then has ``w (1 - b . Gamma)`` in place of
        ``tr(Qg (I - g))``, with b the axis and Gamma the commanded direction, in body axes.
    pointing_axis_B
        The body axis b that points (normalised) [1].
    pointing_weight
        w [1].
    cones
        Cones (:class:`.Cone`) that body axes stay out of or in. They need limits on the torque and
        the rate of every axis, which bound how far an axis moves between two samples.
    wheels
        Reaction wheels (:class:`.WheelArray`) that give the torque; None for torque by other
        devices. J is then the body's inertia without that of the wheels about their axes.
    thrusters
        On/off thrusters (:class:`.ThrusterArray`) that give the torque, within ``max_torque_n_m``.

    Raises ConfigurationError naming the first field that is invalid, its value and what would be
    valid.

    """

    inertia_kg_m2: Array
    step_s: float
    horizon: int
    attitude_weight: Array
    rate_weight: Array
    torque_weight: Array
    terminal_scale: float = 0.1
    max_torque_n_m: Array | None = None
    max_rate_rad_s: Array | None = None
    rate_ellipsoid_s2: Array | None = None
    max_rate_norm_rad_s: float | None = None
    max_kinetic_energy_j: float | None = None
    keep_rate_between_samples: bool = False
    forcing: str = 'symmetric'
    terminal_constraint: bool = True
    target: str = 'attitude'
    pointing_axis_B: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    pointing_weight: float = 2.0
    horizon_s: float = 0.0
    cones: Sequence[Cone] = ()
    wheels: WheelArray | None = None
    thrusters: ThrusterArray | None = None

    def __post_init__(self) -> None:
        """Check every field, then what the fields together have to satisfy."""
        checks.fields(self, _CHECKS)
        self._check_grading()
        check_steps(self.rate_limits, self._rate_limit, self.inertia_kg_m2, self.max_torque_n_m,
                    self.steps.longest_s)
        self._check_between_samples()
        checks.fields(self, {'cones': unique_cones})
        if self.cones:
            self._check_cones()
        if self.wheels is not None and not isinstance(self.wheels, WheelArray):
            raise ConfigurationError('wheels', self.wheels, 'a WheelArray, or None')
        if self.wheels is not None and self.forcing == 'paper':
            raise ConfigurationError(
                'forcing', 'paper', "'symmetric' where there are wheels (their momentum follows "
                'from the state of a physical step)')

    @classmethod
    def from_yaml(cls, path: str | Path) -> AttitudeMpcConfig:
        """Read the controller's ROS parameter file, every key of it checked; needs no ROS."""
        return cls.from_parameters(read_values(path, CONTROLLER_NAME, CONTROLLER_PARAMETERS))

    @classmethod
    def from_parameters(cls, values: Mapping[str, Value]) -> AttitudeMpcConfig:
        """Build from the node's checked parameters; errors carry the parameters' names."""
        chosen = by_field(CONTROLLER_PARAMETERS, values, cls)
        try:
            return cls(wheels=wheels_of(values), thrusters=ThrusterArray.from_parameters(values),
                       cones=cones_from(values), **chosen)
        except ConfigurationError as error:
            raise named_as_parameter(CONTROLLER_PARAMETERS, error) from None

    @property
    def error_weight(self) -> Array:
        """The Q of ``tr(Q (I - g))``: Qg, or ``w b b^T`` for pointing."""
        if self.target == 'attitude':
            return self.attitude_weight
        return self.pointing_weight * np.outer(self.pointing_axis_B, self.pointing_axis_B)

    @property
    def rate_ellipsoids_s2(self) -> Array:
        """E (n, 3, 3) of every limit ``omega^T E omega <= 1`` [s^2]."""
        found = [] if self.rate_ellipsoid_s2 is None else list(self.rate_ellipsoid_s2)
        if self.max_rate_norm_rad_s is not None:
            found.append(np.eye(3) / self.max_rate_norm_rad_s ** 2)
        if self.max_kinetic_energy_j is not None:
            found.append(self.inertia_kg_m2 / (2.0 * self.max_kinetic_energy_j))
        return np.array(found).reshape(-1, 3, 3)

    @property
    def rate_limits(self) -> tuple[RateLimit, ...]:
        """Every limit on the body rate."""
        box = () if self.max_rate_rad_s is None else (RateBox(self.max_rate_rad_s),)
        return (*box, *map(RateEllipsoid, self.rate_ellipsoids_s2))

    @cached_property
    def rate_margins(self) -> list[dict[str, float]]:
        """What rate limits that hold at the nodes have to be smaller by, each, to hold between."""
        return rate_margins(self.rate_limits, self.inertia_kg_m2, self.max_torque_n_m, self.step_s)

    @cached_property
    def within_rate_margins(self) -> AttitudeMpcConfig:
        """The same law with rate limits that are smaller by their margins."""
        box, shapes = None, []
        for limit, margin in zip(self.rate_limits, self.rate_margins):
            if isinstance(limit, RateBox):
                box = limit.smaller(margin).max_rate_rad_s
            elif isinstance(limit, RateEllipsoid):
                shapes.append(limit.smaller(margin).E_s2)
        return replace(
            self, keep_rate_between_samples=False, max_rate_norm_rad_s=None,
            max_kinetic_energy_j=None, max_rate_rad_s=box,
            rate_ellipsoid_s2=np.array(shapes) if shapes else None)

    @property
    def planned(self) -> AttitudeMpcConfig:
        """The law with the rate limits that the nodes of plans and the terminal set keep."""
        return self.within_rate_margins if self.keep_rate_between_samples else self

    @cached_property
    def steps(self) -> HorizonSteps:
        """The steps of the horizon."""
        return HorizonSteps(self.horizon, self.step_s, self.horizon_s)

    @property
    def with_equal_steps(self) -> AttitudeMpcConfig:
        """The same law with a horizon that is as long, of steps that all last step_s."""
        return self if not self.horizon_s else replace(
            self, horizon=self.steps.in_periods, horizon_s=0.0)

    def _check_grading(self) -> None:
        """Refuse steps that cannot grow, or that grow where equal ones are counted on."""
        if self.steps.grow and (self.cones or self.wheels is not None or self.forcing == 'paper'):
            raise ConfigurationError(
                'horizon_s', self.horizon_s, '0 with cones, with wheels and with paper forcing')

    @property
    def can_keep_rate_between_samples(self) -> bool:
        """Whether the margins are proved to do that: docs/theory.md, section 18."""
        return (self.forcing == 'symmetric' and self.wheels is None and self.thrusters is None
                and bool(self.rate_margins) and all(self.rate_margins))

    def _check_between_samples(self) -> None:
        """Refuse to promise between samples what is not proved there."""
        if self.keep_rate_between_samples and not self.can_keep_rate_between_samples:
            raise ConfigurationError(
                'keep_rate_between_samples', True, 'False; or limits on torque and rate of every '
                'axis, a shorter step_s, and no paper forcing, wheels or thrusters')

    @property
    def largest_acceleration_rad_s2(self) -> float:
        """Largest |J^-1 tau| over the torque box, infinite where an axis has no limit."""
        box = self.max_torque_n_m
        if box is None or not np.isfinite(box).all():
            return float('inf')
        changes = np.linalg.solve(self.inertia_kg_m2, (box * CORNERS).T)
        return float(np.linalg.norm(changes, axis=0).max())

    @cached_property
    def between_samples(self) -> Between:
        """How far axes move between samples.

        Raises ConfigurationError where limits are missing that bound it.
        """
        acceleration = self.largest_acceleration_rad_s2
        rate = min((limit.largest_rate_rad_s for limit in self.rate_limits
                    if limit.limits_every_axis), default=None)
        if not np.isfinite(acceleration) or rate is None:
            raise ConfigurationError(
                'cones', [each.name for each in self.cones],
                'limits on torque and rate of every axis (max_torque_n_m, and max_rate_rad_s or '
                'another rate limit) where there are cones: they bound the way between samples')
        return between_samples(self.inertia_kg_m2, acceleration, rate, self.step_s)

    @property
    def kept_cones(self) -> tuple[Cone, ...]:
        """The cones that, kept at every sample, are kept between samples."""
        return tightened(self.cones, self.between_samples, [0.0] * len(self.cones)) \
            if self.cones else ()

    def _check_cones(self) -> None:
        """Refuse cones that no attitude keeps together."""
        best = best_margin_rad(self.kept_cones)
        if best < 0.0:
            raise ConfigurationError(
                'cones', [each.name for each in self.cones], 'cones that some attitude keeps '
                f'together (the best one misses by {np.degrees(-best):.3g} degrees)')

    @property
    def _rate_limit(self) -> tuple[str, object]:
        """Name and value of a rate limit, for an error."""
        names = ('max_rate_rad_s', 'rate_ellipsoid_s2', 'max_rate_norm_rad_s',
                 'max_kinetic_energy_j')
        name = next((name for name in names if getattr(self, name) is not None), names[0])
        value = getattr(self, name)
        return name, value.tolist() if isinstance(value, np.ndarray) else value
