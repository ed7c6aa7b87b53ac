"""ROS 2 node: joint states and trajectories in, completed ones out."""

from __future__ import annotations

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import cinegen
from cinegen_joint_states.joint_states import CompletionError, JointStateCompletion
from cinegen_joint_states.trajectories import TOLERANCE, Trajectory, completed

_DEPTH = 10  # messages of a queue
_QUIET = 1.0  # s between two equal warnings


class CompletionNode(Node):
    """Publishes the states of all joints, and trajectories of the actuated joints.

    Parameters: `robot`, a file that `cinegen.load` reads, best the URDF of `robot_state_publisher`; `tolerance`, see
    `trajectories.completed`.

    Subscribes `actuated_joint_states` and publishes `joint_states` (sensor_msgs/JointState), with the time stamps of
    the input. Efforts are not passed on: those of passive joints are unknown. Subscribes `trajectory` and publishes
    `actuated_trajectory` (trajectory_msgs/JointTrajectory). What can't be completed is reported, and not published.

    Raises:
        CompletionError: the parameter `robot` is missing, or a topic would be published to itself.
        CinegenError: the robot can't be read or completed.
    """

    def __init__(self) -> None:
        super().__init__("joint_state_completion")
        file = self.declare_parameter("robot", "").value
        if not file:
            raise CompletionError("name the robot's file: --ros-args -p robot:=FILE")
        self._tolerance = self.declare_parameter("tolerance", TOLERANCE).value
        self._mechanism = cinegen.load(file)
        self._completion = JointStateCompletion(self._mechanism)
        self._states = self.create_publisher(JointState, "joint_states", _DEPTH)
        self._trajectories = self.create_publisher(JointTrajectory, "actuated_trajectory", _DEPTH)
        states = self.create_subscription(JointState, "actuated_joint_states", self._complete_state, _DEPTH)
        trajectories = self.create_subscription(JointTrajectory, "trajectory", self._complete_trajectory, _DEPTH)
        for subscription, made in ((states, self._states), (trajectories, self._trajectories)):
            if subscription.topic_name == made.topic_name:
                raise CompletionError(f"{made.topic_name} is both read and published: remap one of both topics")
        self.get_logger().info(
            f"{self._mechanism.name}: {len(self._mechanism.actuated)} actuated of {len(self._mechanism.joints)} joints"
        )

    def _complete_state(self, message: JointState) -> None:
        try:
            made = self._completion.complete(message.name, message.position, message.velocity)
        except cinegen.CinegenError as error:
            self.get_logger().warning(f"joint state: {error}", throttle_duration_sec=_QUIET)
            return
        self._states.publish(
            JointState(
                header=message.header,
                name=list(made.names),
                position=made.positions.tolist(),
                velocity=made.velocities.tolist(),
            )
        )

    def _complete_trajectory(self, message: JointTrajectory) -> None:
        try:
            actuated = self._mechanism.actuated
            made = completed(self._mechanism, trajectory_of(message), self._completion.q, self._tolerance).of(actuated)
        except cinegen.CinegenError as error:
            self.get_logger().error(f"trajectory: {error}")
            return
        points = [
            JointTrajectoryPoint(
                positions=made.positions[i].tolist(),
                velocities=[] if made.velocities is None else made.velocities[i].tolist(),
                accelerations=[] if made.accelerations is None else made.accelerations[i].tolist(),
                time_from_start=point.time_from_start,
            )
            for i, point in enumerate(message.points)
        ]
        self._trajectories.publish(JointTrajectory(header=message.header, joint_names=list(made.names), points=points))


def trajectory_of(message: JointTrajectory) -> Trajectory:
    """Return the content of a message. Velocities or accelerations must be those of all points, or of none.

    Raises:
        CompletionError: they are those of some points only, or a point has not one value for each joint.
    """
    names, arrays = tuple(message.joint_names), list[np.ndarray | None]()
    for what in ("positions", "velocities", "accelerations"):
        rows = [getattr(point, what) for point in message.points]
        for number, row in enumerate(rows):
            if len(row) not in ((0, len(names)) if what != "positions" else (len(names),)):
                raise CompletionError(f"point {number} has {len(row)} {what} of {len(names)} joints")
            if bool(len(row)) != bool(len(rows[0])):
                raise CompletionError(f"points 0 and {number}: only one of them has {what}")
        arrays.append(np.array(rows, dtype=float) if rows and len(rows[0]) else None)
    if arrays[0] is None:
        raise CompletionError("the trajectory has no points, or no joints")
    return Trajectory(names, arrays[0], arrays[1], arrays[2])


def main() -> int:
    """Run the node until it is stopped."""
    rclpy.init()
    try:
        rclpy.spin(CompletionNode())
    except cinegen.CinegenError as error:
        rclpy.logging.get_logger("joint_state_completion").fatal(str(error))
        return 1
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0
