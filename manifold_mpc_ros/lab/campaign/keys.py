# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The keys of a campaign file: one table for each group, as for scenarios."""

from __future__ import annotations

from collections.abc import Iterator

from manifold_mpc_ros.config.parameter import ParameterSpec
from manifold_mpc_ros.lab.recording.scenarios.keys import ACCEPTANCE_KEYS

MODEL, PLANT = 'model', 'plant'

#: Groups at the top: name, whether it is a list, meaning.
CAMPAIGN_GROUPS: dict[str, tuple[bool, str]] = {
    'controller': (False, 'changes to the controller parameters, by ROS parameter name'),
    'simulator': (False, 'changes to the shipped config/simulator.yaml, for body: plant'),
    'acceptance': (False, 'what every loop has to keep; what is left out is not judged'),
    'sets': (True, 'the sets of loops, each with what it draws'),
}
#: Groups of a set.
SET_GROUPS: dict[str, tuple[bool, str]] = {
    'attitude': (False, 'initial attitude, seen from the commanded one'),
    'rate': (False, 'initial body rate'),
    'setpoint': (False, 'commanded attitude'),
    'inertia': (False, 'how the body differs from the model (body: plant)'),
    'disturbance': (False, 'constant torque that no model knows of (body: plant)'),
    'noise': (False, 'noise of the sensors (body: plant)'),
    'cones': (False, 'cones beside those of the controller'),
    'acceptance': (False, 'changes to the acceptance of the whole campaign'),
}
#: Of the groups of a set that have ``kind``: the key that each kind takes, None for none.
KINDS: dict[str, dict[str, str | None]] = {
    'attitude': {'uniform': None, 'angle': 'angle_deg', 'half_turn': None, 'fixed': 'xyzw'},
    'rate': {'rest': None, 'ball': 'largest_rad_s', 'normal': 'std_rad_s', 'fixed': 'rad_s'},
    'setpoint': {'identity': None, 'uniform': None, 'fixed': 'xyzw'},
}

