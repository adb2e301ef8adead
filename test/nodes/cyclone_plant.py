# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A spacecraft that knows nothing of ROS: Eclipse Cyclone DDS, and Euler's equations by RK4.

``python cyclone_plant.py DOMAIN`` starts at rest, 180 degrees from identity, moves on by a step
for each torque that answers its last state, and says as JSON how that went. (The library reads
annotations as they stand: none of them may be a text.)
"""

import json
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import cyclone
import numpy as np
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int32, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

INERTIA_KG_M2 = np.array([1.0, 0.9, 0.6])
STEP_S, SUBSTEPS = 0.5, 50
SETTLED_RAD, SETTLED_RAD_S, SETTLED_STEPS = math.radians(0.1), 1e-3, 10
PATIENCE_S, REPEAT_S, MOST_STEPS = 90.0, 1.0, 120


@dataclass
class Time(IdlStruct, typename='builtin_interfaces::msg::dds_::Time_'):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename='std_msgs::msg::dds_::Header_'):
    stamp: Time = field(default_factory=Time)
    frame_id: str = ''


@dataclass
class Vector3(IdlStruct, typename='geometry_msgs::msg::dds_::Vector3_'):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename='geometry_msgs::msg::dds_::Quaternion_'):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Pose(IdlStruct, typename='geometry_msgs::msg::dds_::Pose_'):
    position: Vector3 = field(default_factory=Vector3)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class Pair(IdlStruct, typename='geometry_msgs::msg::dds_::Twist_'):
    """A twist or, in the same bytes, a wrench."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class PoseCovariance(IdlStruct, typename='geometry_msgs::msg::dds_::PoseWithCovariance_'):
    pose: Pose = field(default_factory=Pose)
    covariance: array[float64, 36] = field(default_factory=lambda: [0.0] * 36)


@dataclass
class TwistCovariance(IdlStruct, typename='geometry_msgs::msg::dds_::TwistWithCovariance_'):
    twist: Pair = field(default_factory=Pair)
    covariance: array[float64, 36] = field(default_factory=lambda: [0.0] * 36)


@dataclass
class Odometry(IdlStruct, typename='nav_msgs::msg::dds_::Odometry_'):
    header: Header
    child_frame_id: str
    pose: PoseCovariance
    twist: TwistCovariance


@dataclass
class WrenchStamped(IdlStruct, typename='geometry_msgs::msg::dds_::WrenchStamped_'):
    header: Header
    wrench: Pair


def derivative(state: np.ndarray, tau_B_n_m: np.ndarray) -> np.ndarray:
    """Return d/dt of quaternion (w, x, y, z; body to inertial) and body rate."""
    (w, *v), omega = state[:4], state[4:]
    turning = [-np.dot(v, omega), *(w * omega + np.cross(v, omega))]
    momentum = INERTIA_KG_M2 * omega
    return np.concatenate([
        0.5 * np.array(turning), (np.cross(momentum, omega) + tau_B_n_m) / INERTIA_KG_M2])


def moved(state: np.ndarray, tau_B_n_m: np.ndarray) -> np.ndarray:
    """Return the state one control step later, the torque held."""
    h = STEP_S / SUBSTEPS
    for _ in range(SUBSTEPS):
        k1 = derivative(state, tau_B_n_m)
        k2 = derivative(state + h / 2 * k1, tau_B_n_m)
        k3 = derivative(state + h / 2 * k2, tau_B_n_m)
        k4 = derivative(state + h * k3, tau_B_n_m)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        state[:4] /= np.linalg.norm(state[:4])
    return state


def is_settled(state: np.ndarray) -> bool:
    """Whether the body is at rest at identity."""
    angle = 2.0 * math.atan2(np.linalg.norm(state[1:4]), abs(state[0]))
    return angle < SETTLED_RAD and float(np.linalg.norm(state[4:])) < SETTLED_RAD_S


class Wire:
    """The two topics, under the names that ROS gives them."""

    def __init__(self, domain: int) -> None:
        participant = DomainParticipant(domain)
        self._states = DataWriter(participant, Topic(
            participant, 'rt/odometry', Odometry, qos=cyclone.RELIABLE), qos=cyclone.RELIABLE)
        self._torques = DataReader(participant, Topic(
            participant, 'rt/torque_command', WrenchStamped, qos=cyclone.RELIABLE),
            qos=cyclone.RELIABLE)

    def ask(self, stamp: Time, state: np.ndarray) -> np.ndarray:
        """Publish a state until a torque with its stamp comes; return the torque."""
        message = _odometry(stamp, state)
        end_s, said_s = time.monotonic() + PATIENCE_S, -math.inf
        while time.monotonic() < end_s:
            if time.monotonic() - said_s > REPEAT_S:
                self._states.write(message)
                said_s = time.monotonic()
            for answer in self._torques.take(10):
                if answer.header.stamp == stamp:
                    torque = answer.wrench.angular
                    return np.array([torque.x, torque.y, torque.z])
            time.sleep(0.001)
        raise SystemExit(f'no torque answers the state of {stamp}')


def _odometry(stamp: Time, state: Sequence[float]) -> Odometry:
    """Return the message of a state."""
    w, x, y, z, *omega = map(float, state)
    return Odometry(Header(stamp, 'inertial'), 'base_link',
                    PoseCovariance(Pose(orientation=Quaternion(x, y, z, w))),
                    TwistCovariance(Pair(angular=Vector3(*omega))))


def main(domain: int) -> None:
    """Close the loop until the body has been at rest for a while, or for a number of steps."""
    wire, state = Wire(domain), np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    torques: list[np.ndarray] = []
    rates: list[np.ndarray] = []
    at_rest = 0
    while at_rest < SETTLED_STEPS and len(torques) < MOST_STEPS:
        ticks = 2 + len(torques)  # half seconds; zero means no time in ROS
        torques.append(wire.ask(Time(ticks // 2, ticks % 2 * 500_000_000), state))
        state = moved(state, torques[-1])
        rates.append(state[4:])
        at_rest = at_rest + 1 if is_settled(state) else 0
    print(json.dumps({
        'settled': at_rest == SETTLED_STEPS, 'after_s': STEP_S * (len(torques) - at_rest),
        'largest_torque_n_m': float(np.abs(torques).max()),
        'largest_rate_rad_s': float(np.abs(rates).max())}))


if __name__ == '__main__':
    main(int(sys.argv[1]))
