# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Nodes that share no memory: what one of them leaves behind cannot hold the others up."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from manifold_mpc_ros.cli import processes
from manifold_mpc_ros.cli.arguments import shipped_config

PROFILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'


@pytest.mark.parametrize(('over_udp', 'shared'), [(True, False), (False, True)])
def test_over_udp_no_memory_is_shared(tmp_path: Path, over_udp: bool, shared: bool) -> None:
    pytest.importorskip('rclpy')
    log = tmp_path / 'log'
    with processes.reserved_domain() as domain, processes.NodeProcesses() as nodes:
        environment = processes.node_environment(domain)
        environment |= processes.loopback_only() if over_udp else {}
        nodes.start('simulator', ['--params-file', str(shipped_config('simulator.yaml'))],
                    environment, log)
        node, = nodes.nodes
        end_s = time.monotonic() + 60.0
        while 'active' not in log.read_text():
            assert time.monotonic() < end_s, log.read_text()
            time.sleep(0.05)
        maps = Path('/proc', str(node.pid), 'maps').read_text()
        node.send(signal.SIGINT)
        assert node.wait() == 0
    assert ('/dev/shm/fastrtps' in maps) == shared


def test_another_middleware_or_a_profile_of_the_users_is_left_alone(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(PROFILE, raising=False)
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_cyclonedds_cpp')
    assert processes.loopback_only() == {}
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_fastrtps_dynamic_cpp')
    assert Path(processes.loopback_only()[PROFILE]).name == 'one_computer.xml'
    monkeypatch.setenv(PROFILE, 'mine.xml')
    assert processes.loopback_only() == {}


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_comes_where_it_is_looked_for_and_nowhere_else(
        number: signal.Signals) -> None:
    before = signal.getsignal(number)
    done = []
    with processes.Interrupts() as interrupts:
        interrupts.look()
        os.kill(os.getpid(), number)
        done.append('a message')
        done.append('its checksum')
        with pytest.raises(KeyboardInterrupt):
            interrupts.look()
    assert done == ['a message', 'its checksum']
    assert signal.getsignal(number) is before
