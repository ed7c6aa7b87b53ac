"""Bodies as Pinocchio measures distances between them."""

from __future__ import annotations

from collections.abc import Sequence

import pinocchio as pin

from cinegen.collision.body import Body
from cinegen.model.mechanism import Mechanism

Pairs = Sequence[tuple[int, int]]
"""Places of two bodies in a list of them."""


def geometry_model(
    mechanism: Mechanism, bodies: Sequence[Body], obstacles: Sequence[Body] = (), pairs: Pairs = ()
) -> pin.GeometryModel:
    """Bodies and obstacles as Pinocchio's geometry, for `pin.computeDistances`.

    Args:
        mechanism: on whose joints they are.
        bodies: its own, see `bodies_of`.
        obstacles: on joint 0, where they can be moved by their placements.
        pairs: of the mechanism's own bodies, see `pairs_of`.

    Returns:
        geometry objects: the bodies, then the obstacles, each called `<place> <name>`. Collision pairs: `pairs`, in
        their order; then each body that is not fixed in the world with each obstacle, body by body.
    """
    geometry = pin.GeometryModel()
    for i, body in enumerate((*bodies, *obstacles)):
        geometry.addGeometryObject(pin.GeometryObject(f"{i} {body.name}", body.joint, body.placement, body.shape))
    for first, second in pairs:
        geometry.addCollisionPair(pin.CollisionPair(first, second))
    for i, body in enumerate(bodies):
        for k in range(len(obstacles)) if body.joint != 0 else ():
            geometry.addCollisionPair(pin.CollisionPair(i, len(bodies) + k))
    return geometry
