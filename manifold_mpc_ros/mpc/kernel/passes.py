# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which phases make up the parts of a solve, in their order."""

from __future__ import annotations

from typing import NamedTuple

from manifold_mpc_ros.mpc.kernel import (
    measure,
    merit,
    model,
    plant,
    report,
    start,
    sweep,
    terminal,
    trial,
)
from manifold_mpc_ros.mpc.kernel.phase import Phase
from manifold_mpc_ros.mpc.kernel.structure import Structure


class Program(NamedTuple):
    """The parts of a solve, each a sequence of phases.

    ``measure`` sets the state; ``slew`` or ``shift`` roll a start out; ``cold`` or ``warm`` put
    its barrier variables where the solve begins; ``backward`` models a trajectory, ``trial`` makes
    the next one; ``report`` says what the caller of a solve wants to know; ``plant`` moves a body
    on by one step.
    """

    measure: tuple[Phase, ...]
    slew: tuple[Phase, ...]
    shift: tuple[Phase, ...]
    cold: tuple[Phase, ...]
    warm: tuple[Phase, ...]
    backward: tuple[Phase, ...]
    trial: tuple[Phase, ...]
    report: tuple[Phase, ...]
    plant: tuple[Phase, ...]


def program_of(structure: Structure) -> Program:
    """Return the phases of a structure."""
    s = structure
    if s.symmetric:
        node, transition = model.symmetric_node_phase(s), model.symmetric_transition_phase(s)
    else:
        node, transition = model.paper_node_phase(s), model.paper_transition_phase()
    gather, begin_terminal = merit.gather_phase(s), start.begin_terminal_phase(s)
    reach = (sweep.largest_reach_phase(),) if s.torque_box else ()
    return Program(
        measure=(measure.measure_phase(s),),
        slew=(start.slew_phase(s),),
        shift=(start.shift_phase(s), start.local_phase(s)),
        cold=(start.cold_node_phase(s), start.cold_stage_phase(s), begin_terminal, gather),
        warm=(start.warm_node_phase(s), start.warm_stage_phase(s), begin_terminal, gather),
        backward=(model.force_phase(s), node, terminal.terminal_phase(s),
                  model.costate_phase(s), transition, sweep.sweep_phase(s),
                  sweep.linear_phase(s), sweep.reach_phase(s), *reach),
        trial=(trial.turn_phase(s), trial.chain_phase(s), trial.node_phase(s),
               trial.stage_phase(s), trial.terminal_phase(s), gather),
        report=report.report_phases(s),
        plant=(plant.plant_phase(s),))
