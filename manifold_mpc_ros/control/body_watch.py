# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the body that answers is the one of the model: named when it is another's.

From one measured state to the next, with f the measured turn, the momentum balance says that

    o = J omega+ - f^T J omega    and    e = (I + f^T)/2 (impulse of the torques that acted)

are equal. ``k = sum o . e / sum e . e``, over the pairs in which the torque was large, is how
strongly the body answers; 1/k about its inertia beside the model's. Where one factor an axis
explains o, ``sum_i (sum o_i e_i)^2 / sum e_i^2`` is nearly ``sum o . o``: that tells an answer
from noise and from torque that acts unasked.
"""

from __future__ import annotations

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateSample
from manifold_mpc_ros.control.torque_history import TorqueHistory
from manifold_mpc_ros.lie.arrays import Array

#: A pair counts where a torque of at least this part of its limit acted, on the mean.
LARGE = 0.4
#: A pair that is so many pairs old counts 1/e; judged are no fewer than these.
MEMORY, FEWEST = 20.0, 3
#: Answers weaker or stronger than by this factor are another body's; so much of them is explained.
FACTOR, EXPLAINED = 2.0, 0.9
#: States farther apart than this many steps are not compared.
LONGEST_GAP_STEPS = 3.0


class BodyWatch:
    """Compares how measured rates change with the torques sent; only with torque limits.

    ``ratio`` is k, NaN before it can be told; ``warning`` names a body that is not the model's,
    with the same words while it lasts ('' else).
    """

    def __init__(self, config: AttitudeMpcConfig, delay_ns: int) -> None:
        """Start without a state; torques act so long after they were sent [ns]."""
        limit = config.max_torque_n_m
        self._limit = np.full(3, np.inf) if limit is None else limit
        self._J, self._delay_ns = config.inertia_kg_m2, delay_ns
        self._longest_s = LONGEST_GAP_STEPS * config.step_s
        self._before: StateSample | None = None
        self._sums, self._pairs = np.zeros((3, 3)), 0
        self.ratio, self.warning = float('nan'), ''

    def restart(self) -> None:
        """Compare no state with the latest."""
        self._before = None

    def observe(self, sample: StateSample, sent: TorqueHistory, acting_since_ns: int) -> None:
        """Take a state, and what was sent; nothing sent before ``acting_since_ns`` is trusted."""
        before, self._before = self._before, sample
        if before is None or before.stamp_ns - self._delay_ns < acting_since_ns:
            return
        gap_s = (sample.stamp_ns - before.stamp_ns) / NANOSECONDS
        if not 0.0 < gap_s <= self._longest_s:
            return
        impulse = sent.impulses(
            np.array([-self._delay_ns / NANOSECONDS]), gap_s, before.stamp_ns)[0]
        if (np.abs(impulse) < LARGE * gap_s * self._limit).all():
            return
        back = sample.R_NB.T @ before.R_NB
        expected = 0.5 * (impulse + back @ impulse)
        observed = self._J @ sample.omega_BN_B - back @ (self._J @ before.omega_BN_B)
        self._pairs += 1
        self._sums = np.exp(-1.0 / MEMORY) * self._sums + (
            observed * expected, expected ** 2, observed ** 2)
        if self._pairs >= FEWEST:
            self._judge(*self._sums)

    def _judge(self, both: Array, expected: Array, observed: Array) -> None:
        """Say how strongly the body answers, and whether that is another body's answer."""
        self.ratio = float(both.sum() / expected.sum())
        explained = np.sum(both ** 2 / np.maximum(expected, np.finfo(float).tiny))
        told = self.ratio > 0.0 and explained >= EXPLAINED * observed.sum()
        if told and not 1.0 / FACTOR <= self.ratio <= FACTOR:
            if not self.warning:
                self.warning = (
                    f'the body answers torque {self.ratio:.2g} times as strongly as the model: '
                    'spacecraft.inertia_kg_m2, or what the actuators give, is of another '
                    'spacecraft')
        else:
            self.warning = ''
