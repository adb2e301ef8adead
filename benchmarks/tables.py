# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fill the tables of README.md and docs from the files that the commands wrote.

    python benchmarks/tables.py

Each table stands between ``<!-- table: NAME -->`` and ``<!-- end -->``; a table whose file is
not there yet says which command writes it. Pictures that the commands wrote beside their files
belong into docs/images.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import basilisk_tables
import reference_tables as moving
from program_tables import (
    calls,
    cone_problems,
    cone_times,
    cones,
    exported_capabilities,
    exported_sizes,
    exported_targets,
    fleet,
    joblib,
    light,
    lines,
    mcap,
    moving_cones,
    scenarios,
    search_tail,
    table,
)

TOP = Path(__file__).resolve().parent.parent
PAGES = (TOP / 'README.md', *(TOP / 'docs' / f'{name}.md' for name in (
    'bags', 'basilisk', 'cones', 'performance', 'chaos', 'embedding', 'install', 'libraries',
    'nodes')))
RESULTS = TOP / 'docs' / 'results'
CHAOS = 'chaos_matrix chaos_soak chaos_drills chaos_drills_shared_memory'
TABLE = re.compile(r'(<!-- table: (\S+) -->\n).*?(<!-- end -->)', re.DOTALL)


def times(data: dict[str, Any], start: str) -> str:
    """Return one row a solver, one column a horizon: solver's time, median / 99 %."""
    horizons = data['settings']['horizons']
    found = {(row['solver'], row['horizon']): row for row in data['rows']
             if row['start'] == start}
    names = dict.fromkeys(name for name, _ in found)
    return table(['solver', *(f'N = {n}' for n in horizons)], [
        [name, *(_pair(found.get((name, n))) for n in horizons)] for name in names])


def _pair(row: dict[str, Any] | None) -> str:
    """Return median and 99th percentile, with what failed."""
    if row is None:
        return '-'
    failed = f' ({row["failures"]} of {row["solves"]} failed)' if row['failures'] else ''
    median, p99 = (_three_digits(row[f'solver_us_{which}']) for which in ('median', 'p99'))
    return f'{median} / {p99}{failed}'


def _three_digits(value: float) -> str:
    """Return a number with three significant digits, without an exponent up to a million."""
    return f'{float(f"{value:.3g}"):,g}'


def summary(data: dict[str, Any]) -> str:
    """Return our times beside those of acados and IPOPT, and which plans are found."""
    rows = {(row['solver'], row['start'], row['horizon']): row for row in data['rows']}
    horizons = (10, 20, 40)
    lines = []
    for text, name, start in (
            ('ours, warm, to 1e-8', 'ours, search', 'warm'),
            ('acados SQP with HPIPM, warm, to 1e-6', 'acados SQP (HPIPM)', 'warm'),
            ('acados SQP with DAQP, warm, to 1e-6', 'acados SQP (DAQP)', 'warm'),
            ('acados, one real-time iteration, not converged', 'acados RTI, one step', 'warm'),
            ('IPOPT, warm, its functions as C', 'IPOPT', 'warm'),
            ('ours, cold, global search', 'ours, search', 'cold'),
            ('acados SQP with HPIPM, cold', 'acados SQP (HPIPM)', 'cold'),
            ('acados SQP with DAQP, cold', 'acados SQP (DAQP)', 'cold')):
        every = [row for key, row in rows.items() if key[:2] == (name, start)]
        dearer = f'{sum(row["dearer_than_best_known"] for row in every)} of ' \
                 f'{sum(row["solves"] for row in every):,}' if start == 'cold' else ''
        lines.append([text, *(_pair(rows.get((name, start, n))) for n in horizons), dearer])
    return table(['', *(f'N = {n}' for n in horizons), 'dearer than the best known plan'], lines)


def survival(*runs: dict[str, Any]) -> str:
    """Return what was injected and survived in each run of the fault injection."""
    names = ('every fault in three phases, four seeds', 'one hour at 50 Hz, a fault every 30 s',
             'each node killed 200 times', 'the same kills in shared memory')
    lines = []
    for name, file, run in zip(names, CHAOS.split(), runs):
        totals = run['totals']
        never = ('non_finite_commands', 'over_limit_commands', 'commands_beyond_one_per_tick',
                 'unhandled_exceptions')
        lines.append([
            f'[{name}](results/{file}.json)', f'{totals["faults_injected"]:,}',
            f'{totals["faults_survived"]:,}', str(totals['excused_by_the_machine']),
            str(len(run['voided'])), f'{totals["detection_s"]["median"]:.3f}',
            f'{totals["recovery_s"]["median"]:.3f}', f'{totals["commands"]:,}',
            ', '.join(str(totals[key]) for key in never)])
    return table(['run', 'injected', 'survived', 'late by the machine alone',
                  'void and repeated', 'detection, median [s]', 'recovery, median [s]',
                  'commands', 'not finite, over limit, beyond one per tick, exceptions'], lines)


