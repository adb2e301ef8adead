# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``demo``: both nodes as real processes, the loop closed over DDS."""

from __future__ import annotations

import argparse
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.cli.extras import require
from manifold_mpc_ros.cli.processes import (
    NodeProcesses,
    chosen_domain,
    end_on_sigterm,
    node_environment,
    stay_private,
)
from manifold_mpc_ros.config.control_law import SimulatorConfig
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.description import PLAIN
from manifold_mpc_ros.config.guidance import MODES
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lab.closed_loop import settling_time
from manifold_mpc_ros.lab.demo.bag import DemoBag
from manifold_mpc_ros.lab.demo.defaults import DURATION_S, set_defaults
from manifold_mpc_ros.lab.demo.target import FILE, PERIOD_S, TIMEOUT_S, DemoTarget
from manifold_mpc_ros.lab.demo.watch import (
    HOLD_S,
    StartWatch,
    activate_controller,
    loop_is_closed,
    watch_until_settled,
)
from manifold_mpc_ros.lab.recording.scenarios.scenario import is_shipped_state

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.recording.nodes.history import StateHistory

EXAMPLES = """\
  manifold-mpc demo
      a slew of 180 degrees with the shipped parameters; bag, report, pictures in results/demo
  manifold-mpc demo --guidance nadir
      the same, to an attitude that moves: a third process, guidance, commands it
  manifold-mpc demo --simulator-config tumble.yaml --time-limit 60 --output results/tumble
      another spacecraft or start; faster than real time, for it may take more than 40 s
"""
SNAPSHOTS = 8


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    shared.add_controller_config(parser)
    shared.add_simulator_config(parser)
    parser.add_argument(
        '--time-limit', dest='duration', type=shared.positive_number, metavar='S',
        help='time from the first command until the attitude has settled (default: 40, and at '
             'least twice the horizon)')
    parser.add_argument(
        '--real-time', action='store_true',
        help=f'in real time; else a run that may take more than {DURATION_S:g} s is in lockstep, '
             'as fast as this machine can')
    parser.add_argument(
        '--start-limit', type=shared.positive_number, default=60.0, metavar='S',
        help='wall clock until the first command: discovery, and building the solver '
             '(default: %(default)s)')
    parser.add_argument(
        '--guidance', choices=MODES, metavar='MODE',
        help='turn to an attitude that moves, as the executable guidance commands it with its '
             'shipped parameters in this mode: ' + ', '.join(MODES))
    shared.add_tolerances(parser)
    shared.add_output(parser, 'results/demo')


