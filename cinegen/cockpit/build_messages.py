"""Build the messages of the server: the robots once, then states, and reports in some of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, get_args

import msgspec
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.cockpit.messages import (
    PROTOCOL,
    DescribedMessage,
    ForcesDescription,
    HelloMessage,
    NodeDescription,
    NodeSensor,
    ObstacleDescription,
    ReportMessage,
    RobotDescription,
    SensorDescription,
    StateMessage,
    TaskMessage,
    TickRate,
)
from cinegen.devices.kinds import what_is
from cinegen.jit.starting import COMPILATION
from cinegen.joints import axis, kinematic_data
from cinegen.model import Mechanism
from cinegen.model.description import describe_coupling, describe_joint, describe_loop
from cinegen.session import RobotReport, SessionState, Setup, agreed_status
from cinegen.session.holding import largest_payload, why_no_forces
from cinegen.session.message_types import CommandFrame
from cinegen.session.state import DescribedState, PlaybackStatus, SessionInfo, TaskInfo, TaskState
from cinegen.typed_json import Vector7

_DIGITS = 9  # after the point, of poses and errors in m and rad


def hello_message(
    setup: Setup, title: str, client: int, playback: PlaybackStatus | None = None, view_token: str | None = None
) -> HelloMessage:
    """Build the first message to a client.

    Args:
        setup: setup of the session.
        title: title of the page.
        client: number of the client.
        playback: recording that is replayed.
        view_token: token of addresses that only view.
    """
    length = max(mechanism.length for mechanism in setup.robots.values())
    return HelloMessage(
        protocol=PROTOCOL,
        client=client,
        title=title,
        robots=tuple(_robot(setup, name, mechanism) for name, mechanism in setup.robots.items()),
        obstacles=tuple(ObstacleDescription(name, length, obstacle.dof) for name, obstacle in setup.obstacles.items()),
        sensors=tuple(SensorDescription(device.name, device.url, what_is(device.url)) for device in setup.devices),
        switches=setup.switches,
        frames=get_args(CommandFrame),
        playback=playback,
        stops=setup.stops,
        map=None if setup.map is None else setup.map.robot,
        caption=setup.caption,
        view_token=view_token,
    )


def _robot(setup: Setup, name: str, mechanism: Mechanism) -> RobotDescription:
    base = setup.base(name)
    return RobotDescription(
        name=name,
        robot=mechanism.name,
        length=mechanism.length,
        mobility=mechanism.mobility,
        end=mechanism.end,
        base=None if base.robot is None or base.node is None else (base.robot, base.node),
        nodes=tuple(_nodes(mechanism)),
        joints=tuple(describe_joint(mechanism, joint) for joint in mechanism.joints),
        loops=tuple(map(describe_loop, mechanism.loops)),
        couplings=tuple(map(describe_coupling, mechanism.couplings)),
        forces=ForcesDescription(
            why_no_forces(mechanism),
            largest_payload(mechanism),
            tuple(other for other in setup.robots if setup.base(other).robot == name),
        ),
        root=mechanism.base,
        lost=mechanism.lost_meshes,
    )


def _nodes(mechanism: Mechanism) -> list[NodeDescription]:
    """Describe the nodes of a mechanism. The first node that a joint moves is its link, the others are frames on it."""
    model = mechanism.model
    placed = NodePoses({mechanism.name: mechanism}).of(mechanism.name, mechanism.q_home)
    joint_of = {node: model.frames[mechanism.frame_id(node)].parentJoint for node in mechanism.nodes}
    link_of = {joint: node for node, joint in reversed(joint_of.items())}
    nodes = []
    for node, joint in joint_of.items():
        if link_of[joint] != node:
            link = link_of[joint]
            nodes.append(NodeDescription(node, link, None, "frame", _relative(placed, link, node)))
            continue
        above = joint
        while above > 0 and (above == joint or above not in link_of):
            above = model.parents[above]
        parent = link_of.get(above) if above != joint else None
        moved_by = model.names[joint] if joint > 0 else None
        placement = None if moved_by else _relative(placed, parent, node)
        along = _axis(mechanism, node) if moved_by in mechanism.joints else None
        nodes.append(NodeDescription(node, parent, moved_by, "link" if moved_by else "frame", placement, along))
    nodes[0] = msgspec.structs.replace(nodes[0], kind="base")
    return nodes


def _relative(placed: Mapping[str, pin.SE3], parent: str | None, node: str) -> Vector7:
    """Return the pose of a node that is fixed to its parent, or to the world."""
    return _rounded(placed[node] if parent is None else placed[parent].actInv(placed[node]))


def _rounded(pose: pin.SE3) -> Vector7:
    """Return a pose without digits that cannot be seen: to nanometres."""
    x, y, z, *turn = np.round(pin.SE3ToXYZQUAT(pose), _DIGITS).tolist()
    return (x, y, z, *turn)


def _axis(mechanism: Mechanism, node: str) -> tuple[float, float, float]:
    """Return the axis of the joint that moves a node, in the node's frame."""
    frame = mechanism.model.frames[mechanism.frame_id(node)]
    x, y, z = frame.placement.rotation.T @ axis(mechanism.model.joints[frame.parentJoint])
    return float(x), float(y), float(z)


