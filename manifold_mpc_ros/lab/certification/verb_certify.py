# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``certify``: prove a terminal set in ball arithmetic and write the certificate."""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.certification import effort

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.certification.certificate import Certificate

EXAMPLES = """\
  manifold-mpc certify
      the shipped controller, on every core, to certificate.json; status 0 only if all of its
      terminal set is certified
  manifold-mpc certify --controller-config mine.yaml --output mine.json
      another parameter file
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    shared.add_controller_config(parser)
    parser.add_argument(
        '--output', type=Path, default=Path('certificate.json'), metavar='FILE',
        help='file for the certificate (default: %(default)s)')
    parser.add_argument(
        '--overwrite', action='store_true', help='replace a certificate that is there already')
    parser.add_argument(
        '--margin', type=shared.positive_number, metavar='MU',
        help='prove F(xi+) - F(xi) <= -(1 + MU) L (default: 0.1, or half of what the '
             'terminal_scale leaves, if that is less)')
    effort.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Prove, write, print; 0 only if the whole terminal set is certified."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.certification.certificate import write_certificate
    from manifold_mpc_ros.lab.certification.certification import certify_problem
    from manifold_mpc_ros.lab.certification.enclosures import describe
    if arguments.output.exists() and not arguments.overwrite:
        raise ManifoldMpcError(f'{arguments.output}: exists already; --overwrite replaces it')
    path = shared.controller_config_path(arguments.controller_config)
    kind, values = describe(AttitudeMpcConfig.from_yaml(path))
    console = report.make_console()
    console.print(f'Controller: {path}', soft_wrap=True, markup=False)
    start = time.perf_counter()
    with effort.shown(console, 'Proving') as progress:
        certificate = certify_problem(
            kind, values, margin=arguments.margin, budget=arguments.budget,
            workers=arguments.workers, progress=progress)
    seconds = round(time.perf_counter() - start, 1)
    certificate = replace(certificate, evidence={
        **certificate.evidence, 'seconds': seconds, 'workers': arguments.workers})
    write_certificate(certificate, arguments.output)
    print_certificate(console, certificate)
    report.say_written(console, [arguments.output])
    return 0 if certificate.complete else 1


def print_certificate(console: Console, certificate: Certificate) -> None:
    """Print what is certified, and by how much."""
    from manifold_mpc_ros.cli import console as report
    evidence, proved = certificate.evidence, certificate.certified_level > 0
    rows = [('claim', certificate.claim()), ('problem', certificate.problem)]
    if evidence['reason']:
        rows.append(('why not all of it', evidence['reason']))
    if proved:
        rows += [
            ('decrease, for every state',
             f"F(xi') - F(xi) <= -{1 + certificate.margin:g} L (8c), which implies (8b)"),
            ('implicit steps', 'exist, once, on the principal branch; |m| / lambda_min(J) '
             + _largest(evidence, 'step')),
            ('rates over their limits', _largest(evidence, 'rate') or 'no limit'),
        ]
    rows += [(f'{name}, up to a level of', f'{level:.6g} at least')
             for name, level in evidence['closed_form_levels'].items()]
    rows += [
        ('boxes', f"{evidence['boxes_verified']} verified, {evidence['boxes_outside']} outside, "
         f"depth {evidence['depth']}; {evidence['boxes_of_all_attempts']} tested in all"),
        ('time', f"{evidence['seconds']:g} s on {evidence['workers']} processes"),
    ]
    console.print(report.result_table('Terminal set, in ball arithmetic (Arb)', rows))


def _largest(evidence: dict[str, dict[str, float]], word: str) -> str:
    """Return the largest bound met among the ratios with a word in their names."""
    found = [value for name, value in evidence['largest_ratios'].items()
             if word in name.split() and 'branch' not in name]
    return f'at most {max(found):.3g}' if found else ''
