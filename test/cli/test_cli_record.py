# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings for real over DDS: the same bits twice, readable bags when something goes wrong."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from interruptible import take_interrupts

from manifold_mpc_ros.cli.processes import node_environment
from manifold_mpc_ros.lab.recording.bags.run import BagRun, read_run

Command = Callable[..., tuple[int, str, str]]
TOP = Path(__file__).parents[2]
RECORD = [sys.executable, '-m', 'manifold_mpc_ros.cli.main', 'record']
HALF = 0.7071067811865476
QUICK: dict[str, Any] = {
    'description': 'quick to run', 'duration_s': 5.0,
    'controller': {'mpc': {'horizon': 5, 'terminal_constraint': False},
                   'limits': {'max_rate_rad_s': [float('inf')] * 3}},
    'simulator': {'sensor': {'attitude_noise_std_rad': 1e-3, 'seed': 5}}}
SETPOINTS = [{'at_s': 0.0, 'attitude_xyzw': [0.0, HALF, 0.0, HALF]},
             {'at_s': 2.0, 'attitude_xyzw': [HALF, 0.0, 0.0, HALF]}]
REPRODUCED = ('/odometry', '/imu', '/odometry_link', '/torque_command', '/attitude_setpoint',
              '/attitude_controller/prediction')


def environment() -> dict[str, str]:
    path = os.pathsep.join([str(TOP), *filter(None, [os.environ.get('PYTHONPATH')])])
    return {**node_environment(0), 'PYTHONPATH': path, 'ROS_DOMAIN_ID': ''}


def scenario(folder: Path, **more: Any) -> Path:
    path = folder / 'quick.yaml'
    path.write_text(yaml.safe_dump({**QUICK, **more}), encoding='utf-8')
    return path


def record(*arguments: object) -> subprocess.CompletedProcess[str]:
    pytest.importorskip('rclpy')
    return subprocess.run([*RECORD, *map(str, arguments)], env=environment(), text=True,
                          capture_output=True, check=False, timeout=200)


def record_until(line_of_time: str, *arguments: object) -> subprocess.Popen[str]:
    """Start a recording and return when it has printed a simulated time of this form."""
    pytest.importorskip('rclpy')
    process = subprocess.Popen([*RECORD, *map(str, arguments)], env=environment(), text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               preexec_fn=take_interrupts)
    assert process.stdout is not None
    for line in process.stdout:
        if re.fullmatch(rf'{line_of_time} of \d+ s simulated(, about \d+ s left)?\n', line):
            return process
    raise AssertionError(process.communicate())


def child(process: subprocess.Popen[str], module: str) -> int:
    children = Path(f'/proc/{process.pid}/task/{process.pid}/children').read_text().split()
    return next(int(pid) for pid in children
                if f'nodes.{module}' in Path(f'/proc/{pid}/cmdline').read_text())


def distinct(run: BagRun, topic: str) -> list[bytes]:
    """Return the messages of a topic, those that lockstep repeated once."""
    return list(dict.fromkeys(message.data for message in run.contents.of(topic)))


def test_two_recordings_in_lockstep_have_the_same_bits(tmp_path: Path) -> None:
    """In either storage; the second setpoint reaches the controller before the state at 2 s."""
    given = scenario(tmp_path, setpoints=SETPOINTS)
    runs = []
    for storage in ('mcap', 'sqlite3'):
        done = record(given, '-o', tmp_path / storage, '--storage', storage)
        assert done.returncode == 0, done.stdout + done.stderr
        assert '5 of 5 s simulated' in done.stdout
        assert str(tmp_path / storage) in done.stdout
        runs.append(read_run(tmp_path / storage))
    for run in runs:
        assert run.warnings == ()
        assert run.outcome == 'complete'
        notes = run.contents.custom
        assert json.loads(notes['lost']) == json.loads(notes['unrecorded']) == {}
        assert json.loads(notes['link_losses']) == {'/odometry': 0}
        assert np.allclose(run.states.time_s, 0.5 * np.arange(11), rtol=0, atol=1e-12)
        assert len(run.commands) == len(run.ticks) == len(run.predictions) == 11
        assert set(run.ticks.mode) == {'NOMINAL'}
        assert run.setpoints.time_s.tolist() == [0.0, 2.0]
        assert run.ticks.total('setpoints') == 2
    for topic in REPRODUCED:
        assert distinct(runs[0], topic) == distinct(runs[1], topic), topic
        assert distinct(runs[0], topic), topic
    described(runs[0], given)


