# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Nodes that the machine has no time for are slowed down; a broken controller is not excused."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.fault_injection import trial
from manifold_mpc_ros.lab.fault_injection.evidence import Report
from manifold_mpc_ros.lab.fault_injection.fault import CONTROLLER, SIMULATOR
from manifold_mpc_ros.lab.fault_injection.rig import BenchPlan

CONFIG = Path(__file__).parents[2] / 'config' / 'chaos'


class Bench:
    """Nodes that are at work from some step on; every look takes 0.1 s of the clock here."""

    simulated_time = False

    def __init__(self, *, works_from_s: float, starved_part: float, step_s: float | None) -> None:
        self.plan = BenchPlan(CONFIG / 'controller.yaml', CONFIG / 'simulator.yaml', step_s)
        self.steps_s = [step_s or 0.02]
        self.now_s = self._accounted_s = 0.0
        self._works_from_s, self._starved_part = works_from_s, starved_part
        self.deaths: list[str] = []
        self.tracebacks = lambda: 0
        self.cleared_s: list[float] = []
        self.observer: Any = SimpleNamespace(reports=[], latest={}, state_s=0.0, command_s=0.0,
                                             clear=self.cleared_s.append)
        self._begun_s = 0.0

    def look(self) -> None:
        self.now_s += 0.1
        works = self.steps_s[-1] >= self._works_from_s
        seen = self.observer
        for node, mode in ((CONTROLLER, 'NOMINAL' if works else 'WAIT'), (SIMULATOR, 'RUN')):
            seen.latest[node] = Report(self.now_s, node, {'mode': mode})
            seen.reports.append(seen.latest[node])
        seen.state_s = seen.command_s = self.now_s

    def begin_account(self) -> None:
        self._accounted_s = self.now_s

    @property
    def starved_s(self) -> float:
        return self._starved_part * (self.now_s - self._accounted_s)

    def slow_down(self, times: int) -> None:
        self.steps_s.append(times * self.steps_s[-1])
        self._begun_s = self.now_s

    def life(self, _node: str) -> Any:
        return SimpleNamespace(
            begun_s=self._begun_s, process=SimpleNamespace(last_words=lambda: 'too old'))


def settle(monkeypatch: pytest.MonkeyPatch, **of: Any) -> list[float]:
    """Return the steps that were tried."""
    bench: Any = Bench(**{'works_from_s': 0.1, 'starved_part': 0.9, 'step_s': None, **of})
    monkeypatch.setattr(trial.time, 'monotonic', lambda: bench.now_s)
    trials = trial.Trials(bench, bench.plan.check(), 0)
    trials.settle_in()
    assert trials.limits.step_s == bench.steps_s[-1]
    # What came at another rate is forgotten.
    assert bench.cleared_s == [bench.life(CONTROLLER).begun_s]
    assert (bench.cleared_s[0] > 0.0) == (len(bench.steps_s) > 1)
    return list(bench.steps_s)


def test_where_the_machine_has_no_time_the_pace_is_lower(monkeypatch: pytest.MonkeyPatch) -> None:
    assert settle(monkeypatch) == pytest.approx([0.02, 0.1])


def test_else_the_pace_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    assert settle(monkeypatch, works_from_s=0.0) == [0.02]


@pytest.mark.parametrize(('of', 'words'), [
    ({'starved_part': 0.1}, 'too old$'),
    ({'step_s': 0.02}, 'a lower --rate-hz needs less$'),
    ({'works_from_s': 1.0}, 'a lower --rate-hz needs less$'),
])
def test_what_the_machine_does_not_explain_or_was_asked_for_fails(
    monkeypatch: pytest.MonkeyPatch, of: dict[str, float], words: str,
) -> None:
    with pytest.raises(ManifoldMpcError, match=words):
        settle(monkeypatch, **of)


def test_slower_nodes_have_valid_parameters() -> None:
    """A whole factor keeps periods multiples of each other."""
    plan = BenchPlan(CONFIG / 'controller.yaml', CONFIG / 'simulator.yaml', trial.SLOWER * 0.02)
    values = plan.parameters(SIMULATOR, simulated_time=False)
    state_steps = values['timing.state_period_s'] / values['plant.step_s']
    assert state_steps == pytest.approx(round(state_steps))
