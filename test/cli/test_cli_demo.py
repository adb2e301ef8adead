# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The demo: once for real over DDS, and what happens when it cannot run."""

from __future__ import annotations

import csv
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from manifold_mpc_ros.cli import processes
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.recording.bags.run import BagRun, read_run
from manifold_mpc_ros.lab.recording.bags.verdict import judge

Command = Callable[..., tuple[int, str, str]]
#: Stamp of the first state of a simulator in lockstep [ns].
FIRST_NS = 1_000_000_000
TOP = Path(__file__).parents[2]
DEMO = [sys.executable, '-m', 'manifold_mpc_ros.cli.main', 'demo']


def environment() -> dict[str, str]:
    """Return the environment of a demo in an interpreter of its own."""
    path = os.pathsep.join([str(TOP), *filter(None, [os.environ.get('PYTHONPATH')])])
    return {**processes.node_environment(0), 'PYTHONPATH': path, 'ROS_DOMAIN_ID': ''}


def column(path: Path, name: str) -> np.ndarray:
    with path.open(encoding='utf-8') as file:
        return np.array([float(row[name]) for row in csv.DictReader(file)])


def test_the_shipped_slew_settles_over_dds(tmp_path: Path) -> None:
    """Two real processes turn the body by 180 degrees, and end with status 0.

    In lockstep: in real time a torque comes too late where the machine has no time for it.
    """
    pytest.importorskip('rclpy')
    folder = tmp_path / 'demo'
    done = subprocess.run([*DEMO, '--time-limit', '41', '--start-limit', '120', '--output',
                           str(folder)], env=environment(), text=True, capture_output=True,
                          check=False, timeout=250)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'simulator 0, controller 0' in done.stdout
    live = [line for line in done.stdout.splitlines() if line.startswith('t ')]
    assert live  # how many is a matter of how fast the machine is
    assert all(re.search(r'error +[\d.]+ deg   rate .* rad/s   torque .* N m   mode \w+', line)
               for line in live)
    assert re.search(r'ticks outside D_N +│ +\d+ of \d+ ', done.stdout)
    for name in ('response.png', 'orientation.png'):
        assert (folder / name).read_bytes().startswith(b'\x89PNG')
    bag_and_report(folder, done.stdout)
    error_deg = np.degrees(column(folder / 'states.csv', 'attitude_error_rad'))
    assert np.isclose(error_deg[0], 180.0, atol=1e-6)
    held = column(folder / 'states.csv', 'time_s') > column(
        folder / 'states.csv', 'time_s')[-1] - 1.9
    assert np.all(error_deg[held] < 0.1)
    for axis in 'xyz':
        assert np.all(np.abs(column(folder / 'torques.csv', f'torque_B_{axis}_n_m')) <= 0.3)
        rate = column(folder / 'states.csv', f'omega_BN_B_{axis}_rad_s')
        assert np.all(np.abs(rate[held]) < 1e-3)


def test_a_long_demo_is_in_lockstep_with_the_same_pictures(tmp_path: Path) -> None:
    """One that may take more than 40 s waits for no clock; its bag says so and passes."""
    pytest.importorskip('rclpy')
    done = subprocess.run(
        [*DEMO, '--time-limit', '60', '--output', str(tmp_path)], env=environment(), text=True,
        capture_output=True, check=False, timeout=150)
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'in lockstep: faster than real time' in done.stdout
    assert re.search(r'settled after +│ 12\.\d+ s', done.stdout)
    run = read_run(tmp_path / 'bag')
    assert run.lockstep
    assert run.warnings == ()
    assert judge(run).failed == ()
    nothing_is_missed(tmp_path, run)
    assert (tmp_path / 'response.png').read_bytes().startswith(b'\x89PNG')


