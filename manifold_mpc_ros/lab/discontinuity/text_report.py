# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tables and data of the verb ``discontinuity``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from manifold_mpc_ros.cli.console import grid_table, vector_text

if TYPE_CHECKING:
    from rich.table import Table

    from manifold_mpc_ros.lab.discontinuity.discontinuity import Jump
    from manifold_mpc_ros.lab.discontinuity.findings import Findings
    from manifold_mpc_ros.lab.discontinuity.study import AntipodeStudy, AxisStudy, Circle, JumpMap


def axis_table(found: Sequence[Findings]) -> Table | None:
    """Return the jump across 180 degrees about the axis, a column for each law."""
    shown = [(one.label, one.axis) for one in found if one.axis is not None]
    if not shown:
        return None
    columns = [_axis_column(study) for _, study in shown]
    span = shown[0][1].theta_deg
    return grid_table(
        f'First torque at rest, from {span[0]:g} to {span[-1]:g} degrees about '
        f'{vector_text(shown[0][1].axis)}', ['', *(label for label, _ in shown)],
        [(name, *(column[name] for column in columns)) for name in columns[0]])


def _axis_column(study: AxisStudy) -> dict[str, str]:
    """Return the rows of one law."""
    jump = study.side_jump
    others = [one for one in study.jumps if one is not jump]
    rows = {'side of the turn changes at [deg]': 'nowhere', 'torque just below [N m]': '',
            'torque just above [N m]': '', 'JUMP [N m]': '0', '  of it about the axis [N m]': '',
            '  change over an interval of': ''}
    if jump is not None:
        rows = {
            'side of the turn changes at [deg]': f'{jump.at_deg:.6f}',
            'torque just below [N m]': vector_text(jump.below_n_m),
            'torque just above [N m]': vector_text(jump.above_n_m),
            'JUMP [N m]': f'{jump.size_n_m:.4f}',
            '  of it about the axis [N m]':
                f'{abs((jump.above_n_m - jump.below_n_m) @ study.axis):.4f}',
            '  change over an interval of': _shrinking(jump.widths_deg, jump.differences_n_m)}
    rows['continuous elsewhere, except at [deg]'] = ', '.join(
        f'{one.at_deg:.4f} (by {one.size_n_m:.3f} N m)' for one in others) or 'no other jump'
    rows['  steepest there [N m/deg]'] = f'{study.steepest_elsewhere:.4f}'
    rows[f'  at {study.smooth_at_deg:g} deg, change over'] = _shrinking(
        study.smooth_widths_deg, study.smooth_differences_n_m)
    return rows


def _shrinking(widths_deg: np.ndarray, differences: np.ndarray) -> str:
    """Return the difference over the widest and the narrowest interval."""
    return '\n'.join(f'{widths_deg[k]:.1e} deg: {differences[k]:.2g} N m' for k in (0, -1))


def map_table(found: Sequence[Findings]) -> Table | None:
    """Return the size of the jump over all axes, a column for each law."""
    shown = [(one.label, one.map) for one in found if one.map is not None]
    if not shown:
        return None
    columns = [_map_column(one) for _, one in shown]
    return grid_table(
        f'The jump about {len(shown[0][1].axes)} axes evenly over the hemisphere, to 0.01 degrees',
        ['', *(label for label, _ in shown)],
        [(name, *(column[name] for column in columns)) for name in columns[0]])


def _map_column(found: JumpMap) -> dict[str, str]:
    """Return the rows of one law."""
    jumps = np.isfinite(found.jump_n_m)
    names = ('axes with a jump', 'least jump [N m]', '  about the axis', 'largest jump [N m]',
             '  about this axis', 'off 180 degrees by up to [deg]')
    if not jumps.any():
        return dict.fromkeys(names, '-')
    least, largest = int(np.nanargmin(found.jump_n_m)), int(np.nanargmax(found.jump_n_m))
    return dict(zip(names, (
        f'{jumps.sum()} of {len(jumps)}', f'{found.jump_n_m[least]:.4f}',
        vector_text(found.axes[least]), f'{found.jump_n_m[largest]:.4f}',
        vector_text(found.axes[largest]), f'{np.nanmax(np.abs(found.at_deg - 180.0)):.3f}')))


