# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verdict on a run: each acceptance limit of its scenario against what the bag shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.recording.bags import measures
from manifold_mpc_ros.lab.recording.bags.cones import violated_s
from manifold_mpc_ros.lab.recording.bags.run import COMPLETE, BagRun
from manifold_mpc_ros.lab.recording.scenarios.parts import AcceptanceLimits
from manifold_mpc_ros.lie.arrays import Array

#: The judgement that every run gets, beside those that its scenario asks for.
RECORDING = 'recording'
#: Counted tick by tick: the limit's name, and what is counted.
_TICKS = {'infeasible_ticks': measures.infeasible} | {
    f'{mode.lower()}_ticks': partial(measures.in_mode, mode)
    for mode in ('HOLD', 'FALLBACK', 'COAST')}
#: Totals that the controller gives itself.
_TOTALS = ('promises_broken',)
#: Simulated time that the last state may be short of the end [s].
_END_TOLERANCE_S = 1e-6


@dataclass(frozen=True)
class Judgement:
    """One limit: its name, the limit and the measured value as text, and whether it was kept."""

    name: str
    limit: str
    measured: str
    passed: bool


@dataclass(frozen=True)
class Verdict:
    """Every judgement on one run; the run passed when all of them did."""

    judgements: tuple[Judgement, ...]

    @property
    def passed(self) -> bool:
        """Whether every limit was kept."""
        return all(each.passed for each in self.judgements)

    @property
    def failed(self) -> tuple[str, ...]:
        """The names of the limits that were not kept."""
        return tuple(each.name for each in self.judgements if not each.passed)


def judge(run: BagRun, *, own: bool = True) -> Verdict:
    """Judge a run by the acceptance limits of its scenario.

    The recording itself is judged too: a run that did not come to its end, or a bag that is
    damaged, has not passed. Where the bag does not hold what a limit needs, the limit is not
    kept. A recording that is not ``own`` need not say that it came to its end.

    Raises BagError when the bag has no scenario, or its scenario no limit.
    """
    if run.scenario is None:
        raise BagError(f'{run.path}: no scenario that can be used is inside this bag, so there '
                       'is nothing to judge it by (--scenario names one)')
    judgements = tuple(_judged(run, run.scenario.acceptance))
    if not judgements:
        raise BagError(f'{run.path}: the scenario of this bag has no acceptance limits')
    return Verdict((_recording(run, run.scenario.duration_s, own=own), *judgements))


def _recording(run: BagRun, duration_s: float, *, own: bool) -> Judgement:
    """Judge whether the bag holds the whole run."""
    reached_s = float(run.states.time_s[-1])
    ended = run.outcome == COMPLETE or not (own or run.outcome)
    problems = [] if ended else [run.outcome or 'end unknown']
    if reached_s < duration_s - _END_TOLERANCE_S:
        problems.append(f'ends at {reached_s:g} s')
    problems += run.warnings
    said = f'complete, {reached_s:g} s' if not problems else '; '.join(problems)
    return Judgement(RECORDING, f'complete, {duration_s:g} s', said, not problems)


def _judged(run: BagRun, limits: AcceptanceLimits) -> Iterator[Judgement]:
    """Yield a judgement for each limit that is given, in the order of the table in the docs."""
    if limits.settle_time_s is not None:
        yield _settled(run, limits, limits.settle_time_s)
    yield from _at_most('final_error_deg', limits.final_error_deg,
                        float(np.degrees(run.error_rad[-1])), 'deg')
    yield from _at_most('final_rate_rad_s', limits.final_rate_rad_s,
                        float(run.rate_error_rad_s[-1]), 'rad/s')
    yield from _box('peak_torque_n_m', limits.peak_torque_n_m, run.commands.torque_B_n_m, 'N m')
    yield from _box('peak_rate_rad_s', limits.peak_rate_rad_s, run.states.omega_BN_B, 'rad/s')
    yield from _at_most('violations', limits.violations, measures.violations(run), '')
    if limits.cone_violation_s is not None:
        yield _cones_kept(run, limits.cone_violation_s)
    if limits.solver_time_p99_ms is not None:
        p99_s = measures.solve_time_p99_s(run)
        yield from _at_most('solver_time_p99_ms', limits.solver_time_p99_ms,
                            None if p99_s is None else 1e3 * p99_s, 'ms')
    for name in _TOTALS:
        yield from _at_most(name, getattr(limits, name), run.ticks.total(name), '')
    for name, count in _TICKS.items():
        yield from _counted(run, name, getattr(limits, name), count(run))
    yield from _at_most('refused_messages', limits.refused_messages,
                        measures.refused(run), '')


