# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Devices that do not do what they are asked: thrusters by the body's answer, wheels by reports.

Pure logic; one call a tick, with what the devices were asked in the tick before.
"""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.lie.arrays import Array, BoolArray

#: What was seen counts this part of itself one tick later.
_FADING = 0.95
#: A thruster is off when the impulse that is missing is its own, within this part of it, and
#: explains this part of all that is wrong, of pulses of three shortest ones at least.
_OWN, _EXPLAINED, _PULSES = 0.3, 0.7, 3.0
#: Motor torques below this part of the largest tell nothing of a wheel.
_TELLING = 0.15
#: A wheel that gains less than the first part of its impulse lags, from the second on it follows.
_LAGGING, _FOLLOWING = 0.2, 0.6
#: Torque times steps, in parts of the largest torque, that a wheel may lag.
_LONGEST_LAG = 0.25
#: Beyond this part of its momentum a motor may have no torque outwards.
_FULL = 0.98


class ThrusterWatch:
    """Finds one thruster that is off, by the impulse that the body did not get.

    With p_k the impulse (3,) that thruster k was asked for and r what was measured less all of
    them, sums over ticks give for each k

        s_k = sum p_k . p_k,    m_k = -sum r . p_k,    e = sum r . r,

    and k is off where m_k / s_k is 1 within `_OWN` and m_k^2 / s_k is `_EXPLAINED` of e at least.

    Arguments
    ---------
    matrix_n_m
        Torques of the thrusters (3, n).
    min_on_time_s
        Their shortest pulses (n,).

    """

    def __init__(self, matrix_n_m: Array, min_on_time_s: Array) -> None:
        """Have seen nothing."""
        self._matrix = matrix_n_m
        self._least = _PULSES * np.sum((matrix_n_m * min_on_time_s) ** 2, axis=0)
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._asked, self._missing = np.zeros((2, self._matrix.shape[1]))
        self._wrong = 0.0

    def see(self, on_s: Array, missing_B_n_m_s: Array) -> int | None:
        """Take on-times (n,) and the impulse (3,) that is missing; return the one that is off."""
        asked = self._matrix * on_s
        self._asked = _FADING * self._asked + np.sum(asked ** 2, axis=0)
        self._missing = _FADING * self._missing + missing_B_n_m_s @ asked
        self._wrong = _FADING * self._wrong + float(missing_B_n_m_s @ missing_B_n_m_s)
        with np.errstate(divide='ignore', invalid='ignore'):
            part, explained = self._missing / self._asked, self._missing ** 2 / self._asked
        off = (self._asked >= self._least) & (np.abs(part - 1.0) <= _OWN) & (
            explained >= _EXPLAINED * self._wrong)
        if not off.any():
            return None
        self.forget()
        return int(np.argmax(np.where(off, explained, -1.0)))


class WheelWatch:
    """Finds wheels whose momentum does not follow their motors while that of others does.

    A report that is too old has none of them follow, and tells nothing.

    Arguments
    ---------
    max_torque_n_m, max_momentum_n_m_s
        Limits of the wheels (n,).
    step_s
        Time for which motor torques are held [s].

    """

    def __init__(self, max_torque_n_m: Array, max_momentum_n_m_s: Array, step_s: float) -> None:
        """Have seen nothing."""
        self._top, self._full, self._h = max_torque_n_m, _FULL * max_momentum_n_m_s, step_s
        self._before = np.zeros(len(max_torque_n_m))
        self._lag = np.zeros(len(max_torque_n_m))

    def see(self, motor_n_m: Array, momentum_n_m_s: Array, gained_n_m_s: Array) -> BoolArray:
        """Take motor torques, momenta before them, what was gained (n,); return who lags.

        Of two torques one after the other the smaller counts, of other signs none.
        """
        same = np.where(motor_n_m * self._before > 0.0,
                        np.minimum(np.abs(motor_n_m), np.abs(self._before)), 0.0)
        self._before = motor_n_m
        telling = (same >= _TELLING * self._top) & ~(
            (np.abs(momentum_n_m_s) > self._full) & (motor_n_m * momentum_n_m_s > 0.0))
        gained = np.sign(motor_n_m) * gained_n_m_s
        follows = telling & (gained >= _FOLLOWING * self._h * same)
        lags = telling & (gained < _LAGGING * self._h * same)
        if follows.any():
            self._lag = np.where(lags, self._lag + same / self._top, self._lag * ~follows)
        return np.asarray(self._lag >= _LONGEST_LAG)
