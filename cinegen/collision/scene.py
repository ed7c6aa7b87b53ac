"""`Scene`: a robot, the obstacles around it, its start and its goal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.collision.body import Body
from cinegen.collision.mobile_robot import X, Y, mobile_body
from cinegen.collision.obstacle import Obstacle
from cinegen.collision.scene_table import pose_keys
from cinegen.html import table
from cinegen.model import Mechanism

Array = NDArray[np.float64]


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
        goal: goal pose of that node.
        translation: number of translations of the goal that count, along the world's axes: 3 all, 2 only x and y.
        rotation: number of rotations of the goal that count: 3 all, 1 only the rotation about the world's z axis, 0
            none.
        safety: safety distance, to be kept from obstacles.
        influence: distance at which fields start to act (the paper's range of influence); None: chosen by the planner.
        up: (3,) unit vector upward, for paths over and under obstacles; None: along z.
        allowed_collisions: pairs of the robot's nodes that are not checked against each other.
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

    def __repr__(self) -> str:
        count = len(self.obstacles)
        return f"<Scene {self.name}: robot {self.mechanism.name}, {count} obstacle{'s' * (count != 1)}>"

    def _repr_html_(self) -> str:
        point = ", ".join(f"{x:.6g}" for x in self.goal.translation[: self.translation])
        return table(
            f"Scene {self.name}",
            ("property", "value"),
            [
                ("robot", self.mechanism.name if self.mobile is None else f"mobile robot, radius {self.mobile:g} m"),
                ("obstacles", ", ".join(one.name for one in self.obstacles) or "none"),
                ("goal", f"{self.node} to ({point}) m"),
                ("safety distance", f"{self.safety:g} m"),
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

    # --- as keys and values --------------------------------------------------------------------------------------

    def document(self) -> dict[str, Any]:
        """Return the keys and values that `scene_of` reads as this scene, from the same folder; JSON and TOML can hold
        them; m and rad."""
        found: dict[str, Any] = {"name": self.name, "angles": "rad"}
        if self.mobile is not None:
            found["mobile"] = {"radius": self.mobile}
        elif self.robot is not None:
            found["robot"] = deepcopy(self.robot)
        found |= {"node": self.node, "safety": self.safety}
        if self.influence is not None:
            found["influence"] = self.influence
        if self.up is not None:
            found["up"] = self.up.tolist()
        if self.allowed_collisions:
            found["allowed_collisions"] = [list(pair) for pair in self.allowed_collisions]
        found["start"] = self._start_keys()
        found["goal"] = self._goal_keys()
        found["obstacle"] = [obstacle.document() for obstacle in self.obstacles]
        return found

    def _start_keys(self) -> dict[str, Any]:
        values = self.mechanism.values(self.start)
        if self.mobile is not None:
            return {"point": [values[X], values[Y]]}
        return {"joints": values} | (pose_keys(pin.XYZQUATToSE3(self.start[:7])) if self.mechanism.floating else {})

    def _goal_keys(self) -> dict[str, Any]:
        found: dict[str, Any] = {"point": self.goal.translation[: self.translation].tolist()}
        if self.rotation == 3:
            found["rpy"] = pin.rpy.matrixToRpy(self.goal.rotation).tolist()
        elif self.rotation == 1:
            found["angle"] = heading(self.goal)
        return found


def heading(placement: pin.SE3) -> float:
    """Return the angle of the x axis of a pose in the world's xy plane, rad."""
    return math.atan2(placement.rotation[1, 0], placement.rotation[0, 0])
