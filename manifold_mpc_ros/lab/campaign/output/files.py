# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the verb ``campaign`` writes: table, figures, pictures and the page that shows them."""

from __future__ import annotations

import json
import platform
import re
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manifold_mpc_ros.lab.campaign.outcome import ABSOLUTE, RELATIVE
from manifold_mpc_ros.lab.campaign.output.text_report import by_set, title_of
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.lab.campaign.summary import broken_cases, finite, solve_times, summarise
from manifold_mpc_ros.lab.campaign.table import write_table

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.campaign.run import Run


def write(plan: CampaignPlan, done: Run, folder: Path) -> list[Path]:
    """Write everything into a folder; return where it is."""
    from manifold_mpc_ros.lab.campaign.output.page import write_page
    from manifold_mpc_ros.lab.campaign.output.plot_campaign import plot_campaign
    from manifold_mpc_ros.lab.campaign.output.plot_spread import plot_spread
    data = folder / 'campaign.json'
    text = json.dumps(as_data(plan, done), indent=2, allow_nan=False)
    data.write_text(_with_short_lists(text) + '\n', encoding='utf-8')
    pictures = [plot_campaign(plan, done.outcomes, folder / 'campaign.png')]
    spread = plot_spread(plan, done.outcomes, folder / 'spread.png')
    if spread is not None:
        pictures.append(spread)
    table = write_table(plan, done.outcomes, folder / 'loops.parquet')
    page = write_page(plan, done, pictures, folder)
    return [table, data, *pictures, page]


def _plain(value: Any) -> Any:
    """Return a value of a configuration as JSON holds it: arrays, cones and wheels in parts."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple):
        return list(map(_plain, value))
    if is_dataclass(value):
        return {entry.name: _plain(getattr(value, entry.name)) for entry in fields(value)}
    return value


def as_data(plan: CampaignPlan, done: Run) -> dict[str, Any]:
    """Return every figure as JSON values."""
    config = plan.config
    described = {field.name: getattr(config, field.name) for field in fields(config)}
    groups = by_set(plan, done.outcomes)
    sets = {one.name: one for one in plan.sets}
    return finite({
        'campaign': plan.name, 'description': plan.description,
        'controller': {name: _plain(value) for name, value in described.items()},
        'settings': {
            'seed': plan.seed, 'steps': plan.steps, 'duration_s': plan.duration_s,
            'simulator': dict(plan.simulator), 'decrease_relative': RELATIVE,
            'decrease_absolute': ABSOLUTE},
        'planned': done.planned, 'complete': done.complete,
        'sets': {name: {'start': title_of(sets[name], plan), 'drawn': sets[name].as_mapping(),
                        **summarise(group, config)} for name, group in groups.items()},
        'broken': broken_cases(done.outcomes),
        'this_machine': {
            'machine': platform.machine(), 'python': platform.python_version(),
            'where': done.where, 'loops': done.new, 'elapsed_s': round(done.elapsed_s, 1),
            'solve_times': {name: solve_times(group) for name, group in groups.items()}},
    })


def _with_short_lists(text: str) -> str:
    """Put the innermost lists of a JSON text without braces in them on one line each."""
    return re.sub(r'\[[^][{}"]*\]', lambda match: ' '.join(match.group().split()), text)
