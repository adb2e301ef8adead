# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters that change while the controller acts: another law, between two ticks."""

from __future__ import annotations

from collections.abc import Callable

from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.control.command import Law
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.nodes.controller.background_build import Rebuild
from manifold_mpc_ros.nodes.controller.law_factory import designed_elsewhere
from manifold_mpc_ros.nodes.parameters import NodeParameters
from manifold_mpc_ros.terminal.design import TerminalDesign


class LawChanges:
    """Builds the law that new parameters ask for, in the background, and hands it over.

    Arguments
    ---------
    table
        The node's parameters. A set that cannot be configured is refused at once; one that can,
        but whose law cannot be built, is taken back.
    build
        Makes the law of a terminal design that is ready; called in a thread.

    """

    def __init__(
        self, table: NodeParameters, build: Callable[[ControllerConfig, TerminalDesign], Law],
    ) -> None:
        """Take new sets of parameters from now on."""
        self._table = table
        self._build = build
        self._rebuild: Rebuild[tuple[dict[str, Value], ControllerConfig, Law]] = Rebuild()
        table.take_at_run_time(ControllerConfig.from_parameters, self._request)

    def begin(self, values: dict[str, Value]) -> None:
        """Note the values that are in force; leave aside what was being built."""
        self._rebuild.forget()
        self._values = values
        self._refused = ''
        self._count = 0

    def take(self) -> tuple[ControllerConfig, Law] | ManifoldMpcError | None:
        """Return the law that is ready, or why there is none, once; None when there is no news."""
        built = self._rebuild.poll()
        if built is None:
            return None
        if isinstance(built, ManifoldMpcError):
            self._refused = f'refused: {built}'
            self._table.restore(self._values)
            return built
        self._values, config, law = built
        self._refused = ''
        self._count += 1
        return config, law

    def values(self) -> dict[str, object]:
        """Return the figures by their keys on /diagnostics."""
        state = 'building' if self._rebuild.building else self._refused or 'none'
        return {'parameter_change': state, 'parameter_changes': self._count}

    def _request(self, values: dict[str, Value]) -> None:
        """Build what a set of parameters asks for."""
        config = ControllerConfig.from_parameters(values)
        self._rebuild.request(
            lambda: (values, config, self._build(config, designed_elsewhere(config))))
