# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Service requests and setpoints that a node must outlive, by kind."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from geometry_msgs.msg import Quaternion, QuaternionStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger

from manifold_mpc_ros.lab.fault_injection.nodes.observer import NODES

_NAME_OF = {short: name for name, short in NODES.items()}
#: Requests under way at a time; more wait until some are answered.
_UNDER_WAY = 8
SETPOINT_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)

_DOUBLE, _DOUBLES = ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_DOUBLE_ARRAY
_TEXT, _INTEGER = ParameterType.PARAMETER_STRING, ParameterType.PARAMETER_INTEGER

#: (service type, name behind the node's, request).
Crafted = tuple[type, str, Any]


def _set(*parameters: Parameter) -> Crafted:
    """Return a request to set parameters one by one."""
    return SetParameters, 'set_parameters', SetParameters.Request(parameters=list(parameters))


def _number(name: str, value: float) -> Parameter:
    return Parameter(name=name, value=ParameterValue(type=_DOUBLE, double_value=value))


def _numbers(name: str, *values: float) -> Parameter:
    return Parameter(
        name=name, value=ParameterValue(type=_DOUBLES, double_array_value=list(values)))


def _malformed(draws: random.Random) -> Iterator[Crafted]:
    """Requests that a client library would not write."""
    kinds = (10, 77, 255, draws.randrange(10, 256))
    names = ('mpc.step_s', '', 'limits.max_torque_n_m', 'x' * 60_000, '\U0001f6f0', 'a..b', '.')
    for kind in kinds:
        parameter = Parameter(name=draws.choice(names), value=ParameterValue(type=kind))
        yield _set(parameter)
        yield (SetParametersAtomically, 'set_parameters_atomically',
               SetParametersAtomically.Request(parameters=[parameter, parameter]))
    for name in names:
        yield _set(Parameter(name=name))
        yield GetParameters, 'get_parameters', GetParameters.Request(names=[name] * 50)
        yield (DescribeParameters, 'describe_parameters',
               DescribeParameters.Request(names=[name, name]))
    yield ListParameters, 'list_parameters', ListParameters.Request(
        prefixes=['x' * 1000, ''], depth=2**64 - 1)


def _hostile(draws: random.Random) -> Iterator[Crafted]:
    """Well-formed requests for what must not be."""
    vectors = ('limits.max_torque_n_m', 'limits.max_rate_rad_s', 'mpc.attitude_weight',
               'mpc.torque_weight', 'spacecraft.inertia_kg_m2', 'plant.initial_rate_rad_s')
    bad = (math.nan, -math.inf, -1.0, -1e308)
    for name in vectors:
        value = draws.choice(bad)
        yield _set(_numbers(name, value, value, value))
        yield _set(_numbers(name, 1.0, value))
        yield _set(_numbers(name))
        yield _set(Parameter(name=name, value=ParameterValue(type=_TEXT, string_value='much')))
    for name in ('mpc.step_s', 'mpc.terminal_scale', 'plant.step_s', 'timing.state_period_s'):
        yield _set(_number(name, draws.choice(bad)))
    for name in ('mpc.horizon', 'state_timeout_ticks', 'sensor.seed'):
        for value in (-2**63, 0, 2**63 - 1):
            yield _set(Parameter(name=name, value=ParameterValue(
                type=_INTEGER, integer_value=value)))


def _restored(original: Mapping[str, Any]) -> Iterator[Crafted]:
    """Requests for the values that a node was started with, where they can be changed."""
    for name, value in original.items():
        yield _set(RosParameter(name, value=value).to_parameter_msg())


def _flood(draws: random.Random) -> Iterator[Crafted]:
    """Requests of many parameters that the node does not have."""
    for _ in range(3):
        yield _set(*(_number(f'unknown_{draws.randrange(10**9)}', 1.0) for _ in range(2000)))


def _atomic(_draws: random.Random) -> Iterator[Crafted]:
    """Sets that are right one by one and wrong together, or right but for one."""
    for parameters in (
        [_numbers('limits.max_torque_n_m', 0.9, 0.9, 0.9),
         _numbers('limits.max_rate_rad_s', math.nan, 1.0, 1.0)],
        [_numbers('limits.max_rate_rad_s', 1.1, 1.1, 1.1),
         _numbers('mpc.torque_weight', -1.0, -1.0, -1.0)],
    ):
        yield (SetParametersAtomically, 'set_parameters_atomically',
               SetParametersAtomically.Request(parameters=parameters))


def _transition(number: int, label: str = '') -> Crafted:
    return ChangeState, 'change_state', ChangeState.Request(
        transition=Transition(id=number, label=label))


def _lifecycle_invalid(draws: random.Random) -> Iterator[Crafted]:
    """Transitions that an active node does not have."""
    for number in (Transition.TRANSITION_CREATE, Transition.TRANSITION_CONFIGURE,
                   Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_CLEANUP,
                   Transition.TRANSITION_UNCONFIGURED_SHUTDOWN, 97, 255,
                   draws.randrange(60, 256)):
        yield _transition(number)
    for label in ('no such transition', 'x' * 10_000, '\U0001f6f0'):
        yield _transition(0, label)


def _lifecycle_cycle(_draws: random.Random) -> Iterator[Crafted]:
    """Deactivation and activation."""
    yield _transition(Transition.TRANSITION_DEACTIVATE)
    yield _transition(Transition.TRANSITION_ACTIVATE)