def survived(*runs: dict[str, Any]) -> str:
    """Return what all runs add up to; the last one, the drills in shared memory, by itself."""
    *main, shared = (run['totals'] for run in runs)
    injected = sum(totals['faults_injected'] for totals in main)
    missed = injected - sum(totals['faults_survived'] for totals in main)
    late = shared['faults_injected'] - shared['faults_survived']
    return (f'{injected:,} injected in matrix, soak and drills, {missed} not survived. In '
            f'drills with the nodes in shared memory instead of UDP, {late} of '
            f'{shared["faults_injected"]} kills '
            f'held the controller up, for {shared["longest_gap_s"]:.2f} s at most '
            '([why](docs/safety.md#started-by-a-supervisor)).\n')


def quality(data: dict[str, Any]) -> str:
    """Return how often, and by how much at most, a plan is dearer than the best known one."""
    rows = [row for row in data['rows'] if row['start'] == 'cold']
    cells = []
    for name in dict.fromkeys(row['solver'] for row in rows):
        own = [row for row in rows if row['solver'] == name]
        turns = [row for row in own if 'half_turn_solves' in row]
        cells.append([
            name, f'{sum(row["dearer_than_best_known"] for row in own)} of '
            f'{sum(row["solves"] for row in own)}',
            f'{100 * max(row["largest_excess"] for row in own):.2g} %',
            f'{sum(row["half_turn_dearer"] for row in turns)} of '
            f'{sum(row["half_turn_solves"] for row in turns)}'])
    return table(['solver', 'dearer than the best known', 'by at most', 'exact half turns'], cells)


def aims(data: dict[str, Any]) -> str:
    """Return every aim with what was measured."""
    return table(['aim', 'N', 'measured', 'at most', 'met'], [
        [aim['aim'], str(aim.get('horizon', '')), f'{aim["value"]:.3g}', f'{aim["at_most"]:g}',
         'yes' if aim['met'] else '**no**'] for aim in data['targets']])


def behind(data: dict[str, Any]) -> str:
    """Return where another solver was faster."""
    return ''.join(f'- {line}\n' for line in data['behind']) or 'Nowhere in this run.\n'


def start_up(data: dict[str, Any]) -> str:
    """Return seconds and megabytes of fresh processes."""
    keys = ('imports_s', 'first_build_s', 'cached_build_s', 'peak_memory_mb')
    return table(['solver', 'imports [s]', 'first build [s]', 'cached [s]', 'peak memory [MB]'], [
        [row['solver'], *(f'{row[key]:.2f}' if key in row else '-' for key in keys)]
        for row in data['startup'] if 'why_not' not in row])


def limit(data: dict[str, Any]) -> str:
    """Return the bound of a pass beside a pass of ours, from the same run."""
    local = {row['horizon']: row for row in data['rows']
             if row['solver'] == 'ours, local' and row['start'] == 'cold'}
    rows = []
    for each in data['limit']:
        ours = local.get(each['horizon'])
        took = ours['solver_us_median'] / ours['iterations_median'] if ours else None
        rows.append([str(each['horizon']), f'{each["operations"]["all"]:,}',
                     f'{each["bound_us"]:.2f}', f'{took:.2f}' if took else '-',
                     f'{took / each["bound_us"]:.0f}' if took else '-'])
    return table(['N', 'operations of a pass', 'bound [us]', 'a pass of ours [us]', 'times'], rows)


def machine(data: dict[str, Any]) -> str:
    """Return what was measured on."""
    where = data['machine']
    rate = where.get('rate_gflop_s')
    fast = f', {rate:g} Gflop/s measured on core {where["core"]}' if rate else ''
    return (f'{where["processor"]}, {where["cores"]} cores{fast}; load average at the end '
            f'{where["load_average"][0]:g}.\n')


def _with_picture(text: str, name: str) -> str:
    """Return a text with the picture that belongs to it below."""
    return f'{text}\n![The figures of {name}.json](images/{name}.png)\n'


def ticks(data: dict[str, Any]) -> str:
    """Return latencies over DDS, 50 / 99 / 99.9 %."""
    def three(row: dict[str, Any], key: str) -> str:
        """Return the percentiles of a figure, a dash where there is none."""
        return ' / '.join(f'{row[key][p]:.0f}' for p in ('p50', 'p99', 'p99.9')
                          ) if key in row else '-'
    return table(
        ['way', 'Hz', 'state received to torque published [us]', 'round trip [us]',
         'tick late [us]', 'tick [us]', 'solve [us]', 'ticks', 'late at the probe',
         'missed by the controller'],
        [[row['mode'], f'{row["rate_hz"]:g}', three(row, 'reported_answer_time_us'),
          three(row, 'latency_us'),
          three(row, 'reported_tick_lateness_us'), three(row, 'reported_tick_time_us'),
          three(row, 'reported_solve_time_us'), str(row['ticks']), str(row['missed']),
          f'{row["reported_missed_ticks"]:g}' if 'reported_missed_ticks' in row else '-']
         for row in data['rows']])


