# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One case of a campaign again, tick by tick."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from manifold_mpc_ros.cli import console as report
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.campaign import turning
from manifold_mpc_ros.lab.campaign.case import CaseName, draw_case
from manifold_mpc_ros.lab.campaign.loop import Course, run_case
from manifold_mpc_ros.lab.campaign.outcome import decrease_excess, judge, stage_costs_of
from manifold_mpc_ros.lab.campaign.output.text_report import title_of
from manifold_mpc_ros.mpc.target import error_angle

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.campaign.chunks import Work

# Of the course of one case: time, error, rate, largest torque, value, stage cost, relative
# V+ - (V - L), turn (its side, or where its direction reversed), status, whether it searched.
COURSE_HEADER = ('s', 'deg', 'rad/s', 'N m', 'V', 'L', 'excess', 'turn', 'status', 'search')

def show_case(console: Console, work: Work, name: CaseName) -> int:
    """Run one case and print its course; 0 when it broke nothing, otherwise 1."""
    plan = work.plan
    case = draw_case(plan, name)
    with console.status('Designing the terminal set and building the solver'):
        controller = work.build(case.cones)
    course = run_case(controller, plan, case)
    outcome = judge(course, plan)
    console.print(report.grid_table(
        f'{name} of {title_of(case.drawn_from, plan)}, seed {plan.seed}',
        COURSE_HEADER, _course_rows(course, plan.config)))
    console.print(report.result_table('Outcome', [
        (key.replace('_', ' '), _plain(value)) for key, value in outcome.record().items()]))
    return 1 if outcome.broken else 0


def _course_rows(course: Course, config: AttitudeMpcConfig) -> list[tuple[str, ...]]:
    """Return a row of text for each tick."""
    angle = np.degrees(error_angle(config, course.R_DB))
    paid = stage_costs_of(course, config)
    excess = [*(f'{value:.1e}' for value in decrease_excess(course, config)), '']
    sides = _turns(course, config)
    return [(
        f'{config.step_s * k:g}', f'{angle[k]:.4f}',
        f'{np.linalg.norm(course.omega_BN_B[k]):.5f}',
        f'{np.max(np.abs(course.torque_B_n_m[k])):.4f}', f'{course.value[k]:.1e}',
        f'{paid[k]:.1e}', excess[k], sides[k],
        str(course.status[k]), 'yes' if course.searched[k] else '',
    ) for k in range(len(angle))]


def _turns(course: Course, config: AttitudeMpcConfig) -> list[str]:
    """Return the side of the turn at each tick; for pointing, where its direction reversed."""
    if config.target == 'pointing':
        back = turning.reversals(config.pointing_axis_B, course.R_DB, course.plan_R_DB)
        return ['back' if reversed_here else '' for reversed_here in back]
    return [f'{side:+.0f}' for side in turning.sides_of_turn(course.R_DB, course.plan_R_DB)]


def _plain(value: object) -> str:
    """Return a figure as text."""
    if isinstance(value, tuple):
        return ', '.join(map(_plain, value)) or 'nothing'
    return f'{value:.6g}' if isinstance(value, float) else str(value)
