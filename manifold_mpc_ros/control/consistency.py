# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether attitude and rate of the states tell of one motion, and if not, in which convention.

Between two states k and l, T apart, the attitude turns by F = R_k^T R_l, and the rates say
exp(w T) with w the mean of omega_BN_B, by the trapezoidal rule over the states between. They
disagree by r = |log(exp(-w T) F)| / T [rad/s]. A true state may disagree by

    A dt / 4 + |omega| |delta omega| T / 6 + 0.05 |omega| + 2 (e / T + e / h),

with A the largest angular acceleration (torque limits, gyroscopic torque), dt the longest time
between two states, |delta omega| the largest change of the rate and e the declared error of a
measured attitude; and by noise that nobody declared, seen in changes of the rate that are beyond
A dt, and in what no convention explains. More is a contradiction only where one of
`CONVENTIONS`, a linear map of the rate, explains the motion four times better: noise, gaps, late
messages and a frozen sensor do not find one that fits again and again.
"""

from __future__ import annotations

import itertools
import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateSample
from manifold_mpc_ros.dynamics.inertia import principal_moments
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array, BoolArray

#: So many contradictions by the same convention, less the comparisons between that agree, latch.
MOST_CONTRADICTIONS = 4
#: Comparisons before the first torque by a clock (in lockstep one), unless the body is at rest;
#: and before a contradiction is believed that is no larger than noise of a poor sensor [rad], or
#: that permuted axes explain (which takes two in a row later, too).
FIRST_COMPARISONS, POOR_SENSOR_RAD = 3, 0.1
#: A convention explains a motion if it leaves at most this part of the disagreement.
EXPLAINED = 0.25
#: A disagreement has to be so many times what the best convention leaves, in the median of so
#: many comparisons: noise that nobody declared.
NOISE_FACTOR, NOISE_COMPARISONS = 6.0, 5
#: States are compared over this part of a control step, and over no less than this [s].
COMPARED_STEPS, SHORTEST_COMPARED_S = 0.18, 0.09
#: At rest is what turns slower than this part of what one step of torque may change.
REST_PART = 0.1
#: Part of the rate that may be wrong: scale factors, jitter of stamps.
RATE_PART = 0.05
#: Beyond this nothing is said about a motion [rad/s], [steps].
LARGEST_RATE_RAD_S, LONGEST_COMPARED_STEPS = 1e3, 5.0
_DEGREE = math.pi / 180.0


@dataclass(frozen=True, eq=False)
class Convention:
    """A way to read a state: w = M omega, or w = M R_NB^T omega where ``inertial``."""

    words: str
    matrix: Array
    inertial: bool = False


def _permutations() -> list[Convention]:
    """Return the other 46 ways to name three axes and their signs."""
    found = []
    for order, signs in itertools.product(
            itertools.permutations(range(3)), itertools.product((1.0, -1.0), repeat=3)):
        matrix = np.array(signs)[:, None] * np.eye(3)[list(order)]
        if abs(np.trace(matrix)) < 3.0:
            axes = (f'{"-" * (sign < 0.0)}{"xyz"[axis]}' for sign, axis in zip(signs, order))
            found.append(Convention(
                f'the axes are permuted: the body rate is ({", ".join(axes)}) of the rate',
                matrix))
    return found


#: What a state may mean, the documented meaning first, then the likelier ones first.
_LIKELY = (
    Convention('as documented', np.eye(3)),
    Convention('the rate is in the inertial (parent) frame', np.eye(3), inertial=True),
    Convention('the rate is in deg/s', _DEGREE * np.eye(3)),
    Convention('the rate has the opposite sign, or the quaternion is inverse (inertial to body) '
               'and the rate in the inertial (parent) frame', -np.eye(3)),
    Convention('the quaternion is inverse (inertial to body)', -np.eye(3), inertial=True),
    Convention('the rate is in deg/s and in the inertial (parent) frame', _DEGREE * np.eye(3),
               inertial=True),
)
CONVENTIONS = (*_LIKELY, *_permutations())
_MATRICES = np.array([each.matrix for each in CONVENTIONS])
#: The row of `_Window.turns` that each reads.
_INERTIAL = np.array([int(each.inertial) for each in CONVENTIONS])
#: |w| / |omega| of each.
_SCALES = np.linalg.norm(_MATRICES[:, 0], axis=-1)


@dataclass(frozen=True)
class MotionBounds:
    """How far the states of a body may disagree.

    ``acceleration_rad_s2`` is the largest angular acceleration by the torque limits, infinite
    without; the gyroscopic one is at most ``gyroscopic`` times |omega|^2. ``noise_rad`` is the
    declared error of a measured attitude, and of the rate in one step of ``step_s``. A body that
    is not at rest is not acted on before ``first_comparisons``.
    """

    acceleration_rad_s2: float
    gyroscopic: float
    noise_rad: float
    step_s: float
    first_comparisons: int

    @classmethod
    def from_config(cls, config: ControllerConfig) -> MotionBounds:
        """Return the bounds of a controller's body and sensors."""
        moments = principal_moments(config.mpc.inertia_kg_m2)
        return cls(config.mpc.largest_acceleration_rad_s2,
                   0.5 * float(moments[2] / moments[0] - 1.0),
                   config.attitude_noise_rad, config.mpc.step_s,
                   1 if config.lockstep else FIRST_COMPARISONS)

    def at_rest(self, sample: StateSample) -> bool:
        """Return whether a state is at rest, which it is in every convention."""
        change = np.nan_to_num(self.acceleration_rad_s2 * self.step_s, posinf=0.0)
        return bool(np.linalg.norm(sample.omega_BN_B) <= REST_PART * change)

    @property
    def compared_s(self) -> tuple[float, float]:
        """The shortest and the longest time over which states are compared [s]."""
        shortest_s = max(COMPARED_STEPS * self.step_s, SHORTEST_COMPARED_S)
        return shortest_s, max(LONGEST_COMPARED_STEPS * self.step_s, 2.0 * shortest_s)

    def allowed(self, seen: _Window, elapsed_s: float) -> Array:
        """Return how far a true state may disagree, by convention [rad/s]."""
        fastest, change = _SCALES * seen.fastest, _SCALES * seen.change
        possible = self._possible(seen)
        accelerated = np.where(np.isfinite(possible), 0.25 * possible, 0.5 * change)
        return np.asarray(
            accelerated + fastest * change * elapsed_s / 6.0 + RATE_PART * fastest
            + 2.0 * self.noise_rad * (1.0 / elapsed_s + 1.0 / self.step_s))

    def beyond_torque(self, seen: _Window) -> Array:
        """Return by how much the rate changed more than any torque does, by convention [rad/s]."""
        possible = self._possible(seen)
        return np.maximum(0.0, _SCALES * seen.change - np.where(
            np.isfinite(possible), possible, 0.0))

    def _possible(self, seen: _Window) -> Array:
        """Return the largest change of the rate between two states, by convention [rad/s]."""
        gyroscopic = self.gyroscopic * (_SCALES * seen.fastest) ** 2
        return np.asarray((self.acceleration_rad_s2 + gyroscopic) * seen.longest_s)


