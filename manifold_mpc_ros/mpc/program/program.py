# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which phases make up the parts of a solve, in their order."""

from __future__ import annotations

from typing import NamedTuple

from manifold_mpc_ros.mpc.program.phase import Phase, Structure
from manifold_mpc_ros.mpc.stages import (
    initial_guess,
    initial_state,
    line_search,
    merit,
    plan_report,
    plant,
    quadratic_model,
    riccati,
    terminal,
)
from manifold_mpc_ros.mpc.stages.cone import direction_phases
from manifold_mpc_ros.mpc.stages.inequalities import (
    cone_inequalities,
    torque_inequalities,
    wheel_inequalities,
)


class Program(NamedTuple):
    """The parts of a solve, each a sequence of phases.

    ``set_state`` sets the state; ``slew`` or ``shift`` roll a start out; ``cold`` or ``warm`` put
    its barrier variables where the solve begins; ``way`` says how fast a start goes round cones;
    ``backward`` models a trajectory, ``trial_step`` makes the next one; ``report`` and ``poses``
    say what the caller of a solve wants to know; ``plant`` moves a body on by one step,
    ``motion`` the measured one, whose torque is constant over a step.
    """

    set_state: tuple[Phase, ...]
    slew: tuple[Phase, ...]
    shift: tuple[Phase, ...]
    cold: tuple[Phase, ...]
    warm: tuple[Phase, ...]
    way: tuple[Phase, ...]
    backward: tuple[Phase, ...]
    trial_step: tuple[Phase, ...]
    report: tuple[Phase, ...]
    poses: tuple[Phase, ...]
    plant: tuple[Phase, ...]
    motion: tuple[Phase, ...]


def program_of(structure: Structure) -> Program:
    """Return the phases of a structure."""
    s = structure
    if s.symmetric:
        node = quadratic_model.symmetric_node_phase(s)
        transition = quadratic_model.symmetric_transition_phase(s)
    else:
        node = quadratic_model.paper_node_phase(s)
        transition = quadratic_model.paper_transition_phase()
    gather, begin_terminal = merit.gather_phase(s), initial_guess.begin_terminal_phase(s)
    reach = (riccati.largest_reach_phase(),) if torque_inequalities(s) or wheel_inequalities(
        s) else ()
    return Program(
        set_state=(initial_state.set_state_phase(s), *direction_phases(cone_inequalities(s))),
        slew=(initial_guess.slew_phase(s),),
        shift=(initial_guess.shift_phase(s), initial_guess.local_phase(s)),
        cold=(initial_guess.cold_node_phase(s), initial_guess.cold_stage_phase(s),
              begin_terminal, gather),
        warm=(initial_guess.warm_node_phase(s), initial_guess.warm_stage_phase(s),
              begin_terminal, gather),
        way=initial_guess.way_phases(s),
        backward=(quadratic_model.force_phase(s), node, terminal.terminal_phase(s),
                  quadratic_model.costate_phase(s), transition, riccati.riccati_phase(s),
                  riccati.linear_phase(s), riccati.reach_phase(s), *reach),
        trial_step=(line_search.turn_phase(s), line_search.chain_phase(s),
                    line_search.node_phase(s), line_search.stage_phase(s),
                    line_search.terminal_phase(s), gather),
        report=plan_report.report_phases(s), poses=(plan_report.pose_phase(),),
        plant=(plant.plant_phase(symmetric=s.symmetric),),
        motion=(plant.plant_phase(symmetric=True),))
