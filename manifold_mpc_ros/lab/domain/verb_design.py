# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``design``: terminal cost, local law, terminal set, its checks, smallest N."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.rate_limits import RateBox, RateEllipsoid

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.domain.horizon import HorizonReport
    from manifold_mpc_ros.terminal.design import TerminalDesign
    from manifold_mpc_ros.terminal.existence import Existence

EXAMPLES = """\
  manifold-mpc design
      the shipped controller
  manifold-mpc design --controller-config mine.yaml --json mine.json
      another one, and everything that is printed as data
  manifold-mpc design --no-horizon
      without the search for the smallest horizon, which takes a while
"""
# What stops the terminal set from being larger, in words.
CONDITIONS = {
    'chart': 'the chart ends, half a turn away',
    'torque': 'torque limit, |K xi| <= max_torque (8a)',
    **{kind.name: kind.description for kind in (RateBox, RateEllipsoid)},
    'step': 'existence of the implicit step',
    'decrease': "decrease, F(xi') - F(xi) <= -L (8c)",
}
# The chart of each target: what xi is, and the names of its coordinates.
RATES = ('omega x', 'omega y', 'omega z')
CHARTS = {
    'attitude': ('(zeta, omega) = (Log g, Log f / h)', ('zeta x', 'zeta y', 'zeta z', *RATES)),
    'pointing': ('(x, omega) = (E^T x, Log f / h)', ('x 1', 'x 2', *RATES)),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    shared.add_controller_config(parser)
    parser.add_argument(
        '--no-horizon', action='store_true',
        help='do not search the smallest horizon from which sampled states at rest are feasible')
    parser.add_argument(
        '--json', type=Path, metavar='FILE', help='write everything to a file as well')


def run(arguments: argparse.Namespace) -> int:
    """Design, print; 1 when the configured horizon is not enough."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.terminal.problem_of import terminal_design
    path = shared.controller_config_path(arguments.controller_config)
    config = AttitudeMpcConfig.from_yaml(path).with_equal_steps
    console = report.make_console()
    console.print(f'Controller: {path}', soft_wrap=True, markup=False)
    with console.status('Designing the terminal set'):
        design = terminal_design(config)
    _print_design(console, design, config.target)
    shares = momentum_shares(config, design)
    if shares:
        console.print(report.result_table('What stored momentum leaves of c', [
            (f'{part:.0%} stored', f'{share:.4g} c, at rest inside up to '
             f'{rest_angle_deg(design, share):.1f} deg') for part, share in shares.items()]))
    horizon = None
    if not arguments.no_horizon:
        horizon = _find_horizon(console, config, design)
        _print_horizon(console, horizon, config)
    if arguments.json is not None:
        data = as_data(config, design, horizon) | {'momentum_shares': {
            str(part): share for part, share in shares.items()}}
        text = json.dumps(data, indent=2, allow_nan=False)
        arguments.json.write_text(text + '\n', encoding='utf-8')
        report.say_written(console, [arguments.json])
    return int(horizon is not None and horizon.smallest > config.horizon)


def _print_design(console: Console, design: TerminalDesign, target: str) -> None:
    """Print matrices, level and checks."""
    from manifold_mpc_ros.cli import console as report
    chart, axes = CHARTS[target]
    console.print(report.grid_table(
        f'P: terminal cost F = xi^T P xi / 2, xi = {chart}', ('', *axes), _rows(axes, design.P)))
    console.print(report.grid_table(
        'K: local law tau = K xi [N m]', ('', *axes),
        _rows(('tau x', 'tau y', 'tau z'), design.K)))
    limiting = design.report.limiting
    console.print(report.grid_table(
        'c of the terminal set xi^T P xi <= c',
        ('condition', 'first broken at', ''),
        [(CONDITIONS.get(name, name), _level(level), 'limits c' if name == limiting else '')
         for name, level in design.report.limits.items()]))
    console.print(report.result_table('Checks, by closed forms and by samples', [
        ('c', f'{design.c:.6g}'),
        ('limited by', CONDITIONS.get(limiting, limiting)),
        ('at rest, in any direction', f'inside up to {rest_angle_deg(design):.1f} deg at least'),
        ('worst (F+ - F + L) / L', f'{design.report.worst_decrease:.4g} over '
         f'{design.report.samples} states of the set (negative: F decreases by more than L)'),
        ('Riccati residual, relative', f'{design.riccati_residual:.2g}'),
        ('spectral radius of A + B K', f'{design.closed_loop_radius:.6g}'),
        *_existence_rows(design.existence),
    ]))


def _existence_rows(existence: Existence) -> list[tuple[str, str]]:
    """Return what P needs to exist, and by how much it holds."""
    return [
        ('(A, B) stabilisable', f'smallest singular value {existence.reachability:.3g} over '
         f'{existence.unstable_modes} modes that are not stable'),
        ('symplectic pencil', f'{existence.pencil_distance:.3g} from the unit circle'),
        ('Hessian of L, P', f'smallest over largest eigenvalue '
         f'{existence.hessian_definiteness:.3g}, {existence.P_definiteness:.3g}'),
    ]


def _print_horizon(
    console: Console, horizon: HorizonReport, config: AttitudeMpcConfig,
) -> None:
    """Print the smallest horizon beside the configured one."""
    from manifold_mpc_ros.cli import console as report
    angle_deg = math.degrees(float(np.linalg.norm(horizon.hardest)))
    axis = report.vector_text(np.asarray(horizon.hardest) / np.linalg.norm(horizon.hardest))
    enough = horizon.smallest <= config.horizon
    gentler = None if enough else _find_weight(console, config)
    console.print(report.result_table('Horizon', [
        ('smallest N', f'{horizon.smallest} ({horizon.smallest * config.step_s:g} s) makes each '
         f'of {horizon.attitudes} sampled states at rest feasible'),
        ('hardest of them', f'{angle_deg:.0f} deg about {axis}'),
        ('configured N', f'{config.horizon} '
         + ('(enough)' if enough else '(NOT enough: from some states at rest no plan was found '
            'that ends in the terminal set)')),
        *([] if enough else [('otherwise', 'a longer step_s' if gentler is None else (
            f'torque_weight times {gentler:g} makes N = {config.horizon} enough, '
            'at the price of slower slews'))]),
    ]))


def _find_weight(console: Console, config: AttitudeMpcConfig) -> float | None:
    """Search a torque weight with which the configured horizon is enough."""
    from manifold_mpc_ros.lab.domain.horizon import gentler_torque_weight
    with console.status('Searching a torque weight with which the configured N is enough'):
        return gentler_torque_weight(config)


def _find_horizon(
    console: Console, config: AttitudeMpcConfig, design: TerminalDesign,
) -> HorizonReport:
    """Search the smallest horizon, saying what is being tried."""
    from manifold_mpc_ros.cli.progress import activity
    from manifold_mpc_ros.lab.domain.horizon import smallest_horizon
    with activity(console, 'Searching the smallest horizon') as say:
        return smallest_horizon(config, terminal=design, progress=lambda line: say(
            f'Searching the smallest horizon: {line}'))


def momentum_shares(config: AttitudeMpcConfig, design: TerminalDesign) -> dict[float, float]:
    """Map parts of what fits into the wheels in every attitude to the parts of c that they leave.

    The momentum is towards the nearest facet. Nothing without wheels.
    """
    from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
    if config.wheels is None:
        return {}
    mpc, momenta, shares = AttitudeMpc(config, terminal=design), config.wheels.momenta, {}
    nearest = int(np.argmin(momenta.bounds))
    total = momenta.bounds[nearest] * momenta.normals[nearest]
    for part in (0.0, 0.4, 0.8):
        mpc.solve(np.eye(3), np.zeros(3),
                  wheel_momentum_n_m_s=config.wheels.inverse @ (part * total))
        shares[part] = mpc.terminal_share
    return shares


def rest_angle_deg(design: TerminalDesign, share: float = 1.0) -> float:
    """Return the angle up to which a body at rest is in the terminal set, turned any way.

    Or in this share of its level. The rates are the last three coordinates of either chart, the
    angles the others.
    """
    steepest = float(np.linalg.eigvalsh(design.P[:-3, :-3])[-1])
    return math.degrees(min(math.sqrt(share * design.c / steepest), math.pi))


def as_data(
    config: AttitudeMpcConfig, design: TerminalDesign, horizon: HorizonReport | None,
) -> dict[str, Any]:
    """Return everything that is printed as JSON values; an infinite level becomes null."""
    found = None if horizon is None else {
        'smallest': horizon.smallest,
        'configured': config.horizon,
        'attitudes': horizon.attitudes,
        'hardest_rotation_vector_rad': np.asarray(horizon.hardest).tolist(),
        'tried': {str(n): count for n, count in horizon.tried.items()},
    }
    return {
        'target': config.target,
        'P': design.P.tolist(),
        'K': design.K.tolist(),
        'A': design.A.tolist(),
        'B': design.B.tolist(),
        'Q': design.Q.tolist(),
        'R': design.R.tolist(),
        'N': design.N.tolist(),
        'c': design.c,
        'limiting_condition': design.report.limiting,
        'levels': {name: level if math.isfinite(level) else None
                   for name, level in design.report.limits.items()},
        'worst_decrease_ratio': design.report.worst_decrease,
        'samples': design.report.samples,
        'rest_angle_deg': rest_angle_deg(design),
        'riccati_residual': design.riccati_residual,
        'closed_loop_radius': design.closed_loop_radius,
        'existence': {name: value if math.isfinite(value) else None
                      for name, value in asdict(design.existence).items()},
        'horizon': found,
    }


def _rows(names: tuple[str, ...], matrix: np.ndarray) -> list[tuple[str, ...]]:
    """Return the rows of a matrix as text behind their names; rounding noise is a dot."""
    scale = float(np.max(np.abs(matrix)))
    return [(name, *('.' if abs(value) < 1e-12 * scale else f'{value:.4f}' for value in row))
            for name, row in zip(names, matrix, strict=True)]


def _level(level: float) -> str:
    """Return a level as text."""
    return f'{level:.6g}' if math.isfinite(level) else 'no lower level'
