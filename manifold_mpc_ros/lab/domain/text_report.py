# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the verb ``domain`` says: how far it is, the table, and everything as data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from manifold_mpc_ros.cli import console as report
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.lab.domain.domain import NONE, Domain, Round

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.cli.progress import Progress
    from manifold_mpc_ros.lab.domain.states import Plane
    from manifold_mpc_ros.terminal.design import TerminalDesign

STATEMENT = ('Sampled: each state was asked by itself, and nothing is certified between them. '
             'Inside D_N: a plan was found and checked. Outside: no start of the search led to '
             'one.')


def show_round(progress: Progress, now: Round) -> None:
    """Show how far the search is."""
    progress.show(now.tried, f'{now.found} inside; round {now.number}: '
                  f'N = {", ".join(map(str, now.horizons))}; '
                  f'{now.decided} of {now.states} states decided', now.to_try)


def show(console: Console, config: AttitudeMpcConfig, domains: Sequence[Domain],
         elapsed_s: float) -> None:
    """Print the smallest N of each group, then how much of each is in D_N for every N."""
    for domain in domains:
        console.print(report.result_table(
            f'{_capitalised(domain.states.name)}: sampled', _rows(config, domain)))
    most = max(int(domain.smallest.max()) for domain in domains)
    console.print(report.grid_table(
        'States inside D_N, and those of which N is the smallest',
        ('N', *(text for domain in domains for text in (domain.states.name, 'smallest'))),
        [(f'{n}' + (' (X_T)' if n == 0 else ''), *_cells(domains, n)) for n in range(most + 1)]))
    console.print(STATEMENT)
    console.print(f'{sum(len(domain.states) for domain in domains)} states in the tables, '
                  f'{elapsed_s:.0f} s in all')


def as_data(
    config: AttitudeMpcConfig, terminal: TerminalDesign, domains: Sequence[Domain],
    planes: Sequence[tuple[Plane, Domain]],
) -> dict[str, Any]:
    """Return everything as JSON values; a smallest N of null: none was found."""
    return {
        'statement': STATEMENT,
        'target': config.target,
        'step_s': config.step_s,
        'inertia_kg_m2': config.inertia_kg_m2.tolist(),
        'max_torque_n_m': _limits(config.max_torque_n_m),
        'max_rate_rad_s': _limits(config.max_rate_rad_s),
        'terminal_level_c': terminal.c,
        'configured_horizon': config.horizon,
        'groups': [_group_data(config, domain) for domain in domains],
        'planes': [{'axes': plane.axes.T.tolist(), 'states': len(domain.states),
                    'smallest_horizons': _plain(domain.smallest)} for plane, domain in planes],
    }


def horizon_text(config: AttitudeMpcConfig, domain: Domain) -> str:
    """Say which N is enough for all states of a group."""
    if domain.largest == NONE:
        return f'{_count(domain.smallest == NONE)} states without a plan at any N tried'
    return (f'{domain.largest} ({domain.largest * config.step_s:g} s) is enough for each of '
            f'{len(domain.states)} states')


def configured_text(config: AttitudeMpcConfig, domain: Domain) -> str:
    """Say whether the configured N is enough for a group."""
    outside = len(domain.states) - int(domain.inside(config.horizon).sum())
    if outside == 0:
        return f'{config.horizon} (enough: all {len(domain.states)} sampled states are inside)'
    return (f'{config.horizon} (NOT enough: from {outside} of {len(domain.states)} sampled '
            'states no plan was found that ends in the terminal set)')


def hardest_text(domain: Domain) -> str:
    """Describe the state that needs the largest N."""
    vector, rate = (values[domain.hardest] for values in (domain.states.vectors,
                                                          domain.states.rates))
    angle = float(np.linalg.norm(vector))
    text = f'{math.degrees(angle):.4g} deg'
    if angle > 0:
        text += f' about {report.vector_text(np.round(vector / angle, 4) + 0.0)}'
    return text + (f' at {report.vector_text(rate, "rad/s")}' if np.any(rate) else '')


def _rows(config: AttitudeMpcConfig, domain: Domain) -> list[tuple[str, str]]:
    """Return the summary of one group."""
    equals = _count(domain.smallest == domain.smallest[domain.hardest])
    rows = [('smallest N for all', horizon_text(config, domain)),
            ('hardest', f'{hardest_text(domain)} ({equals} in the group need as many steps)'),
            ('configured N', configured_text(config, domain))]
    if domain.states.covering_rad is not None:
        what = 'attitude' if config.target == 'attitude' else 'direction'
        rows.append(('covering radius', f'{math.degrees(domain.states.covering_rad):.3g} deg: no '
                     f'{what} is farther than that from the grid'))
    return rows


def _cells(domains: Sequence[Domain], n: int) -> Iterator[str]:
    """Return how much of each group is inside D_n, and how many states have n as smallest N."""
    for domain in domains:
        yield f'{100 * domain.inside(n).mean():.2f} %'
        yield str(_count(domain.smallest == n))


def _group_data(config: AttitudeMpcConfig, domain: Domain) -> dict[str, Any]:
    """Return one group as JSON values."""
    states, found = domain.states, [int(n) for n in np.unique(domain.smallest) if n != NONE]
    covering = states.covering_rad
    return {
        'name': states.name,
        'states': len(states),
        'covering_radius_deg': None if covering is None else math.degrees(covering),
        'smallest_horizon_for_all': None if domain.largest == NONE else domain.largest,
        'all_inside_configured': bool(domain.inside(config.horizon).all()),
        'histogram': {str(n): _count(domain.smallest == n) for n in found},
        'fraction_inside': {str(n): float(domain.inside(n).mean())
                            for n in range(max(found, default=0) + 1)},
        'no_plan_found': _count(domain.smallest == NONE),
        'hardest_rotation_vector_rad': states.vectors[domain.hardest].tolist(),
        'hardest_rate_rad_s': states.rates[domain.hardest].tolist(),
        'smallest_horizons': _plain(domain.smallest),
    }


def _plain(smallest: np.ndarray) -> list[int | None]:
    """Return smallest N as JSON values."""
    return [None if n == NONE else int(n) for n in smallest]


def _limits(limits: np.ndarray | None) -> list[float | None] | None:
    """Return limits as JSON values, an infinite one as null."""
    return None if limits is None else [
        float(value) if math.isfinite(value) else None for value in limits]


def _count(mask: np.ndarray) -> int:
    """Return how many are true."""
    return int(np.count_nonzero(mask))


def _capitalised(text: str) -> str:
    """Return the text with a capital letter in front."""
    return text[:1].upper() + text[1:]
