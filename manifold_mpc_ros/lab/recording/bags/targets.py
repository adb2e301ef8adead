# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What was commanded in a run, as a function of time: setpoints, and references that move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.input_gate import NANOSECONDS, Refusal
from manifold_mpc_ros.control.moving.gate import Frame, Point, admit_moving, admit_trajectory
from manifold_mpc_ros.control.moving.trajectory import Trajectory
from manifold_mpc_ros.control.target import FixedTarget, Target, goes_on
from manifold_mpc_ros.lab.recording.bags import decode
from manifold_mpc_ros.lab.recording.bags.series import ReferenceSeries, SetpointSeries
from manifold_mpc_ros.lie.arrays import Array, IntArray


def read_trajectory(content: Any) -> Trajectory:
    """Return the trajectory of a message as the controller reads it; raises Unusable."""
    points = [Point(
        _ns(point.time_from_start), _numbers(point.transforms[0].rotation, 'xyzw'),
        _angular(point.velocities), _angular(point.accelerations)) for point in content.points]
    frame = content.header.frame_id
    return _usable(admit_trajectory(
        frame, _ns(content.header.stamp), points, Frame(frame, None)))


def read_moving_setpoint(content: Any, valid_s: float, config: AttitudeMpcConfig) -> Trajectory:
    """Return an odometry setpoint, which goes on for ``valid_s``, in the same way."""
    frame = content.header.frame_id
    return _usable(admit_moving(
        frame, _ns(content.header.stamp), _numbers(content.pose.pose.orientation, 'xyzw'),
        _numbers(content.twist.twist.angular, 'xyz'), Frame(frame, None),
        valid_s=valid_s, seen_s=config.steps.in_periods * config.step_s))


def _usable(admitted: Trajectory | Refusal) -> Trajectory:
    """Return what is admitted; raises Unusable for a refusal."""
    if isinstance(admitted, Refusal):
        raise decode.Unusable(admitted.detail)
    return admitted


def _ns(time: Any) -> int:
    """Return a time or a duration [ns]."""
    return int(time.sec) * NANOSECONDS + int(time.nanosec)


def _numbers(content: Any, names: str) -> Any:
    """Return the numbers of a message by name."""
    return tuple(float(getattr(content, name)) for name in names)


def _angular(given: Sequence[Any]) -> Any:
    """Return the angular part of the one that is given, None where there is none."""
    return _numbers(given[0].angular, 'xyz') if len(given) == 1 else None


@dataclass(frozen=True, eq=False)
class Commanded:
    """The targets of a run in the order of their stamps; the first one is the initial setpoint."""

    stamp_ns: IntArray
    targets: tuple[Target, ...]

    @classmethod
    def of(
        cls, initial: Array, setpoints: SetpointSeries, references: ReferenceSeries,
    ) -> Commanded:
        """Return what was commanded; before everything the attitude ``initial`` (3, 3)."""
        rows: list[tuple[int, int, Target]] = [
            (int(stamp), int(received), FixedTarget(R_ND)) for stamp, received, R_ND in zip(
                setpoints.stamp_ns, setpoints.received_ns, setpoints.R_ND, strict=True)]
        rows += [(int(stamp), int(received), each) for stamp, received, each in zip(
            references.stamp_ns, references.received_ns, references.trajectories, strict=True)]
        rows.sort(key=lambda row: row[:2])
        return cls(np.array([row[0] for row in rows], dtype=np.int64),
                   (FixedTarget(initial), *(row[2] for row in rows)))

    def at(self, stamps_ns: IntArray) -> tuple[Array, Array]:
        """Map times (n,) [ns] to R_ND (n, 3, 3) and omega_DN_D (n, 3) [rad/s].

        The last target with an earlier or equal stamp.
        """
        rows = [self.targets[index].at(int(stamp)) for index, stamp in zip(
            np.searchsorted(self.stamp_ns, stamps_ns, side='right'), stamps_ns, strict=True)]
        return (np.array([row[0] for row in rows]).reshape(-1, 3, 3),
                np.array([row[1] for row in rows]).reshape(-1, 3))

    def jumps_ns(self, step_s: float) -> list[int]:
        """Return the stamps [ns] of moving targets that do not go on where the last one was."""
        return [int(stamp) for stamp, before, after in zip(
            self.stamp_ns, self.targets, self.targets[1:], strict=False)
            if after.moves and not goes_on(before, after, int(stamp), step_s)]
