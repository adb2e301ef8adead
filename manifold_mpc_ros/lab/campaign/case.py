# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One case of a campaign: its name, and everything that it draws.

A case is a function of the campaign's seed, its set and its index alone, whatever else runs. Each
quantity has a random stream of its own (the initial state one), so that changing how one is drawn
leaves the others as they were.
"""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass

import numpy as np

from manifold_mpc_ros.config.cones import Cone, tightened
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.campaign.keys import MODEL
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.lab.campaign.random_cones import random_cones, straight_way
from manifold_mpc_ros.lab.campaign.sets import CaseSet, ConesDraw, InertiaDraw
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import AnyArray as Array

# Streams beside that of the initial state.
SETPOINT, INERTIA, DISTURBANCE, NOISE, CONES = 1, 2, 3, 4, 5
# Inertias that no body can have and cones that an end breaks are drawn again, so often at most.
MOST_DRAWS = 1000


@dataclass(frozen=True, order=True)
class CaseName:
    """Which case: of which set, and its index within the set."""

    set_name: str
    index: int

    def __str__(self) -> str:
        """Return for example ``random-17``."""
        return f'{self.set_name}-{self.index}'

    @classmethod
    def parse(cls, text: str) -> CaseName:
        """Read what `str` gives; raises ConfigurationError."""
        match = re.fullmatch(r'(\w+)-(\d{1,9})', text, re.ASCII)
        if match is None:
            raise ConfigurationError('case', text, "a name like 'random-17': set and index")
        return cls(match[1], int(match[2]))


@dataclass(frozen=True, eq=False)
class Case:
    """One closed loop before it runs."""

    name: CaseName
    drawn_from: CaseSet
    R_NB: Array             # (3, 3) initial attitude
    omega_BN_B: Array       # (3,) initial rate [rad/s]
    R_ND: Array             # (3, 3) commanded attitude
    inertia_kg_m2: Array    # (3, 3) of the body
    disturbance_n_m: Array  # (3,) in `drawn_from.disturbance.frame`
    attitude_noise_std_rad: float
    rate_noise_std_rad_s: float
    noise_seed: int
    cones: tuple[Cone, ...]  # the controller's, then the drawn ones


def all_names(plan: CampaignPlan) -> list[CaseName]:
    """Return the names of every case, in the order of the table."""
    return [CaseName(one.name, index) for one in plan.sets for index in range(one.loops)]


def draw_case(plan: CampaignPlan, name: CaseName) -> Case:
    """Map a name to its case; the index may be beyond the set's loops.

    Raises ConfigurationError for a set that is not there.
    """
    place = plan.place_of(name.set_name)
    one = plan.sets[place]
    seeds = [plan.seed, place, name.index]
    state = np.random.default_rng(seeds)
    setpoint, inertia, disturbance, noise, cones = (
        np.random.default_rng([*seeds, stream])
        for stream in (SETPOINT, INERTIA, DISTURBANCE, NOISE, CONES))
    R_DB = _error(one, plan.config, state, name.index)
    R_ND = _commanded(one, setpoint)
    R_NB = R_ND @ R_DB
    return Case(
        name, one, R_NB, _rate(one, state), R_ND,
        plan.config.inertia_kg_m2 if one.body == MODEL
        else _inertia(plan.body.inertia_kg_m2, one.inertia, inertia),
        _in_ball(one.disturbance.largest_n_m, disturbance),
        _between(one.noise.attitude_std_rad, noise), _between(one.noise.rate_std_rad_s, noise),
        int(noise.integers(2**31)), tuple(plan.config.cones) if one.cones is None
        else _cones(one.cones, plan.config, R_NB, R_ND, cones))


def _error(one: CaseSet, config: AttitudeMpcConfig, rng: np.random.Generator, index: int
           ) -> Array:
    """Draw the initial attitude seen from the commanded one, R_DB (3, 3)."""
    draw = one.attitude
    if draw.kind == 'half_turn':
        return _half_turn(config, rng, index)
    if draw.xyzw is not None:
        return _rotation(draw.xyzw)
    if draw.angle_deg is not None:
        angle = np.radians(_between(draw.angle_deg, rng))
        return so3.exp(angle * _unit(rng.normal(size=3)))
    return so3.random_rotations(rng, 1)[0]


def _half_turn(config: AttitudeMpcConfig, rng: np.random.Generator, index: int) -> Array:
    """Return a half turn (3, 3), for pointing one that takes b to -b."""
    axis = _unit(rng.normal(size=3))
    if config.target == 'pointing':
        b = config.pointing_axis_B
        axis = _unit(np.cross(b, axis))
    elif index < 3:
        axis = np.linalg.eigh(config.inertia_kg_m2)[1][:, index]
    return 2.0 * np.outer(axis, axis) - np.eye(3)


def _rate(one: CaseSet, rng: np.random.Generator) -> Array:
    """Draw the initial body rate (3,) [rad/s]."""
    draw = one.rate
    if draw.largest_rad_s is not None:
        return _in_ball(draw.largest_rad_s, rng)
    if draw.std_rad_s is not None:
        return rng.normal(size=3) * np.array(draw.std_rad_s)
    return np.zeros(3) if draw.rad_s is None else np.array(draw.rad_s)


def _commanded(one: CaseSet, rng: np.random.Generator) -> Array:
    """Draw the commanded attitude R_ND (3, 3)."""
    if one.setpoint.kind == 'uniform':
        return so3.random_rotations(rng, 1)[0]
    return np.eye(3) if one.setpoint.xyzw is None else _rotation(one.setpoint.xyzw)


def _inertia(J: Array, draw: InertiaDraw, rng: np.random.Generator) -> Array:
    """Draw the inertia of a body about J (3, 3) [kg m^2]; it obeys J_1 + J_2 > J_3."""
    moments, axes = np.linalg.eigh(J)
    for _ in range(MOST_DRAWS):
        drawn = moments * rng.uniform(1.0 - draw.moments_part, 1.0 + draw.moments_part, size=3)
        turn = so3.exp(np.radians(rng.uniform(0.0, draw.axes_deg)) * _unit(rng.normal(size=3)))
        if 2.0 * drawn.max() < drawn.sum():
            turned = turn @ axes
            tensor = (turned * drawn) @ turned.T
            return 0.5 * (tensor + tensor.T)
    raise ConfigurationError(
        'inertia.moments_part', draw.moments_part, 'a spread with some bodies that can exist')


def _cones(draw: ConesDraw, config: AttitudeMpcConfig, R_NB: Array, R_ND: Array,
           rng: np.random.Generator) -> tuple[Cone, ...]:
    """Draw cones that two attitudes keep, after those of the configuration."""
    ends, way = np.array([R_NB, R_ND]), straight_way(R_NB, R_ND)
    out, inside = np.radians([draw.half_angle_deg, draw.keep_in_half_angle_deg]).tolist()
    for _ in range(MOST_DRAWS):
        drawn = random_cones(
            rng, most=draw.most, most_axes=draw.most_axes, keep_in_part=draw.keep_in_part,
            half_angle_rad=out, keep_in_half_angle_rad=inside)
        kept = tightened(drawn, config.between_samples, [0.0] * len(drawn))
        if min(cone.margins_rad(ends).min() for cone in kept) > np.radians(draw.margin_deg) and (
                not draw.on_the_way or min(cone.margins_rad(way).min() for cone in drawn) < 0.0):
            return (*config.cones, *drawn)
    raise ConfigurationError(
        'cones', asdict(draw), 'cones that the initial and the commanded attitude of every case '
        f'keep (in {MOST_DRAWS} draws; with on_the_way they have to be some way apart)')


def _in_ball(radius: float, rng: np.random.Generator) -> Array:
    """Draw a vector uniform in a ball."""
    length = radius * rng.uniform() ** (1 / 3)
    return length * _unit(rng.normal(size=3))


def _between(ends: tuple[float, ...], rng: np.random.Generator) -> float:
    """Draw a number uniform between two ends, or return the only one."""
    return float(rng.uniform(ends[0], ends[-1]))


def _rotation(xyzw: tuple[float, ...]) -> Array:
    """Map a quaternion as files have it to R (3, 3)."""
    x, y, z, w = xyzw
    return so3.rotation_from_quaternion([w, x, y, z])


def _unit(v: Array) -> Array:
    """Return v (3,) divided by its length."""
    return v / np.linalg.norm(v)
