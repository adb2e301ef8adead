# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameter table of a node as ROS parameters: declared, described, ranged, guarded."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.lifecycle import LifecycleNode
from rclpy.parameter import Parameter

from manifold_mpc_ros.config.parameter import (
    ROS_PARAMETERS,
    ParameterSpec,
    Value,
    resolve_parameters,
    with_named,
)
from manifold_mpc_ros.errors import ConfigurationError

USE_SIM_TIME = ROS_PARAMETERS[0]


class NodeParameters:
    """The parameters of one node.

    Every parameter takes any type at first: a value of the wrong type has to reach the check,
    which names key, value and what is valid, and must not end the process. What is accepted has
    the type of the table. While the node is unconfigured each may be set, checked by itself, and
    takes effect when it configures. After that the read-only ones are fixed, and the others may be
    set only where the node takes whole new sets, and only such a set as could be configured.

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
        self._given = set(node.list_parameters([], 0).names)
        specs = self._with_named(specs)
        self._specs = {spec.name: spec for spec in specs}
        self._complete = complete
        self._check: Callable[[dict[str, Value]], object] | None = None
        self._restoring = False
        for spec in specs:
            self._declare(spec)
        self.changeable = True
        node.add_on_set_parameters_callback(self._on_set)

    def _with_named(self, specs: Sequence[ParameterSpec]) -> Sequence[ParameterSpec]:
        """Return the table with what the names that were given bring."""
        given = {spec.name: self._read(spec.name) for spec in specs
                 if spec.each and spec.name in self._given}
        try:
            return with_named(specs, given)
        except ConfigurationError:
            return specs  # resolve() raises it again, when the node configures

    @property
    def changeable(self) -> bool:
        """Whether every parameter may be set: the node is not configured."""
        return self._changeable

    @changeable.setter
    def changeable(self, changeable: bool) -> None:
        """Let the descriptors say from now on what is read-only."""
        self._changeable = changeable
        for name in [*self._specs, USE_SIM_TIME]:
            # rclpy replaces no descriptor that is read-only, so it is changed in its place.
            self._node.describe_parameter(name).read_only = not changeable and self._fixed(name)

    def _fixed(self, name: str) -> bool:
        """Whether a parameter is read when the node configures, and not again."""
        spec = self._specs.get(name)
        return name in ROS_PARAMETERS if spec is None else spec.read_only or self._check is None

    def changes(self, parameters: Sequence[Parameter]) -> list[Parameter]:
        """Return those of a request that change something, in the types of the table.

        Raises ConfigurationError for one that is read-only now.
        """
        typed = list(map(self._typed, parameters))
        changed = [each for each in typed if not self._has(each)]
        self._given.update(each.name for each in typed if each.name in self._specs
                           and each not in changed)
        for each in changed:
            if not self.changeable and self._fixed(each.name):
                raise ConfigurationError(each.name, _plain(each.value), (
                    'no change now: it is read when the node configures, so deactivate and clean '
                    'up first'))
        return changed

    def keep_types(self, names: Iterable[str]) -> None:
        """Describe parameters by the values that they have; rclpy by what was asked for."""
        for name in filter(self._node.has_parameter, names):
            kind = self._node.get_parameter(name).type_
            self._node.describe_parameter(name).type = int(kind.value)

    def _typed(self, parameter: Parameter) -> Parameter:
        """Return a parameter in the type of the table, as it is where its value is not valid."""
        spec = self._specs.get(parameter.name)
        try:
            return parameter if spec is None else Parameter(
                parameter.name, value=spec.check(_plain(parameter.value)))
        except ConfigurationError:
            return parameter

    def _has(self, parameter: Parameter) -> bool:
        """Whether a parameter has this value already."""
        present = self._node.get_parameter_or(parameter.name)
        return (self._node.has_parameter(parameter.name) and present.type_ is parameter.type_
                and bool(_plain(present.value) == _plain(parameter.value)))

    def resolve(self) -> dict[str, Value]:
        """Return one checked value for every parameter; raise ConfigurationError."""
        return self._resolved({})

    def flag(self, name: str) -> bool:
        """Return a boolean parameter; its shipped value when what was given is not one."""
        value = self._read(name)
        return value if isinstance(value, bool) else bool(self._specs[name].default)

    def take_at_run_time(
        self, check: Callable[[dict[str, Value]], object],
        apply: Callable[[dict[str, Value]], None],
    ) -> None:
        """Accept whole sets that ``check`` lets pass while configured, then hand them over."""
        def applied(parameters: list[Parameter]) -> None:
            own = any(parameter.name in self._specs for parameter in parameters)
            if own and not self.changeable and not self._restoring:
                apply(self.resolve())

        self._check = check
        self._node.add_post_set_parameters_callback(applied)

    def restore(self, values: Mapping[str, Value]) -> None:
        """Return to values that were in force before, without handing them over again."""
        self._restoring = True
        try:
            self._node.set_parameters_atomically(self.changes([
                Parameter(name, value=value) for name, value in values.items()]))
        finally:
            self._restoring = False

    def _resolved(self, changes: Mapping[str, Any]) -> dict[str, Value]:
        """Return one checked value for every parameter, some of them changed."""
        given = {name: self._read(name) for name in sorted(self._given)} | dict(changes)
        return resolve_parameters(
            list(self._specs.values()), given, complete=self._complete)

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
        return _plain(self._node.get_parameter(name).value)

    def _on_set(self, parameters: list[Parameter]) -> SetParametersResult:
        """Accept a change only when it is valid and will take effect: all of it, or nothing."""
        changes = {parameter.name: _plain(parameter.value) for parameter in parameters}
        own = {name: value for name, value in changes.items() if name in self._specs}
        try:
            if '' in changes:  # rclpy takes it for one that is declared
                raise ConfigurationError('parameter', '', 'a name')
            for name, value in own.items():
                self._specs[name].check(value)
            if own and not self.changeable and self._check is not None:
                self._check(self._resolved(own))
        except ConfigurationError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._given.update(own)
        return SetParametersResult(successful=True)


def _plain(value: Any) -> Any:
    """Return arrays as lists."""
    return list(value) if isinstance(value, (array, tuple)) else value


def _descriptor(spec: ParameterSpec) -> ParameterDescriptor:
    """Return what ``ros2 param describe`` shows."""
    unit = f' [{spec.unit}]' if spec.unit else ''
    descriptor = ParameterDescriptor(
        description=f'{spec.description}{unit}', additional_constraints=spec.valid,
        dynamic_typing=True)
    if spec.low is not None and spec.high is not None:
        if spec.kind == 'int':
            descriptor.integer_range = [
                IntegerRange(from_value=int(spec.low), to_value=int(spec.high))]
        else:
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=spec.low, to_value=spec.high)]
    return descriptor
