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

from cinegen.collision.bodies.geometry import Pairs
from cinegen.collision.bodies.neighbours import neighbours
from cinegen.collision.body import Body
from cinegen.ik.seeker import Seeker
from cinegen.model.mechanism import Mechanism

Array = NDArray[np.float64]

_TOUCHING = 1e-3  # of the characteristic length: nearer than this counts as contact
_CONSTANT = 1e-6  # of the characteristic length
_SAMPLES = 400  # configurations
_FEW = 40  # of these, in which points are compared


def pairs_of(mechanism: Mechanism, bodies: Sequence[Body]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of bodies that move against each other and may collide.

    A pair is left out only for one of these reasons:

    - Both bodies are on the same joint, or on joints that are adjacent by structure (see `neighbours`).
    - They touch in every one of 400 configurations sampled within the limits, loops closed. Contact in one
      configuration, be it home, is no reason.
    - They cannot move against each other, or only rotate about a common axis.

    Args:
        mechanism: any.
        bodies: on its joints; convex solids or meshes.

    Returns:
        indices into `bodies`, the smaller first, in lexical order.
    """
    found, _ = sorted_pairs(mechanism, bodies)
    return found


def sorted_pairs(
    mechanism: Mechanism, bodies: Sequence[Body]
) -> tuple[tuple[tuple[int, int], ...], tuple[tuple[int, int], ...]]:
    """Return the pairs that may collide, as `pairs_of` does, and those that touch in every sampled configuration."""
    near = neighbours(mechanism)
    joints = [body.joint for body in bodies]
    candidates = [
        (i, k)
        for i, k in combinations(range(len(bodies)), 2)
        if joints[i] != joints[k] and (min(joints[i], joints[k]), max(joints[i], joints[k])) not in near
    ]
    if not candidates:
        return (), ()
    samples = Seeker(mechanism).spread(_SAMPLES, np.random.default_rng(0))
    always = _always_touching(mechanism, bodies, candidates, samples)
    cores, length = _cores(mechanism, bodies, samples[:_FEW]), mechanism.length
    free = tuple((i, k) for i, k in candidates if (i, k) not in always)
    return tuple((i, k) for i, k in free if not _apart_for_ever(cores[i], cores[k], length)), tuple(sorted(always))


def _always_touching(
    mechanism: Mechanism, bodies: Sequence[Body], pairs: Pairs, samples: Array
) -> set[tuple[int, int]]:
    """Return the pairs that touch in all samples (n, nq). A pair found apart once is not measured again."""
    left, gap = set(pairs), _TOUCHING * mechanism.length
    data = mechanism.model.createData()
    for q in samples:
        if not left:
            break
        pin.forwardKinematics(mechanism.model, data, q)
        at = [data.oMi[body.joint] * body.placement for body in bodies]
        placed = [coal.Transform3s(placement.rotation, placement.translation) for placement in at]
        left = {pair for pair in left if _distance(bodies, placed, *pair) <= gap}
    return left


def _distance(bodies: Sequence[Body], placed: Sequence[coal.Transform3s], i: int, k: int) -> float:
    """Return the distance of two placed bodies, m; 0 or less where they touch."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return float(coal.distance(bodies[i].shape, placed[i], bodies[k].shape, placed[k], request, result))


def _apart_for_ever(first: Array, second: Array, length: float) -> bool:
    """Whether all points of one core stay as far from all of another as they are: (configurations, points, 3) each.

    The shortest distance alone would not do: it may stay what it is, between the nearest ends of two bars, until one
    is folded back along the other. That between two points is an analytic function of the joints: if it is constant
    in some configurations at random, it is everywhere.
    """
    between = np.linalg.norm(first[:, :, None] - second[:, None], axis=3)
    return bool(np.ptp(between, axis=0).max() <= _CONSTANT * length)


def _cores(mechanism: Mechanism, bodies: Sequence[Body], configurations: Array) -> list[Array]:
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
