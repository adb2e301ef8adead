# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Keep-out and keep-in cones of body axes, and what keeps them between two samples.

With c = s . R b (s a direction in N, b an axis in B) a cone of half angle theta is
``c <= cos theta`` (keep-out) or ``c >= cos theta`` (keep-in).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from manifold_mpc_ros.config import checks as checks
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

KINDS = ('keep_out', 'keep_in')
# Attitudes that are tried to see whether cones leave any, and how many of them are improved.
_GRID, _REFINED = 2000, 8
# A round that gains less than this part of its turns makes them smaller.
_GAIN = 0.1
_REPEATED = 5
#: Cones in a group at most, and the power of the mean that nodes keep of it.
MOST_MEMBERS, MEAN_POWER = 4, 32
_VALID_ANGLE = 'an angle above 0 and below pi rad (180 degrees)'


class Between(NamedTuple):
    """h^2/8 of the largest |omega|^2 and of the largest |omega'| between samples."""

    bend: float
    swing: float

    @property
    def turn_rad(self) -> float:
        """What a body turns from the nearer sample at most: h/2 |omega| + h^2/8 |omega'| [rad]."""
        return float((2.0 * self.bend) ** 0.5 - self.swing)


@dataclass(frozen=True, eq=False)
class Cone:
    """One cone: a body axis that stays out of, or in, a cone about a direction.

    Arguments
    ---------
    name
        What parameters, reports and ``solve(directions_N=)`` call it.
    axis_B
        Body axis b (normalised) [1].
    direction_N
        Axis s of the cone in inertial axes (normalised) [1].
    half_angle_rad
        Half angle theta, above 0 and below pi [rad].
    kind
        'keep_out' or 'keep_in'.
    group
        Name of a group of keep-in cones of which any one has to be kept; None: by itself.

    Raises ConfigurationError naming ``cones.NAME.FIELD``, its value and what would be valid.

    """

    name: str
    axis_B: Array
    direction_N: Array
    half_angle_rad: float
    kind: str = 'keep_out'
    group: str | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise ConfigurationError('cones.names', self.name, 'letters, digits and underscores')
        for field in ('axis_B', 'direction_N'):
            value = checks.direction(f'cones.{self.name}.{field}', getattr(self, field))
            object.__setattr__(self, field, value)
        key = f'cones.{self.name}.half_angle_rad'
        angle = checks.number(key, self.half_angle_rad, _VALID_ANGLE)
        if not 0.0 < angle < np.pi:
            raise ConfigurationError(key, angle, _VALID_ANGLE)
        object.__setattr__(self, 'half_angle_rad', angle)
        checks.choice(f'cones.{self.name}.kind', self.kind, KINDS)
        if self.group is not None and (not isinstance(self.group, str) or not self.group
                                       or self.kind != 'keep_in'):
            raise ConfigurationError(f'cones.{self.name}.group', self.group,
                                     'no group, or the name of a group of keep_in cones')

    @property
    def sign(self) -> float:
        """1 for keep-out, -1 for keep-in: ``sign * (c - cos theta) <= 0`` where it is kept."""
        return 1.0 if self.kind == 'keep_out' else -1.0

    def margins_rad(self, R_NB: Any, direction_N: Any = None) -> Array:
        """Map attitudes (..., 3, 3) to the angle (...) by which each keeps the cone [rad].

        Negative where the cone is violated. ``direction_N`` (..., 3) stands in for the cone's.
        """
        s = np.asarray(self.direction_N if direction_N is None else direction_N)
        axis_N = np.asarray(R_NB) @ self.axis_B
        sine = np.linalg.norm(np.cross(axis_N, s), axis=-1)
        angle = np.arctan2(sine, np.sum(axis_N * s, axis=-1))
        return np.asarray(self.sign * (angle - self.half_angle_rad))

    def tightened(self, between: Between, moved: float = 0.0) -> Cone:
        """Return the cone that, kept at samples, keeps this one between them: theory.md (23).

        Of a group its part in keeping one member of it at every instant: theory.md (24b).
        ``moved`` is the largest distance of its unit directions at two samples in succession.

        Raises ConfigurationError when nothing of it is left.
        """
        if self.group is None:
            edge, sine = self.sign * float(np.cos(self.half_angle_rad)), 1.0
            for _ in range(_REPEATED):  # each valid, from above
                bound = edge - between.bend - moved - between.swing * sine
                sine = (1.0 - bound ** 2) ** 0.5 if 0.0 <= bound < 1.0 else 1.0
            moves = f'{moved + sum(between):.3g} in cosine'
        else:
            turn = between.turn_rad + 2.0 * float(np.arcsin(min(moved / 2.0, 1.0)))
            bound = -float(np.cos(max(self.half_angle_rad - turn, 0.0)))
            moves = f'{np.degrees(turn):.3g} degrees'
        if bound <= -1.0:
            raise ConfigurationError(
                f'cones.{self.name}', f'{np.degrees(self.half_angle_rad):.4g} degrees',
                'a half angle that leaves some direction allowed, between samples too (there the '
                f'axis moves by up to {moves}; less with a shorter step_s or lower limits)')
        angle = float(np.arccos(self.sign * bound))
        return replace(self, half_angle_rad=angle)