def run(arguments: argparse.Namespace) -> int:
    """Run both nodes until the attitude settled or time is up; 0 when it settled."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.demo.display import DemoDisplay
    files = shared.config_paths(arguments)
    config = ControllerConfig.from_yaml(files[0])
    SimulatorConfig.from_yaml(files[1])
    if not is_shipped_state(config.state_source) or config.command_sink != PLAIN:
        raise ConfigurationError(
            'state_source and command_sink', [config.state_source, config.command_sink],
            'the shipped messages; manifold-mpc record runs a scenario in those of another stack')
    set_defaults(arguments, config.mpc)
    target = DemoTarget(config.mpc, arguments.guidance)
    require('demo', 'rclpy')
    from manifold_mpc_ros.lab.recording.nodes.history import Recorder
    arguments.output.mkdir(parents=True, exist_ok=True)
    stay_private(os.environ)  # the recorder is in this process
    end_on_sigterm()
    console, namespace = report.make_console(), f'/demo_{os.getpid()}'
    lockstep = (arguments.duration > DURATION_S and not arguments.real_time
                and target.mode is None)
    with chosen_domain() as domain_id, Recorder(domain_id, namespace) as recorder, \
            NodeProcesses() as processes, \
            DemoBag(arguments.output / 'bag', domain_id, namespace) as bag:
        environment = node_environment(domain_id)
        count = 'Two' if target.mode is None else 'Three'
        console.print(f'{count} processes on ROS_DOMAIN_ID={domain_id}, topics under {namespace}'
                      + lockstep * ', in lockstep: faster than real time')

        def start(module: str, file: Path, *more: str) -> None:
            processes.start(
                module, ['--params-file', str(file), '-r', f'__ns:={namespace}', *more],
                environment, arguments.output / f'{module}.log')

        with DemoDisplay(console) as display:
            waiting = StartWatch(recorder, processes, arguments.start_limit, display)
            steps: tuple[str, ...] = ('-p', f'lockstep:={str(lockstep).lower()}')
            start('simulator', files[1], *steps)
            # Seen before anything moves: the recording begins at the initial state. In lockstep
            # the simulator waits for the controller.
            waiting.until(lambda: lockstep or recorder.states > 0)
            if target.mode is not None:
                start('guidance', shared.shipped_config(FILE), '-p', f'mode:={target.mode}',
                      '-p', f'period_s:={PERIOD_S}')
                steps += ('-p', f'reference.timeout_s:={TIMEOUT_S}')
            start('controller', files[0], '-p', 'autostart:=false', *steps)
            activate_controller(
                recorder, bag, processes, waiting.look, guided=target.mode is not None)
            waiting.until(lambda: loop_is_closed(recorder))
            watch_until_settled(recorder, processes, target, arguments, display,
                                simulated=lockstep)
        bag.end()
        history, solver = recorder.history(), recorder.solver
        bag.describe(files, arguments, recorder.first_ns, float(history.state_time_s[-1]),
                     lockstep=lockstep)
        exits = processes.stop()
    errors = target.errors(history.stamp_ns, history.R_NB, history.omega_BN_B)
    status = _finish(console, history, errors, solver, waiting.elapsed_s, exits, config, arguments)
    return status if _report(console, bag) else 1


def _report(console: Console, bag: DemoBag) -> bool:
    """Write the page about the bag and say where both are; return whether that worked."""
    from manifold_mpc_ros.lab.report.verb import write_report
    if bag.failure:
        console.print(f'no report: {bag.failure}', soft_wrap=True, markup=False)
        return False
    page = write_report(bag.path.parent / 'report', [bag.path])[0]
    console.print(f'Bag and report, to look at in a browser:\n  {bag.path}\n  {page}',
                  soft_wrap=True, markup=False)
    return True


def _finish(
    console: Console, history: StateHistory, errors: tuple[np.ndarray, np.ndarray],
    solver: dict[str, str], start_s: float, exits: dict[str, int], config: ControllerConfig,
    arguments: argparse.Namespace,
) -> int:
    """Print the table, write pictures and data; 0 when settled and both nodes ended well."""
    from manifold_mpc_ros.cli import console as report
    error_rad, rate_rad_s = errors
    settled_s = settling_time(
        history.state_time_s,
        (np.degrees(error_rad) < arguments.attitude_tolerance)
        & (rate_rad_s < arguments.rate_tolerance))
    if settled_s is not None and history.state_time_s[-1] - settled_s < HOLD_S:
        settled_s = None
    console.print(report.result_table(f'Closed loop over DDS, {len(exits)} processes', [
        ('settled after', report.settled_text(
            settled_s, arguments.attitude_tolerance, arguments.rate_tolerance)),
        ('start to first command', f'{start_s:.1f} s of wall clock, not counted above'),
        (f'first {config.mpc.target} error', f'{math.degrees(error_rad[0]):.6g} deg'),
        (f'final {config.mpc.target} error', f'{math.degrees(error_rad[-1]):.3g} deg'),
        ('final rate' if arguments.guidance is None else 'final rate error',
         f'{rate_rad_s[-1]:.3g} rad/s'),
        ('peak torque, by axis',
         report.vector_text(np.abs(history.torque_B_n_m).max(axis=0), 'N m')
         + f', {report.limit_text(config.mpc.max_torque_n_m)}'),
        ('peak rate, by axis',
         report.vector_text(np.abs(history.omega_BN_B).max(axis=0), 'rad/s')
         + f', {report.limit_text(config.mpc.max_rate_rad_s)}'),
        ('messages seen', f'{len(error_rad)} states, {len(history.torque_B_n_m)} torques'),
        ('last solve', ', '.join(f'{key} {solver[key]}' for key in (
            'solver_status', 'iterations', 'solve_time_us') if key in solver) or 'unknown'),
        ('promises broken', f'{solver.get("promises_broken", "unknown")} of '
         f'{solver.get("promises_checked", "unknown")} (decrease of the value function)'),
        ('ticks outside D_N', f'{solver.get("ticks_outside_domain", "unknown")} of '
         f'{solver.get("ticks", "unknown")} (no plan that keeps every limit reached the set)'),
        ('exit status', ', '.join(f'{name} {status}' for name, status in exits.items())),
    ]))
    report.say_written(console, _write(history, error_rad, settled_s, config, arguments))
    return 0 if settled_s is not None and not any(exits.values()) else 1


def _write(
    history: StateHistory, error_rad: np.ndarray, settled_s: float | None,
    config: ControllerConfig, arguments: argparse.Namespace,
) -> list[Path]:
    """Write pictures and data; return where they are."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.report.plot_orientation import plot_orientation, snapshot_rows
    from manifold_mpc_ros.lab.report.plot_response import Response, plot_response
    folder = arguments.output
    response = plot_response(Response(
        title=f'Closed loop over DDS from {math.degrees(error_rad[0]):.4g} degrees',
        state_time_s=history.state_time_s, attitude_error_rad=error_rad,
        omega_BN_B=history.omega_BN_B, torque_time_s=history.torque_time_s,
        torque_B_n_m=history.torque_B_n_m, max_rate_rad_s=config.mpc.max_rate_rad_s,
        max_torque_n_m=config.mpc.max_torque_n_m,
        attitude_tolerance_rad=math.radians(arguments.attitude_tolerance),
        settled_s=settled_s, target=config.mpc.target), folder / 'response.png')
    chosen = snapshot_rows(history.state_time_s, 2.0, settled_s, SNAPSHOTS)
    orientation = plot_orientation(
        'Orientation during the slew', history.state_time_s[chosen], history.R_NB[chosen],
        folder / 'orientation.png')
    states = report.write_csv(folder / 'states.csv', {
        'time_s': history.state_time_s,
        'attitude_error_rad': error_rad,
        **report.axis_columns('omega_BN_B', 'rad_s', history.omega_BN_B),
        **report.attitude_columns(history.R_NB),
    })
    torques = report.write_csv(folder / 'torques.csv', {
        'time_s': history.torque_time_s,
        **report.axis_columns('torque_B', 'n_m', history.torque_B_n_m),
    })
    return [response, orientation, states, torques,
            *sorted(folder.glob('*.log'))]
