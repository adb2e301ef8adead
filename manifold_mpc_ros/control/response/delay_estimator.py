# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The actuation delay that explains best how the body has answered.

A set of delays, a quarter of a step apart, each with the logarithm of its likelihood. From one
state to the next a delay D predicts the impulse i(D) of the torques sent; what is measured beside
it is taken as normal. Only differences that tell delays apart count, and the old ones fade.
"""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.lie.arrays import Array

#: Distance of two delays, and how far beyond the declared one they go, in control steps.
GRID_STEPS = 0.25
RANGE_STEPS = 3.0
#: Standard deviation of the declared delay before anything is seen, in control steps.
PRIOR_STEPS = 1.0
#: Differences of squared residuals, in variances, below this tell nothing.
INFORMATIVE = 4.0
#: What is left of old differences when new ones come.
MEMORY = 0.9
#: A delay that is off by more than this part of a step, and by so many standard deviations ...
TOLERANCE_STEPS = 0.25
DEVIATIONS = 4.0
#: ... in so many observations in a row is not the declared one.
OBSERVATIONS = 3


class DelayEstimator:
    """Compares delays from 0 to three steps beyond the declared one.

    Arguments
    ---------
    declared_s, step_s
        The delay that is expected, and the control step [s].

    """

    def __init__(self, declared_s: float, step_s: float) -> None:
        """Start with the declared delay."""
        self.declared_s, self._step_s = declared_s, step_s
        self._grid_s = GRID_STEPS * step_s
        self.longest_s = declared_s + RANGE_STEPS * step_s
        self.delays_s: Array = np.arange(0.0, self.longest_s + self._grid_s, self._grid_s)
        self._prior = -0.5 * ((self.delays_s - declared_s) / (PRIOR_STEPS * step_s)) ** 2
        self._seen = np.zeros(len(self.delays_s))
        self._disagreeing = 0
        self.disagrees = False
        self._estimate()

    @property
    def delay_s(self) -> float:
        """The delay to plan with [s]: the declared one, until the response contradicts it."""
        return self.measured_s if self.disagrees else self.declared_s

    def observe(self, residuals: Array, variance: float) -> None:
        """Take what each delay leaves unexplained (n, 3), of this variance a component."""
        squares = np.sum(residuals ** 2, axis=1) / variance
        squares -= squares.min()
        if squares.max() < INFORMATIVE:
            return
        self._seen = MEMORY * self._seen - 0.5 * squares
        self._estimate()
        self._judge()

    def _estimate(self) -> None:
        """Set ``measured_s`` and its standard deviation ``std_s`` [s] from a parabola."""
        likelihood = self._prior + self._seen
        best = int(np.clip(np.argmax(likelihood), 1, len(likelihood) - 2))
        before, at, after = likelihood[best - 1:best + 2]
        curvature = max(2.0 * at - before - after, 1e-9)
        shift = np.clip(0.5 * (after - before) / curvature, -1.0, 1.0)
        self.measured_s = float(self.delays_s[best] + shift * self._grid_s)
        self.std_s = float(min(curvature ** -0.5 * self._grid_s, PRIOR_STEPS * self._step_s))

    def _judge(self) -> None:
        """Say whether the response contradicts the declared delay."""
        off_s, tolerance_s = abs(self.measured_s - self.declared_s), TOLERANCE_STEPS * self._step_s
        wrong = off_s > max(tolerance_s, DEVIATIONS * self.std_s)
        self._disagreeing = self._disagreeing + 1 if wrong else 0
        if self._disagreeing >= OBSERVATIONS:
            self.disagrees = True
        elif off_s < 0.5 * tolerance_s:
            self.disagrees = False
