# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``tune``: from inertia and limits to a controller file, checked by closed loops."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.config.parameter import Value, resolve_parameters
from manifold_mpc_ros.config.tables import (
    CONTROLLER_NAME,
    CONTROLLER_PARAMETERS,
    SIMULATOR_NAME,
)
from manifold_mpc_ros.config.yaml_file import read_parameter_file, sections_of
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.tune import rule

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.tune.choice import Trial
    from manifold_mpc_ros.lab.tune.trial import Outcome

EXAMPLES = """\
  manifold-mpc tune mine.yaml -o mine_controller.yaml
      mine.yaml is a parameter file of the controller that has spacecraft and limits; the file
      written is complete, for the simulator too, and says at its head what was decided and why
  manifold-mpc tune mine.yaml -o mine_controller.yaml --step 0.2 --slew 0 0 90
      a given control period, and the slew that is to be flown (a rotation vector in degrees)
  manifold-mpc tune mine.yaml -o mine_controller.yaml --gentler
      less torque, later
"""
NEEDED = ('spacecraft.inertia_kg_m2', 'limits.max_torque_n_m', 'limits.max_rate_rad_s')
# What controller and simulator have in common, and steps of the plant and states a period.
SHARED = ('spacecraft.inertia_kg_m2', 'limits.max_torque_n_m')
PLANT_STEPS, STATES = 20, 10
# Part of the period that 99 % of the solves may take.
SOLVE_PART = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument('spacecraft', type=Path, metavar='FILE',
                        help='parameter file of the controller, at least spacecraft and limits')
    parser.add_argument('-o', '--output', type=Path, default=Path('tuned_controller.yaml'),
                        metavar='FILE', help='the controller file to write (default: %(default)s)')
    parser.add_argument('--step', type=shared.positive_number, metavar='S',
                        help='control period (default: a sixtieth of a half turn)')
    parser.add_argument('--accuracy', type=shared.positive_number, default=0.1, metavar='DEG',
                        help='settled below this error (default: %(default)s)')
    parser.add_argument('--slew', type=shared.number, nargs=3, metavar=('X', 'Y', 'Z'),
                        help='the slew to be flown, rotation vector in degrees (default: quarter '
                             'and half turns about five axes)')
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument('--faster', dest='pace', action='store_const', const='FASTER',
                      help='98.5 %% of the torque, full torque for smaller errors')
    pace.add_argument('--gentler', dest='pace', action='store_const', const='GENTLER',
                      help='half of the torque, slower slews')
    parser.set_defaults(pace='NORMAL')


