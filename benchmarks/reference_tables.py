# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tables and picture of what references.py and moving_cost.py measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from program_tables import table

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, save_figure, styled


def _deg(value: float) -> str:
    """Return an angle with two digits."""
    return f'{value:.1e}' if value >= 1e-6 else 'below 1e-6'


def targets(data: dict[str, Any]) -> str:
    """Return how targets are followed: drawn ones in the loop, and in orbit."""
    rows = [[f'{row["target"]}, step {row["step_s"]:g} s', _deg(row['steady_error_deg']),
             str(row['searches']), f'{row["promises_broken"]} of {row["promises_checked"]}']
            for row in data['targets']]
    if 'smooth' in data:
        row = data['smooth']
        rows.append([f'swings, 0.3 of the limits, {row["ticks"]:,} ticks of 0.5 s', _deg(
            row['steady_error_deg']), str(row['searches']),
            f'{row["promises_broken"]} of {row["promises_checked"]}'])
    orbit = {f'an orbit, {name}': row for name, row in data['orbit'].items()}
    orbit |= {'a place on the ground, up to '
              f'{data["ground_pass"]["largest_rate_deg_s"]:.2f} deg/s': data['ground_pass'],
              f'Sun to nadir, {data["sun_to_nadir"]["turn_deg"]:.0f} deg, cone kept by '
              f'{data["sun_to_nadir"]["smallest_margin_deg"]:.3f} deg': data['sun_to_nadir']}
    rows += [[name, _deg(row['largest_error_deg']), str(row['searches']),
              f'{row["promises_broken"]} of {row["promises_checked"]}']
             for name, row in orbit.items()]
    return table(['target', 'largest steady error [deg]', 'searches', 'promises broken'], rows)


def delays(data: dict[str, Any]) -> str:
    """Return what delays do, declared right and wrong."""
    return table(
        ['delay [s]', 'declared [s]', 'half turn settled after [s]', 'rate limit exceeded [%]',
         'measured [s]', 'reported', 'error of a swinging target [deg]'],
        [[f'{row["delay_s"]:g}', f'{row["declared_s"]:g}', f'{row["settled_s"]:.1f}',
          f'{100.0 * row["rate_limit_exceeded"]:.1f}', f'{row["measured_s"]:.3f}',
          'yes' if row['reported_at_the_end'] else 'no', f'{row["tracking_error_deg"]:.3f}']
         for row in data['delays']])


def disturbances(data: dict[str, Any]) -> str:
    """Return what an unknown constant torque leaves, and what noise makes."""
    return table(
        ['step [s]', 'start', '10 mN m', 'below 1e-3 deg for good after [s]', 'at the end [deg]'],
        [[f'{row["step_s"]:g}', row['start'],
          'absent' if not row['torque'] else 'estimated' if row['estimate'] else 'not estimated',
          f'{row["below_1e-3_deg_after_s"]:.1f}' if row['final_error_deg'] < 1e-3 else 'never',
          _deg(row['final_error_deg'])] for row in data['disturbances']])


def noise(data: dict[str, Any]) -> str:
    """Return the torque that noise makes, from measured and from filtered states."""
    return table(
        ['step [s]', 'noise [rad, rad/s]', '`drift_n_m`', 'plans from', 'torque [mN m rms]',
         'error [deg rms]'],
        [[f'{row["step_s"]:g}', f'{row["noise_rad"]:g}', f'{row["drift_n_m"]:g}',
          'filtered' if row['filtered'] else 'measured', f'{1e3 * row["torque_rms_n_m"]:.2f}',
          f'{row["error_rms_deg"]:.4f}'] for row in data['noise']])


def random_targets(data: dict[str, Any]) -> str:
    """Return what became of random targets within the limits and beyond."""
    found = {name: data[key] for name, key in (
        ('within the limits', 'feasible'), ('beyond', 'infeasible')) if key in data}
    rows = {'flights': 'flights', 'error, median [deg]': 'median_error_deg',
            'error, largest [deg]': 'largest_error_deg', 'promises checked': 'promises_checked',
            'promises broken': 'promises_broken',
            'torque limit exceeded by at most (part of it)': 'largest_torque_excess',
            'rate limit exceeded by at most (part of it)': 'largest_rate_excess',
            'flights with more than one search': 'with_more_than_one_search',
            'every tick NOMINAL': 'all_nominal', 'flights that were warned of': 'warned',
            'ticks warned of': 'ticks_warned', 'ticks in all': 'ticks'}
    return table(['', *found], [
        [name, *(_plain(study.get(key)) for study in found.values())]
        for name, key in rows.items()])


def _plain(value: object) -> str:
    """Return a figure of a study, nothing where it has none."""
    if value is None or isinstance(value, bool):
        return {None: '', True: 'yes', False: 'no'}[value]
    return f'{value:.3g}' if isinstance(value, float) else str(value)


def cost(data: dict[str, Any]) -> str:
    """Return what a warm solve costs, and the call that it is part of."""
    columns = {'solve': 'instructions_per_solve', 'pass': 'instructions_per_pass',
               'solver_us': 'solver_us', 'call_us': 'call_us'}
    rows = [[kind, *(f'{data[kind][key]:,}' for key in columns.values())]
            for kind in ('fixed', 'moving')]
    return table(['target', 'instructions, warm solve', 'instructions, pass',
                  'solver [us]', 'whole call of `AttitudeMpc.solve` [us]'], [
        *rows, ['moving over fixed', *(
            f'{data["moving_over_fixed"][name]:.2f}' for name in columns)]])


def draw(data: dict[str, Any], path: Path) -> Path:
    """Draw errors over an orbit, a slew and a pass, and of random targets."""
    with styled():
        figure = Figure(figsize=(10.0, 4.0), layout='constrained')
        left, right = figure.subplots(1, 2)
        for (name, row), colour in zip({
                'nadir, disturbance estimated': data['orbit']['nadir, estimated'],
                'nadir, not estimated': data['orbit']['nadir, not estimated'],
                'Sun to nadir round a cone': data['sun_to_nadir']}.items(), AXIS_COLOURS):
            left.semilogy(np.array(row['time_s']) / 60.0, np.maximum(row['error_deg'], 1e-5),
                          color=colour, label=name)
        left.set(xlabel='time [min]', ylabel='error [deg]',
                 title='A telescope in orbit under gravity gradient')
        left.legend(loc='upper right')
        for name, key, colour in (('within the limits', 'feasible', AXIS_COLOURS[0]),
                                  ('beyond', 'infeasible', AXIS_COLOURS[1])):
            if key in data:
                right.semilogy(data[key]['shares'], np.maximum(data[key]['errors_deg'], 1e-5), '.',
                               color=colour, markersize=3.0, label=name)
        right.axvline(1.0, color='#666666', linewidth=1.0)
        right.set(xlabel='largest part of a limit that the target needs',
                  ylabel='largest error, last 30 % [deg]', title='Random targets')
        right.legend(loc='lower right')
        return save_figure(figure, path)
