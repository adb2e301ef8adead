# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The verb ``record``: run a scenario with real processes over DDS, everything into a bag."""

from __future__ import annotations

import argparse
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from manifold_mpc_ros.cli import arguments as shared
from manifold_mpc_ros.cli.extras import require
from manifold_mpc_ros.cli.processes import (
    Interrupts,
    NodeProcesses,
    chosen_domain,
    node_environment,
    stay_private,
)
from manifold_mpc_ros.errors import BagError, ConfigurationError, ManifoldMpcError
from manifold_mpc_ros.lab.recording.record_plan import RecordPlan
from manifold_mpc_ros.lab.recording.scenarios.scenario import Scenario

if TYPE_CHECKING:
    from rich.console import Console

    from manifold_mpc_ros.lab.recording.bags.writer import BagWriter
    from manifold_mpc_ros.lab.recording.nodes.bag_recorder import BagRecorder
    from manifold_mpc_ros.lab.recording.nodes.raw import StampReader
    from manifold_mpc_ros.lab.recording.nodes.run_inputs import RunInputs

EXAMPLES = """\
  manifold-mpc record rest_to_rest_90
      a shipped scenario; the bag is results/bags/rest_to_rest_90
  manifold-mpc record my_slew.yaml -o bags/my_slew --storage sqlite3
      a scenario of your own; docs/scenarios.md says what it may hold
  manifold-mpc record --list
      the shipped scenarios"""
