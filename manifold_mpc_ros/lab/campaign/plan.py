# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A campaign: controller, body and sets of cases, read from YAML and checked as a whole."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig, SimulatorConfig
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.parameter import Value, resolve_parameters
from manifold_mpc_ros.config.tables import (
    CONTROLLER_NAME,
    CONTROLLER_PARAMETERS,
    SIMULATOR_PARAMETERS,
)
from manifold_mpc_ros.config.yaml_file import parse_mapping, read_parameter_file, read_text
from manifold_mpc_ros.dynamics.inertia import largest_guaranteed_rate
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.campaign.keys import CAMPAIGN_GROUPS, CAMPAIGN_KEYS, MODEL, PLANT
from manifold_mpc_ros.lab.campaign.sets import CaseSet, Limits
from manifold_mpc_ros.lab.recording.scenarios.changes import named, parameter_changes
from manifold_mpc_ros.lab.recording.scenarios.keys import check_group
from manifold_mpc_ros.lab.recording.scenarios.parts import as_mapping

#: Simulator parameters that are not a campaign's to change, and what decides them.
DECIDED = {
    **dict.fromkeys(('plant.initial_attitude_xyzw', 'plant.initial_rate_rad_s',
                     'plant.disturbance_torque_n_m', 'sensor.attitude_noise_std_rad',
                     'sensor.rate_noise_std_rad_s', 'sensor.seed'), 'the set'),
    **dict.fromkeys(('timing.control_period_s', 'timing.state_period_s'), 'mpc.step_s'),
    **dict.fromkeys(('timing.publish_clock', 'timing.real_time_factor', 'lockstep'),
                    'the campaign, which runs in process,'),
}
#: Simulator parameters that are the controller's unless the campaign changes them.
OF_THE_MODEL = ('spacecraft.inertia_kg_m2', 'limits.max_torque_n_m')


