"""`Obstacle`: a rigid object that a robot must not touch, made of pieces, which can be moved as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pinocchio as pin

from cinegen.collision.body import Body
from cinegen.collision.obstacle_kinds import pieces_of
from cinegen.collision.scene_table import SceneTable, pose_keys


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A rigid object around a robot.

    Attributes:
        name: unique in a scene.
        pieces: convex shapes, some of which contain an exact one, in the frame of the obstacle.
        placement: pose of the obstacle in the world.
        kind: one of `cinegen.collision.obstacle_kinds.KINDS`, if it was read from a table.
        written: the keys of its kind and shape as they were read, as JSON can hold them.
    """

    name: str
    pieces: tuple[Body, ...]
    placement: pin.SE3 = field(default_factory=pin.SE3.Identity)
    kind: str = ""
    written: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        count = len(self.pieces)
        return f"<Obstacle {self.name}: {self.kind or 'bodies'}, {count} piece{'s' * (count != 1)}>"

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Pieces, in the world."""
        return tuple(replace(piece, placement=self.placement * piece.placement) for piece in self.pieces)

    def moved(self, placement: pin.SE3) -> Obstacle:
        """Return the same obstacle at another pose in the world."""
        return replace(self, placement=placement.copy())

    def document(self) -> dict[str, Any]:
        """Return the keys and values that `read_obstacle` reads as this obstacle, at its present pose."""
        return {"name": self.name, **deepcopy(dict(self.written)), **pose_keys(self.placement)}


def read_obstacle(table: SceneTable, number: int, folder: Path, label: str = "") -> Obstacle:
    """Return the obstacle of a table.

    Args:
        table: `kind`, the keys of that kind, and optionally `name`, and `point`, `rpy` or `angle` of the pose.
        number: number of the obstacle, from 1, for its default name.
        folder: folder of the files that the table names.
        label: first word of that name, instead of the kind.

    Raises:
        SceneError: a value is invalid.
    """
    kind = table.text("kind")
    name = table.text("name") if "name" in table else f"{label or kind} {number}"
    placement, shapes = table.pose(), pieces_of(kind, table, folder)
    table.finish()
    pieces = tuple(Body(name if len(shapes) == 1 else f"{name}/{i}", 0, *shape) for i, shape in enumerate(shapes, 1))
    written = {key: value for key, value in table.read.items() if key not in ("name", "point", "rpy", "angle")}
    return Obstacle(name, pieces, placement, kind, written)
