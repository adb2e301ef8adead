# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Slews of a 6U with four reaction wheels and stored momentum, on a plant of its own.

    python benchmarks/wheels.py [--slews 200] [--failures 50] [--parts NAME ...]
        [--output docs/results/wheels.json]

180 degrees about random axes, with momentum up to 80 % of what the wheels can store in every
attitude: plans with the wheels in them, and beside them plans in the box of the pseudo-inverse,
which know nothing of momentum. Then one wheel dead at instants of a slew, told at once or found
by what wheels report; those slews are able at whose target the momentum fits into three wheels.
Zero crossings by what the null space is for; the order of the relation of momentum and state.
--parts: only these, the others stay in the file.

The plant knows nothing of the predictor: quaternion, body rate and wheel momenta by fourth-order
Runge-Kutta in steps of 0.2 s, motor torques held over a control step. Motors give no more than
their torque, and none beyond their momentum; what was asked beyond is counted. The largest rate is
that of all samples, in parts of the limit; plans keep RATE_PART of it at control instants, for the
rate between them.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from manifold_mpc_ros import AttitudeMpc, AttitudeMpcConfig, WheelArray
from manifold_mpc_ros.control.devices.wheel_actuator import WheelActuator
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

RESULT = Path(__file__).parents[1] / 'docs' / 'results' / 'wheels.json'
INERTIA = np.diag([0.05, 0.06, 0.02])
# Wheels as those of B1 (bench --constrained) in a pyramid that reaches as far along x, y and z.
AXES_B = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1]]) / np.sqrt(3.0)
TORQUE, MOMENTUM = 7e-4, 0.01082
STEP_S, DURATION_S = 1.0, 160.0
RATE_RAD_S = float(np.radians(3.0))
SETTLED_RAD, SETTLED_RAD_S = np.radians(0.1), np.radians(0.01)
# Plans keep this part of the rate limit; more than this beyond a limit counts.
RATE_PART, BEYOND = 0.95, 1e-9
PURPOSES = ('least_torque', 'away_from_zero', 'balanced')


def array(**changes: Any) -> WheelArray:
    """Return the four wheels."""
    return WheelArray(AXES_B, TORQUE, MOMENTUM, **changes)


def controller(wheels: WheelArray | None) -> AttitudeMpc:
    """Return a controller of the 6U, of torques in the pseudo-inverse's box without wheels."""
    inverse = array().inverse
    box = TORQUE / np.abs(inverse).sum(axis=1).max() * np.ones(3)
    return AttitudeMpc(AttitudeMpcConfig(
        inertia_kg_m2=INERTIA, step_s=STEP_S, horizon=60, attitude_weight=np.eye(3),
        rate_weight=2.0 * np.eye(3), torque_weight=1e4 * np.eye(3),
        max_torque_n_m=box if wheels is None else 5.0 * TORQUE,
        max_rate_rad_s=RATE_PART * RATE_RAD_S,
        wheels=wheels))


class Body:
    """One 6U: attitude, body rate, wheel momenta, and what was asked beyond the limits."""

    def __init__(self, R_NB: Array, momentum: Array) -> None:
        """Begin at rest."""
        self.R_NB, self.omega, self.momentum = R_NB, np.zeros(3), momentum.copy()
        self.dead = np.zeros(4, dtype=bool)
        self.torque_beyond = self.momentum_beyond = 0
        self.actuator: WheelActuator | None = None
        self.largest, self.rate, self.rate_at_steps = np.zeros(2), 0.0, 0.0

    def _rates(self, q: Array, omega: Array, momentum: Array, motor: Array
               ) -> tuple[Array, Array]:
        """Return the derivatives of quaternion and body rate."""
        stored = INERTIA @ omega + AXES_B.T @ momentum
        dq = 0.5 * np.concatenate([[-q[1:] @ omega], q[0] * omega + np.cross(q[1:], omega)])
        return dq, np.linalg.solve(INERTIA, -AXES_B.T @ motor - np.cross(omega, stored))

    def _sample(self, motor: Array, h: float) -> None:
        """Take one Runge-Kutta step."""
        q, omega, held = so3.quaternion_from_rotation(self.R_NB), self.omega, self.momentum
        dq, dw, parts = np.zeros(4), np.zeros(3), []
        for part in (0.0, 0.5, 0.5, 1.0):
            dq, dw = self._rates(q + part * h * dq, omega + part * h * dw,
                                 held + part * h * motor, motor)
            parts.append((dq, dw))
        weights = h / 6.0 * np.array([1.0, 2.0, 2.0, 1.0])
        q = q + sum(w * each[0] for w, each in zip(weights, parts))
        self.R_NB = so3.rotation_from_quaternion(q / np.linalg.norm(q))
        self.omega = omega + sum(w * each[1] for w, each in zip(weights, parts))
        self.momentum = held + h * motor
        self.rate = max(self.rate, float(np.abs(self.omega).max()) / RATE_RAD_S)

    def advance(self, command: Array, step_s: float = STEP_S, samples: int = 5) -> None:
        """Take a control step."""
        parts = np.abs(command) / TORQUE
        self.torque_beyond += bool((parts > 1.0 + BEYOND).any())
        motor = np.clip(command, -TORQUE, TORQUE) * ~self.dead
        reached = np.abs(self.momentum + step_s * motor) / MOMENTUM
        self.momentum_beyond += bool((reached > 1.0 + BEYOND).any())
        self.largest = np.maximum(self.largest, [parts.max(), reached.max()])
        for _ in range(samples):
            stopped = np.abs(self.momentum + step_s / samples * motor) > MOMENTUM
            self._sample(np.where(stopped, 0.0, motor), step_s / samples)
        self.rate_at_steps = max(
            self.rate_at_steps, float(np.abs(self.omega).max()) / RATE_RAD_S)

    @property
    def settled(self) -> bool:
        """Whether the target is reached, the identity at rest."""
        return bool(so3.angle(self.R_NB) < SETTLED_RAD
                    and np.linalg.norm(self.omega) < SETTLED_RAD_S)


