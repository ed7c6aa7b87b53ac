"""What the page is told, as JSON: who is there once, then where everything is, and reports now and then."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from cinegen.devices.kinds import what_is
from cinegen.model import Mechanism
from cinegen.model.description import describe_joint, describe_loop
from cinegen.session import FRAMES_OF_COMMAND, Replayed, Report, RobotState, Setup, Singularity, State, is_obstacle

Array = NDArray[np.float64]

PROTOCOL = 1


def hello(setup: Setup, title: str, client: int, replay: Replayed | None = None) -> dict[str, Any]:
    """What a page must know first.

    Args:
        setup: of the session.
        title: of the page.
        client: the page's own number.
        replay: the recording that is shown.
    """
    length = max((one.length for one in setup.robots.values() if not is_obstacle(one)), default=1.0)
    return {
        "kind": "hello",
        "protocol": PROTOCOL,
        "client": client,
        "title": title,
        "robots": [
            _robot(name, mechanism, setup.stand(name).robot, setup.stand(name).node, length)
            for name, mechanism in setup.robots.items()
        ],
        "sensors": [{"id": one.name, "url": one.url, "what": what_is(one.url)} for one in setup.devices],
        "switches": [
            {"robot": one.robot, "node": one.node, "choices": list(one.choices)} for one in setup.switches
        ],
        "frames": list(FRAMES_OF_COMMAND),
        "replay": replay and {"file": replay.file, "seconds": replay.seconds, "stops": list(setup.stops)},
        "map": setup.map and setup.map.robot,
    }  # fmt: skip


def _robot(name: str, mechanism: Mechanism, on: str | None, node: str | None, length: float) -> dict[str, Any]:
    """
    Args:
        length: of the largest robot: an obstacle has none.
    """
    model = mechanism.model
    above = {node: model.frames[mechanism.frame_id(node)] for node in mechanism.nodes}
    by_joint = {frame.parentJoint: node for node, frame in reversed(above.items())}
    nodes = []
    for own, frame in above.items():
        joint, parent = frame.parentJoint, by_joint.get(frame.parentJoint)
        moved_by = None
        if parent == own:  # the first node that this joint moves
            moved_by = model.names[joint] if joint > 0 else None
            while joint > 0:
                joint = model.parents[joint]
                if joint in by_joint:
                    break
            parent = by_joint.get(joint) if by_joint.get(joint) != own else None
        nodes.append({"name": own, "parent": parent, "joint": moved_by, "kind": "link" if moved_by else "frame"})
    nodes[0]["kind"] = "base"
    return {
        "name": name,
        "robot": mechanism.name,
        "obstacle": is_obstacle(mechanism),
        "length": length if is_obstacle(mechanism) else mechanism.length,
        "mobility": mechanism.mobility,
        "end": mechanism.end,
        "stands_on": None if on is None else [on, node],
        "nodes": nodes,
        "joints": [describe_joint(mechanism, joint) for joint in mechanism.joints],
        "loops": [describe_loop(loop) for loop in mechanism.loops],
    }


class Poses:
    """Where all nodes of robots are; scratch of its own, for one thread.

    Args:
        robots: by name.
    """

    def __init__(self, robots: Mapping[str, Mechanism]) -> None:
        self._robots = {
            name: (
                mechanism.model,
                mechanism.model.createData(),
                [mechanism.frame_id(node) for node in mechanism.nodes],
            )
            for name, mechanism in robots.items()
        }

    def of(self, name: str, q: Array) -> list[pin.SE3]:
        """Of each node of a robot at q (nq,), as seen from where it stands."""
        model, data, frames = self._robots[name]
        pin.forwardKinematics(model, data, q)
        return [pin.updateFramePlacement(model, data, frame) for frame in frames]


def frame(state: State, poses: Poses) -> dict[str, Any]:
    """Where everything is.

    Args:
        state: of the session.
        poses: of the same robots.
    """
    placed, tasks, statuses = {}, [], {}
    for name, robot in state.robots.items():
        nodes = poses.of(name, robot.q)
        placed[name] = numbers(np.concatenate([pin.SE3ToXYZQUAT(one) for one in (robot.base, *nodes)]))
        statuses[name] = {"name": robot.status[0], "words": robot.status[1]}
        tasks += _tasks(name, robot, nodes, poses)
    return {
        "kind": "state",
        "time": round(state.time, 3),
        "poses": placed,
        "tasks": tasks,
        "statuses": statuses,
    }


def _tasks(name: str, robot: RobotState, nodes: list[pin.SE3], poses: Poses) -> list[dict[str, Any]]:
    _, _, frames = poses._robots[name]
    model = poses._robots[name][0]
    places = {model.frames[frame].name: place for frame, place in zip(frames, nodes, strict=True)}
    return [
        {
            "id": task.number,
            "robot": name,
            "node": task.node,
            "who": task.who,
            "label": task.label,
            "point": numbers(robot.base.act((places[task.node] * task.offset).translation)),
            "target": numbers(pin.SE3ToXYZQUAT(robot.base * task.target)),
            "error": numbers(task.error),
            "holds": [task.translation, task.rotation],
            "weight": task.weight,
        }
        for task in robot.tasks
    ]


def report(
    setup: Setup, state: State, reports: Mapping[str, Report], rate: tuple[float, float], clients: int
) -> dict[str, Any]:
    """What is told some ten times a second.

    Args:
        setup: of the session.
        state: of the session.
        reports: of its robots.
        rate: ticks a second, and ms that 99 % of them begin late at most.
        clients: how many pages look.
    """
    recording, replay = state.recording, state.replay
    return {
        "robots": {
            name: _reported(setup.robots[name], state.robots[name], found) for name, found in reports.items()
        },
        "sensors": [
            {
                "id": one.name,
                "state": one.status.state.value,
                "words": one.status.message,
                "packets": one.status.packets,
                "damaged": one.status.damaged,
                "twist": None if one.twist is None else numbers(one.twist),
            }
            for one in state.sensors
        ],
        "switches": [
            {"robot": robot, "node": node, "sensor": sensor} for (robot, node), sensor in state.switches.items()
        ],
        "settings": {"frame": state.frame, **state.settings},
        "undo": state.undo,
        "redo": state.redo,
        "paused": state.paused,
        "moving": state.moving,
        "recording": recording
        and {"file": recording.file, "seconds": round(recording.seconds, 1), "error": recording.error},
        "replay": replay and {"time": replay.time, "playing": replay.playing, "speed": replay.tempo},
        "rate": {"ticks": round(rate[0], 1), "late": round(rate[1], 3)},
        "clients": clients,
    }  # fmt: skip


def _reported(mechanism: Mechanism, robot: RobotState, found: Report) -> dict[str, Any]:
    return {
        "q": numbers([robot.q[mechanism.q_index(joint)] for joint in mechanism.joints]),
        "saturated": list(robot.saturated),
        "near": list(found.near),
        "closure": finite(robot.closure),
        "type1": _singular(found.type1),
        "type2": _singular(found.type2),
        "ellipsoid": found.ellipsoid
        and {"at": numbers(found.ellipsoid[0]), "axes": [numbers(axis) for axis in found.ellipsoid[1]]},
        "forecast": {
            "path": [numbers(point) for point in found.path],
            "events": [
                {"time": round(one.time, 2), "kind": one.kind, "words": one.words, "at": numbers(one.at)}
                for one in found.events
            ],
        },
    }


def _singular(one: Singularity | None) -> dict[str, Any] | None:
    if one is None:
        return None
    return {
        "sigma": finite(one.sigma),
        "near": one.near,
        "words": one.words,
        "node": one.node,
        "at": numbers(one.at),
        "twist": numbers(one.twist),
    }


def numbers(values: ArrayLike) -> list[float]:
    """For JSON, which has none that are not finite."""
    found: list[float] = np.nan_to_num(np.asarray(values, dtype=float)).tolist()
    return found


def finite(value: float) -> float | None:
    """A number for JSON; None for none."""
    return float(value) if math.isfinite(value) else None
