# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A plant on another vendor's DDS, without ROS, closes the loop with the controller."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
if importlib.util.find_spec('cyclonedds') is None:
    pytest.skip('the plant needs Eclipse Cyclone DDS (cyclonedds), which is not installed',
                allow_module_level=True)

from harness import PATIENCE_S, child_environment

if TYPE_CHECKING:
    from harness import Rig

PLANT = Path(__file__).with_name('cyclone_plant.py')
MAX_TORQUE_N_M, MAX_RATE_RAD_S = 0.3, 0.6


def test_a_plant_on_another_vendors_dds_is_turned_by_180_degrees(rig: Rig) -> None:
    controller = rig.start('controller', parameters={'lockstep': True})
    done = subprocess.run(
        [sys.executable, str(PLANT), str(rig.domain)], text=True, check=False,
        capture_output=True, env=child_environment(rig.domain), timeout=3 * PATIENCE_S)
    assert done.returncode == 0, f'{done.stderr}\n{controller.log}'
    said = json.loads(done.stdout)
    assert said['settled'], said
    assert said['after_s'] < 40.0
    assert 0.1 < said['largest_torque_n_m'] <= MAX_TORQUE_N_M
    assert 0.1 < said['largest_rate_rad_s'] <= MAX_RATE_RAD_S + 1e-3
