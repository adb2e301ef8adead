# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Follow one warm tick through the real controller node, call by call.

    python benchmarks/follow_tick.py [--output docs/results/tick_path.json]

The node runs in this process with the shipped parameters, its states come over DDS (on this
computer, in the domain that ROS_DOMAIN_ID says),
and a profile function in every thread notes each call into a file of the package while the
executor answers. Two ticks are followed: in lockstep, where the state's callback answers, and
timed, where the timer does and the solver works in a thread of its own. Of several warm ticks
the path is the one that is seen most often.

calls: functions of the package that were entered. files, folders: in which they are. changes of
folder: calls whose caller, the nearest frame of the package, is in another folder. runs: how
often, in the order of the calls, one is not in the folder of the one before; coming back from a
call counts here too. Exits with 1 when a tick changes folder more often than `MOST_CHANGES`.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')

import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node

import manifold_mpc_ros
from manifold_mpc_ros.nodes.controller.main import PROGRAM
from manifold_mpc_ros.nodes.controller.node import AttitudeControllerNode
from manifold_mpc_ros.nodes.executor import GuardedExecutor

PACKAGE = str(Path(manifold_mpc_ros.__file__).parent) + '/'
TOP = Path(__file__).resolve().parent.parent
#: At most so many changes of folder in a tick.
MOST_CHANGES = 14
#: What this counts of earlier commits: 63bbe4a had not told what flies from the laboratory, in
#: e229e26 every module had its place.
EARLIER = {'63bbe4a': {'lockstep': 29, 'timed': 30}, 'e229e26': {'lockstep': 27, 'timed': 29},
           '87722c2': {'lockstep': 28, 'timed': 30}, '115df6c': {'lockstep': 21, 'timed': 24}}
TICKS = 15
#: A state that nobody answers within so many looks of the executor is sent again.
LOOKS = 100


@dataclass(frozen=True)
class Call:
    """One call into a file of the package; ``caller`` is the file it came from, if any."""

    file: str
    function: str
    caller: str = ''

    @property
    def folder(self) -> str:
        """The folder of the file, below the package."""
        return _folder(self.file)


def _folder(file: str) -> str:
    """Return the folder of a file below the package."""
    return file.rpartition('/')[0] or '.'


class Profile:
    """Notes every call into the package, in every thread, while it is on."""

    def __init__(self) -> None:
        """Begin in this thread and in those that are started from now on."""
        self.calls: list[Call] = []
        self.on = False
        threading.setprofile(self._note)
        sys.setprofile(self._note)

    def _note(self, frame: FrameType, event: str, _argument: object) -> None:
        """Note a call of a Python function of the package."""
        name = frame.f_code.co_filename
        if self.on and event == 'call' and name.startswith(PACKAGE):
            caller = frame.f_back
            while caller is not None and not caller.f_code.co_filename.startswith(PACKAGE):
                caller = caller.f_back
            self.calls.append(Call(
                name[len(PACKAGE):], frame.f_code.co_name,
                '' if caller is None else caller.f_code.co_filename[len(PACKAGE):]))


def figures(path: Sequence[Call]) -> dict[str, Any]:
    """Return what is told of a path."""
    folders = [folder for folder, _ in itertools.groupby(call.folder for call in path)]
    changes = [f'{call.caller} > {call.file}:{call.function}' for call in path
               if call.caller and _folder(call.caller) != call.folder]
    return {
        'calls': len(path), 'files': len({call.file for call in path}),
        'folders': len(set(folders)), 'changes_of_folder': len(changes),
        'runs': len(folders) - 1, 'folders_in_order': folders, 'changes': changes,
        'path': [f'{call.file}:{call.function}' for call in path],
    }


