# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How fast the measured core is, and how many operations one pass of the solver has to do.

The bound is for the pass that any structure-exploiting method makes: linearise N stages, one
Riccati sweep backwards, one roll-out forwards. Its operations are counted here, from formulas
and from CasADi graphs written for this; they are not those of our code, which does more
(inequalities, exact second-order terms, line search).
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import casadi as ca

from manifold_mpc_ros.errors import ManifoldMpcError
from manifold_mpc_ros.lab.benchmark.peers import problem

#: Independent chains of fused multiply-adds on four doubles each: enough to hide their latency.
_KERNEL = r"""
#include <stdio.h>
#include <time.h>
typedef double vector __attribute__((vector_size(32)));
static double seconds(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}
int main(void) {
    enum { CHAINS = 12, LANES = 4, STEPS = 1000000, RUNS = 30 };
    vector a[CHAINS], factor, term, sum;
    double best = 0;
    for (int lane = 0; lane < LANES; lane++) { factor[lane] = 0.999999; term[lane] = 1e-9; }
    for (int i = 0; i < CHAINS; i++) a[i] = factor * (i + 1);
    for (int run = 0; run < RUNS; run++) {
        double begin = seconds();
        for (int step = 0; step < STEPS; step++)
            for (int i = 0; i < CHAINS; i++) a[i] = a[i] * factor + term;
        double rate = 2.0 * LANES * CHAINS * STEPS / (seconds() - begin);
        if (rate > best) best = rate;
    }
    sum = a[0];
    for (int i = 1; i < CHAINS; i++) sum += a[i];
    printf("%.6e %g\n", best, sum[0]);
    return 0;
}
"""
_COMPILE = ('-O3', '-march=native', '-ffp-contract=fast')


def core_rate(core: int) -> float:
    """Return the largest rate of double-precision operations of a core [flop/s], measured.

    Raises ManifoldMpcError where it cannot be, without a C compiler above all.
    """
    compiler = shutil.which('cc')
    if compiler is None:
        raise ManifoldMpcError("the core's rate needs a C compiler, and there is no cc")
    with tempfile.TemporaryDirectory(prefix='flops_') as folder:
        source, program = Path(folder, 'kernel.c'), str(Path(folder, 'kernel'))
        source.write_text(_KERNEL, encoding='utf-8')
        try:
            subprocess.run([compiler, *_COMPILE, str(source), '-o', program], check=True)
            done = subprocess.run(['taskset', '-c', str(core), program], check=True, text=True,
                                  capture_output=True)
        except (OSError, subprocess.CalledProcessError) as error:
            raise ManifoldMpcError(f"the core's rate was not measured: {error}") from None
    return float(done.stdout.split()[0])


def pass_operations(horizon: int) -> dict[str, int]:
    """Return the floating-point operations of one textbook pass, part by part."""
    stage = {'linearise': _linearise(), 'Riccati step': _riccati(6, 3), 'roll out': _roll_out()}
    parts = {name: horizon * count for name, count in stage.items()}
    return {**parts, 'all': sum(parts.values())}


def _riccati(states: int, inputs: int) -> int:
    """Return the operations of one Riccati step with vectors, symmetric parts once.

    [A B]^T P [A B] + H (P [A B], then a triangle), Cholesky of Quu, K and k, the Schur update.
    """
    n, m = states, inputs
    both = n + m
    product = 2 * n * n * both + 2 * n * (both * (both + 1) // 2)
    vector = 2 * n * n + 2 * n * both
    factor = m ** 3 // 3 + m * m
    gains = 2 * m * m * (n + 1)
    update = 2 * m * (n * (n + 1) // 2) + 2 * m * n
    return product + vector + factor + gains + update


def _operations(function: ca.Function) -> int:
    """Return the operations of an SX function: its instructions without moves and constants."""
    idle = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_ASSIGN}
    return sum(function.instruction_id(k) not in idle
               for k in range(function.n_instructions()))


def _symbols() -> tuple[ca.SX, ca.SX]:
    """Return a state and a torque."""
    return ca.SX.sym('x', problem.STATE), ca.SX.sym('tau', problem.TORQUE)


def _linearise() -> int:
    """Return the operations of one Runge-Kutta step with its Jacobian."""
    x, tau = _symbols()
    after = problem.runge_kutta(x, tau)
    jacobian = ca.jacobian(after, ca.vertcat(x, tau))
    return _operations(ca.Function('linearise', [x, tau], [after, jacobian], {'cse': True}))


def _roll_out() -> int:
    """Return the operations of one step under the feedback law, and of its stage cost."""
    x, tau = _symbols()
    step = ca.Function('step', [x, tau], [problem.runge_kutta(x, tau)], {'cse': True})
    return _operations(step) + 2 * 3 * 6 + 2 * 9


def bound(horizon: int, rate_flop_s: float) -> dict[str, Any]:
    """Return the least time of one pass at the measured rate [us], and what it counts."""
    operations = pass_operations(horizon)
    return {'horizon': horizon, 'operations': operations,
            'bound_us': round(1e6 * operations['all'] / rate_flop_s, 4)}
