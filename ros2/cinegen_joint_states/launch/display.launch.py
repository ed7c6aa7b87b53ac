"""Show a robot with closed loops: `robot_state_publisher` gets the values of all joints."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def nodes(context):
    """Return the nodes for the file that the argument `robot` names."""
    robot = Path(LaunchConfiguration("robot").perform(context)).resolve()
    actuated = LaunchConfiguration("actuated").perform(context)
    return [
        Node(
            package="cinegen_joint_states",
            executable="complete",
            parameters=[{"robot": str(robot)}],
            remappings=[("actuated_joint_states", actuated)],
        ),
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            parameters=[{"robot_description": robot.read_text(encoding="utf-8")}],
        ),
    ]


def generate_launch_description():
    """Return the launch description."""
    return LaunchDescription(
        [
            DeclareLaunchArgument("robot", description="URDF with loops"),
            DeclareLaunchArgument(
                "actuated", default_value="actuated_joint_states", description="topic of the actuated joints' states"
            ),
            OpaqueFunction(function=nodes),
        ]
    )