def run(arguments: argparse.Namespace) -> int:
    """Tune, print, write; 0 when all loops settled within their limits and solves fit."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.tune import choice, trial
    from manifold_mpc_ros.lab.tune.trade import plot_trade
    console = report.make_console()
    given = read_parameter_file(arguments.spacecraft, CONTROLLER_NAME)
    values = _values(given)
    accuracy = float(np.radians(arguments.accuracy))
    slews = (trial.default_slews() if arguments.slew is None
             else [trial.Slew(np.radians(arguments.slew))])
    with console.status('Closing loops') as status:
        trials = choice.try_all(
            values, getattr(choice, arguments.pace), accuracy, slews, arguments.step,
            lambda weights: status.update(f'Closing loops with damping {weights.damping:g}, '
                                          f'profile of {weights.torque_fraction:g}'))
        best = choice.best_of(trials)
        status.update('Closing loops with other torques and horizons')
        picture = plot_trade(values, best, accuracy, arguments.output.with_suffix('.png'))
    hardest = best.hardest
    times_s = trial.solve_times_s(best.flyer, hardest.slew)
    rows = _rows(best, hardest, times_s)
    console.print(report.grid_table(
        'Tried', ('profile', 'damping', 'worst settling / bound', 'median', 'off the model',
                  'ticks infeasible'), [_candidate_row(each) for each in trials]))
    console.print(report.result_table('Chosen', rows))
    _write(arguments.output, given, _simulator(arguments.spacecraft), best, rows)
    report.say_written(console, [arguments.output, picture])
    return _verdict(console, best, hardest, times_s)


def _values(given: Mapping[str, Any]) -> dict[str, Value]:
    """Return a value for every parameter; raises ConfigurationError where one is needed."""
    for name in NEEDED:
        if name not in given:
            raise ConfigurationError(
                name, None, 'a value, from which tune starts (the key is missing)')
    return resolve_parameters(CONTROLLER_PARAMETERS, given, complete=False)


def _simulator(path: Path) -> Mapping[str, Any]:
    """Return the parameters that the file has for the simulator."""
    if not any(section.split('/')[-1] == SIMULATOR_NAME for section in sections_of(path)):
        return {}
    return read_parameter_file(path, SIMULATOR_NAME)


def _candidate_row(each: Trial) -> tuple[str, ...]:
    """Return what a choice of weights did."""
    ratios = [outcome.ratio for outcome in each.outcomes]
    return (f'{each.weights.torque_fraction:g}' if each.flyer.slews else 'none',
            f'{each.weights.damping:g}', f'{max(ratios):.3f}', f'{np.median(ratios):.3f}',
            f'{max(outcome.ratio for outcome in each.margins):.3f}',
            str(sum(outcome.infeasible for outcome in each.outcomes)))


def _rows(best: Trial, hardest: Outcome, times_s: np.ndarray) -> list[tuple[str, str]]:
    """Return what was decided, why, and what it does."""
    from manifold_mpc_ros.lab.tune.choice import MARGINS
    config, weights = best.flyer.mpc.config, best.weights
    half_turn = rule.half_turn_s(config)
    margins = [(name, _settled(outcome) + f', {outcome.infeasible} ticks infeasible')
               for (name, _, _), outcome in zip(MARGINS, best.margins)]
    return [
        ('half turn', f'{half_turn:.4g} s, bang-bang about the slowest axis'),
        ('step', f'{config.step_s:g} s, {half_turn / config.step_s:.0f} steps a half turn'),
        ('horizon', f'{config.horizon} steps = {config.steps.times_s[-1]:.4g} s, '
         f'{config.steps.times_s[-1] / half_turn:.3g} half turns'),
        ('torque weight', 'full torque costs what an error of '
         f'{np.degrees(weights.torque_angle_rad):.3g} deg does'),
        ('slews', f'by a profile of {100 * weights.torque_fraction:g} % of torque and rate limits'
         if weights.torque_fraction else 'aimed at the setpoint, quicker than by a profile'),
        ('rate limits', 'kept between samples too: plans stay within them by '
         f'{100 * max(max(each.values()) for each in config.rate_margins):.2g} % at most'
         if config.keep_rate_between_samples else 'kept at samples, not proved between them'),
        ('rate weight', f'(damping {weights.damping:g} x half turn)^2'),
        ('hardest slew', f'{hardest.slew.text}: {_settled(hardest)}, '
         f'{100 * hardest.peak_torque:.0f} % of the torque'),
        *margins,
        ('solve, processor time', f'p99 {1e3 * np.percentile(times_s, 99):.3g} ms, first '
         f'{1e3 * times_s[0]:.3g} ms, of a period of {1e3 * config.step_s:.4g} ms'),
    ]


def _settled(outcome: Outcome) -> str:
    """Say when a slew settled."""
    if not np.isfinite(outcome.settled_s):
        return f'NOT settled in {2 * outcome.bound_s:.4g} s'
    return (f'{outcome.settled_s:.4g} s, {outcome.ratio:.3f} of the bang-bang '
            f'{outcome.bound_s:.4g} s')


def _write(path: Path, given: Mapping[str, Any], simulator: Mapping[str, Any], best: Trial,
           rows: Sequence[tuple[str, str]]) -> None:
    """Write the parameters of both nodes, what they share once, with the reasons as comments."""
    step_s = best.flyer.mpc.config.step_s
    chosen = {**given, **best.chosen}
    plant = {**simulator, 'timing.control_period_s': step_s,
             'plant.step_s': step_s / PLANT_STEPS, 'timing.state_period_s': step_s / STATES}
    sections = {'/**': {name: chosen.pop(name) for name in SHARED},
                f'/**/{CONTROLLER_NAME}': chosen,
                f'/**/{SIMULATOR_NAME}': {
                    name: value for name, value in plant.items()
                    if name not in SHARED or value != given.get(name)}}
    head = ['Parameters of both nodes, by manifold-mpc tune (docs/tuning.md).',
            *(f'{name}: {text}' for name, text in rows)]
    body = yaml.safe_dump({section: {'ros__parameters': _nested(values)}
                           for section, values in sections.items()},
                          sort_keys=False, default_flow_style=None)
    path.write_text(''.join(f'# {line}\n' for line in head) + body, encoding='utf-8')


def _nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return dotted names as nested keys."""
    tree: dict[str, Any] = {}
    for name, value in values.items():
        *groups, last = name.split('.')
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[last] = value
    return tree


def _verdict(console: Console, best: Trial, hardest: Outcome, times_s: np.ndarray) -> int:
    """Say what is not good enough; return 0 when all is."""
    config = best.flyer.mpc.config
    wrong = []
    if any(outcome.infeasible for outcome in best.outcomes):
        wrong.append('ticks without a plan into the terminal set: a longer horizon, --gentler')
    if any(outcome.broken for outcome in best.outcomes):
        wrong.append('a rate limit was exceeded')
    if not np.isfinite(hardest.settled_s):
        wrong.append('a slew did not settle: a shorter --step, a larger --accuracy')
    if np.percentile(times_s, 99) > SOLVE_PART * config.step_s:
        wrong.append('solves take more than half the period: a longer --step, or mpc.horizon_s')
    for line in wrong:
        console.print(f'NOT good enough: {line}')
    return int(bool(wrong))
