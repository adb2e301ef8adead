# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of faults, second part: processes, requests, strangers on the domain."""

from __future__ import annotations

import signal

from manifold_mpc_ros.lab.fault_injection.fault import (
    CONTROLLER,
    SIMULATOR,
    STATE,
    TORQUE,
    BadStart,
    Datagrams,
    Expectation,
    Fault,
    Hogs,
    MisfitSubscriber,
    Requests,
    Signal,
)

QOS = 'QoS mismatch'
PARAMETERS = 'wrong-typed, NaN, contradictory or structural parameter at run time'
YAML = 'YAML error'
KILLED = 'controller killed or hung'
TERMINATED = 'SIGTERM, SIGINT'
RESTART = 'restart of either node'
STARVED = 'CPU starvation'
SETPOINTS = 'NaN or Inf in state, setpoint, time'
REQUESTS = 'malformed requests'

#: A node takes so long to start on a loaded machine, discovery included [s].
START_S = 20.0
RESTARTED = Expectation(silent=True, recovery_s=START_S)

PROCESS_FAULTS = (
    Fault('controller-killed', 'SIGKILL; a supervisor starts it again', KILLED,
          Signal(CONTROLLER, signal.SIGKILL), Expectation(
              counters=('simulator.expired_commands',), silent=True, recovery_s=START_S)),
    Fault('simulator-killed', 'SIGKILL; a supervisor starts it again', RESTART,
          Signal(SIMULATOR, signal.SIGKILL), Expectation(
              modes=frozenset({'HOLD', 'FALLBACK', 'COAST', 'WAIT'}), recovery_s=START_S)),
    Fault('controller-terminated', 'SIGTERM; a supervisor starts it again', TERMINATED,
          Signal(CONTROLLER, signal.SIGTERM, exit_status=0), RESTARTED),
    Fault('controller-interrupted', 'SIGINT; a supervisor starts it again', TERMINATED,
          Signal(CONTROLLER, signal.SIGINT, exit_status=0), RESTARTED),
    Fault('simulator-terminated', 'SIGTERM; a supervisor starts it again', TERMINATED,
          Signal(SIMULATOR, signal.SIGTERM, exit_status=0), Expectation(recovery_s=START_S)),
    Fault('controller-stopped', 'SIGSTOP for 0.5 s, then SIGCONT', KILLED,
          Signal(CONTROLLER, signal.SIGSTOP), Expectation(
              counters=('simulator.expired_commands',), silent=True, recovery_s=2.0)),
    Fault('simulator-stopped', 'SIGSTOP for 0.5 s, then SIGCONT', KILLED,
          Signal(SIMULATOR, signal.SIGSTOP), Expectation(
              modes=frozenset({'HOLD', 'FALLBACK', 'COAST'}), recovery_s=2.0)),
    Fault('simulated-time-restart', 'SIGKILL of the simulator: its time begins again', RESTART,
          Signal(SIMULATOR, signal.SIGKILL), Expectation(silent=True, recovery_s=START_S),
          simulated_time=True),
    Fault('controller-bad-start', 'killed, started with a mistake in its file, then rightly',
          YAML, BadStart(CONTROLLER, {'mpc.horizon': 'many'}), RESTARTED),
    Fault('simulator-bad-start', 'killed, started with a mistake in its file, then rightly',
          YAML, BadStart(SIMULATOR, {'plant.step_s': -1.0}), Expectation(recovery_s=START_S)),
    Fault('hogs', 'eight processes that compute as fast as they can', STARVED, Hogs(8),
          Expectation(silent=True, recovery_s=4.0), duration_s=1.0),
)

REQUEST_FAULTS = (
    *(Fault(f'{node}-parameters-{kind}', does, PARAMETERS, Requests(node, f'parameters_{kind}'))
      for node in (CONTROLLER, SIMULATOR) for kind, does in (
          ('malformed', 'set_parameters with types that do not exist, empty and endless names'),
          ('hostile', 'NaN, infinite, negative, contradictory and structural values'),
          ('flood', 'thousands of unknown parameters in one request'))),
    Fault('parameters-atomic', 'contradictory sets, to be taken as a whole or not at all',
          PARAMETERS, Requests(CONTROLLER, 'parameters_atomic')),
    *(Fault(f'{node}-lifecycle-invalid', 'transitions that do not exist, or not from here',
            REQUESTS, Requests(node, 'lifecycle_invalid')) for node in (CONTROLLER, SIMULATOR)),
    Fault('controller-cycled', 'deactivated and activated again', REQUESTS,
          Requests(CONTROLLER, 'lifecycle_cycle'),
          Expectation(silent=True, recovery_s=4.0, surplus=3)),
    Fault('reset-storm', '~/reset as fast as it is answered', REQUESTS,
          Requests(CONTROLLER, 'resets'), Expectation(recovery_s=2.0)),
    Fault('pause-storm', '~/pause on and off', REQUESTS, Requests(CONTROLLER, 'pauses'),
          Expectation(modes=frozenset({'PAUSED'}), recovery_s=2.0)),
    Fault('setpoints-bad', 'setpoints with NaN, zero, frames and bytes of every bad kind',
          SETPOINTS, Requests(CONTROLLER, 'setpoints_bad'),
          Expectation(counters=('controller.refused.attitude_setpoint.*',))),
    Fault('setpoint-storm', 'another valid setpoint every few milliseconds', REQUESTS,
          Requests(CONTROLLER, 'setpoint_storm')),
    Fault('controller-datagrams', 'noise and damaged RTPS to the UDP ports of the process',
          REQUESTS, Datagrams(CONTROLLER)),
    Fault('simulator-datagrams', 'noise and damaged RTPS to the UDP ports of the process',
          REQUESTS, Datagrams(SIMULATOR)),
    Fault('torque-misfit', 'a subscriber asks for durability that the command lacks', QOS,
          MisfitSubscriber(TORQUE), Expectation(counters=('controller.incompatible_qos_ends.*',))),
    Fault('state-misfit', 'a subscriber asks for durability that the state lacks', QOS,
          MisfitSubscriber(STATE), Expectation(counters=('simulator.incompatible_qos_ends.*',))),
)
