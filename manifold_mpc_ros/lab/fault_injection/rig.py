# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Both nodes as supervised processes on a domain of their own, and everything that looks on."""

from __future__ import annotations

import signal
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import Any

from manifold_mpc_ros.cli.processes import (
    STOP_TIMEOUT_S,
    NodeProcess,
    loopback_only,
    node_environment,
    reserved_domain,
)
from manifold_mpc_ros.config.control_law import SimulatorConfig
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, SIMULATOR_NAME
from manifold_mpc_ros.config.yaml_file import read_parameter_file
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.fault_injection.fault import (
    BEHIND,
    CONTROLLER,
    SIMULATED_TIME,
    SIMULATOR,
    STATE,
    TORQUE,
)
from manifold_mpc_ros.lab.fault_injection.lifetimes import Life
from manifold_mpc_ros.lab.parameter_files import parameter_file_text

NAMES = {CONTROLLER: CONTROLLER_NAME, SIMULATOR: SIMULATOR_NAME}
#: Between two looks at everything [s].
LOOK_S = 0.004
#: Between two looks at the memory of the nodes [s].
MEMORY_PERIOD_S = 1.0


class Interrupted(ManifoldMpcError):
    """The bench was asked to stop."""


@dataclass(frozen=True)
class BenchPlan:
    """What every bench of a run has in common."""

    controller_file: Path
    simulator_file: Path
    step_s: float | None = None
    programs: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def parameters(self, node: str, *, simulated_time: bool) -> dict[str, Any]:
        """Return the parameters that a node is started with; raises ConfigurationError."""
        path = self.controller_file if node == CONTROLLER else self.simulator_file
        values = read_parameter_file(path, NAMES[node])
        if self.step_s is not None and node == CONTROLLER:
            values['mpc.step_s'] = self.step_s
        elif self.step_s is not None:
            values['timing.state_period_s'] *= self.step_s / values['timing.control_period_s']
            values['timing.control_period_s'] = self.step_s
        if simulated_time:
            values['use_sim_time' if node == CONTROLLER else 'timing.publish_clock'] = True
        return values

    def check(self) -> ControllerConfig:
        """Return the controller's configuration; raises ConfigurationError for either file."""
        SimulatorConfig.from_yaml(self.simulator_file)
        return ControllerConfig.from_yaml(self.controller_file)


