# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of the report page over time: one run in nine panels or more, several runs in four."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from manifold_mpc_ros.cli.plot_style import AXIS_COLOURS, AXIS_NAMES, INK, LIMIT_COLOUR
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.lab.recording.bags import measures
from manifold_mpc_ros.lab.recording.bags.cones import cone_histories
from manifold_mpc_ros.lab.recording.bags.run import BagRun
from manifold_mpc_ros.lab.recording.bags.series import MOTOR_TORQUE, WHEEL_SPEED
from manifold_mpc_ros.lab.report import motion
from manifold_mpc_ros.lab.report.plot_cones import margins_deg
from manifold_mpc_ros.lie.arrays import Array

PANEL_PX = 186
#: The panel that says how much of their torque or momentum wheels use.
SATURATION = 'saturation of wheels [1]'
#: Between two panels, in panels.
GAP = 0.14
#: Colours of runs that are compared, told apart by colour-blind readers (Okabe and Ito).
RUN_COLOURS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#222222')
#: What a tick ended as, with the colour of its mark.
OUTCOMES = {
    'NOMINAL, converged': '#0072B2', 'NOMINAL, feasible': '#E69F00',
    'NOMINAL, infeasible': '#D55E00', 'FALLBACK': '#CC79A7', 'COAST': '#666666',
    'WAIT': '#AAAAAA', 'PAUSED': '#AAAAAA'}
_FONT = {'family': 'system-ui, -apple-system, Segoe UI, Roboto, Helvetica Neue, Arial, sans-serif',
         'size': 13, 'color': INK}
#: Logarithmic axes end here: below is rounding.
_LEAST_DEG, _LEAST_VALUE = 1e-7, 1e-14
#: Marks of a logarithmic axis of times.
_TICKS_MS = [mantissa * 10.0 ** exponent for exponent in range(-3, 5) for mantissa in (1, 3)]


def histories(run: BagRun) -> go.Figure:
    """Return error, rate, torque, solver, value, cones, devices and motion of one run."""
    config = None if run.scenario is None else run.scenario.controller_config.mpc
    cones, devices = cone_histories(run), device_histories(run, config)
    further = _motion(run, config)
    figure = _panels(f'{_target(run)} error [deg]', 'body rate [rad/s]', 'torque [N m]',
                     'solve time [ms]', 'value function', *['cone margin [deg]'][:len(cones)],
                     *devices, *further)
    # The first shape is the cursor, which the page moves.
    figure.add_shape(type='line', xref='x', yref='paper', x0=0, x1=0, y0=0, y1=1,
                     line={'color': '#0072B2', 'width': 1.5})
    _line(figure, 1, run.states.time_s, np.degrees(run.error_rad),
          'error', INK)
    if run.scenario is not None:
        _level(figure, 1, run.scenario.acceptance.attitude_tolerance_deg, 'tolerance')
    if config is not None and (reference := motion.bang_bang(run, config)) is not None:
        _line(figure, 1, *reference, 'bang-bang', '#E69F00', dash='dot')
    for axis, (name, colour) in enumerate(zip(AXIS_NAMES, AXIS_COLOURS, strict=True)):
        _line(figure, 2, run.states.time_s, run.states.omega_BN_B[:, axis], name, colour)
        _line(figure, 3, run.commands.time_s, run.commands.torque_B_n_m[:, axis], name, colour,
              shape='hv')
    if config is not None:
        _limits(figure, 2, config.max_rate_rad_s)
        _limits(figure, 3, config.max_torque_n_m)
    _solver(figure, run)
    _value(figure, run)
    figure.update_yaxes(type='log', tickvals=_TICKS_MS, tickformat='~g', row=4, col=1)
    _logarithmic(figure, 1, [np.degrees(run.error_rad)], _LEAST_DEG)
    _logarithmic(figure, 5, [run.ticks.value_function], _LEAST_VALUE)
    margins = margins_deg(cones) if cones else {}
    for (name, values), colour in zip(margins.items(), itertools.cycle(RUN_COLOURS)):
        _line(figure, 6, run.states.time_s, values, name, colour)
    if cones:
        _level(figure, 6, 0.0, 'limit')
    first = 7 if cones else 6
    for row, (quantity, named) in enumerate(devices.items(), start=first):
        for (name, each), colour in zip(named.items(), itertools.cycle(RUN_COLOURS)):
            _line(figure, row, measures.tick_times_s(run), each, name, colour, shape='hv')
        _wheel_limits(figure, row, quantity, None if config is None else config.wheels)
    first += len(devices)
    for row, curves in enumerate(further.values(), start=first):
        for (name, values), colour in zip(curves.items(), (*AXIS_COLOURS, INK)):
            _line(figure, row, run.states.time_s, values, name, colour)
    _finish(figure, [run], first - 1 + len(further))
    for time_s in measures.commands_at_s(run):
        figure.add_vline(x=time_s, line={'color': LIMIT_COLOUR, 'width': 1, 'dash': 'dot'})
    return figure


