# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tables of what the programs in this folder measured; `tables.py` fills them in."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in markdown."""
    lines = [header, ['---'] * len(header), *rows]
    return ''.join(f'| {" | ".join(line)} |\n' for line in lines)


def light(data: dict[str, Any]) -> str:
    """Return how long a start takes, and what an installation brings."""
    return table(['start of', 'wall time, median [s]', 'processor time, median [s]'], [
        [f'`{name}`', f'{took["median_s"]:.2f}', f'{took["median_processor_s"]:.2f}']
        for name, took in data['seconds'].items()]) + '\n' + table(
        ['installed', 'distributions', 'MB'],
        [[name, str(what['distributions']), f'{what["megabytes"]:.0f}']
         for name, what in data['installed'].items()])


def lines(data: dict[str, Any]) -> str:
    """Return how many lines each part has, now and at earlier commits."""
    return table(['', 'modules', 'lines', 'of them docstrings', 'code'], [
        [part if when == 'now' else f'{part}, at {when}',
         *(f'{kinds[kind]:,}' for kind in ('files', 'lines', 'docstrings', 'code'))]
        for when, parts in data.items() for part, kinds in parts.items() if ':' not in part])


def fleet(data: dict[str, Any]) -> str:
    """Return what became of several spacecraft, and what they cost."""
    return table(
        ['time', 'spacecraft', 'settled', 'after [s]', 'ticks missed', 'processor, all [% of one '
         'core]', 'controller / simulator [%]', 'memory, all [MB]', 'controller / simulator [MB]'],
        [[row['time'], str(row['spacecraft']), str(row['settled']),
          f'{row["settled_after_s"]:.0f}', f'{row["missed_ticks"]} of {row["ticks"]}',
          f'{row["processor_percent_all"]:.0f}', '{controller} / {simulator}'.format(
              **row['processor_percent']), str(row['memory_mb_all']),
          '{controller} / {simulator}'.format(**row['memory_mb'])] for row in data['rows']])


def mcap(data: dict[str, Any]) -> str:
    """Return what is read of whole and damaged files, and what a killed writer leaves."""
    own = data['mcap']
    rows = []
    for what in ('whole', 'cut in the middle', 'a bit flipped at a fifth'):
        rows.append([what, *(f'{found["read"]:,} in {found["seconds"]:.2f} s' + (
            f', then {found["ended_by"]}' if found['ended_by'] else '')
            for found in own[what].values())])
    written = ', '.join(f'{name} {own["write_us_per_message"][name]:.0f} us a message, {left:,} '
                        f'of {own["messages"] // 2:,} left by a kill'
                        for name, left in own['after_kill'].items())
    return table(['file', *own['whole']], rows) + (
        f'\nWritten: {written}. `mcap` and zstandard would add {own["megabytes_more"]:g} MB; of '
        f'own code the scan has {own["own_lines"]["scan"]} lines, the storage '
        f'{own["own_lines"]["storage"]}.\n')


def joblib(data: dict[str, Any]) -> str:
    """Return both pools."""
    own = data['joblib']
    return table(['', f'{own["jobs"]:,} empty jobs on two processes [s]',
                  'results before a worker died', 'raised', 'alive 2 s after a killed parent'], [
        [name, f'{own[name]["seconds"]:.1f}', str(own[name]['results_before_a_death']),
         own[name]['raised'], str(own[name]['alive_after_the_parent'])]
        for name in ('own workers', 'joblib')])


def cones(data: dict[str, Any]) -> str:
    """Return the public slews: ours, the bound, others', what was kept."""
    rows = []
    for row in data['rows']:
        runs = row['runs']
        settled = [run['settled_s'] for run in runs if run['settled_s'] is not None]
        margins = [value for run in runs for value in run['least_margin_deg'].values()]
        largest = [max(run.get(f'largest_{key}', 0.0) for run in runs)
                   for key in ('energy', 'rate', 'motor')]
        rows.append([
            row['problem'], str(len(runs)),
            f'{min(settled):.4g} to {max(settled):.4g}' if settled else 'never',
            '-' if row['bound_s'] is None else f'{row["bound_s"]:.1f}',
            '-' if row['bound_s'] is None or not settled else
            f'{100 * (max(settled) / row["bound_s"] - 1):.1f}',
            ', '.join(f'{each:,g}' for each in row['others_s']) or '-',
            f'{min(margins):.2f}' if margins else '-',
            *(f'{100 * value:.1f}' if value else '-' for value in largest)])
    return table(['problem', 'frames', 'settled after [s]', 'time-optimal bound [s]',
                  'above it, worst [%]', 'published, others [s]', 'least angle to a cone [deg]',
                  'largest energy [%]', 'largest rate [%]', 'largest motor torque [%]'], rows)