class Bench:
    """A pair of nodes, the proxy between them, the observer, and a supervisor; a context manager.

    A node that ends is started again at once, as a supervisor would; an end that nobody asked for
    is kept in ``deaths``, what processes of a node's own outlived it in ``left_behind``.
    """

    def __init__(
        self, plan: BenchPlan, folder: Path, *, simulated_time: bool, seed: int,
        stopped: Any,
    ) -> None:
        """Prepare; `__enter__` starts."""
        self.plan, self.simulated_time, self.stopped = plan, simulated_time, stopped
        self._folder, self._seed = folder, seed
        self.lives: dict[str, list[Life]] = {CONTROLLER: [], SIMULATOR: []}
        self.deaths: list[str] = []
        self.left_behind: list[str] = []
        config = plan.check()
        self.inertial_frame_id = config.inertial_frame_id
        #: Those of the control so far; the last one is the present one.
        self.steps_s = [plan.step_s or config.mpc.step_s]
        self.expected_end: dict[str, bool] = {CONTROLLER: False, SIMULATOR: False}
        self.late_s = 0.0
        self._waits_ns: dict[str, dict[str, int]] = {CONTROLLER: {}, SIMULATOR: {}}
        self._memory_s = 0.0
        self._stack = ExitStack()

    def __enter__(self) -> Bench:
        """Reserve a domain, start both nodes and the onlookers."""
        from manifold_mpc_ros.lab.fault_injection.nodes.observer import Observer
        from manifold_mpc_ros.lab.fault_injection.nodes.proxy import Proxy
        from manifold_mpc_ros.lab.fault_injection.nodes.requests import Requests
        from manifold_mpc_ros.lab.recording.nodes.listener import Listener
        try:
            self._domain = self._stack.enter_context(reserved_domain())
            listener = Listener('chaos_proxy', self._domain)
            self._stack.push(listener.__exit__)
            stranger = Listener('chaos_stranger', self._domain)
            self._stack.push(stranger.__exit__)
            self.listener, self.observer = listener, Observer(listener.node)
            topics = (STATE, TORQUE) + ((SIMULATED_TIME,) if self.simulated_time else ())
            self.proxy = Proxy(
                listener.node, stranger.node, topics, self._seed, self.observer.see)
            self.requests = Requests(listener.node)
            self._stack.callback(self._end_nodes)
            for node in (CONTROLLER, SIMULATOR):
                self.start(node)
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """End everything that was started."""
        self._stack.close()

    def life(self, node: str) -> Life:
        """Return the present process of a node."""
        return self.lives[node][-1]

    def start(self, node: str, changes: Mapping[str, object] | None = None) -> None:
        """Start a process of a node, with some parameters changed."""
        number = len(self.lives[node])
        values = {**self.plan.parameters(node, simulated_time=self.simulated_time),
                  **(changes or {})}
        path = self._folder / f'{node}_{number}.yaml'
        path.write_text(parameter_file_text(NAMES[node], values), encoding='utf-8')
        arguments = ['--params-file', str(path)]
        for topic in ((STATE, SIMULATED_TIME) if node == CONTROLLER else (TORQUE,)):
            if topic != SIMULATED_TIME or self.simulated_time:
                name = f'/{topic}' if topic == SIMULATED_TIME else topic
                arguments += ['-r', f'{name}:=/{topic}{BEHIND}']
        process = NodeProcess(
            node, arguments, node_environment(self._domain) | loopback_only(),
            self._folder / f'{node}_{number}.log', self.plan.programs.get(node))
        self.lives[node].append(Life(process, time.monotonic()))
        self.expected_end[node] = False
        if node == CONTROLLER:
            self.observer.new_life()

    def restart(self) -> None:
        """Kill both nodes and start them afresh."""
        for node in NAMES:
            self.life(node).note_children()
            self.life(node).process.send(signal.SIGKILL)
            self.life(node).process.wait()
            self.start(node)

    def slow_down(self, times: int) -> None:
        """Start both nodes afresh with steps, and delays of messages, so many times as long."""
        self.proxy.stretch(times)
        self.steps_s.append(times * self.steps_s[-1])
        self.plan = replace(self.plan, step_s=self.steps_s[-1])
        self.restart()

    def look(self) -> None:
        """Take in what comes for a short while, deliver what is due, look after the nodes."""
        if self.stopped.is_set():
            raise Interrupted('interrupted')
        begun_s = time.monotonic()
        self.listener.spin(LOOK_S)
        self.proxy.poll()
        self.requests.poll()
        now_s = time.monotonic()
        self.late_s = max(self.late_s, now_s - begun_s - LOOK_S)
        self._supervise()
        if now_s - self._memory_s >= MEMORY_PERIOD_S:
            self._memory_s = now_s
            for lives in self.lives.values():
                lives[-1].sample(now_s)

    def begin_account(self) -> None:
        """Count anew what the machine is late by."""
        self.late_s = 0.0
        self._waits_ns = {node: lives[-1].waits_ns() for node, lives in self.lives.items()}

    @property
    def starved_s(self) -> float:
        """Longest time that a thread of either node has waited for a processor since then."""
        grown = [wait_ns - self._waits_ns[node].get(thread, 0)
                 for node, lives in self.lives.items()
                 for thread, wait_ns in lives[-1].waits_ns().items()]
        return max(grown, default=0) / NANOSECONDS

    def tracebacks(self) -> int:
        """Return how many tracebacks both nodes have written since the last call."""
        return sum(life.new_tracebacks() for lives in self.lives.values() for life in lives[-2:])

    def _supervise(self) -> None:
        """Start again what has ended; note what nobody had asked to end."""
        for node, lives in self.lives.items():
            status = lives[-1].process.exit_status
            if status is None:
                continue
            if self.expected_end[node]:
                continue
            words = lives[-1].process.last_words()
            self.deaths.append(f'the {node} ended by itself (status {status}): {words}')
            self.start(node)

    def _end_nodes(self) -> None:
        """Interrupt both and wait."""
        processes = [lives[-1].process for lives in self.lives.values() if lives]
        for process in processes:
            process.interrupt()
        for process in processes:
            process.wait()
        until_s = time.monotonic() + STOP_TIMEOUT_S
        lives = [life for lives in self.lives.values() for life in lives]
        while any(life.left_behind() for life in lives) and time.monotonic() < until_s:
            time.sleep(LOOK_S)
        for life in lives:
            self.left_behind += life.left_behind()
            life.end_children()
