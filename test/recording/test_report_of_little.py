# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reports of bags that hold next to nothing, or something that is no number."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
from synthetic import START_NS, diagnostics, odometry, raw, tick_messages, write_bag

from manifold_mpc_ros.lab.recording.bags.run import read_run
from manifold_mpc_ros.lab.recording.bags.series import MOTOR_TORQUE
from manifold_mpc_ros.lab.report.histories import SATURATION, device_histories, histories
from manifold_mpc_ros.lab.report.verb import write_report


def test_one_state_without_a_rate_and_no_torque(tmp_path: Path) -> None:
    state = odometry(5, (0.0, 0.0, 0.0, 1.0), (math.nan, 0.0, 0.0))
    bag = write_bag(tmp_path / 'theirs', [raw('/odometry', 10**18, state)], scenario='')
    page, response, orientation = write_report(tmp_path / 'report', [bag])
    text = page.read_text(encoding='utf-8').split('id="runs">')[1].split('</script>')[0]
    (run,) = json.loads(text)['runs']
    assert 'NaN' not in text
    assert (run['rate_rad_s'], run['torque_drawn'], run['mode']) == ([None], [], [])
    assert run['error_deg'] == [0.0]
    for picture in (response, orientation):
        assert picture.read_bytes().startswith(b'\x89PNG')


def test_what_diagnostics_say_of_devices_is_drawn(tmp_path: Path) -> None:
    said = [{'ticks': str(k + 1), 'mode': 'NOMINAL', 'wheel_a_speed_rad_s': str(10.0 * k),
             'wheel_a_torque_n_m': '0.1', 'thruster_7_on_s': '0.02'} for k in range(3)]
    messages = [message for k, values in enumerate(said) for message in (
        *tick_messages(k)[:2],
        raw('/diagnostics', START_NS + 1000 * k + 400, diagnostics(
            'attitude_controller', 0, '', values)))]
    run = read_run(write_bag(tmp_path / 'wheeled', messages))
    assert {quantity: list(values) for quantity, values in run.ticks.devices.items()} == {
        'wheel speed [rad/s]': ['wheel_a'], 'motor torque [N m]': ['wheel_a'],
        'thruster on-time [s]': ['thruster_7']}
    assert run.ticks.devices['wheel speed [rad/s]']['wheel_a'].tolist() == [0.0, 10.0, 20.0]
    figure = histories(run)
    titles = [figure.layout[f'yaxis{row}'].title.text for row in (6, 7, 8)]
    assert titles == list(run.ticks.devices)
    assert sum(trace.name == 'wheel_a' for trace in figure.data) == 2


def test_how_saturated_wheels_are_is_drawn_beside_what_they_do() -> None:
    run = read_run(Path(__file__).parent / 'golden' / 'wheels.mcap')
    assert run.scenario is not None
    config = run.scenario.controller_config.mpc
    devices = device_histories(run, config)
    assert list(devices) == [*run.ticks.devices, SATURATION]
    assert config.wheels is not None
    for i, (name, parts) in enumerate(devices[SATURATION].items()):
        torque = np.abs(devices[MOTOR_TORQUE][name]) / config.wheels.max_torque_n_m[i]
        assert (parts >= torque)[np.isfinite(parts)].all()
        assert 0.0 < np.nanmax(parts) <= 1.0 + 1e-9
    figure = histories(run)
    titles = [axis.title.text for axis in figure.select_yaxes()]
    assert SATURATION in titles