def device_histories(run: BagRun, config: AttitudeMpcConfig | None
                     ) -> dict[str, Mapping[str, Array]]:
    """Return what the devices did by quantity and name, how saturated wheels were among it.

    That is the larger part of motor torque and momentum, of the rate in the body.
    """
    devices = dict(run.ticks.devices)
    wheels = None if config is None else config.wheels
    said = [devices.get(quantity, {}) for quantity in (MOTOR_TORQUE, WHEEL_SPEED)]
    if wheels and wheels.inertia_kg_m2 is not None and all(
            set(wheels.names) <= set(each) for each in said):
        torque, speed = (np.array([each[name] for name in wheels.names]).T for each in said)
        parts = np.maximum(np.abs(torque) / wheels.max_torque_n_m, np.abs(
            speed * wheels.inertia_kg_m2) / wheels.max_momentum_n_m_s)
        devices[SATURATION] = dict(zip(wheels.names, parts.T))
    return devices


def _wheel_limits(figure: go.Figure, row: int, quantity: str, wheels: WheelArray | None) -> None:
    """Add the limits of what wheels do to a panel, where there are any."""
    if wheels is None:
        return
    if quantity == MOTOR_TORQUE:
        _limits(figure, row, wheels.max_torque_n_m)
    elif quantity == WHEEL_SPEED and wheels.inertia_kg_m2 is not None:
        _limits(figure, row, wheels.max_momentum_n_m_s / wheels.inertia_kg_m2)
    elif quantity == SATURATION:
        _level(figure, row, 1.0, 'limit')


def _motion(run: BagRun, config: AttitudeMpcConfig | None) -> dict[str, dict[str, Array]]:
    """Return what follows from the states: curves by their names, by the titles of panels."""
    q = motion.quaternions_wxyz(run)
    found = {'quaternion': dict(zip(('x', 'y', 'z', 'w'), q[:, [1, 2, 3, 0]].T))}
    if config is not None and config.target == 'attitude':
        found = {'error by axis [deg]': dict(zip(
            AXIS_NAMES, motion.error_vectors_deg(run).T))} | found
    if config is not None:
        found['momentum, inertial [N m s]'] = dict(zip(
            AXIS_NAMES, motion.momentum_N(run, config).T))
        found['kinetic energy [J]'] = {'energy': motion.energy_j(run, config)}
    return found


def comparison(runs: Sequence[BagRun], names: Sequence[str]) -> go.Figure:
    """Return error, norms of rate and torque, and value function of several runs."""
    figure = _panels('error [deg]', '|rate| [rad/s]', '|torque| [N m]', 'value function')
    for index, (run, name) in enumerate(zip(runs, names, strict=True)):
        colour = RUN_COLOURS[index % len(RUN_COLOURS)]
        rate = np.linalg.norm(run.states.omega_BN_B, axis=1)
        torque = np.linalg.norm(run.commands.torque_B_n_m, axis=1)
        rows: list[tuple[Array, Array, str]] = [
            (run.states.time_s, np.degrees(run.error_rad), 'linear'),
            (run.states.time_s, rate, 'linear'),
            (run.commands.time_s, torque, 'hv'),
            (measures.tick_times_s(run), run.ticks.value_function, 'linear')]
        for row, (time_s, values, shape) in enumerate(rows, start=1):
            _line(figure, row, time_s, values, name, colour, shape=shape, group=name,
                  legend='legend', show=row == 1)
    _logarithmic(figure, 1, [np.degrees(run.error_rad) for run in runs], _LEAST_DEG)
    _logarithmic(figure, 4, [run.ticks.value_function for run in runs], _LEAST_VALUE)
    _finish(figure, runs, 4)
    return figure


def _target(run: BagRun) -> str:
    """Return what the error is an error of."""
    return 'attitude' if run.scenario is None else run.scenario.controller_config.mpc.target


def _panels(*titles: str) -> go.Figure:
    """Return a figure of panels above each other that share their time axis."""
    figure = make_subplots(rows=len(titles), cols=1, shared_xaxes=True,
                           vertical_spacing=GAP / len(titles))
    for row, title in enumerate(titles, start=1):
        figure.update_yaxes(title_text=title, row=row, col=1)
    return figure


def _line(
    figure: go.Figure, row: int, time_s: Array, values: Array, name: str, colour: str,
    *, shape: str = 'linear', dash: str = 'solid', group: str | None = None, legend: str = '',
    show: bool = True, width: float = 1.8,
) -> None:
    """Add a curve to a panel."""
    figure.add_trace(go.Scatter(
        x=time_s, y=values, name=name, mode='lines', legendgroup=group, showlegend=show,
        legend=legend or _legend(row),
        line={'color': colour, 'width': width, 'shape': shape, 'dash': dash},
        hovertemplate='%{y:.4g}'), row=row, col=1)


