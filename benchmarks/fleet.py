# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Several spacecraft on one machine: whether all settle where they were told, and the cost.

    python benchmarks/fleet.py [--spacecraft 2 10] [--output docs/results/fleet.json]

Each has a controller and a simulator in a namespace, starts 180 degrees from identity, and is
told an attitude of its own. Settled: within 0.1 degree and 1e-3 rad/s of it. ``foreign`` counts
torques that answer a state of another spacecraft (by the wall clock no two stamps are the same).
Processor time is that of all processes over ten seconds at rest, memory their proportional share.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import QuaternionStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data

from manifold_mpc_ros.cli import provenance
from manifold_mpc_ros.cli.arguments import shipped_config
from manifold_mpc_ros.cli.processes import NodeProcesses, node_environment, reserved_domain
from manifold_mpc_ros.lie import so3

RESULT = Path(__file__).parents[1] / 'docs' / 'results' / 'fleet.json'
TIMES = ('wall clock', 'one clock, followed', 'a clock each')
PATIENCE_S, MEASURED_S = 300.0, 10.0
SETTLED_RAD, SETTLED_RAD_S = math.radians(0.1), 1e-3
#: Few states, so that the watcher does not weigh: the controllers need one a tick.
STATE_PERIOD_S = 0.25


class Spacecraft:
    """What the watcher knows of one spacecraft."""

    def __init__(self, node: Node, index: int) -> None:
        """Listen to it, and make ready to tell it where to turn."""
        self.name = f'sat{index}'
        self.half_angle_rad = math.radians(5.0 * index)
        self.states: set[int] = set()
        self.commands: set[int] = set()
        self.settled = False
        self._setpoint = node.create_publisher(
            QuaternionStamped, f'/{self.name}/attitude_setpoint', 10)
        node.create_subscription(Odometry, f'/{self.name}/odometry', self._on_state,
                                 qos_profile_sensor_data)
        node.create_subscription(WrenchStamped, f'/{self.name}/torque_command', self._on_torque,
                                 qos_profile_sensor_data)

    def tell(self) -> None:
        """Publish where it shall turn."""
        message = QuaternionStamped()
        message.header.frame_id = 'inertial'
        message.quaternion.x = math.sin(self.half_angle_rad)
        message.quaternion.w = math.cos(self.half_angle_rad)
        self._setpoint.publish(message)

    def _on_state(self, message: Odometry) -> None:
        """Note the stamp, and whether it is where it should be."""
        self.states.add(_nanoseconds(message))
        q, rate = message.pose.pose.orientation, message.twist.twist.angular
        R_NB = so3.rotation_from_quaternion([q.w, q.x, q.y, q.z])
        R_ND = so3.rotation_from_quaternion(
            [math.cos(self.half_angle_rad), math.sin(self.half_angle_rad), 0.0, 0.0])
        self.settled = (so3.angle(R_ND.T @ R_NB) < SETTLED_RAD
                        and math.hypot(rate.x, rate.y, rate.z) < SETTLED_RAD_S)

    def _on_torque(self, message: WrenchStamped) -> None:
        """Note which state it answers."""
        self.commands.add(_nanoseconds(message))


def _nanoseconds(message: Any) -> int:
    """Return the stamp of a message [ns]."""
    return int(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)


def start(processes: NodeProcesses, times: str, count: int, environment: dict[str, str],
          folder: Path) -> None:
    """Start every node."""
    for index in range(count):
        own = ['-r', f'__ns:=/sat{index}']
        follow = [] if times == TIMES[0] else ['-p', 'use_sim_time:=true']
        if times == TIMES[2]:
            own += ['-r', '/clock:=clock']
        publishes = times == TIMES[2] or (times == TIMES[1] and index == 0)
        clock = ['-p', 'timing.publish_clock:=true'] if publishes else follow
        for module, more in (('controller', follow), ('simulator', [
                *clock, '-p', f'timing.state_period_s:={STATE_PERIOD_S}'])):
            processes.start(module, [*own, '--params-file', str(shipped_config(f'{module}.yaml')),
                                     *more], environment, folder / f'{module}{index}.log')