CAMPAIGN_KEYS = (
    ParameterSpec('description', 'str', 'a campaign', 'what it is and why, in a sentence or two',
                  required=True),
    ParameterSpec('seed', 'int', 0, 'a case depends on this, its set and its index alone', low=0,
                  high=2**31 - 1),
    ParameterSpec('duration_s', 'float', 30.0,
                  'length of each loop, a multiple of mpc.step_s', unit='s', low=1e-3, high=1e6,
                  required=True),
)
SET_KEYS = (
    ParameterSpec('name', 'str', 'random', 'what its cases are called, NAME-0, NAME-1, ...',
                  required=True),
    ParameterSpec('loops', 'int', 1000, 'number of cases', low=0, high=10**9 - 1, required=True),
    ParameterSpec('body', 'str', MODEL,
                  "model: the controller's own, which the theory speaks about; plant: the "
                  "simulator's, with its own step, inertia, disturbance and noise",
                  choices=(MODEL, PLANT)),
)
_XYZW = 'as x, y, z, w'
ATTITUDE_KEYS = (
    ParameterSpec('kind', 'str', 'uniform',
                  'uniform: on SO(3); angle: about a uniform axis by an angle uniform in '
                  'angle_deg; half_turn: exactly 180 degrees, about the principal axes, then '
                  'uniform ones (for pointing the exact antipode); fixed: xyzw',
                  choices=tuple(KINDS['attitude']), required=True),
    ParameterSpec('angle_deg', 'floats', [0.0, 180.0], 'least and largest angle', unit='deg',
                  lengths=(2,)),
    ParameterSpec('xyzw', 'floats', [0.0, 0.0, 1.0, 0.0], f'the attitude {_XYZW}', unit='1',
                  lengths=(4,)),
)
RATE_KEYS = (
    ParameterSpec('kind', 'str', 'rest',
                  'rest; ball: uniform in a ball; normal: normal about each body axis (body: '
                  'plant); fixed: rad_s', choices=tuple(KINDS['rate']), required=True),
    ParameterSpec('largest_rad_s', 'float', 0.3, 'radius of the ball', unit='rad/s', low=0.0,
                  high=1e3),
    ParameterSpec('std_rad_s', 'floats', [0.1], 'standard deviation, one or by axis',
                  unit='rad/s', lengths=(1, 3)),
    ParameterSpec('rad_s', 'floats', [0.0, 0.0, 0.0], 'the rate', unit='rad/s', lengths=(3,)),
)
SETPOINT_KEYS = (
    ParameterSpec('kind', 'str', 'identity', 'identity; uniform: on SO(3); fixed: xyzw',
                  choices=tuple(KINDS['setpoint']), required=True),
    ParameterSpec('xyzw', 'floats', [0.0, 0.0, 0.0, 1.0],
                  f'the attitude, body to inertial, {_XYZW}', unit='1', lengths=(4,)),
)
INERTIA_KEYS = (
    ParameterSpec('moments_part', 'float', 0.0,
                  'each principal moment times a factor uniform from 1 - part to 1 + part',
                  unit='1', low=0.0, high=0.9),
    ParameterSpec('axes_deg', 'float', 0.0,
                  'the principal axes turned about a uniform axis by an angle uniform up to this',
                  unit='deg', low=0.0, high=180.0),
)
DISTURBANCE_KEYS = (
    ParameterSpec('largest_n_m', 'float', 0.0, 'radius of the ball that it is uniform in',
                  unit='N m', low=0.0, high=1e6, required=True),
    ParameterSpec('frame', 'str', 'body', 'components in which it is constant',
                  choices=('body', 'inertial')),
)
NOISE_KEYS = (
    ParameterSpec('attitude_std_rad', 'floats', [0.0],
                  'standard deviation about each body axis, or the ends of its range',
                  unit='rad', lengths=(1, 2)),
    ParameterSpec('rate_std_rad_s', 'floats', [0.0],
                  'standard deviation about each body axis, or the ends of its range',
                  unit='rad/s', lengths=(1, 2)),
)
CONE_KEYS = (
    ParameterSpec('most', 'int', 3, 'their number is uniform from 1 to this', low=1, high=8,
                  required=True),
    ParameterSpec('most_axes', 'int', 3,
                  'of 1 to so many body axes, uniform on the sphere as their directions are',
                  low=1, high=8),
    ParameterSpec('half_angle_deg', 'floats', [12.0, 50.0],
                  'ends of the half angle of those to stay out of', unit='deg', lengths=(2,)),
    ParameterSpec('keep_in_part', 'float', 0.0, 'probability that one is to stay in', unit='1',
                  low=0.0, high=1.0),
    ParameterSpec('keep_in_half_angle_deg', 'floats', [70.0, 135.0],
                  'ends of the half angle of those to stay in', unit='deg', lengths=(2,)),
    ParameterSpec('margin_deg', 'float', 1.0,
                  'angle by which the initial and the commanded attitude keep every cone, as '
                  'widened for the way between samples', unit='deg', low=0.0, high=180.0),
    ParameterSpec('on_the_way', 'bool', False,
                  'drawn again until turning straight to the commanded attitude breaks one'),
)
_AS_IN_SCENARIOS = ('attitude_tolerance_deg', 'rate_tolerance_rad_s', 'final_error_deg',
                    'final_rate_rad_s', 'peak_rate_rad_s', 'promises_broken', 'infeasible_ticks',
                    'cone_violation_s')
LIMIT_KEYS = (
    *(spec for spec in ACCEPTANCE_KEYS if spec.name in _AS_IN_SCENARIOS),
    ParameterSpec('settle_time_s', 'float', 30.0,
                  'settled no later than this, and to the end; any time in the loop when left out',
                  unit='s', low=0.0, high=1e6),
    ParameterSpec('limits_exceeded', 'int', 0,
                  'ticks with a torque above its limit, or a rate above its limit that the plan '
                  'before had kept', low=0, high=2**31 - 1),
    ParameterSpec('feasibility_lost', 'int', 0, 'infeasible ticks after a feasible one', low=0,
                  high=2**31 - 1),
    ParameterSpec('turn_changes', 'int', 1,
                  'changes of the side of the turn (pointing: reversals of its direction)', low=0,
                  high=2**31 - 1),
)


def all_keys() -> Iterator[tuple[str, ParameterSpec]]:
    """Yield the full name of every key and its description, ``[]`` for an element of a list."""
    tables = (
        ('', CAMPAIGN_KEYS), ('acceptance.', LIMIT_KEYS), ('sets[].', SET_KEYS),
        ('sets[].attitude.', ATTITUDE_KEYS), ('sets[].rate.', RATE_KEYS),
        ('sets[].setpoint.', SETPOINT_KEYS), ('sets[].inertia.', INERTIA_KEYS),
        ('sets[].disturbance.', DISTURBANCE_KEYS), ('sets[].noise.', NOISE_KEYS),
        ('sets[].cones.', CONE_KEYS))
    for prefix, specs in tables:
        yield from ((prefix + spec.name, spec) for spec in specs)