class Bench:
    """The controller node and, in the same process, a node that sends it states."""

    def __init__(self, profile: Profile, *, lockstep: bool) -> None:
        """Configure and activate the controller."""
        self._profile = profile
        rclpy.init(args=[
            'controller', '--ros-args', '--params-file', str(TOP / 'config' / 'controller.yaml'),
            '-p', f'lockstep:={str(lockstep).lower()}', '--log-level', 'warn'])
        self.controller = AttitudeControllerNode(PROGRAM, complete=True)
        self._source = Node('state_source')
        self._states = self._source.create_publisher(Odometry, 'odometry', 10)
        self._executor = GuardedExecutor(self.controller.barrier)
        self._executor.add_node(self.controller)
        self.controller.trigger_configure()
        self.controller.trigger_activate()
        self._lockstep = lockstep
        self._stamp_ns = 0

    def close(self) -> None:
        """Deactivate and take down."""
        self.controller.trigger_deactivate()
        self._executor.shutdown(timeout_sec=0)
        self.controller.destroy_node()
        self._source.destroy_node()
        rclpy.shutdown()

    def tick(self) -> list[Call]:
        """Return the calls of the state's callback and of the tick that answers it."""
        nominal = 'command_source', 'mpc'
        while True:
            self._send()
            taken = self._until(lambda calls: any('admit' in call.function for call in calls))
            if not taken:
                continue
            path = taken if _is_answered(taken) else taken + self._until(_is_answered)
            if self.controller.status().values.get(nominal[0]) == nominal[1]:
                return path

    def _until(self, wanted: Callable[[list[Call]], bool]) -> list[Call]:
        """Return the calls of the first callback that has wanted ones, none if none comes."""
        for _ in range(LOOKS):
            self._profile.calls, self._profile.on = [], True
            self._executor.spin_some(0.05)
            self._profile.on = False
            if wanted(self._profile.calls):
                return self._profile.calls
        return []

    def _send(self) -> None:
        """Publish a body at rest, 0.3 rad from where it should be."""
        now_ns = self._source.get_clock().now().nanoseconds
        self._stamp_ns = self._stamp_ns + 500_000_000 if self._lockstep else now_ns
        message = Odometry(child_frame_id='base_link')
        message.header.frame_id = 'inertial'
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(self._stamp_ns, 10**9)
        message.pose.pose.orientation.z = 0.15
        message.pose.pose.orientation.w = (1.0 - 0.15**2) ** 0.5
        self._states.publish(message)


def _is_answered(calls: Sequence[Call]) -> bool:
    """Return whether a torque was published among the calls."""
    return any((call.file, call.function) == ('nodes/command_output.py', 'send')
               for call in calls)


def follow(*, lockstep: bool) -> list[Call]:
    """Return the path of a warm tick that is seen most often among several."""
    profile = Profile()
    bench = Bench(profile, lockstep=lockstep)
    try:
        paths = [tuple(bench.tick()) for _ in range(TICKS)]
    finally:
        sys.setprofile(None)
        threading.setprofile(None)  # type: ignore[arg-type]
        bench.close()
    return list(Counter(paths[2:]).most_common(1)[0][0])


def main() -> int:
    """Follow both ticks, print what they do and write it down; return the exit status."""
    parser = argparse.ArgumentParser(
        description=(__doc__ or '').partition('\n')[0],
        epilog='The file has every call; what is printed are the changes of folder.')
    parser.add_argument('--output', type=Path, default=TOP / 'docs' / 'results' / 'tick_path.json',
                        help='the file to write (%(default)s)')
    arguments = parser.parse_args()
    result: dict[str, Any] = {
        'most_changes_of_folder': MOST_CHANGES,
        'changes_of_folder_in_earlier_commits': EARLIER}
    for name in ('lockstep', 'timed'):
        told = result[name] = figures(follow(lockstep=name == 'lockstep'))
        for line in told['changes']:
            print(f'  {line}')
        print(f'{name}: {told["calls"]} calls, {told["files"]} files, {told["folders"]} folders, '
              f'{told["changes_of_folder"]} changes of folder, {told["runs"]} runs: '
              f'{" > ".join(told["folders_in_order"])}')
    arguments.output.write_text(json.dumps(result, indent=1) + '\n', encoding='utf-8')
    return int(any(
        result[name]['changes_of_folder'] > MOST_CHANGES for name in ('lockstep', 'timed')))


if __name__ == '__main__':
    sys.exit(main())