def random_slew(rng: np.random.Generator, largest: float) -> tuple[Array, Array]:
    """Return a half turn, and wheel momenta up to this part of what fits in every attitude."""
    axis, direction = rng.normal(size=(2, 3))
    wheels = array()
    reach = float(wheels.momenta.bounds.min())
    total = largest * rng.uniform() * reach * direction / np.linalg.norm(direction)
    return so3.exp(np.pi * axis / np.linalg.norm(axis)), wheels.inverse @ total


def slew(mpc: AttitudeMpc, body: Body, command: Callable[[AttitudeMpc, Body], Array],
         on_tick: Callable[[int], None] = lambda _: None) -> dict[str, Any]:
    """Run one slew; return when it settled (None: never) and what was asked beyond limits."""
    mpc.reset()
    settled: list[bool] = []
    speeds: list[Array] = []
    for k in range(round(DURATION_S / STEP_S)):
        on_tick(k)
        settled.append(body.settled)
        body.advance(command(mpc, body))
        speeds.append(body.momentum)
    late = np.flatnonzero(~np.array(settled))
    crossings = np.count_nonzero(np.diff(np.sign(speeds), axis=0), axis=0).sum()
    return {'settled_s': None if not settled[-1] else float(late[-1] + 1) * STEP_S,
            'torque_beyond': body.torque_beyond, 'momentum_beyond': body.momentum_beyond,
            'largest_torque': float(body.largest[0]), 'largest_momentum': float(body.largest[1]),
            'largest_rate': body.rate, 'largest_rate_at_steps': body.rate_at_steps,
            'zero_crossings': int(crossings)}


def by_wheels(mpc: AttitudeMpc, body: Body) -> Array:
    """Return the motor torques of a plan that knows the wheels."""
    known = np.where(body.dead, np.nan, body.momentum)
    motor = mpc.solve(body.R_NB, body.omega, wheel_momentum_n_m_s=known).wheel_torque_n_m
    assert motor is not None
    return motor


def by_reports(mpc: AttitudeMpc, body: Body) -> Array:
    """Return motor torques of an actuator that finds dead wheels by what they report."""
    if body.actuator is None:
        body.actuator = WheelActuator(array(), INERTIA, STEP_S)
    known = body.actuator.observe(body.omega, body.momentum)
    plan = mpc.solve(body.R_NB, body.omega, wheel_momentum_n_m_s=known)
    body.actuator.planned = plan.wheel_torque_n_m
    return body.actuator.allocate(body.actuator.limited(plan.torque_B_n_m)).device


