"""What a map can tell of each cell: the names of quantities, their units and what they are.

Singular values are those of `cinegen.singularity`, without unit: lengths are divided by the mechanism's
characteristic length, which makes them commensurable with angles. What counts of the node, its place or also how it is
turned, is `MapSpecification.counted`. How each is computed stands in `cinegen.workspace.measured`.
"""

from __future__ import annotations

from typing import NamedTuple


class Quantity(NamedTuple):
    """What a map can tell.

    Attributes:
        unit: "1" where it has none.
        words: what it is.
        dtype: how it is stored.
    """

    unit: str
    words: str
    dtype: str = "float32"


QUANTITIES: dict[str, Quantity] = {
    "solutions": Quantity("1", "inverse solutions, or of motors assembly modes", "int32"),
    "sigma_1": Quantity("1", "smallest singular value of type 1: the node loses a freedom at 0"),
    "sigma_2": Quantity("1", "smallest singular value of type 2: motors lose hold of the node at 0"),
    "condition": Quantity("1", "condition of how motors move the node, 1 at best"),
    "manipulability": Quantity("1", "Yoshikawa's: the volume that unit velocities of the motors span"),
    "margin": Quantity("1", "joint-limit margin: 1 in the middle of all ranges, 0 at a limit"),
    "velocity": Quantity("m s-1", "largest component of the node's velocity along the direction"),
    "force": Quantity("N", "largest force of the node along the direction"),
    "solid_angle": Quantity("sr", "directions that the node's z can have here (dexterous solid angle)"),
    "clearance": Quantity("m", "least distance to the scene's obstacles and between links"),
}
"""By name. `reachable`, `settled` and `configuration` are in every map."""

DIRECTED = frozenset({"velocity", "force"})
"""Those that are meant along a direction."""
