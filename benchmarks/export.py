# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The exported controller against Python's, on every processor that can be had here.

    python benchmarks/export.py --output docs/results/export.json

Closed loops of half turns, random states, tumbling, rates beyond the limits, disturbances and new
targets, on the shipped controller with its horizon and with one of which many of these states are
outside D_N; status and torque against Python's. Code, stack and memory for horizons of 10, 20 and
40 on a Cortex-M7, and the instructions of a call there, as QEMU counts them. With --target, what
the file has of others stays. --capability NAME compares what a problem may have besides, in loops
of 200 steps on the host's gcc, and their sizes on a Cortex-M7.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test'))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'export'))

from campaign_of_states import loops
from targets import STATUSES, TARGETS, Target, answers, built, stack_bytes

from manifold_mpc_ros import AttitudeMpc, AttitudeMpcConfig, Cone, WheelArray
from manifold_mpc_ros.cli.arguments import controller_config_path
from manifold_mpc_ros.lab.export.bounds import bounds
from manifold_mpc_ros.lab.export.sources import exported, memory_doubles
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.stages.inequalities import structure_of

HORIZONS = (10, 20, 40)
TICKS, LONG_TICKS = 25, 200
# What two solves of states that differ in their last bits may differ by, each converged.
CONVERGED_N_M = 1e-6
# What is changed of the shipped parameters, whether targets move, by what part of a step torque is
# late. One cone by itself and a group of two; the pyramid of wheels that the parameters describe.
_CONES = [Cone('sun', (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.3),
          *(Cone(name, axis, axis, 2.3, 'keep_in', 'any')
            for name, axis in (('one', (0.0, 0.0, 1.0)), ('other', (0.0, 1.0, 0.0))))]
_WHEELS = WheelArray([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]], 0.5, 4.0)
CAPABILITIES: dict[str, tuple[dict[str, Any], bool, float]] = {
    'cones': ({'cones': _CONES}, False, 0.0), 'wheels': ({'wheels': _WHEELS}, False, 0.0),
    'references': ({}, True, 0.0), 'delay': ({}, False, 0.7),
    'steps that grow': (
        {'max_rate_rad_s': 0.3, 'horizon': 12, 'horizon_s': 7.0}, False, 0.0),
    'cones, wheels and references': ({'cones': _CONES, 'wheels': _WHEELS}, True, 0.0)}


def write(folder: Path, mpc: AttitudeMpc, moving: bool = False) -> Path:
    """Export a controller into a folder."""
    folder.mkdir(parents=True)
    for name, text in exported(mpc.config, mpc.terminal, moving=moving).items():
        (folder / name).write_text(text, encoding='utf-8')
    return folder


def compared(found: Array, python: Array) -> dict[str, Any]:
    """Return what differs between a target's answers and Python's."""
    return {
        'states': len(python), 'same_bits': bool(np.array_equal(
            found[:, :11], python, equal_nan=True)),
        'other_status': int((found[:, 0] != python[:, 0]).sum()),
        'other_passes': int((found[:, 1] != python[:, 1]).sum()),
        'largest_torque_difference_n_m': float(np.abs(found[:, 8:11] - python[:, 8:]).max())}


def instructions(found: Array) -> dict[str, Any]:
    """Return how many instructions calls take, searches apart."""
    counts, searched = found[:, 11], found[:, 2] > 0.0
    return {name: {'median': float(np.median(each)), 'p99': float(np.percentile(each, 99)),
                   'largest': float(each.max()), 'calls': len(each)}
            for name, each in (('warm', counts[~searched]), ('search', counts[searched]))}


def sizes(target: Target, folder: Path) -> dict[str, int]:
    """Return code, data and deepest stack of the object file [bytes]."""
    table = subprocess.run([*target.sizes, str(folder / 'manifold_mpc.o')], check=True,
                           capture_output=True, text=True).stdout.splitlines()[1].split()
    return {'code_bytes': int(table[0]), 'data_bytes': int(table[1]) + int(table[2]),
            'stack_bytes': stack_bytes(folder)}


