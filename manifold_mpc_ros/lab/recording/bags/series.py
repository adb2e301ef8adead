# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A run as arrays: states, commands, setpoints, and what the controller said at each tick.

Stamps are nanoseconds as in the messages; times are seconds since the first state. Receipt is
nanoseconds of the recorder's system clock, what ``ros2 bag play`` goes by.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from manifold_mpc_ros.control.moving.trajectory import Trajectory
from manifold_mpc_ros.lie.arrays import Array

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class StateSeries:
    """n states in the order of their stamps, each stamp once; ``repeats`` were left out."""

    stamp_ns: IntArray       # (n,)
    time_s: Array       # (n,)
    received_ns: IntArray    # (n,)
    R_NB: Array         # (n, 3, 3) body to inertial
    omega_BN_B: Array   # (n, 3) [rad/s]
    repeats: int = 0

    def __len__(self) -> int:
        """Return n."""
        return len(self.stamp_ns)


@dataclass(frozen=True, eq=False)
class CommandSeries:
    """m torque commands in the order of receipt; the stamp is that of the state answered."""

    stamp_ns: IntArray        # (m,)
    time_s: Array        # (m,)
    received_ns: IntArray     # (m,)
    torque_B_n_m: Array  # (m, 3)
    repeats: int = 0

    def __len__(self) -> int:
        """Return m."""
        return len(self.stamp_ns)

    def without(self, rows: Collection[int]) -> CommandSeries:
        """Return the commands but those of some rows."""
        kept = [row for row in range(len(self)) if row not in rows]
        return CommandSeries(self.stamp_ns[kept], self.time_s[kept], self.received_ns[kept],
                             self.torque_B_n_m[kept], self.repeats)


@dataclass(frozen=True, eq=False)
class SetpointSeries:
    """k setpoints in the order of time: the commanded attitude, and the direction if one was.

    For a direction ``R_ND`` is the attitude that the controller makes of it
    (`manifold_mpc_ros.mpc.target.attitude_towards`); ``direction_N`` is NaN for an attitude.
    """

    stamp_ns: IntArray       # (k,)
    time_s: Array       # (k,)
    received_ns: IntArray    # (k,)
    R_ND: Array         # (k, 3, 3)
    direction_N: Array  # (k, 3)

    def __len__(self) -> int:
        """Return k."""
        return len(self.stamp_ns)


@dataclass(frozen=True, eq=False)
class ReferenceSeries:
    """r commanded attitudes that move, in the order of their stamps."""

    stamp_ns: IntArray     # (r,) of their first points
    time_s: Array          # (r,)
    received_ns: IntArray  # (r,)
    trajectories: tuple[Trajectory, ...]

    def __len__(self) -> int:
        """Return r."""
        return len(self.stamp_ns)


WHEEL_SPEED, MOTOR_TORQUE = 'wheel speed [rad/s]', 'motor torque [N m]'
DIPOLE = 'dipole [A m^2]'
#: What diagnostics say of devices, by the end of the key.
DEVICE_QUANTITIES = {'_speed_rad_s': WHEEL_SPEED, '_torque_n_m': MOTOR_TORQUE,
                     '_on_s': 'thruster on-time [s]', '_dipole_a_m2': DIPOLE,
                     'pulses': 'pulses so far'}


@dataclass(frozen=True, eq=False)
class TickSeries:
    """What the controller said on /diagnostics after each of t ticks, by ``tick`` (from 1).

    Numbers that it did not give are NaN, words are empty. ``last`` holds all that it said at
    last (totals such as ``promises_broken`` and ``refused.*`` among them), as text; ``devices``
    has the `DEVICE_QUANTITIES` of each wheel, thruster or magnetorquer.
    """

    tick: IntArray                 # (t,)
    received_ns: IntArray          # (t,)
    level: IntArray                # (t,) 0 ok, 1 warning, 2 error
    message: tuple[str, ...]
    mode: tuple[str, ...]
    source: tuple[str, ...]
    solver_status: tuple[str, ...]
    promise: tuple[str, ...]
    iterations: Array         # (t,)
    solve_time_s: Array       # (t,)
    cost: Array               # (t,)
    value_function: Array     # (t,)
    promised_value: Array     # (t,)
    relative_excess: Array    # (t,)
    in_terminal_set: tuple[str, ...]
    last: Mapping[str, str]
    devices: Mapping[str, Mapping[str, Array]]  # quantity to name to values (t,)

    def __len__(self) -> int:
        """Return t."""
        return len(self.tick)

    def total(self, key: str) -> int | None:
        """Return a counter of ``last``, None when the controller did not give it."""
        text = self.last.get(key, '')
        return int(text) if text.lstrip('-').isdecimal() else None

    @property
    def refused(self) -> int:
        """Number of messages that the controller refused, whatever the reason."""
        return sum(int(value) for key, value in self.last.items()
                   if key.startswith('refused.') and value.isdecimal())


@dataclass(frozen=True, eq=False)
class PredictionSeries:
    """p predictions: the attitudes of each plan, the first of them the state it begins at."""

    stamp_ns: IntArray         # (p,) stamp of the state that the plan begins at
    received_ns: IntArray      # (p,)
    R_NB: tuple[Array, ...]  # p times (N + 1, 3, 3)

    def __len__(self) -> int:
        """Return p."""
        return len(self.stamp_ns)
