"""`Attached`: an object that a node of a robot holds, which moves with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from cinegen.collision.body import Body
from cinegen.collision.obstacle import Obstacle, read_obstacle
from cinegen.collision.scene_table import SceneTable
from cinegen.model import Mechanism
from raff2urdf.errors import did_you_mean


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
        found = {**self.object.document(), "node": self.node}
        return found | ({"touches": list(self.touches)} if self.touches else {})


def read_attached(
    table: SceneTable, number: int, folder: Path, mechanism: Mechanism, end: str, obstacles: Sequence[Obstacle]
) -> Attached:
    """Return the object of a table.

    Args:
        table: keys of an obstacle, `node` and `touches`.
        number: number of the object, from 1, for its default name.
        folder: folder of the files that the table names.
        mechanism: robot.
        end: node that holds it by default.
        obstacles: of the scene.

    Raises:
        SceneError: a value is invalid.
    """
    node = table.text("node") if "node" in table else end
    touches = tuple(table.names("touches")) if "touches" in table else ()
    table.check_name("node", node, mechanism.nodes, f"a node of {mechanism.name}")
    known = (*mechanism.nodes, *(obstacle.name for obstacle in obstacles))
    for name in touches:
        if name not in known:
            near = did_you_mean(name, known)
            raise table.error("touches", f"'{name}' is neither a node of {mechanism.name} nor an obstacle{near}")
    held = read_obstacle(table, number, folder, "attached")
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
    found, first = list[tuple[int, int]](), len(links)
    owned = [(i, link.joint, link.name) for i, link in enumerate(links)]
    for one in objects:
        bodies = one.bodies(mechanism)
        own = [(i, body.joint, one.name) for i, body in enumerate(bodies, first)]
        for (i, joint, name), (k, own_joint, _) in product(owned, own):
            if joint != own_joint and name not in one.touches:
                found.append((i, k))
        owned, first = owned + own, first + len(bodies)
    return found
