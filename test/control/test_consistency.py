# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States that contradict themselves are not acted on, and no true state is taken for one."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scripted import CONFIG, Script
from strategies import drawn_inertias

from manifold_mpc_ros.config.control_law import AttitudeMpcConfig
from manifold_mpc_ros.config.controller import ControllerConfig
from manifold_mpc_ros.config.parameter import resolve_parameters
from manifold_mpc_ros.config.tables import CONTROLLER_PARAMETERS
from manifold_mpc_ros.control.command import Command, Law
from manifold_mpc_ros.control.consistency import CONVENTIONS, MotionBounds
from manifold_mpc_ros.control.control_loop import ControlLoop
from manifold_mpc_ros.control.fallback_law import FallbackLaw
from manifold_mpc_ros.control.input_gate import RawState, StateGate
from manifold_mpc_ros.control.modes import Mode
from manifold_mpc_ros.control.solver_thread import DirectSolver, solve_with
from manifold_mpc_ros.control.tick_time import LOCKSTEP, ClockTime
from manifold_mpc_ros.dynamics.inertia import largest_guaranteed_rate
from manifold_mpc_ros.dynamics.lgvi import lgvi_step
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.mpc.solution import AttitudeMpcSolution

Array = np.ndarray
Read = Callable[[Array, Array], tuple[Array, Array]]

