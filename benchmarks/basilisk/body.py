# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The 6U that flies in Basilisk, and the controller's parameters for it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from link import hub_inertia, sigma_of

from manifold_mpc_ros.config.orbit import EARTH_GM_M3_S2
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.lie.arrays import Array

#: Of the body without the wheels' inertia about their axes [kg m^2], and its limits.
INERTIA = np.diag([0.05, 0.06, 0.02])
RATE_RAD_S = math.radians(1.0)
#: What plans use about each axis; the wheels give more about each [N m].
TORQUE_N_M = 5e-4
#: The pyramid and the wheels of benchmarks/wheels.py.
AXES_B = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]]) / math.sqrt(3.0)
MOTOR_N_M, MOMENTUM_N_M_S, SPIN_KG_M2 = 7e-4, 0.01082, 1.72205648e-5
WHEELS = WheelArray(AXES_B, MOTOR_N_M, MOMENTUM_N_M_S, inertia_kg_m2=SPIN_KG_M2)
FRICTION_N_M, SPEED_RAD_S = 1e-5, 1500.0 * math.pi / 30.0
#: A circular orbit [m].
ORBIT_M = 6.878e6
#: Control period, and a horizon beyond the longest turn.
STEP_S, HORIZON = 0.5, 400


def common() -> dict[str, Any]:
    """Return the controller's parameters that no actuator changes."""
    return {
        'spacecraft.inertia_kg_m2': np.diag(INERTIA).tolist(),
        'limits.max_torque_n_m': [TORQUE_N_M] * 3, 'limits.max_rate_rad_s': [RATE_RAD_S] * 3,
        'mpc.step_s': STEP_S, 'mpc.horizon': HORIZON,
        # In the form of `manifold-mpc tune`: full torque costs what 0.5 degrees do, and the last
        # approach has a time constant of 2.5 s.
        'mpc.attitude_weight': [1.0] * 3, 'mpc.rate_weight': [2.5 ** 2] * 3,
        'mpc.torque_weight': [(math.radians(0.5) / TORQUE_N_M) ** 2] * 3,
    }


def orbit() -> dict[str, Any]:
    """Return place and velocity on the orbit, inclined by 45 degrees."""
    speed = math.sqrt(EARTH_GM_M3_S2 / ORBIT_M)
    return {'position_N_m': [ORBIT_M, 0.0, 0.0],
            'velocity_N_m_s': [0.0, speed * math.sqrt(0.5), speed * math.sqrt(0.5)]}


def hub(R_NB: Array, omega_BN_B: Array | None = None, **devices: Any) -> dict[str, Any]:
    """Return the description of the spacecraft for plant.py, at an attitude and rate."""
    array = WHEELS if 'wheels' in devices else None
    return {'hub_inertia_kg_m2': hub_inertia(INERTIA, array), 'sigma_BN': sigma_of(R_NB),
            'omega_BN_B': np.zeros(3).tolist() if omega_BN_B is None else omega_BN_B.tolist(),
            'step_s': 0.05, 'sample_s': 0.05, 'period_s': STEP_S, **devices}


def wheels(friction_n_m: float) -> dict[str, Any]:
    """Return the description of the wheels, all of which start at one speed."""
    return {'axes_B': AXES_B.tolist(), 'inertia_kg_m2': SPIN_KG_M2, 'max_torque_n_m': MOTOR_N_M,
            'max_speed_rad_s': MOMENTUM_N_M_S / SPIN_KG_M2, 'speed_rad_s': [SPEED_RAD_S] * 4,
            'coulomb_friction_n_m': friction_n_m}


def wheel_parameters() -> dict[str, Any]:
    """Return the parameters of the controller for the wheels."""
    key = 'actuators.wheels'
    return {'actuators.kind': 'wheels', f'{key}.axes_B': AXES_B.ravel().tolist(),
            f'{key}.max_torque_n_m': [MOTOR_N_M], f'{key}.max_momentum_n_m_s': [MOMENTUM_N_M_S],
            f'{key}.inertia_kg_m2': [SPIN_KG_M2]}


def observer(attitude_rad: float = 2.5e-7, rate_rad_s: float = 1e-7) -> dict[str, Any]:
    """Return the parameters of the disturbance observer for friction, by noise of the state."""
    return {'disturbance.estimate': True, 'disturbance.drift_n_m': 1e-5,
            'disturbance.rate_noise_rad_s': rate_rad_s,
            'monitor.attitude_noise_rad': 4.0 * attitude_rad}