def cone_times(data: dict[str, Any]) -> str:
    """Return the solve times on the public slews, with what two cones cost."""
    text = ''
    for each in data['timing']:
        rows = [[row['solver'], *([row['why_not']] + ['-'] * 4 if 'why_not' in row else [
            *(f'{row[key]:.3g}' for key in ('first_ms', 'warm_ms_median', 'warm_ms_p99')),
            f'{row["passes_median"]:g}', f'{row["failures"]} of {row["solves"] + 1}'])]
            for row in each['rows']]
        cost = each['cones_cost']
        text += table([f'{each["problem"]}, N = {each["horizon"]}', 'first [ms]',
                       'warm, median [ms]', 'warm, 99 % [ms]', 'passes', 'failed'], rows) + (
            f'\nWarm solves of a loop with the two cones take {cost["sum"]:.2f} times those of '
            f'the loop without (median {cost["median"]:.2f}).\n\n')
    return text.removesuffix('\n')


def cone_problems(data: dict[str, Any]) -> str:
    """Return what became of random problems with cones, without and with a group of sensors."""
    columns = [_problems(data), *([_problems(data['groups'])] if 'groups' in data else [])]
    names = ['', 'cones', 'and one of 2 to 4 Sun sensors that sees the Sun'][:1 + len(columns)]
    return table(names, [[key, *(each[key] for each in columns)] for key in columns[0]])


def _problems(data: dict[str, Any]) -> dict[str, str]:
    """Return a column: what became of such problems, and which plans are dearer."""
    starts = ', '.join(f'{count:,} from {n}' for n, count in data['starts_of_ipopt'].items())
    loops, search = data['loops'], data['search_cpu_ms']
    dearer = '; '.join(f'problem {row["problem"]} ({row["cones"]} cones) by '
                       f'{100 * row["excess"]:.2g} %' for row in data['dearer'])
    return {
        'problems that IPOPT was asked, from so many starts each': starts,
        'solved by IPOPT, and of those not by us':
            f'{data["solved_by_ipopt"]:,}, ' + ': '.join(filter(None, [
                str(len(data['not_solved_but_by_ipopt'])),
                ', '.join(f'problem {each}' for each in data['not_solved_but_by_ipopt'])])),
        'ours dearer than the best of IPOPT by more than 1e-6':
            ': '.join(filter(None, [str(len(data['dearer'])), dearer])),
        "IPOPT's best dearer than ours": str(data['ipopt_dearer']),
        'least angle to a cone under a plan, integrated 50 times finer [deg]':
            f'{data["least_angle_to_a_cone_deg"]:.2f}',
        'first search, processor time, median / 99 % [ms]':
            f'{search["median"]:.0f} / {search["p99"]:.0f}',
        'loops closed, settled, feasible at every tick':
            f'{loops["count"]}, {loops["settled"]}, {loops["feasible_at_every_tick"]}',
        'largest rise of the value above the bound V - L, relative':
            f'{loops["largest_rise_above_promise"]:.1e}'}


def moving_cones(data: dict[str, Any]) -> str:
    """Return the least angles to a Sun that passes through the target."""
    return table(['torque limit [N m]', 'Sun [deg/s]', 'a message every', 'followed [deg]',
                  'taken for fixed [deg]'],
                 [[f'{row["max_torque_n_m"]:g}', f'{row["sun_deg_s"]:g}',
                   f'{row["message_s"]:g} s', *(f'{row[key]["least_angle_deg"]:.2f}'
                                                for key in ('followed', 'taken_for_fixed'))]
                  for row in data['rows']])



