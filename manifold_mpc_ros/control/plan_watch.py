# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether horizon, period and stored momentum fit: what happens, and what to change."""

from __future__ import annotations

from collections import deque

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.mpc.solution import SolveStatus

# Solves that are looked back on, and how many of them may take longer than the period.
RECENT, LATE = 100, 10


class PlanWatch:
    """Sees every solve of one configuration.

    Warns when no plan has reached the terminal set for as many ticks in a row as the horizon has
    steps, when ten of the last hundred solves took longer than the step, and when wheels cannot
    store the momentum that is left at rest at the target.

    ``warnings``: what is wrong now and what would mend it, by kind; the same words while it lasts.
    """

    def __init__(self, config: AttitudeMpcConfig) -> None:
        """Start without a solve."""
        self._config, self._outside = config, 0
        self._momentum = 0.0
        self._late: deque[bool] = deque(maxlen=RECENT)
        self.warnings: dict[str, str] = {}

    def see(self, status: SolveStatus | str, solve_time_s: float, target_momentum: float = 0.0
            ) -> None:
        """Take one solve."""
        self._momentum = target_momentum
        self._outside = self._outside + 1 if status == SolveStatus.INFEASIBLE else 0
        self._late.append(solve_time_s > self._config.step_s)
        self.warnings = self._judged()

    def _judged(self) -> dict[str, str]:
        """Return the warnings after a solve."""
        config, found = self._config, {}
        if self._momentum > 1.0:
            found['momentum'] = (
                f'at rest at the target the wheels would have to store {self._momentum:.3g} of '
                'what they can: it cannot be held before momentum is dumped')
        elif self._outside >= config.horizon:
            view_s = config.steps.in_periods * config.step_s
            found['horizon'] = (
                f'no plan has reached the terminal set for {config.horizon} ticks: {view_s:g} s '
                'ahead are too short for this slew; raise mpc.horizon or mpc.torque_weight '
                '(manifold-mpc design says by how much)')
        if sum(self._late) >= LATE:
            found['period'] = (
                f'{LATE} of {RECENT} solves take longer than the period of {config.step_s:g} s; '
                'lower mpc.horizon (with mpc.horizon_s it sees as far in fewer steps) or raise '
                'mpc.step_s')
        return found
