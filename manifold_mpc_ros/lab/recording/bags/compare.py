# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Torques of a replay beside those of the recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.lab.recording.bags.series import CommandSeries
from manifold_mpc_ros.lie.arrays import Array, IntArray


@dataclass(frozen=True, eq=False)
class Comparison:
    """k recorded torques beside the replay's, in the order of recording.

    ``replayed`` is NaN where the replay has no answer to that state.
    """

    stamp_ns: IntArray      # (k,) of the state answered
    time_s: Array      # (k,) since the first state
    recorded: Array    # (k, 3) [N m]
    replayed: Array    # (k, 3) [N m]

    def __len__(self) -> int:
        """Return k."""
        return len(self.stamp_ns)

    @property
    def difference_n_m(self) -> Array:
        """The largest difference about any axis, infinite without an answer (k,) [N m]."""
        largest = np.abs(self.replayed - self.recorded).max(axis=1, initial=0.0)
        return np.where(np.isfinite(largest), largest, np.inf)

    @property
    def unanswered(self) -> int:
        """How many recorded torques have no counterpart."""
        return int((~np.isfinite(self.replayed).all(axis=1)).sum())

    @property
    def identical(self) -> bool:
        """Whether every torque has the same bits."""
        return self.recorded.tobytes() == self.replayed.tobytes()

    def first_beyond(self, tolerance_n_m: float, *, unanswered: bool = True) -> int | None:
        """Return the first index at which the difference exceeds a tolerance; 0 means bits.

        A torque without a counterpart differs, unless ``unanswered`` is false.
        """
        if tolerance_n_m > 0.0:
            beyond = self.difference_n_m > tolerance_n_m
        else:
            beyond = (self.recorded.view(np.int64) != self.replayed.view(np.int64)).any(axis=1)
        if not unanswered:
            beyond &= np.isfinite(self.replayed).all(axis=1)
        return int(np.argmax(beyond)) if beyond.any() else None


def compare_torques(
    recorded: CommandSeries, replayed: Mapping[int, Array], within_s: float = 0.0,
) -> Comparison:
    """Put each recorded torque beside the replay's answer to the same state.

    Arguments
    ---------
    recorded
        The commands of the bag.
    replayed
        Torques (3,) by the stamp of the state that they answer [ns].
    within_s
        How far another stamp may be to stand in for one that is missing [s]; nearest first.

    """
    known = np.array(sorted(replayed), dtype=np.int64)
    rows = np.full((len(recorded), 3), np.nan)
    for row, stamp_ns in enumerate(map(int, recorded.stamp_ns)):
        at = int(np.searchsorted(known, stamp_ns))
        near = known[max(0, at - 1):at + 1]  # the last before, and the first not before
        distances = np.abs(near - stamp_ns)
        if len(near) and distances.min() <= within_s * NANOSECONDS:
            rows[row] = replayed[int(near[distances.argmin()])]
    return Comparison(recorded.stamp_ns, recorded.time_s,
                      np.ascontiguousarray(recorded.torque_B_n_m), rows)
