# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The model of a pass is the second-order expansion of the merit that its trial evaluates.

Along the Newton step d of a merit phi with gradient g and exact Hessian H, ``phi' = g . d`` and
``phi'' = d . H d`` are minus and plus the expected decrease. Both are taken by differences of
trials, which share no derivative with the model. A start on the central path has multipliers
mu / slack, so the model's Hessian is the barrier's own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cases import CERTIFIED, LIMITED, LIMITS, REFERENCE, configuration
from strategies import INERTIAS, generator

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.config.wheels import WheelArray
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.attitude_mpc import AttitudeMpc
from manifold_mpc_ros.mpc.compiled import CompiledMpc
from manifold_mpc_ros.mpc.program import fields as f
from manifold_mpc_ros.mpc.program import options
from manifold_mpc_ros.mpc.reference import Reference
from manifold_mpc_ros.mpc.stages.inequalities import inequalities_of

WHEELS = WheelArray([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1], [1, 0, 0]], 0.15, 0.8)
ODD: dict[str, Any] = {
    'inertia_kg_m2': INERTIAS['off_diagonal'], 'horizon': 6,
    'torque_weight': [[2.0, 0.3, 0.0], [0.3, 1.5, -0.2], [0.0, -0.2, 1.0]],
    'attitude_weight': [[1.0, 0.2, 0.0], [0.2, 1.4, 0.1], [0.0, 0.1, 0.7]]}
ELLIPSOID = [[4.0, 0.5, 0.0], [0.5, 5.0, -0.3], [0.0, -0.3, 6.0]]
CONES = (Cone('sun', (1.0, 0.2, 0.0), (-0.3, 1.0, 0.1), 0.6),
         Cone('sensor', (0.0, 0.3, 1.0), (0.2, -0.1, 1.0), 1.4, 'keep_in'))
GROUP = tuple(Cone(name, axis, (1.0, 0.3, -0.5), 1.3, 'keep_in', 'any') for name, axis in (
    ('one', (0.0, 1.0, 0.2)), ('other', (1.0, -1.0, 0.0))))
KINDS: dict[str, dict[str, Any]] = {
    'free paper': {**REFERENCE, **ODD},
    'free symmetric': {**REFERENCE, **ODD, 'forcing': 'symmetric'},
    'limited paper': {**LIMITED, **ODD},
    'limited symmetric': {**LIMITED, **ODD, 'forcing': 'symmetric'},
    'ellipsoid paper': {**LIMITED, **ODD, 'rate_ellipsoid_s2': ELLIPSOID},
    'ellipsoids symmetric': {**LIMITED, **ODD, 'forcing': 'symmetric', 'max_rate_rad_s': None,
                             'rate_ellipsoid_s2': ELLIPSOID, 'max_rate_norm_rad_s': 0.7},
    'cones paper': {**LIMITED, **ODD, 'cones': (*CONES, *GROUP)},
    'certified cones': {**CERTIFIED, 'horizon': 12, 'cones': CONES},
    'wheels symmetric': {**LIMITED, **ODD, 'forcing': 'symmetric', 'wheels': WHEELS},
    'certified wheels': {**CERTIFIED, 'horizon': 12, 'wheels': WHEELS},
    'certified': {**CERTIFIED, 'horizon': 12},
    'certified paper': {**LIMITS, 'horizon': 12},
    'graded': {**CERTIFIED, 'step_s': 0.2, 'horizon': 12, 'horizon_s': 3.2},
    'graded pointing': {**LIMITED, 'target': 'pointing', 'forcing': 'symmetric', 'step_s': 0.2,
                        'horizon': 9, 'horizon_s': 2.4},
    'pointing': {**LIMITED, 'target': 'pointing', 'forcing': 'symmetric', 'horizon': 6},
    'certified pointing': {**LIMITS, 'target': 'pointing', 'horizon': 9},
}
# About a reference that moves, under a disturbance torque.
MOVING: dict[str, dict[str, Any]] = {
    'moving certified': KINDS['certified'], 'moving paper': KINDS['limited paper']}


