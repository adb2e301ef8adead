# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Slews to a setpoint that jumped: the quickest turn about one axis, as a target that moves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from manifold_mpc_ros.config.cones import joined
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.wheels import Zonotope
from manifold_mpc_ros.control.input_gate import NANOSECONDS, to_ns
from manifold_mpc_ros.control.target import FixedTarget, Target
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.reference import Reference
from manifold_mpc_ros.mpc.target import error_angle

#: Rates that an arc is computed at: its duration is within 1 / RATES of the quickest.
RATES = 400
#: An arc is over so much before its end, relative: times are sums of steps.
ROUNDING = 1e-9
#: Attitudes of a path are so far apart [rad] where cones are looked at.
SPACING_RAD = 0.01


class Arc(NamedTuple):
    """A turn about a unit axis (3,) of the body from R (3, 3): angle and rate at times (m,) [s].

    The rate is linear in time between them.
    """

    R: Array
    axis: Array
    time_s: Array
    angle: Array
    rate: Array

    def at(self, time_s: Array) -> tuple[Array, Array]:
        """Return attitudes (n, 3, 3) and rates (n, 3) [rad/s] at times (n,), at rest after it."""
        s = np.clip(time_s, self.time_s[0], self.time_s[-1])
        k = np.clip(np.searchsorted(self.time_s, s, 'right') - 1, 0, len(self.time_s) - 2)
        since, slope = s - self.time_s[k], np.diff(self.rate) / np.diff(self.time_s)
        turns = s < self.time_s[-1] * (1.0 - ROUNDING)
        rate = np.where(turns, self.rate[k] + slope[k] * since, 0.0)
        angle = np.where(turns, self.angle[k] + since * (
            self.rate[k] + slope[k] * since / 2.0), self.angle[-1])
        return self.R @ so3.exp(angle[:, None] * self.axis), rate[:, None] * self.axis


@dataclass(frozen=True)
class AxisLimits:
    """What part of the limits allows about a body axis n: ``|p_f a + q_f w^2| <= part``.

    p = N J n and q = N (n x J n) over the bounds, N the normals of the torque set's facets: the
    torque of a turn about n with rate w and acceleration a is ``J n a + n x J n w^2``.
    """

    p: Array
    q: Array
    part: float
    rate_rad_s: float

    @classmethod
    def about(cls, config: AttitudeMpcConfig, axis_B: Array, part: float) -> AxisLimits:
        """Return those of a unit axis (3,); inf where the configuration limits no torque."""
        assert config.max_torque_n_m is not None
        torques = (Zonotope(np.eye(3), config.max_torque_n_m) if config.wheels is None
                   else config.wheels.torques)
        momentum = config.inertia_kg_m2 @ axis_B
        p = torques.normals @ momentum / torques.bounds
        q = torques.normals @ np.cross(axis_B, momentum) / torques.bounds
        rates = [float(limit.rate_about(axis_B))
                 for limit in config.within_rate_margins.rate_limits]
        return cls(np.abs(p), np.where(p < 0.0, -q, q), part, part * min(rates, default=math.inf))

    @property
    def coasting_rad_s(self) -> float:
        """The largest rate that torques within the part keep about the axis."""
        return math.sqrt(self.part / max(float(np.abs(self.q).max()), 1e-300))

    def ramp(self, rates: Array, *, brake: bool) -> tuple[Array, Array]:
        """Return times and angles (m,) at which growing rates (m,) are reached from the first.

        Backwards in time with ``brake``: how long and how far before the first one they are.
        """
        middle = (rates[1:] + rates[:-1]) / 2.0
        turning = (self.q if brake else -self.q)[:, None] * middle ** 2
        with np.errstate(divide='ignore'):
            times = np.diff(rates) / np.min((self.part + turning) / self.p[:, None], axis=0)
        return (np.append(0.0, np.cumsum(times)), np.append(0.0, np.cumsum(times * middle)))

    def stop(self, rate: float) -> tuple[Array, Array, Array] | None:
        """Return times, angles and rates of the quickest stop; None when beyond the torque."""
        if rate > self.coasting_rad_s:
            return None
        rates = np.linspace(0.0, rate, RATES)
        times, angles = self.ramp(rates, brake=True)
        return times[-1] - times[::-1], angles[-1] - angles[::-1], rates[::-1]

    def turn(self, angle: float) -> tuple[Array, Array, Array]:
        """Return times, angles and rates of the quickest turn from rest to rest."""
        # 4 / 3: the torque that turns the rate speeds up by no more than it brakes.
        quick = math.sqrt(4.0 / 3.0 * angle * self.part / float(self.p.max()))
        rates = np.linspace(0.0, min(quick, self.rate_rad_s, self.coasting_rad_s), RATES)
        (up_s, up), (down_s, down) = (self.ramp(rates, brake=brake) for brake in (False, True))
        top = int(np.searchsorted(up + down, angle, 'right'))
        up_s, up, down_s, down, rates = (each[:top] for each in (up_s, up, down_s, down, rates))
        coast_s = (angle - up[-1] - down[-1]) / rates[-1]
        time_s = np.append(up_s, up_s[-1] + coast_s + down_s[-1] - down_s[::-1])
        return (time_s, np.append(up, angle - down[::-1]), np.append(rates, rates[::-1]))


