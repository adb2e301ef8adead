# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Real nodes in real processes over DDS, on a domain of their own, and a node that watches them.

Everything waits for conditions, and fails with the processes' own words when one does not come.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import rclpy
import yaml
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from manifold_mpc_ros.cli.processes import reserved_domain

CONFIG = Path(__file__).parents[2] / 'config'
#: A first start on a busy machine may have to compile the solver.
PATIENCE_S = 90.0
#: Messages are taken in for so long between two looks at a condition.
LOOK_S = 0.02
DEEP = QoSProfile(depth=2000, reliability=ReliabilityPolicy.RELIABLE)

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'


def child_environment(domain: int, **variables: str) -> dict[str, str]:
    """Return the environment of a child interpreter, which finds its own ROS libraries."""
    kept = {name: value for name, value in os.environ.items()
            if name not in ('_ROS_WHEELS_BOOTSTRAP_COMPLETE', 'LD_LIBRARY_PATH')
            or '_ROS_WHEELS_BOOTSTRAP_COMPLETE' not in os.environ}
    return {**kept, 'ROS_DOMAIN_ID': str(domain), 'PYTHONUNBUFFERED': '1', **variables}


class Process:
    """One node in one process, with everything that it wrote."""

    def __init__(self, command: Sequence[str], folder: Path, environment: dict[str, str]) -> None:
        handle, name = tempfile.mkstemp(dir=folder, suffix='.log')
        self._log = Path(name)
        with os.fdopen(handle, 'wb') as stream:
            self._popen = subprocess.Popen(
                command, cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=stream,
                stderr=subprocess.STDOUT, start_new_session=True)

    @property
    def log(self) -> str:
        """Everything written to stdout and stderr so far."""
        return self._log.read_text(encoding='utf-8', errors='replace')

    @property
    def pid(self) -> int:
        return self._popen.pid

    @property
    def running(self) -> bool:
        return self.status is None

    @property
    def status(self) -> int | None:
        """The exit status, negative after a signal; None while it runs."""
        return self._popen.poll()

    def signal(self, number: signal.Signals) -> None:
        os.kill(self._popen.pid, number)

    def wait(self, timeout_s: float = 30.0) -> int:
        """Return the exit status."""
        return self._popen.wait(timeout_s)

    def end(self) -> None:
        """Make sure that nothing of it is left."""
        if self.running:
            self.signal(signal.SIGINT)
            try:
                self.wait(5.0)
            except subprocess.TimeoutExpired:
                self._popen.kill()
                self.wait()
                raise AssertionError(f'did not end on SIGINT:\n{self.log}') from None


