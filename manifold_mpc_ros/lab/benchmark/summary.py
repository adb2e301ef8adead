# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a run comes to, as JSON values: one row for each solver, horizon, and way of starting."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from manifold_mpc_ros.lab.benchmark.measure import Comparison, Record
from manifold_mpc_ros.lab.benchmark.peers.instances import Instance
from manifold_mpc_ros.lab.benchmark.peers.solver import ON_THE_GROUP

#: A cost is at the best known one within this, relative.
SAME_COST = 1e-6
_DIGITS = 6


def rows_of(comparison: Comparison, instances: Sequence[Instance]) -> list[dict[str, Any]]:
    """Return the rows of one horizon; a solver that could not be had says why."""
    rows = []
    for record in comparison.records:
        shared = {'solver': record.entry.name, 'horizon': comparison.horizon,
                  'ours': record.entry.ours, 'formulation': record.entry.formulation}
        if record.why_not:
            rows.append({**shared, 'start': 'none', 'why_not': record.why_not})
        if record.cold:
            rows.append({**shared, 'start': 'cold', **_times(record.cold_s),
                         **_ends(record, warm=False),
                         **_costs(comparison, record, instances)})
        if record.warm:
            rows.append({**shared, 'start': 'warm', **_times(record.warm_s),
                         **_ends(record, warm=True)})
    return rows


def _times(pairs: Sequence[tuple[float, float]]) -> dict[str, float | None]:
    """Return median and 99th percentile of both clocks [us]."""
    microseconds = 1e6 * np.array(pairs)
    values: dict[str, float | None] = {}
    for column, name in enumerate(('solver_us', 'call_us')):
        values[f'{name}_median'] = _rounded(np.median(microseconds[:, column]))
        values[f'{name}_p99'] = _rounded(np.percentile(microseconds[:, column], 99))
    return values


def _ends(record: Record, *, warm: bool) -> dict[str, Any]:
    """Return how the solves ended, and what the process needed."""
    answers = record.warm if warm else record.cold
    iterations = [answer.iterations for answer in answers]
    return {
        'solves': len(answers),
        'failures': sum(not answer.converged for answer in answers),
        'iterations_median': float(np.median(iterations)),
        'iterations_p99': _rounded(np.percentile(iterations, 99)),
        'peak_memory_mb': _rounded(record.peak_memory_bytes / 1e6),
        'build_beside_others_s': _rounded(record.build_s),
        'version': record.version,
        'ahead_of_other_processes': record.undisturbed,
    }


def _costs(comparison: Comparison, record: Record, instances: Sequence[Instance]
           ) -> dict[str, Any]:
    """Return costs over the best known of the formulation, and on our model over our best."""
    best = comparison.best[record.entry.formulation][record.asked]
    excess = np.array([answer.cost for answer in record.cold]) / best - 1
    kinds = np.array([instances[i].kind for i in record.asked])
    converged = np.array([answer.converged for answer in record.cold])
    on_the_group = np.array(record.group_cost) / comparison.best[ON_THE_GROUP][record.asked] - 1
    values: dict[str, Any] = {
        'dearer_than_best_known': int(np.sum(converged & (excess > SAME_COST))),
        'largest_excess': _rounded(np.max(excess[converged], initial=0.0)),
        'excess_on_our_model_median': _rounded(np.median(on_the_group)),
        'largest_excess_on_our_model': _rounded(np.max(on_the_group)),
    }
    for kind in dict.fromkeys(each.kind for each in instances):
        mask = converged & (kinds == kind)
        name = kind.replace(' ', '_')
        values[f'{name}_solves'] = int(np.sum(kinds == kind))
        values[f'{name}_dearer'] = int(np.sum(excess[mask] > SAME_COST))
        values[f'{name}_largest_excess'] = _rounded(np.max(excess[mask], initial=0.0))
    return values


def _rounded(value: Any) -> float | None:
    """Return a number with as many digits as it is worth, None for one that is not finite."""
    return float(f'{float(value):.{_DIGITS}g}') if np.isfinite(value) else None
