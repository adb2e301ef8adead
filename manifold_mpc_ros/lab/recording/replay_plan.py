# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a replay needs of its bag: the controller's parameters, the feed, what to expect."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.cli import provenance
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.description import PLAIN
from manifold_mpc_ros.config.parameter import (
    Value,
    read_values,
    resolve_parameters,
    with_named,
)
from manifold_mpc_ros.config.tables import CONTROLLER_NAME, CONTROLLER_PARAMETERS
from manifold_mpc_ros.lab.parameter_files import parameter_file_text

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.recording.bags.compare import Comparison
    from manifold_mpc_ros.lab.recording.bags.feed import Feed
    from manifold_mpc_ros.lab.recording.bags.run import BagRun
    from manifold_mpc_ros.lab.recording.bags.series import CommandSeries
    from manifold_mpc_ros.lie.arrays import Array

#: With another build or machine the last bits of a sum may differ, and the iterations with them.
OTHER_BUILD_TOLERANCE_N_M = 1e-9
#: At a pace ticks fall between the states as the scheduler has it.
PACED_TOLERANCE_N_M = 0.05
#: At a pace, part of the ticks that a busy machine may skip.
PACED_MAY_MISS = 0.1


@dataclass(frozen=True, eq=False)
class ReplayPlan:
    """How one bag is given to one controller; ``rate`` None is lockstep."""

    recorded: BagRun
    parameters: Mapping[str, Value]
    feed: Feed
    rate: float | None

    @classmethod
    def of(
        cls, recorded: BagRun, config_file: Path | None, backend: str | None,
        rate: float | None,
    ) -> ReplayPlan:
        """Plan the replay of a bag.

        The controller gets the parameters that it had, or those of a file. Unless the bag proves
        that it was in lockstep, it is replayed as fast as it was recorded, or at the rate given.

        Raises ConfigurationError, and BagError when there is nothing to give.
        """
        from manifold_mpc_ros.lab.recording.bags.feed import feed_of
        parameters = dict(_parameters(recorded, config_file))
        if backend is not None:
            parameters['mpc.backend'] = backend
        config = ControllerConfig.from_parameters(parameters)
        feed = feed_of(recorded, config)
        if rate is None and not recorded.lockstep:
            rate = 1.0 if recorded.scenario is None else recorded.scenario.clock_factor
        if rate is None and len(recorded.commands):
            feed = feed.at(map(int, recorded.commands.stamp_ns))
        elif rate is None:
            feed = feed.every(config.mpc.step_s)
        parameters.update({'lockstep': rate is None, 'autostart': False,
                           'state_source': feed.state_source, 'setpoint_source': PLAIN,
                           'command_sink': PLAIN})
        return cls(recorded, parameters, feed, rate)

    @property
    def step_s(self) -> float:
        """Period of the controller [s]."""
        return ControllerConfig.from_parameters(self.parameters).mpc.step_s

    @property
    def first_tick_ns(self) -> int:
        """Stamp of the state that the first torque to compare answers, or of the first state."""
        answered = self._answers.stamp_ns
        return int(answered[0]) if len(answered) else self.feed.states[0].stamp_ns

    @property
    def _answers(self) -> CommandSeries:
        """The recorded torques that the controller computed, those before any state left out."""
        commands, ticks = self.recorded.commands, self.recorded.ticks
        if self.recorded.lockstep:
            return commands
        idle = {int(tick) - 1 for tick, source in zip(ticks.tick, ticks.source, strict=True)
                if source == 'zero'}
        return commands.without(idle)

    @property
    def may_miss(self) -> float:
        """Part of the torques that may have no answer."""
        return 0.0 if self.rate is None else PACED_MAY_MISS

    @property
    def duration_s(self) -> float:
        """Time from the first state to the last [s]."""
        states = self.feed.states
        return (states[-1].stamp_ns - states[0].stamp_ns) / 1_000_000_000

    def default_tolerance_n_m(self, backend: str) -> float:
        """Return how near the torques have to be; 0 means the same bits.

        A build is the same when the bag notes the same versions (of the sources too), the same
        processor and the same solver backend.
        """
        if self.rate is not None:
            return PACED_TOLERANCE_N_M
        noted = self.recorded.description
        same = bool(noted.versions) and self.recorded.backend == backend \
            and dict(noted.versions) == provenance.versions(noted.versions.get('rmw', ''))
        return 0.0 if same else OTHER_BUILD_TOLERANCE_N_M

    def compare(self, torques: Mapping[int, Array]) -> Comparison:
        """Put the recorded torques beside those of the replay.

        At a pace the nearest answer within half a step counts.
        """
        from manifold_mpc_ros.lab.recording.bags.compare import compare_torques
        within_s = 0.0 if self.rate is None else 0.5 * self.step_s
        return compare_torques(self._answers, torques, within_s)

    def arguments(self, folder: Path) -> list[str]:
        """Write the controller's parameter file; return the ROS arguments to start it with."""
        values: dict[str, Any] = {**self.parameters, 'use_sim_time': self.rate is not None}
        path = folder / f'{CONTROLLER_NAME}.yaml'
        path.write_text(parameter_file_text(CONTROLLER_NAME, values), encoding='utf-8')
        return ['--params-file', str(path)]


def _parameters(recorded: BagRun, config_file: Path | None) -> dict[str, Value]:
    """Return the controller's parameters: of a file, of the recording, or the shipped ones."""
    noted = recorded.description.controller_parameters
    if config_file is None and (noted or recorded.scenario is not None):
        known = {spec.name: noted[spec.name] for spec in with_named(
            CONTROLLER_PARAMETERS, noted) if spec.name in noted}
        scenario = recorded.scenario
        given = {**(scenario.controller_parameters if scenario else {}), **known}
        return resolve_parameters(CONTROLLER_PARAMETERS, given, complete=False)
    path = shared.controller_config_path(config_file)
    return read_values(path, CONTROLLER_NAME, CONTROLLER_PARAMETERS)
