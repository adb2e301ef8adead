# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The closed loop as markers for RViz and Foxglove: body, axes, setpoint, plan, torque, cones.

Everything is drawn about the origin of the inertial frame; axes have length 1. Namespace and
number of a marker are the same in every message, so each message replaces the one before.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.lie.arrays import Array
from manifold_mpc_ros.nodes.messages import to_quaternion, to_stamp

#: Blue, vermilion and bluish green (Okabe and Ito) for x, y and z, as in every picture here.
AXIS_COLOURS = ((0.0, 0.447, 0.698), (0.835, 0.369, 0.0), (0.0, 0.620, 0.451))
BODY_COLOUR, TORQUE_COLOUR = (0.79, 0.83, 0.87), (0.71, 0.09, 0.62)
PREDICTION_COLOUR = (0.90, 0.62, 0.0)
KEEP_OUT_COLOUR, KEEP_IN_COLOUR = (0.84, 0.15, 0.16), (0.0, 0.620, 0.451)
#: Edges of the box that stands for the body.
BODY_SIZE = (0.55, 0.4, 0.3)
_SHAFT, _HEAD = 0.03, 0.07


@dataclass
class Picture:
    """What is known of the loop; what is None (or empty) is not drawn."""

    inertial_frame_id: str
    stamp_ns: int = 0
    R_NB: Array | None = None
    R_ND: Array | None = None            # commanded attitude
    direction_N: Array | None = None     # commanded direction
    prediction_N: Sequence[Point] = ()        # the predicted path of a body axis on the sphere
    torque_B_n_m: Array | None = None
    torque_length_per_n_m: float = 1.0
    cones: Sequence[Cone] = ()
    directions_N: Mapping[str, Array] = field(default_factory=dict)  # that have come, by cone


def markers(picture: Picture) -> MarkerArray:
    """Return the markers of everything that is known; the rest is removed from the viewer."""
    array = MarkerArray()
    array.markers.append(_marker(picture, 'everything', 0, Marker.ARROW, (0.0, 0.0, 0.0)))
    array.markers[0].action = Marker.DELETEALL
    array.markers.extend(_drawn(picture))
    return array


def _drawn(picture: Picture) -> Iterator[Marker]:
    """Yield a marker for each thing."""
    if picture.R_NB is not None:
        body = _marker(picture, 'body', 0, Marker.CUBE, BODY_COLOUR)
        body.pose.orientation = to_quaternion(picture.R_NB)
        body.scale.x, body.scale.y, body.scale.z = BODY_SIZE
        yield body
        for index, colour in enumerate(AXIS_COLOURS):
            yield _arrow(picture, 'body_axes', index, picture.R_NB[:, index], colour)
        if picture.torque_B_n_m is not None and np.any(picture.torque_B_n_m):
            torque_N = picture.R_NB @ picture.torque_B_n_m
            yield _arrow(picture, 'torque', 0, torque_N * picture.torque_length_per_n_m,
                         TORQUE_COLOUR)
    if picture.R_ND is not None:
        for index, colour in enumerate(AXIS_COLOURS):
            yield _arrow(picture, 'setpoint', index, 1.2 * picture.R_ND[:, index], colour, 0.35)
    if picture.direction_N is not None:
        yield _arrow(picture, 'setpoint', 3, 1.2 * picture.direction_N, BODY_COLOUR, 0.6)
    if len(picture.prediction_N) > 1:
        line = _marker(picture, 'prediction', 0, Marker.LINE_STRIP, PREDICTION_COLOUR)
        line.scale.x, line.points = 0.015, list(picture.prediction_N)
        yield line
    for number, cone in enumerate(picture.cones):
        yield from _cone(picture, number, cone)


def _cone(picture: Picture, number: int, cone: Cone) -> Iterator[Marker]:
    """Yield a cone, its edge on the unit sphere, and the body axis that it is for.

    The axis is thick and longer than the sphere; black while the cone is violated.
    """
    colour = KEEP_OUT_COLOUR if cone.kind == 'keep_out' else KEEP_IN_COLOUR
    s = picture.directions_N.get(cone.name, cone.direction_N)
    one = np.linalg.svd(s[None])[2][1]
    turn = np.linspace(0.0, 2.0 * np.pi, 49)[:, None]
    around = np.cos(turn) * one + np.sin(turn) * np.cross(s, one)
    rim = np.cos(cone.half_angle_rad) * s + np.sin(cone.half_angle_rad) * around
    points = [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in rim]
    surface = _marker(picture, 'cones', number, Marker.TRIANGLE_LIST, colour, 0.25)
    surface.scale.x = surface.scale.y = surface.scale.z = 1.0
    for pair in itertools.pairwise(points):
        surface.points += [Point(), *pair]
    yield surface
    edge = _marker(picture, 'cone_edges', number, Marker.LINE_STRIP, colour)
    edge.scale.x, edge.points = 0.012, points
    yield edge
    if picture.R_NB is not None:
        violated = cone.margins_rad(picture.R_NB, s) < 0.0
        yield _arrow(picture, 'boresights', number, 1.15 * picture.R_NB @ cone.axis_B,
                     (0.0, 0.0, 0.0) if violated else colour)


def _arrow(
    picture: Picture, namespace: str, number: int, tip_N: Array,
    colour: Sequence[float], opacity: float = 1.0,
) -> Marker:
    """Return an arrow from the origin."""
    marker = _marker(picture, namespace, number, Marker.ARROW, colour, opacity)
    x, y, z = map(float, tip_N)
    marker.points = [Point(), Point(x=x, y=y, z=z)]
    marker.scale.x, marker.scale.y, marker.scale.z = _SHAFT, _HEAD, 0.0
    return marker


def _marker(
    picture: Picture, namespace: str, number: int, kind: int, colour: Sequence[float],
    opacity: float = 1.0,
) -> Marker:
    """Return a marker at the origin, without a size."""
    marker = Marker(ns=namespace, id=number, type=kind, action=Marker.ADD)
    marker.header.frame_id = picture.inertial_frame_id
    marker.header.stamp = to_stamp(picture.stamp_ns)
    marker.pose.orientation.w = 1.0
    red, green, blue = map(float, colour)
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=opacity)
    return marker
