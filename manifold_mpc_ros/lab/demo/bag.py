# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The demo as a bag: recorded beside its own watching, with a scenario made of its files."""

from __future__ import annotations

import argparse
import threading
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import yaml

from manifold_mpc_ros.cli import provenance
from manifold_mpc_ros.config.guidance import GUIDANCE_NAME
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, SIMULATOR_NAME
from manifold_mpc_ros.config.yaml_file import read_parameter_file
from manifold_mpc_ros.errors import BagError
from manifold_mpc_ros.lab.demo.target import TIMEOUT_S
from manifold_mpc_ros.lab.recording.record_plan import TRAJECTORY
from manifold_mpc_ros.lab.recording.scenarios.scenario import (
    DECIDED_AT_SIMULATOR,
    DECIDED_BY_TIME,
)

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.recording.nodes.bag_recorder import BagRecorder

#: Between two looks at what came [s of wall clock].
LOOK_S = 0.05
NAME = 'demo'
#: The recording may lack the last states that the demo itself has seen [s].
SHORT_S = 0.2
#: What each node publishes of a run, by the roles of its topics.
_PUBLISHED = {SIMULATOR_NAME: ('state',), CONTROLLER_NAME: ('torque', 'prediction'),
              GUIDANCE_NAME: ('reference',)}


class DemoBag:
    """A bag of everything under a namespace, recorded in a thread of its own; a context manager.

    A bag that cannot be written does not end the demo: `failure` then says why.
    """

    def __init__(self, path: Path, domain_id: int, namespace: str) -> None:
        """Join the domain; what comes waits in memory until `begin`."""
        from manifold_mpc_ros.lab.recording.bags.writer import BagWriter, remove_bag
        from manifold_mpc_ros.lab.recording.nodes.bag_recorder import BagRecorder
        if path.exists():
            remove_bag(path)
        self.path = path
        self.failure = ''
        self._described = False
        self._namespace = namespace
        self._stack = ExitStack()
        self._writer = self._stack.enter_context(BagWriter(path))
        self._recorder: BagRecorder = self._stack.enter_context(BagRecorder(
            domain_id, self._writer, self._stamped(), {
                '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
                self._roles()['reference']: TRAJECTORY}))
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._record, name=NAME, daemon=True)

    def __enter__(self) -> DemoBag:
        """Return the bag."""
        return self

    def listen(self, nodes: Iterable[str], watch: Callable[[], None]) -> None:
        """Take in what comes from now on; nothing is missed of what these nodes then publish.

        Guidance has published already: the reference that the controller begins with is here too.
        ``watch`` is called at every look, and raises to give up.
        """
        roles = self._roles()
        for node in nodes:
            name = node.rpartition('/')[2]
            self._recorder.meet(node, watch, [roles[role] for role in _PUBLISHED[name]])
            if name == GUIDANCE_NAME:
                self._recorder.until(
                    lambda: self._recorder.count(roles['reference']).received > 0, watch)
        self._thread.start()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close the bag."""
        from manifold_mpc_ros.lab.recording.bags.writer import remove_bag
        self.end()
        try:
            self._stack.close()
            if not self._described:
                remove_bag(self.path)
        except BagError as problem:
            self.failure = self.failure or str(problem)

    def end(self) -> None:
        """Listen no more."""
        self._ended.set()
        if self._thread.is_alive():
            self._thread.join()

    def describe(
        self, files: tuple[Path, Path], arguments: argparse.Namespace, first_ns: int,
        duration_s: float, *, lockstep: bool,
    ) -> None:
        """Write what has come since a stamp, with the scenario that the demo was."""
        from manifold_mpc_ros.lab.recording.bags.contents import CUSTOM_OUTCOME, RunDescription
        controller, simulator = (
            dict(read_parameter_file(file, node)) for file, node in zip(
                files, (CONTROLLER_NAME, SIMULATOR_NAME), strict=True))
        for parameters in (controller, simulator):
            parameters['lockstep'] = lockstep
        if arguments.guidance is not None:
            controller['reference.timeout_s'] = TIMEOUT_S
        # In lockstep the bag may end some states before those that were watched.
        held_s = (self._recorder.count(self._roles()['state']).latest_stamp_ns - first_ns) / 1e9
        text = _scenario(
            controller, simulator, arguments, min(duration_s, held_s), lockstep=lockstep)
        description = RunDescription(
            scenario_name=NAME, scenario_text=text, backend=self._recorder.controller.get(
                'backend', ''), versions=provenance.versions(self._recorder.middleware),
            controller_parameters=controller, simulator_parameters=simulator,
            topics=self._roles())
        self._described = True
        try:
            self._writer.add_description(description, self._recorder.first_receipt_ns)
            self._recorder.begin(first_ns)
            self._recorder.tend()
        except BagError as problem:
            self.failure = str(problem)
        self._writer.add_outcome({CUSTOM_OUTCOME: 'complete'})

    def _record(self) -> None:
        """Take in what comes until the end."""
        while not self._ended.is_set():
            self._recorder.spin(LOOK_S)
            self._recorder.look()

    def _roles(self) -> dict[str, str]:
        """Return the topics of a run under the namespace."""
        inside = {'state': 'odometry', 'torque': 'torque_command',
                  'attitude_setpoint': 'attitude_setpoint',
                  'direction_setpoint': 'direction_setpoint', 'reference': 'reference',
                  'prediction': f'{CONTROLLER_NAME}/prediction'}
        return {role: f'{self._namespace}/{topic}' for role, topic in inside.items()}

    def _stamped(self) -> dict[str, str]:
        """Return the type of each topic whose stamps are the run's time."""
        kinds = {'state': 'nav_msgs/msg/Odometry', 'torque': 'geometry_msgs/msg/WrenchStamped',
                 'prediction': 'nav_msgs/msg/Path'}
        return {self._roles()[role]: kind for role, kind in kinds.items()}


def _scenario(
    controller: dict[str, Any], simulator: dict[str, Any], arguments: argparse.Namespace,
    duration_s: float, *, lockstep: bool,
) -> str:
    """Return the demo as the text of a scenario."""
    step_s = float(controller['mpc.step_s'])
    return str(yaml.safe_dump({
        'description': 'What the demo showed: two processes '
                       + ('in lockstep.' if lockstep else 'in real time.'),
        'duration_s': max(1, int((duration_s - SHORT_S) / step_s)) * step_s,
        'time': {'mode': 'lockstep' if lockstep else 'wall'},
        'controller': _own(controller, DECIDED_BY_TIME),
        'simulator': _own(simulator, DECIDED_AT_SIMULATOR),
        'acceptance': {
            'attitude_tolerance_deg': arguments.attitude_tolerance,
            'rate_tolerance_rad_s': arguments.rate_tolerance,
            'settle_time_s': arguments.duration,
            'final_error_deg': arguments.attitude_tolerance}}, sort_keys=False))


def _own(parameters: dict[str, Any], decided: Mapping[str, str]) -> dict[str, Any]:
    """Return the parameters that a scenario may give."""
    return {name: value for name, value in parameters.items() if name not in decided}
