# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bytes that are no requests, on every service that a node answers: it lives on and answers."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
if importlib.util.find_spec('cyclonedds') is None:
    pytest.skip('raw requests need Eclipse Cyclone DDS (cyclonedds), which is not installed',
                allow_module_level=True)

from diagnostic_msgs.msg import DiagnosticArray
from harness import child_environment
from lifecycle_msgs.msg import State
from lifecycle_msgs.srv import GetState
from watching import values_of

if TYPE_CHECKING:
    from harness import Rig

RAW = Path(__file__).with_name('raw_requests.py')
ROUNDS = 12
SERVICES = 9


@pytest.mark.parametrize(('program', 'node'), [
    ('controller', 'attitude_controller'), ('simulator', 'lgvi_simulator')])
def test_garbage_to_every_service(rig: Rig, program: str, node: str) -> None:
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    process = rig.start(program)
    rig.until(lambda: bool(values_of(diagnostics, node).get('mode')), 'a word from the node')
    done = subprocess.run(
        [sys.executable, str(RAW), str(rig.domain), node, str(ROUNDS)], text=True, check=False,
        capture_output=True, env=child_environment(rig.domain), timeout=90)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) == SERVICES
    state = rig.call(GetState, f'/{node}/get_state', GetState.Request()).current_state
    assert state.id == State.PRIMARY_STATE_ACTIVE
    assert process.running
    assert 'Traceback' not in process.log
    diagnostics.clear()
    rig.until(lambda: bool(values_of(diagnostics, node).get('mode')), 'a word after it all')