@dataclass(frozen=True)
class SlewProfile:
    """A stop about the axis of the present rate, and a turn to the goal, from ``begin_ns`` on."""

    begin_ns: int
    arcs: tuple[Arc, ...]

    def over(self, time_ns: int) -> bool:
        """Return whether it has ended at a time [ns]."""
        return time_ns >= self.begin_ns + to_ns(self.arcs[-1].time_s[-1])

    def at(self, time_ns: int, after_s: Array) -> tuple[Array, Array]:
        """Return ``R_ND^T R`` (n, 3, 3), R_ND the goal, and rates (n, 3) after a time [ns]."""
        s = (time_ns - self.begin_ns) / NANOSECONDS + after_s
        R, omega = self.arcs[0].at(s)
        for arc in self.arcs[1:]:
            later = s >= arc.time_s[0]
            R[later], omega[later] = arc.at(s[later])
        return R, omega

    def attitudes(self) -> Array:
        """Return ``R_ND^T R`` (n, 3, 3) along the whole path, `SPACING_RAD` apart at most."""
        return np.concatenate([arc.R @ so3.exp(np.linspace(
            0.0, arc.angle[-1], 2 + int(arc.angle[-1] / SPACING_RAD))[:, None] * arc.axis)
            for arc in self.arcs])


@dataclass(frozen=True, eq=False)
class ProfiledTarget:
    """A profile towards the attitude R_ND (3, 3)."""

    R_ND: Array
    profile: SlewProfile
    moves = True

    def at(self, time_ns: int) -> tuple[Array, Array]:
        """Return attitude (3, 3) and rate (3,) [rad/s] at a time [ns]."""
        R, omega = self.profile.at(time_ns, np.zeros(1))
        return self.R_ND @ R[0], omega[0]

    def over_horizon(self, time_ns: int, step_s: float, steps: int) -> Reference:
        """Return attitudes and rates at so many steps from a time [ns], both ends included."""
        R, omega = self.profile.at(
            time_ns, np.linspace(0.0, steps * step_s, steps + 1))
        return Reference(self.R_ND @ R, omega)

    def warning(self, _time_ns: int) -> str:
        """Return that nothing is wrong."""
        return ''