@dataclass(frozen=True)
class CampaignPlan:
    """Everything that the table of a campaign is a function of.

    ``controller`` holds every controller parameter by its dotted ROS name, ``simulator`` the
    changes to the shipped ones.

    Raises ConfigurationError from the constructors; names the key, its value and what would be
    valid.
    """

    name: str
    description: str
    seed: int
    duration_s: float
    controller: Mapping[str, Value]
    simulator: Mapping[str, Value]
    sets: tuple[CaseSet, ...]

    @classmethod
    def from_yaml(cls, path: str | Path, controller: str | Path | None = None) -> CampaignPlan:
        """Read a campaign file, named after the file.

        Its changes to the controller are to the parameter file ``controller``, or to the shipped
        parameters when there is none.
        """
        base = {} if controller is None else read_parameter_file(controller, CONTROLLER_NAME)
        return cls.from_text(read_text(path, 'campaign'), Path(path).stem, str(path), base)

    @classmethod
    def from_text(cls, text: str, name: str, source: str = 'campaign',
                  base: Mapping[str, Any] | None = None) -> CampaignPlan:
        """Read a campaign from YAML text; ``source`` is what messages call it."""
        values = check_group(
            CAMPAIGN_KEYS, CAMPAIGN_GROUPS, parse_mapping(text, 'campaign', source), '')
        acceptance = Limits().changed(as_mapping(values.get('acceptance')), 'acceptance.')
        changes = parameter_changes(
            'controller', CONTROLLER_PARAMETERS, as_mapping(values.get('controller')), {})
        plan = cls(
            name=name, description=' '.join(str(values['description']).split()),
            seed=values.get('seed', 0), duration_s=values['duration_s'],
            controller=resolve_parameters(
                CONTROLLER_PARAMETERS, {**(base or {}), **changes}, complete=bool(base)),
            simulator=parameter_changes(
                'simulator', SIMULATOR_PARAMETERS, as_mapping(values.get('simulator')), DECIDED),
            sets=tuple(CaseSet.from_mapping(item, f'sets[{place}].', acceptance)
                       for place, item in enumerate(values.get('sets', ()))))
        plan.check()
        return plan

    @cached_property
    def node(self) -> ControllerConfig:
        """The controller's configuration as its node has it."""
        return named('controller', lambda: ControllerConfig.from_parameters(self.controller))

    @property
    def config(self) -> AttitudeMpcConfig:
        """The control law."""
        return self.node.mpc

    @cached_property
    def body(self) -> SimulatorConfig:
        """The plant before anything is drawn."""
        period = {name: self.config.step_s for name, by in DECIDED.items() if by == 'mpc.step_s'}
        model = {name: self.controller[name] for name in OF_THE_MODEL}
        values = resolve_parameters(
            SIMULATOR_PARAMETERS, {**model, **self.simulator, **period}, complete=False)
        return named('simulator', lambda: SimulatorConfig.from_parameters(values))

    @property
    def steps(self) -> int:
        """Control steps of a loop."""
        return round(self.duration_s / self.config.step_s)

    @property
    def digest(self) -> str:
        """A number that two plans share when each case is the same in both, however many run."""
        described = self.as_mapping()
        for one in described['sets']:
            del one['loops']
        del described['description']
        return hashlib.sha256(json.dumps(described).encode()).hexdigest()

    def place_of(self, set_name: str) -> int:
        """Return which of the sets has a name; raises ConfigurationError."""
        names = [one.name for one in self.sets]
        if set_name not in names:
            raise ConfigurationError('set', set_name, 'one of ' + ', '.join(map(repr, names)))
        return names.index(set_name)

    def with_loops(self, set_name: str | None, loops: int) -> CampaignPlan:
        """Return the plan with another number of loops in one set, in every one for None."""
        if set_name is not None:
            self.place_of(set_name)
        return replace(self, sets=tuple(
            replace(one, loops=loops) if set_name in (None, one.name) else one
            for one in self.sets))

    def as_mapping(self) -> dict[str, Any]:
        """Return a campaign file that says all of it."""
        return {
            'description': self.description, 'seed': self.seed, 'duration_s': self.duration_s,
            'controller': dict(self.controller), 'simulator': dict(self.simulator),
            'sets': [one.as_mapping() for one in self.sets]}

    def as_yaml(self) -> str:
        """Return the text of that file; `from_text` reads the same plan from it."""
        return yaml.safe_dump(self.as_mapping(), sort_keys=False, allow_unicode=True, width=99)

    def check(self) -> None:
        """Refuse what does not fit together."""
        step_s = self.config.step_s
        ratio = self.duration_s / step_s
        if round(ratio) < 1 or not math.isclose(ratio, round(ratio), rel_tol=1e-9):
            raise ConfigurationError(
                'duration_s', self.duration_s, f'a multiple of the control step {step_s:g} s')
        if not self.sets:
            raise ConfigurationError('sets', [], 'a list of at least one set')
        names = [one.name for one in self.sets]
        for place, one in enumerate(self.sets):
            if one.name in names[:place]:
                raise ConfigurationError(
                    f'sets[{place}].name', one.name, 'a name that no other set has')
            self._check_rates(one, f'sets[{place}].rate.')
            if one.cones is not None:
                try:
                    self.config.between_samples  # noqa: B018 (refuses limits that bound nothing)
                except ConfigurationError as error:
                    raise ConfigurationError(
                        f'sets[{place}].cones', asdict(one.cones), error.valid) from None
        if any(one.body == PLANT for one in self.sets):
            self.body  # noqa: B018 (reads and checks it)

    def _check_rates(self, one: CaseSet, prefix: str) -> None:
        """Refuse rates from which the model has no guaranteed free step."""
        if one.body != MODEL:
            return
        most = largest_guaranteed_rate(self.config.inertia_kg_m2, self.config.step_s)
        rate = one.rate
        if rate.kind == 'normal':
            raise ConfigurationError(
                f'{prefix}kind', rate.kind, f'another kind, or body: {PLANT} (the model has no '
                'step from rates without bound)')
        largest = rate.largest_rad_s or float(np.linalg.norm(rate.rad_s or 0.0))
        if largest >= most:
            key = 'largest_rad_s' if rate.kind == 'ball' else 'rad_s'
            raise ConfigurationError(
                f'{prefix}{key}', getattr(rate, key),
                f'below {most:.4g} rad/s, where the step of this body exists')
