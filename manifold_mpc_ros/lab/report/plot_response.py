# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of one slew: attitude error, body rate and torque over time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from manifold_mpc_ros.cli.plot_style import (
    AXIS_COLOURS,
    AXIS_NAMES,
    INK,
    LIMIT_COLOUR,
    draw_limits,
    legend_right,
    save_figure,
    styled,
)

# The ends of the logarithmic axis of the attitude error [degrees].
ERROR_RANGE_DEG = (1e-3, 400.0)


@dataclass(frozen=True, eq=False)
class Response:
    """What is drawn of one slew: n states, m commands, the limits and the tolerance."""

    title: str
    state_time_s: np.ndarray        # (n,)
    attitude_error_rad: np.ndarray  # (n,)
    omega_BN_B: np.ndarray          # (n, 3) [rad/s]
    torque_time_s: np.ndarray       # (m,)
    torque_B_n_m: np.ndarray        # (m, 3), each held until the next
    max_rate_rad_s: np.ndarray | None
    max_torque_n_m: np.ndarray | None
    attitude_tolerance_rad: float
    settled_s: float | None
    target: str = 'attitude'  # or 'pointing': what the error is an error of


def plot_response(response: Response, path: Path) -> Path:
    """Draw the three panels into a PNG."""
    with styled():
        figure = Figure(figsize=(9.0, 8.0), layout='constrained')
        figure.suptitle(response.title, fontsize=13)
        error, rate, torque = figure.subplots(3, 1, sharex=True)
        _draw_error(error, response)
        draw_limits(rate, response.max_rate_rad_s)
        draw_limits(torque, response.max_torque_n_m)
        for axis, (name, colour) in enumerate(zip(AXIS_NAMES, AXIS_COLOURS, strict=True)):
            rate.plot(response.state_time_s, response.omega_BN_B[:, axis], color=colour,
                      label=name)
            torque.step(response.torque_time_s, response.torque_B_n_m[:, axis], where='post',
                        color=colour, label=name)
        rate.set_ylabel('body rate [rad/s]')
        torque.set_ylabel('body torque [N m]')
        torque.set_xlabel('time [s]')
        torque.set_xlim(0.0, float(response.state_time_s[-1]))
        for axes in (error, rate, torque):
            _mark_settled(axes, response.settled_s)
            legend_right(axes)
        figure.align_ylabels()
        return save_figure(figure, path)


def _draw_error(axes: Axes, response: Response) -> None:
    """Draw the error over decades, with the tolerance."""
    degrees = np.degrees(response.attitude_error_rad)
    axes.semilogy(response.state_time_s, np.maximum(degrees, 1e-12), color=INK, label='error')
    tolerance = math.degrees(response.attitude_tolerance_rad)
    axes.axhline(tolerance, color=LIMIT_COLOUR, linestyle='--', linewidth=1.2,
                 label='tolerance')
    axes.set_ylim(*ERROR_RANGE_DEG)
    axes.yaxis.set_major_formatter(lambda value, _: f'{value:g}')
    axes.set_ylabel(f'{response.target} error [deg]')


def _mark_settled(axes: Axes, settled_s: float | None) -> None:
    """Draw the time after which the body stays at rest at its attitude."""
    if settled_s is not None:
        axes.axvline(settled_s, color=LIMIT_COLOUR, linestyle=':', linewidth=1.4,
                     label=f'settled\nat {settled_s:.1f} s')