class SlewPlanner:
    """Puts a profile in the place of a fixed setpoint that is far from where the body should be.

    Where it should be is where the profile is, or the setpoint without one. So a setpoint that
    jumps, a body that was pushed away, and the first state begin a profile, a setpoint that
    creeps carries the present one with it. There is none, and the setpoint is aimed at, while the
    body cannot be stopped about the axis of its rate, and where the path would break a cone.

    Arguments
    ---------
    config
        Body and limits.
    torque_fraction
        Part of the torque and rate limits that profiles use, above 0 and below 1.
    smallest_angle_rad
        Nearer than this nothing begins.

    ``follows``: whether the last target was a profile.
    """

    def __init__(self, config: AttitudeMpcConfig, torque_fraction: float,
                 smallest_angle_rad: float) -> None:
        """Begin without a profile."""
        self._config, self._part, self._near = config, torque_fraction, smallest_angle_rad
        self.forget()

    @classmethod
    def from_config(cls, config: ControllerConfig) -> SlewPlanner | None:
        """Return what a controller's configuration asks for, None where it does not."""
        if not config.slew_torque_fraction:
            return None
        return cls(config.mpc, config.slew_torque_fraction, config.slew_smallest_angle_rad)

    def forget(self) -> None:
        """Plan anew at the next state."""
        self._profile: SlewProfile | None = None
        self._blocked: Array | None = None
        self.follows = False

    def target(
        self, setpoint: Target, state: tuple[Array, Array], time_ns: int,
        directions_N: Mapping[str, Array], on_begin: Callable[[str], object] = bool,
    ) -> Target:
        """Return what to follow from a state R_NB, omega_BN_B [rad/s] at a time [ns].

        ``directions_N`` stand in for those of cones, by name; ``on_begin`` is told of a new
        profile.
        """
        if not isinstance(setpoint, FixedTarget):
            self.forget()
            return setpoint
        R_ND, profile = setpoint.R_ND, self._profile
        expected = R_ND if profile is None else R_ND @ profile.at(time_ns, np.zeros(1))[0][0]
        if self._far(expected, state[0]) and (
                self._blocked is None or self._far(self._blocked, R_ND)):
            profile = self._profile = self._plan(R_ND, state, time_ns, directions_N)
            if profile is not None:
                on_begin('a slew profile begins')
        self.follows = profile is not None and not profile.over(time_ns)
        return ProfiledTarget(R_ND, profile) if profile is not None and self.follows else setpoint

    def _far(self, R_ND: Array, R_NB: Array) -> bool:
        """Return whether an attitude is far from another."""
        return float(error_angle(self._config, R_ND.T @ R_NB)) > self._near

    def _plan(self, R_ND: Array, state: tuple[Array, Array], time_ns: int,
              directions_N: Mapping[str, Array]) -> SlewProfile | None:
        """Return the profile from a state on, None where there is none."""
        config, arcs, s, self._blocked = self._config, [], 0.0, None
        R, rate = R_ND.T @ state[0], float(np.linalg.norm(state[1]))
        if rate > 0.0:
            axis = state[1] / rate
            stop = AxisLimits.about(config, axis, self._part).stop(rate)
            if stop is None:
                return None
            arcs.append(Arc(R, axis, *stop))
            R, s = R @ so3.exp(stop[1][-1] * axis), float(stop[0][-1])
        turn = so3.log(R.T @ self._goal(R))
        angle = float(np.linalg.norm(turn))
        if angle > 0.0:
            axis, h = turn / angle, config.step_s
            time_s, angles, rates = AxisLimits.about(config, axis, self._part).turn(angle)
            longer = (math.ceil((s + time_s[-1]) / h) * h - s) / time_s[-1]
            arcs.append(Arc(R, axis, s + longer * time_s, angles, rates / longer))
        profile = SlewProfile(time_ns, tuple(arcs))
        if not self._clear(R_ND @ profile.attitudes(), directions_N):
            self._blocked = R_ND
            return None
        return profile

    def _goal(self, R: Array) -> Array:
        """Return the end (3, 3) of the turn from R: the identity, for pointing rolled as R is."""
        if self._config.target != 'pointing':
            return np.eye(3)
        return Reference.fixed(np.eye(3), 0).rolled(self._config.pointing_axis_B, R).R_ND[0]

    def _clear(self, attitudes: Array, directions_N: Mapping[str, Array]) -> bool:
        """Return whether all attitudes (n, 3, 3) keep the cones by what is between them."""
        cones = self._config.kept_cones
        margins = np.array([cone.margins_rad(attitudes, directions_N.get(cone.name))
                            for cone in cones])
        return all(float(each.min()) > SPACING_RAD / 2.0
                   for each in joined(cones, margins).values())