def unique_cones(key: str, value: Any) -> tuple[Cone, ...]:
    """Return ``value`` as cones with names of their own."""
    given = () if value is None else tuple(value)
    names = [each.name for each in given if isinstance(each, Cone)]
    if len(names) < len(given) or len(set(names)) < len(names):
        raise ConfigurationError(key, value, 'cones (Cone) with names of their own')
    for group, members in groups(given).items():
        if not 1 < len(members) <= MOST_MEMBERS:
            raise ConfigurationError(f'cones.{members[0].name}.group', group,
                                     f'a group of 2 to {MOST_MEMBERS} cones')
    return given


def groups(given: Sequence[Cone]) -> dict[str, list[Cone]]:
    """Return the members of each group, in order."""
    names = dict.fromkeys(each.group for each in given if each.group is not None)
    return {name: [each for each in given if each.group == name] for name in names}


def joined(given: Sequence[Cone], margins: Array) -> dict[str, Array]:
    """Map the margins (n, ...) of cones to those that have to be kept, by name.

    Of a cone by itself its own, of a group that of its best member.
    """
    own = {each.name: margins[i] for i, each in enumerate(given) if each.group is None}
    return own | {name: np.max([margins[i] for i, each in enumerate(given)
                                if each.group == name], axis=0) for name in groups(given)}


def tightened(given: Sequence[Cone], between: Between, moved: Sequence[float]
              ) -> tuple[Cone, ...]:
    """Map cones to those that, kept at samples, keep them between."""
    return tuple(each.tightened(between, shift) for each, shift in zip(given, moved))


def alone(kept: Sequence[Cone]) -> tuple[Cone, ...]:
    """Map kept cones to those of which one by itself makes the mean of its group 1 or more.

    With ``1 + cos theta' = n^(1/32) (1 + cos theta)`` of n members, docs/theory.md (24a); a member
    that cannot do it has a cone of next to nothing.
    """
    sizes = {name: len(members) for name, members in groups(kept).items()}
    return tuple(each if each.group is None else replace(each, half_angle_rad=float(max(
        1e-9, np.arccos(min(1.0, sizes[each.group] ** (1.0 / MEAN_POWER) * (
            1.0 + np.cos(each.half_angle_rad)) - 1.0))))) for each in kept)


def cone_names(values: Mapping[str, Any]) -> list[str]:
    """Return the names of the cones among a controller's checked parameters."""
    return [name for name in values.get('cones.names', ()) if name]


def cones_from(values: Mapping[str, Any]) -> tuple[Cone, ...]:
    """Return the cones that a controller's checked parameters describe."""
    return tuple(Cone(
        name, values[f'cones.{name}.axis_B'], values[f'cones.{name}.direction_N'],
        float(np.radians(values[f'cones.{name}.half_angle_deg'])), values[f'cones.{name}.kind'],
        None if values[f'cones.{name}.group'] == 'none' else values[f'cones.{name}.group'])
        for name in cone_names(values))


