# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bond with a lifecycle manager, whose end the test plays; and a node that cannot have one."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING, Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import GetState
from watching import values_of

if TYPE_CHECKING:
    from pathlib import Path

    from harness import Rig

NODE = 'lgvi_simulator'
BOND = {'bond_period_s': 0.05}


class Manager:
    """The other end of the bond, and what it hears."""

    def __init__(self, rig: Rig) -> None:
        from bond.msg import Status

        self._kind, self._rig = Status, rig
        self.heard: list[Any] = []
        rig.node.create_subscription(Status, 'bond', self._hear, 50)
        self._publisher = rig.node.create_publisher(Status, 'bond', 10)

    def _hear(self, status: Any) -> None:
        """Keep what the node says."""
        if status.instance_id != 'manager':
            self.heard.append(status)

    def say(self, *, active: bool, name: str = NODE) -> None:
        """Say whether the bond is in force."""
        self._publisher.publish(self._kind(id=name, instance_id='manager', active=active))

    def hears(self, count: int) -> None:
        """Wait for so many heartbeats from now on."""
        self.heard.clear()
        self._rig.until(lambda: len(self.heard) >= count, 'heartbeats')


def test_a_bond_forms_ends_and_forms_again(
    rig: Rig, bond_package: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(str(bond_package))
    manager, diagnostics = Manager(rig), rig.watch(DiagnosticArray, '/diagnostics')
    rig.start('simulator', parameters=BOND | {'autostart': False}, PYTHONPATH=str(bond_package))
    assert rig.transition(f'/{NODE}', Transition.TRANSITION_CONFIGURE)
    assert not manager.heard
    assert rig.transition(f'/{NODE}', Transition.TRANSITION_ACTIVATE)
    manager.hears(3)
    assert {(each.id, each.active) for each in manager.heard} == {(NODE, True)}
    (first,) = {each.instance_id for each in manager.heard}

    def bond() -> str:
        return values_of(diagnostics, NODE).get('bond', '')

    rig.until(lambda: bond() == 'waits for a manager', 'no bond yet')
    rig.until(lambda: bond() == 'formed', 'the bond', meanwhile=lambda: manager.say(active=True))
    manager.say(active=False, name='another_node')
    manager.hears(3)
    # The node ends it, and begins another.
    assert rig.transition(f'/{NODE}', Transition.TRANSITION_DEACTIVATE)
    rig.until(lambda: not manager.heard[-1].active, 'the end of the bond')
    assert manager.heard[-1].instance_id == first
    assert rig.transition(f'/{NODE}', Transition.TRANSITION_ACTIVATE)
    rig.until(lambda: manager.heard[-1].active, 'another bond')
    assert manager.heard[-1].instance_id != first
    # The manager ends it: that is acknowledged, and the node goes on.
    rig.until(lambda: not manager.heard[-1].active, 'the acknowledgement',
              meanwhile=lambda: manager.say(active=False))
    rig.until(lambda: bond() == 'ended', 'no bond')
    rig.more(diagnostics, 2, 'further words')
    manager.heard.clear()
    rig.more(diagnostics, 2, 'further words')
    assert not manager.heard
    state = rig.call(GetState, f'/{NODE}/get_state', GetState.Request()).current_state
    assert state.id == State.PRIMARY_STATE_ACTIVE


@pytest.mark.skipif(importlib.util.find_spec('bond') is not None, reason='bond is installed')
def test_a_bond_without_its_package_is_refused_in_a_sentence(rig: Rig) -> None:
    process = rig.start('simulator', parameters=BOND)
    assert process.wait() == 1
    assert process.log.count(
        'bond_period_s: 0.05 is not valid; expected 0, or bond/msg/Status to be a type of an '
        'installed package (apt-get install ros-jazzy-bond)') == 1, process.log
