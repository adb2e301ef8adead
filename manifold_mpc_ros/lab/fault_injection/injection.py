# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How each kind of fault is done to a bench: begun, kept up, ended."""

from __future__ import annotations

import random
import signal
import socket
import subprocess
import sys
import time
from abc import abstractmethod
from pathlib import Path

from manifold_mpc_ros.lab.fault_injection import fault as kinds
from manifold_mpc_ros.lab.fault_injection.rig import Bench

#: Until a process has ended that was told to; a node takes less than a second, the rest is the
#: machine's [s].
END_S = 5.0
#: Until every request is answered [s].
ANSWER_S = 15.0
#: Until a node with a mistake in its file has ended by itself [s].
BAD_START_S = 30.0
#: Datagrams that are sent at each look.
_DATAGRAMS = 5


class Injection:
    """One fault at work on a bench; what went wrong on the way, or took too long."""

    def __init__(self, bench: Bench, duration_s: float) -> None:
        """Keep the bench."""
        self.bench, self.duration_s = bench, duration_s
        self.troubles: list[str] = []
        self.delays: list[str] = []

    def run(self) -> None:
        """Do it, for as long as it lasts."""
        self.begin()
        try:
            self.last()
        finally:
            self.end()

    @abstractmethod
    def begin(self) -> None:
        """Begin."""

    def last(self) -> None:
        """Keep it up."""
        until_s = time.monotonic() + self.duration_s
        while time.monotonic() < until_s:
            self.keep_up()
            self.bench.look()

    def keep_up(self) -> None:
        """Do what has to be done at each look."""

    def end(self) -> None:
        """End; also after an error."""


class _Topic(Injection):
    """Disturb a topic, intrude on it, silence it or misread it."""

    def __init__(self, bench: Bench, duration_s: float, action: kinds.Action) -> None:
        super().__init__(bench, duration_s)
        self._action = action

    def begin(self) -> None:
        """Begin."""
        proxy, action = self.bench.proxy, self._action
        if isinstance(action, kinds.OnTopic):
            proxy.disturb(action.topic, action.disturbance())
        elif isinstance(action, kinds.SecondPublisher):
            proxy.intrude(action.topic, action.disturbance())
        elif isinstance(action, kinds.PublisherGone):
            proxy.silence(action.topic, True)
        elif isinstance(action, kinds.MisfitSubscriber):
            proxy.misfit(action.topic, True)

    def end(self) -> None:
        """Let messages pass again."""
        proxy, action = self.bench.proxy, self._action
        if isinstance(action, kinds.OnTopic):
            proxy.disturb(action.topic, None)
        elif isinstance(action, kinds.SecondPublisher):
            proxy.intrude(action.topic, None)
        elif isinstance(action, kinds.PublisherGone):
            proxy.silence(action.topic, False)
        elif isinstance(action, kinds.MisfitSubscriber):
            proxy.misfit(action.topic, False)


class _Signal(Injection):
    """Send a signal; a stopped process goes on afterwards, an ended one is started again."""

    def __init__(self, bench: Bench, duration_s: float, action: kinds.Signal) -> None:
        super().__init__(bench, duration_s)
        self._action = action

    def begin(self) -> None:
        """Send it."""
        self.bench.life(self._action.node).note_children()
        self._process = self.bench.life(self._action.node).process
        self.bench.expected_end[self._action.node] = self._action.number != signal.SIGSTOP
        self._process.send(self._action.number)

    def last(self) -> None:
        """Keep it stopped, or wait until it has ended and start another one."""
        if self._action.number == signal.SIGSTOP:
            super().last()
            return
        sent_s = time.monotonic()
        while self._process.exit_status is None and time.monotonic() < sent_s + END_S:
            self.bench.look()
        status, wanted = self._process.exit_status, self._action.exit_status
        if status is None:
            self.delays.append(f'did not end within {END_S:g} s of {self._action.number.name}')
            self._process.send(signal.SIGKILL)
            self._process.wait()
        elif wanted is not None and status != wanted:
            self.troubles.append(f'ended with exit status {status}, not {wanted}')
        self.bench.start(self._action.node)

    def end(self) -> None:
        """Let a stopped process go on."""
        self._process.send(signal.SIGCONT)