def capability(name: str, count: int, shipped: AttitudeMpcConfig, folder: Path) -> dict[str, Any]:
    """Return how the host's gcc answers so many states, and the sizes on a Cortex-M7."""
    change, moving, late = CAPABILITIES[name]
    config = replace(shipped, **change)
    mpc = AttitudeMpc(config, disturbed=True, moving=moving)
    sources = write(folder / 'c', mpc, moving)
    states, python = loops(mpc, -(-count // LONG_TICKS), LONG_TICKS, name, moving=moving,
                           late_s=late * config.step_s)
    row = compared(answers(TARGETS['gcc'], built(TARGETS['gcc'], sources, folder), states, 7200.0),
                   python)
    row['statuses'] = {str(each): int((python[:, 0] == i).sum())
                       for i, each in enumerate(STATUSES)}
    if not TARGETS['cortex-m7'].missing:
        built(TARGETS['cortex-m7'], sources, folder)
        row['cortex_m7'] = {**sizes(TARGETS['cortex-m7'], folder), 'memory_bytes': 8 * (
            memory_doubles(config, structure_of(config, disturbed=True, moving=moving)))}
    return row


def main() -> int:
    """Run, write; 1 where a target answers otherwise."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n', 1)[0])
    parser.add_argument('--output', type=Path, required=True, metavar='FILE')
    parser.add_argument('--states', type=int, default=10000, metavar='N')
    parser.add_argument('--cortex-m7-states', type=int, default=10000, metavar='N',
                        help='the first N of these: the emulated processor is slow')
    parser.add_argument('--target', choices=TARGETS, action='append', help='this one alone')
    parser.add_argument('--capability', choices=CAPABILITIES, action='append', default=[],
                        help='compare this instead')
    arguments = parser.parse_args()
    shipped = AttitudeMpcConfig.from_yaml(controller_config_path(None))
    report: dict[str, Any] = {}
    if arguments.output.exists():
        report = json.loads(arguments.output.read_text(encoding='utf-8'))
    if not (arguments.target or arguments.capability):
        report = {'targets': {}, 'cortex_m7': {},
                  **{key: each for key, each in report.items() if key == 'capabilities'}}
    for name in arguments.capability:
        with tempfile.TemporaryDirectory() as place:
            row = capability(name, arguments.states, shipped, Path(place))
        print(f'{name}: {row}', flush=True)
        report.setdefault('capabilities', {})[name] = row
        arguments.output.write_text(json.dumps(report, indent=2) + '\n', encoding='utf-8')
    if arguments.capability:
        rows = [(name, report['capabilities'][name]) for name in arguments.capability]
        return int(any(row['other_status'] > 0 or not row['largest_torque_difference_n_m'] < (
            CONVERGED_N_M if CAPABILITIES[name][2] else 1e-9) for name, row in rows))
    with tempfile.TemporaryDirectory() as name:
        folder, right = Path(name), True
        for horizon in HORIZONS:
            config = replace(shipped, horizon=horizon)
            mpc = AttitudeMpc(config, disturbed=True)
            sources = write(folder / str(horizon), mpc)
            count = arguments.states // len(HORIZONS) // TICKS + 1
            states, python = loops(mpc, count, TICKS, f'export {horizon}')
            structure = structure_of(config, disturbed=True)
            report.setdefault(f'states of N = {horizon}', {
                str(each): int((python[:, 0] == i).sum()) for i, each in enumerate(STATUSES)})
            for key, target in TARGETS.items():
                if key not in (arguments.target or TARGETS):
                    continue
                if target.missing:
                    print(f'{key}: {target.missing}')
                    continue
                here = folder / f'{key} {horizon}'
                here.mkdir()
                few = len(states) if key != 'cortex-m7' else min(
                    len(states), arguments.cortex_m7_states // len(HORIZONS))
                found = answers(target, built(target, sources, here), states[:few], 7200.0)
                row = compared(found, python[:few])
                report['targets'].setdefault(key, {})[f'N = {horizon}'] = row
                right &= row['other_status'] == 0 and row['largest_torque_difference_n_m'] < 1e-9
                print(f'{key}, N = {horizon}: {row}', flush=True)
                if key == 'cortex-m7':
                    report['cortex_m7'][f'N = {horizon}'] = {
                        **sizes(target, here),
                        'memory_bytes': 8 * memory_doubles(config, structure),
                        'instructions': instructions(found),
                        'bound_statements': bounds(structure, config)._asdict()}
            arguments.output.write_text(json.dumps(report, indent=2) + '\n', encoding='utf-8')
    return int(not right)


if __name__ == '__main__':
    sys.exit(main())
