"""The characteristic length of a mechanism, which makes translations commensurable with angles.

Let s_i = (v_i, w_i) be the unit twists of all joints at home, those of the cut joints included, each with the velocity
v_i of the point at the origin and the angular velocity w_i; a prismatic joint has w_i = 0. About a point c, the moment
of a rotation is m_i = v_i + w_i x c: its length is the distance of the axis from c. The *centre* is the point c for
which the sum of all |m_i|^2 is least, and the *characteristic length* is

    L = sqrt(3) S,    S = sqrt(sum |m_i|^2 / sum |w_i|^2).

S is the *spread* of the axes of rotation: their root mean square distance from the centre. A ball joint counts as
three rotations about its point. The factor makes L an extent of the robot: half the length of a straight arm with
evenly distributed axes. Divided by S, the moments and the directions of all rotations have the same Frobenius norm.
J. Angeles' characteristic length of an isotropic manipulator ("The design of isotropic manipulator architectures in the
presence of redundancies", International Journal of Robotics Research 11, 1992) is the ratio of these norms, too, there
about the point of the end effector; this definition needs no isotropy, no optimisation and no end effector.

L depends on the axes alone: not on frames drawn on links or along axes, nor on which link is the base, on which joints
are cut, on their order, or on the base pose; it is proportional to size. Axes that are parallel up to a few
degrees do not determine the centre along their direction; there it stays near a given point, so that rounding does not
move it far, and no moment depends on it if they are parallel.

Where all axes nearly meet in one point, as in a wrist, or where there is none, as in a gantry, they give no scale.
`characteristic_length` then passes, smoothly, to the largest lever arm: the distance of a node from an axis about which
it turns; and where there is none either, to half the largest distance of two nodes.
"""

from __future__ import annotations

import math

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.raff.document import LoopKind

_EXTENT = math.sqrt(3.0)
"""Half the length of a straight line over the root mean square distance of its points from the middle."""

_PARALLEL = (1e-4, 1e-2)
"""Sum of squared sines between axes and a direction: along it, they do not determine their centre; they do."""

_SMALL = (1e-3, 0.1)
"""A length below the first fraction of the next one gives no scale; above the second, the next one does not count."""

_POINT = 1e-15  # m: a robot no larger than this is a point


def characteristic_length(screws: Array, points: Array, moves: Array) -> float:
    """Return the characteristic length, m.

    Args:
        screws: (6, k) unit twists of all joints that move: the velocity of the point at the origin above the angular
            velocity.
        points: (n, 3) origins of the nodes, m.
        moves: (n, k) whether a joint moves a node; False for cut joints.

    Returns:
        The length; 1 for a robot that is a point.
    """
    turning = np.any(screws[3:] != 0.0, axis=0)
    rotations, middle = screws[:, turning], points.mean(axis=0)
    about = centre(rotations, middle)
    length = _EXTENT * spread(rotations, about)
    outermost = np.linalg.norm(moments(rotations, about), axis=0).max(initial=0.0)
    reach = float(outermost + np.linalg.norm(points - about, axis=1).max())  # no arm is longer, nor half the extent
    if length < 2.0 * _SMALL[1] * reach:
        arm = max(
            float(np.linalg.norm(moments(rotations[:, of], point), axis=0).max(initial=0.0))
            for point, of in zip(points, moves[:, turning], strict=True)
        )
        extent = 0.5 * max(float(np.linalg.norm(points - point, axis=1).max()) for point in points)
        length = scale_of(length, scale_of(arm, extent))
    return length if length > _POINT else 1.0


def centre(rotations: Array, near: Array) -> Array:
    """Return the centre (3,) of axes of rotation.

    Args:
        rotations: (6, k) twists, none without angular velocity.
        near: (3,) where the centre is along directions in which the axes do not determine it.
    """
    v, w = rotations[:3], rotations[3:]
    matrix = (w**2).sum() * np.eye(3) - w @ w.T
    values, vectors = np.linalg.eigh(matrix)
    known = _ramp(values, *_PARALLEL)
    right = np.cross(w, v, axis=0).sum(axis=1) - matrix @ near
    return np.asarray(near + vectors @ (known / np.maximum(values, _PARALLEL[0]) * (vectors.T @ right)))


def spread(rotations: Array, about: Array) -> float:
    """Return the root mean square distance (m) of axes of rotation (6, k) from a point (3,); 0 without axes."""
    total = float((rotations[3:] ** 2).sum())
    return float(np.sqrt((moments(rotations, about) ** 2).sum() / total)) if total > 0.0 else 0.0


def moments(rotations: Array, about: Array) -> Array:
    """Return the moments (3, k) of axes of rotation (6, k) about a point (3,): the velocities of that point."""
    return np.asarray(rotations[:3] + np.cross(rotations[3:], about[:, None], axis=0))


def cut_screws(kind: LoopKind, placement: Array) -> Array:
    """Return the unit twists (6, dof) of a joint that was cut, at a placement (4, 4); of a ball about x, y and z."""
    point = placement[:3, 3]
    axes = {LoopKind.RIGID: np.zeros((3, 0)), LoopKind.BALL: np.eye(3)}.get(kind, placement[:3, 2:3])
    if kind is LoopKind.PRISMATIC:
        return np.vstack([axes, np.zeros_like(axes)])
    return np.vstack([np.cross(point[:, None], axes, axis=0), axes])


def scale_of(length: float, other: float) -> float:
    """Return a length, or another where it is far smaller than that, and smoothly what lies between."""
    if not length > _SMALL[0] * other:
        return other
    if not length < _SMALL[1] * other:
        return length
    known = float(_ramp(np.log(length / other), *np.log(_SMALL)))
    return float(length**known * other ** (1.0 - known))


def _ramp(x: Array, low: float, high: float) -> Array:
    """Return 0 below a bound, 1 above another, and smoothly what lies between."""
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))