class _Window:
    """What the rates say about the motion since a first state.

    ``turns`` (2, 3) are the integrals of omega_BN_B and of R_NB^T omega_BN_B [rad]; ``longest_s``
    is the longest time between two states, ``fastest`` the largest rate and ``change`` its
    largest change from one state to the next [rad/s].
    """

    def __init__(self, first: StateSample) -> None:
        """Begin with a state."""
        self.first = self.last = first
        self.turns = np.zeros((2, 3))
        self.longest_s = self.change = 0.0
        self._rates = _in_both_frames(first)
        self.fastest = float(np.linalg.norm(first.omega_BN_B))

    @property
    def elapsed_s(self) -> float:
        """The time from the first state to the last [s]."""
        return (self.last.stamp_ns - self.first.stamp_ns) / NANOSECONDS

    def add(self, sample: StateSample) -> None:
        """Add the next state, by the trapezoidal rule."""
        dt, rates = (sample.stamp_ns - self.last.stamp_ns) / NANOSECONDS, _in_both_frames(sample)
        self.turns += 0.5 * dt * (rates + self._rates)
        self.longest_s = max(self.longest_s, dt)
        self.change = max(self.change, float(np.linalg.norm(rates[0] - self._rates[0])))
        self.fastest = max(self.fastest, float(np.linalg.norm(rates[0])))
        self.last, self._rates = sample, rates


