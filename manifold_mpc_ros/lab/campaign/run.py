# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a campaign came to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from manifold_mpc_ros.lab.campaign.outcome import Outcome


@dataclass(frozen=True, eq=False)
class Run:
    """What a campaign came to: every outcome there is, and how the new ones were made."""

    outcomes: list[Outcome]
    planned: int
    new: int
    where: str
    elapsed_s: float

    @property
    def complete(self) -> bool:
        """Whether every case was run."""
        return len(self.outcomes) == self.planned

    @property
    def broken(self) -> list[Outcome]:
        """The outcomes that broke anything."""
        return [outcome for outcome in self.outcomes if outcome.broken]
