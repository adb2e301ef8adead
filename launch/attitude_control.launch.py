# Copyright 2026 The manifold_mpc_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Start the attitude controller, and a simulated spacecraft unless there is a real one.

ros2 launch manifold_mpc_ros attitude_control.launch.py namespace:=sat1 with_simulator:=false
ros2 launch manifold_mpc_ros attitude_control.launch.py rviz:=true
ros2 launch manifold_mpc_ros attitude_control.launch.py namespace:=sat1 enclaves:=/sat1
"""

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from launch import LaunchDescription

PACKAGE = 'manifold_mpc_ros'
RESPAWN_DELAY_S = 0.5


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and the nodes, which configure and activate themselves."""
    simulated_time = ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool)
    return LaunchDescription([
        DeclareLaunchArgument(
            'namespace', default_value='', description='namespace of both nodes'),
        DeclareLaunchArgument(
            'enclaves', default_value='',
            description='where the enclaves attitude_controller, lgvi_simulator and '
                        'attitude_markers are in the keystore, like /sat1'),
        DeclareLaunchArgument(
            'controller_params', default_value=_shipped('controller.yaml'),
            description='parameter file of the controller'),
        DeclareLaunchArgument(
            'simulator_params', default_value=_shipped('simulator.yaml'),
            description='parameter file of the simulator'),
        DeclareLaunchArgument(
            'use_sim_time', default_value='false',
            description='the controller follows /clock, and the simulator publishes it'),
        DeclareLaunchArgument(
            'with_simulator', default_value='true',
            description='start the simulated spacecraft too'),
        DeclareLaunchArgument(
            'respawn', default_value='false',
            description='start a node again when it has ended'),
        DeclareLaunchArgument(
            'markers', default_value='true',
            description='start the node that draws for RViz and Foxglove, when they look'),
        DeclareLaunchArgument(
            'rviz', default_value='false',
            description='start RViz too (topics without a namespace)'),
        Node(
            package=PACKAGE, executable='controller', output='screen',
            ros_arguments=_enclave('attitude_controller'),
            respawn=LaunchConfiguration('respawn'), respawn_delay=RESPAWN_DELAY_S,
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('controller_params'),
                        {'use_sim_time': simulated_time}]),
        Node(
            package=PACKAGE, executable='simulator', output='screen',
            ros_arguments=_enclave('lgvi_simulator'),
            respawn=LaunchConfiguration('respawn'), respawn_delay=RESPAWN_DELAY_S,
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('simulator_params'),
                        {'timing.publish_clock': simulated_time}],
            condition=IfCondition(LaunchConfiguration('with_simulator'))),
        Node(
            package=PACKAGE, executable='markers', output='screen',
            ros_arguments=_enclave('attitude_markers'),
            namespace=LaunchConfiguration('namespace'),
            parameters=[{'use_sim_time': simulated_time}],
            condition=IfCondition(LaunchConfiguration('markers'))),
        Node(
            package='rviz2', executable='rviz2',
            arguments=['-d', _shipped('attitude.rviz')],
            parameters=[{'use_sim_time': simulated_time}],
            condition=IfCondition(LaunchConfiguration('rviz'))),
    ])


def _enclave(node: str) -> list[object]:
    """Return the arguments that put a node into the enclave of its name; only security looks."""
    return ['--enclave', [LaunchConfiguration('enclaves'), f'/{node}']]


def _shipped(name: str) -> PathJoinSubstitution:
    """Return the path of a file in this package's folder config."""
    return PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', name])
