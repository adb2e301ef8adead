# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Record the golden bags again: golden/NAME.yaml becomes golden/NAME.mcap. See ``make golden``.

Needed when the controller is meant to command other torques than before, in their last bits too.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from manifold_mpc_ros.cli.main import main

GOLDEN = Path(__file__).parent / 'golden'


def record(scenario: Path, folder: Path) -> bool:
    """Record one scenario and put its storage file beside it; return whether that worked."""
    bag = folder / scenario.stem
    if main(['record', str(scenario), '--compress', '-o', str(bag)]) != 0:
        return False
    shutil.copyfile(bag / f'{scenario.stem}_0.mcap', scenario.with_suffix('.mcap'))
    return True


if __name__ == '__main__':
    with tempfile.TemporaryDirectory(prefix='manifold-mpc-golden-') as made:
        recorded = [record(each, Path(made)) for each in sorted(GOLDEN.glob('*.yaml'))]
    sys.exit(0 if all(recorded) else 1)
