# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Directions of cones, followed from stamped messages: what moves steadily is seen to go on.

Of the messages of the last horizon as many as lie on one arc at one rate say how a direction
moves: at least three, over a quarter of the horizon or more, each within 2 mrad and 5 % of the
arc of where the rate has it. It goes on at that rate for a horizon after the last message, and
holds there. It is taken for fixed where the arc is below 4 mrad (noise), where the messages are
fewer or say otherwise (a jump), have no stamp or one that is not later, and above half of the
body's rate limit, or what would leave nothing of a cone (:func:`largest_rate_rad_s`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from manifold_mpc_ros.config.cones import tightened
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.control.input_gate import NANOSECONDS, to_ns
from manifold_mpc_ros.errors import ConfigurationError
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

#: How far messages may be from a steady motion [rad, part of the arc], and an arc that is none.
OFF_RAD, OFF_PART, STILL_RAD = 2e-3, 0.05, 4e-3
#: Messages that a motion needs, and the part of the horizon that they span.
LEAST_MESSAGES, LEAST_SPAN = 3, 0.25
#: A direction that is farther than this from where it was expected jumped [rad].
JUMP_RAD = 1e-3
# Messages are kept so many to a horizon.
_KEPT = 16


def largest_rate_rad_s(config: AttitudeMpcConfig) -> float:
    """Return the largest rate at which directions are followed [rad/s]; 0 where none is."""
    rate = min(float(limit.rate_about(axis)) for limit in config.rate_limits
               for axis in np.eye(3)) / 2.0
    for _ in range(10):
        try:
            tightened(config.cones, config.between_samples,
                      [rate * config.step_s] * len(config.cones))
            return rate
        except ConfigurationError:
            rate /= 2.0
    return 0.0


@dataclass
class MovingDirection:
    """One direction: the messages that it is known from, and its rate (3,) [rad/s] in N."""

    stamps_ns: list[int] = field(default_factory=list)
    seen_N: list[Array] = field(default_factory=list)
    rate_N: Array | None = None

    def at(self, times_ns: Array, horizon_ns: int) -> Array:
        """Return the unit directions (n, 3) at times (n,) [ns]; the last one while it is fixed."""
        last = self.seen_N[-1]
        if self.rate_N is None:
            return np.tile(last, (len(times_ns), 1))
        after_s = np.clip(times_ns - self.stamps_ns[-1], -horizon_ns, horizon_ns) / NANOSECONDS
        return np.asarray(so3.exp(after_s[:, None] * self.rate_N) @ last)

    def take(self, stamp_ns: int, direction_N: Array, horizon_ns: int, most_rad_s: float) -> None:
        """Take a message, and find out whether and how it moves."""
        stamps, seen = self.stamps_ns, self.seen_N
        if stamps and stamp_ns <= stamps[-1]:
            stamps.clear()
            seen.clear()
        elif len(stamps) > 1 and stamps[-1] - stamps[-2] < horizon_ns // _KEPT:
            del stamps[-1], seen[-1]
        stamps.append(stamp_ns)
        seen.append(direction_N)
        first = next(i for i, each in enumerate(stamps) if each >= stamp_ns - horizon_ns)
        while (rate := _steady(stamps[first:], seen[first:])) is None and (
                len(stamps) - first > LEAST_MESSAGES):
            first += 1
        del stamps[:first], seen[:first]
        spans = stamps[-1] - stamps[0] >= LEAST_SPAN * horizon_ns and stamps[0] > 0
        self.rate_N = rate if rate is not None and spans and (
            0.0 < np.linalg.norm(rate) <= most_rad_s) else None


def _steady(stamps_ns: list[int], seen_N: list[Array]) -> Array | None:
    """Return the rate (3,) [rad/s] of messages on one arc, 0 for none; None where they are not."""
    if len(stamps_ns) < LEAST_MESSAGES:
        return None
    first, seen = seen_N[0], np.array(seen_N)
    normal = np.cross(first, seen[-1])
    sine = float(np.linalg.norm(normal))
    angle = float(np.arctan2(sine, first @ seen[-1]))
    after_s = (np.array(stamps_ns) - stamps_ns[0]) / NANOSECONDS
    moves = angle > STILL_RAD and sine > 0.0
    rate = normal / sine * angle / after_s[-1] if moves else np.zeros(3)
    off = np.linalg.norm(so3.exp(after_s[:, None] * rate) @ first - seen, axis=1).max()
    return rate if off <= OFF_RAD + OFF_PART * angle else None


class ConeDirections:
    """The directions that have come, by the names of their cones."""

    def __init__(self, config: AttitudeMpcConfig) -> None:
        """Begin with none."""
        self._moving: dict[str, MovingDirection] = {}
        self.configure(config)

    def configure(self, config: AttitudeMpcConfig) -> None:
        """Follow them as another configuration has it from now on."""
        self._horizon_ns = to_ns(config.horizon * config.step_s)
        self._nodes_ns = np.array([to_ns(k * config.step_s) for k in range(config.horizon + 1)])
        self._most_rad_s = largest_rate_rad_s(config) if config.cones else 0.0

    def take(self, name: str, direction_N: Array, stamp_ns: int) -> bool:
        """Take a unit direction (3,) of this stamp (0: none); return whether it jumped."""
        jumped = name in self._moving and bool(np.linalg.norm(
            self.at(stamp_ns)[name] - direction_N) > JUMP_RAD)
        self._moving.setdefault(name, MovingDirection()).take(
            stamp_ns, direction_N, self._horizon_ns, self._most_rad_s)
        return jumped

    def at(self, time_ns: int) -> dict[str, Array]:
        """Return the directions (3,) at a time."""
        return {name: each.at(np.array([time_ns]), self._horizon_ns)[0]
                for name, each in self._moving.items()}

    def over_horizon(self, time_ns: int) -> dict[str, Array]:
        """Return those of every node of a plan from a time on, (N + 1, 3), (3,) of a fixed one."""
        return {name: each.seen_N[-1] if each.rate_N is None else each.at(
            time_ns + self._nodes_ns, self._horizon_ns) for name, each in self._moving.items()}

    def rates_rad_s(self) -> dict[str, float]:
        """Return how fast each one moves [rad/s]."""
        return {name: 0.0 if each.rate_N is None else float(np.linalg.norm(each.rate_N))
                for name, each in self._moving.items()}