class Probe(CompiledMpc):
    """The solver with its model and its trial laid open."""

    def modelled(self, mu: float) -> tuple[float, float]:
        """Model the plan at a barrier parameter; return expected decrease and stationarity."""
        self._mu = mu
        self._library.model(self._address, mu)
        stationarity, _, decrease, _, _ = self._global(f.RESIDUALS).tolist()
        return decrease, stationarity

    def merit(self, length: float) -> float:
        """Return the merit of a trial of some length."""
        self._library.try_step(self._address, length)
        cost, logs, _ = self._global(f.SUMS).tolist()
        return float(cost - self._mu * logs)


def wobbling(horizon: int) -> Reference:
    """Return a reference that turns about changing axes."""
    turns = np.array([[0.06 * np.sin(0.5 * k), 0.02 * k, -0.01 * k] for k in range(horizon + 1)])
    rates = np.array([[0.02, 0.04 * np.cos(k), -0.02] for k in range(horizon + 1)])
    return Reference(so3.exp(turns), rates)


@pytest.fixture(scope='module', params=sorted([*KINDS, *MOVING]))
def probe(request: pytest.FixtureRequest) -> Probe:
    """Return a probe of each kind of problem."""
    moving = request.param in MOVING
    config = configuration(**{**KINDS, **MOVING}[request.param])
    mpc = AttitudeMpc(config, disturbed=moving, moving=moving)
    if moving:
        mpc.solve(np.eye(3), np.zeros(3), reference=wobbling(config.horizon),
                  disturbance_B_n_m=[0.02, -0.05, 0.03])
    if config.wheels is not None:
        mpc.solve(np.eye(3), np.zeros(3), wheel_momentum_n_m_s=[0.4, -0.3, 0.5, 0.2, -0.1],
                  disturbance_B_n_m=[0.02, -0.05, 0.03])
    solver = mpc.solver
    solver.__class__ = Probe
    assert isinstance(solver, Probe)
    return solver


def starts(probe: Probe, n: int, mu: float) -> Any:
    """Yield n random states from which a central start keeps clear of its multipliers' cap."""
    rng, found = generator('model'), 0
    while found < n:
        R, omega = so3.random_rotations(rng, 1)[0], rng.uniform(-0.1, 0.1, 3)
        probe.set_state(R, np.eye(3), omega)
        probe.begin_slew(mu)
        multipliers = [probe.field(each.multiplier)[1:] for each in inequalities_of(
            probe.structure) if each.penalty is not None and each.name != 'terminal_level']
        multipliers += [probe.field(each.multiplier)[-1:] for each in inequalities_of(
            probe.structure) if each.name == 'terminal_level']
        if all(values.max() < 9.9 for values in multipliers):
            found += 1
            yield R, omega


def test_the_model_is_the_expansion_of_the_merit(probe: Probe) -> None:
    mu, h = options.COLD_BARRIER, 1e-4
    for _ in starts(probe, 3, mu):
        decrease, stationarity = probe.modelled(mu)
        assert decrease > 1e-3
        assert stationarity > 1e-3
        low, middle, high = (probe.merit(length) for length in (-h, 0.0, h))
        scale = decrease + 1e-7 * abs(middle) / h
        assert abs((high - low) / (2 * h) + decrease) < 1e-5 * scale
        assert abs((high - 2 * middle + low) / h**2 - decrease) < 1e-3 * scale + 1e-6 / h


def test_a_wrong_gradient_would_be_seen(probe: Probe) -> None:
    """The same comparison fails when the plan is not the one that was modelled."""
    mu, h = options.COLD_BARRIER, 1e-4
    states = list(starts(probe, 2, mu))
    decrease, _ = probe.modelled(mu)
    probe.set_state(states[0][0], np.eye(3), states[0][1])
    probe.begin_slew(mu)
    slope = (probe.merit(h) - probe.merit(-h)) / (2 * h)
    assert abs(slope + decrease) > 1e-2 * decrease