def run(times: str, count: int) -> dict[str, Any]:
    """Return what became of so many spacecraft in one way of giving them time."""
    with (reserved_domain() as domain, tempfile.TemporaryDirectory() as folder,
          NodeProcesses() as processes):
        environment = node_environment(domain)
        rclpy.init(domain_id=domain)
        node = Node('watcher')
        try:
            fleet = [Spacecraft(node, index) for index in range(count)]
            begun_s = time.monotonic()
            start(processes, times, count, environment, Path(folder))
            ended = _until(node, lambda: all(each.commands for each in fleet), processes)
            started_s = time.monotonic() - begun_s
            for each in fleet:
                each.tell()
            if ended:
                _until(node, lambda: all(each.settled for each in fleet), processes,
                       again=[each.tell for each in fleet])
            settled_s = time.monotonic() - begun_s - started_s
            row = {'time': times, 'spacecraft': count, 'all_started_s': round(started_s, 1),
                   'settled': sum(each.settled for each in fleet),
                   'settled_after_s': round(settled_s, 1),
                   'foreign': _foreign(fleet) if times == TIMES[0] else None}
            return row | _cost(node, processes, count)
        finally:
            node.destroy_node()
            rclpy.shutdown()


def _until(node: Node, condition: Callable[[], bool], processes: NodeProcesses,
           again: list[Callable[[], None]] | None = None) -> bool:
    """Listen until a condition holds; say what is to be said again every two seconds."""
    end_s = time.monotonic() + PATIENCE_S
    said_s = time.monotonic()
    while not condition():
        ended = processes.ended()
        if ended is not None:
            raise SystemExit(f'{ended.name} has ended: {ended.last_words()}')
        if time.monotonic() > end_s:
            return False
        if again and time.monotonic() - said_s > 2.0:
            said_s = time.monotonic()
            for say in again:
                say()
        rclpy.spin_once(node, timeout_sec=0.05)
    return True


def _foreign(fleet: list[Spacecraft]) -> int:
    """Return how many torques answer a state of another spacecraft."""
    return sum(len(each.commands & other.states - each.states)
               for each in fleet for other in fleet if other is not each)


def _cost(node: Node, processes: NodeProcesses, count: int) -> dict[str, Any]:
    """Return processor time and memory of the processes at work, and what they say."""
    used = {each.pid: _processor_s(each.pid) for each in processes.nodes}
    said: dict[str, tuple[int, dict[str, str]]] = {}

    def note(array: DiagnosticArray) -> None:
        for status in array.status:
            said[status.name] = (int.from_bytes(status.level, 'little'),
                                 {pair.key: pair.value for pair in status.values})

    begun_s = time.monotonic()
    while time.monotonic() - begun_s < MEASURED_S:
        time.sleep(0.5)  # the watcher takes no part in what is measured
    took_s = time.monotonic() - begun_s
    shares = {name: [(_processor_s(each.pid) - used[each.pid]) / took_s
                     for each in processes.nodes if each.name == name]
              for name in ('controller', 'simulator')}
    memory = {name: [_memory_mb(each.pid) for each in processes.nodes if each.name == name]
              for name in ('controller', 'simulator')}
    node.create_subscription(DiagnosticArray, '/diagnostics', note, 100)
    _until(node, lambda: len(said) >= 2 * count, processes)
    controllers = [values for name, (_, values) in said.items() if 'controller' in name]
    return {
        'processor_percent': {name: round(100 * float(np.mean(each)), 1)
                              for name, each in shares.items()},
        'processor_percent_all': round(100 * sum(map(sum, shares.values())), 1),
        'memory_mb': {name: round(float(np.mean(each)), 1) for name, each in memory.items()},
        'memory_mb_all': round(sum(map(sum, memory.values()))),
        'ticks': sum(int(values['ticks']) for values in controllers),
        'missed_ticks': sum(int(values['missed_ticks']) for values in controllers),
        'levels': sorted(level for level, _ in said.values()),
        'exceptions': sum(int(values['exceptions']) for _, values in said.values()),
    }


def _processor_s(pid: int) -> float:
    """Return the processor time that a process has used [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text(encoding='utf-8').rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def _memory_mb(pid: int) -> float:
    """Return the memory of a process, shared pages divided among those that share them [MB]."""
    text = Path(f'/proc/{pid}/smaps_rollup').read_text(encoding='utf-8')
    line = next(line for line in text.splitlines() if line.startswith('Pss:'))
    return int(line.split()[1]) * 1024 / 1e6


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--spacecraft', type=int, nargs='+', default=[2, 10],
                        help='how many (default: 2 and 10)')
    parser.add_argument('--output', type=Path, default=RESULT, help='(%(default)s)')
    arguments = parser.parse_args()
    data: dict[str, Any] = {
        'processor': provenance.processor(), 'cores': os.cpu_count(),
        'python': provenance.versions('')['python'],
        'load_average': round(os.getloadavg()[0], 2), 'rows': []}
    for count in arguments.spacecraft:
        for times in TIMES:
            row = run(times, count)
            print(json.dumps(row), flush=True)
            data['rows'].append(row)
    arguments.output.write_text(json.dumps(data, indent=1) + '\n', encoding='utf-8')


if __name__ == '__main__':
    main()
