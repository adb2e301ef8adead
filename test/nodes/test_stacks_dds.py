# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Controllers of four shipped descriptions turn plants of their stacks by 180 degrees.

And the simulator speaks as a stack: such a run is recorded, judged, replayed and reported.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import message_packages
import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')
if message_packages.missing():
    pytest.skip(f'message packages cannot be built without {message_packages.missing()}',
                allow_module_level=True)

from stacks import FULL_SCALE, PLANTS, Px4, built
from visualization_msgs.msg import MarkerArray

from manifold_mpc_ros.cli.processes import node_environment
from manifold_mpc_ros.config.description import PRESETS

if TYPE_CHECKING:
    from harness import Rig

SCENARIO = """
description: Half a turn, in the messages of another stack.
duration_s: 13.0
controller:
  state_source: {stack}
  setpoint_source: {setpoints}
  command_sink: {stack}
  full_scale_torque_n_m: [0.5, 0.4, 0.3]
setpoints: [{{at_s: 1.0, attitude_xyzw: [0.0, 0.1, 0.0, 0.99498743710662]}}]
time: {time}
acceptance: {{final_error_deg: 2.0}}
"""


@pytest.fixture
def packages(pytestconfig: pytest.Config, tmp_path: Path) -> Iterator[Path]:
    """Give the folder of the message packages, built once where pytest has a cache."""
    cache = getattr(pytestconfig, 'cache', None)
    with built(tmp_path if cache is None else cache.mkdir('message_packages')) as folder:
        yield folder


def test_four_stacks_close_the_loop_from_180_degrees(rig: Rig, packages: Path) -> None:
    """All at once on one domain: no convention, stamp or topic of one disturbs another."""
    plants = []
    for name, make in PLANTS.items():
        rig.start('controller', parameters={
            'lockstep': True, 'state_source': name, 'command_sink': name,
            'setpoint_source': name if name == 'space_station_os' else 'nav',
            'full_scale_torque_n_m': FULL_SCALE.tolist()}, remap={'__ns': f'/{name}'},
            PYTHONPATH=str(packages))
        plants.append(make(rig.node, f'/{name}'))
    rig.run(['manifold_mpc_ros.nodes.markers.main', '--ros-args', '-r', '__ns:=/px4',
             '-p', 'state_source:=px4', '-p', 'command_sink:=px4',
             '-p', f'full_scale_torque_n_m:={FULL_SCALE.tolist()}'], PYTHONPATH=str(packages))
    pictures = rig.watch(MarkerArray, '/px4/attitude_markers/markers')

    def tend() -> None:
        for plant in plants:
            plant.tend()

    rig.until(lambda: all(plant.settled for plant in plants), 'rest at the setpoint',
              meanwhile=tend)
    vehicle, = (plant for plant in plants if isinstance(plant, Px4))
    rig.until(lambda: len(vehicle.heartbeats) > 10, 'offboard mode kept up')
    assert all(beat.thrust_and_torque and not beat.attitude for beat in vehicle.heartbeats)
    rig.until(lambda: {'body', 'torque'} <= {
        marker.ns for picture in pictures for marker in picture.markers}, 'the picture',
        meanwhile=lambda: (  # no arrow of a torque of zero, no push before the last is answered
            vehicle.advance([0.05, 0.0, 0.0]) if vehicle.settled else vehicle.tend()))
    gaps_us = [later.timestamp - beat.timestamp for beat, later in zip(
        vehicle.heartbeats, vehicle.heartbeats[1:], strict=False)]
    assert sorted(gaps_us)[len(gaps_us) // 2] < 500_000  # more than twice a second


@pytest.mark.parametrize(('stack', 'setpoints', 'time'), [
    ('basilisk', 'nav', '{mode: lockstep}'),
    ('px4', 'nav', '{mode: clock, factor: 3.0}'),
    ('space_station_os', 'space_station_os', '{mode: clock, factor: 3.0}')])
def test_a_run_in_the_messages_of_a_stack_is_recorded_judged_and_replayed(
    packages: Path, tmp_path: Path, stack: str, setpoints: str, time: str,
) -> None:
    """The bag alone says what its messages mean; in lockstep its torques come again."""
    mine = tmp_path / 'mine.yaml'
    shutil.copy(PRESETS / f'{stack}.yaml', mine)
    (tmp_path / 'run.yaml').write_text(SCENARIO.format(
        stack='mine.yaml' if stack == 'basilisk' else stack, setpoints=setpoints, time=time,
    ), encoding='utf-8')
    environment = dict(node_environment(0), ROS_DOMAIN_ID='', PYTHONPATH=str(packages),
                       AMENT_PREFIX_PATH=str(packages))

    def verb(*words: str) -> str:
        done = subprocess.run(
            [Path(sys.executable).with_name('manifold-mpc'), *words], cwd=tmp_path,
            env=environment, capture_output=True, text=True, check=False, timeout=200)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    verb('record', 'run.yaml', '-o', 'bag')
    mine.unlink()
    assert 'final_error_deg' in verb('check', 'bag')
    if stack == 'basilisk':
        assert 'every bit is the same' in verb('replay', 'bag')
        assert 'run.html' in verb('report', 'bag')