def by_box(mpc: AttitudeMpc, body: Body) -> Array:
    """Return motor torques for a body torque, by the pseudo-inverse."""
    return np.asarray(-array().inverse @ mpc.solve(body.R_NB, body.omega).torque_B_n_m)


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of some slews."""
    times = [run['settled_s'] for run in runs if run['settled_s'] is not None]
    return {'slews': len(runs), 'settled': len(times),
            'median_settled_s': float(np.median(times)), 'longest_settled_s': max(times),
            **{f'slews_with_{name}': sum(run[name] > 0 for run in runs)
               for name in ('torque_beyond', 'momentum_beyond')},
            **{name: max(run[name] for run in runs)
               for name in ('largest_torque', 'largest_momentum', 'largest_rate',
                            'largest_rate_at_steps')},
            'median_rate': float(np.median([run['largest_rate'] for run in runs])),
            'slews_with_rate_beyond': sum(run['largest_rate'] > 1.0 + BEYOND for run in runs),
            'zero_crossings': sum(run['zero_crossings'] for run in runs)}


def campaign(slews: int) -> dict[str, Any]:
    """Return what plans with wheels and plans in the box do on the same slews."""
    rng, mpcs = np.random.default_rng(13), (controller(array()), controller(None))
    runs: list[list[dict[str, Any]]] = [[], []]
    for given in [random_slew(rng, 0.8) for _ in range(slews)]:
        for mpc, command, kept in zip(mpcs, (by_wheels, by_box), runs):
            kept.append(slew(mpc, Body(*given), command))
    both = [(a, b) for a, b in zip(*runs) if a['settled_s'] and b['settled_s']]
    return {'stored': 0.8, 'wheels': summary(runs[0]), 'box': summary(runs[1]),
            'least_rate_of_box': min(run['largest_rate'] for run in runs[1]),
            'compared': len(both),
            'median_gain': float(np.median([1.0 - a['settled_s'] / b['settled_s']
                                            for a, b in both])),
            'later_than_box': [{name: [a[name], b[name]] for name in ('settled_s', 'largest_rate')}
                               for a, b in both if a['settled_s'] > b['settled_s']]}


def failures(instants: int, stored: float, command: Callable[[AttitudeMpc, Body], Array]
             ) -> dict[str, Any]:
    """Return one slew with a wheel that dies, at so many instants of its first 50 s."""
    rng, mpc = np.random.default_rng(14), controller(array())
    runs: list[dict[str, Any]] = []
    for i in range(instants):
        R, momentum = random_slew(rng, stored)
        body, which, at = Body(R, momentum), i % 4, i * 50 // instants
        total, need = R @ AXES_B.T @ momentum, np.zeros(3)

        def fail(k: int, body: Body = body, which: int = which, at: int = at,
                 total: Array = total, need: Array = need) -> None:
            if k == at + 1:
                need[:] = total - AXES_B[which] * body.momentum[which]
            body.dead[which] = k > at
        run = slew(mpc, body, command, fail)
        left = array().without(np.arange(4) == which)
        runs.append(run | {'at_target': left.momenta.gauge(need)})
    able = [run for run in runs if run['at_target'] <= 1.0]
    return {'stored': stored, 'able': summary(able) if able else None,
            'not_able': len(runs) - len(able),
            'not_able_but_settled': sum(
                run['settled_s'] is not None for run in runs if run['at_target'] > 1.0),
            'able_not_settled_at_target': [
                run['at_target'] for run in able if run['settled_s'] is None]}


def crossings(slews: int) -> dict[str, int]:
    """Return zero crossings of the wheels by what the null space is for."""
    counts = {}
    for purpose in PURPOSES:
        rng, mpc = np.random.default_rng(15), controller(array(null_space=purpose))
        counts[purpose] = summary([slew(mpc, Body(*random_slew(rng, 0.2)), by_wheels)
                                   for _ in range(slews)])['zero_crossings']
    return counts


def order() -> dict[str, Any]:
    """Return differences of attitude [rad] from the plant, whose motors do what states say."""
    def torque(time_s: float) -> Array:
        return np.asarray(1.5e-4 * np.sin(0.2 * time_s + np.arange(3.0)))

    found = {}
    for step_s in (1.0, 0.5, 0.25, 0.125):
        body = Body(so3.exp([0.4, -1.1, 0.6]), np.array([6e-3, -3e-3, 4e-3, 2e-3]))
        body.omega = np.array([0.01, -0.005, 0.015])
        R, omega = body.R_NB, body.omega
        total = R @ (INERTIA @ omega + AXES_B.T @ body.momentum)
        for k in range(round(20.0 / step_s)):
            b = R.T @ total - INERTIA @ omega
            R, omega = lgvi_step(R, omega, torque((k + 0.5) * step_s), inertia_kg_m2=INERTIA,
                                 step_s=step_s)
            motors = array().inverse @ (R.T @ total - INERTIA @ omega - b) / step_s
            body.advance(motors, step_s, 20)
        found[str(step_s)] = float(so3.angle(R.T @ body.R_NB))
    values = list(found.values())
    return {'error_rad_by_step_s': found,
            'orders': np.log2(np.array(values[:-1]) / values[1:]).tolist()}


def main() -> None:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument('--slews', type=int, default=200)
    parser.add_argument('--failures', type=int, default=50)
    parser.add_argument('--parts', nargs='+')
    parser.add_argument('--output', type=Path, default=RESULT)
    given = parser.parse_args()
    parts: dict[str, Callable[[], Any]] = {
        'order': order, 'campaign': lambda: campaign(given.slews),
        'dead_wheel': lambda: failures(given.failures, 0.25, by_wheels),
        'dead_wheel_80': lambda: failures(given.failures, 0.8, by_wheels),
        'dead_wheel_80_found': lambda: failures(given.failures, 0.8, by_reports),
        'zero_crossings': lambda: crossings(given.slews // 8)}
    new = {name: parts[name]() for name in given.parts or parts}
    old = json.loads(given.output.read_text('utf-8')) if given.output.exists() else {}
    found = {name: (old | new)[name] for name in parts if name in old | new}
    given.output.write_text(json.dumps(found, indent=2) + '\n', encoding='utf-8')
    print(json.dumps(new, indent=2))


if __name__ == '__main__':
    main()
