# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tables in README and docs say what the files of the commands say, and nothing else."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
sys.path.insert(0, str(TOP / 'benchmarks'))

import tables  # noqa: E402


@pytest.mark.parametrize('page', tables.PAGES, ids=lambda page: page.name)
def test_a_page_is_filled_from_the_files(page: Path) -> None:
    text = page.read_text(encoding='utf-8')
    assert tables.filled(text) == text, 'run python benchmarks/tables.py after a new measurement'


def test_every_table_has_its_place() -> None:
    found = [match[2] for page in tables.PAGES
             for match in tables.TABLE.finditer(page.read_text(encoding='utf-8'))]
    assert sorted(found) == sorted(tables.TABLES)
