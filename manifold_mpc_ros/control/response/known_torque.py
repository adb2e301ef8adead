# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The torque that acts unasked and is known, at a time and an attitude."""

from __future__ import annotations

import math

import numpy as np

from manifold_mpc_ros.config.orbit import KnownTorque
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.dynamics.environment import gravity_gradient_B
from manifold_mpc_ros.lie.arrays import Array


def known_torque_B(known: KnownTorque, time_ns: int, R_NB: Array) -> Array:
    """Map a time [ns] and an attitude (3, 3) to the torque (3,) in body axes [N m].

    ``tau = constant + table(u) + gravity gradient``; the table is linear in the angle u from the
    ascending node, and periodic.
    """
    torque, table = known.constant_n_m + known.table_n_m[0], known.table_n_m
    if known.orbit is None:
        return np.asarray(torque)
    since_s = time_ns / NANOSECONDS - known.epoch_s
    if len(table) > 1:
        place = known.orbit.angle_rad(since_s) / (2.0 * math.pi) % 1.0 * len(table)
        first, part = int(place), place % 1.0
        torque = known.constant_n_m + (1.0 - part) * table[first % len(table)] + (
            part * table[(first + 1) % len(table)])
    if known.gravity_gradient:
        torque = torque + gravity_gradient_B(
            R_NB, known.orbit.position_N_m(since_s), known.inertia_kg_m2)
    return np.asarray(torque)
