# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``verify``: prove the claim of a certificate again, from its file alone."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.certification import effort

EXAMPLES = """\
  manifold-mpc verify
      rebuild the problem that certificate.json describes and prove its claim again
  manifold-mpc verify mine.json --workers 1
      another certificate, on one core
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument(
        'certificate', nargs='?', type=Path, default=Path('certificate.json'), metavar='FILE',
        help='the certificate (default: %(default)s)')
    effort.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Prove again; 0 when the claim holds, 1 with the reason when the file is refused."""
    from manifold_mpc_ros.cli import console as report
    from manifold_mpc_ros.lab.certification.certificate import read_certificate
    from manifold_mpc_ros.lab.certification.certification import recheck
    console = report.make_console()
    try:
        certificate = read_certificate(arguments.certificate)
        with effort.shown(console, 'Proving again') as progress:
            recheck(certificate, budget=arguments.budget, workers=arguments.workers,
                    progress=progress)
    except ManifoldMpcError as error:
        print(f'{arguments.certificate}: NOT verified: {error}', file=sys.stderr)
        return 1
    console.print(f'Verified: the terminal set is {certificate.claim()}', soft_wrap=True)
    return 0
