"""An obstacle: something that stands in the way, made of convex pieces, and can be moved as a whole."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pinocchio as pin

from cinegen.collision.body import Body
from cinegen.collision.scene.kinds import kind_of
from cinegen.collision.scene.place import placement, said
from cinegen.collision.scene.table import Table

_STANDS = ("name", "point", "rpy", "angle")


@dataclass(frozen=True, eq=False)
class Obstacle:
    """What stands in the way.

    Attributes:
        name: no two obstacles of a scene have the same.
        kind: one of `cinegen.collision.scene.kinds.KINDS`.
        pieces: convex solids that it is made of, each placed in the obstacle's frame.
        placement: of the obstacle in the world.
        written: the keys that say its kind and shape, as JSON can hold them.
    """

    name: str
    kind: str
    pieces: tuple[Body, ...]
    placement: pin.SE3
    written: Mapping[str, Any]

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """Its pieces where they stand in the world."""
        return tuple(replace(piece, placement=self.placement * piece.placement) for piece in self.pieces)

    def moved(self, placement: pin.SE3) -> Obstacle:
        """The same obstacle elsewhere."""
        return replace(self, placement=placement.copy())

    def document(self) -> dict[str, Any]:
        """What reads back as this obstacle, where it stands now."""
        return {"name": self.name, **deepcopy(dict(self.written)), **said(self.placement)}


def obstacle(table: Table, number: int, folder: Path) -> Obstacle:
    """Reads one.

    Args:
        table: of a scene.
        number: of the obstacle, from 1; it has no other name unless it is given one.
        folder: where its files are looked for.

    Raises:
        SceneError: something is wrong with it.
    """
    kind = kind_of(table)
    name = table.text("name") if "name" in table else f"{table.read['kind']} {number}"
    where = placement(table)
    solids = kind.solids(table, folder)
    table.finish()
    pieces = tuple(
        Body(name if len(solids) == 1 else f"{name}/{i}", 0, solid.placement, solid.shape)
        for i, solid in enumerate(solids, 1)
    )
    written = {key: value for key, value in table.read.items() if key not in _STANDS}
    return Obstacle(name, written["kind"], pieces, where, written)
