"""The bodies of a mechanism: convex solids around its links, made once, to which distances are fast."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from cinegen.collision.bodies.inside import is_inside
from cinegen.collision.bodies.solid import Solid, solid
from cinegen.collision.body import Body
from cinegen.model.mechanism import Mechanism


def bodies_of(mechanism: Mechanism) -> tuple[Body, ...]:
    """Convex solids around all links of a mechanism, also those that stand fixed in the world, on joint 0.

    They stand for what the links collide with (`Mechanism.collision`): the shapes that a URDF gives for collisions; for
    a link that has none, what is seen of it; where nothing is drawn, the bars of the stick figure. No part of these
    is outside of them. Each piece has its own, see `cinegen.collision.bodies.solid`; a piece that is inside of another
    one on the same joint is left out, whichever link it belongs to.

    Returns:
        in the order of the mechanism's nodes; the name of each is its node's. m, in the frames of the joints.

    Raises:
        LoadError: a mesh is not there or can't be read.
    """
    frames = mechanism.model.frames
    rank = {node: i for i, node in enumerate(mechanism.nodes)}
    drawn = sorted(
        mechanism.collision.geometryObjects,
        key=lambda piece: rank.get(frames[piece.parentFrame].name, len(rank)),
    )
    found = [
        (frames[piece.parentFrame].name, piece.parentJoint, solid(piece.geometry, piece.placement)) for piece in drawn
    ]
    kept = set(_outermost([some for _, _, some in found], [joint for _, joint, _ in found]))
    return tuple(
        Body(name, joint, some.placement, some.shape) for i, (name, joint, some) in enumerate(found) if i in kept
    )


def _outermost(solids: Sequence[Solid], joints: Sequence[int]) -> Iterator[int]:
    """Those that are inside of no other one on their joint; of several that are the same, the first."""
    for i, inner in enumerate(solids):
        others = [j for j in range(len(solids)) if j != i and joints[j] == joints[i]]
        if not any(is_inside(inner, solids[j]) and not (i < j and is_inside(solids[j], inner)) for j in others):
            yield i
