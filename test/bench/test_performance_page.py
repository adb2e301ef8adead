# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""docs/performance.md says what the files of the commands say, and nothing else."""

from __future__ import annotations

import sys
from pathlib import Path

TOP = Path(__file__).parents[2]
sys.path.insert(0, str(TOP / 'benchmarks'))

import performance_tables  # noqa: E402


def test_the_page_is_filled_from_the_files() -> None:
    page = performance_tables.PAGE.read_text(encoding='utf-8')
    assert performance_tables.filled(page) == page, (
        'run python benchmarks/performance_tables.py after a new measurement')


def test_every_table_has_its_place() -> None:
    page = performance_tables.PAGE.read_text(encoding='utf-8')
    found = [match[2] for match in performance_tables.TABLE.finditer(page)]
    assert sorted(found) == sorted(performance_tables.TABLES)
