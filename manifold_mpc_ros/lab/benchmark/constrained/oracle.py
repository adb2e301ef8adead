# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Problems with cones in another formulation, from many starts, by IPOPT: the best known plan.

As :mod:`..peers.oracle`, with the attitude quaternion of every node as an unknown: cones at
every node make the problem without them dense. Written down and compiled once a configuration;
initial state, cones and terminal level are parameters. Of a group of keep-in cones the mean of
power 32 is kept, as docs/theory.md (24a) has it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import casadi as ca
import numpy as np

from manifold_mpc_ros.config.cones import Cone, joined
from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.dynamics import lgvi
from manifold_mpc_ros.lab.benchmark.peers import oracle
from manifold_mpc_ros.lab.benchmark.peers.casadi_peer import library_of
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.lie.arrays import Array

#: Numbers of a node (attitude, rate) and of a stage (node and turn).
NODE, STAGE = 7, 10
#: Numbers of a cone: axis, direction, sign and cosine.
_CONE = 8
IPOPT = {'print_level': 0, 'sb': 'yes', 'tol': 1e-9, 'max_iter': 300, 'bound_relax_factor': 0.0}
_QUIET = {'print_time': False, 'error_on_fail': False}


class ConeOracle:
    """IPOPT on one configuration and up to ``most`` cones; P (6, 6) is its terminal design's.

    The last ``members`` of the cones are a group of which any one is kept.
    """

    def __init__(self, config: AttitudeMpcConfig, P: Array, most: int, members: int = 0) -> None:
        """Write the problem down and compile it."""
        assert config.max_torque_n_m is not None
        assert config.max_rate_rad_s is not None
        self.config, self._P, self._most, self._members = config, P, most, members
        rows = most - members + (members > 0)
        nlp = self._write()
        with tempfile.TemporaryDirectory(prefix='oracle_') as folder:
            options = {**_QUIET, 'ipopt': IPOPT}
            library = library_of(ca.nlpsol('oracle', 'ipopt', nlp, options), Path(folder))
            self._solver = ca.nlpsol('oracle', 'ipopt', library, options)
        n = config.horizon
        torque, rate = config.max_torque_n_m, config.max_rate_rad_s
        above = np.concatenate([np.zeros(NODE), *(
            [np.concatenate([np.zeros(NODE), torque, rate, np.zeros(rows)])] * n), np.ones(1)])
        below = np.concatenate([np.zeros(NODE), *(
            [np.concatenate([np.zeros(NODE), -torque, -rate, np.full(rows, -np.inf)])] * n),
            np.full(1, -np.inf)])
        self._bounds = {'lbg': below, 'ubg': above}

    def solve(self, R_NB: Array, omega_BN_B: Array, cones: Sequence[Cone], level: float,
              guess: Array) -> tuple[float, Array]:
        """Return cost (inf when none was found) and unknowns that a start leads to."""
        found = self._solver(x0=guess, p=self._parameters(R_NB, omega_BN_B, cones, level),
                             **self._bounds)
        cost = float(found['f']) if self._solver.stats()['success'] else np.inf
        return cost, np.array(found['x']).ravel()

    def guess(self, R_NB: Array, omega_BN_B: Array) -> Array:
        """Map attitudes (N + 1, 3, 3) and rates (N + 1, 3) to the unknowns."""
        steps = oracle.steps_of(R_NB, omega_BN_B, self.config)
        q = so3.quaternion_from_rotation(R_NB)
        dots = np.sum(q[1:] * q[:-1], axis=1)
        q[1:] *= np.cumprod(np.where(dots < 0.0, -1.0, 1.0))[:, None]
        nodes = np.hstack([q, steps.rates])
        return np.concatenate([np.hstack([nodes[:-1], steps.turns]).ravel(), nodes[-1]])

    def by_way_of(self, corners: Array) -> Array:
        """Return a start along corners (k, 3, 3), at rest at both ends and fastest between."""
        config = self.config
        turns = so3.log(np.swapaxes(corners[:-1], 1, 2) @ corners[1:])
        angles = np.maximum(np.linalg.norm(turns, axis=1), 1e-9)
        end = np.cumsum(angles)
        share = np.linspace(0.0, 1.0, config.horizon + 1)
        place = end[-1] * share ** 2 * (3.0 - 2.0 * share)
        part = np.minimum(np.searchsorted(end, place), len(end) - 1)
        done = (place - end[part] + angles[part]) / angles[part]
        R = corners[part] @ so3.exp(done[:, None] * turns[part])
        omega = so3.log(np.swapaxes(R[:-1], 1, 2) @ R[1:]) / config.step_s
        return self.guess(R, np.vstack([omega, np.zeros(3)]))

    def _parameters(self, R_NB: Array, omega_BN_B: Array, cones: Sequence[Cone], level: float
                    ) -> Array:
        """Return the parameters; a cone that is not there allows everything."""
        J, h = self.config.inertia_kg_m2, self.config.step_s
        rows = [[*cone.axis_B, *cone.direction_N, cone.sign, np.cos(cone.half_angle_rad)]
                for cone in cones]
        first = len(cones) - self._members
        rows[first:first] = [[0.0] * 6 + [1.0, 1.0]] * (self._most - len(cones))
        return np.concatenate([
            so3.quaternion_from_rotation(R_NB), lgvi.cayley_step(h * J @ omega_BN_B, J),
            np.ravel(rows), [level]])

    def _write(self) -> dict[str, ca.MX]:
        """Return cost and constraints of all stages."""
        config, n = self.config, self.config.horizon
        plan = ca.MX.sym('plan', STAGE * n + NODE)
        given = ca.MX.sym('given', NODE + _CONE * self._most + 1)
        stages = ca.reshape(plan[:STAGE * n], STAGE, n)
        nodes = ca.horzcat(stages[:NODE, :], plan[STAGE * n:])
        cones = given[NODE:-1]
        cost, rows = self._stage().map(n)(stages, nodes[:, 1:], ca.repmat(cones, 1, n))
        end, form = self._end()(nodes[:, n])
        rows = ca.vertcat(nodes[:, 0] - given[:NODE], ca.vec(rows), form / given[-1])
        assert config.forcing == 'symmetric'
        return {'x': plan, 'p': given, 'f': ca.sum2(cost) + end, 'g': rows}

    def _stage(self) -> ca.Function:
        """Map a stage, the node after it and the cones to cost and rows of constraints."""
        config = self.config
        J, h = ca.DM(config.inertia_kg_m2), config.step_s
        stage, after, cones = ca.SX.sym('s', STAGE), ca.SX.sym('n', NODE), ca.SX.sym(
            'cones', _CONE * self._most)
        q, rate, turn = stage[:4], stage[4:7], stage[7:]
        half = oracle.momentum(turn, J, 1) - oracle.momentum(rate, J, 1)
        torque = 2 * half / h ** 2
        ends = oracle.momentum(turn, J, -1) + half - oracle.momentum(after[4:], J, 1)
        omega = ca.DM(np.linalg.inv(config.inertia_kg_m2)) @ oracle.momentum(
            after[4:], J, 1) / h
        effort = ca.DM(np.trace(config.torque_weight) * np.eye(3) - config.torque_weight)
        cost = (oracle.trace_cost(config.attitude_weight, q)
                + oracle.trace_cost(config.rate_weight, oracle.quaternion(rate)) / h ** 2
                + ca.dot(torque, effort @ torque) / 2)
        rows = [after[:4] - oracle.turned(q, turn), ends, torque, omega]
        w, v, shares = after[0], after[1:4], []
        for i, each in enumerate(ca.vertsplit(cones, _CONE)):
            b, s, sign, cosine = each[0:3], each[3:6], each[6], each[7]
            seen = ca.dot(s, b + 2 * ca.cross(v, w * b + ca.cross(v, b)))
            if i < self._most - self._members:
                rows.append(sign * (seen - cosine))
            else:
                shares.append((1 + seen) / (1 + cosine))
        if shares:
            rows.append(1 - (sum(share ** 32 for share in shares) / len(shares)) ** (1 / 32))
        return ca.Function('stage', [stage, after, cones], [cost, ca.vertcat(*rows)])

    def _end(self) -> ca.Function:
        """Map the last node to the terminal cost and its form."""
        node = ca.SX.sym('n', NODE)
        xi = ca.vertcat(oracle.log(node[:4]),
                        oracle.log(oracle.quaternion(node[4:])) / self.config.step_s)
        form = ca.dot(xi, ca.DM(self._P) @ xi)
        return ca.Function('end', [node], [form / 2, form])


