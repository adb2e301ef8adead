# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report page: recorded runs and their verdicts as one HTML file that needs no network."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from plotly.offline import get_plotlyjs

from manifold_mpc_ros.lab.recording.bags.run import BagRun
from manifold_mpc_ros.lab.recording.bags.verdict import Verdict
from manifold_mpc_ros.lab.report import histories, motion, scene
from manifold_mpc_ros.lab.report.facts import facts
from manifold_mpc_ros.lie import so3

#: A limit that is exceeded by less, 0.0 % as it is shown, is one that is reached.
PAST = 5e-4
_FOLDER = files('manifold_mpc_ros.lab.report') / 'static'


@dataclass(frozen=True, eq=False)
class Reported:
    """One run on the page: its name, and its verdict where it has limits to be judged by."""

    name: str
    run: BagRun
    verdict: Verdict | None


def write_page(path: Path, reported: Sequence[Reported]) -> Path:
    """Write the page; return where it is."""
    several = len(reported) > 1
    title = f'{len(reported)} runs' if several else reported[0].name
    data: dict[str, Any] = {'runs': [_run_data(each.run) for each in reported]}
    if several:
        data['comparison'] = _plain(histories.comparison(
            [each.run for each in reported], [each.name for each in reported]))
    head = _summary(reported) if several else ''
    body = head + ''.join(
        _section(each, number if several else None) for number, each in enumerate(reported))
    path.write_text(Template(_text('page.html')).substitute(
        title=escape(title), css=_text('page.css'), body=body + _FOOTER,
        runs=json.dumps(data, separators=(',', ':')).replace('</', '<\\/'),
        plotly=get_plotlyjs(), script=_text('page.js')), encoding='utf-8')
    return path


_FOOTER = '<footer>manifold_mpc_ros. Click into a panel to move the body to that time.</footer>'


def _text(name: str) -> str:
    """Return a file of the page's folder."""
    return (_FOLDER / name).read_text(encoding='utf-8')


def _run_data(run: BagRun) -> dict[str, Any]:
    """Return what the script of the page needs of a run."""
    modes = dict(zip(run.ticks.tick.tolist(), run.ticks.mode, strict=True))
    return {
        'histories': _plain(histories.histories(run)),
        'scene': _plain(scene.scene(run)),
        'traces': scene.MOVED,
        'corners': _rounded(scene.corners(run)),
        'commanded_axes': _rounded(scene.commanded_axes(run)),
        'time_s': _rounded(run.states.time_s),
        'attitude_wxyz': _rounded(so3.quaternion_from_rotation(run.states.R_NB)),
        'commanded_wxyz': _rounded(so3.quaternion_from_rotation(run.R_ND)),
        'torque_time_s': _rounded(run.commands.time_s),
        'torque_drawn': _rounded(scene.drawn_torques(run)),
        'error_deg': _rounded(np.degrees(run.error_rad)),
        'rate_rad_s': _rounded(np.linalg.norm(run.states.omega_BN_B, axis=1)),
        'mode': [modes.get(row + 1, '') for row in range(len(run.commands))],
    }


def _plain(figure: Any) -> Any:
    """Return a figure as plain data; what is not a number is null."""
    return json.loads(figure.to_json())


def _rounded(values: Any) -> Any:
    """Return an array as lists with the digits that a picture needs; null for no number."""
    array = np.asarray(values, dtype=float)
    if array.ndim > 1:
        return [_rounded(row) for row in array]
    return [float(f'{value:.7g}') if np.isfinite(value) else None for value in array]


#: Limits whose names are not their key without the unit.
_LABELS = {'settle_time_s': 'settling time', 'solver_time_p99_ms': 'solve time, 99 %'}
_UNITS = ('_s', '_deg', '_ms', '_n_m', '_rad_s')


def label(key: str) -> str:
    """Return a limit's name for people: its key in words, without the unit."""
    unit = next((each for each in sorted(_UNITS, key=len)[::-1] if key.endswith(each)), '')
    return _LABELS.get(key, key[:len(key) - len(unit)].replace('_', ' '))


def _badge(verdict: Verdict | None) -> str:
    """Return the verdict as a coloured word."""
    if verdict is None:
        return '<span class="badge none">no limits</span>'
    return '<span class="badge pass">PASS</span>' if verdict.passed \
        else '<span class="badge fail">FAIL</span>'