def cone_topics(values: Mapping[str, Any]) -> dict[str, tuple[str, float]]:
    """Return topic and timeout [s] of the cones whose directions a topic brings."""
    given = {name: (values[f'cones.{name}.direction_topic'],
                    values[f'cones.{name}.direction_timeout_s']) for name in cone_names(values)}
    return {name: one for name, one in given.items() if one[0] != 'none'}


def check_target(given: Sequence[Cone], key: str, target: str) -> None:
    """Refuse the identity as a target (as the value ``target`` of a key says) that cones forbid.

    Raises ConfigurationError with the angle that is missing.
    """
    given = alone(given)
    margins = np.array([each.margins_rad(np.eye(3)) for each in given]).reshape(len(given))
    for name, margin in joined(given, margins).items():
        if margin < 0.0:
            raise ConfigurationError(
                key, target, f'a target that the cone {name!r} allows '
                f'({np.degrees(-margin):.3g} degrees are missing, between samples included)')


def directions(given: Sequence[Cone], directions_N: Any, horizon: int) -> Array:
    """Map directions by name, (3,) or (N + 1, 3), to all cones' unit directions (N + 1, n, 3).

    Raises ConfigurationError for a name that no cone has, and what is no direction.
    """
    found = np.empty((horizon + 1, len(given), 3))
    for i, each in enumerate(given):
        found[:, i] = each.direction_N
    places = {each.name: i for i, each in enumerate(given)}
    for name, value in (directions_N or {}).items():
        key, valid = f'directions_N[{name!r}]', f'(3,) or ({horizon + 1}, 3) numbers, none of zero'
        if name not in places:
            raise ConfigurationError('directions_N', name, 'names of cones: ' + ', '.join(places))
        array = checks.array(key, value, valid)
        if array.shape not in ((3,), (horizon + 1, 3)):
            raise ConfigurationError(key, array.shape, valid)
        length = np.linalg.norm(array, axis=-1, keepdims=True)
        if not (length > 1e-9).all():
            raise ConfigurationError(key, value, valid)
        found[:, places[name]] = array / length
    return found


def best_margin_rad(given: Sequence[Cone]) -> float:
    """Return about the largest angle by which one attitude keeps all cones, negative if none can.

    The best attitudes of a grid, each improved by a pattern search; margins change by no more
    than the attitude turns.
    """
    def least(R_NB: Array) -> Array:
        margins = np.array([each.margins_rad(R_NB) for each in given])
        return np.min(list(joined(given, margins).values()), axis=0)

    R = so3.spiral_rotations(_GRID)
    best = R[np.argsort(-least(R))[:_REFINED]]
    turns = np.vstack([np.zeros(3), np.indices((3, 3, 3)).reshape(3, -1).T - 1.0])
    radius = 0.25
    while radius > 1e-5:
        tried = best[:, None] @ so3.exp(radius * turns)
        margins = least(tried)
        gained = margins.max(axis=1) - margins[:, 0]
        best = tried[np.arange(len(best)), np.argmax(margins, axis=1)]
        radius *= 1.0 if (gained > _GAIN * radius).any() else 0.5
    return float(least(best).max())


def between_samples(inertia_kg_m2: Array, acceleration: float, rate_rad_s: float,
                    step_s: float) -> Between:
    """Bound the motion between samples at which |omega| is limited.

    With alpha the smallest solution of ``a + k (rate + h/2 alpha)^2 <= alpha``, docs/theory.md
    (22), a from the torque and k from ``J^-1 (omega x J omega)``.

    Raises ConfigurationError when there is no such alpha.
    """
    moments, within = np.linalg.eigvalsh(inertia_kg_m2), step_s / 2.0
    k = float(np.abs((moments[[1, 2, 0]] - moments[[2, 0, 1]]) / moments).max()) / 3.0 ** 0.5
    steady = acceleration + k * rate_rad_s ** 2
    half = 0.5 - k * rate_rad_s * within
    root = half ** 2 - k * within ** 2 * steady
    if half <= 0.0 or root < 0.0:
        raise ConfigurationError(
            'step_s', step_s, 'a step within which limited rates stay bounded (cones)')
    alpha = steady / (half + root ** 0.5)
    return Between(step_s ** 2 / 8.0 * (rate_rad_s + within * alpha) ** 2,
                   step_s ** 2 / 8.0 * alpha)
