# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reports of bags that hold next to nothing, or something that is no number."""

from __future__ import annotations

import json
import math
from pathlib import Path

from synthetic import odometry, raw, write_bag

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
