# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Controllers of four shipped descriptions turn plants of their stacks by 180 degrees."""

from __future__ import annotations

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

if TYPE_CHECKING:
    from harness import Rig


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

    def tend() -> None:
        for plant in plants:
            plant.tend()

    rig.until(lambda: all(plant.settled for plant in plants), 'rest at the setpoint',
              meanwhile=tend)
    vehicle, = (plant for plant in plants if isinstance(plant, Px4))
    rig.until(lambda: len(vehicle.heartbeats) > 3, 'offboard mode kept up')
    assert all(beat.thrust_and_torque and not beat.attitude for beat in vehicle.heartbeats)
    gaps_us = [later.timestamp - beat.timestamp for beat, later in zip(
        vehicle.heartbeats, vehicle.heartbeats[1:], strict=False)]
    assert sorted(gaps_us)[len(gaps_us) // 2] < 500_000  # more than twice a second
