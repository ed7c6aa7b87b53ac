"""`Scene`: a robot, the obstacles around it, its start and its goal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import pinocchio as pin

from cinegen.arrays import Array
from cinegen.collision.body import Body
from cinegen.collision.mobile_robot import X, Y, mobile_body
from cinegen.collision.obstacle import Attached, Obstacle, attached_pairs
from cinegen.collision.scene_table import pose_keys
from cinegen.html import table
from cinegen.joints import supporting_columns
from cinegen.loops.closed_loops import linked
from cinegen.model import Mechanism
from raff2urdf.errors import counted


class PathConstraints(NamedTuple):
    """Constraints that a node satisfies all along a path, relative to its pose at the start.

    Attributes:
        upright: it rotates about the vertical only.
        line: (3,) unit direction of the line through its position at the start, on which it stays; None for none.
        plane: (3,) unit normal of the plane through its position at the start, in which it stays; None for none.
    """

    upright: bool = False
    line: Array | None = None
    plane: Array | None = None

    def __bool__(self) -> bool:
        return self.upright or self.line is not None or self.plane is not None


UNCONSTRAINED = PathConstraints()


@dataclass(frozen=True, eq=False, repr=False)
class Scene:
    """A motion task: a robot among obstacles, with a start and a goal. Made by `load_scene` and `scene_of`.

    Lengths in m, angles in rad, poses in the world.

    Attributes:
        name: name of the scene.
        path: its file; None if it was made by a program.
        folder: folder of the files that it names.
        mechanism: the robot.
        robot: file of the robot, or a table with `file` and `name`; None for a mobile robot, or for a mechanism that
            was given by a program.
        mobile: radius of a mobile robot, 0 for a point; None for other robots.
        obstacles: each with a unique name.
        start: (nq,) configuration within all limits, loops closed.
        node: node that is to reach the goal.
        goal: goal pose of that node; that in the goal configuration, if joint values are the goal.
        translation: number of translations of the goal that count, along the world's axes: 3 all, 2 only x and y.
        rotation: number of rotations of the goal that count: 3 all, 1 only the rotation about the world's z axis, 0
            none.
        safety: safety distance, to be kept from obstacles.
        self_clearance: distance to be kept between the robot's links, at most `safety`.
        influence: distance at which fields start to act (the paper's range of influence); None: chosen by the planner.
        up: (3,) unit vector upward, for paths over and under obstacles; None: along z.
        allowed_collisions: pairs of the robot's nodes that are not checked against each other.
        goal_joints: names of the joints whose values are the goal, instead of a pose; none if a pose is.
        goal_configuration: (nq,) configuration within all limits, loops closed, with these values; None for a pose.
        locked: names of joints that keep their values of the start along a path.
        tolerance: (3,) of a region as goal: largest differences of the node's position along the world's axes; None
            for a point.
        cone: of a region as goal: largest angle of the node's z axis with that of the goal pose, the rotation about it
            free; None for an orientation.
        path_constraints: constraints of the node along the path.
        attached: objects that the robot holds; each name is unique, also among obstacles.
        weights: weights of joints, by name, in the length of paths, above 0; 1 for others.
    """

    name: str
    path: Path | None
    folder: Path
    mechanism: Mechanism
    robot: str | Mapping[str, Any] | None
    mobile: float | None
    obstacles: tuple[Obstacle, ...]
    start: Array
    node: str
    goal: pin.SE3
    translation: int
    rotation: int
    safety: float
    influence: float | None
    up: Array | None
    allowed_collisions: tuple[tuple[str, str], ...] = ()
    goal_joints: tuple[str, ...] = ()
    goal_configuration: Array | None = None
    locked: tuple[str, ...] = ()
    tolerance: Array | None = None
    cone: float | None = None
    path_constraints: PathConstraints = UNCONSTRAINED
    self_clearance: float = 0.0
    attached: tuple[Attached, ...] = ()
    weights: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        count = len(self.obstacles)
        return f"<Scene {self.name}: robot {self.mechanism.name}, {counted(count, 'obstacle')}>"

    def _repr_html_(self) -> str:
        point = ", ".join(f"{x:.6g}" for x in self.goal.translation[: self.translation])
        goal = f"joints {', '.join(self.goal_joints)}" if self.goal_joints else f"{self.node} to ({point}) m"
        return table(
            f"Scene {self.name}",
            ("property", "value"),
            [
                ("robot", self.mechanism.name if self.mobile is None else f"mobile robot, radius {self.mobile:g} m"),
                ("obstacles", ", ".join(obstacle.name for obstacle in self.obstacles) or "none"),
                *([("attached", ", ".join(attached.name for attached in self.attached))] if self.attached else []),
                ("goal", goal),
                ("safety distance", f"{self.safety:g} m"),
                ("self-clearance", f"{self.self_clearance:g} m"),
            ],
        )

    @cached_property
    def bodies(self) -> tuple[Body, ...] | None:
        """Bodies of a mobile robot; None for other robots, see `link_bodies`."""
        return None if self.mobile is None else (mobile_body(self.mobile),)

    def checked_pairs(self, bodies: Sequence[Body], pairs: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
        """Return the pairs of the robot's bodies without those that the scene allows to collide.

        Args:
            bodies: bodies of the robot.
            pairs: indices into `bodies`.
        """
        allowed = {frozenset(pair) for pair in self.allowed_collisions}
        return [(i, k) for i, k in pairs if frozenset((bodies[i].name, bodies[k].name)) not in allowed]

    def with_attached(
        self, links: Sequence[Body], pairs: Iterable[tuple[int, int]]
    ) -> tuple[tuple[Body, ...], list[tuple[int, int]]]:
        """Return the robot's bodies and the attached objects behind them, and the pairs of all that are checked.

        Args:
            links: bodies of the robot.
            pairs: pairs of these, as of `checked_pairs`.
        """
        touches = {
            load.name: frozenset(
                body.name for each in self.obstacles if each.name in load.touches for body in each.pieces
            )
            for load in self.attached
        }
        held = [
            replace(body, touches=touches[load.name]) for load in self.attached for body in load.bodies(self.mechanism)
        ]
        return (*links, *held), [*pairs, *attached_pairs(self.attached, self.mechanism, links)]

    @property
    def has_weights(self) -> bool:
        """True if `weights` change anything."""
        return any(weight != 1.0 for weight in self.weights.values())

    @cached_property
    def metric(self) -> Array:
        """(nv,) motion of each joint that has length 1 in the planner's metric, rad and m: the mechanism's `scale`,
        divided by `weights`."""
        metric = self.mechanism.scale.copy()
        for name, weight in self.weights.items():
            metric[self.mechanism.v_index(name)] /= weight
        return metric

    # --- as keys and values --------------------------------------------------------------------------------------

    def document(self) -> dict[str, Any]:
        """Return the keys and values that `scene_of` reads as this scene, from the same folder; JSON and TOML can hold
        them; m and rad."""
        document: dict[str, Any] = {"name": self.name, "angles": "rad"}
        if self.mobile is not None:
            document["mobile"] = {"radius": self.mobile}
        elif self.robot is not None:
            document["robot"] = deepcopy(self.robot)
        document |= {"node": self.node, "safety": self.safety, "self_clearance": self.self_clearance}
        if self.influence is not None:
            document["influence"] = self.influence
        if self.up is not None:
            document["up"] = self.up.tolist()
        if self.allowed_collisions:
            document["allowed_collisions"] = [list(pair) for pair in self.allowed_collisions]
        if self.locked != unmoving_joints(self.mechanism, self.node, self.goal_joints):
            document["locked"] = list(self.locked)
        if self.weights:
            document["weights"] = dict(self.weights)
        if self.attached:
            document["attached"] = [attached.document() for attached in self.attached]
        if self.path_constraints:
            constraints = self.path_constraints
            document["path"] = {"upright": True} if constraints.upright else {}
            for key, direction in (("line", constraints.line), ("plane", constraints.plane)):
                if direction is not None:
                    document["path"][key] = direction.tolist()
        document["start"] = self._start_keys()
        document["goal"] = self._goal_keys()
        document["obstacle"] = [obstacle.document() for obstacle in self.obstacles]
        return document

    def _start_keys(self) -> dict[str, Any]:
        if self.mobile is not None:
            values = self.mechanism.values(self.start)
            return {"point": [values[X], values[Y]]}
        return configuration_keys(self.mechanism, self.start)

    def _goal_keys(self) -> dict[str, Any]:
        if self.goal_configuration is not None:
            values = self.mechanism.values(self.goal_configuration)
            return {"joints": {name: values[name] for name in self.goal_joints}}
        keys: dict[str, Any] = {"point": self.goal.translation[: self.translation].tolist()}
        if self.rotation == 3:
            keys["rpy"] = pin.rpy.matrixToRpy(self.goal.rotation).tolist()
        elif self.rotation == 1:
            keys["angle"] = heading(self.goal)
        if self.tolerance is not None:
            keys["tolerance"] = self.tolerance.tolist()
        if self.cone is not None:
            keys["cone"] = self.cone
        return keys


def unmoving_joints(mechanism: Mechanism, node: str, goal: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that neither move a node nor are part of the goal, which are locked by default. Loops and
    couplings that a joint shares with one of these make it move, too.

    Args:
        mechanism: robot.
        node: its node.
        goal: names of joints whose values are the goal.
    """
    moves = supporting_columns(mechanism.model, mechanism.model.frames[mechanism.frame_id(node)].parentJoint)
    moves[[mechanism.v_index(name) for name in goal]] = 1.0
    for _, columns in linked(mechanism.structure.system.columns):
        moves[columns] = moves[columns].max()
    return tuple(name for name in mechanism.joints if not moves[mechanism.v_index(name)])


def configuration_keys(mechanism: Mechanism, q: Array) -> dict[str, Any]:
    """Return the keys of a scene's start at q (nq,)."""
    return {"joints": mechanism.values(q)} | (pose_keys(pin.XYZQUATToSE3(q[:7])) if mechanism.floating else {})


def heading(placement: pin.SE3) -> float:
    """Return the angle of the x axis of a pose in the world's xy plane, rad."""
    return math.atan2(placement.rotation[1, 0], placement.rotation[0, 0])