def test_the_controller_begins_when_who_listens_and_every_node_know_each_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Discovery of each may be late: whom the loop does not wait for misses its first states."""
    pytest.importorskip('rclpy')
    from manifold_mpc_ros.lab.demo.bag import DemoBag
    from manifold_mpc_ros.lab.demo.watch import activate_controller
    from manifold_mpc_ros.lab.recording.nodes.bag_recorder import BagRecorder
    from manifold_mpc_ros.lab.recording.nodes.history import Recorder
    from manifold_mpc_ros.lab.recording.nodes.listener import Listener
    done: list[tuple[str, ...]] = []

    def note(what: str) -> Callable[..., bool]:
        def do(listener: Listener, node: str, _watch: object, topics: Iterable[str] = ()) -> bool:
            done.append((what, listener.node.get_name(), node, *topics))
            return True
        return do

    for what in ('configure', 'meet', 'activate'):
        monkeypatch.setattr(Listener, what, note(what))
    monkeypatch.setattr(BagRecorder, 'count', lambda *_: SimpleNamespace(received=1))
    listening = ('manifold_mpc_recorder', 'bag_recorder')
    with processes.reserved_domain() as domain, Recorder(domain, '/here') as recorder, \
            DemoBag(tmp_path / 'bag', domain, '/here') as bag:
        activate_controller(recorder, bag, SimpleNamespace(), lambda: None, guided=True)
    controller, simulator, guidance = (f'here/{name}' for name in (
        'attitude_controller', 'lgvi_simulator', 'attitude_guidance'))
    assert done[0] == ('configure', listening[0], controller)
    assert done[-1] == ('activate', listening[0], controller)
    assert set(done[1:-1]) == {
        *(('meet', name, simulator, '/here/odometry') for name in listening),
        ('meet', listening[0], controller, '/here/torque_command'),
        ('meet', listening[1], controller, '/here/torque_command',
         '/here/attitude_controller/prediction'),
        ('meet', listening[1], guidance, '/here/reference')}


def bag_and_report(folder: Path, out: str) -> None:
    """The run is in a bag that passes its own limits, and there is a page about it."""
    run = read_run(folder / 'bag')
    assert run.warnings == ()
    assert judge(run).failed == ()
    assert run.ticks.mode[-1] == 'NOMINAL'
    assert np.isclose(run.error_rad[0], np.pi, atol=1e-9)
    nothing_is_missed(folder, run)
    watched = column(folder / 'states.csv', 'time_s')
    # Both are closed one after the other; a state that had no answer for a while counts once.
    assert abs(len(run.states) - len(np.unique(watched[watched >= 0.0]))) <= 10
    page = folder / 'report' / 'demo.html'
    assert page.is_file()
    assert str(page) in out


def nothing_is_missed(folder: Path, run: BagRun) -> None:
    """Bag and pictures have every state of a demo in lockstep from the initial one on."""
    assert run.states.stamp_ns[0] == FIRST_NS
    for time_s in (1e-9 * run.states.stamp_ns, column(folder / 'states.csv', 'time_s')):
        # One a control period, and again what has no answer for a while.
        assert np.allclose(np.diff(np.unique(time_s)), 0.5)


def test_sigterm_ends_the_nodes_as_well(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    with subprocess.Popen([*DEMO, '--output', str(tmp_path)], env=environment(), text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE) as demo:
        assert demo.stdout is not None
        assert 'ROS_DOMAIN_ID=' in demo.stdout.readline()
        assert 'starting' in demo.stdout.readline()
        children = Path(f'/proc/{demo.pid}/task/{demo.pid}/children')
        nodes = [int(pid) for pid in children.read_text().split()]
        assert nodes
        demo.send_signal(signal.SIGTERM)
        out, err = demo.communicate(timeout=30)
    assert demo.returncode == 130
    assert not (tmp_path / 'bag').exists()
    assert err == 'manifold-mpc: interrupted\n'
    assert 'settled' not in out
    assert not any(Path(f'/proc/{pid}').exists() for pid in nodes)


def test_a_loop_that_does_not_close_in_time_is_one_message(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    done = subprocess.run([*DEMO, '--start-limit', '0.01', '--output', str(tmp_path)],
                          env=environment(), text=True, capture_output=True, check=False,
                          timeout=60)
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert 'no torque came within 0.01 s' in done.stderr


def test_the_messages_of_another_stack_are_refused_with_the_verb_that_takes_them(
    command: Callable[..., tuple[int, str, str]], write_config: Callable[..., Path],
) -> None:
    config = write_config('controller', state_source='basilisk')
    status, _, error = command('demo', '--controller-config', config)
    assert status == 2
    assert 'manifold-mpc record runs a scenario' in error


def test_without_ros_the_demo_says_what_to_install(
    command: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
) -> None:
    monkeypatch.setitem(sys.modules, 'rclpy', None)
    status, out, err = command('demo', '--output', tmp_path / 'demo')
    assert (status, out) == (2, '')
    assert err.count('\n') == 1
    assert "rclpy, which is not installed: pip install 'manifold_mpc_ros[ros]', or source" in err
    assert not (tmp_path / 'demo').exists()


def test_a_node_that_ends_by_itself_is_noticed(tmp_path: Path) -> None:
    """Its status and its last words can be told; the others are ended in order."""
    plain = dict(os.environ, PYTHONPATH=environment()['PYTHONPATH'])
    with processes.NodeProcesses() as group:
        group.start('no_such_node', [], plain, tmp_path / 'log')
        (node,) = group.nodes
        assert node.wait() == 1
        assert group.ended() is node
        assert 'no_such_node' in node.last_words()
        assert group.stop() == {'no_such_node': 1}


def test_a_torque_without_a_state_does_not_close_the_loop() -> None:
    """Each topic comes on its own way: the torque may be heard first."""
    pytest.importorskip('rclpy')
    from manifold_mpc_ros.lab.demo.watch import loop_is_closed
    heard = SimpleNamespace(states=0, commands=1, mode='NOMINAL',
                            latest_torque=lambda: np.ones(3))
    assert not loop_is_closed(heard)
    heard.states = 1
    assert loop_is_closed(heard)


def test_a_taken_domain_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    with processes.chosen_domain() as domain:
        assert 1 <= domain <= 101
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(('', 7400 + 250 * domain + 10))
        with processes.chosen_domain() as other:
            assert other != domain


def test_the_domain_of_the_environment_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_DOMAIN_ID', '0')
    with processes.chosen_domain() as domain:
        assert domain == 0
    monkeypatch.setenv('ROS_DOMAIN_ID', '233')
    with pytest.raises(ConfigurationError, match='from 0 to 232'), \
            processes.chosen_domain():
        pass


def test_children_find_their_own_ros_libraries(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('LD_LIBRARY_PATH', '/some/ros/lib')
    monkeypatch.setenv('_ROS_WHEELS_BOOTSTRAP_COMPLETE', '1')
    child = processes.node_environment(42)
    assert not {'LD_LIBRARY_PATH', '_ROS_WHEELS_BOOTSTRAP_COMPLETE'} & child.keys()
    assert child['ROS_DOMAIN_ID'] == '42'
    assert child['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    # A sourced installation sets the path for good and no mark.
    monkeypatch.delenv('_ROS_WHEELS_BOOTSTRAP_COMPLETE')
    assert processes.node_environment(42)['LD_LIBRARY_PATH'] == '/some/ros/lib'