def loops(data: dict[str, Any]) -> str:
    """Return how long many loops took, and how they ended."""
    row = data['row']
    return (f'{row["loops"]:,} loops of {row["ticks"]} steps, N = {row["horizon"]}, on '
            f'{row["threads"]} threads: {row["elapsed_s"]:.1f} s, '
            f'{row["solves_per_s"]:,.0f} solves a second, {row["searches"]:,} searches.\n\n'
            + table(['aim', 'measured', 'at most', 'met'], [
                [aim['aim'], f'{aim["value"]:.3g}', f'{aim["at_most"]:g}',
                 'yes' if aim['met'] else '**no**'] for aim in data['targets']]))


def counts(data: dict[str, Any]) -> str:
    """Return instructions per solve."""
    return table(['solver', 'N', 'cold', 'warm steps after each', 'instructions per solve'], [
        [row['solver'], str(row['horizon']), str(row['cold']), str(row['warm_steps']),
         f'{row["instructions_per_solve"]:,}'] for row in data['rows']])


TABLES: dict[str, tuple[str, Callable[..., str]]] = {
    'summary': ('bench', summary),
    'survival': (CHAOS, survival),
    'survived': (CHAOS, survived),
    'batch-summary': ('batch', lambda data: loops(data).partition('\n')[0] + '\n'),
    'machine': ('bench', lambda data: _with_picture(machine(data), 'bench')),
    'aims': ('bench', aims), 'behind': ('bench', behind),
    'cold': ('bench', lambda data: times(data, 'cold')),
    'warm': ('bench', lambda data: times(data, 'warm')),
    'quality': ('bench', quality), 'start-up': ('bench', start_up), 'limit': ('bench', limit),
    'ticks': ('tick', lambda data: _with_picture(ticks(data), 'tick')),
    'tick-machine': ('tick', machine),
    'instructions': ('instructions', counts),
    'batch': ('batch', loops), 'light': ('light', light), 'lines': ('lines', lines),
    'fleet': ('fleet', fleet),
    'cones': ('constrained', lambda data: _with_picture(cones(data), 'constrained')),
    'cone-times': ('constrained', cone_times), 'cone-problems': ('cone_problems', cone_problems),
    'moving-cones': ('moving_cones', moving_cones),
    'calls': ('calls', calls), 'search-tail': ('search_tail', search_tail),
    'export-targets': ('export', exported_targets), 'export-sizes': ('export', exported_sizes),
    'export-capabilities': ('export', exported_capabilities),
    'targets': ('references', lambda data: _with_picture(moving.targets(data), 'references')),
    'delays': ('references', moving.delays), 'noise': ('references', moving.noise),
    'disturbances': ('references', moving.disturbances),
    'random-targets': ('references', moving.random_targets),
    'moving-cost': ('moving_cost', moving.cost),
    'basilisk-slews': ('basilisk', basilisk_tables.slews),
    'basilisk-pointing': ('basilisk', basilisk_tables.pointing),
    'basilisk-tuning': ('basilisk', basilisk_tables.tuning),
    'scenarios': ('scenarios', scenarios),
    'mcap': ('libraries', mcap), 'joblib': ('libraries', joblib),
}
COMMANDS = {'bench': 'make bench', 'tick': 'manifold-mpc bench --tick',
            'instructions': 'manifold-mpc bench --instructions',
            'batch': 'manifold-mpc bench --batch', 'light': 'python benchmarks/light.py',
            'libraries': 'python benchmarks/libraries.py', 'fleet': 'python benchmarks/fleet.py',
            'constrained': 'manifold-mpc bench --constrained',
            'cone': 'python benchmarks/cone_problems.py', 'lines': 'python benchmarks/lines.py',
            'calls': 'python benchmarks/calls.py', 'export': 'python benchmarks/export.py',
            'references': 'python benchmarks/references.py',
            'moving': 'python benchmarks/moving_cost.py', 'basilisk': 'make basilisk',
            'chaos': 'manifold-mpc chaos', 'scenarios': 'python benchmarks/scenarios.py'}


def filled(page: str) -> str:
    """Return the page with every table from its file."""
    def fill(match: re.Match[str]) -> str:
        """Return a table with its marks."""
        names, make = TABLES[match[2]]
        paths = [RESULTS / f'{name}.json' for name in names.split()]
        missing = [path for path in paths if not path.exists()]
        if missing:
            command = COMMANDS[missing[0].stem.partition('_')[0]]
            return f'{match[1]}Not measured yet: `{command}` writes {missing[0].name}.\n{match[3]}'
        data = [json.loads(path.read_text(encoding='utf-8')) for path in paths]
        return f'{match[1]}{make(*data)}{match[3]}'
    return TABLE.sub(fill, page)


if __name__ == '__main__':
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding='utf-8')), encoding='utf-8')
