# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Several spacecraft, one clock: shared, followed, and the wrong combinations, each named."""

from __future__ import annotations

import itertools
import math
import signal
from typing import Any

import pytest

pytest.importorskip('rclpy', reason='ROS 2 (rclpy) is not installed')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from harness import Process, Rig, stamp_ns
from nav_msgs.msg import Odometry
from own_time import OwnTime
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool, Trigger
from watching import is_settled, values_of

#: The wrong combinations are named within this, once both are found; waits for a processor apart.
NAMED_S = 2.0
PUBLISHES = {'timing.publish_clock': True}
FOLLOWS = {'use_sim_time': True}
#: Few states, so that the watcher of two spacecraft keeps up on a busy machine.
SPARSE = {'timing.state_period_s': 0.25}
TURN_Y = (0.0, math.sin(0.5), 0.0, math.cos(0.5))


def simulator(rig: Rig, namespace: str, **parameters: Any) -> Process:
    """Start a simulator in a namespace."""
    return rig.start('simulator', remap={'__ns': f'/{namespace}'}, parameters=parameters)


def spacecraft(rig: Rig, namespace: str, **parameters: Any) -> list[Odometry]:
    """Start controller and simulator in a namespace; return the states."""
    states = rig.watch(Odometry, f'/{namespace}/odometry')
    followed = bool({*PUBLISHES, *FOLLOWS} & {*parameters})
    rig.start('controller', remap={'__ns': f'/{namespace}'},
              parameters=FOLLOWS if followed else {})
    simulator(rig, namespace, **parameters)
    return states


def said(diagnostics: list[DiagnosticArray], node: str) -> str:
    """Return the latest message of a simulator."""
    return values_of(diagnostics, f'{node}/lgvi_simulator').get('message', '')


def level(diagnostics: list[DiagnosticArray], node: str) -> bytes:
    """Return the latest level of a simulator."""
    return next(status.level for array in reversed(diagnostics) for status in array.status
                if status.name == f'{node}/lgvi_simulator')


def test_two_clocks_are_named_and_at_most_one_goes_on(rig: Rig) -> None:
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    clock = rig.watch(Clock, '/clock')
    # A lost message of discovery is repeated after 3 s; not every pair loses one.
    for pair in (('sat1', 'sat2'), ('sat3', 'sat4'), ('sat5', 'sat6'), ('sat7', 'sat8')):
        processes = {name: simulator(rig, name, **PUBLISHES) for name in pair}
        rig.until(lambda: rig.node.count_publishers('/clock') == 2, 'two publishers of the clock')
        taken = OwnTime(*(process.pid for process in processes.values()))
        names = ' and '.join(f'/{name}/lgvi_simulator' for name in pair)
        conflict = f'two publishers of /clock: {names}'
        rig.until(lambda words=conflict, pair=pair: any(
            words in said(diagnostics, name) for name in pair), 'its name')
        if (named_s := taken.look()) < NAMED_S:
            break
        for process in processes.values():
            rig.end(process)
        rig.until(lambda: rig.node.count_publishers('/clock') == 0, 'no publisher')
    still = [name for name in processes if conflict in said(diagnostics, name)]
    assert all(level(diagnostics, name) == DiagnosticStatus.ERROR for name in still)
    assert all(processes[name].log.count(f'{conflict}; simulated time') == 1 for name in still)
    assert named_s < NAMED_S
    # One time at the most: from here on the clock does not go back.
    rig.settle()
    del clock[:]
    rig.settle()
    times = [(message.clock.sec, message.clock.nanosec) for message in clock]
    assert times == sorted(times)
    # With the other one gone, a reset lets time go on.
    other = next(name for name in processes if name != still[0])
    rig.end(processes[other])
    rig.until(lambda: rig.node.count_publishers('/clock') == 1, 'one publisher')
    assert rig.call(Trigger, f'/{still[0]}/lgvi_simulator/reset', Trigger.Request()).success
    del clock[:]
    rig.until(lambda: len(clock) > 20, 'time that goes on')
    rig.until(lambda: said(diagnostics, still[0]) == 'simulated time runs', 'no fault')


def test_a_clock_that_is_started_again_is_no_second_one(rig: Rig) -> None:
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    clock = rig.watch(Clock, '/clock')
    killed = simulator(rig, 'sat1', **PUBLISHES)
    rig.until(lambda: len(clock) > 5, 'the clock')
    rig.end(killed, signal.SIGKILL)
    del clock[:]
    simulator(rig, 'sat1', **PUBLISHES)
    rig.until(lambda: len(clock) > 60, 'the clock again')
    rig.more(diagnostics, 2, 'words of the new one')
    assert said(diagnostics, 'sat1') == 'simulated time runs'


