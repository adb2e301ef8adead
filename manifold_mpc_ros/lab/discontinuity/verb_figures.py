# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``figures``: the four figures of the paper's simulation results, and their data."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.lab.closed_loop import ClosedLoopLog, ModelPlant, run_closed_loop
from manifold_mpc_ros.lab.discontinuity.findings import paper_config
from manifold_mpc_ros.lie import so3

EXAMPLES = """\
  manifold-mpc figures
      torque and rate about z, and the orientation every 2 s, from 180 and -0.99*180 degrees
  manifold-mpc figures --output results/paper --duration 30
"""
CHOICES = """\
From the paper: Qg = I, Qf = J_d, R = 2 I, lambda = 0.1, N = 10, no limits, terminal set P_c.
Our choice, for the paper does not give them: J = I kg m^2 (so J_d = I/2) and h = 0.5 s.
The body is the paper's own model, with its first-order forcing."""

SNAPSHOT_SPACING_S = 2.0
SNAPSHOTS = 8
SETTLED = (math.radians(0.1), 1e-3)


@dataclass(frozen=True)
class Case:
    """One of the two initial rotations about z."""

    label: str
    drawn: str
    file_name: str
    angle_rad: float


CASES = (
    Case('180 deg', '180°', '180', math.pi),
    Case('-0.99*180 deg', '−0.99·180°', 'minus_0.99x180', -0.99 * math.pi),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument(
        '--duration', type=shared.positive_number, default=20.0, metavar='S',
        help='simulated time, a multiple of h = 0.5 s (default: %(default)s)')
    shared.add_backend(parser, 'auto')
    shared.add_output(parser, 'results/figures')


def run(arguments: argparse.Namespace) -> int:
    """Run both cases, print, draw; 0 when their first torques are opposite, otherwise 1."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
    console = report.make_console()
    console.print(CHOICES, markup=False)
    arguments.output.mkdir(parents=True, exist_ok=True)
    config = paper_config()
    with console.status('Building the solver and running both cases'):
        mpc = AttitudeMpc(config, backend=arguments.backend or 'auto')
        logs = []
        for case in CASES:
            mpc.reset()
            plant = ModelPlant(config, so3.exp([0.0, 0.0, case.angle_rad]))
            logs.append(run_closed_loop(mpc, plant, arguments.duration, config.step_s))
    console.print(_table(logs))
    first, second = (log.torque_B_n_m[0, 2] for log in logs)
    opposite = bool(first * second < 0.0)
    console.print(
        f'The attitudes are {math.degrees(_distance(logs)):.3g} degrees apart and the first '
        f'torques differ by {abs(first - second):.4g} N m: '
        + ('the control law is discontinuous there.' if opposite
           else 'NO discontinuity, which contradicts the paper.'))
    report.say_written(console, _write(logs, arguments.output))
    return 0 if opposite else 1


def _distance(logs: list[ClosedLoopLog]) -> float:
    """Return the angle between the two initial attitudes [rad]."""
    return float(so3.angle(logs[0].R_NB[0].T @ logs[1].R_NB[0]))


def _table(logs: list[ClosedLoopLog]) -> object:
    """Return the results of both cases side by side."""
    from manifold_mpc_ros.cli import console as report
    rows = [
        ('first torque about z [N m]', *(f'{log.torque_B_n_m[0, 2]:+.4f}' for log in logs)),
        ('first cost', *(f'{log.cost[0]:.4f}' for log in logs)),
        ('peak rate about z [rad/s]', *(f'{_peak(log.omega_BN_B[:, 2]):+.4f}' for log in logs)),
        ('turned, seen from +z', *(_direction(log) for log in logs)),
        ('settled to 0.1 deg, 1e-3 rad/s [s]', *(_settled(log) for log in logs)),
        ('final error [deg]', *(f'{math.degrees(log.attitude_error_rad[-1]):.2g}'
                                for log in logs)),
        ('statuses', *(report.counts_text(log.status) for log in logs)),
    ]
    return report.grid_table(
        'Rest-to-rest rotation about z', ['initial rotation', *(case.label for case in CASES)],
        rows)


def _peak(values: np.ndarray) -> float:
    """Return the value of largest size, with its sign."""
    return float(values[np.argmax(np.abs(values))])


def _direction(log: ClosedLoopLog) -> str:
    """Say which way the body turned, and how far."""
    turned = so3.log(np.swapaxes(log.R_NB[:-1], 1, 2) @ log.R_NB[1:])[:, 2].sum()
    side = 'counter-clockwise' if turned > 0.0 else 'clockwise'
    return f'{side}, {abs(math.degrees(turned)):.1f} deg'


def _settled(log: ClosedLoopLog) -> str:
    """Return the settling time as text."""
    settled_s = log.settled_at(*SETTLED)
    return 'not yet' if settled_s is None else f'{settled_s:g}'


def _write(logs: list[ClosedLoopLog], folder: Path) -> list[Path]:
    """Write four pictures and one table of data for each case; return where they are."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.discontinuity.plot_pair import Curve, plot_pair
    from manifold_mpc_ros.lab.report.plot_orientation import plot_orientation, snapshot_rows
    time_s = logs[0].time_s
    labels = [f'{case.drawn} about z' for case in CASES]
    written = [
        plot_pair([Curve(label, log.torque_B_n_m[:, 2]) for label, log in
                   zip(labels, logs, strict=True)],
                  time_s, 'torque about z, $\\tau_{k,3}$ [N m]', True,
                  folder / 'figure_1_torque_z.png'),
        plot_pair([Curve(label, log.omega_BN_B[:, 2]) for label, log in
                   zip(labels, logs, strict=True)],
                  time_s, 'rate about z, $\\omega_{k,3}$ [rad/s]', False,
                  folder / 'figure_2_rate_z.png'),
    ]
    for number, (case, log) in enumerate(zip(CASES, logs, strict=True), start=3):
        chosen = snapshot_rows(
            time_s, SNAPSHOT_SPACING_S, log.settled_at(math.radians(1.0), 0.02), SNAPSHOTS)
        written.append(plot_orientation(
            f'Orientation every 2 s, initial rotation of {case.drawn} about z',
            log.time_s[chosen], log.R_NB[chosen],
            folder / f'figure_{number}_orientation_{case.file_name}.png'))
    for case, log in zip(CASES, logs, strict=True):
        written.append(report.write_csv(folder / f'rotation_{case.file_name}.csv', {
            'time_s': log.time_s,
            **report.axis_columns('torque_B', 'n_m', log.torque_B_n_m),
            **report.axis_columns('omega_BN_B', 'rad_s', log.omega_BN_B),
            'attitude_error_rad': log.attitude_error_rad,
            **report.attitude_columns(log.R_NB),
            'cost': log.cost,
        }))
    return written
