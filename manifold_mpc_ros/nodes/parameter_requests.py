# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Services that set parameters and change states, for requests that make no sense too.

rclpy lets errors out of its own callbacks, which end the process: a parameter of no known type, a
transition that does not exist in the present state.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.nodes.parameters import NodeParameters

Answer = Callable[[Any, Any], Any]


def make_requests_safe(node: Node, table: NodeParameters) -> None:
    """Answer every request to set parameters with success or the reason, whatever it holds.

    What a parameter has already is no change, so a node takes its own dump.
    """
    def one_by_one(
        request: SetParameters.Request, response: SetParameters.Response,
    ) -> SetParameters.Response:
        response.results = [_set(node, table, [message]) for message in request.parameters]
        return response

    def all_or_nothing(
        request: SetParametersAtomically.Request, response: SetParametersAtomically.Response,
    ) -> SetParametersAtomically.Response:
        response.result = _set(
            node, table, list(request.parameters))
        return response

    answers: dict[type, Answer] = {
        SetParameters: one_by_one, SetParametersAtomically: all_or_nothing}
    for service in node.services:
        service.callback = answers.get(service.srv_type, service.callback)


def make_transitions_safe(node: Node) -> None:
    """Answer a transition that does not exist in the present state with "no success"."""
    service = next(each for each in node.services if each.srv_type is ChangeState)
    change_state = service.callback

    def guarded(
        request: ChangeState.Request, response: ChangeState.Response,
    ) -> ChangeState.Response:
        try:
            return change_state(request, response)
        except RuntimeError as error:
            node.get_logger().warning(' '.join(str(error).split()))
            response.success = False
            return response

    service.callback = guarded


def _set(node: Node, table: NodeParameters, messages: list[Any]) -> SetParametersResult:
    """Set parameters together; a request that cannot be read is refused with the reason."""
    try:
        changes = table.changes([Parameter.from_parameter_msg(message) for message in messages])
        return node.set_parameters_atomically(changes)
    except ConfigurationError as error:
        return SetParametersResult(successful=False, reason=str(error))
    except Exception as error:  # noqa: BLE001  (whatever it was, the sender gets to know)
        reason = ' '.join(f'{type(error).__name__}: {error}'.split())
        return SetParametersResult(successful=False, reason=reason)
    finally:
        table.keep_types(message.name for message in messages)