def _logarithmic(
    figure: go.Figure, row: int, values: Sequence[Array], least: float,
) -> None:
    """Give a panel a logarithmic axis that shows all values above ``least``."""
    shown = np.concatenate(values)
    shown = shown[np.isfinite(shown) & (shown > least)]
    low, high = (float(shown.min()), float(shown.max())) if len(shown) else (least, 1.0)
    decades = np.log10(high) - np.log10(low)
    figure.update_yaxes(
        type='log', exponentformat='power', row=row, col=1, dtick=max(1.0, np.ceil(decades / 4)),
        range=[np.log10(low) - 0.3, np.log10(high) + 0.3])


def _legend(row: int) -> str:
    """Return the name of a panel's legend."""
    return 'legend' if row == 1 else f'legend{row}'


def _level(figure: go.Figure, row: int, value: float, name: str) -> None:
    """Add a horizontal line that the legend names."""
    figure.add_hline(y=value, row=row, col=1, line={'color': LIMIT_COLOUR, 'width': 1.2,
                                                    'dash': 'dash'})
    figure.add_trace(go.Scatter(
        x=[None], y=[None], mode='lines', name=name, legend=_legend(row),
        line={'color': LIMIT_COLOUR, 'width': 1.2, 'dash': 'dash'}), row=row, col=1)


def _limits(figure: go.Figure, row: int, limits: Array | None) -> None:
    """Add the finite limits of both signs."""
    values = [] if limits is None else sorted({float(each) for each in limits
                                               if np.isfinite(each)})
    for index, value in enumerate(values):
        if index == 0:
            _level(figure, row, value, 'limit')
        for level in ([-value] if index == 0 else [value, -value]):
            figure.add_hline(y=level, row=row, col=1, line={
                'color': LIMIT_COLOUR, 'width': 1.2, 'dash': 'dash'})


def _solver(figure: go.Figure, run: BagRun) -> None:
    """Add the solve time of each tick, coloured by mode and status."""
    time_s, solve_ms = measures.tick_times_s(run), 1e3 * run.ticks.solve_time_s
    known = solve_ms[np.isfinite(solve_ms)]
    solve_ms = np.where(np.isfinite(solve_ms), solve_ms, known.min() if len(known) else 1.0)
    labels = np.array([_outcome(mode, status) for mode, status in zip(
        run.ticks.mode, run.ticks.solver_status, strict=True)], dtype=str)
    for label in dict.fromkeys(labels):
        chosen = labels == label
        figure.add_trace(go.Scatter(
            x=time_s[chosen], y=solve_ms[chosen], mode='markers', name=str(label),
            legend=_legend(4), customdata=run.ticks.iterations[chosen],
            marker={'color': OUTCOMES.get(str(label), '#D55E00'), 'size': 5},
            hovertemplate='%{y:.3g} ms, %{customdata:.0f} iterations'), row=4, col=1)


def _outcome(mode: str, status: str) -> str:
    """Return what a tick ended as."""
    return f'{mode}, {status}' if mode == 'NOMINAL' and status else mode or 'unknown'


def _value(figure: go.Figure, run: BagRun) -> None:
    """Add the value function, what the tick before promised of it, and how much it fell."""
    time_s, ticks = measures.tick_times_s(run), run.ticks
    _line(figure, 5, time_s, ticks.value_function, 'V', INK)
    _line(figure, 5, time_s, ticks.promised_value, 'promised at most', '#E69F00', dash='dot')
    if len(time_s) > 1:
        _line(figure, 5, time_s[1:], -np.diff(ticks.value_function), 'decrease', '#009E73',
              width=1.2)


def _finish(figure: go.Figure, runs: Sequence[BagRun], rows: int) -> None:
    """Set sizes, fonts, grids and one legend beside each panel."""
    end_s = max(float(run.states.time_s[-1]) for run in runs)
    figure.update_xaxes(range=[0.0, end_s or 1.0], showgrid=True, gridcolor='#E6EAEE',
                        zeroline=False, linecolor='#B8C0C9')
    figure.update_xaxes(title_text='time [s]', row=rows, col=1)
    figure.update_yaxes(exponentformat='power', gridcolor='#E6EAEE', zeroline=False,
                        linecolor='#B8C0C9', title_font={'size': 12.5}, automargin=False)
    legends: dict[str, Any] = {
        _legend(row): {'x': 1.01, 'y': 1.0 - (row - 1) * (1.0 + GAP / rows) / rows,
                       'yanchor': 'top', 'font': {'size': 12}, 'tracegroupgap': 0}
        for row in range(1, rows + 1)}
    figure.update_layout(
        height=PANEL_PX * rows + 80, margin={'l': 76, 'r': 150, 't': 32, 'b': 44}, font=_FONT,
        paper_bgcolor='white', plot_bgcolor='white', hovermode='x unified', **legends)
