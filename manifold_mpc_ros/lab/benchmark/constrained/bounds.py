# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The shortest time of a slew at rest, by IPOPT from several starts: what no controller beats.

50 intervals of one length, constant torques and one Runge-Kutta step of order 4 in each, limits
and cones at the nodes: a bound but for what happens between them. Wheels begin at rest, so that
the momentum of body and wheels stays zero and ``J omega' = -W u``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from manifold_mpc_ros.lab.benchmark.constrained.oracle import starts
from manifold_mpc_ros.lab.benchmark.constrained.slews import Slew
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.mpc.target import attitude_towards

INTERVALS, VIAS = 50, 4
_IPOPT = {'print_level': 0, 'sb': 'yes', 'tol': 1e-8, 'max_iter': 500}
_QUIET = {'print_time': False, 'error_on_fail': False, 'ipopt': _IPOPT}


def time_optimal_s(slew: Slew, say: Callable[[str], None]) -> float:
    """Return the shortest time [s] that was found; inf where no start led to a solution."""
    problem = _Problem(slew)
    R_ND = slew.target if slew.axis_B is None else attitude_towards(
        slew.config(np.eye(3)), slew.target)
    cones = [type(each)(each.name, each.axis_B, R_ND.T @ each.direction_N, each.half_angle_rad,
                        each.kind) for each in slew.cones]
    best = np.inf
    for i, corners in enumerate(starts(R_ND.T @ slew.start, cones, np.random.default_rng(14),
                                       VIAS)):
        say(f'{slew.name}: time-optimal, start {i + 1} of {VIAS + 2}, so far {best:.1f} s')
        best = min(best, problem.solve(R_ND @ corners))
    return best


class _Problem:
    """The problem, written down once; times are in units of the period of control."""

    def __init__(self, slew: Slew) -> None:
        """Write states (omega in rad per unit) and controls (parts of the limits) down."""
        self._slew, n = slew, INTERVALS
        wheels = slew.wheels
        limit = np.broadcast_to(slew.law['max_torque_n_m'], 3)
        self._torques = np.diag(limit) if wheels is None else (
            -wheels.axes_B.T * wheels.max_torque_n_m)
        m = self._torques.shape[1]
        x, u, h = ca.MX.sym('x', 7, n + 1), ca.MX.sym('u', m, n), ca.MX.sym('h')
        gaps = x[:, 1:] - self._step().map(n)(x[:, :-1], u, ca.repmat(h, 1, n))
        limits = self._limits().map(n)(x[:, 1:])
        ends = self._ends()(x[:, n])
        rows = ca.vertcat(ca.vec(gaps), ca.vec(limits), ends)
        plan = ca.vertcat(ca.vec(x), ca.vec(u), h)
        self._solver = ca.nlpsol('quickest', 'ipopt', {'x': plan, 'f': n * h, 'g': rows}, _QUIET)
        equal, below = gaps.numel(), limits.numel()
        self._rows = {'lbg': [0.0] * equal + [-np.inf] * below + [0.0] * ends.numel(), 'ubg': 0.0}
        self._controls = m

    def solve(self, corners: Array) -> float:
        """Return the time [s] that a start along corners (k, 3, 3) leads to, inf without one."""
        n, m, unit = INTERVALS, self._controls, self._slew.step_s
        turns = so3.log(np.swapaxes(corners[:-1], 1, 2) @ corners[1:])
        angles = np.maximum(np.linalg.norm(turns, axis=1), 1e-9)
        end = np.cumsum(angles)
        place = end[-1] * np.linspace(0.0, 1.0, n + 1)
        part = np.minimum(np.searchsorted(end, place), len(end) - 1)
        done = (place - end[part] + angles[part]) / angles[part]
        q = so3.quaternion_from_rotation(corners[part] @ so3.exp(done[:, None] * turns[part]))
        q[1:] *= np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0))[:, None]
        guess_s = 1.5 * self._slew.ticks * unit / n
        rate = turns[part] * (end[-1] / angles[part] / n / guess_s * unit)[:, None]
        states = np.hstack([q, rate])
        low = np.concatenate([np.full(7 * (n + 1), -np.inf), np.full(m * n, -1.0), [1e-3]])
        high = np.concatenate([np.full(7 * (n + 1), np.inf), np.full(m * n, 1.0), [np.inf]])
        low[:7] = high[:7] = np.concatenate([q[0], np.zeros(3)])
        found = self._solver(x0=np.concatenate([
            states.ravel(), np.zeros(m * n), [guess_s / unit]]), lbx=low, ubx=high, **self._rows)
        return float(found['f']) * unit if self._solver.stats()['success'] else np.inf

    def _step(self) -> ca.Function:
        """Map a state, a control and a length to the next state."""
        J, unit, free = self._slew.inertia, self._slew.step_s, self._slew.wheels is None
        x, u, h = ca.SX.sym('x', 7), ca.SX.sym('u', self._torques.shape[1]), ca.SX.sym('h')
        torque = ca.DM(self._torques * unit ** 2) @ u

        def derivative(x: ca.SX) -> ca.SX:
            w, v, omega = x[0], x[1:4], x[4:7]
            total = torque - (ca.cross(omega, ca.DM(J) @ omega) if free else 0)
            return ca.vertcat(-ca.dot(v, omega) / 2, (w * omega + ca.cross(v, omega)) / 2,
                              ca.DM(np.linalg.inv(J)) @ total)
        a = derivative(x)
        b = derivative(x + h / 2 * a)
        c = derivative(x + h / 2 * b)
        d = derivative(x + h * c)
        return ca.Function('step', [x, u, h], [x + h / 6 * (a + 2 * b + 2 * c + d)])

    def _limits(self) -> ca.Function:
        """Map a state to values that are at most zero: cones, energy or rate, momenta."""
        slew, x = self._slew, ca.SX.sym('x', 7)
        w, v, omega = x[0], x[1:4], x[4:7] / slew.step_s
        values: list[Any] = []
        for each in slew.cones:
            b = ca.DM(each.axis_B)
            turned = b + 2 * ca.cross(v, w * b + ca.cross(v, b))
            values.append(each.sign * (ca.dot(ca.DM(each.direction_N), turned)
                                       - np.cos(each.half_angle_rad)))
        if slew.energy_form is not None:
            values.append(ca.dot(omega, ca.DM(slew.energy_form) @ omega) - 1)
        else:
            part = omega / np.broadcast_to(slew.law['max_rate_rad_s'], 3)
            values += [part - 1, -part - 1]
        return ca.Function('limits', [x], [ca.vertcat(*values)])

    def _ends(self) -> ca.Function:
        """Map the last state to what is zero at rest at the target."""
        slew, x = self._slew, ca.SX.sym('x', 7)
        w, v = x[0], x[1:4]
        if slew.axis_B is None:
            q = so3.quaternion_from_rotation(slew.target)
            error = q[0] * v - w * ca.DM(q[1:]) - ca.cross(ca.DM(q[1:]), v)
        else:
            b = ca.DM(slew.axis_B)
            across = np.linalg.svd(slew.target[None])[2][1:]
            error = ca.DM(across) @ (b + 2 * ca.cross(v, w * b + ca.cross(v, b)))
        return ca.Function('ends', [x], [ca.vertcat(error, x[4:7])])
