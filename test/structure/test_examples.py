# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The Python examples of the README and of the theory run as they stand, without warnings."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
#: How numpy says which of NPY_DISABLE_CPU_FEATURES this processor lacks anyway.
NUMPY_SETTINGS = 'ignore::ImportWarning'
BLOCK = re.compile(r'^```python\n(.*?)^```$', re.DOTALL | re.MULTILINE)
EXAMPLES = {f'{page}-{number}': code for page in ('README.md', 'docs/theory.md')
            for number, code in enumerate(BLOCK.findall((TOP / page).read_text(encoding='utf-8')))}


def test_both_pages_have_examples() -> None:
    assert set(EXAMPLES) == {'README.md-0', 'docs/theory.md-0'}


@pytest.mark.parametrize('name', EXAMPLES)
def test_an_example_runs(name: str, tmp_path: Path) -> None:
    path = os.pathsep.join([str(TOP), *filter(None, [os.environ.get('PYTHONPATH')])])
    done = subprocess.run(
        [sys.executable, '-W', 'error', '-W', NUMPY_SETTINGS, '-c', EXAMPLES[name]],
        cwd=tmp_path, text=True, check=False, capture_output=True, timeout=120,
        env=dict(os.environ, PYTHONPATH=path))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ''
