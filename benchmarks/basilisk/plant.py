# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A spacecraft in Basilisk, stepped by requests on the standard input; needs nothing of ours.

    ENVIRONMENT/bin/python plant.py

One JSON object a line in and out. The first line describes the spacecraft (`Spacecraft`), each
further one asks for one control period (`Spacecraft.advance`); the answer is the state at its end.
Attitudes are Basilisk's MRP sigma_BN, rates omega_BN_B in body axes [rad/s]. What Basilisk prints
goes to the standard error.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from Basilisk.architecture import messaging
from Basilisk.fswAlgorithms import attTrackingError, mrpFeedback, rwMotorTorque
from Basilisk.simulation import (
    GravityGradientEffector,
    extForceTorque,
    reactionWheelStateEffector,
    spacecraft,
    thrusterDynamicEffector,
)
from Basilisk.utilities import (
    SimulationBaseClass,
    macros,
    simIncludeGravBody,
    simIncludeRW,
    simIncludeThruster,
)
from sensors import Sensors

DYNAMICS, SENSORS, FLIGHT_SOFTWARE = 'dynamics', 'sensors', 'flight software'
#: Wheels creep in Basilisk's friction below this speed, where friction falls to zero [rad/s].
CREEP_RAD_S = 1e-3
Given = Mapping[str, Any]
Numbers = Sequence[float]


def column(values: Numbers) -> list[list[float]]:
    """Return numbers as the column that Basilisk's states are."""
    return [[float(value)] for value in values]


