# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The nodes as processes of their own: start, watch, end in order."""

from __future__ import annotations

import fcntl
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, MutableMapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import NoReturn

from manifold_mpc_ros.cli.arguments import shipped_config
from manifold_mpc_ros.errors import ConfigurationError, ManifoldMpcError

# Fast DDS and the others take this port for the first participant of a domain (DDSI-RTPS 9.6.1).
_FIRST_PORT, _PORTS_PER_DOMAIN, _PARTICIPANT_OFFSET = 7400, 250, 10
# Domains above 101 reach into the ports that Linux hands out to anybody.
_DOMAINS = range(1, 102)
# Its ports are the last below 65536.
_LAST_DOMAIN = 232

STOP_TIMEOUT_S = 5.0


@contextmanager
def chosen_domain() -> Iterator[int]:
    """Give the ROS domain that ROS_DOMAIN_ID names, one of its own where that is not set.

    Raises ConfigurationError for what is no domain.
    """
    given = os.environ.get('ROS_DOMAIN_ID', '')
    if not given:
        with reserved_domain() as domain:
            yield domain
    elif given.isdecimal() and int(given) <= _LAST_DOMAIN:
        yield int(given)
    else:
        raise ConfigurationError('ROS_DOMAIN_ID', given, f'a number from 0 to {_LAST_DOMAIN}')


@contextmanager
def reserved_domain() -> Iterator[int]:
    """Hold a ROS domain that no process on this machine uses, nor another that holds one.

    Raises ManifoldMpcError when all of them are taken.
    """
    start = os.getpid() % len(_DOMAINS)
    for domain in (*_DOMAINS[start:], *_DOMAINS[:start]):
        path = Path(tempfile.gettempdir(), f'manifold_mpc_ros_domain_{domain}.lock')
        try:
            lock = path.open('w')
        except PermissionError:
            continue  # another user's
        with lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            if _is_free(domain):
                yield domain
                return
    raise ManifoldMpcError('no ROS domain is free on this machine (1 to 101 are all in use)')


def _is_free(domain: int) -> bool:
    """Say whether nobody on this machine is in a domain."""
    port = _FIRST_PORT + _PORTS_PER_DOMAIN * domain + _PARTICIPANT_OFFSET
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', port))
        except OSError:
            return False
    return True


def node_environment(domain_id: int) -> dict[str, str]:
    """Return the environment of a node on a domain of its own, seen on this machine only.

    The ROS wheels restart Python once to set a library path; a child has to do that afresh, so
    the path and the mark of it are left out. A sourced ROS installation has no such mark and
    keeps its path.
    """
    environment = dict(os.environ)
    if environment.pop('_ROS_WHEELS_BOOTSTRAP_COMPLETE', None) is not None:
        environment.pop('LD_LIBRARY_PATH', None)
    stay_private(environment)
    environment['ROS_DOMAIN_ID'] = str(domain_id)
    environment['PYTHONUNBUFFERED'] = '1'
    return environment


def stay_private(environment: MutableMapping[str, str]) -> None:
    """Change an environment so that its nodes are seen on this machine only, without security.

    Enclaves do not allow what happens in a domain of its own: they are bound to another domain
    and to other names.
    """
    for name in [each for each in environment if each.startswith('ROS_SECURITY_')]:
        del environment[name]
    environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'


def end_on_sigterm() -> None:
    """Let SIGTERM end this program in order, with what it has done so far, as Ctrl-C does."""
    signal.signal(signal.SIGTERM, _interrupt)


def _interrupt(_number: int, _frame: object) -> NoReturn:
    raise KeyboardInterrupt


class Interrupts:
    """Ctrl-C and SIGTERM as a wish that is looked at, not an exception; a context manager.

    What is being written then stays whole: raised between a message and its checksum, an
    exception would leave the one without the other.
    """

    def __init__(self) -> None:
        """Nothing has been wished."""
        self._wished = False

    def __enter__(self) -> Interrupts:
        """Take over both signals."""
        self._before = {number: signal.signal(number, self._note)
                        for number in (signal.SIGINT, signal.SIGTERM)}
        return self

    def __exit__(self, *_: object) -> None:
        """Give them back."""
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, _number: int, _frame: object) -> None:
        self._wished = True

    def look(self) -> None:
        """Raise KeyboardInterrupt, here, when an end has been wished."""
        if self._wished:
            raise KeyboardInterrupt


def loopback_only() -> dict[str, str]:
    """Return variables with which Fast DDS uses UDP over the loopback interface, nothing else.

    What a killed process leaves behind in shared memory holds others up (config/fastdds). Empty
    for another middleware, and where the user has a profile.
    """
    profile = 'FASTRTPS_DEFAULT_PROFILES_FILE'
    if profile in os.environ or 'fastrtps' not in os.environ.get(
            'RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp'):
        return {}
    return {profile: str(shipped_config('fastdds/one_computer.xml')),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}


class NodeProcess:
    """One running node; what it prints goes to a file."""

    def __init__(
        self, module: str, ros_arguments: Sequence[str], environment: dict[str, str],
        log_path: Path, program: Sequence[str] | None = None,
    ) -> None:
        """Start ``python -m manifold_mpc_ros.nodes.<module>.main``, or another program instead."""
        self.name = module
        self.log_path = log_path
        command = [*(program or (sys.executable, '-m', f'manifold_mpc_ros.nodes.{module}.main')),
                   '--ros-args', *ros_arguments]
        with log_path.open('wb') as log:
            self._process = subprocess.Popen(
                command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    @property
    def pid(self) -> int:
        """The process's id."""
        return self._process.pid

    @property
    def exit_status(self) -> int | None:
        """The exit status of the process, None while it runs; negative after a signal."""
        return self._process.poll()

    def last_words(self) -> str:
        """Return the last line that the node printed."""
        lines = self.log_path.read_text(encoding='utf-8', errors='replace').split('\n')
        return next((line.strip() for line in reversed(lines) if line.strip()), 'no output')

    def interrupt(self) -> None:
        """Ask the process to end, the way a terminal does; one that is stopped goes on first."""
        self.send(signal.SIGINT)
        self.send(signal.SIGCONT)

    def send(self, number: signal.Signals) -> None:
        """Send a signal to the process while it runs."""
        if self.exit_status is None:
            self._process.send_signal(number)

    def wait(self) -> int:
        """Wait until the process has ended, by force if it takes too long; its exit status."""
        try:
            return self._process.wait(STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()


class NodeProcesses:
    """Several nodes that live and end together; a context manager."""

    def __init__(self) -> None:
        """Start with none."""
        self.nodes: list[NodeProcess] = []

    def __enter__(self) -> NodeProcesses:
        """Return the group."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """End all that still run."""
        self.stop()

    def start(
        self, module: str, ros_arguments: Sequence[str], environment: dict[str, str],
        log_path: Path,
    ) -> None:
        """Start one more node."""
        self.nodes.append(NodeProcess(module, ros_arguments, environment, log_path))

    def ended(self) -> NodeProcess | None:
        """Return a node that has ended, None while all run."""
        return next((node for node in self.nodes if node.exit_status is not None), None)

    def stop(self) -> dict[str, int]:
        """Interrupt all and wait; return the exit status of each."""
        for node in self.nodes:
            node.interrupt()
        return {node.name: node.wait() for node in self.nodes}