def scenarios(data: dict[str, Any]) -> str:
    """Return what became of the shipped scenarios."""
    def said(row: dict[str, Any], limit: str) -> str:
        """Return what was measured for a limit, nothing where it has none."""
        return str(row['limits'].get(limit, {}).get('measured', ''))

    return table(['scenario', 'verdict', 'settling time (after each setpoint)', 'final error',
                  'replay'], [
        [f'`{name}`', row['verdict'], said(row, 'settle_time_s'), said(row, 'final_error_deg'),
         ('' if row['lockstep'] else 'by the stamps, ') + row['replay']]
        for name, row in data.items()])


def calls(data: dict[str, Any]) -> str:
    """Return what a call of `AttitudeMpc.solve` costs beside the solver in it."""
    return table(['N', 'start', 'call [us]', 'solver [us]', 'call over solver'], [
        [name.removeprefix('N = '), start, f'{row["call_us"]:.1f}', f'{row["solver_us"]:.1f}',
         f'{row["quotient"]:.2f}'] for name, rows in data.items() for start, row in rows.items()])


def exported_targets(data: dict[str, Any]) -> str:
    """Return how the exported controller agrees with Python's on every target."""
    rows = []
    for target, horizons in data['targets'].items():
        parts = list(horizons.values())
        rows.append([target, f'{sum(part["states"] for part in parts):,}',
                     'yes' if all(part['same_bits'] for part in parts) else 'no',
                     str(sum(part['other_status'] for part in parts)),
                     f'{max(part["largest_torque_difference_n_m"] for part in parts):.1e}'])
    return table(['target', 'states', 'same bits', 'other status', 'torque differs by [N m]'],
                 rows)


def exported_capabilities(data: dict[str, Any]) -> str:
    """Return how it agrees with what a problem may have besides, and sizes on a Cortex-M7."""
    rows = []
    for name, each in data['capabilities'].items():
        target = each['cortex_m7']
        rows.append([name, f'{each["states"]:,}', 'yes' if each['same_bits'] else 'no',
                     str(each['other_status']), f'{each["largest_torque_difference_n_m"]:.1e}',
                     *(f'{target[key] / 1024:.1f}'
                       for key in ('code_bytes', 'stack_bytes', 'memory_bytes'))])
    return table(['with', 'states', 'same bits', 'other status', 'torque differs by [N m]',
                  'code [KiB]', 'stack [KiB]', 'memory [KiB]'], rows)


def exported_sizes(data: dict[str, Any]) -> str:
    """Return sizes and instructions on a Cortex-M7."""
    rows = []
    for horizon, each in data['cortex_m7'].items():
        counts = each['instructions']
        rows.append([
            horizon.removeprefix('N = '),
            *(f'{each[key] / 1024:.1f}' for key in ('code_bytes', 'stack_bytes', 'memory_bytes')),
            *(f'{counts[kind][key] / 1e6:.2f}' for kind in ('warm', 'search')
              for key in ('median', 'p99')),
            f'{max(counts[kind]["largest"] for kind in counts) / 1e6:.0f}',
            f'{each["bound_statements"]["total"] / 1e6:,.0f}'])
    return table(['N', 'code [KiB]', 'stack [KiB]', 'memory [KiB]', 'warm: median [10^6]', 'p99',
                  'search: median [10^6]', 'p99', 'largest seen', 'statements at most [10^6]'],
                 rows)


def search_tail(data: dict[str, Any]) -> str:
    """Return how many passes searches and local solves take, by forcing and horizon."""
    rows = [[row['forcing'], str(row['horizon']), str(row['instances']),
             f'{row["passes_median"]:g}', f'{row["passes_p99"]:.0f}', str(row['passes_most']),
             str(row['dearer']), str(row['not_converged'] + row['local_not_converged']),
             str(row['local_passes_most'])] for row in data['rows']]
    return table(['forcing', 'N', 'instances', 'passes: median', '99 %', 'most', 'dearer',
                  'not converged', 'one local solve: most'], rows)