def _resets(_draws: random.Random) -> Iterator[Crafted]:
    """Resets."""
    for _ in range(20):
        yield Trigger, 'reset', Trigger.Request()


def _pauses(_draws: random.Random) -> Iterator[Crafted]:
    """A pause that is over at the end."""
    for _ in range(10):
        yield SetBool, 'pause', SetBool.Request(data=True)
        yield SetBool, 'pause', SetBool.Request(data=False)


_KINDS: dict[str, Callable[[random.Random], Iterator[Crafted]]] = {
    'parameters_malformed': _malformed, 'parameters_hostile': _hostile,
    'parameters_flood': _flood, 'parameters_atomic': _atomic,
    'lifecycle_invalid': _lifecycle_invalid, 'lifecycle_cycle': _lifecycle_cycle,
    'resets': _resets, 'pauses': _pauses,
}


class Requests:
    """Sends a series of requests to a node, a few at a time, until all are answered.

    Setpoints are published instead, one at each look.
    """

    def __init__(self, node: Node) -> None:
        """Belong to a node."""
        self._node = node
        self._clients: dict[tuple[type, str], Any] = {}
        self._setpoints = node.create_publisher(
            QuaternionStamped, '/attitude_setpoint', SETPOINT_QOS)
        self._under_way: list[Any] = []
        self._waiting: Iterator[Crafted] = iter(())
        self._target = ''
        self._in_order = False
        self._publish: Callable[[], None] | None = None

    def begin(
        self, target: str, kind: str, seed: int, inertial_frame_id: str,
        original: Mapping[str, Any],
    ) -> None:
        """Start a series; parameters that it may have changed get their original values back."""
        draws = random.Random(seed)
        self._target, self._under_way = _NAME_OF[target], []
        self._publish = None
        if kind in _KINDS:
            again = _restored(original) if kind.startswith('parameters') else ()
            self._waiting = itertools.chain(_KINDS[kind](draws), again)
            self._in_order = kind in ('lifecycle_cycle', 'pauses')
            return
        self._waiting = iter(())
        make = _bad_setpoint if kind == 'setpoints_bad' else _valid_setpoint
        self._publish = lambda: self._setpoints.publish(make(draws, inertial_frame_id))

    def poll(self) -> None:
        """Send what may be sent now."""
        if self._publish is not None:
            self._publish()
        self._under_way = [future for future in self._under_way if not future.done()]
        while len(self._under_way) < (1 if self._in_order else _UNDER_WAY):
            crafted = next(self._waiting, None)
            if crafted is None:
                return
            kind, name, request = crafted
            self._under_way.append(self._client(kind, name).call_async(request))

    @property
    def answered(self) -> bool:
        """Whether every request of the series has been sent and answered."""
        self.poll()
        return not self._under_way

    def reset(self, target: str) -> Any:
        """Ask a node for its reset; return the future of the answer."""
        self._target = _NAME_OF[target]
        return self._client(Trigger, 'reset').call_async(Trigger.Request())

    def command(self, frame_id: str, x: float, y: float, z: float, w: float) -> None:
        """Publish a commanded attitude."""
        self._setpoints.publish(setpoint(frame_id, x, y, z, w))

    def cease(self) -> None:
        """Publish no more setpoints."""
        self._publish = None

    def ready(self, target: str, kind: str) -> bool:
        """Whether the services of a series are known here."""
        if kind not in _KINDS:
            return True
        self._target = _NAME_OF[target]
        services = {(crafted[0], crafted[1]) for crafted in _KINDS[kind](random.Random(0))}
        clients = [self._client(*service) for service in services]
        return all(client.service_is_ready() for client in clients)

    def _client(self, kind: type, name: str) -> Any:
        """Return the client of a node's service."""
        path = f'/{self._target}/{name}'
        if (kind, path) not in self._clients:
            self._clients[kind, path] = self._node.create_client(kind, path)
        return self._clients[kind, path]


def setpoint(frame_id: str, x: float, y: float, z: float, w: float) -> QuaternionStamped:
    """Return a setpoint message."""
    message = QuaternionStamped(quaternion=Quaternion(x=x, y=y, z=z, w=w))
    message.header.frame_id = frame_id
    return message


def _valid_setpoint(draws: random.Random, frame_id: str) -> QuaternionStamped:
    """Return an attitude drawn evenly."""
    values = [draws.gauss(0.0, 1.0) for _ in range(4)]
    norm = math.hypot(*values)
    return setpoint(frame_id, *(value / norm for value in values))


def _bad_setpoint(draws: random.Random, frame_id: str) -> QuaternionStamped | bytes:
    """Return a setpoint that must be refused, or bytes that are none."""
    return draws.choice([
        setpoint(frame_id, math.nan, 0.0, 0.0, 1.0), setpoint(frame_id, 0.0, 0.0, 0.0, 0.0),
        setpoint(frame_id, 0.0, 0.0, math.inf, 1.0), setpoint(frame_id, 3.0, 0.0, 0.0, 4.0),
        setpoint('', 0.0, 0.0, 0.0, 1.0), setpoint('odom', 0.0, 0.0, 0.0, 1.0),
        setpoint('x' * 60_000, 0.0, 0.0, 0.0, 1.0), b'\0\1\0\0' + draws.randbytes(48),
        b'\0\1\0\0', b'\0\1\0\0' + b'\xff' * 64])