def antipode_table(found: Sequence[Findings]) -> Table | None:
    """Return the circles around the antipode, a row for each law and radius."""
    rows = []
    for one in found:
        for k, circle in enumerate(one.antipode.circles if one.antipode is not None else ()):
            rows.append((
                one.label if k == 0 else '', f'{circle.radius_deg:g}', winding_text(circle),
                ', '.join(f'{jump.size_n_m:.2f}' for jump in circle.jumps) or 'none',
                f'{circle.least_across_n_m:.3f}', f'{circle.least_opposite_n_m:.3f}'))
    return None if not rows else grid_table(
        'Pointing (S^2) at rest: first torque around the antipode', (
            'law', 'radius [deg]', 'degree', 'jumps on the circle [N m]',
            'least torque across the axis [N m]', 'least change to the opposite side [N m]'),
        rows)


def winding_text(circle: Circle) -> str:
    """Return the degree; in brackets where the law jumps and only the short way is counted."""
    return f'({circle.winding:+d})' if circle.jumps else f'{circle.winding:+d}'


def as_data(found: Sequence[Findings], axis: np.ndarray) -> dict[str, Any]:
    """Return everything as JSON values; where there is no jump it is null."""
    return {'axis': _numbers(axis), 'laws': {one.name: {
        'label': one.label,
        'across_180_degrees': None if one.axis is None else _axis_data(one.axis),
        'over_axes': None if one.map is None else _map_data(one.map),
        'around_the_antipode': None if one.antipode is None else _antipode_data(one.antipode),
    } for one in found}}


def _axis_data(study: AxisStudy) -> dict[str, Any]:
    side = study.side_jump
    return {
        'theta_deg': _numbers(study.theta_deg), 'torque_B_n_m': _numbers(study.torque_B_n_m),
        'cost': _numbers(study.cost), 'side_changes': None if side is None else _jump_data(side),
        'other_jumps': [_jump_data(jump) for jump in study.jumps if jump is not side],
        'steepest_elsewhere_n_m_per_deg': study.steepest_elsewhere,
        'continuous_at': {
            'theta_deg': study.smooth_at_deg, 'interval_deg': _numbers(study.smooth_widths_deg),
            'difference_n_m': _numbers(study.smooth_differences_n_m)}}


def _jump_data(jump: Jump) -> dict[str, Any]:
    return {
        'at_deg': jump.at_deg, 'jump_n_m': jump.size_n_m, 'below_n_m': _numbers(jump.below_n_m),
        'above_n_m': _numbers(jump.above_n_m), 'interval_deg': _numbers(jump.widths_deg),
        'difference_n_m': _numbers(jump.differences_n_m)}


def _map_data(found: JumpMap) -> dict[str, Any]:
    return {'axes': _numbers(found.axes), 'at_deg': _numbers(found.at_deg),
            'jump_n_m': _numbers(found.jump_n_m)}


def _antipode_data(study: AntipodeStudy) -> dict[str, Any]:
    return {
        'circles': [{
            'radius_deg': circle.radius_deg, 'winding': circle.winding,
            'largest_step_deg': math.degrees(circle.largest_step_rad),
            'phase_deg': _numbers(circle.phase_deg),
            'torque_B_n_m': _numbers(circle.torque_B_n_m),
            'jumps': [{'phase_deg': jump.at_deg, 'jump_n_m': jump.size_n_m}
                      for jump in circle.jumps],
            'least_across_n_m': circle.least_across_n_m,
            'least_opposite_n_m': circle.least_opposite_n_m} for circle in study.circles],
        'field': {'position_deg': _numbers(study.field_deg),
                  'torque_across_n_m': _numbers(study.field_n_m)}}


def _numbers(values: np.ndarray) -> list[Any]:
    """Return numbers to 10 digits, NaN as None."""
    rounded = np.vectorize(lambda value: float(f'{value:.10g}'), otypes=[float])(values)
    return np.asarray(np.where(np.isnan(rounded), None, rounded.astype(object))).tolist()