class NodePoses:
    """Poses of the nodes of robots. It has memory of its own, for one thread.

    Args:
        robots: robots by name.
    """

    def __init__(self, robots: Mapping[str, Mechanism]) -> None:
        self._robots = {
            name: (robot.model, kinematic_data(robot.model), {node: robot.frame_id(node) for node in robot.nodes})
            for name, robot in robots.items()
        }

    def of(self, name: str, q: Array) -> dict[str, pin.SE3]:
        """Return the placement of each node of a robot at q (nq,), in its own world."""
        model, data, frames = self._robots[name]
        pin.forwardKinematics(model, data, q)
        return {node: pin.updateFramePlacement(model, data, frame) for node, frame in frames.items()}


def state_message(state: SessionState, poses: NodePoses, reports: Mapping[str, RobotReport]) -> StateMessage:
    """Build a state, without its number, the client that has control, and a report.

    Args:
        state: state of the session.
        poses: poses of the same robots.
        reports: last reports on its robots that are shown, with which their statuses must agree.
    """
    placed: dict[str, list[float]] = {}
    tasks: list[TaskMessage] = []
    for name, robot in state.robots.items():
        nodes = poses.of(name, robot.q)
        every = np.concatenate([pin.SE3ToXYZQUAT(pose) for pose in (robot.base, *nodes.values())])
        placed[name] = np.round(every, _DIGITS).tolist()
        tasks += [_task(name, task, robot.base * nodes[task.node], robot.base * task.target) for task in robot.tasks]
    for name, obstacle in state.obstacles.items():
        tasks += [_task(name, task, obstacle.pose, task.target) for task in obstacle.tasks]
    obstacles = {name: _rounded(drawn.pose) for name, drawn in state.obstacles.items()}
    statuses = {name: agreed_status(robot.status, reports.get(name)) for name, robot in state.robots.items()}
    statuses |= {name: obstacle.status for name, obstacle in state.obstacles.items()}
    stopped = {name: robot.obstruction for name, robot in state.robots.items() if robot.obstruction is not None}
    torques = {
        name: [float(f"{x:.6g}") if np.isfinite(x) else None for x in robot.torques]
        for name, robot in state.robots.items()
        if robot.torques is not None
    }
    described = tuple(
        DescribedMessage(robot=name, **_fields(DescribedState, task))
        for name, robot in state.robots.items()
        for task in robot.described
    )
    return StateMessage(
        round(state.time, 3), placed, obstacles, tuple(tasks), statuses, stopped, torques, described=described
    )


def _task(robot: str, task: TaskState, node: pin.SE3, target: pin.SE3) -> TaskMessage:
    """Build the message of a task, with the poses of its node and its target in the world."""
    position = np.round((node * task.offset).translation, _DIGITS).tolist()
    fields = _fields(TaskInfo, task) | {"error": (round(task.error[0], _DIGITS), round(task.error[1], _DIGITS))}
    return TaskMessage(robot=robot, position=position, target=_rounded(target), **fields)


def report_message(
    state: SessionState, robots: Mapping[str, RobotReport], rate: TickRate, clients: int
) -> ReportMessage:
    """Build a report.

    Args:
        state: state of the session.
        robots: reports on its robots.
        rate: timing of the ticks.
        clients: number of clients.
    """
    return ReportMessage(
        robots=dict(robots),
        switches=tuple(NodeSensor(robot, node, sensor) for (robot, node), sensor in state.switches.items()),
        rate=rate,
        clients=clients,
        compilation=None if state.compiled else COMPILATION.fraction,
        **_fields(SessionInfo, state),
    )


def _fields(kind: type[msgspec.Struct], struct: msgspec.Struct) -> dict[str, Any]:
    """Return the fields of a base class."""
    return {name: getattr(struct, name) for name in kind.__struct_fields__}
