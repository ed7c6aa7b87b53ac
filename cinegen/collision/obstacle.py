"""`Obstacle`: a rigid object that a robot must not touch, made of pieces, which can be moved as a whole; `Attached`:
one that a node of the robot holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.collision.body import Body
from cinegen.collision.obstacle_kinds import KINDS, pieces_of
from cinegen.collision.scene_table import SceneTable, pose_keys, read_each
from cinegen.model import Mechanism
from raff2urdf.errors import counted


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
        return f"<Obstacle {self.name}: {self.kind or 'bodies'}, {counted(count, 'piece')}>"

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
    name, placement, shapes, _ = read_each(
        lambda: table.text("name") if "name" in table else f"{label or kind} {number}",
        table.pose,
        lambda: pieces_of(kind, table, folder),
        table.finish if kind in KINDS else list,  # the keys of an unknown kind are not known
    )
    pieces = tuple(Body(name if len(shapes) == 1 else f"{name}/{i}", 0, *shape) for i, shape in enumerate(shapes, 1))
    written = {key: value for key, value in table.read.items() if key not in ("name", "point", "rpy", "angle")}
    return Obstacle(name, pieces, placement, kind, written)


@dataclass(frozen=True, eq=False, repr=False)
class Attached:
    """An object that moves with a node: it is kept clear of obstacles, of the robot's links, and of other such objects.

    Attributes:
        object: its pieces; `placement` is its pose in the frame of the node, m.
        node: name of the node.
        touches: names of nodes and obstacles that may touch it, besides the nodes that are fixed to `node`.
    """

    object: Obstacle
    node: str
    touches: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Attached {self.object.name}: {self.object.kind}, to {self.node}>"

    @property
    def name(self) -> str:
        """Name, unique in a scene."""
        return self.object.name

    def bodies(self, mechanism: Mechanism) -> tuple[Body, ...]:
        """Return its pieces on the joint of the node."""
        frame = mechanism.model.frames[mechanism.frame_id(self.node)]
        return tuple(
            replace(piece, joint=frame.parentJoint, placement=frame.placement * piece.placement)
            for piece in self.object.bodies
        )

    def document(self) -> dict[str, Any]:
        """Return the keys and values that `read_attached` reads as this object."""
        touches = {"touches": list(self.touches)} if self.touches else {}
        return {**self.object.document(), "node": self.node, **touches}


def read_attached(
    table: SceneTable, number: int, folder: Path, mechanism: Mechanism, end: str, obstacles: Sequence[Obstacle] | None
) -> Attached:
    """Return the object of a table.

    Args:
        table: keys of an obstacle, `node` and `touches`.
        number: number of the object, from 1, for its default name.
        folder: folder of the files that the table names.
        mechanism: robot.
        end: node that holds it by default.
        obstacles: of the scene; None if they are not known: any names may be touched then.

    Raises:
        SceneError: a value is invalid.
    """
    table.know("node", "touches")

    def touched() -> tuple[str, ...]:
        names = tuple(table.names("touches")) if "touches" in table else ()
        known = (*mechanism.nodes, *(obstacle.name for obstacle in obstacles or ()))
        what = f"a node of {mechanism.name} or an obstacle"
        read_each(*(partial(table.check_name, "touches", name, known, what) for name in names if obstacles is not None))
        return names

    node, touches, held = read_each(
        lambda: table.node("node", mechanism, end), touched, lambda: read_obstacle(table, number, folder, "attached")
    )
    if not all(np.isfinite(piece.radius) for piece in held.pieces):
        raise table.error("kind", f"'{held.kind}' is unbounded: it can't be attached")
    written = {key: value for key, value in held.written.items() if key not in ("node", "touches")}
    return Attached(replace(held, written=written), node, touches)


def attached_pairs(objects: Sequence[Attached], mechanism: Mechanism, links: Sequence[Body]) -> list[tuple[int, int]]:
    """Return the pairs of bodies with attached objects that are checked: those that can move relative to each other,
    and may not touch.

    Args:
        objects: attached to the robot.
        mechanism: robot.
        links: bodies of the robot; those of the objects follow them, in order.

    Returns:
        indices into all bodies, the smaller first.
    """
    pairs = list[tuple[int, int]]()
    before = [(link.joint, link.name) for link in links]
    for held in objects:
        parts = [(body.joint, held.name) for body in held.bodies(mechanism)]
        for (i, (joint, name)), (k, (carrier, _)) in product(enumerate(before), enumerate(parts, len(before))):
            if joint != carrier and name not in held.touches:
                pairs.append((i, k))
        before += parts
    return pairs