def _settled(run: BagRun, limits: AcceptanceLimits, limit_s: float) -> Judgement:
    """Judge the settling time after the start and after each setpoint.

    One that the next setpoint superseded sooner than the limit had no time to break it.
    """
    times = measures.settling_times(
        run, limits.attitude_tolerance_deg, limits.rate_tolerance_rad_s)
    said, kept = [], []
    for time_s, lasted_s in zip(times, measures.lasted_s(run), strict=True):
        superseded = time_s is None and lasted_s < limit_s
        said.append(f'superseded after {lasted_s:.4g} s' if superseded
                    else 'not settled' if time_s is None else f'{time_s:.4g} s')
        kept.append(superseded or (time_s is not None and time_s <= limit_s))
    return Judgement('settle_time_s', f'{limit_s:g} s', ', '.join(said), all(kept))


def _cones_kept(run: BagRun, limit_s: float) -> Judgement:
    """Judge for how long a cone is not kept for sure, at any time between states."""
    found = violated_s(run)
    if found is None:
        return Judgement('cone_violation_s', f'{limit_s:g} s', 'no cones', False)
    time_s, worst, margin_rad = found
    said = f'{time_s:.4g} s (least margin {np.degrees(margin_rad):.3g} deg, {worst})'
    return Judgement('cone_violation_s', f'{limit_s:g} s', said, time_s <= limit_s)


def _at_most(
    name: str, limit: float | None, measured: float | None, unit: str,
) -> Iterator[Judgement]:
    """Judge one number by its upper limit; what is unknown or not finite is not below it."""
    if limit is not None:
        said = 'not in the bag' if measured is None else _with_unit(f'{measured:.4g}', unit)
        yield Judgement(name, _with_unit(f'{limit:g}', unit), said,
                        measured is not None and measured <= limit)


def _box(name: str, limit: Array | None, values: Array, unit: str) -> \
        Iterator[Judgement]:
    """Judge the largest value about each axis."""
    if limit is None:
        return
    if not len(values):
        yield Judgement(name, _vector(limit, unit), 'not in the bag', False)
        return
    peak = np.abs(values).max(axis=0)
    # A limit that is reached is kept; a bag has doubles, so one ulp is all that rounding needs.
    yield Judgement(name, _vector(limit, unit), _vector(peak, unit),
                    bool((peak <= limit * (1.0 + np.finfo(float).eps)).all()))


def _counted(run: BagRun, name: str, limit: int | None, count: int) -> Iterator[Judgement]:
    """Judge a number of ticks: the controller's own count where a recording of ours has it.

    Else what is in the bag is counted; ticks that it says nothing of count as well.
    """
    if limit is None:
        return
    total = run.ticks.total(name)
    if total is not None and run.outcome:
        said = f'{total} of {int(run.ticks.tick[-1])} ticks'
        yield Judgement(name, str(limit), said, total <= limit)
        return
    unknown = measures.unknown_ticks(run)
    said = f'{count} of {len(run.ticks)} ticks'
    if unknown:
        said += f', {unknown} more are not in the bag'
    yield Judgement(name, str(limit), said, count + unknown <= limit and len(run.ticks) > 0)


def _vector(values: Array, unit: str) -> str:
    """Return three numbers as text, one where they are equal."""
    distinct = values[:1] if (values == values[0]).all() else values
    return _with_unit(', '.join(f'{value:.4g}' for value in distinct), unit)


def _with_unit(text: str, unit: str) -> str:
    """Return a number with its unit."""
    return f'{text} {unit}'.rstrip()
