# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The theorem watched at run time: whether the plant keeps what the last plan promised.

Inside D_N a plan of value V(x) whose first torque u is applied for one step promises

    V(f(x, u)) <= V(x) - L(x, u),    and that a plan from f(x, u) exists,

for the model f; about a target that moves, V - L and what `MovingPromise` allows for. A plant
that breaks it is not the model: a disturbance, another inertia, a torque
that did not arrive. Pure logic: solutions and times in, records out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.decrease_record import (
    Allowance,
    Decrease,
    DecreaseCounters,
    DecreaseRecord,
    Tolerance,
    ValuedPlan,
)
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.program.options import SMALLEST_BARRIER
from manifold_mpc_ros.mpc.scaling import scaling_of
from manifold_mpc_ros.mpc.solution import SolveStatus

#: A broken promise is warned of for so many ticks after it.
HOLD_TICKS = 5
#: Two ticks whose distance is off one step by more than this part of it do not follow each other.
LARGEST_JITTER = 0.5

#: A target that is fixed allows for nothing.
FIXED = Allowance()

_CAUSE = 'a disturbance, a torque that came late, or a plant that differs from the model'


@dataclass(frozen=True)
class _Promise:
    """A promise in force: V - L, the L in it, when it was made and how late its torque was.

    ``error`` is the value of the model's own error in the step.
    """

    value: float
    decrease: float
    time_s: float
    delay_s: float
    error: float


class DecreaseMonitor:
    """Compares each tick's value with what the tick before promised.

    Arguments
    ---------
    tolerance
        What may be missing from the decrease.
    step_s
        Time from one tick to the next [s].
    certified
        Whether plans have to end in the terminal set: without it nothing is promised, and
        membership in D_N is not known.

    """

    def __init__(self, tolerance: Tolerance, *, step_s: float, certified: bool = True) -> None:
        """Start with no promise and all counters at zero."""
        self._tolerance = tolerance
        self._step_s = step_s
        self._certified = certified
        self.clear()

    def clear(self) -> None:
        """Forget everything, counters too."""
        self.counters = DecreaseCounters()
        self._promise: _Promise | None = None
        self._why_none = 'first tick' if self._certified else 'terminal_constraint is false'
        self._ago = HOLD_TICKS + 1
        self._latest = ''

    def suspend(self, why: str) -> None:
        """End the promise in force: what follows is not what it was about."""
        if self._certified:
            self._promise, self._why_none = None, why

    def observe(
        self, plan: ValuedPlan | None, *, time_s: float, delay_s: float = 0.0,
        applied: bool = True, why_none: str = '', allowance: Allowance = FIXED,
    ) -> DecreaseRecord:
        """Return the record of one tick.

        Arguments
        ---------
        plan
            The answer to this tick's state; None when the solver was not asked or did not answer.
        time_s
            When [s], on any clock.
        delay_s
            How long after that the torque is in force [s].
        applied
            Whether the plan's first torque is what is commanded, unchanged, until the next tick.
        why_none
            Why there is no plan, or why its torque is not commanded.
        allowance
            What the promise of this plan allows for, where its target moves.

        """
        inside = self._is_inside(plan)
        record = DecreaseRecord(
            Decrease.NONE, self._why_none, math.nan if plan is None else float(plan.cost),
            math.nan, math.nan, math.nan, inside if self._certified else None,
            plan is not None and plan.terminal_ratio <= 1.0, self.counters)
        if plan is None:
            record = replace(record, reason=why_none)
        elif self._is_due(time_s):
            record = self._judge(record, plan, inside, time_s)
        elif self._promise is not None:
            record = replace(record, reason='a tick is missing or out of time')
        if plan is None or not inside:
            self.suspend(why_none or 'the last state was outside the domain of attraction')
        elif not applied:
            self.suspend(why_none or 'not the torque of the plan was commanded')
        elif allowance.why_none:
            self.suspend(allowance.why_none)
        else:
            self._promise_from(plan, time_s, delay_s, allowance)
        outside = plan is not None and self._certified and not inside
        self.counters = replace(
            record.counters, made=record.counters.made + (self._promise is not None),
            outside_domain=record.counters.outside_domain + outside)
        return self._warned(replace(record, counters=self.counters))

    def _is_inside(self, plan: ValuedPlan | None) -> bool:
        """Return whether a plan shows that the state is in D_N."""
        return (plan is not None and self._certified and math.isfinite(plan.cost)
                and plan.status in (SolveStatus.CONVERGED, SolveStatus.FEASIBLE))

    def _is_due(self, time_s: float) -> bool:
        """Return whether a promise is in force and was made one step ago."""
        return self._promise is not None and abs(
            (time_s - self._promise.time_s) / self._step_s - 1.0) <= LARGEST_JITTER

    def _judge(
        self, record: DecreaseRecord, plan: ValuedPlan, inside: bool, time_s: float,
    ) -> DecreaseRecord:
        """Return the record with the verdict on the promise in force."""
        assert self._promise is not None
        promise, tolerance = self._promise, self._tolerance
        counters = replace(record.counters, checked=record.counters.checked + 1)
        record = replace(record, promised=promise.value, reason='', counters=counters)
        if not inside:
            return self._broken(record, 'no plan that meets every limit and ends in the terminal '
                                f'set was found, against the promise: {_CAUSE}')
        excess = record.value - promise.value
        relative = excess / max(promise.decrease, tolerance.floor)
        record = replace(record, excess=excess, relative_excess=relative)
        off_s = abs(time_s - promise.time_s - self._step_s) + 2.0 * promise.delay_s
        if excess <= tolerance.slack(promise.value, promise.decrease, off_s / self._step_s,
                                     promise.error):
            return replace(record, verdict=Decrease.KEPT)
        early = '' if plan.status == SolveStatus.CONVERGED else 'a plan that has not converged, '
        return self._broken(record, f'{_fall(excess, promise.decrease)}: {early}{_CAUSE}')

    def _broken(self, record: DecreaseRecord, reason: str) -> DecreaseRecord:
        """Return the record of a broken promise."""
        counters = record.counters
        largest = counters.largest_excess
        if math.isfinite(record.relative_excess):
            largest = max(largest, record.relative_excess)
        return replace(record, verdict=Decrease.BROKEN, reason=reason, counters=replace(
            counters, broken=counters.broken + 1, largest_excess=largest))

    def _promise_from(
        self, plan: ValuedPlan, time_s: float, delay_s: float, allowance: Allowance,
    ) -> None:
        """Put the promise of a plan in force, if its torque is."""
        promised = float(plan.promised_cost)
        if not math.isfinite(promised):
            self.suspend('the last plan promised nothing')
        elif delay_s > LARGEST_JITTER * self._step_s:
            self.suspend('the last torque came late')
        else:
            self._promise = _Promise(
                promised + allowance.excess, float(plan.cost) - promised, time_s, delay_s,
                allowance.model_error)

    def _warned(self, record: DecreaseRecord) -> DecreaseRecord:
        """Return the record with the warning that is due."""
        if record.verdict is Decrease.BROKEN:
            burst, self._ago, self._latest = self._ago > HOLD_TICKS, 0, record.reason
            return replace(record, warning=record.reason, burst=burst)
        self._ago += 1
        if self._ago > HOLD_TICKS:
            return record
        ticks = 'tick' if self._ago == 1 else 'ticks'
        return replace(record, warning=f'{self._ago} {ticks} ago: {self._latest}')


