# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report page in a real browser: no complaint, no network, a slider that acts."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from golden import GOLDEN, truncated

Command = Callable[..., tuple[int, str, str]]
BROWSER = next(filter(None, map(shutil.which, (
    'chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable'))), None)
FLAGS = ('--headless', '--no-sandbox', '--no-first-run', '--disable-background-networking',
         '--disable-component-update', '--disable-sync', '--disable-extensions',
         # WebGL on a machine without a graphics card.
         '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist',
         '--window-size=1366,900', '--virtual-time-budget=60000')
#: Put at the beginning of the page: keeps every complaint.
LISTEN = """<script>
window.complaints = [];
for (const name of ['error', 'warn']) console[name] = (...all) => complaints.push(all.join(' '));
addEventListener('error', (event) => complaints.push(event.message));
addEventListener('unhandledrejection', (event) => complaints.push(String(event.reason)));
addEventListener('securitypolicyviolation', (event) => complaints.push(event.blockedURI));
</script>"""
#: Put at its end: moves the slider, and writes down what has changed.
PROBE = """<script>
(async () => {
  const wait = () => new Promise((done) => setTimeout(done, 100));
  while (!document.body.dataset.drawn) await wait();
  const scene = document.querySelector('.scene');
  const slider = document.querySelector('input[type=range]');
  const histories = document.querySelector('.histories');
  const look = async () => ({
    value: Number(slider.value), text: document.querySelector('[data-field=time]').textContent,
    body: [5, 6, 7, 8].map((i) => ['x', 'y', 'z'].map((axis) => [...scene.data[i][axis]])),
    cursor: histories.layout.shapes[0].x0,
    pixels: await Plotly.toImage(scene, {format: 'png', width: 300, height: 300})});
  const move = async (value) => {
    slider.value = value;
    slider.dispatchEvent(new Event('input'));
    while (histories.layout.shapes[0].x0 !== Number(slider.value)) await wait();
    await wait();
    return look();
  };
  const looks = [await look(), await move(3.25), await move(0)];
  const drawn = [...document.querySelectorAll('.js-plotly-plot')].map((each) => each.data.length);
  const note = document.createElement('pre');
  note.id = 'probe';
  note.textContent = JSON.stringify({looks, drawn, complaints});
  document.body.append(note);
})();
</script>"""