def test_a_second_simulator_beside_a_clock_says_that_it_ignores_it(rig: Rig) -> None:
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    publishing = simulator(rig, 'sat1', **PUBLISHES)
    rig.until(lambda: said(diagnostics, 'sat1') == 'simulated time runs', 'the clock')
    words = 'not /clock of /sat1/lgvi_simulator; use_sim_time: true follows it'
    # Where the middleware loses a message of discovery, it repeats it after 3 s; not every time.
    for name in ('sat2', 'sat3', 'sat4', 'sat5'):
        ignoring = simulator(rig, name)
        rig.until(lambda name=name: said(diagnostics, name) != '', 'the second simulator')
        taken = OwnTime(publishing.pid, ignoring.pid)  # discovery is an exchange of both
        rig.until(lambda name=name: words in said(diagnostics, name), 'a warning')
        if (named_s := taken.look()) < NAMED_S:
            break
        rig.end(ignoring, signal.SIGTERM)
    assert named_s < NAMED_S
    assert level(diagnostics, name) == DiagnosticStatus.WARN
    rig.until(lambda: words in ignoring.log, 'the warning in the log')
    assert ignoring.log.count('stamps follow the system clock') == 1
    assert said(diagnostics, 'sat1') == 'simulated time runs'


def test_a_simulator_without_the_clock_it_follows_waits_and_says_so(rig: Rig) -> None:
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    states = rig.watch(Odometry, '/sat1/odometry')
    simulator(rig, 'sat1', **FOLLOWS)
    rig.until(lambda: said(diagnostics, 'sat1') == 'use_sim_time: no time comes on /clock',
              'waiting')
    assert level(diagnostics, 'sat1') == DiagnosticStatus.WARN
    rig.more(diagnostics, 2, 'further words')
    assert not states


def test_a_followed_clock_paces_the_plant_stamps_it_and_may_start_again(rig: Rig) -> None:
    """The plant moves with the clock that the test publishes, and not otherwise."""
    states = rig.watch(Odometry, '/sat1/odometry')
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    clock = rig.node.create_publisher(Clock, '/clock', 10)
    process = simulator(rig, 'sat1', **FOLLOWS)
    now_ns = 100 * 10**9

    def step(step_ns: int = 10**8) -> None:
        nonlocal now_ns
        now_ns += step_ns
        clock.publish(Clock(clock=Time(sec=now_ns // 10**9, nanosec=now_ns % 10**9)))

    rig.until(lambda: len(states) > 20, 'states', meanwhile=step)
    rig.until(lambda: 0 <= now_ns - stamp_ns(states[-1]) < 50_000_000, 'the time of the clock',
              meanwhile=lambda: step(0))
    stamps = [stamp_ns(state) for state in states]
    assert {b - a for a, b in itertools.pairwise(stamps)} == {50_000_000}
    assert stamps[0] > 100 * 10**9
    rig.more(diagnostics, 3, 'words of a plant without time')
    assert len(states) == len(stamps)
    # Time that passed in a pause is not made up for.
    pause = '/sat1/lgvi_simulator/pause'
    assert rig.call(SetBool, pause, SetBool.Request(data=True)).success
    step(25 * 10**8)
    rig.more(diagnostics, 5, 'words in the pause', meanwhile=lambda: step(0))
    del states[:]
    assert rig.call(SetBool, pause, SetBool.Request(data=False)).success
    resumed_ns = now_ns
    rig.until(lambda: len(states) > 4, 'states after the pause', meanwhile=step)
    assert stamp_ns(states[0]) > resumed_ns - 5 * 10**8
    # A clock that goes back starts the simulation again.
    now_ns = 10**9
    rig.until(lambda: stamp_ns(states[-1]) < 10 * 10**9, 'the restart', meanwhile=step)
    assert process.log.count('the simulation starts again') == 1


@pytest.mark.parametrize('second', [
    pytest.param(PUBLISHES | {'timing.real_time_factor': 4.0}, id='one clock, followed'),
    pytest.param({}, id='wall clock')])
def test_two_spacecraft_settle_side_by_side(rig: Rig, second: dict[str, Any]) -> None:
    """Each goes to the attitude that it was told, and only there."""
    diagnostics = rig.watch(DiagnosticArray, '/diagnostics')
    torques = {name: rig.watch(WrenchStamped, f'/{name}/torque_command')
               for name in ('sat1', 'sat2')}
    states = {'sat1': spacecraft(rig, 'sat1', **SPARSE, **second),
              'sat2': spacecraft(rig, 'sat2', **SPARSE, **(FOLLOWS if second else {}),
                                 **{'plant.initial_attitude_xyzw': list(TURN_Y)})}
    rig.until(lambda: all(is_settled(each) for each in states.values()), 'both at rest')
    for name, other in (('sat1', 'sat2'), ('sat2', 'sat1')):
        assert len(torques[name]) > 9
        assert rig.node.count_publishers(f'/{name}/torque_command') == 1
        if not second:  # stamps of the system clock are never shared
            foreign = {stamp_ns(state) for state in states[other]}
            assert not foreign & {stamp_ns(command) for command in torques[name]}
        values = values_of(diagnostics, f'{name}/attitude_controller')
        assert values['exceptions'] == '0'
        assert said(diagnostics, name) == 'simulated time runs'