class ConsistencyCheck:
    """Compares each state with those before it, while ``bounds`` are set.

    ``contradiction`` says what contradicts, '' while nothing does; while that is so the latest
    state waits for `judge`, for when the command of a tick is on its way.
    """

    def __init__(self) -> None:
        """Start without bounds, and no state seen."""
        self.bounds: MotionBounds | None = None
        self.forget()

    def forget(self) -> None:
        """Forget every state, as at the start."""
        self._window: _Window | None = None
        self._to_judge: StateSample | None = None
        self._count = self._compared = self._needed = 0
        self._agreeing = np.zeros(len(CONVENTIONS), dtype=np.bool_)
        self._squares = np.zeros(len(CONVENTIONS))
        self._unexplained_rad: deque[float] = deque(maxlen=NOISE_COMPARISONS)
        self._jumps_rad_s: deque[Array] = deque(maxlen=NOISE_COMPARISONS)
        self._sentence, self._large, self._likely, self._early = '', False, False, True

    @property
    def is_ready(self) -> bool:
        """Whether enough states have been compared to act, or to say that they contradict."""
        return self._compared >= self._needed and (
            not self._count or self._is_sure or not self._early)

    @property
    def _is_sure(self) -> bool:
        """Whether a contradiction is more than noise."""
        if self._likely:
            return self._large or not self._early
        return self._count > 1 and not self._early

    @property
    def contradiction(self) -> str:
        """What contradicts, and what convention would agree; '' while nothing does."""
        return self._sentence if self._count and self._is_sure else ''

    @property
    def is_latched(self) -> bool:
        """Whether the states have contradicted themselves for too long."""
        return self._count >= MOST_CONTRADICTIONS

    def observe(self, sample: StateSample) -> None:
        """Take the next state; one that is earlier than the last begins anew."""
        self.judge()
        self._to_judge = sample
        if self._early or self._count or not self.is_ready:
            self.judge()

    def judge(self) -> None:
        """Compare the state that `observe` has left."""
        sample, self._to_judge = self._to_judge, None
        if sample is None:
            return
        if self.bounds is None or float(np.abs(sample.omega_BN_B).max()) > LARGEST_RATE_RAD_S:
            self._window = None
            return
        window = self._window
        if window is None and not self._compared and not self.bounds.at_rest(sample):
            self._needed = self.bounds.first_comparisons
        if window is not None and sample.stamp_ns > window.last.stamp_ns:
            window.add(sample)
            shortest_s, longest_s = self.bounds.compared_s
            if window.elapsed_s < shortest_s:
                return
            self._compared += 1
            if window.elapsed_s <= longest_s:
                self._compare(window, self.bounds)
        self._window = _Window(sample)

    def _compare(self, window: _Window, bounds: MotionBounds) -> None:
        """Judge the motion in a window by every convention."""
        elapsed_s = window.elapsed_s
        F = window.first.R_NB.T @ window.last.R_NB
        turns = (_MATRICES @ window.turns[_INERTIAL][..., None])[..., 0]
        angles = so3.angle_beyond(turns, F)
        self._unexplained_rad.append(float(angles.min()))
        self._early = len(self._unexplained_rad) < FIRST_COMPARISONS
        self._jumps_rad_s.append(bounds.beyond_torque(window))
        rate_noise = 2.0 * np.median(np.array(self._jumps_rad_s), axis=0)
        least = np.maximum(
            elapsed_s * (bounds.allowed(window, elapsed_s) + rate_noise),
            NOISE_FACTOR * float(np.median(self._unexplained_rad)))
        explaining = (angles[0] > least) & (angles <= EXPLAINED * np.minimum(
            angles[0], np.linalg.norm(turns, axis=-1)))
        if explaining.any():
            self._contradict(explaining, angles, elapsed_s)
        else:
            self._count = max(0, self._count - 1)

    def _contradict(self, explaining: BoolArray, angles: Array, elapsed_s: float) -> None:
        """Count a contradiction, anew where no convention explains all of them."""
        residuals = angles / elapsed_s
        again = self._count > 0 and bool((explaining & self._agreeing).any())
        self._count = self._count + 1 if again else 1
        self._agreeing = explaining & self._agreeing if again else explaining
        self._squares = residuals ** 2 + (self._squares if again else 0.0)
        squares = np.where(self._agreeing, self._squares, np.inf)
        likeliest = int(np.argmax(squares <= 4.0 * squares.min() + 1e-12))
        named = [likeliest]
        if squares[likeliest] > 1.2 * squares.min() + 1e-12:
            named.append(int(np.argmin(squares)))
        self._large, self._likely = angles[0] > POOR_SENSOR_RAD, likeliest < len(_LIKELY)
        words = ', or if '.join(CONVENTIONS[each].words for each in named)
        self._sentence = (f'attitude and rate contradict each other by {residuals[0]:.3g} rad/s; '
                          f'they would agree if {words}')


def _in_both_frames(sample: StateSample) -> Array:
    """Return omega_BN_B and R_NB^T omega_BN_B (2, 3)."""
    return np.stack([sample.omega_BN_B, sample.R_NB.T @ sample.omega_BN_B])
