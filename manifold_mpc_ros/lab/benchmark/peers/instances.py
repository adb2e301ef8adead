# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The states that every solver starts from: drawn by rule, written to a file, read back."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

SEED = 0
#: So many are drawn, whatever the number asked for: a short run has the first ones of a long one.
MOST = 200
LARGEST_RATE_RAD_S = 0.2
#: Axes of near half turns lean from a principal axis by these [rad].
LEANS_RAD = (1e-3, 0.05)
#: The rest of the near half turns fall short of 180 degrees by this [rad].
SHORT_BY_RAD = 1e-3
RULE = (
    f'random: the first ones of numpy default_rng({SEED}), {MOST} x 4 standard normals normalised '
    'to quaternions w, x, y, z with w >= 0, then body rates uniform in '
    f'+-{LARGEST_RATE_RAD_S} rad/s; half turns: '
    'exactly 180 degrees about the principal axes, at rest; near half turns: the same with the '
    f'axis leaning by {" and ".join(f"{lean:g}" for lean in LEANS_RAD)} rad to the next, and '
    f'{SHORT_BY_RAD:g} rad short of 180 degrees')


@dataclass(frozen=True)
class Instance:
    """One initial state: a unit quaternion w, x, y, z of R_NB and a body rate [rad/s]."""

    kind: str
    quaternion_wxyz: tuple[float, ...]
    omega_BN_B: tuple[float, ...]

    @property
    def R_NB(self) -> Array:
        """The attitude (3, 3), body components to inertial ones."""
        return so3.rotation_from_quaternion(self.quaternion_wxyz)

    @property
    def state(self) -> Array:
        """The quaternion and the rate (7,)."""
        return np.array([*self.quaternion_wxyz, *self.omega_BN_B])


def draw(random_count: int) -> list[Instance]:
    """Return up to MOST random states, then the exact half turns, then the near ones."""
    rng = np.random.default_rng(SEED)
    quaternions = [_normalised(*normal) for normal in rng.standard_normal((MOST, 4)).tolist()]
    rates = rng.uniform(-LARGEST_RATE_RAD_S, LARGEST_RATE_RAD_S, (MOST, 3))
    states = [('random', q, omega) for q, omega in zip(quaternions, rates)][:random_count]
    axes = np.eye(3)
    states += [('half turn', _turn(axis, np.pi), np.zeros(3)) for axis in axes]
    for axis, towards in zip(axes, np.roll(axes, -1, axis=0)):
        leaning = [math.cos(lean) * axis + math.sin(lean) * towards for lean in LEANS_RAD]
        states += [('near half turn', _turn(each, np.pi), np.zeros(3)) for each in leaning]
        states.append(('near half turn', _turn(axis, np.pi - SHORT_BY_RAD), np.zeros(3)))
    return [Instance(kind, tuple(map(float, q)), tuple(map(float, omega)))
            for kind, q, omega in states]


def _normalised(w: float, x: float, y: float, z: float) -> Array:
    """Return the unit quaternion with w >= 0 along four numbers, rounded alike everywhere.

    By operations that IEEE 754 defines to the bit, where numpy's sums follow the processor.
    """
    length = math.copysign(math.sqrt(w * w + x * x + y * y + z * z), w)
    return np.array([w, x, y, z]) / length


def _turn(axis: Array, angle_rad: float) -> Array:
    """Return the quaternion of a rotation about a unit axis; w is exactly 0 at pi."""
    w = 0.0 if angle_rad == np.pi else math.cos(angle_rad / 2)
    return np.array([w, *(math.sin(angle_rad / 2) * axis)])


def write(path: Path, instances: Sequence[Instance]) -> Path:
    """Write instances with the rule that they follow; every bit of a number is kept."""
    rows = [{'kind': each.kind, 'quaternion_wxyz': each.quaternion_wxyz,
             'omega_BN_B_rad_s': each.omega_BN_B} for each in instances]
    path.write_text(json.dumps({'rule': RULE, 'instances': rows}, indent=1) + '\n',
                    encoding='utf-8')
    return path


def read(path: Path) -> list[Instance]:
    """Read what `write` wrote; raises ManifoldMpcError for anything else."""
    try:
        rows = json.loads(path.read_text(encoding='utf-8'))['instances']
        return [_checked(row) for row in rows]
    except (ValueError, KeyError, TypeError) as error:
        raise ManifoldMpcError(f'{path} is no file of instances: {error!r}') from None


def _checked(row: dict[str, object]) -> Instance:
    """Return one row as an instance; raises ValueError, KeyError or TypeError."""
    vectors = [np.array(row[key], dtype=float) for key in ('quaternion_wxyz', 'omega_BN_B_rad_s')]
    quaternion, omega = vectors
    if quaternion.shape != (4,) or omega.shape != (3,) or not np.isfinite(omega).all() or not (
            abs(np.linalg.norm(quaternion) - 1) < 1e-9):
        raise ValueError(f'not a unit quaternion and a rate: {row}')
    return Instance(str(row['kind']), tuple(map(float, quaternion)), tuple(map(float, omega)))
