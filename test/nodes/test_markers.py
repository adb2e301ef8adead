# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The live view: what the markers show, that nobody's view costs nothing, what viewers load."""

from __future__ import annotations

import json

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, QuaternionStamped, Vector3, Vector3Stamped, WrenchStamped
from harness import CONFIG, Rig
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

from manifold_mpc_ros.config.cones import Cone
from manifold_mpc_ros.lie import so3
from manifold_mpc_ros.nodes.markers.shapes import Picture, markers
from manifold_mpc_ros.nodes.messages import to_quaternion

TOPIC = '/attitude_markers/markers'


def by_name(array: MarkerArray) -> dict[tuple[str, int], Marker]:
    assert array.markers[0].action == Marker.DELETEALL
    drawn = {(each.ns, each.id): each for each in array.markers[1:]}
    assert len(drawn) == len(array.markers) - 1
    return drawn


def tip(marker: Marker) -> list[float]:
    point = marker.points[1]
    return [point.x, point.y, point.z]


def test_nothing_known_nothing_drawn() -> None:
    assert by_name(markers(Picture('inertial'))) == {}


def test_everything() -> None:
    R_NB, R_ND = so3.exp(np.array([0.3, -0.4, 1.2])), so3.exp(np.array([0.0, 2.0, 0.0]))
    torque = np.array([0.1, 0.0, -0.2])
    drawn = by_name(markers(Picture(
        'inertial', 1_500_000_000, R_NB, R_ND, None, [Point(x=1.0), Point(y=1.0)], torque, 3.0)))
    assert set(drawn) == {('body', 0), ('torque', 0), ('prediction', 0), *(
        (name, index) for name in ('body_axes', 'setpoint') for index in range(3))}
    for index in range(3):
        assert tip(drawn['body_axes', index]) == pytest.approx(R_NB[:, index])
        assert tip(drawn['setpoint', index]) == pytest.approx(1.2 * R_ND[:, index])
    assert tip(drawn['torque', 0]) == pytest.approx(3.0 * R_NB @ torque)
    for marker in drawn.values():
        assert marker.header.frame_id == 'inertial'
        assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (1, 500_000_000)
        assert marker.color.a > 0.0
        assert marker.scale.x > 0.0
        assert marker.pose.orientation.w != 0.0


def test_a_direction_is_one_arrow() -> None:
    drawn = by_name(markers(Picture('inertial', direction_N=np.array([0.0, 0.6, 0.8]))))
    assert tip(drawn['setpoint', 3]) == pytest.approx([0.0, 0.72, 0.96])


