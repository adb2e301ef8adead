# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Between Basilisk's numbers and ours, and the process in which Basilisk runs (plant.py).

Basilisk has an environment of its own (`make basilisk`), so the two speak by lines of JSON on a
pipe, one a control period. Attitudes cross as sigma_BN, the MRP set of the rotation that turns
inertial axes into body axes, by the conversions of the shipped description ``basilisk``.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from manifold_mpc_ros.config.conventions import AttitudeConvention
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.control.described.conversions import read_attitude, write_attitude
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

PLANT = Path(__file__).with_name('plant.py')
INTERPRETER = Path(__file__).parents[2] / '.venv' / 'basilisk' / 'bin' / 'python'
MRP = AttitudeConvention(form='mrp')


def rotation_of(sigma_BN: Any) -> Array:
    """Map MRP sigma_BN (3,), of either set, to R_NB (3, 3)."""
    x, y, z, w = read_attitude(MRP, [float(each) for each in sigma_BN])
    return so3.rotation_from_quaternion([w, x, y, z])


def sigma_of(R_NB: Array) -> list[float]:
    """Map R_NB (3, 3) to sigma_BN (3,) of the shorter turn."""
    w, x, y, z = map(float, so3.quaternion_from_rotation(R_NB))
    return list(write_attitude(MRP, (x, y, z, w)))


def reference_of(R_ND: Array, omega_DN_D: Array, alpha_DN_D: Array) -> list[list[float]]:
    """Map a commanded attitude, rate and acceleration in its own axes to Basilisk's reference.

    That is sigma_RN, and omega_RN_N and its inertial derivative in inertial axes. The derivative
    is the same seen from the target: ``d/dt (R omega) = R (omega x omega + alpha) = R alpha``.
    """
    return [sigma_of(R_ND), (R_ND @ omega_DN_D).tolist(), (R_ND @ alpha_DN_D).tolist()]


def hub_inertia(body_kg_m2: Array, wheels: WheelArray | None) -> list[float]:
    """Return Basilisk's inertia of the hub (9,): the wheels' about their axes is in it."""
    if wheels is None:
        return np.asarray(body_kg_m2).ravel().tolist()
    return np.asarray(body_kg_m2 + wheels.axes_B.T * wheels.inertia_kg_m2 @ wheels.axes_B
                      ).ravel().tolist()


@dataclass(frozen=True, eq=False)
class PlantState:
    """What Basilisk says at the end of a control period, true and as it is measured.

    ``wheel_speed_rad_s`` and ``motor_torque_n_m`` (n,) are empty without wheels;
    ``peak_rate_rad_s`` (3,) is the largest of each body rate in the period.
    """

    time_s: float
    R_NB: Array
    measured_R_NB: Array
    omega_BN_B: Array
    measured_omega_BN_B: Array
    peak_rate_rad_s: Array
    position_N_m: Array
    wheel_speed_rad_s: Array
    motor_torque_n_m: Array

    @classmethod
    def read(cls, answer: Mapping[str, Any]) -> PlantState:
        """Return the state of an answer."""
        return cls(float(answer['time_s']), *(
            rotation_of(answer[name]) for name in ('sigma_BN', 'measured_sigma_BN')), *(
            np.array(answer.get(name, []), dtype=float) for name in (
                'omega_BN_B', 'measured_omega_BN_B', 'peak_rate_rad_s', 'position_N_m',
                'wheel_speed_rad_s', 'motor_torque_n_m')))


class BasiliskProcess:
    """Basilisk in a process of its own; a context manager.

    Arguments
    ---------
    spacecraft
        The description (plant.py).
    interpreter
        Of the environment that has Basilisk.

    ``state`` is the latest one.
    """

    def __init__(self, spacecraft: Mapping[str, Any], interpreter: Path = INTERPRETER) -> None:
        """Start it."""
        self._process = subprocess.Popen(
            [interpreter, PLANT], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env={'PATH': '/usr/bin:/bin'})
        self.state = self._ask(spacecraft)

    def __enter__(self) -> BasiliskProcess:
        """Return it."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 traceback: TracebackType | None) -> None:
        """End it; it has nothing to save."""
        self._process.kill()
        self._process.wait()

    def advance(self, **asked: Any) -> PlantState:
        """Move on by a control period under what is asked (plant.py)."""
        self.state = self._ask({
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in asked.items()})
        return self.state

    def _ask(self, line: Mapping[str, Any]) -> PlantState:
        """Send a line and return the state of the answer."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(line) + '\n')
        self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise SystemExit(f'Basilisk ended with {self._process.wait()}; it said why above')
        return PlantState.read(json.loads(answer))
