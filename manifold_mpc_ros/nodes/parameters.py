# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameter table of a node as ROS parameters: declared, described, ranged, guarded."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.lifecycle import LifecycleNode
from rclpy.parameter import Parameter

from manifold_mpc_ros.config_parameters import ParameterSpec, Value, resolve_parameters
from manifold_mpc_ros.errors import ConfigurationError


class NodeParameters:
    """The parameters of one node.

    Every parameter takes any type at first: a value of the wrong type has to reach the check,
    which names key, value and what is valid, and must not end the process. Read-only ones are
    fixed from the start; the others may be set while the node is unconfigured, and take effect
    when it configures.

    Arguments
    ---------
    node
        Made with ``automatically_declare_parameters_from_overrides=True``.
    specs
        The table of its parameters.
    complete
        Ask for every required parameter (there is a parameter file), or let the shipped values
        stand in.

    """

    def __init__(
        self, node: LifecycleNode, specs: Sequence[ParameterSpec], *, complete: bool,
    ) -> None:
        """Declare what was not given, describe what was."""
        self._node = node
        self._specs = {spec.name: spec for spec in specs}
        self._complete = complete
        self.changeable = True
        self._given = set(node.list_parameters([], 0).names)
        for spec in specs:
            self._declare(spec)
        node.add_on_set_parameters_callback(self._on_set)

    def resolve(self) -> dict[str, Value]:
        """Return one checked value for every parameter; raise ConfigurationError."""
        given = {name: self._read(name) for name in sorted(self._given)}
        return resolve_parameters(
            list(self._specs.values()), given, complete=self._complete)

    def flag(self, name: str) -> bool:
        """Return a boolean parameter; its shipped value when what was given is not one."""
        value = self._read(name)
        return value if isinstance(value, bool) else bool(self._specs[name].default)

    def _declare(self, spec: ParameterSpec) -> None:
        """Declare one parameter, or describe and clean what the command line declared."""
        if spec.name not in self._given:
            self._node.declare_parameter(spec.name, spec.default, _descriptor(spec))
            return
        try:
            checked = spec.check(self._read(spec.name))
        except ConfigurationError:
            return  # resolve() raises it again, when the node configures
        self._node.set_parameters([Parameter(spec.name, value=checked)])
        self._node.set_descriptor(spec.name, _descriptor(spec))

    def _read(self, name: str) -> Any:
        """Return the value of a parameter as plain Python."""
        value = self._node.get_parameter(name).value
        return list(value) if isinstance(value, (array, tuple)) else value

    def _on_set(self, parameters: list[Parameter]) -> SetParametersResult:
        """Accept a change only when it is valid by itself and will take effect."""
        for parameter in parameters:
            spec = self._specs.get(parameter.name)
            if spec is None:
                continue
            if not self.changeable:
                return SetParametersResult(successful=False, reason=(
                    f'{spec.name} is read when the node configures: deactivate and clean up '
                    'first'))
            value = parameter.value
            try:
                spec.check(list(value) if isinstance(value, (array, tuple)) else value)
            except ConfigurationError as error:
                return SetParametersResult(successful=False, reason=str(error))
        self._given.update(
            parameter.name for parameter in parameters if parameter.name in self._specs)
        return SetParametersResult(successful=True)


def _descriptor(spec: ParameterSpec) -> ParameterDescriptor:
    """Return what ``ros2 param describe`` shows."""
    unit = f' [{spec.unit}]' if spec.unit else ''
    descriptor = ParameterDescriptor(
        description=f'{spec.description}{unit}', additional_constraints=spec.valid,
        read_only=spec.read_only, dynamic_typing=True)
    if spec.low is not None and spec.high is not None:
        if spec.kind == 'int':
            descriptor.integer_range = [
                IntegerRange(from_value=int(spec.low), to_value=int(spec.high))]
        else:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=spec.low, to_value=spec.high)]
    return descriptor
