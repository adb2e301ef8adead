# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The figures of a whole campaign: counts, quantiles and extremes of its outcomes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.campaign.outcome import Outcome

# Cases listed as the worst in some way, and of those where a solve did not converge.
WORST, LISTED = 5, 20
# A turn that changes more often than this chatters.
MOST_CHANGES = 1


def summarise(outcomes: Sequence[Outcome], config: AttitudeMpcConfig) -> dict[str, Any]:
    """Map the outcomes of one set, at least one, to their figures.

    Nothing here depends on the machine or on how the work was shared; `solve_times` does.
    """
    settled = [o.settled_s for o in outcomes if o.settled_s is not None]
    by_time = sorted((o for o in outcomes if o.settled_s is not None),
                     key=lambda o: (-(o.settled_s or 0.0), o.name))
    by_error = sorted(outcomes, key=lambda o: (-o.final_angle_deg, o.name))
    changes = [o.changes for o in outcomes]
    times, counts = np.unique(settled, return_counts=True)
    figures: dict[str, Any] = {
        'loops': len(outcomes),
        'settled': len(settled),
        'settling_s': _quantiles(settled),
        'settling_histogram': {'settled_s': times.tolist(), 'loops': counts.tolist()},
        'slowest': [{'case': o.name, 'settled_s': o.settled_s} for o in by_time[:WORST]],
        'farthest_at_the_end': [
            {'case': o.name, 'final_angle_deg': o.final_angle_deg} for o in by_error[:WORST]],
        'turn_changes_most': max(changes),
        'loops_with_turn_changes': {str(n): k for n, k in sorted(Counter(changes).items())},
        'chattering_loops': sum(n > MOST_CHANGES for n in changes),
        'decrease_violations': sum(o.decrease_violations for o in outcomes),
        'largest_decrease_excess': _largest([o.largest_excess for o in outcomes]),
        'infeasible_solves': sum(o.infeasible for o in outcomes),
        'infeasible_after_feasible': sum(o.feasibility_lost for o in outcomes),
        'not_converged_solves': sum(o.not_converged for o in outcomes),
        'cases_not_converged': [o.name for o in outcomes if o.not_converged][:LISTED],
        'cases_infeasible': [o.name for o in outcomes if o.infeasible][:LISTED],
        'solves': sum(1 + len(o.warm_solves_s) for o in outcomes),
        'searches': sum(o.searches for o in outcomes),
        'searches_after_the_first': sum(max(o.searches - 1, 0) for o in outcomes),
        'limits_exceeded': sum(o.limits_exceeded for o in outcomes),
        'lost_loops': sum(o.lost for o in outcomes),
        'largest_torque_n_m': _axes_max([o.largest_torque_n_m for o in outcomes]),
        'largest_rate_rad_s': _axes_max([o.largest_rate_rad_s for o in outcomes]),
        'final_angle_deg': _quantiles([o.final_angle_deg for o in outcomes]),
        'largest_initial_angle_deg': max(o.initial_angle_deg for o in outcomes),
        'broken_loops': sum(bool(o.broken) for o in outcomes),
    }
    if any(o.cones for o in outcomes):
        figures['cones'] = {
            'loops_by_number': {str(n): k for n, k in sorted(
                Counter(o.cones for o in outcomes).items())},
            'loops_whose_straight_way_crosses_one': sum(o.way_crosses_a_cone for o in outcomes),
            'ticks_that_violate_one': sum(o.cone_violations for o in outcomes),
            'time_not_kept_for_sure_s': sum(o.cone_violation_s for o in outcomes),
            'least_margin_between_ticks_deg': min(
                o.least_cone_margin_deg for o in outcomes if o.least_cone_margin_deg is not None)}
    if config.target == 'pointing':
        turned = [abs(o.roll_turned_deg) for o in outcomes if o.roll_turned_deg is not None]
        figures['roll_turned_deg'] = _quantiles(turned)
    return figures


def solve_times(outcomes: Sequence[Outcome]) -> dict[str, float | None]:
    """Return median and 99th percentile of cold and warm solves [us], this machine's."""
    cold = 1e6 * np.array([o.cold_solve_s for o in outcomes])
    warm = 1e6 * np.concatenate([o.warm_solves_s for o in outcomes])
    return {
        f'{name}_us_{label}': round(float(np.quantile(values, q)), 1) if len(values) else None
        for name, values in (('cold', cold), ('warm', warm))
        for label, q in (('median', 0.5), ('p99', 0.99))}


def broken_cases(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return the records of the cases that broke anything, each to be run again by its name."""
    return [finite(o.record()) for o in outcomes if o.broken]


def finite(value: Any) -> Any:
    """Return JSON values: tuples as lists, numbers that are not finite as None."""
    if isinstance(value, dict):
        return {key: finite(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(part) for part in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _quantiles(values: Sequence[float]) -> dict[str, float] | None:
    """Return median, 99th percentile and maximum; None of nothing."""
    if not values:
        return None
    return {'median': float(np.median(values)), 'p99': float(np.quantile(values, 0.99)),
            'max': float(np.max(values))}


def _largest(values: Sequence[float]) -> float | None:
    """Return the largest value; None when one is not a number."""
    largest = float(np.max(values))
    return largest if np.isfinite(largest) else None


def _axes_max(vectors: Sequence[tuple[float, ...]]) -> list[float]:
    """Return the largest component of each axis."""
    return [float(value) for value in np.max(vectors, axis=0)]