def starts(R_NB: Array, cones: Sequence[Cone], rng: np.random.Generator, vias: int
           ) -> Iterator[Array]:
    """Yield corners (k, 3, 3) of starts towards the identity: straight, long way, by others.

    Of 60 random attitudes those by way of which the two straight ways keep all cones, half of
    ``vias`` the shortest and half at random; where there are too few, the least violating ones.
    """
    home = np.eye(3)
    yield np.stack([R_NB, home])
    turn = so3.log(R_NB)
    angle = max(float(np.linalg.norm(turn)), 1e-9)
    back = turn / angle * (2.0 * np.pi - angle)
    yield np.stack([R_NB, R_NB @ so3.exp(back / 3), R_NB @ so3.exp(2 * back / 3), home])
    if not cones:
        return
    others = so3.random_rotations(rng, 60)
    legs = [so3.log(np.swapaxes(R_NB[None], 1, 2) @ others), so3.log(np.swapaxes(others, 1, 2))]
    parts = np.linspace(0.0, 1.0, 13)[:, None, None]
    seen = np.concatenate([R_NB @ so3.exp(parts * legs[0]), others @ so3.exp(parts * legs[1])])
    margins = np.min(list(joined(cones, np.array([
        cone.margins_rad(seen) for cone in cones])).values()), axis=(0, 1))
    lengths = sum(np.linalg.norm(leg, axis=1) for leg in legs)
    order = np.lexsort([lengths, np.maximum(-margins, 0.0)])
    clear = int(np.sum(margins >= 0.0))
    short = order[:vias - vias // 2]
    rest = order[len(short):max(clear, vias)]
    for i in [*short, *rng.permutation(rest)[:vias // 2]]:
        yield np.stack([R_NB, others[i], home])


