# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is drawn: which snapshots, which limits, no overlapping text; and what CSV files keep."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

from manifold_mpc_ros.cli import console
from manifold_mpc_ros.cli.plot_style import draw_limits
from manifold_mpc_ros.lab.discontinuity import plot_pair
from manifold_mpc_ros.lab.report import plot_orientation as orientation
from manifold_mpc_ros.lab.report import plot_response
from manifold_mpc_ros.lie import so3


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Collect the figures that are saved; the files are written all the same."""
    figures: list[Figure] = []
    save = Figure.savefig

    def collect(figure: Figure, *arguments: object, **options: object) -> None:
        figures.append(figure)
        save(figure, *arguments, **options)

    monkeypatch.setattr(Figure, 'savefig', collect)
    return figures


def drawn_texts(figure: Figure) -> list[Text]:
    """Return the texts that are on the page; ticks beyond an axis' ends are not."""
    texts = [figure._suptitle] if figure._suptitle is not None else []
    for axes in figure.axes:
        texts += [axes.title, axes.xaxis.label, axes.yaxis.label]
        legend = axes.get_legend()
        texts += [] if legend is None else [legend.get_title(), *legend.get_texts()]
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            texts += [tick.label1 for tick in axis.get_major_ticks()
                      if low <= tick.get_loc() <= high]
    return [text for text in texts if text.get_visible() and text.get_text().strip()]


def assert_no_text_overlaps(figure: Figure) -> None:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    boxes = [text.get_window_extent(renderer) for text in drawn_texts(figure)]
    assert len(boxes) > 10
    for index, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[index + 1:]), box
        assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.bbox.y1


def response(**changed: object) -> plot_response.Response:
    time_s = np.linspace(0.0, 20.0, 41)
    fading = np.exp(-time_s)[:, None] * [1.0, -0.5, 0.2]
    values: dict[str, object] = {
        'title': 'A slew', 'state_time_s': time_s, 'attitude_error_rad': 3.0 * np.exp(-time_s),
        'omega_BN_B': fading, 'torque_time_s': time_s[::2], 'torque_B_n_m': fading[::2],
        'max_rate_rad_s': np.array([0.6, 0.6, 0.6]),
        'max_torque_n_m': np.array([0.3, 0.2, np.inf]),
        'attitude_tolerance_rad': 1e-3, 'settled_s': 8.0}
    return plot_response.Response(**{**values, **changed})  # type: ignore[arg-type]


@pytest.mark.parametrize('changed', [
    {}, {'max_rate_rad_s': None, 'max_torque_n_m': None}, {'settled_s': None},
    {'attitude_error_rad': np.zeros(41)},
])
def test_response_is_labelled_and_nothing_overlaps(
    drawn: list[Figure], tmp_path: Path, changed: dict[str, object],
) -> None:
    path = plot_response.plot_response(response(**changed), tmp_path / 'response.png')
    assert path.read_bytes().startswith(b'\x89PNG')
    (figure,) = drawn
    assert [axes.get_ylabel() for axes in figure.axes] == [
        'attitude error [deg]', 'body rate [rad/s]', 'body torque [N m]']
    assert figure.axes[-1].get_xlabel() == 'time [s]'
    assert_no_text_overlaps(figure)


@pytest.mark.parametrize(('limits', 'levels'), [
    (None, set()),
    (np.array([0.6, 0.6, 0.6]), {-0.6, 0.6}),
    (np.array([0.3, 0.2, np.inf]), {-0.3, 0.3, -0.2, 0.2}),
])
def test_limits_are_dashed_lines(limits: np.ndarray | None, levels: set[float]) -> None:
    axes = Figure().subplots()
    draw_limits(axes, limits)
    assert {float(line.get_ydata()[0]) for line in axes.lines} == levels
    assert all(line.get_linestyle() == '--' for line in axes.lines)


@pytest.mark.parametrize('count', [1, 3, 5, 8])
def test_orientation_has_one_panel_for_each_snapshot(
    drawn: list[Figure], tmp_path: Path, count: int,
) -> None:
    times_s = 2.0 * np.arange(count)
    attitudes = so3.exp(np.linspace(0.0, 1.0, count)[:, None] * np.array([2.0, -1.0, 0.4]))
    orientation.plot_orientation('A turn', times_s, attitudes, tmp_path / 'turn.png')
    (figure,) = drawn
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == [f't = {time_s:g} s' for time_s in times_s]
    assert_no_text_overlaps_in_titles(figure)


def assert_no_text_overlaps_in_titles(figure: Figure) -> None:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    titles = [axes.title.get_window_extent(renderer) for axes in figure.axes]
    lines = [line.get_window_extent(renderer) for axes in figure.axes for line in axes.lines]
    key = figure.legends[0].get_window_extent(renderer)
    assert key.x0 >= 0
    assert key.x1 <= figure.bbox.x1
    assert not any(title.overlaps(key) for title in titles)
    assert not any(title.overlaps(line) for title in titles for line in lines)


def test_pair_shows_both_runs(drawn: list[Figure], tmp_path: Path) -> None:
    time_s = np.linspace(0.0, 20.0, 41)
    curves = [plot_pair.Curve(name, sign * np.exp(-time_s)) for name, sign in
              (('first', 1.0), ('second', -1.0))]
    plot_pair.plot_pair(curves, time_s, 'torque [N m]', True, tmp_path / 'pair.png')
    (figure,) = drawn
    solid, dotted = (line for line in figure.axes[0].lines if line.get_label() in (
        'first', 'second'))
    assert (solid.get_linestyle(), dotted.get_linestyle()) == ('-', ':')
    assert solid.get_color() != dotted.get_color()
    assert_no_text_overlaps(figure)


@pytest.mark.parametrize(('end_s', 'expected'), [
    (None, [0, 8, 16, 24, 32, 40]), (3.0, [0, 2, 4]), (13.0, [0, 2, 4, 6, 8, 10, 12, 14]),
    (100.0, [0, 8, 16, 24, 32, 40]), (0.0, [0, 2]),
])
def test_snapshots_stop_soon_after_the_end(end_s: float | None, expected: list[int]) -> None:
    time_s = np.arange(0.0, 40.01, 0.5)
    rows = orientation.snapshot_rows(time_s, 2.0, end_s, 8)
    assert np.array_equal(time_s[rows], expected)


def test_csv_keeps_every_digit(tmp_path: Path) -> None:
    decades = 10.0 ** np.arange(-150, 150, 15)[:, None]
    values = decades * np.random.default_rng(1).normal(size=(20, 3))
    path = console.write_csv(tmp_path / 'table.csv', {
        **console.axis_columns('torque_B', 'n_m', values), 'status': ['ok'] * 20})
    with path.open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    read = [[float(row[f'torque_B_{axis}_n_m']) for axis in 'xyz'] for row in rows]
    assert np.array_equal(read, values)
    assert {row['status'] for row in rows} == {'ok'}
    with pytest.raises(ValueError, match='argument'):
        console.write_csv(tmp_path / 'uneven.csv', {'a': [1], 'b': [1, 2]})