class _BadStart(Injection):
    """Start a node with a mistake in its parameters; it has to say so and leave."""

    def __init__(self, bench: Bench, duration_s: float, action: kinds.BadStart) -> None:
        super().__init__(bench, duration_s)
        self._action = action

    def begin(self) -> None:
        """Kill the node and start it wrongly."""
        node = self._action.node
        self.bench.expected_end[node] = True
        self.bench.life(node).note_children()
        self.bench.life(node).process.send(signal.SIGKILL)
        self.bench.life(node).process.wait()
        self.bench.start(node, self._action.changes)
        self.bench.expected_end[node] = True

    def last(self) -> None:
        """Wait until it has refused, then start it as it should be."""
        process = self.bench.life(self._action.node).process
        begun_s = time.monotonic()
        while process.exit_status is None and time.monotonic() < begun_s + BAD_START_S:
            self.bench.look()
        key = next(iter(self._action.changes))
        if process.exit_status is None:
            self.troubles.append('ran on with a mistake in its parameters')
            process.send(signal.SIGKILL)
            process.wait()
        elif process.exit_status != 1 or key not in process.last_words():
            self.troubles.append(
                f'refused with status {process.exit_status}: {process.last_words()}')
        self.bench.start(self._action.node)


class _Hogs(Injection):
    """Take processor time."""

    def __init__(self, bench: Bench, duration_s: float, action: kinds.Hogs) -> None:
        super().__init__(bench, duration_s)
        self._count = action.processes

    def begin(self) -> None:
        """Start them; each ends by itself, should nobody end it."""
        program = f'import time\nend = time.time() + {self.duration_s + 5.0}\n' \
                  'while time.time() < end: pass'
        self._hogs = [subprocess.Popen([sys.executable, '-S', '-c', program])
                      for _ in range(self._count)]

    def end(self) -> None:
        """End them."""
        for hog in self._hogs:
            hog.kill()
            hog.wait()


class _Requests(Injection):
    """Send requests until every one is answered."""

    def __init__(
        self, bench: Bench, duration_s: float, action: kinds.Requests, seed: int,
    ) -> None:
        super().__init__(bench, duration_s)
        self._action, self._seed = action, seed

    def begin(self) -> None:
        """Find the services and begin."""
        requests, action = self.bench.requests, self._action
        until_s = time.monotonic() + ANSWER_S
        while not requests.ready(action.node, action.kind):
            if time.monotonic() > until_s:
                self.delays.append('its services could not be found')
                return
            self.bench.look()
        bench = self.bench
        requests.begin(
            action.node, action.kind, self._seed, bench.inertial_frame_id,
            bench.plan.parameters(action.node, simulated_time=bench.simulated_time))

    def last(self) -> None:
        """Wait for the answers, or publish for as long as it lasts."""
        life = self.bench.life(self._action.node)
        super().last()
        until_s = time.monotonic() + ANSWER_S
        while not self.bench.requests.answered:
            if self.bench.life(self._action.node) is not life:
                return  # it died of them
            if time.monotonic() > until_s:
                self.delays.append(f'requests were not answered within {ANSWER_S:g} s')
                return
            self.bench.look()

    def end(self) -> None:
        """Publish no more."""
        self.bench.requests.cease()


class _Datagrams(Injection):
    """Send noise, and RTPS that is damaged, to the ports of a process."""

    def __init__(
        self, bench: Bench, duration_s: float, action: kinds.Datagrams, seed: int,
    ) -> None:
        super().__init__(bench, duration_s)
        self._draws, self._node = random.Random(seed), action.node

    def begin(self) -> None:
        """Find the ports."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._ports = udp_ports(self.bench.life(self._node).process.pid)
        if not self._ports:
            self.troubles.append('no UDP port of the process was found')

    def keep_up(self) -> None:
        """Send some."""
        for _ in range(_DATAGRAMS if self._ports else 0):
            data = self._draws.randbytes(self._draws.randrange(1400))
            header = b'RTPS\x02\x03\x01\x0f' + self._draws.randbytes(12)
            self._socket.sendto(self._draws.choice((data, header + data)),
                                ('127.0.0.1', self._draws.choice(self._ports)))

    def end(self) -> None:
        """Close the socket."""
        self._socket.close()


def udp_ports(pid: int) -> list[int]:
    """Return the UDP ports that a process listens on."""
    inodes = set()
    for link in Path(f'/proc/{pid}/fd').iterdir():
        try:
            target = link.readlink().name
        except OSError:
            continue
        if target.startswith('socket:['):
            inodes.add(target[8:-1])
    rows = Path(f'/proc/{pid}/net/udp').read_text().splitlines()[1:]
    return sorted({int(row.split()[1].rpartition(':')[2], 16)
                   for row in rows if row.split()[9] in inodes})


def injection(bench: Bench, fault: kinds.Fault, seed: int) -> Injection:
    """Return what does a fault to a bench."""
    action, duration_s = fault.action, fault.duration_s
    match action:
        case kinds.Signal():
            return _Signal(bench, duration_s, action)
        case kinds.BadStart():
            return _BadStart(bench, duration_s, action)
        case kinds.Hogs():
            return _Hogs(bench, duration_s, action)
        case kinds.Requests():
            return _Requests(bench, duration_s, action, seed)
        case kinds.Datagrams():
            return _Datagrams(bench, duration_s, action, seed)
        case _:
            return _Topic(bench, duration_s, action)