class Spacecraft:
    """A rigid hub with what ``given`` names.

    ``hub_inertia_kg_m2`` (9), ``sigma_BN``, ``omega_BN_B`` [rad/s], ``step_s`` of the integration
    (RK4), ``sample_s`` between looks at the rate, ``period_s`` of control; ``position_N_m`` and
    ``velocity_N_m_s``: the orbit, on which gravity gradient acts; one of ``max_torque_n_m`` (3),
    ``wheels`` and ``thrusters``; ``noise`` of what is measured, standard deviations
    ``attitude_rad`` and ``rate_rad_s`` about each axis; ``law``: gains of mrpFeedback, which then
    commands the wheels in place of the requests, and its first ``reference``.
    """

    def __init__(self, given: Given) -> None:
        """Build the simulation and put it to time zero."""
        self._period_s = given['period_s']
        self._sample_ns = macros.sec2nano(given['sample_s'])
        self._sim = SimulationBaseClass.SimBaseClass()
        process = self._sim.CreateNewProcess('process')
        process.addTask(self._sim.CreateNewTask(
            DYNAMICS, macros.sec2nano(given['step_s'])), 3)
        self._hub = spacecraft.Spacecraft()
        self._hub.ModelTag = 'hub'
        self._hub.hub.mHub = 12.0
        self._hub.hub.r_BcB_B = column([0.0, 0.0, 0.0])
        self._hub.hub.IHubPntBc_B = np.reshape(given['hub_inertia_kg_m2'], (3, 3)).tolist()
        self._hub.hub.sigma_BNInit = column(given['sigma_BN'])
        self._hub.hub.omega_BN_BInit = column(given['omega_BN_B'])
        self._add(self._hub, 10)
        self._limit = np.array(given.get('max_torque_n_m', np.inf))
        self._wheels, self._thrusters = given.get('wheels'), given.get('thrusters')
        self._effectors: list[Any] = []
        self._disturbance = self._external('disturbance')
        if self._wheels:
            self._add_wheels(self._wheels)
        elif self._thrusters:
            self._add_thrusters(self._thrusters)
        else:
            self._command = self._external('torque')
        if 'position_N_m' in given:
            self._add_orbit(given)
        self._reference = None
        self._add_sensors(given.get('noise'), process)
        if 'law' in given:
            self._add_law(given['law'], given['hub_inertia_kg_m2'])
        self._sim.InitializeSimulation()
        self._peak = np.zeros(3)
        self._now_ns = 0
        if self._reference is not None:
            self._aim(given['reference'])
        self._execute(0)

    def advance(self, asked: Given) -> dict[str, Any]:
        """Move on by a control period under a ``command`` that is held; return the state then.

        The command is a body torque (3,) [N m], motor torques (n,) [N m], or on-times (n,) [s].
        ``disturbance_B_n_m`` (3,) acts beside it. With a law ``reference``
        (sigma_RN, omega_RN_N, domega_RN_N) is that of the end, where the law acts again, and there
        is no command. ``peak_rate_rad_s`` is the largest of each body rate on the way.
        """
        if self._reference is not None:
            self._aim(asked['reference'])
        else:
            self._order(np.array(asked['command'], dtype=float))
        self._write_torque(self._disturbance, asked.get('disturbance_B_n_m', [0.0] * 3))
        end_ns = self._now_ns + macros.sec2nano(self._period_s)
        self._peak = np.zeros(3)
        while self._now_ns < end_ns:
            self._execute(min(end_ns, self._now_ns + self._sample_ns))
            self._peak = np.maximum(self._peak, np.abs(self._state().omega_BN_B))
        return self.answer()

    def answer(self) -> dict[str, Any]:
        """Return the state of now."""
        state, measured = self._state(), self._sensors.measured.read()
        answer = {'time_s': self._now_ns * macros.NANO2SEC, 'sigma_BN': list(state.sigma_BN),
                  'omega_BN_B': list(state.omega_BN_B), 'position_N_m': list(state.r_CN_N),
                  'measured_sigma_BN': list(measured.sigma_BN),
                  'measured_omega_BN_B': list(measured.omega_BN_B),
                  'peak_rate_rad_s': self._peak.tolist()}
        if self._wheels:
            count = len(self._wheels['axes_B'])
            answer['wheel_speed_rad_s'] = list(self._effector.rwSpeedOutMsg.read().wheelSpeeds)[
                :count]
            answer['motor_torque_n_m'] = [
                message.read().u_current for message in self._effector.rwOutMsgs]
        return answer

    def _state(self) -> Any:
        """Return the message of the state."""
        return self._hub.scStateOutMsg.read()

    def _execute(self, until_ns: int) -> None:
        """Let every task run up to a time, that included."""
        self._sim.ConfigureStopTime(until_ns)
        self._sim.ExecuteSimulation()
        self._now_ns = until_ns

    def _add(self, model: Any, priority: int, task: str = DYNAMICS) -> None:
        """Add a model to a task; the highest priority runs first."""
        self._sim.AddModelToTask(task, model, priority)

    def _external(self, name: str) -> Any:
        """Return the message of a body torque that acts on the hub."""
        effector = extForceTorque.ExtForceTorque()
        effector.ModelTag = name
        message = messaging.CmdTorqueBodyMsg().write(messaging.CmdTorqueBodyMsgPayload())
        effector.cmdTorqueInMsg.subscribeTo(message)
        self._hub.addDynamicEffector(effector)
        self._add(effector, 20)
        self._effectors.append(effector)
        return message

    def _write_torque(self, message: Any, torque_B_n_m: Any) -> None:
        """Let a body torque (3,) act from now on."""
        message.write(messaging.CmdTorqueBodyMsgPayload(
            torqueRequestBody=[float(each) for each in torque_B_n_m]), self._now_ns)

    def _order(self, command: Any) -> None:
        """Put a command in force."""
        if self._wheels:
            self._command.write(messaging.ArrayMotorTorqueMsgPayload(
                motorTorque=command.tolist()), self._now_ns)
        elif self._thrusters:
            # What has the stamp of the last one, 0 at first, is taken for the same command.
            self._command.write(messaging.THRArrayOnTimeCmdMsgPayload(
                OnTimeRequest=command.tolist()), self._now_ns + 1)
        else:
            self._write_torque(self._command, np.clip(command, -self._limit, self._limit))

    def _add_wheels(self, given: Given) -> None:
        """Add reaction wheels with Coulomb friction: ``axes_B`` and a number each for all."""
        self._factory = simIncludeRW.rwFactory()
        for axis, speed in zip(given['axes_B'], given['speed_rad_s']):
            wheel = self._factory.create(
                'custom', axis, Js=given['inertia_kg_m2'], u_max=given['max_torque_n_m'],
                Omega_max=given['max_speed_rad_s'] / macros.RPM, Omega=speed / macros.RPM,
                RWModel=messaging.BalancedWheels, useRWfriction=True,
                fCoulomb=given['coulomb_friction_n_m'])
            wheel.betaStatic = -1.0  # no Stribeck
            wheel.omegaLimitCycle = CREEP_RAD_S
        self._effector = reactionWheelStateEffector.ReactionWheelStateEffector()
        self._factory.addToSpacecraft('wheels', self._effector, self._hub)
        self._add(self._effector, 20)
        self._command = messaging.ArrayMotorTorqueMsg().write(
            messaging.ArrayMotorTorqueMsgPayload())
        self._effector.rwMotorCmdInMsg.subscribeTo(self._command)

    def _add_thrusters(self, given: Given) -> None:
        """Add on/off thrusters: ``positions_B_m``, ``directions_B`` and a number each for all."""
        self._effector = thrusterDynamicEffector.ThrusterDynamicEffector()
        factory = simIncludeThruster.thrusterFactory()
        for position, direction in zip(given['positions_B_m'], given['directions_B']):
            factory.create('Blank_Thruster', position, direction, MaxThrust=given['force_n'],
                           MinOnTime=given['min_on_time_s'],
                           steadyIsp=given['specific_impulse_s'])
        factory.addToSpacecraft('thrusters', self._effector, self._hub)
        self._add(self._effector, 20)
        self._command = messaging.THRArrayOnTimeCmdMsg().write(
            messaging.THRArrayOnTimeCmdMsgPayload())
        self._effector.cmdsInMsg.subscribeTo(self._command)

    def _add_orbit(self, given: Given) -> None:
        """Add the Earth as a point, and its gravity gradient on the hub."""
        factory = simIncludeGravBody.gravBodyFactory()
        earth = factory.createEarth()
        earth.isCentralBody = True
        factory.addBodiesTo(self._hub)
        self._hub.hub.r_CN_NInit = column(given['position_N_m'])
        self._hub.hub.v_CN_NInit = column(given['velocity_N_m_s'])
        gradient = GravityGradientEffector.GravityGradientEffector()
        gradient.addPlanetName(earth.planetName)
        self._hub.addDynamicEffector(gradient)
        self._add(gradient, 20)
        self._effectors.append(gradient)

    def _add_sensors(self, noise: Given | None, process: Any) -> None:
        """Add what measures the state every control period, and the task of what hears it."""
        for task, priority in ((SENSORS, 2), (FLIGHT_SOFTWARE, 1)):
            process.addTask(self._sim.CreateNewTask(
                task, macros.sec2nano(self._period_s)), priority)
        self._sensors = Sensors(self._hub.scStateOutMsg, noise)
        self._add(self._sensors, 10, SENSORS)

    def _add_law(self, gains: Given, inertia_kg_m2: Numbers) -> None:
        """Add Basilisk's tracking error, feedback law and torques of motors."""
        self._reference = messaging.AttRefMsg().write(messaging.AttRefMsgPayload())
        error = attTrackingError.attTrackingError()
        error.attNavInMsg.subscribeTo(self._sensors.measured)
        error.attRefInMsg.subscribeTo(self._reference)
        feedback, motors = mrpFeedback.mrpFeedback(), rwMotorTorque.rwMotorTorque()
        self._vehicle = messaging.VehicleConfigMsg().write(
            messaging.VehicleConfigMsgPayload(ISCPntB_B=inertia_kg_m2))
        feedback.guidInMsg.subscribeTo(error.attGuidOutMsg)
        feedback.vehConfigInMsg.subscribeTo(self._vehicle)
        self._array = self._factory.getConfigMessage()
        feedback.rwParamsInMsg.subscribeTo(self._array)
        feedback.rwSpeedsInMsg.subscribeTo(self._effector.rwSpeedOutMsg)
        feedback.K, feedback.P, feedback.Ki = (gains[name] for name in ('K', 'P', 'Ki'))
        feedback.integralLimit = gains['integral_limit']
        motors.controlAxes_B = np.eye(3).ravel().tolist()
        motors.vehControlInMsg.subscribeTo(feedback.cmdTorqueOutMsg)
        motors.rwParamsInMsg.subscribeTo(self._array)
        self._effector.rwMotorCmdInMsg.subscribeTo(motors.rwMotorTorqueOutMsg)
        self._law = (error, feedback, motors)
        for priority, (name, model) in enumerate(zip(
                ('error', 'feedback', 'motors'), self._law)):
            model.ModelTag = name
            self._add(model, 10 - priority, FLIGHT_SOFTWARE)

    def _aim(self, reference: Sequence[Numbers]) -> None:
        """Say where the law aims at from now on."""
        sigma_RN, omega_RN_N, domega_RN_N = reference
        self._reference.write(messaging.AttRefMsgPayload(
            sigma_RN=sigma_RN, omega_RN_N=omega_RN_N, domega_RN_N=domega_RN_N), self._now_ns)


def main() -> None:
    """Answer line by line."""
    answers = os.fdopen(os.dup(1), 'w', encoding='utf-8')
    os.dup2(2, 1)
    plant = None
    for line in sys.stdin:
        asked = json.loads(line)
        if plant is None:
            plant = Spacecraft(asked)
            answer = plant.answer()
        else:
            answer = plant.advance(asked)
        answers.write(json.dumps(answer) + '\n')
        answers.flush()


if __name__ == '__main__':
    main()