DEFAULT_FOLDER = Path('results/bags')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this verb."""
    parser.add_argument(
        'scenario', nargs='?', metavar='SCENARIO',
        help='a scenario file, or the name of a shipped one')
    parser.add_argument('--list', action='store_true', help='list the shipped scenarios')
    parser.add_argument(
        '-o', '--output', type=Path, metavar='BAG',
        help=f'folder of the bag (default: {DEFAULT_FOLDER}/NAME)')
    parser.add_argument(
        '--storage', choices=('mcap', 'sqlite3'), default='mcap',
        help='storage of the bag (default: %(default)s)')
    parser.add_argument(
        '--compress', action='store_true', help='compress the chunks of MCAP with zstd')
    parser.add_argument(
        '--overwrite', action='store_true', help='replace a bag that is there already')
    parser.add_argument(
        '--start-limit', type=shared.positive_number, default=120.0, metavar='S',
        help='wall clock until the run begins: discovery, and building the solver '
             '(default: %(default)s)')


def run(arguments: argparse.Namespace) -> int:
    """Record; 0 when the run came to its end and nothing of it was lost."""
    from manifold_mpc_ros.cli import console as report
    console = report.make_console()
    if arguments.list:
        return _list(console)
    if arguments.compress and arguments.storage != 'mcap':
        raise ConfigurationError('--compress', arguments.storage, '--storage mcap')
    scenario = find_scenario(arguments.scenario)
    path = arguments.output or DEFAULT_FOLDER / scenario.name
    require('record', 'rclpy')
    _make_way(path, overwrite=arguments.overwrite)
    stay_private(os.environ)  # the recorder is in this process
    console.print(f'{scenario.name}: {scenario.description}', markup=False)
    try:
        lost = _record(scenario, path, arguments, console)
    except (ManifoldMpcError, KeyboardInterrupt) as error:
        if (path / 'metadata.yaml').is_file():
            console.print(f'What was recorded until then is in {path}', soft_wrap=True,
                          markup=False)
        elif path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        raise error
    report.say_written(console, [path])
    for topic, count in lost.items():
        console.print(f'{count} messages of {topic} were published and not received')
    return 1 if lost else 0


def find_scenario(given: str | None) -> Scenario:
    """Return the scenario of a file, or a shipped one by its name."""
    if given is None:
        raise ConfigurationError('SCENARIO', None, 'a file or the name of a shipped scenario; '
                                 'manifold-mpc record --list names them')
    if Path(given).is_file() or given.endswith(('.yaml', '.yml')):
        return Scenario.from_yaml(given)
    shipped = {path.stem: path for path in shipped_scenarios()}
    if given not in shipped:
        raise ConfigurationError(
            'SCENARIO', given, 'a file that exists, or one of ' + ', '.join(sorted(shipped)))
    return Scenario.from_yaml(shipped[given])


def shipped_scenarios() -> list[Path]:
    """Return the files of the shipped scenarios."""
    return sorted((shared.shipped_config('controller.yaml').parent / 'scenarios').glob('*.yaml'))


def _list(console: Console) -> int:
    """Print names and descriptions of the shipped scenarios."""
    from manifold_mpc_ros.cli import console as report
    console.print(report.result_table('Shipped scenarios', [
        (path.stem, Scenario.from_yaml(path).description) for path in shipped_scenarios()]))
    return 0


def _record(
    scenario: Scenario, path: Path, arguments: argparse.Namespace, console: Console,
) -> dict[str, int]:
    """Record into a new bag, which is closed whatever happens; messages lost, by topic."""
    from manifold_mpc_ros.cli.progress import Progress
    from manifold_mpc_ros.lab.recording.bags.writer import BagWriter
    from manifold_mpc_ros.lab.recording.nodes.bag_recorder import BagRecorder
    from manifold_mpc_ros.lab.recording.nodes.raw import stamp_reader
    from manifold_mpc_ros.lab.recording.recorder import Recording
    plan = RecordPlan(scenario)
    readers = {topic: stamp_reader(each) for topic, each in plan.described.items()}
    with ExitStack() as stack:
        interrupts = stack.enter_context(Interrupts())
        logs = stack.enter_context(_logs())
        domain = stack.enter_context(chosen_domain())
        writer = stack.enter_context(BagWriter(
            path, arguments.storage, compress=arguments.compress))
        outcome = stack.enter_context(_outcome(writer))
        writer.require(each.message_type for each in plan.described.values())
        recorder = stack.enter_context(BagRecorder(
            domain, writer, plan.stamped, plan.others, readers,
            use_sim_time=scenario.use_sim_time))
        processes = stack.enter_context(NodeProcesses())
        inputs = _inputs(plan, recorder, readers)
        recording = Recording(plan, writer, recorder, inputs, processes, interrupts)
        duration_s = scenario.duration_s
        with Progress(console, 's simulated', duration_s, 'starting the nodes') as progress:
            recording.start(node_environment(domain), logs, arguments.start_limit)
            recording.run(lambda time_s: progress.show(min(time_s, duration_s)))
        outcome.update(outcome='complete', lost=json.dumps(recorder.lost()),
                       link_losses=json.dumps(inputs.lost),
                       unrecorded=json.dumps(recorder.unrecorded))
        return recorder.lost()


def _inputs(
    plan: RecordPlan, recorder: BagRecorder, readers: Mapping[str, StampReader],
) -> RunInputs:
    """Return what the scenario puts into the run."""
    from manifold_mpc_ros.control.guidance.laws import Guidance
    from manifold_mpc_ros.lab.recording.nodes.run_inputs import RunInputs
    scenario, controller = plan.scenario, plan.scenario.controller_config
    return RunInputs(
        recorder, scenario.setpoints,
        {link.source: (link.target, link.kind, link.fault, readers[link.source])
         for link in plan.links.values()},
        plan.state_topic, lockstep=scenario.lockstep,
        wall_clock=scenario.time_mode == 'wall', wall_per_s=1.0 / scenario.clock_factor,
        frames=(controller.inertial_frame_id, controller.body_frame_id), setpoint=plan.setpoint,
        cone_topics=plan.cone_topics,
        guidance={mode: Guidance(scenario.guidance_config(mode)) for mode in plan.modes},
        end_s=scenario.duration_s + controller.mpc.horizon * controller.mpc.step_s)


@contextmanager
def _outcome(writer: BagWriter) -> Iterator[dict[str, str]]:
    """Write how the recording ended, before the bag is closed."""
    notes = {'outcome': 'interrupted'}
    try:
        yield notes
    except ManifoldMpcError as error:
        notes['outcome'] = f'failed: {error}'
        raise
    finally:
        writer.add_outcome(notes)


@contextmanager
def _logs() -> Iterator[Path]:
    """Return a folder for what the nodes print."""
    with tempfile.TemporaryDirectory(prefix='manifold-mpc-record-') as folder:
        yield Path(folder)


def _make_way(path: Path, *, overwrite: bool) -> None:
    """Refuse a path that is taken, or remove the bag that is there."""
    from manifold_mpc_ros.lab.recording.bags.writer import remove_bag
    if not path.exists():
        return
    if not overwrite:
        raise BagError(f'{path}: exists already; --overwrite replaces it')
    remove_bag(path)