def _summary(reported: Sequence[Reported]) -> str:
    """Return the head of a page about several runs: verdicts, and the comparison."""
    rows = ''.join(
        f'<tr><td><a href="#run-{index}">{escape(each.name)}</a></td><td>{_badge(each.verdict)}'
        f'</td><td>{escape(_not_kept(each.verdict))}</td>'
        f'<td>{escape(_measured(each, "settle_time_s"))}</td>'
        f'<td>{escape(_measured(each, "final_error_deg"))}</td>'
        f'<td>{escape(str(each.run.path))}</td></tr>'
        for index, each in enumerate(reported))
    passed = sum(each.verdict is not None and each.verdict.passed for each in reported)
    return (f'<header><h1>{len(reported)} runs, {passed} passed</h1></header><section>'
            '<table><thead><tr><th>run</th><th>verdict</th><th>limits not kept</th>'
            '<th>settling time</th><th>final error</th><th>bag</th></tr></thead>'
            f'<tbody>{rows}</tbody></table></section>'
            '<section><h2>Side by side</h2><div class="plot comparison"></div></section>')


def _not_kept(verdict: Verdict | None) -> str:
    """Return the limits that were not kept."""
    return ', '.join(map(label, verdict.failed)) if verdict is not None else ''


def _measured(reported: Reported, name: str) -> str:
    """Return what was measured for one limit, empty where it was not judged."""
    judgements = reported.verdict.judgements if reported.verdict is not None else ()
    return next((each.measured for each in judgements if each.name == name), '')


def _section(reported: Reported, number: int | None) -> str:
    """Return everything about one run; ``number`` None is the only one of its page."""
    run, level = reported.run, 'h1' if number is None else 'h2'
    scenario = run.scenario
    lead = scenario.description if scenario is not None else 'A bag from another stack.'
    head = (f'<{level}>{escape(reported.name)} {_badge(reported.verdict)}</{level}>'
            f'<p class="lead">{escape(lead)}</p>')
    end_s = float(run.states.time_s[-1]) or 1.0
    anchor = '' if number is None else f' id="run-{number}"'
    return (f'<section class="run"{anchor}>{head}{_warnings(run)}'
            f'<div class="top"><div>{_verdict_table(reported.verdict)}{_margins(run)}</div>'
            f'<div><h3>What ran</h3>{_facts(run)}</div></div>'
            '<div class="panes"><div class="plot histories"></div><div class="side">'
            '<div class="plot scene"></div>'
            '<div class="controls"><button type="button" aria-label="play">▶</button>'
            f'<input type="range" min="0" max="{end_s:.9g}" step="any" value="0" '
            'aria-label="time"><output data-field="time"></output></div>'
            '<div class="readout"><div>error<b data-field="error"></b></div>'
            '<div>|rate|<b data-field="rate"></b></div><div>mode<b data-field="mode"></b></div>'
            f'</div></div></div>{_scenario(run)}</section>')


def _verdict_table(verdict: Verdict | None) -> str:
    """Return the judgements as a table."""
    if verdict is None:
        return '<h3>Verdict</h3><p>No acceptance limits are inside this bag.</p>'
    rows = ''.join(
        f'<tr{"" if each.passed else " class=bad"}><td>{escape(label(each.name))}</td>'
        f'<td>{escape(each.limit)}</td><td>{escape(each.measured)}</td>'
        f'<td class="verdict {"good" if each.passed else "bad"}">'
        f'{"ok" if each.passed else "FAIL"}</td></tr>' for each in verdict.judgements)
    return ('<h3>Verdict</h3><table><thead><tr><th></th><th>limit</th><th>measured</th><th></th>'
            f'</tr></thead><tbody>{rows}</tbody></table>')


def _margins(run: BagRun) -> str:
    """Return what the run used of the controller's own limits."""
    rows = ''.join(
        f'<tr{" class=bad" if each.left < -PAST else ""}><td>{escape(each.name)}</td>'
        f'<td>{escape(each.limit)}</td><td>{escape(each.measured)}</td>'
        f'<td>{each.left if abs(each.left) >= PAST else 0.0:.1%}</td>'
        '</tr>' for each in motion.margins(run))
    return rows and (
        '<h3 class="next">Margins</h3><table><thead><tr><th></th><th>limit</th><th>measured</th>'
        f'<th>left</th></tr></thead><tbody>{rows}</tbody></table>')


def _facts(run: BagRun) -> str:
    """Return what ran as a list of terms."""
    return '<dl class="facts">' + ''.join(
        f'<dt>{escape(name)}</dt><dd>{escape(value)}</dd>' for name, value in facts(run)) + '</dl>'


def _warnings(run: BagRun) -> str:
    """Return what is wrong with the bag."""
    if not run.warnings:
        return ''
    items = ''.join(f'<li>{escape(each)}</li>' for each in run.warnings)
    return ('<div class="warning">This bag is damaged; what can be read is shown.'
            f'<ul>{items}</ul></div>')


def _scenario(run: BagRun) -> str:
    """Return the scenario to the letter, folded."""
    if run.scenario is None:
        return ''
    return f'<details><summary>Scenario</summary><pre>{escape(run.scenario.text)}</pre></details>'
