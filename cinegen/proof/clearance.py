"""Distances between bodies over many boxes at a time: equation 9 of docs/proof.md."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin
from scipy.optimize import nnls

from cinegen.arrays import Array, Indices
from cinegen.collision.body import Body, geometry_model
from cinegen.collision.links import link_bodies
from cinegen.collision.self_collision import PairReason, link_pairs
from cinegen.collision.shapes import SIDES, rounded_hull
from cinegen.joints import kinematic_data
from cinegen.model import Mechanism
from cinegen.proof.equations import Equations
from cinegen.proof.exported_equations import RADIUS, ProofError
from cinegen.proof.matrices import Matrices
from cinegen.proof.tubes import Tubes

_MANY = 64  # corners of a shape, above which the one around it counts
_STEPS = 10_000  # of a plane's normal: whole numbers, which a certificate states in few digits
_MARGIN = 1e-6  # of the characteristic length: for the checker
_AT_ONCE = 16  # boxes


def bodies_of(mechanism: Mechanism) -> list[int]:
    """Return the joints whose bodies have shapes (of `Mechanism.successive`)."""
    return sorted({body.joint for body in link_bodies(mechanism.successive)})


def shapes_of(mechanism: Mechanism) -> dict[str, Any]:
    """Return the shapes of a mechanism and the pairs that may collide, as JSON values; `body` is an index of
    `bodies_of`.

    A shape is the convex hull of points, grown by a radius; each point of it is within `slack` of the body, unless that
    is None.

    Raises:
        ProofError: there are no such pairs, or rods may rotate about themselves.
    """
    joints, rounding, shapes = bodies_of(mechanism), RADIUS * mechanism.length, list[dict[str, Any]]()
    for body in link_bodies(mechanism.successive):
        solid = _solid(body)
        points, radius = rounded_hull(solid.shape)
        shapes.append({
            "name": body.name, "body": joints.index(body.joint), "radius": radius + rounding,
            "slack": _slack(solid) + rounding if solid is body.as_described else None,
            "points": [list(map(float, solid.placement.act(point))) for point in points],
        })  # fmt: skip
    pairs, idle = mechanism.structure.derived(link_pairs).of(PairReason.CHECKED), mechanism.structure.idle_joints
    if idle:
        raise ProofError(
            f"{mechanism.name}: rods may rotate about themselves ({', '.join(idle)}), so that a pose does not "
            "determine distances: leave out the clearance"
        )
    if not pairs:
        raise ProofError(f"{mechanism.name}: no two links may collide: leave out the clearance")
    return {"shapes": shapes, "pairs": [list(pair) for pair in pairs]}


def _solid(body: Body) -> Body:
    """Return the body as it is described, if that has few corners and all of its hull is near it."""
    described = body.as_described
    is_near = isinstance(described.shape, coal.Sphere | coal.Capsule | coal.Box | coal.Cylinder | coal.Convex)
    return described if is_near and len(rounded_hull(described.shape)[0]) <= _MANY else body


def _slack(body: Body) -> float:
    """Return how far points of the rounded hull of a body are from it at most."""
    is_round = isinstance(body.shape, coal.Cylinder)
    return float(body.shape.radius) * (1.0 / math.cos(math.pi / SIDES) - 1.0) if is_round else 0.0


class Distances(NamedTuple):
    """Distances in a box.

    Attributes:
        is_apart: whether all pairs are proved to be farther apart.
        near: names of the nearest pair, if it is proved to be nearer, else of the pair that is not proved.
        is_near: whether it is.
        axis: along which the distance of that pair varies most.
        claim: what the checker needs, JSON values.
    """

    is_apart: bool
    near: str
    is_near: bool
    axis: int
    claim: dict[str, Any]


class Clearances:
    """Bounds the distances between bodies over boxes.

    Args:
        mechanism: without ball joints of one piece.
        equations: of a document.
        document: its JSON values, with bodies and shapes.
        clearance: m.
    """

    def __init__(
        self, mechanism: Mechanism, equations: Equations, document: Mapping[str, Any], clearance: float
    ) -> None:
        self._bodies = Equations({**document, "closures": document["bodies"], "couplings": [], "virtual": []})
        self._mechanism, self._clearance, self._equations = mechanism, clearance, equations
        self._length, self._pairs = float(document["length"]), document["pairs"]
        self._shapes = document["shapes"]
        self._corners = [np.array([[*point, 1.0] for point in shape["points"]]).T for shape in self._shapes]
        self._body = [shape["body"] for shape in self._shapes]
        self._geometry = geometry_model(mechanism, list(map(_solid, link_bodies(mechanism))), pairs=self._pairs)
        self._data = kinematic_data(mechanism.model), self._geometry.createData()
        names = [document["variables"][k]["name"] for k in equations.unknown]
        joints = {name: i for i, name in enumerate(names) if name in mechanism.joints}
        self._columns, self._at = list(joints.values()), [mechanism.q_index(name) for name in joints]
        self._q = mechanism.q_home.copy()
        for k, name in enumerate(mechanism.joints):
            self._q[mechanism.q_index(name)] = document["variables"][k]["at"]

    def examine(self, tubes: Tubes) -> list[Distances]:
        """Return what is known of the distances in boxes."""
        examined = list[Distances]()
        for start in range(0, len(tubes.x), _AT_ONCE):
            some = slice(start, start + _AT_ONCE)
            examined += self._examined(tubes.x[some], tubes.centre[some], tubes.along[some], tubes.near[some])
        return examined

    def _examined(self, x: Array, p: Array, along: Array, y: Array) -> list[Distances]:
        placed, n, boxes = self._placements(x, p, along, y), p.shape[1], np.arange(len(x))
        normals, nearest = self._nearest(x)
        lack, by = np.zeros((len(self._pairs), len(x))), np.zeros((len(self._pairs), len(x), n))
        for k, (i, j) in enumerate(self._pairs):
            first, second = placed[self._body[i]], placed[self._body[j]]
            normal = np.concatenate([normals[:, k], np.zeros((len(x), 1))], axis=1)
            support = self._corners[i].T[np.argmax(normal @ self._corners[i], axis=1)]
            turned = Matrices(*(m.swapaxes(-1, -2) for m in first.times(normal[:, :, None])))
            away, base = second.times(np.tile(self._corners[j], (len(x), 1, 1))), first.times(support[:, :, None])
            away = Matrices(away.c - base.c, away.g - base.g, away.r + base.r)
            beyond, size = turned.by(away, n), np.linalg.norm(normal, axis=1)
            lowest = beyond.c[:, 0] - np.abs(beyond.g[:, :, 0]).sum(axis=1) - beyond.r[:, 0]
            corner = np.argmin(lowest, axis=1)
            by[k] = np.abs(beyond.g[boxes, :n, 0, corner])
            rest = self._shapes[i]["radius"] + self._shapes[j]["radius"]
            lack[k] = self._clearance + _MARGIN * self._length + rest - lowest[boxes, corner] / size
        examined = list[Distances]()
        for b, k in enumerate(np.argmax(lack, axis=0).tolist()):
            is_apart, claim = bool(lack[k, b] < 0.0), {"planes": normals[b].tolist()}
            near = None if is_apart else self._near(placed, b, *nearest[b])
            if near is not None:
                k, claim = nearest[b][0], near
            names = " and ".join(self._shapes[i]["name"] for i in self._pairs[k])
            examined.append(Distances(is_apart, names, near is not None, int(np.argmax(by[k, b])), claim))
        return examined

    def _placements(self, x: Array, p: Array, along: Array, y: Array) -> list[Matrices]:
        """Return the placements (boxes, 3, 4) of all bodies, m."""
        at, change, n = self._bodies.at(x, p), self._bodies.change(x, p, along, y), p.shape[1]
        width, count = along.shape[1:]
        jacobian, unsure = (at.jacobian[:, k, :, :width] for k in range(2))
        turned, rest = 0.5 * (change.by[..., :width] @ along[:, None]), 0.5 * (change.bent + change.apart)[..., :width]
        slopes, is_product = (jacobian @ along).swapaxes(1, 2), np.ones((count, count), dtype=bool)
        bends = turned.transpose(0, 1, 3, 2)  # (boxes, j, k, rows)
        j, k = np.triu_indices(n)
        slopes[:, n:] += (bends[:, j, k] + bends[:, k, j]) * np.where(j == k, 0.5, 1.0)[:, None]
        is_product[:n, :n] = False
        radius = at.residual[:, 1] + np.abs(bends[:, is_product]).sum(axis=1)
        radius += ((rest + unsure) @ np.abs(along).sum(axis=-1)[..., None])[..., 0]
        size = np.abs(jacobian) + unsure + rest + 0.5 * np.abs(change.by[..., :width]).sum(axis=1)
        radius += (size[..., : x.shape[1]] @ y[..., None])[..., 0]
        scale = np.array([1.0, 1.0, 1.0, self._length])
        parts = (m.reshape(*m.shape[:-1], -1, 3, 4) * scale for m in (at.residual[:, 0], slopes, radius))
        c, g, r = parts
        return [Matrices(c[:, i], g[:, :, i], r[:, i]) for i in range(c.shape[1])]

    def _nearest(self, x: Array) -> tuple[Indices, list[tuple[int, Array, Array]]]:
        """Return normals (boxes, pairs, 3) of planes between bodies in the frames of the first ones, in whole numbers;
        and of each box the nearest pair, with its nearest points (3,) in the frames of their joints, m."""
        normals, nearest = np.zeros((len(x), len(self._pairs), 3), dtype=np.intp), list[tuple[int, Array, Array]]()
        model, (data, shapes) = self._mechanism.model, self._data
        for b, values in enumerate(x * self._equations.units):
            self._q[self._at] = values[self._columns]
            pin.forwardKinematics(model, data, self._q)
            pin.updateGeometryPlacements(model, data, self._geometry, shapes)
            k = int(pin.computeDistances(self._geometry, shapes))
            frames = [data.oMi[body.parentJoint] for body in self._geometry.geometryObjects]
            for pair, (result, (i, _)) in enumerate(zip(shapes.distanceResults, self._pairs, strict=True)):
                normals[b, pair] = np.rint(_STEPS * (frames[i].rotation.T @ result.normal))
            i, j = self._pairs[k]
            points = shapes.distanceResults[k].getNearestPoint1(), shapes.distanceResults[k].getNearestPoint2()
            nearest.append((k, frames[i].actInv(points[0]), frames[j].actInv(points[1])))
        return normals, nearest

    def _near(self, placed: list[Matrices], b: int, k: int, *points: Array) -> dict[str, Any] | None:
        """Return what proves that a pair is nearer than asked for in box b, if it is."""
        weights, ends, most = list[list[float]](), list[Matrices](), self._clearance - _MARGIN * self._length
        for i, point in zip(self._pairs[k], points, strict=True):
            shape, corners = self._shapes[i], self._corners[i]
            if shape["slack"] is None:
                return None
            weight = nnls(corners, [*point, 1.0])[0]
            weights.append(weight.tolist())
            placement = Matrices(*(m[b : b + 1] for m in placed[self._body[i]]))
            ends.append(placement.times((corners @ weight / weight.sum())[None, :, None]))
            most += shape["radius"] - shape["slack"]
        first, second = ends
        size = np.abs(first.c - second.c) + np.abs(first.g - second.g).sum(axis=1) + first.r + second.r
        return {"pair": k, "weights": weights} if np.linalg.norm(size) < most else None
