"""Which bodies of a mechanism may collide with one another.

An SRDF says so of a robot by hand or by sampling (S. Chitta, I. Sucan and S. Cousins, "MoveIt!", IEEE Robotics and
Automation Magazine 19(1), 2012: adjacent links, links in collision by default, always, or never); here it is worked out
for any mechanism.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.avoid.bodies.geometry import Pairs, geometry_model
from cinegen.avoid.bodies.neighbours import neighbours
from cinegen.avoid.body import Body
from cinegen.model.mechanism import Mechanism

Array = NDArray[np.float64]

_TOUCHING = 1e-3  # of the characteristic length: nearer than this is no gap
_NEARLY_ALWAYS = 0.95  # of all configurations
_CONSTANT = 1e-6  # of the characteristic length
_TRIED = 60  # configurations


def pairs_of(mechanism: Mechanism, bodies: Sequence[Body]) -> tuple[tuple[int, int], ...]:
    """Pairs of bodies that move against each other and may collide.

    Left out are bodies on the same joint, neighbours (see `neighbours`), and pairs that

    - touch, or nearly touch, at home: home counts as free, and whoever wants a pair watched has to bring a home, or
      shapes, that leave a gap there;
    - overlap in nearly all closed configurations (95 of 100 random ones);
    - can't move against each other, or only turn about the axis of one, as two drums on axes that a link holds apart.

    Args:
        mechanism: any.
        bodies: on its joints.

    Returns:
        places in `bodies`, the smaller first, in lexical order.
    """
    near = neighbours(mechanism)
    joints = [body.joint for body in bodies]
    pairs = [
        (i, k)
        for i, k in combinations(range(len(bodies)), 2)
        if joints[i] != joints[k] and (min(joints[i], joints[k]), max(joints[i], joints[k])) not in near
    ]
    length, home = mechanism.length, mechanism.q_home
    at_home = _distances(mechanism, bodies, pairs, [home])[0]
    pairs = [pair for pair, distance in zip(pairs, at_home, strict=True) if distance > _TOUCHING * length]
    tried = [home, *mechanism.random_closed(_TRIED)]
    distances = _distances(mechanism, bodies, pairs, tried)
    overlap = (distances <= 0.0).mean(axis=0) >= _NEARLY_ALWAYS
    cores = _cores(mechanism, bodies, tried)
    return tuple(
        (i, k)
        for (i, k), always in zip(pairs, overlap, strict=True)
        if not always and not _apart_for_ever(cores[i], cores[k], length)
    )


def _apart_for_ever(first: Array, second: Array, length: float) -> bool:
    """Whether all points of one core stay as far from all of another as they are: (configurations, points, 3) each.

    The shortest distance alone would not do: it may stay what it is, between the nearest ends of two bars, until one
    is folded back along the other. That between two points is an analytic function of the joints: if it is constant
    in some configurations at random, it is everywhere.
    """
    between = np.linalg.norm(first[:, :, None] - second[:, None], axis=3)
    return bool(np.ptp(between, axis=0).max() <= _CONSTANT * length)


def _cores(mechanism: Mechanism, bodies: Sequence[Body], configurations: Sequence[Array]) -> list[Array]:
    """For each body (configurations, points, 3): where the points are, in the world, m, that say where it is."""
    data, points = mechanism.model.createData(), [_core(body) for body in bodies]
    found: list[list[Array]] = [[] for _ in bodies]
    for q in configurations:
        pin.forwardKinematics(mechanism.model, data, q)
        for body, own, there in zip(bodies, points, found, strict=True):
            at = data.oMi[body.joint]
            there.append(own @ at.rotation.T + at.translation)
    return [np.array(there) for there in found]


def _core(body: Body) -> Array:
    """(n, 3) the ends of the axis of what is round about one, the middle of a ball, four points of anything else; in
    the frame of the joint, m."""
    match body.shape:
        case coal.Sphere():
            core = np.zeros((1, 3))
        case coal.Capsule() | coal.Cylinder():
            core = np.array([[0.0, 0.0, body.shape.halfLength], [0.0, 0.0, -body.shape.halfLength]])
        case _:
            core = body.radius * np.vstack([np.zeros(3), np.eye(3)])
    return np.asarray(core @ body.placement.rotation.T + body.placement.translation)


def _distances(mechanism: Mechanism, bodies: Sequence[Body], pairs: Pairs, configurations: Sequence[Array]) -> Array:
    """(configurations, pairs) m, negative where bodies overlap."""
    geometry = geometry_model(mechanism, bodies, pairs=pairs)
    found, data = geometry.createData(), mechanism.model.createData()
    distances = np.empty((len(configurations), len(pairs)))
    for row, q in zip(distances, configurations, strict=True):
        pin.updateGeometryPlacements(mechanism.model, data, geometry, found, q)
        pin.computeDistances(geometry, found)
        row[:] = [result.min_distance for result in found.distanceResults]
    return distances