def opened(page: Path, folder: Path) -> dict[str, Any]:
    """Open a page, move its slider, and return what was seen."""
    if BROWSER is None:
        pytest.skip('no Chromium or Chrome on this machine')
    probed = folder / 'probed.html'
    text = page.read_text(encoding='utf-8')
    head, tail = text.split('<style>', 1)
    probed.write_text(head + LISTEN + '<style>' + tail.replace('</body>', PROBE + '</body>'),
                      encoding='utf-8')
    done = subprocess.run(
        [BROWSER, *FLAGS, f'--user-data-dir={folder / "profile"}', '--dump-dom',
         probed.as_uri()], text=True, capture_output=True, check=False, timeout=350)
    found = re.search('<pre id="probe">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found, done.stderr[-2000:]
    return json.loads(unescape(found.group(1)))


@pytest.mark.timeout(400)  # WebGL without a graphics card, perhaps on a busy machine
def test_the_page_in_a_browser(command: Command, tmp_path: Path) -> None:
    status, out, err = command(
        'report', GOLDEN / 'half_turn.mcap', GOLDEN / 'mistuned.mcap', '--output', tmp_path)
    assert (status, err) == (0, '')
    page = tmp_path / 'report.html'
    assert str(page) in out
    seen = opened(page, tmp_path)
    assert seen['complaints'] == []
    assert len(seen['drawn']) >= 4  # side by side, two histories, the scene in sight
    assert all(seen['drawn'])
    start, moved, back = seen['looks']
    assert [look['value'] for look in (start, moved, back)] == [0, 3.25, 0]
    assert [look['cursor'] for look in (start, moved, back)] == [0, 3.25, 0]
    assert moved['text'] == '3.25 s'
    turned(start['body'], moved['body'])
    assert moved['pixels'] != start['pixels']
    assert back['body'] == start['body']
    assert back['pixels'] == start['pixels']


def turned(before: list[Any], after: list[Any]) -> None:
    """The box keeps its size, and body x has turned about z by some tens of degrees."""
    for one, other in zip(zip(*before[0], strict=True), zip(*after[0], strict=True), strict=True):
        assert sum(v * v for v in one) == pytest.approx(sum(v * v for v in other))
    x_before, x_after = [[axis[1] for axis in body[1]] for body in (before, after)]
    assert x_before == pytest.approx([-1.0, 0.0, 0.0], abs=1e-6)
    assert x_after[2] == pytest.approx(0.0, abs=1e-6)
    assert -0.9 < x_after[0] < 0.9


def test_the_page_needs_nothing_else(command: Command, tmp_path: Path) -> None:
    command('report', GOLDEN / 'pointing.mcap', '--output', tmp_path)
    text = (tmp_path / 'pointing.html').read_text(encoding='utf-8')
    assert len(text) < 6_000_000
    assert "default-src 'none'" in text
    assert re.findall(r'<(?:script|link|img|iframe)[^>]*\b(?:src|href)=', text.split(
        '<script type="application/json"')[0]) == []
    for picture in ('response', 'orientation'):
        assert (tmp_path / f'pointing_{picture}.png').read_bytes().startswith(b'\x89PNG')


def test_verdicts_and_names_are_on_the_page(command: Command, tmp_path: Path) -> None:
    bags = [GOLDEN / 'mistuned.mcap', GOLDEN / 'mistuned.mcap', truncated('mistuned', tmp_path)]
    status, _, _ = command('report', *bags, '--output', tmp_path)
    assert status == 0
    body = (tmp_path / 'report.html').read_text(encoding='utf-8').split('<main>')[1]
    body = body.split('</main>')[0]
    assert '3 runs, 0 passed' in body
    assert body.count('>settling time, final error') == 2
    assert body.count('>recording, settling time') == 1
    assert not re.search(r'[a-z]_(?:s|deg|n_m|rad_s|ms|ticks)\b', body.split('<details>')[0])
    margins = re.findall(
        r'<td>(peak torque|peak rate|final rate)</td>.*?<td>(-?[\d.]+)%</td>', body)
    assert len(margins) == 9
    assert all(float(left) <= 100.0 for _, left in margins)
    assert body.count('This bag is damaged') == 1
    assert (tmp_path / 'mistuned_2_response.png').is_file()


def test_hostile_text_in_a_bag_stays_text(tmp_path: Path) -> None:
    pytest.importorskip('plotly')
    from manifold_mpc_ros.lab.recording.bags.run import read_run
    from manifold_mpc_ros.lab.report.page import Reported, write_page
    run = read_run(GOLDEN / 'mistuned.mcap')
    path = write_page(tmp_path / 'page.html', [
        Reported('</script><script>alert(1)</script>', run, None)])
    assert '<script>alert' not in path.read_text(encoding='utf-8')


def test_names_in_a_bag_are_no_paths() -> None:
    from manifold_mpc_ros.lab.report.verb import _distinct
    assert _distinct(['../../etc/x', 'a b', 'a_b', '']) == ['_etc_x', 'a_b', 'a_b_2', 'run']


def test_flipped_bits_are_told_or_refused(command: Command, tmp_path: Path) -> None:
    data = (GOLDEN / 'mistuned.mcap').read_bytes()
    for part in range(4):
        at = (2 * part + 1) * len(data) // 8
        flipped = data[:at] + bytes([data[at] ^ 16]) + data[at + 1:]
        (tmp_path / 'flipped.mcap').write_bytes(flipped)
        status, _, err = command('report', tmp_path / 'flipped.mcap', '--output', tmp_path)
        assert status in (0, 2)
        assert err.count('\n') == (status == 2)


def test_mistakes_are_one_line(command: Command, tmp_path: Path) -> None:
    for arguments, words in (
        ((tmp_path / 'none',), 'no such bag'),
        ((GOLDEN / 'mistuned.mcap', '--state', '/elsewhere'), 'no state can be read'),
    ):
        status, out, err = command('report', *arguments, '--output', tmp_path / 'out')
        assert (status, out) == (2, '')
        assert err.count('\n') == 1
        assert words in err
        assert not (tmp_path / 'out').exists()
