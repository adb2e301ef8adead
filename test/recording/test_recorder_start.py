# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recording begins when nothing can be missed, however late discovery is."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from manifold_mpc_ros.lab.recording.record_plan import RecordPlan
from manifold_mpc_ros.lab.recording.recorder import Recording
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario
from manifold_mpc_ros.lab.recording.verb_record import shipped_scenarios

CONTROLLER, SIMULATOR = 'attitude_controller', 'lgvi_simulator'


class Recorder(SimpleNamespace):
    """Keeps whom it has met, and what was known when a node was activated."""

    middleware, first_receipt_ns = 'none', 0

    def __init__(self) -> None:
        self.controller = {'backend': 'c'}
        self.met: dict[str, set[str]] = {}
        self.met_at: dict[str, dict[str, set[str]]] = {}

    def meet(self, node: str, _watch: object, topics: Iterable[str] = ()) -> None:
        self.met.setdefault(node, set()).update(topics)

    def activate(self, node: str, _watch: object) -> bool:
        self.met_at[node] = {name: set(topics) for name, topics in self.met.items()}
        return True

    def configure(self, *_: object) -> bool:
        return True

    def parameters(self, *_: object) -> dict[str, Any]:
        return {}

    def until(self, *_: object) -> None:
        pass

    def begin(self) -> None:
        pass


@pytest.mark.parametrize('path', shipped_scenarios(), ids=lambda path: path.stem)
def test_states_begin_when_both_nodes_and_the_recorder_know_each_other(
    path: Path, tmp_path: Path,
) -> None:
    plan, recorder = RecordPlan(Scenario.from_yaml(path)), Recorder()
    others: Any = SimpleNamespace(
        add_description=lambda *_: None, command_first=lambda *_: None, start=lambda *_: None)
    Recording(plan, others, recorder, others, others, others).start({}, tmp_path, 1e9)
    known = recorder.met_at[SIMULATOR]
    assert known[SIMULATOR] == {*plan.state_topics, *plan.device_reports}
    assert known[CONTROLLER] >= {plan.command_topic, *plan.device_commands}
    assert {topic for topics in known.values() for topic in topics} <= {
        *plan.stamped, *plan.others}
