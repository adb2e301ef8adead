# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller that the rule gives for a body: the one whose worst slew is the quickest."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from manifold_mpc_ros.config.parameter import Value
from manifold_mpc_ros.control.moving.slew_profile import SlewPlanner
from manifold_mpc_ros.lab.batch.model_loop import LoopingMpc
from manifold_mpc_ros.lab.tune import rule, trial
from manifold_mpc_ros.lab.tune.rule import Timing, Weights
from manifold_mpc_ros.lab.tune.trial import Flyer, Outcome, Slew

# Dampings that are tried.
DAMPINGS = (0.015, 0.03, 0.05)
# Nearer than this profiles do not begin [rad], the default of the controller.
SMALLEST_RAD = 0.1
# Bodies that are not the model: what, inertia over the controller's, part of the torque that acts.
MARGINS = (('inertia 10 % larger', 1.1, 0.0), ('inertia 10 % smaller', 0.9, 0.0),
           ('2 % of the torque as disturbance', 1.0, 0.02))


class Pace(NamedTuple):
    """What is traded for time: full torque costs what an error of ``effort`` accuracies does.

    ``fractions`` are the parts of the limits that profiles use, 0 without profiles; all are tried.
    """

    effort: float
    fractions: tuple[float, ...]


FASTER, NORMAL, GENTLER = Pace(2.0, (0.0, 0.985)), Pace(5.0, (0.0, 0.97)), Pace(20.0, (0.5,))


class Trial(NamedTuple):
    """One choice of weights, the parameters it gives, how it flew, its hardest slew off-model."""

    weights: Weights
    chosen: dict[str, Value]
    flyer: Flyer
    outcomes: list[Outcome]
    margins: list[Outcome]

    @property
    def hardest(self) -> Outcome:
        """The slew that settles latest against its bound."""
        return max(self.outcomes, key=lambda outcome: outcome.ratio)


def try_all(values: Mapping[str, Value], pace: Pace, accuracy_rad: float,
            slews: Sequence[Slew], step_s: float | None = None,
            on_trial: Callable[[Weights], object] = bool) -> list[Trial]:
    """Fly every slew with every damping, aiming at the setpoint and by a profile."""
    trials = []
    for fraction in pace.fractions:
        for damping in DAMPINGS:
            weights = Weights(pace.effort * accuracy_rad, damping, fraction)
            on_trial(weights)
            timing, half_turn = rule.timing_of(values, weights, step_s)
            trials.append(fly(values, timing, weights, half_turn, slews, accuracy_rad))
    return trials


def best_of(trials: Sequence[Trial]) -> Trial:
    """Return the trial whose worst ratio is least, of equals within a percent off the model."""
    return min(trials, key=lambda each: (
        round(trial.worst_ratio(each.outcomes), 2),
        max(outcome.ratio for outcome in each.margins)))


def built(values: Mapping[str, Value], timing: Timing, weights: Weights, half_turn: float
          ) -> tuple[dict[str, Value], Flyer]:
    """Build one controller; return the parameters of the rule, and what flies."""
    chosen, config = rule.controller(values, timing, weights, half_turn)
    if not weights.torque_fraction:
        return chosen, Flyer(LoopingMpc(config))
    return chosen, Flyer(LoopingMpc(config, moving=True), SlewPlanner(
        config, weights.torque_fraction, SMALLEST_RAD))


def fly(values: Mapping[str, Value], timing: Timing, weights: Weights, half_turn: float,
        slews: Sequence[Slew], accuracy_rad: float) -> Trial:
    """Build one controller and fly every slew, the hardest one off the model too."""
    chosen, flyer = built(values, timing, weights, half_turn)
    outcomes = trial.fly(flyer, slews, accuracy_rad)
    hardest = max(outcomes, key=lambda outcome: outcome.ratio).slew
    return Trial(weights, chosen, flyer, outcomes, [
        trial.fly(flyer, [hardest], accuracy_rad, inertia_factor=inertia,
                  disturbance_part=disturbance)[0] for _, inertia, disturbance in MARGINS])
