# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Run the tests as other processors would, and on a busy machine; write docs/results.

python benchmarks/processors.py [--settings NAME ...] [--workers N] [--list] [-- PYTEST_ARG ...]

Each setting is one run of pytest (of all tests, or of those that are named) in an environment that
selects other kernels of OpenBLAS, numpy, the C library or the compiled solver, or that keeps both
processors busy. A setting that this processor cannot run is named with the reason. One that fails
does not keep the others from running. Entries of docs/results/processors.json are replaced by
name, after each setting. Exit status 0 when every test passed in every setting that could run.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from manifold_mpc_ros.cli import provenance

TOP = Path(__file__).parents[1]
RESULTS = TOP / 'docs' / 'results' / 'processors.json'
KERNELS = Path(__file__).with_name('other_kernels.c')
BUILD = ('cc', '-std=gnu11', '-O2', '-ffp-contract=off', '-fno-builtin', '-fPIC', '-shared')
#: Of one test; a hung one, since no test should take a tenth of it where nothing else runs [s].
TIMEOUT_S = 900
NO_AVX = ('AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V4 '
          'AVX2 FMA3 X86_V3')
NO_FMA = 'glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable'
#: Prints what OpenBLAS and numpy chose, and multiplies once, which a missing instruction ends.
CHOSEN = """
import ctypes, json, pathlib, numpy
numpy.linalg.solve(numpy.eye(40) + 1.0, numpy.ones((40, 40)) @ numpy.ones(40))
core = 'another BLAS'
for path in pathlib.Path(numpy.__file__).parents[1].glob('numpy.libs/libscipy_openblas64_*'):
    name = ctypes.CDLL(str(path)).scipy_openblas_get_corename64_
    name.restype = ctypes.c_char_p
    core = name().decode()
simd = numpy.show_config('dicts')['SIMD Extensions']
print(json.dumps({'openblas_core': core, 'numpy_simd': simd['baseline'] + simd.get('found', [])}))
"""


@dataclass(frozen=True)
class Setting:
    """An environment to run the tests in, beside so many busy loops."""

    says: str
    environment: dict[str, str] = field(default_factory=dict)
    other_kernels: bool = False
    busy_loops: int = 0


SETTINGS = {
    'plain': Setting('as this machine is'),
    **{core.lower(): Setting(f'kernels of OpenBLAS for {core}', {'OPENBLAS_CORETYPE': core})
       for core in ('Haswell', 'SkylakeX', 'Zen', 'Prescott')},
    'no_avx': Setting('numpy without AVX-512, AVX2 and FMA', {'NPY_DISABLE_CPU_FEATURES': NO_AVX}),
    'no_fma': Setting('C library without AVX2 and FMA', {'GLIBC_TUNABLES': NO_FMA}),
    'two_lanes': Setting('compiled solver with two lanes', {'CC': 'cc -mno-avx'}),
    'oldest': Setting('all four of these together', {
        'OPENBLAS_CORETYPE': 'Prescott', 'NPY_DISABLE_CPU_FEATURES': NO_AVX,
        'GLIBC_TUNABLES': NO_FMA, 'CC': 'cc -mno-avx'}),
    'other_kernels': Setting('sums in another order, functions rounded otherwise (in place of '
                             'AVX-512: other_kernels.c)', other_kernels=True),
    **{f'busy_{core.lower()}': Setting(f'beside two busy loops, kernels of OpenBLAS for {core}',
                                       {'OPENBLAS_CORETYPE': core}, busy_loops=2)
       for core in ('Haswell', 'Zen')},
    'busy_no_avx': Setting(
        'beside two busy loops, kernels of OpenBLAS for Prescott, numpy without AVX-512, AVX2 and '
        'FMA', {'OPENBLAS_CORETYPE': 'Prescott', 'NPY_DISABLE_CPU_FEATURES': NO_AVX},
        busy_loops=2),
}


@contextmanager
def busy(loops: int) -> Iterator[None]:
    """Keep so many processors busy."""
    started = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(loops)]
    try:
        yield
    finally:
        for process in started:
            process.kill()
            process.wait()


