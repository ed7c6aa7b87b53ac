"""`Scene`: a robot, the obstacles around it, where it starts and where it is to go."""

from __future__ import annotations

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
from cinegen.collision.scene.goal import Goal, said_goal
from cinegen.collision.scene.mobile import body
from cinegen.collision.scene.obstacle import Obstacle
from cinegen.collision.scene.start import said_start
from cinegen.model import Mechanism

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scene:
    """What a scene's file says. Made by `load_scene` and `scene_of`. Lengths in m, angles in rad.

    Attributes:
        name: of the scene.
        path: its file; None if it was made by a program.
        folder: where the files that it names are looked for.
        mechanism: the robot.
        robot: what was written for it: a file, or a table with `file` and `name`; None for a mobile robot, or where a
            program gave a mechanism only.
        mobile: the radius of a mobile robot, 0 for a point; None for others.
        obstacles: each with a name of its own.
        start: (nq,) a closed configuration inside all limits.
        node: which is to reach the goal.
        goal: where that should be, in the world.
        translation: how many translations of the goal count, along the world's axes: 3 all, 2 only x and y.
        rotation: how many rotations of it count, about the world's axes: 3 all, 1 only the turn about z, 0 none.
        safety: distance that is to be kept from obstacles.
        influence: distance from which on fields act (the paper's r of influence); None: the planner's choice.
        up: (3,) a unit vector, which way is up, for ways over obstacles and below them; None: along z.
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

    @cached_property
    def bodies(self) -> tuple[Body, ...] | None:
        """What a mobile robot fills; None for others, whose links say it."""
        return None if self.mobile is None else (body(self.mobile),)

    def without_allowed(self, bodies: Sequence[Body], pairs: Iterable[tuple[int, int]]) -> list[tuple[int, int]]:
        """Return the pairs of the robot's bodies that are to be checked.

        Args:
            bodies: of the robot.
            pairs: indices into `bodies`.
        """
        allowed = {frozenset(pair) for pair in self.allowed_collisions}
        return [(i, k) for i, k in pairs if frozenset((bodies[i].name, bodies[k].name)) not in allowed]

    def document(self) -> dict[str, Any]:
        """What reads back as this scene from the same folder (`scene_of`); JSON and TOML can hold it."""
        found: dict[str, Any] = {"name": self.name}
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
        found["start"] = said_start(self.mechanism, self.start, self.mobile is not None)
        found["goal"] = said_goal(Goal(self.goal, self.translation, self.rotation))
        found["obstacle"] = [obstacle.document() for obstacle in self.obstacles]
        return found
