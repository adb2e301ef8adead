# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Builds the exported controller for processors, runs it there, or on QEMU, on given states."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from manifold_mpc_ros import AttitudeMpc, AttitudeMpcSolution
from manifold_mpc_ros.control.input_gate import NANOSECONDS
from manifold_mpc_ros.control.torque_history import moved_on
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.reference import Reference
from manifold_mpc_ros.mpc.solution import SolveStatus

STATUSES = list(SolveStatus)
HERE = Path(__file__).resolve().parent
STRICT = ('-std=c99', '-pedantic', '-Wall', '-Wextra', '-Wconversion', '-Werror',
          '-ffp-contract=off', '-fno-tree-slp-vectorize')
#: What answers.c writes of a state, but for the number of instructions.
COLUMNS = ('status', 'passes', 'searched', 'cost', 'residual', 'violation', 'promised', 'ratio',
           'torque_x', 'torque_y', 'torque_z')


class Target(NamedTuple):
    """Compiler with its flags, what to link besides, what runs the program, Debian's packages."""

    compiler: tuple[str, ...]
    linked: tuple[str, ...]
    runner: tuple[str, ...]
    packages: str

    @property
    def missing(self) -> str:
        """Why it cannot be tested here, '' when it can."""
        tools = [each for each in (self.compiler[0], *self.runner[:1]) if not shutil.which(each)]
        return f'no {" nor ".join(tools)}: apt-get install {self.packages}' if tools else ''

    @property
    def sizes(self) -> tuple[str, ...]:
        """The command that prints sizes of its object files."""
        name = self.compiler[0]
        return (name.replace('-gcc', '-size') if name.endswith('-gcc') else 'size',)


_SANITIZED = ('-g', '-O1', '-fsanitize=address,undefined', '-fno-sanitize-recover=all')
_CORTEX_M7 = ('arm-none-eabi-gcc', '-O2', '-mcpu=cortex-m7', '-mthumb', '-mfpu=fpv5-d16',
              '-mfloat-abi=hard')
TARGETS = {
    'gcc': Target(('gcc', '-O2'), (), (), 'gcc'),
    'clang': Target(('clang', '-O1'), (), (), 'clang'),
    'sanitizers': Target(('gcc', *_SANITIZED), (), (), 'gcc'),
    'cortex-m7': Target(
        _CORTEX_M7, (str(HERE / 'cortex_m7.c'), '--specs=rdimon.specs',
                     '-T', str(HERE / 'cortex_m7.ld'), '-Wl,--no-warn-rwx-segments'),
        ('qemu-system-arm', '-M', 'mps2-an500', '-nographic', '-icount', 'shift=0', '-semihosting',
         '-kernel'), 'gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm'),
    'aarch64': Target(('aarch64-linux-gnu-gcc', '-O2', '-static'), (), ('qemu-aarch64',),
                      'gcc-aarch64-linux-gnu qemu-user'),
    'riscv64': Target(('riscv64-linux-gnu-gcc', '-O2', '-static'), (), ('qemu-riscv64',),
                      'gcc-riscv64-linux-gnu qemu-user'),
}


def built(target: Target, sources: Path, folder: Path) -> Path:
    """Compile exported sources with the strictest warnings; return the program."""
    counter = () if 'rdimon.specs' in ' '.join(target.linked) else (str(HERE / 'no_counter.c'),)
    obj, program = folder / 'manifold_mpc.o', folder / 'answers'
    for arguments in (
            (*STRICT, '-fstack-usage', '-c', '-o', str(obj), str(sources / 'manifold_mpc.c'))
            if target.compiler[0] != 'clang' else
            (*STRICT, '-c', '-o', str(obj), str(sources / 'manifold_mpc.c')),
            ('-std=gnu99', f'-I{sources}', '-o', str(program), str(HERE / 'answers.c'), *counter,
             str(obj), *target.linked, '-lm')):
        done = subprocess.run([*target.compiler, *arguments], capture_output=True, text=True,
                              check=False)
        assert done.returncode == 0, done.stderr
    return program


def stack_bytes(folder: Path) -> int:
    """Return the deepest stack of a program, from what -fstack-usage wrote beside it.

    Nothing is recursive, so no chain of calls has a function twice; of the generated functions it
    has one part (run_) and one phase at most.
    """
    frames = []
    for line in (folder / 'manifold_mpc.su').read_text(encoding='utf-8').splitlines():
        where, size, kind = line.split('\t')
        assert kind == 'static', line
        frames.append((where.rsplit(':', 1)[1], int(size)))
    kinds = ('phase_', 'run_')
    return sum(size for name, size in frames if not name.startswith(kinds)) + sum(
        max((size for name, size in frames if name.startswith(kind)), default=0)
        for kind in kinds)


def answers(target: Target, program: Path, states: Array, timeout_s: float = 600.0) -> Array:
    """Run a program on states (n, record); return what it answers (n, 12)."""
    folder = program.parent
    states.tofile(folder / 'states.bin')
    done = subprocess.run([*target.runner, str(program)], cwd=folder, capture_output=True,
                          text=True, check=False, timeout=timeout_s)
    assert done.returncode == 0, (done.returncode, done.stdout, done.stderr)
    return np.fromfile(folder / 'answers.bin').reshape(-1, 12)


def rotation(q: Sequence[float]) -> Array:
    """Map a quaternion (x, y, z, w) to R by the operations of interface.c, in their order."""
    x, y, z, w = (float(each) for each in q)
    norm = np.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = (float(each / norm) for each in (x, y, z, w))
    return np.array([
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]])


def python_answer(mpc: AttitudeMpc, state: Array) -> tuple[AttitudeMpcSolution, list[float]]:
    """Return Python's plan for a state (record,), and what answers.c would write of it."""
    if state[0] > 0.0:
        mpc.reset()
    config, nodes = mpc.config, mpc.config.horizon + 1
    given: dict[str, Any] = {}
    momenta, directions, rest = np.split(state[22:], np.cumsum([
        0 if config.wheels is None else len(config.wheels), 3 * len(config.cones) * nodes]))
    if momenta.size:
        mpc._wheels.held = state[21] > 0.0  # what the torques of the motors decide otherwise
        given['wheel_momentum_n_m_s'] = momenta
    if state[15] > 0.0:
        given['directions_N'] = {cone.name: each for cone, each in zip(
            config.cones, directions.reshape(nodes, -1, 3).transpose(1, 0, 2))}
    if state[16] > 0.0:
        given['reference'] = Reference(np.array([*map(rotation, rest[:4 * nodes].reshape(-1, 4))]),
                                       rest[4 * nodes:].reshape(-1, 3))
    late = [(round(state[17] * NANOSECONDS), state[18:21] + state[12:15])] if state[17] else []
    plan = mpc.solve(*moved_on(rotation(state[1:5]), state[5:8], late, mpc.moved_on),
                     rotation(state[8:12]),
                     disturbance_B_n_m=state[12:15], **given)
    return plan, [float(STATUSES.index(plan.status)), plan.iterations, plan.searched, plan.cost,
                  plan.kkt_residual, plan.violation, plan.promised_cost, plan.terminal_ratio,
                  *plan.torque_B_n_m.tolist()]