class Rig:
    """A domain with processes on it and one watching node."""

    def __init__(self, folder: Path, domain: int) -> None:
        self._folder = folder
        self.domain = domain
        self._processes: list[Process] = []
        self._known: set[str] = set()
        self._context = Context()
        rclpy.init(context=self._context, domain_id=domain,
                   signal_handler_options=SignalHandlerOptions.NO)
        self.node = Node('watcher', context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)

    def start(
        self, program: str, *, parameters: dict[str, Any] | None = None,
        remap: dict[str, str] | None = None, file: Path | None = None, **variables: str,
    ) -> Process:
        """Start 'controller' or 'simulator' with its shipped file and changed parameters."""
        arguments = ['--ros-args', '--params-file', str(file or CONFIG / f'{program}.yaml')]
        for name, value in (parameters or {}).items():
            text = str(value).lower() if isinstance(value, bool) else str(value)
            arguments += ['-p', f'{name}:={text}']
        for source, target in (remap or {}).items():
            arguments += ['-r', f'{source}:={target}']
        return self.run([f'manifold_mpc_ros.nodes.{program}.main', *arguments], **variables)

    def run(self, arguments: Sequence[str], **variables: str) -> Process:
        """Start ``python -m`` with these arguments."""
        process = Process([sys.executable, '-m', *arguments], self._folder,
                          child_environment(self.domain, **variables))
        self._processes.append(process)
        return process

    def end(self, process: Process, number: signal.Signals = signal.SIGINT) -> None:
        """End one process, which then no longer has to be alive."""
        self._processes.remove(process)
        process.signal(number)
        process.wait()

    def watch(self, kind: type, topic: str) -> list[Any]:
        """Return a list that grows with every message on a topic."""
        seen: list[Any] = []
        self.node.create_subscription(kind, topic, seen.append, DEEP)
        return seen

    def call(self, kind: type, name: str, request: Any) -> Any:
        """Call a service of a lifecycle node; return its answer."""
        node, _, _ = name.rpartition('/')
        if node not in self._known:
            self._get_known(node)
            self._known.add(node)
        client = self.node.create_client(kind, name)
        self.until(client.service_is_ready, f'service {name}')
        future = client.call_async(request)
        self.until(future.done, f'an answer of {name}')
        self.node.destroy_client(client)
        return future.result()

    def _get_known(self, node: str) -> None:
        """Ask for the state until it is answered: the node then knows the watcher too.

        A client sees a service before the service sees the client, and an answer to somebody
        unknown is lost.
        """
        client = self.node.create_client(GetState, f'{node}/get_state')
        self.until(client.service_is_ready, f'node {node}')
        futures = [client.call_async(GetState.Request())]
        asked_s = time.monotonic()

        def ask_again() -> None:
            nonlocal asked_s
            if time.monotonic() - asked_s > 1.0:
                futures.append(client.call_async(GetState.Request()))
                asked_s = time.monotonic()

        self.until(lambda: any(future.done() for future in futures), f'an answer of {node}',
                   meanwhile=ask_again)
        self.node.destroy_client(client)

    def transition(self, node: str, transition: int) -> bool:
        """Ask a node for a lifecycle transition; return whether it succeeded."""
        request = ChangeState.Request(transition=Transition(id=transition))
        return bool(self.call(ChangeState, f'{node}/change_state', request).success)

    def activate(self, node: str) -> None:
        """Configure and activate a node that was started with ``autostart`` false.

        By the answers of its services it knows this watcher before it publishes anything, so
        nothing that it publishes is missed.
        """
        for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            assert self.transition(node, transition), node

    def until(
        self, condition: Callable[[], bool], what: str, *, timeout_s: float = PATIENCE_S,
        meanwhile: Callable[[], object] = lambda: None, alive: bool = True,
    ) -> None:
        """Spin until a condition holds, calling ``meanwhile`` between looks."""
        end = time.monotonic() + timeout_s
        while not condition():
            logs = '\n'.join(process.log for process in self._processes)
            assert time.monotonic() < end, f'waited in vain for {what}\n{logs}'
            if alive:
                assert all(p.running for p in self._processes), (
                    f'ended before {what}, with {[p.status for p in self._processes]}\n{logs}')
            meanwhile()
            self._spin_for(LOOK_S)

    def tell(
        self, publisher: Any, message: Any, condition: Callable[[], bool], what: str,
    ) -> None:
        """Publish once a second until a condition holds.

        Inputs are best effort: what comes before a node knows of the publisher is lost.
        """
        next_s = 0.0

        def publish() -> None:
            nonlocal next_s
            if time.monotonic() >= next_s:
                publisher.publish(message)
                next_s = time.monotonic() + 1.0

        self.until(condition, what, meanwhile=publish)

    def more(self, seen: list[Any], count: int, what: str,
             meanwhile: Callable[[], object] = lambda: None) -> None:
        """Wait for so many further messages: whoever sends them has gone on meanwhile."""
        before = len(seen)
        self.until(lambda: len(seen) >= before + count, what, meanwhile=meanwhile)

    def settle(self) -> None:
        """Take in what has come, and what comes within a moment."""
        self._spin_for(10 * LOOK_S)

    def _spin_for(self, duration_s: float) -> None:
        """Take in what comes within a while; the wait stays the same: see `Listener.spin`."""
        end = time.monotonic() + duration_s
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=LOOK_S)

    def close(self) -> None:
        """End every process and the watcher, also when one does not end by itself."""
        with ExitStack() as stack:
            stack.callback(rclpy.shutdown, context=self._context)
            stack.callback(self.node.destroy_node)
            stack.callback(self._executor.shutdown, timeout_sec=0)
            for process in reversed(self._processes):
                stack.callback(process.end)


@contextmanager
def open_rig(folder: Path) -> Iterator[Rig]:
    """Open a rig on a domain of its own."""
    with reserved_domain() as domain:
        rig = Rig(folder, domain)
        try:
            yield rig
        finally:
            rig.close()


def file_with(folder: Path, program: str, changes: dict[str, Any]) -> Path:
    """Return a copy of a shipped parameter file with changes; None removes a key."""
    document = yaml.safe_load((CONFIG / f'{program}.yaml').read_text(encoding='utf-8'))
    (_section, content), = document.items()
    for name, value in changes.items():
        *groups, key = name.split('.')
        group = content['ros__parameters']
        for part in groups:
            group = group[part]
        if value is not None:
            group[key] = value
        elif len(group) > 1:
            del group[key]
        else:
            del content['ros__parameters'][groups[0]]
    path = folder / f'{program}.yaml'
    path.write_text(yaml.safe_dump(document), encoding='utf-8')
    return path


def log_line(process: Process, text: str) -> Callable[[], bool]:
    """Return the condition that a process has written some text."""
    return lambda: text in process.log


def stamp_ns(message: Any) -> int:
    """Return the stamp of a message [ns]."""
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def torque_of(message: Any) -> tuple[float, float, float]:
    """Return the torque of a wrench."""
    torque = message.wrench.torque
    return (torque.x, torque.y, torque.z)


