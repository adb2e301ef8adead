# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A process that publishes states at a rate and times the torques that answer them.

    python -m manifold_mpc_ros.lab.benchmark.latency_probe '{"rate_hz": 100.0, ...}'

The argument is a `Task` as JSON, the answer one line of JSON. A torque carries the stamp of its
state, so each is matched with the moment its state was published; it is taken in as bytes, so
that little of the probe's own work is in the figure. The plant is the model, stepped here.
"""

from __future__ import annotations

import gc
import json
import sys
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message

from manifold_mpc_ros.config.description import PLAIN, state_description
from manifold_mpc_ros.control.described.state_writer import StateWriter
from manifold_mpc_ros.control.input_gate import NANOSECONDS, StateSample
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lab.recording.bags.contents import stamp_ns_of
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.nodes import messages

STATE_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
TORQUE_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
#: The attitude that each run starts from, about 50 degrees from the setpoint [rad].
START_RAD = (0.6, 0.5, 0.4)
#: The first answer comes within this, solver compiled included [s].
PATIENCE_S = 120.0
#: States per tick where the controller ticks by its own timer.
STATES_PER_TICK = 5
#: Numbers that the controller reports of itself, by their keys on /diagnostics.
KEYS = ('solve_time_us', 'answer_time_us', 'tick_lateness_us', 'tick_time_us', 'missed_ticks')
_WRITER = StateWriter(state_description(PLAIN), ('inertial', 'base_link'))


@dataclass(frozen=True)
class Task:
    """Measure at one rate; ``lockstep``: one state per tick, answered at once."""

    rate_hz: float
    seconds: float
    lockstep: bool
    inertia_kg_m2: tuple[tuple[float, ...], ...]


class Probe:
    """The state publisher, the torque subscription, and what was seen."""

    def __init__(self, task: Task) -> None:
        """Join the domain."""
        self._task = task
        self._period_s = 1.0 / task.rate_hz
        self._inertia = np.array(task.inertia_kg_m2)
        self._R_NB, self._omega, self._torque = so3.exp(np.array(START_RAD)), np.zeros(3), (
            np.zeros(3))
        self._arrived: dict[int, float] = {}
        self._arrivals_s: list[float] = []
        self.reported: dict[str, list[float]] = {key: [] for key in KEYS}
        self._node = Node('latency_probe')
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._publisher = self._node.create_publisher(Odometry, 'odometry', STATE_QOS)
        self._node.create_subscription(
            WrenchStamped, 'torque_command', self._on_torque, TORQUE_QOS, raw=True)
        self._node.create_subscription(
            DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)

    def _on_torque(self, data: bytes) -> None:
        """Note when a torque arrived; the first of a stamp counts."""
        now_s = time.monotonic()
        self._arrived.setdefault(stamp_ns_of(data), now_s)
        self._arrivals_s.append(now_s)
        self._data = data

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Collect what the controller says about its ticks."""
        for status in message.status:
            for pair in status.values:
                if pair.key in self.reported:
                    self.reported[pair.key].append(float(pair.value))

    def publish(self) -> tuple[int, float]:
        """Publish the present state; return its stamp [ns] and when it went out [s]."""
        stamp_ns, message = time.time_ns(), Odometry()
        _WRITER.fill({'odometry': message}, StateSample(stamp_ns, self._R_NB, self._omega))
        now_s = time.monotonic()
        self._publisher.publish(message)
        return stamp_ns, now_s

    def wait_for_controller(self) -> None:
        """Publish until something comes back; raises TimeoutError."""
        end_s = time.monotonic() + PATIENCE_S
        while not self._arrived:
            if time.monotonic() > end_s:
                raise TimeoutError(f'no torque within {PATIENCE_S:.0f} s')
            self.publish()
            self._take_in_until(time.monotonic() + max(0.1, self._period_s))

    def run(self) -> dict[str, Any]:
        """Measure; return latencies and missed ticks as JSON values."""
        gc.collect()
        gc.freeze()
        for values in self.reported.values():
            values.clear()
        return self._run_lockstep() if self._task.lockstep else self._run_on_timer()

    def _run_lockstep(self) -> dict[str, Any]:
        """Publish one state a period; its torque has to come before the next one is due."""
        latencies_s, missed = [], 0
        begin_s, ticks = time.monotonic(), round(self._task.seconds * self._task.rate_hz)
        for tick in range(ticks):
            self._take_in_until(begin_s + tick * self._period_s)
            stamp_ns, out_s = self.publish()
            end_s = begin_s + (tick + 1) * self._period_s
            while stamp_ns not in self._arrived and (left_s := end_s - time.monotonic()) > 0:
                self._executor.spin_once(timeout_sec=left_s)
            if stamp_ns in self._arrived:
                latencies_s.append(self._arrived[stamp_ns] - out_s)
                self._torque = _torque_of(self._data)
            else:
                missed += 1
            self._advance(self._period_s)
        return {'ticks': ticks, 'missed': missed,
                'latencies_us': [round(1e6 * value, 1) for value in latencies_s]}

    def _run_on_timer(self) -> dict[str, Any]:
        """Publish several states a tick; the controller's timer decides when it answers."""
        self._arrivals_s.clear()
        step_s = self._period_s / STATES_PER_TICK
        begin_s = time.monotonic()
        for count in range(round(self._task.seconds / step_s)):
            self._take_in_until(begin_s + count * step_s)
            if self._arrivals_s:
                self._torque = _torque_of(self._data)
            self.publish()
            self._advance(step_s)
        gaps_s = np.diff(self._arrivals_s)
        return {'ticks': len(self._arrivals_s),
                'missed': int(np.sum(np.maximum(np.rint(gaps_s / self._period_s) - 1, 0))),
                'intervals_us': [round(1e6 * value, 1) for value in gaps_s]}

    def _take_in_until(self, time_s: float) -> None:
        """Take in what comes until a time of the monotonic clock."""
        while (left_s := time_s - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left_s)

    def _advance(self, step_s: float) -> None:
        """Step the body under the last torque."""
        self._R_NB, self._omega = lgvi_step(
            self._R_NB, self._omega, self._torque, inertia_kg_m2=self._inertia, step_s=step_s)


def _torque_of(data: bytes) -> np.ndarray:
    """Return the torque of a serialized wrench."""
    return np.array(messages.vector_values(
        deserialize_message(data, WrenchStamped).wrench.torque))


def main(argument: str) -> int:
    """Measure and print; return the exit status."""
    task = Task(**json.loads(argument))
    rclpy.init(args=[])
    probe = Probe(task)
    try:
        probe.wait_for_controller()
        result = probe.run()
    except TimeoutError as error:
        print(error, file=sys.stderr)
        return 1
    finally:
        rclpy.try_shutdown()
    print(json.dumps({**result, 'reported': probe.reported, 'period_ns': round(
        NANOSECONDS / task.rate_hz)}))
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1]))