def study(setting: Setting, arguments: Sequence[str], workers: int, folder: Path
          ) -> dict[str, Any]:
    """Run the tests in one setting; return what it was and what became of them."""
    environment = {name: value for name, value in os.environ.items()
                   if name != 'MANIFOLD_MPC_CACHE'} | setting.environment
    if setting.other_kernels:
        library = folder / 'other_kernels.so'
        subprocess.run([*BUILD, str(KERNELS), '-o', str(library), '-lm', '-ldl'], check=True)
        environment['LD_PRELOAD'] = str(library)
    row: dict[str, Any] = {
        'setting': setting.says, 'environment': setting.environment,
        'busy_loops': setting.busy_loops, 'tests': list(arguments) or 'all'}
    chosen = subprocess.run([sys.executable, '-c', CHOSEN], env=environment, text=True,
                            capture_output=True, check=False)
    if chosen.returncode != 0:
        return {**row, 'cannot_run': ending(chosen.returncode)}
    row |= json.loads(chosen.stdout)
    with busy(setting.busy_loops):
        return {**row, 'run': pytest(arguments, workers, environment, folder / 'report.xml')}


def pytest(arguments: Sequence[str], workers: int, environment: dict[str, str], report: Path
           ) -> dict[str, Any]:
    """Run pytest once; return when, beside what load, its counts, and what did not pass."""
    begun, begun_s = datetime.now(timezone.utc), time.monotonic()
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', f'--timeout={TIMEOUT_S}', f'--junitxml={report}',
         '-n', str(workers), '--dist', 'loadfile', *arguments], cwd=TOP, env=environment,
        check=False)
    row = {'begun': begun.isoformat(timespec='seconds'),
           'elapsed_s': round(time.monotonic() - begun_s),
           'load_last_15_min': round(os.getloadavg()[2], 1), 'ended': ending(done.returncode)}
    if not report.is_file():
        return {**row, 'passed': 0, 'failed': 0, 'skipped': 0, 'not_passed': []}
    cases = list(ET.parse(report).iter('testcase'))
    failed = [case for case in cases
              if case.find('failure') is not None or case.find('error') is not None]
    skipped = sum(case.find('skipped') is not None for case in cases)
    return {**row, 'passed': len(cases) - len(failed) - skipped, 'failed': len(failed),
            'skipped': skipped,
            'not_passed': [f'{case.get("classname")}::{case.get("name")}' for case in failed]}


def ending(status: int) -> str:
    """Say how a process ended."""
    return f'signal {signal.Signals(-status).name}' if status < 0 else f'exit status {status}'


def keep(name: str, row: dict[str, Any]) -> None:
    """Put one row into the file of results, in the place of an older one."""
    rows = json.loads(RESULTS.read_text(encoding='utf-8')) if RESULTS.is_file() else {}
    rows[name] = {**row, 'versions': provenance.versions('')}
    ordered = {known: rows[known] for known in SETTINGS if known in rows}
    RESULTS.write_text(json.dumps(ordered, indent=1) + '\n', encoding='utf-8')


def show(rows: dict[str, dict[str, Any]]) -> None:
    """Print one line for each run."""
    print(f'\n{"setting":14} {"OpenBLAS":12} {"numpy":16} {"passed":>7} {"failed":>7} '
          f'{"skipped":>8} {"s":>6} {"load":>5}')
    for name, row in rows.items():
        if 'cannot_run' in row:
            print(f'{name:14} cannot run here: {row["cannot_run"]}')
            continue
        run = row['run']
        print(f'{name:14} {row["openblas_core"]:12} {" ".join(row["numpy_simd"]):16} '
              f'{run["passed"]:7} {run["failed"]:7} {run["skipped"]:8} '
              f'{run["elapsed_s"]:6} {run["load_last_15_min"]:5} '
              f'{"" if passed(row) else run["ended"]}')
        for case in run['not_passed']:
            print(f'    {case}')


def passed(row: dict[str, Any]) -> bool:
    """Whether every test of a setting passed, if it could run."""
    return 'run' not in row or bool(row['run']['ended'] == 'exit status 0')


if __name__ == '__main__':
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--settings', nargs='+', choices=SETTINGS, default=list(SETTINGS),
                        metavar='NAME', help=f'some of {", ".join(SETTINGS)} (default: all)')
    parser.add_argument('--workers', type=int, default=1, help='processes of tests (default: 1)')
    parser.add_argument('--list', action='store_true', help='print the settings and end')
    parser.add_argument('pytest', nargs='*', help='arguments of pytest (default: all tests)')
    given = parser.parse_args()
    if given.list:
        for name, setting in SETTINGS.items():
            print(f'{name:14} {setting.says}')
        sys.exit(0)
    found: dict[str, dict[str, Any]] = {}
    for name in given.settings:
        print(f'\n=== {name}: {SETTINGS[name].says}', flush=True)
        with tempfile.TemporaryDirectory(prefix='processors-') as made:
            found[name] = study(SETTINGS[name], given.pytest, given.workers, Path(made))
        keep(name, found[name])
    show(found)
    sys.exit(0 if all(map(passed, found.values())) else 1)
