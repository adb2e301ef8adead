# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tables and pictures of what basilisk/measure.py measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from program_tables import table

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, save_figure, styled

#: What is drawn no smaller [deg].
FLOOR_DEG = 1e-8


def slews(data: dict[str, Any]) -> str:
    """Return when half turns settled, and what became of limits and error."""
    rows = data['slews']
    ideal_s = rows['ideal torque']['settled_s']
    return table(
        ['half turn with', 'settled after [s]', 'of ideal torque', 'largest rate, of the limit',
         'error in the last minute [deg]', 'ticks with a converged plan'],
        [[name, f'{row["settled_s"]:g}', f'{row["settled_s"] / ideal_s:.3f}',
          f'{row["largest_rate_over_limit"]:.4f}', f'{row["steady_error_deg"]:.1e}',
          f'{row["ticks"].get("NOMINAL converged", 0)} of {sum(row["ticks"].values())}']
         for name, row in rows.items()])


def pointing(data: dict[str, Any]) -> str:
    """Return how controller and law do on the same flights."""
    rows = []
    for name, row in data['pointing'].items():
        flight, who = name.split(', ')
        by, every = who.split(' every ')
        rows.append([flight, 'controller' if by == 'controller' else "Basilisk's law", every,
                     f'{row["largest_error_deg"]:.4f}', f'{row["rms_error_deg"]:.5f}',
                     f'{row["below_settled_s"]:.1f}',
                     f'{1e6 * row["mean_body_torque_n_m"]:.1f}',
                     f'{1e6 * row["mean_motor_torques_n_m"]:.1f}',
                     f'{row["largest_rate_over_limit"]:.3f}'])
    return table(
        ['flight', 'by', 'every', 'largest error [deg]', 'rms error [deg]',
         'below 0.01 deg for good after [s]', 'mean body torque [uN m]',
         'mean of all motors [uN m]', 'largest rate, of the limit'], sorted(
            rows, key=lambda row: (list(dict.fromkeys(each[0] for each in rows)).index(row[0]),
                                   -float(row[2].split()[0]), row[1] != 'controller')))


def tuning(data: dict[str, Any]) -> str:
    """Return which gains of the law were the best of those tried."""
    return table(['law', 'tried', 'P [N m s]', 'K [N m]', 'Ki [1/(N m s)]',
                  'rms error, best of the tried [deg]'], [
        [every, str(len(row['rms_error_deg'])), *(
            f'{row["best"][name]:g}' for name in ('P', 'K', 'Ki')),
         f'{min(row["rms_error_deg"].values()):.5f}'] for every, row in data['tuning'].items()])


def draw(data: dict[str, Any], folder: Path) -> None:
    """Draw what is there into a folder, and say where."""
    if 'slews' in data:
        print(draw_slews(data, folder / 'basilisk_slews.png'))
    if 'pointing' in data:
        print(draw_pointing(data, folder / 'basilisk_pointing.png'))


def draw_pointing(data: dict[str, Any], path: Path) -> Path:
    """Draw errors of controller and law over time, both every half a second."""
    flights = list(dict.fromkeys(name.split(', ')[0] for name in data['pointing']))
    with styled():
        figure = Figure(figsize=(13.0, 3.6), layout='constrained')
        panels = figure.subplots(1, len(flights), sharey=True, squeeze=False)[0]
        for axes, flight in zip(panels, flights):
            for by, words, colour in (('law', "Basilisk's law", AXIS_COLOURS[0]),
                                      ('controller', 'controller', AXIS_COLOURS[2])):
                row = data['pointing'].get(f'{flight}, {by} every 0.5 s')
                if row is None:
                    continue
                trace = row['trace']
                axes.semilogy(trace['every_s'] * np.arange(len(trace['error_deg'])),
                              np.maximum(trace['error_deg'], 1e-7), color=colour, label=words)
            axes.set(title=flight[0].upper() + flight[1:], xlabel='time [s]', ylim=(1e-7, 30.0))
        figure.axes[0].set(ylabel='error [deg]')
        figure.axes[0].legend(loc='upper right', fontsize='small')
        return save_figure(figure, path)


def draw_slews(data: dict[str, Any], path: Path) -> Path:
    """Draw errors, rates against the limit, and speeds of the wheels over time."""
    rows = data['slews']
    with styled():
        figure = Figure(figsize=(11.0, 3.6), layout='constrained')
        error, rate, speed = figure.subplots(1, 3)
        for (name, colour), width in zip({
                'ideal torque': '#666666', 'wheels, not estimated': AXIS_COLOURS[0],
                'wheels, estimated, rate limit tightened': AXIS_COLOURS[2]}.items(),
                (3.0, 1.2, 1.2)):
            trace = rows[name]['trace']
            time_s = trace['every_s'] * np.arange(len(trace['error_deg']))
            error.semilogy(time_s, np.maximum(trace['error_deg'], FLOOR_DEG), color=colour,
                           linewidth=width, label=name)
            rate.plot(time_s, trace['rate_over_limit'], color=colour, linewidth=width)
        for index, each in enumerate(trace['wheel_rpm']):
            speed.plot(time_s, each, label=f'wheel {index + 1}')
        error.set(title='Attitude error [deg]', xlabel='time [s]', ylim=(1e-12, 1e3))
        rate.set(title='Largest rate about a body axis, of the limit', xlabel='time [s]',
                 xlim=(0.0, 170.0), ylim=(0.9, 1.05))
        rate.axhline(1.0, color='#666666', linewidth=0.8, linestyle=':')
        speed.set(title='Wheel speeds [rpm]', xlabel='time [s]')
        speed.axhline(0.0, color='#666666', linewidth=0.8, linestyle=':')
        error.legend(loc='lower left', fontsize='small')
        speed.legend(loc='lower right', fontsize='small')
        return save_figure(figure, path)