#: Closed loops that a property is tried on; the full number is 2000.
LOOPS = settings(
    max_examples=int(os.environ.get('PROPERTY_EXAMPLES', '10')), deadline=None, derandomize=True,
    database=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
SHIPPED = ControllerConfig.from_parameters(
    resolve_parameters(CONTROLLER_PARAMETERS, {
        'spacecraft.inertia_kg_m2': [1.0, 0.9, 0.6], 'mpc.step_s': 0.5, 'mpc.horizon': 20},
        complete=False))

YZX, Y_X_MINUS_Z = np.eye(3)[[1, 2, 0]], np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
#: What every alarm says.
WORDS = 'contradict each other'
#: How a wrong source reads a true attitude and body rate, and how that has to be named.
WRONG: dict[str, tuple[Read, str]] = {
    'parent frame': (lambda R, w: (R, R @ w), 'in the inertial (parent) frame'),
    'deg/s': (lambda R, w: (R, np.rad2deg(w)), 'in deg/s'),
    'sign': (lambda R, w: (R, -w), 'the rate has the opposite sign'),
    'inverse quaternion': (lambda R, w: (R.T, w), 'the quaternion is inverse (inertial to body)'),
    'inverse, parent frame': (
        lambda R, w: (R.T, R @ w), 'the quaternion is inverse (inertial to body) and the rate'),
    'rate axes': (lambda R, w: (R, YZX @ w), 'the body rate is (z, x, y) of the rate'),
    'attitude axes': (
        lambda R, w: (YZX @ R @ YZX.T, w), 'the body rate is (y, z, x) of the rate'),
    'other handed axes': (
        lambda R, w: (R, Y_X_MINUS_Z @ w), 'the body rate is (y, x, -z) of the rate'),
}


class Geometric(Script):
    """A solver that is cheap and turns the body to where it should be: the fallback law."""

    def __init__(self, config: AttitudeMpcConfig) -> None:
        super().__init__()
        self._law = FallbackLaw(config)

    def solve(
        self, R_NB: Array, omega_BN_B: Array, R_ND: Array | None = None, **given: Any,
    ) -> AttitudeMpcSolution:
        self.torque = self._law.torque(R_NB, omega_BN_B, np.eye(3) if R_ND is None else R_ND)
        return super().solve(R_NB, omega_BN_B, R_ND, **given)


@dataclasses.dataclass
class Link:
    """How states come: how often [Hz], how noisy [rad, rad/s], how many are lost, how late [s]."""

    hertz: float = 10.0
    attitude_noise_rad: float = 0.0
    rate_noise_rad_s: float = 0.0
    lost: float = 0.0
    latest_s: float = 0.0
    lockstep: bool = False
    seed: int = 0


class Flight:
    """A body, what its source says of it, and the controller that acts on that."""

    def __init__(
        self, R_NB: Array, omega_BN_B: Array, read: Read | None = None, link: Link | None = None,
        config: ControllerConfig = SHIPPED,
    ) -> None:
        self.R_NB, self.omega_BN_B = R_NB, omega_BN_B
        self._read, self._link = read or (lambda R, w: (R, w)), link or Link()
        self._rng = np.random.default_rng(self._link.seed)
        self._config = config = dataclasses.replace(config, lockstep=self._link.lockstep)
        law = Law(config.mpc, DirectSolver(solve_with(Geometric(config.mpc))),
                  config.state_timeout_s, motion=MotionBounds.from_config(config))
        gate = StateGate('inertial', 'base_link', step_s=config.mpc.step_s,
                         timeout_s=config.state_timeout_s, timed=not config.lockstep)
        self.loop = ControlLoop(law, gate, initial_setpoint='identity')
        self.commands: list[Command] = []
        self.rates: list[float] = []
        self._coming: list[tuple[int, RawState]] = []

    def fly(self, duration_s: float) -> None:
        """Fly on, to the latch at the latest."""
        step_s = self._config.mpc.step_s
        dt_s = step_s if self._config.lockstep else min(step_s, 1.0 / self._link.hertz)
        for k in range(round(duration_s / dt_s)):
            now_ns = 10**9 + round(k * dt_s * 1e9)
            self._sense(now_ns)
            if now_ns >= 10**9 + round(len(self.commands) * step_s * 1e9):
                at = LOCKSTEP if self._config.lockstep else ClockTime(now_ns)
                self.commands.append(self.loop.tick(at))
            if self.commands[-1].mode is Mode.FAULT:
                return
            self._turn(dt_s)

    def tick_by_tick(self, ticks: int, read: Read) -> list[str]:
        """Fly on in lockstep, read in a way; return the modes in the order in which they came."""
        self._read = read
        before = len(self.commands)
        for k in range(before, before + ticks):
            now_ns = 10**9 + round(k * self._config.mpc.step_s * 1e9)
            self._sense(now_ns)
            self.commands.append(self.loop.tick(LOCKSTEP))
            self._turn(self._config.mpc.step_s)
        return list(dict.fromkeys(command.mode.value for command in self.commands[before:]))

    def _sense(self, now_ns: int) -> None:
        """Send the present state, and receive what has come."""
        link, rng = self._link, self._rng
        R, omega = self._read(self.R_NB, self.omega_BN_B)
        R = R @ so3.exp(rng.normal(scale=link.attitude_noise_rad, size=3))
        omega = omega + rng.normal(scale=link.rate_noise_rad_s, size=3)
        w, x, y, z = so3.quaternion_from_rotation(R).tolist()
        if rng.random() >= link.lost:
            self._coming.append((now_ns + round(rng.uniform(0.0, link.latest_s) * 1e9), RawState(
                now_ns, 'inertial', 'base_link', (x, y, z, w), tuple(omega.tolist()))))
        here = sorted((each for each in self._coming if each[0] <= now_ns), key=lambda e: e[0])
        self._coming = [each for each in self._coming if each[0] > now_ns]
        for _, raw in here:
            self.loop.receive(raw, now_ns)

    def _turn(self, dt_s: float) -> None:
        """Move the body on, in steps that exist."""
        self.rates.append(float(np.linalg.norm(self.omega_BN_B)))
        J, torque = self._config.mpc.inertia_kg_m2, self.commands[-1].torque_B_n_m
        guard = largest_guaranteed_rate(J, dt_s)
        steps = int(np.ceil(4.0 * max(1.0, self.rates[-1] / guard)))
        for _ in range(steps):
            self.R_NB, self.omega_BN_B = lgvi_step(
                self.R_NB, self.omega_BN_B, torque, inertia_kg_m2=J, step_s=dt_s / steps)


def tilted(rng: np.random.Generator) -> Array:
    """Return an attitude that tells the frames apart: 50 to 150 degrees from the inertial."""
    while True:
        R = so3.random_rotations(rng, 1)[0]
        if 0.9 < so3.angle(R) < 2.6:
            return R


def spinning(rng: np.random.Generator, rate_rad_s: float) -> Array:
    """Return a rate whose components differ, so that axes can be told apart."""
    signs = rng.choice([1.0, -1.0], 3)
    omega = signs * rng.permutation([1.0, 0.6, 0.3]) * rng.uniform(0.9, 1.1, 3)
    return rate_rad_s * omega / np.linalg.norm(omega)


@pytest.mark.parametrize('kind', WRONG)
@LOOPS
@given(seed=st.integers(0, 2**32 - 1), rate=st.floats(0.15, 0.6), hertz=st.floats(10.0, 100.0),
       noise=st.sampled_from([0.0, 1e-5, 3e-4]))
def test_a_wrong_convention_is_stopped_and_named(
    kind: str, seed: int, rate: float, hertz: float, noise: float,
) -> None:
    """Within 2 s, at a rate grown by at most 20 %, and by its name."""
    rng, (read, words) = np.random.default_rng(seed), WRONG[kind]
    R_NB, omega = tilted(rng), spinning(rng, rate)
    if abs(np.dot(R_NB @ omega, omega)) > 0.8 * rate ** 2:
        return  # too near to the axis of the tilt: the frames agree on this rate
    flight = Flight(R_NB, omega, read, Link(hertz, noise, noise, seed=seed))
    flight.fly(2.01)
    last = flight.commands[-1]
    assert last.mode is Mode.FAULT
    assert words in last.reason
    assert max(flight.rates) <= 1.2 * rate
    assert not any(command.torque_B_n_m.any() for command in flight.commands)


@pytest.mark.parametrize('kind', WRONG)
def test_in_lockstep_it_takes_two_states_to_contradict_and_four_to_be_sure(kind: str) -> None:
    rng, (read, words) = np.random.default_rng(5), WRONG[kind]
    flight = Flight(tilted(rng), spinning(rng, 0.4), read, Link(lockstep=True))
    flight.fly(4.0)
    modes = [command.mode for command in flight.commands]
    waited = 3 if 'axes' in kind else 1
    assert modes == [Mode.WAIT] * waited + [Mode.COAST] * (4 - waited) + [Mode.FAULT]
    assert not any(command.torque_B_n_m.any() for command in flight.commands)
    assert words in flight.commands[-1].reason


@pytest.mark.parametrize('lockstep', [False, True])
def test_a_body_at_rest_is_acted_on_at_once_and_stopped_when_it_moves(lockstep: bool) -> None:
    rng, (read, words) = np.random.default_rng(5), WRONG['sign']
    flight = Flight(tilted(rng), np.zeros(3), read, Link(lockstep=lockstep))
    flight.fly(4.0)
    assert flight.commands[0].mode is Mode.NOMINAL
    assert flight.commands[-1].mode is Mode.FAULT
    assert words in flight.commands[-1].reason
    assert sum(command.torque_B_n_m.any() for command in flight.commands) <= 2


@st.composite
def links(draw: st.DrawFn) -> Link:
    """Draw a link, from none of its faults to all of them."""
    def noise(largest: float) -> float:
        return draw(st.just(0.0) | st.floats(-5.0, np.log10(largest)).map(lambda x: 10.0 ** x))
    return Link(draw(st.sampled_from([2.0, 10.0, 25.0, 100.0])), noise(0.05), noise(0.1),
                draw(st.sampled_from([0.0, 0.1, 0.5])), draw(st.sampled_from([0.0, 0.06, 0.3])),
                draw(st.booleans()), draw(st.integers(0, 2**32 - 1)))


@st.composite
def bodies(draw: st.DrawFn) -> ControllerConfig:
    """Draw a body with its torque limits, or without."""
    J = draw(drawn_inertias())
    step_s = draw(st.sampled_from([0.05, 0.2, 0.5]))
    limit = np.full(3, float(np.linalg.eigvalsh(J)[0]) * draw(st.floats(0.05, 0.5)))
    mpc = dataclasses.replace(CONFIG, inertia_kg_m2=J, step_s=step_s,
                              max_torque_n_m=None if draw(st.booleans()) else limit)
    return dataclasses.replace(SHIPPED, mpc=mpc)


@LOOPS
@given(link=links(), config=bodies(), speed=st.sampled_from([0.0, 0.1, 0.5, 2.0, 8.0]))
def test_no_true_state_is_taken_for_a_contradiction(
    link: Link, config: ControllerConfig, speed: float,
) -> None:
    """Closed loops with noise that nobody declared, tumbling, lost, late and swapped messages."""
    rng = np.random.default_rng(link.seed)
    flight = Flight(so3.random_rotations(rng, 1)[0], speed * spinning(rng, 1.0), link=link,
                    config=config)
    flight.fly(4.0)
    assert not [command.reason for command in flight.commands if WORDS in command.reason]


@pytest.mark.parametrize('read', [
    lambda R, w: (R, w), lambda _R, w: (np.eye(3), w), lambda R, w: (R, 2.0 * w),
    lambda R, w: (R, w + 0.05)], ids=['true', 'frozen attitude', 'twice the rate', 'biased'])
def test_what_no_convention_explains_is_no_alarm(read: Read) -> None:
    flight = Flight(so3.exp([0.4, 0.2, -0.3]), np.array([0.1, 0.2, -0.15]), read)
    flight.fly(10.0)
    assert {command.mode for command in flight.commands} <= {Mode.WAIT, Mode.NOMINAL}


def test_a_contradiction_that_ends_gives_the_torque_back_and_a_reset_ends_a_latched_one() -> None:
    rng = np.random.default_rng(3)
    wrong, right = WRONG['inverse quaternion'][0], lambda R, w: (R, w)
    flight = Flight(tilted(rng), spinning(rng, 0.4), link=Link(lockstep=True))
    assert flight.tick_by_tick(3, right) == ['WAIT', 'NOMINAL']
    assert flight.tick_by_tick(3, wrong) == ['NOMINAL', 'COAST']  # nothing explains the jump
    assert flight.tick_by_tick(10, right) == ['COAST', 'NOMINAL']
    assert flight.tick_by_tick(8, wrong) == ['NOMINAL', 'COAST', 'FAULT']
    assert flight.tick_by_tick(8, right) == ['FAULT']
    flight.loop.reset()
    assert flight.tick_by_tick(3, right) == ['WAIT', 'NOMINAL']


def test_no_two_conventions_have_the_same_words() -> None:
    assert len({convention.words for convention in CONVENTIONS}) == len(CONVENTIONS) == 52
