# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""No page leads nowhere: files and headings that Markdown links name are there.

``make docs`` looks at the same, at the docstrings and, when asked, at links to elsewhere.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
PAGES = sorted([*TOP.glob('*.md'), *(TOP / 'docs').glob('*.md')])
FENCE = re.compile(r'^```.*?^```', re.DOTALL | re.MULTILINE)
LINK = re.compile(r'\]\((?!https?://)([^()\s#]*)(?:#([^()\s]*))?\)')
HEADING = re.compile(r'^#+ (.*)$', re.MULTILINE)


def text(page: Path) -> str:
    """Return a page without its code."""
    return FENCE.sub('', page.read_text(encoding='utf-8'))


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    return {re.sub(r'[^\w\- ]', '', heading.lower()).strip().replace(' ', '-')
            for heading in HEADING.findall(text(page))}


def dead(page: Path) -> list[str]:
    """Return the links of a page that lead nowhere; a folder is no page."""
    found = []
    for path, anchor in LINK.findall(text(page)):
        target = page.parent / path if path else page
        if not target.is_file() or (anchor and anchor not in anchors(target)):
            found.append(f'{path}#{anchor}' if anchor else path)
    return found


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    assert dead(page) == []


def test_dead_ones_are_found(tmp_path: Path) -> None:
    page = tmp_path / 'page.md'
    page.write_text('# A B\n[1](#a-b) [2](#a) [3](page.md#a-b) [4](gone.md) [5](.)\n'
                    '```\n[6](code)\n```\n', encoding='utf-8')
    assert dead(page) == ['#a', 'gone.md', '.']
