# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verbs of ``manifold-mpc``; a table, so that ``--help`` imports none of them."""

from __future__ import annotations

from typing import NamedTuple


class Verb(NamedTuple):
    """One verb: its module below `lab`, its line in the help, the packages of the extra `lab`.

    The module has EXAMPLES, `add_arguments` and `run`, and is imported when its verb is given.
    A verb asks for packages of other extras itself, as what it needs depends on its arguments.
    """

    module: str
    summary: str
    packages: tuple[str, ...]


VERBS = {
    'demo': Verb(
        'demo.verb',
        'Close the loop over DDS: controller and simulator as two processes, live.',
        ('matplotlib', 'plotly', 'rich', 'rosbags')),
    'simulate': Verb(
        'demo.verb_simulate',
        'Run the closed loop offline and draw it.',
        ('matplotlib', 'rich')),
    'design': Verb(
        'domain.verb_design',
        'Print the terminal set, how it was checked and the smallest horizon of a controller.',
        ('rich',)),
    'tune': Verb(
        'tune.verb',
        'From inertia and limits to a controller file, checked by closed loops.',
        ('matplotlib', 'rich')),
    'export': Verb(
        'export.verb',
        'Write the whole controller as plain C99, for flight computers.',
        ('rich',)),
    'certify': Verb(
        'certification.verb_certify',
        'Prove the conditions of the terminal set on all of it and write a certificate.',
        ('flint', 'rich')),
    'verify': Verb(
        'certification.verb_verify',
        'Re-check a certificate of a terminal set; its stored verdicts are not believed.',
        ('flint', 'rich')),
    'domain': Verb(
        'domain.verb',
        'Sample the domain of attraction D_N: the smallest horizon of every attitude, a picture.',
        ('matplotlib', 'rich')),
    'discontinuity': Verb(
        'discontinuity.verb',
        'Show where the control law jumps, how far, and why no continuous law can replace it.',
        ('matplotlib', 'rich')),
    'campaign': Verb(
        'campaign.verb',
        'Run thousands of closed loops drawn from a file; succeed when each keeps its limits.',
        ('matplotlib', 'rich')),
    'record': Verb(
        'recording.verb_record',
        'Run a scenario over DDS and record every topic into a rosbag2 bag.',
        ('rich', 'rosbags')),
    'replay': Verb(
        'recording.verb_replay',
        'Give recorded states to a live controller over DDS and compare its torques.',
        ('rich', 'rosbags')),
    'check': Verb(
        'recording.verb_check',
        'Judge recorded runs by the acceptance limits inside their bags.',
        ('rich', 'rosbags')),
    'report': Verb(
        'report.verb',
        'Write recorded runs as one interactive HTML page, and as PNG pictures.',
        ('matplotlib', 'plotly', 'rich', 'rosbags')),
    'chaos': Verb(
        'fault_injection.verb',
        'Inject faults between and into both nodes over DDS, and count what they survive.',
        ('rich',)),
    'bench': Verb(
        'benchmark.verb',
        'Compare the solver with acados, fatrop, IPOPT and others, side by side on one core.',
        ('matplotlib', 'rich')),
    'figures': Verb(
        'discontinuity.verb_figures',
        "Reproduce the four figures of the paper's simulation, as pictures and as data.",
        ('matplotlib', 'rich')),
}
