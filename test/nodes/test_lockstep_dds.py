# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two lockstep runs over DDS are the same to the last bit, whoever starts first."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from harness import Rig, open_rig, stamp_ns, torque_of
from nav_msgs.msg import Odometry
from std_srvs.srv import SetBool
from watching import values_of

BY_HAND = {'lockstep': True, 'autostart': False}
NOISY = {'sensor.attitude_noise_std_rad': 1e-3, 'sensor.rate_noise_std_rad_s': 1e-4,
         'plant.disturbance_torque_n_m': [0.01, -0.02, 0.005]}
EXCHANGES = 60


def record(folder: Path, order: list[str]) -> tuple[list, list]:
    """Return stamps and bits of the first states and torques of a run."""
    with open_rig(folder) as rig:
        states = rig.watch(Odometry, 'odometry')
        torques = rig.watch(WrenchStamped, 'torque_command')
        rig.start('controller', parameters=BY_HAND)
        rig.start('simulator', parameters=BY_HAND | NOISY)
        for node in order:
            rig.activate(node)
        rig.until(lambda: min(len(states), len(torques)) > EXCHANGES, 'the exchanges')
    return bits_of_states(states)[:EXCHANGES], bits_of_torques(torques)[:EXCHANGES]


def bits_of_torques(torques: list[WrenchStamped]) -> list:
    """Return each stamp with its torque, once, in order."""
    return sorted({(stamp_ns(m), *(x.hex() for x in torque_of(m))) for m in torques})


def bits_of_states(states: list[Odometry]) -> list:
    """Return each stamp with quaternion and rate, once, in order."""
    def values(message: Odometry) -> list[float]:
        q, w = message.pose.pose.orientation, message.twist.twist.angular
        return [q.x, q.y, q.z, q.w, w.x, w.y, w.z]
    return sorted({(stamp_ns(m), *(x.hex() for x in values(m))) for m in states})


def test_two_runs_record_the_same_bits(tmp_path: Path) -> None:
    nodes = ['/attitude_controller', '/lgvi_simulator']
    first = record(tmp_path, nodes)
    second = record(tmp_path, nodes[::-1])
    assert first == second
    states, torques = first
    assert [row[0] for row in states] == [row[0] for row in torques]
    assert len({row[1:] for row in torques}) == EXCHANGES  # noise: no two alike


def test_simulator_waits_for_a_controller_and_repeats_what_is_not_answered(rig: Rig) -> None:
    """Time starts with the first answer, and a silent controller is counted, not fatal."""
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    rig.start('simulator', parameters={
        'lockstep': True, 'lockstep_retry_s': 0.05, 'lockstep_timeout_s': 0.3})
    rig.until(lambda: values_of(diagnostics, 'lgvi_simulator').get('mode') == 'WAIT', 'waiting')
    publisher = rig.node.create_publisher(WrenchStamped, 'torque_command', 10)
    rig.until(lambda: len(states) > 10, 'repeated states')
    assert {stamp_ns(state) for state in states} == {1_000_000_000}
    answer = WrenchStamped()
    answer.header.frame_id = 'base_link'
    answer.header.stamp.sec = 1
    rig.tell(publisher, answer, lambda: stamp_ns(states[-1]) > 1_000_000_000, 'time to begin')
    rig.until(lambda: int(values_of(diagnostics, 'lgvi_simulator')['lockstep_timeouts']) > 1,
              'timeouts')
    assert int(values_of(diagnostics, 'lgvi_simulator')['lockstep_repeats']) > 10
    stamps = sorted({stamp_ns(state) for state in states})
    assert stamps[:3] == [1_000_000_000, 1_500_000_000, 2_000_000_000]


def test_pause_stops_simulated_time(rig: Rig) -> None:
    states = rig.watch(Odometry, 'odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    rig.start('controller', parameters={'lockstep': True})
    rig.start('simulator', parameters={'lockstep': True})
    rig.until(lambda: len(states) > 5, 'states')
    assert rig.call(SetBool, '/lgvi_simulator/pause', SetBool.Request(data=True)).success
    rig.until(lambda: values_of(diagnostics, 'lgvi_simulator').get('mode') == 'PAUSED', 'a pause')
    for _ in range(2):  # what was still on its way has come by the second time
        paused_at, looked = stamp_ns(states[-1]), len(diagnostics)
        rig.until(lambda n=looked: len(diagnostics) > n + 6, 'more diagnostics')
    assert stamp_ns(states[-1]) <= paused_at
    assert rig.call(SetBool, '/lgvi_simulator/pause', SetBool.Request(data=False)).success
    rig.until(lambda: stamp_ns(states[-1]) > paused_at, 'time going on')