def test_cones_are_drawn_about_their_directions_and_an_axis_inside_is_black() -> None:
    sun = Cone('sun', (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5)
    sensor = Cone('sensor', (0.0, 1.0, 0.0), (0.0, 1.0, 0.0), 2.0, 'keep_in')
    moved = np.array([0.6, 0.0, 0.8])
    drawn = by_name(markers(Picture(
        'inertial', R_NB=np.eye(3), cones=(sun, sensor), directions_N={'sun': moved})))
    assert {name for name in drawn if name[0] in ('cones', 'cone_edges', 'boresights')} == {
        (name, index) for name in ('cones', 'cone_edges', 'boresights') for index in (0, 1)}
    for index, (cone, s) in enumerate(((sun, moved), (sensor, sensor.direction_N))):
        edge = np.array([(p.x, p.y, p.z) for p in drawn['cone_edges', index].points])
        np.testing.assert_allclose(np.linalg.norm(edge, axis=1), 1.0)
        np.testing.assert_allclose(edge @ s, np.cos(cone.half_angle_rad))
        assert len(drawn['cones', index].points) == 3 * (len(edge) - 1)
        np.testing.assert_allclose(tip(drawn['boresights', index]), 1.15 * cone.axis_B)
    assert drawn['cones', 0].color.r > drawn['cones', 0].color.g  # red to stay out of
    assert drawn['cones', 1].color.r < drawn['cones', 1].color.g  # green to stay in
    assert drawn['boresights', 0].color.r > 0.0
    inside = by_name(markers(Picture(
        'inertial', R_NB=so3.exp([0.0, -0.9, 0.0]), cones=(sun,), directions_N={'sun': moved})))
    assert inside['boresights', 0].color.r == 0.0


def test_over_dds_only_while_somebody_looks(rig: Rig) -> None:
    rig.run(['manifold_mpc_ros.nodes.markers.main'])
    states = rig.node.create_publisher(Odometry, 'odometry', 10)
    setpoints = rig.node.create_publisher(QuaternionStamped, 'attitude_setpoint', 10)
    said: list[DiagnosticArray] = rig.watch(DiagnosticArray, '/diagnostics')
    rig.until(lambda: setpoints.get_subscription_count() > 0, 'the markers node')
    R_NB = so3.exp(np.array([0.0, 0.0, 0.7]))
    count = 0

    def publish() -> None:
        nonlocal count
        count += 1
        state = Odometry(child_frame_id='base_link')
        state.header.frame_id, state.header.stamp.sec = 'inertial', count
        state.pose.pose.orientation = to_quaternion(R_NB)
        states.publish(state)
        setpoint = QuaternionStamped(quaternion=to_quaternion(np.eye(3)))
        setpoint.header.frame_id = 'inertial'
        setpoints.publish(setpoint)

    def latest(key: str) -> str:
        values = {pair.key: pair.value for array in said for status in array.status
                  for pair in status.values if status.name == 'attitude_markers'}
        return values.get(key, '')

    rig.until(lambda: count > 30 and latest('mode') == 'RUN', 'states', meanwhile=publish)
    assert latest('pictures') == '0'
    assert states.get_subscription_count() == 0
    seen: list[MarkerArray] = rig.watch(MarkerArray, TOPIC)
    wanted = {('setpoint', 0), ('body_axes', 0)}
    rig.until(lambda: bool(seen) and wanted <= set(by_name(seen[-1])), 'markers',
              meanwhile=publish)
    assert tip(by_name(seen[-1])['body_axes', 0]) == pytest.approx(R_NB[:, 0])
    # What the controller says of itself brings cones, and their topics directions.
    said_by_controller = rig.node.create_publisher(
        String, 'attitude_controller/description', QoSProfile(
            depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    said_by_controller.publish(String(data=json.dumps({'parameters': {
        'cones.names': ['sun'], 'cones.sun.axis_B': [1.0, 0.0, 0.0],
        'cones.sun.half_angle_deg': 20.0, 'cones.sun.kind': 'keep_out', 'cones.sun.group': 'none',
        'cones.sun.direction_N': [0.0, 0.0, 1.0], 'cones.sun.direction_topic': 'sun_direction',
        'cones.sun.direction_timeout_s': 60.0}})))
    sun = rig.node.create_publisher(Vector3Stamped, 'sun_direction', 10)
    message = Vector3Stamped(vector=Vector3(x=0.0, y=2.0, z=0.0))
    message.header.frame_id = 'inertial'

    def there() -> bool:
        edge = by_name(seen[-1]).get(('cone_edges', 0))
        return edge is not None and min(point.y for point in edge.points) > 0.9

    rig.until(there, 'the cone at its direction',
              meanwhile=lambda: (publish(), sun.publish(message)))  # type: ignore[arg-type]
    rig.until(lambda: latest('pictures') not in ('', '0'), 'the count', meanwhile=publish)
    assert states.get_subscription_count() == 1


def test_viewers_look_at_topics_that_exist() -> None:
    rviz = yaml.safe_load((CONFIG / 'attitude.rviz').read_text(encoding='utf-8'))
    displays = rviz['Visualization Manager']['Displays']
    topics = [each['Topic']['Value'] for each in displays if 'Topic' in each]
    assert topics == [TOPIC]
    assert rviz['Visualization Manager']['Global Options']['Fixed Frame'] == 'inertial'
    layout = json.loads((CONFIG / 'attitude.foxglove.json').read_text(encoding='utf-8'))
    panels = layout['configById']
    assert set(panels) == set(placed(layout['layout']))
    assert list(panels['3D!attitude']['topics']) == [TOPIC]
    paths = [path['value'] for panel in panels.values() for path in panel.get('paths', ())]
    assert {path.split('.')[0] for path in paths} == {'/odometry', '/torque_command'}
    for path in paths:
        topic, *fields = path.split('.')
        message = {'/odometry': Odometry, '/torque_command': WrenchStamped}[topic]()
        for field in fields:
            message = getattr(message, field)
        assert isinstance(message, float)


def placed(layout: object) -> list[str]:
    """Return the panels of a layout, which is a tree."""
    if isinstance(layout, str):
        return [layout]
    assert isinstance(layout, dict)
    return placed(layout['first']) + placed(layout['second'])
