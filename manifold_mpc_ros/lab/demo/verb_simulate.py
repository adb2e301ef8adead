# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``simulate``: the closed loop in one process, without ROS and without waiting."""

from __future__ import annotations

import argparse
import math
from functools import partial
from pathlib import Path

import numpy as np

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig, SimulatorConfig
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.control.plan_watch import PlanWatch
from manifold_mpc_ros.lab.closed_loop import ClosedLoopLog, SlewingController, run_closed_loop
from manifold_mpc_ros.lab.demo.defaults import set_defaults
from manifold_mpc_ros.mpc.target import error_angle
from manifold_mpc_ros.sim.plant import Plant

EXAMPLES = """\
  manifold-mpc simulate
      the shipped spacecraft and controller: a slew of 180 degrees about z
  manifold-mpc simulate --duration 60 --output results/tumble --simulator-config tumble.yaml
      another plant: its own inertia, initial state, limits, disturbance and noise
  manifold-mpc simulate --attitude-tolerance 0.01
      succeed only when the error ends below 0.01 degrees
"""
SNAPSHOTS = 8


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    shared.add_controller_config(parser)
    shared.add_simulator_config(parser)
    parser.add_argument(
        '--duration', type=shared.positive_number, metavar='S',
        help="simulated time, a multiple of the controller's step (default: 40, and at least "
             'twice the horizon)')
    parser.add_argument(
        '--disturbance-frame', choices=('body', 'inertial'), default='body',
        help="components that the simulator's disturbance torque is constant in "
             '(default: %(default)s)')
    shared.add_tolerances(parser)
    shared.add_backend(parser, "the parameter file's")
    shared.add_output(parser, 'results/simulate')


def run(arguments: argparse.Namespace) -> int:
    """Simulate, print, draw; 0 when the attitude settled, otherwise 1."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.cli.progress import Progress
    from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
    files = shared.config_paths(arguments)
    controller = ControllerConfig.from_yaml(files[0])
    config = controller.mpc
    plant = Plant(
        SimulatorConfig.from_yaml(files[1]), disturbance_frame=arguments.disturbance_frame)
    set_defaults(arguments, config)
    arguments.output.mkdir(parents=True, exist_ok=True)
    console = report.make_console()
    with console.status('Designing the terminal set and building the solver'):
        mpc = AttitudeMpc(config, backend=arguments.backend or controller.backend,
                          moving=controller.moving)
    slews = SlewPlanner.from_config(controller)
    with Progress(console, 's', arguments.duration) as progress:
        log = run_closed_loop(
            mpc if slews is None else SlewingController(mpc, slews), plant,
            arguments.duration, config.step_s,
            on_tick=lambda tick: progress.show(
                tick.time_s, f'error {math.degrees(tick.attitude_error_rad):9.4f} deg, '
                f'rate {tick.rate_rad_s:8.5f} rad/s'),
            error_angle=partial(error_angle, config))
    settled_s = log.settled_at(
        math.radians(arguments.attitude_tolerance), arguments.rate_tolerance)
    rows = _result_rows(log, plant, config, arguments, settled_s)
    console.print(report.result_table('Closed loop, offline', rows))
    for text in _warnings(log, config):
        console.print(f'WARNING: {text}', soft_wrap=True, markup=False)
    report.say_written(console, _write(log, config, arguments, settled_s))
    return 0 if settled_s is not None else 1


def _warnings(log: ClosedLoopLog, config: AttitudeMpcConfig) -> list[str]:
    """Return what did not fit at some time of the run: horizon, period."""
    watch, found = PlanWatch(config), dict[str, str]()
    for status, solve_time_s in zip(log.status, log.solve_time_s):
        watch.see(status, float(solve_time_s))
        found |= watch.warnings
    return list(found.values())


def _result_rows(
    log: ClosedLoopLog, plant: Plant, config: AttitudeMpcConfig, arguments: argparse.Namespace,
    settled_s: float | None,
) -> list[tuple[str, str]]:
    """Return what is worth knowing about the run."""
    from manifold_mpc_ros.cli import console as report
    solve_us = 1e6 * log.solve_time_s
    counters = plant.counters
    return [
        ('settled at', report.settled_text(
            settled_s, arguments.attitude_tolerance, arguments.rate_tolerance)),
        (f'first {config.target} error', f'{math.degrees(log.attitude_error_rad[0]):.6g} deg'),
        (f'final {config.target} error', f'{math.degrees(log.attitude_error_rad[-1]):.3g} deg'),
        ('final rate', f'{log.rate_rad_s[-1]:.3g} rad/s'),
        ('peak torque, by axis', report.vector_text(np.abs(log.torque_B_n_m).max(axis=0), 'N m')
         + f', {report.limit_text(config.max_torque_n_m)}'),
        ('peak rate, by axis', report.vector_text(np.abs(log.omega_BN_B).max(axis=0), 'rad/s')
         + f', {report.limit_text(config.max_rate_rad_s)}'),
        ('solves', f'{len(log.status)}: {report.counts_text(log.status)}'),
        ('iterations',
         f'median {np.median(log.iterations):.0f}, most {int(np.max(log.iterations))}'),
        ('solve time',
         f'median {np.median(solve_us):.0f} us, p99 {np.percentile(solve_us, 99):.0f} us'),
        ('plant steps', ', '.join((
            f'{counters.saturated} saturated', f'{counters.substepped} in substeps',
            f'{counters.refused} with a refused torque', f'{counters.frozen} not possible'))),
    ]


def _write(
    log: ClosedLoopLog, config: AttitudeMpcConfig, arguments: argparse.Namespace,
    settled_s: float | None,
) -> list[Path]:
    """Write data and pictures; return where they are."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.report.plot_orientation import plot_orientation, snapshot_rows
    from manifold_mpc_ros.lab.report.plot_response import Response, plot_response
    folder = arguments.output
    log.save(folder / 'closed_loop.npz')
    table = report.write_csv(folder / 'closed_loop.csv', {
        'time_s': log.time_s,
        'attitude_error_rad': log.attitude_error_rad,
        **report.axis_columns('omega_BN_B', 'rad_s', log.omega_BN_B),
        **report.axis_columns('torque_B', 'n_m', log.torque_B_n_m),
        **report.attitude_columns(log.R_NB),
        'cost': log.cost,
        'iterations': log.iterations,
        'status': log.status,
        'solve_time_s': log.solve_time_s,
    })
    response = plot_response(Response(
        title=f'Closed loop from {math.degrees(log.attitude_error_rad[0]):.4g} degrees',
        state_time_s=log.time_s, attitude_error_rad=log.attitude_error_rad,
        omega_BN_B=log.omega_BN_B, torque_time_s=log.time_s, torque_B_n_m=log.torque_B_n_m,
        max_rate_rad_s=config.max_rate_rad_s, max_torque_n_m=config.max_torque_n_m,
        attitude_tolerance_rad=math.radians(arguments.attitude_tolerance),
        settled_s=settled_s, target=config.target), folder / 'response.png')
    chosen = snapshot_rows(log.time_s, 2.0, settled_s, SNAPSHOTS)
    orientation = plot_orientation(
        'Orientation during the slew', log.time_s[chosen], log.R_NB[chosen],
        folder / 'orientation.png')
    return [folder / 'closed_loop.npz', table, response, orientation]