def _fall(excess: float, decrease: float) -> str:
    """Say by how much a value fell, and should have."""
    fall = decrease - excess
    if fall > 0.01 * decrease:
        return (f'the value function fell {100.0 * excess / decrease:.3g} % less than promised '
                f'(by {fall:.3g}, not {decrease:.3g})')
    did = f'rose by {-fall:.3g}' if fall < -0.01 * decrease else 'did not fall'
    return f'the value function {did} (promised: a fall by {decrease:.3g})'


def value_of_noise(P: Array, step_s: float, attitude_rad: float) -> float:
    """Return the largest ``F = xi^T P xi / 2`` of the error of a measurement.

    ``|xi_attitude| <= e`` and ``|xi_rate| <= e / h``: an error e [rad] of the attitude, and of the
    rate what turns the body by e in a step. P is (n, n), its last three coordinates the rate.
    """
    scale = np.full(len(P), attitude_rad)
    scale[-3:] /= step_s
    return float(np.linalg.eigvalsh(P * np.outer(scale, scale))[-1])


def monitor_for(
    config: AttitudeMpcConfig, P: Array, *, decrease_tolerance: float, attitude_noise_rad: float,
) -> DecreaseMonitor:
    """Return the monitor of a controller whose terminal cost is ``xi^T P xi / 2``.

    Its floor adds to `value_of_noise` how far the value of a converged plan may be above the
    optimum: the barrier ends at mu, with up to 12 inequalities of two terms a stage, so 24 N mu.
    """
    rounding = 24.0 * config.horizon * SMALLEST_BARRIER * scaling_of(config).cost
    floor = value_of_noise(P, config.step_s, attitude_noise_rad) + rounding
    return DecreaseMonitor(Tolerance(decrease_tolerance, floor), step_s=config.step_s,
                          certified=config.terminal_constraint)
