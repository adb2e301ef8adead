# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report of a campaign: one HTML page that needs nothing else, pictures inside."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from manifold_mpc_ros.lab.campaign.outcome import Outcome
from manifold_mpc_ros.lab.campaign.output.text_report import (
    again,
    by_set,
    caption,
    figures_by_set,
    titles,
    verdict,
)
from manifold_mpc_ros.lab.campaign.plan import CampaignPlan
from manifold_mpc_ros.lab.campaign.summary import WORST

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.campaign.run import Run

# Broken cases that the page lists; the data file has all.
LISTED = 500
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 62rem; margin: 2rem auto;
       padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: 0; } h2 { font-size: 1.2rem; margin-top: 2rem; }
table { border-collapse: collapse; } th, td { padding: .25rem .8rem; text-align: right;
       border-bottom: 1px solid #ddd; } th:first-child, td:first-child { text-align: left; }
.scroll { overflow-x: auto; } img { max-width: 100%; }
code, pre { font: 13px/1.4 ui-monospace, monospace; } td code { white-space: nowrap; }
pre { background: #f5f5f5; padding: 1rem; overflow-x: auto; }
.verdict { font-weight: 600; padding: .6rem 1rem; border-left: .3rem solid #009E73;
       background: #f5f5f5; } .failed { border-color: #D55E00; }
"""


def write_page(plan: CampaignPlan, done: Run, pictures: Sequence[Path], folder: Path) -> Path:
    """Write the page beside the data; return where."""
    groups = by_set(plan, done.outcomes)
    parts = [
        f'<h1>Campaign {escape(plan.name)}</h1>', f'<p>{escape(plan.description)}</p>',
        f'<p class="verdict{"" if done.complete and not done.broken else " failed"}">'
        f'{escape(verdict(done))}</p>',
        f'<p>{escape(caption(plan, done))}.</p>',
        '<h2>Figures by set</h2>',
        _table(['', *titles(plan, groups)], figures_by_set(plan, groups)),
        '<h2>Pictures</h2>', *map(_picture, pictures),
        '<h2>Worst cases</h2>', _worst(groups, folder),
        '<h2>Failures</h2>', _failures(done.broken, folder),
        '<h2>What was drawn</h2>',
        '<p>The whole campaign as a file (<code>campaign.yaml</code>); the table '
        '(<code>loops.parquet</code>) is a function of it.</p>',
        f'<pre>{escape(plan.as_yaml())}</pre>',
    ]
    page = folder / 'report.html'
    page.write_text(
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<title>Campaign {escape(plan.name)}</title><link rel="icon" href="data:,">'
        f'<style>{STYLE}</style></head>\n<body>\n' + '\n'.join(parts) + '\n</body></html>\n',
        encoding='utf-8')
    return page


def _worst(groups: dict[str, list[Outcome]], folder: Path) -> str:
    """Return the slowest to settle and the farthest at the end, of each set, with commands."""
    rows = []
    for group in groups.values():
        settled = [o for o in group if o.settled_s is not None]
        slowest = sorted(settled, key=lambda o: (-(o.settled_s or 0.0), o.name))[:WORST]
        farthest = sorted(group, key=lambda o: (-o.final_angle_deg, o.name))[:WORST]
        rows += [(o.name, f'settled at {o.settled_s:g} s', again(folder, o.name))
                 for o in slowest]
        rows += [(o.name, f'final error {o.final_angle_deg:.3g} deg', again(folder, o.name))
                 for o in farthest]
    return _table(['case', 'why', 'run it again'], rows, code=True)


def _failures(broken: Sequence[Outcome], folder: Path) -> str:
    """Return the broken cases with commands."""
    if not broken:
        return '<p>None.</p>'
    rows = [(o.name, ', '.join(o.broken), again(folder, o.name)) for o in broken[:LISTED]]
    more = len(broken) - len(rows)
    note = f'<p>And {more} more, all in <code>campaign.json</code>.</p>' if more else ''
    return _table(['case', 'what it broke', 'run it again'], rows, code=True) + note


def _picture(path: Path) -> str:
    """Return a picture inside the page."""
    data = base64.b64encode(path.read_bytes()).decode()
    return f'<p><img alt="{escape(path.stem)}" src="data:image/png;base64,{data}"></p>'


def _table(header: Sequence[str], rows: Iterable[Sequence[str]], *, code: bool = False) -> str:
    """Return a table; with ``code`` the last column is a command."""
    def cells(row: Sequence[str]) -> str:
        texts = [escape(text) for text in row]
        if code:
            texts[-1] = f'<code>{texts[-1]}</code>'
        return ''.join(f'<td>{text}</td>' for text in texts)
    head = ''.join(f'<th>{escape(text)}</th>' for text in header)
    body = '\n'.join(f'<tr>{cells(row)}</tr>' for row in rows)
    return f'<div class="scroll"><table>\n<tr>{head}</tr>\n{body}\n</table></div>'
