# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An observer of the closed loop: records states and commands, remembers the latest mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry

from manifold_mpc_ros.config.description import PLAIN, state_description
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, SIMULATOR_NAME
from manifold_mpc_ros.control.described.source import DescribedSource
from manifold_mpc_ros.control.input_gate import NANOSECONDS, RawState
from manifold_mpc_ros.lab.recording.nodes.listener import Listener, Watch
from manifold_mpc_ros.lab.recording.nodes.raw import DEEP_QOS
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array, IntArray
from manifold_mpc_ros.nodes import messages

NODE_NAME = 'manifold_mpc_recorder'


@dataclass(frozen=True, eq=False)
class StateHistory:
    """What was seen: n states and m commands; time 0 is the state that is answered first."""

    stamp_ns: IntArray    # (n,) of the states [ns]
    state_time_s: Array   # (n,) stamps [s]
    R_NB: Array           # (n, 3, 3)
    omega_BN_B: Array     # (n, 3) [rad/s]
    torque_time_s: Array  # (m,) stamps of the states that the commands answer [s]
    torque_B_n_m: Array   # (m, 3)


class Recorder(Listener):
    """Listens to ``odometry``, ``torque_command`` and the controller's diagnostics."""

    def __init__(self, domain_id: int, namespace: str = '') -> None:
        """Join a domain and subscribe to the topics of a namespace, '' or ``/name``."""
        super().__init__(NODE_NAME, domain_id)
        self.controller, self.simulator = (
            f'{namespace}/{name}'.strip('/') for name in (CONTROLLER_NAME, SIMULATOR_NAME))
        self._state_topic = f'{namespace}/odometry'
        self._torque_topic = f'{namespace}/torque_command'
        for kind, topic, callback in (
            (Odometry, self._state_topic, self._on_odometry),
            (WrenchStamped, self._torque_topic, self._on_torque),
            (DiagnosticArray, '/diagnostics', self._on_diagnostics),
        ):
            self.subscribe(kind, topic, callback, DEEP_QOS)
        self._source = DescribedSource(state_description(PLAIN))
        self._stamps_ns: list[int] = []
        self._attitudes: list[Array] = []
        self._rates: list[tuple[float, float, float]] = []
        self._torque_stamps_ns: list[int] = []
        self._torques: list[tuple[float, float, float]] = []
        self.mode = ''
        self.solver: dict[str, str] = {}

    def __enter__(self) -> Recorder:
        """Return the recorder."""
        return self

    def meet_both(self, watch: Watch) -> None:
        """Wait until no state and no command is missed any more; the controller is configured."""
        self.meet(self.simulator, watch, [self._state_topic])
        self.meet(self.controller, watch, [self._torque_topic])

    @property
    def states(self) -> int:
        """Number of states seen."""
        return len(self._stamps_ns)

    @property
    def commands(self) -> int:
        """Number of torque commands seen."""
        return len(self._torques)

    @property
    def first_ns(self) -> int:
        """Stamp of the state that is answered first, of the first one while none is."""
        answers_ns = sorted(set(self._stamps_ns).intersection(self._torque_stamps_ns))
        seen_ns = answers_ns or self._stamps_ns
        return seen_ns[0] if seen_ns else 0

    def latest_state(self) -> tuple[int, Array, Array]:
        """Return stamp [ns], attitude and body rate of the last state."""
        return self._stamps_ns[-1], self._attitudes[-1], np.array(self._rates[-1])

    def latest_torque(self) -> Array:
        """Return the last torque seen (3,) [N m]."""
        return np.array(self._torques[-1])

    def history(self) -> StateHistory:
        """Return everything seen so far as arrays."""
        first_ns = self.first_ns
        return StateHistory(
            stamp_ns=np.array(self._stamps_ns, dtype=np.int64),
            state_time_s=_seconds(self._stamps_ns, first_ns),
            R_NB=np.array(self._attitudes).reshape(-1, 3, 3),
            omega_BN_B=np.array(self._rates).reshape(-1, 3),
            torque_time_s=_seconds(self._torque_stamps_ns, first_ns),
            torque_B_n_m=np.array(self._torques).reshape(-1, 3),
        )

    def _on_odometry(self, message: Odometry) -> None:
        """Record a state."""
        state = self._source.read('odometry', message, 0)
        if not isinstance(state, RawState):
            return
        x, y, z, w = state.quaternion_xyzw
        self._stamps_ns.append(state.stamp_ns)
        self._attitudes.append(so3.rotation_from_quaternion([w, x, y, z]))
        self._rates.append(state.omega_BN_B)

    def _on_torque(self, message: WrenchStamped) -> None:
        """Record a command."""
        self._torque_stamps_ns.append(messages.nanoseconds(message.header.stamp))
        self._torques.append(messages.vector_values(message.wrench.torque))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Remember what the controller last said about itself."""
        for status in message.status:
            if status.name == self.controller:
                self.solver = {pair.key: pair.value for pair in status.values}
                self.mode = self.solver.get('mode', '')


def _seconds(stamps_ns: list[int], first_ns: int) -> Array:
    """Return stamps as seconds since the first state."""
    return np.array([(stamp_ns - first_ns) / NANOSECONDS for stamp_ns in stamps_ns])