def described(run: BagRun, given: Path) -> None:
    """The bag says what it comes from, and what every topic is."""
    assert run.scenario is not None
    assert run.scenario.text == given.read_text(encoding='utf-8')
    assert run.description.backend == 'c'
    assert run.description.controller_parameters['mpc.horizon'] == 5
    assert run.description.simulator_parameters['sensor.seed'] == 5
    assert {'manifold_mpc_ros', 'numpy', 'casadi', 'rmw', 'python'} <= set(
        run.description.versions)
    topics = run.contents.topics
    for name in (*REPRODUCED, '/diagnostics', '/rosout'):
        assert re.fullmatch('RIHS01_[0-9a-f]{64}', topics[name].type_hash), name
        assert topics[name].qos, name
    assert topics['/odometry'].qos[0]['reliability'] == 'reliable'
    received = [message.received_ns for message in run.contents.of('/odometry')]
    published = [message.published_ns for message in run.contents.of('/odometry')]
    assert published == sorted(published)
    assert all(early <= late for early, late in zip(published, received, strict=True))
    # What reached the controller through the link is what the simulator published.
    assert np.array_equal(run.received_states.R_NB, run.states.R_NB)


def test_a_node_that_crashes_leaves_a_readable_bag(tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    process = record_until(r'[\d.]+', scenario(
        tmp_path, duration_s=500.0, time={'mode': 'wall'}, setpoints=SETPOINTS[:1]), '-o', bag)
    os.kill(child(process, 'controller'), signal.SIGKILL)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert err.count('\n') == 1
    assert 'the controller ended by itself by signal SIGKILL' in err
    assert f'What was recorded until then is in {bag}' in out
    run = read_run(bag)
    assert run.warnings == ()
    assert run.outcome.startswith('failed: the controller ended')
    assert 0 < len(run.states) < 1000
    assert len(run.setpoints) == 1


def test_ctrl_c_ends_the_nodes_and_leaves_a_readable_bag(tmp_path: Path) -> None:
    bag = tmp_path / 'bag'
    process = record_until(
        r'[1-9][\d.]*', scenario(tmp_path, duration_s=500.0, time={'mode': 'clock', 'factor': 2.0},
                 faults={'state_link': {'drop_probability': 0.3, 'delay_s': 0.02, 'seed': 1}}),
        '-o', bag)
    nodes = [child(process, module) for module in ('controller', 'simulator')]
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, out + err
    assert err == 'manifold-mpc: interrupted\n'
    assert f'What was recorded until then is in {bag}' in out
    assert not any(Path(f'/proc/{pid}').exists() for pid in nodes)
    run = read_run(bag)
    assert run.warnings == ()
    assert run.outcome == 'interrupted'
    sent, arrived = set(run.states.stamp_ns), set(run.received_states.stamp_ns)
    assert arrived < sent
    sent_ns = {m.data: m.published_ns for m in run.contents.of('/odometry')}
    assert all(m.published_ns - sent_ns[m.data] > 5_000_000  # 0.02 s at factor 2 is 10 ms
               for m in run.contents.of('/odometry_link') if m.data in sent_ns)


def test_a_bag_that_is_there_is_kept(command: Command, tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'metadata.yaml').write_text('precious')
    status, out, err = command('record', scenario(tmp_path), '-o', tmp_path / 'bag')
    assert (status, out) == (2, '')
    assert err == (f'manifold-mpc: error: {tmp_path / "bag"}: exists already; '
                   '--overwrite replaces it\n')
    assert (tmp_path / 'bag' / 'metadata.yaml').read_text() == 'precious'


def test_mistakes_are_one_line(command: Command, tmp_path: Path) -> None:
    for arguments, words in (
        ((), 'a file or the name of a shipped scenario'),
        (('no_such',), 'one of air_bearing'),
        ((tmp_path / 'absent.yaml',), 'a readable YAML file'),
        ((scenario(tmp_path, duratoin_s=3.0),), 'the nearest is duration_s'),
    ):
        status, out, err = command('record', *arguments)
        assert (status, out) == (2, '')
        assert err.count('\n') == 1
        assert words in err


def test_the_list_has_every_shipped_scenario(command: Command) -> None:
    status, out, _ = command('record', '--list')
    assert status == 0
    for path in (TOP / 'config' / 'scenarios').glob('*.yaml'):
        assert path.stem in out


def test_a_controller_that_refuses_leaves_nothing(tmp_path: Path) -> None:
    """No design exists for these weights: one message, no bag."""
    given = scenario(tmp_path, controller={
        'mpc': {'horizon': 5, 'terminal_scale': 1.0}})
    done = record(given, '-o', tmp_path / 'bag')
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert not (tmp_path / 'bag').exists()
