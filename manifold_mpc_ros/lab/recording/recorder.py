# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One recording from the first process to the last message of the run."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from manifold_mpc_ros.cli import provenance
from manifold_mpc_ros.cli.processes import Interrupts, NodeProcess, NodeProcesses
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, SIMULATOR_NAME
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.recording.bags.contents import RunDescription
from manifold_mpc_ros.lab.recording.bags.writer import BagWriter
from manifold_mpc_ros.lab.recording.record_plan import PREDICTION, RecordPlan

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.recording.nodes.bag_recorder import BagRecorder
    from manifold_mpc_ros.lab.recording.nodes.run_inputs import RunInputs

_NODES = {CONTROLLER_NAME: 'controller', SIMULATOR_NAME: 'simulator'}
#: Time stands still when no new state has come for so long [s of wall clock].
STANDSTILL_S = 60.0
#: The last tick's diagnostics and plan are waited for no longer than this [s].
GRACE_S = 2.0
#: What the other topics say of the last state is on its way for so long [s].
SETTLE_S = 0.05

#: Told the simulated time of the newest state [s] at every look.
Progress = Callable[[float], None]


class Recording:
    """Starts both nodes, lets the scenario run, and has everything recorded."""

    def __init__(
        self, plan: RecordPlan, writer: BagWriter, recorder: BagRecorder, inputs: RunInputs,
        processes: NodeProcesses, interrupts: Interrupts,
    ) -> None:
        """Keep the parts."""
        self._interrupts = interrupts
        self._plan, self._scenario = plan, plan.scenario
        self._writer, self._recorder, self._inputs = writer, recorder, inputs
        self._processes = processes
        self._deadline_s = 0.0
        self._stops = list(plan.scenario.faults.controller_stops)
        self._stopped = False

    def start(self, environment: dict[str, str], folder: Path, limit_s: float) -> None:
        """Bring both nodes to where the next state begins the run.

        Raises ManifoldMpcError when a node ends, refuses its configuration, or the limit is
        reached.
        """
        self._deadline_s = time.monotonic() + limit_s
        for node, module in _NODES.items():
            self._processes.start(
                module, self._plan.arguments(node, folder), environment, folder / f'{module}.log')
        for node in _NODES:
            self._recorder.meet(node, self._watch_start)
        for node in _NODES:
            self._require(node, self._recorder.configure(node, self._watch_start))
        parameters = {node: self._recorder.parameters(node, self._watch_start)
                      for node in _NODES}
        self._activate(CONTROLLER_NAME)
        self._recorder.until(lambda: 'backend' in self._recorder.controller, self._watch_start)
        self._describe(parameters)
        self._recorder.begin()
        self._inputs.command_first(self._watch_start)
        for node, topics in self._plan.published.items():
            self._recorder.meet(node, self._watch_start, topics)
        self._activate(SIMULATOR_NAME)
        self._recorder.until(lambda: self._state_ns > 0, self._watch_start)

    def run(self, progress: Progress) -> None:
        """Let simulated time go on to the scenario's end."""
        # A reader may be found later on one topic than on the other: from where there are both.
        first_ns = max(self._recorder.count(topic).first_stamp_ns
                       for topic in self._plan.state_topics)
        end_ns = first_ns + round(self._plan.duration_s * NANOSECONDS)
        self._recorder.end_stamp_ns = end_ns
        self._inputs.begin(first_ns)
        latest_ns, latest_s = 0, time.monotonic()
        while not self._over(end_ns):
            self._watch_processes()
            self._recorder.tend()
            elapsed_s = (self._state_ns - first_ns) / NANOSECONDS
            self._inputs.tend(elapsed_s)
            self._stop_and_go(elapsed_s)
            progress(elapsed_s)
            if self._state_ns != latest_ns:
                latest_ns, latest_s = self._state_ns, time.monotonic()
            elif time.monotonic() - latest_s > STANDSTILL_S:
                raise ManifoldMpcError(
                    f'no new state came within {STANDSTILL_S:g} s, at {elapsed_s:g} s of '
                    f'simulated time; the nodes said: {self._last_words()}')
            self._inputs.wait(self._recorder)
        self._finish_tick(end_ns)
        progress((end_ns - first_ns) / NANOSECONDS)

    @property
    def _state_ns(self) -> int:
        """Stamp of the newest state, 0 before the first."""
        return min(self._recorder.count(topic).latest_stamp_ns
                   for topic in self._plan.state_topics)

    def _over(self, end_ns: int) -> bool:
        """Say whether the last state has come, and in lockstep its answer."""
        answered = self._recorder.count(self._plan.command_topic).latest_stamp_ns >= end_ns
        return self._state_ns >= end_ns and (answered or not self._scenario.lockstep)

    def _finish_tick(self, end_ns: int) -> None:
        """Take in what the controller says about the last tick."""
        step_s = self._scenario.controller_config.mpc.step_s
        ticks = round(self._scenario.duration_s / step_s) + 1
        latest_s, missing_before = time.monotonic() + GRACE_S, 0

        def said() -> bool:
            nonlocal latest_s, missing_before
            known = int(self._recorder.controller.get('ticks', 0)) >= ticks
            planned = self._recorder.count(PREDICTION).latest_stamp_ns >= end_ns
            missing = self._missing_of_devices()
            if missing != missing_before:
                latest_s, missing_before = time.monotonic() + GRACE_S, missing
            return time.monotonic() > latest_s or not self._scenario.lockstep or (
                known and planned and not missing)

        self._recorder.until(said, self._recorder.tend)
        self._recorder.spin(SETTLE_S)

    def _missing_of_devices(self) -> int:
        """Return how many messages of devices are to come: one for each torque or state."""
        plan, count = self._plan, self._recorder.count
        return sum(max(0, count(first).received - count(topic).received)
                   for first, topics in ((plan.command_topic, plan.device_commands),
                                         (plan.state_topic, plan.device_reports))
                   for topic in topics)

    def _activate(self, node: str) -> None:
        """Let a node act."""
        self._require(node, self._recorder.activate(node, self._watch_start))

    def _require(self, node: str, succeeded: bool) -> None:
        """Say why a node refused, where it did."""
        if not succeeded:
            process = next(each for each in self._processes.nodes if each.name == _NODES[node])
            raise ManifoldMpcError(f'the {process.name} refused: {process.last_words()}')

    def _describe(self, parameters: dict[str, dict[str, object]]) -> None:
        """Write where the bag comes from, as its first message and into its metadata."""
        description = RunDescription(
            scenario_name=self._scenario.name, scenario_text=self._scenario.text,
            versions=provenance.versions(self._recorder.middleware),
            backend=self._recorder.controller['backend'],
            controller_parameters=parameters[CONTROLLER_NAME],
            simulator_parameters=parameters[SIMULATOR_NAME], topics=self._plan.roles)
        self._writer.add_description(description, self._recorder.first_receipt_ns)

    def _stop_and_go(self, elapsed_s: float) -> None:
        """Take the processor from the controller, or give it back."""
        if not self._stops or elapsed_s < self._stops[0].at_s:
            return
        over = elapsed_s >= self._stops[0].at_s + self._stops[0].for_s
        if over == self._stopped:
            controller = next(each for each in self._processes.nodes
                              if each.name == 'controller')
            controller.send(signal.SIGCONT if over else signal.SIGSTOP)
            self._stopped = not over
        if over:
            self._stops.pop(0)

    def _watch_start(self) -> None:
        """Give up when a node has ended, the bag cannot be written, or the start takes long."""
        self._watch_processes()
        self._recorder.tend()
        if time.monotonic() > self._deadline_s:
            raise ManifoldMpcError(
                f'the nodes did not get ready in time; they said: {self._last_words()}')

    def _watch_processes(self) -> None:
        """Raise when an end is wished, or a node has ended by itself."""
        self._interrupts.look()
        node = self._processes.ended()
        if node is not None:
            raise ManifoldMpcError(_ended(node))

    def _last_words(self) -> str:
        """Return what each node said last."""
        return '; '.join(f'{node.name}: {node.last_words()}' for node in self._processes.nodes)


def _ended(node: NodeProcess) -> str:
    """Say that a node has ended."""
    status = node.exit_status or 0
    how = f'with exit status {status}' if status >= 0 else \
        f'by signal {signal.Signals(-status).name}'
    return f'the {node.name} ended by itself {how}: {node.last_words()}'
