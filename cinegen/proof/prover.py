"""`prove`: boxes of poses in which a robot has exactly one configuration on a branch, within limits, regular.

docs/proof.md derives the test: a parametric Krawczyk operator about X(eps) = x_0 + S eps, S = -F_x^-1 F_p diag(r). A
box that fails is halved along the axis along which F_x varies most. What is written here is a claim: the result is
that of `cinegen.proof.checker`, which shares no code with this module.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.proof.affine import Form
from cinegen.proof.equations import Equations, Matrices

BOXES = 10_000
"""Default number of boxes that are tested."""

_BATCH = 256
_NEWTON, _CONVERGED = 8, 1e-9
_ROUNDS = 4  # radii of a tube that are tried, 0 first
_WIDER = 1.25  # times the radius that would just do: a margin for the checker
_LOST = 4  # halvings of a box in whose middle no configuration is found
_SURE = 0.98  # part of a bound that is used: the rest is a margin for the checker
_TINY = 1e-11  # rad and characteristic lengths: smallest radius

PROVED, REGULAR, LIMIT, OPEN = "proved", "regular", "limit", "open"
"""Claims of a box: everything holds; one configuration, no more is claimed; ... and a joint is beyond a limit in all of
it; nothing."""


@dataclass(frozen=True)
class Leaf:
    """A box that is not halved.

    Attributes:
        claim: what is claimed of it.
        reason: why no more is claimed; or the joint that is beyond its limit.
        x: (unknowns,) the configuration at its centre, rad and m.
        y: (unknowns,) radius of the tube in which the configuration is the only one, rad and m.
    """

    claim: str
    reason: str
    x: list[float] = field(default_factory=list)
    y: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class _Box:
    node: int
    low: Array
    high: Array
    x: Array
    lost: int = 0  # halvings since a configuration was found


class Prover:
    """Halves a region until its boxes are proved, or a number of them is tested.

    Args:
        equations: as many as there are unknowns.
        limits: whether joints must stay within theirs.
    """

    def __init__(self, equations: Equations, limits: bool) -> None:
        self.equations, self._limits = equations, limits
        self.nodes: list[tuple[int, int, int] | Leaf | None] = [None]
        self.tested = 0

    def run(self, low: Array, high: Array, x: Array, boxes: int, report: Callable[[float], None] | None = None) -> None:
        """Prove a region.

        Args:
            low: (parameters,) its lower ends, m and rad.
            high: its upper ends.
            x: (unknowns,) dimensionless configuration at its centre.
            boxes: number of boxes that are tested.
            report: is called with the share of the volume that is not halved any more.
        """
        waiting, decided, volume = [_Box(0, low, high, x)], 0.0, float(np.prod(high - low))
        while waiting:
            batch, waiting = waiting[:_BATCH], waiting[_BATCH:]
            budget = boxes - self.tested - len(waiting)
            self.tested += len(batch)
            for box, (leaf, axis, halves) in zip(batch, self._tested(batch), strict=True):
                middle, lost = 0.5 * (box.low[axis] + box.high[axis]), 0 if halves else box.lost + 1
                splits = leaf.claim in (REGULAR, OPEN) and budget >= 2 and lost <= _LOST
                if not splits or not box.low[axis] < middle < box.high[axis]:
                    self.nodes[box.node] = leaf
                    decided += float(np.prod(box.high - box.low))
                    continue
                budget, first = budget - 2, len(self.nodes)
                self.nodes[box.node] = (axis, first, first + 1)
                self.nodes += [None, None]
                ends = box.high.copy(), box.low.copy()
                ends[0][axis] = ends[1][axis] = middle
                x_low, x_high = halves or (box.x, box.x)
                waiting.append(_Box(first, box.low, ends[0], x_low, lost))
                waiting.append(_Box(first + 1, ends[1], box.high, x_high, lost))
            if report is not None:
                report(decided / volume)

    def tree(self) -> list[Any]:
        """Return the nodes in preorder: the axis of a halved box, or a leaf as JSON values."""
        found, stack = list[Any](), [0]
        while stack:
            node = self.nodes[stack.pop()]
            assert node is not None
            if isinstance(node, Leaf):
                tube = {"x": node.x, "y": node.y} if node.x else {}
                found.append({"claim": node.claim, "reason": node.reason, **tube})
            else:
                found.append(node[0])
                stack += [node[2], node[1]]
        return found

    # --- one batch ---------------------------------------------------------------------------------------------------

    def solve(self, p: Array, x: Array) -> tuple[Array, Array, Bools]:
        """Return configurations (boxes, unknowns) by Newton's method, inverse Jacobians, and which converged."""
        e, done = self.equations, np.zeros(len(x), dtype=bool)
        jacobian = np.zeros((len(x), x.shape[1], x.shape[1]))
        for _ in range(_NEWTON):
            variables = e.values(_point(x), _point(p))
            jacobian = e.matrices(variables).jacobian.a[0][..., : x.shape[1]]
            residual = e.residual(variables).a[0]
            inverse = _inverse(jacobian)
            step = -(inverse @ residual[..., None])[..., 0]
            size = np.abs(step).max(axis=1)
            done = size < _CONVERGED
            step *= np.minimum(1.0, 0.5 / np.maximum(size, _TINY))[:, None]
            x = x + np.where(np.isfinite(step), step, 0.0)
            if done.all():
                break
        return x, inverse, done

    def _tested(self, batch: list[_Box]) -> list[tuple[Leaf, int, tuple[Array, Array] | None]]:
        """Return of each box the claim, the axis along which it would be halved, and configurations at the centres of
        both halves; None where none is found."""
        e, count = self.equations, len(self.equations.unknown)
        low, high = np.array([box.low for box in batch]), np.array([box.high for box in batch])
        centre, width = 0.5 * (low + high), count + low.shape[1]
        radius = np.maximum(high - centre, centre - low)
        x, inverse, done = self.solve(centre, np.array([box.x for box in batch]))
        variables = e.values(_point(x), _point(centre))
        at_centre = e.residual(variables)[..., None].left(inverse)[..., 0]
        slopes = -(inverse @ e.matrices(variables).jacobian.a[0][..., count:width]) * radius[:, None, :]
        p = Form(np.stack([centre, *np.moveaxis(radius[..., None] * np.eye(low.shape[1]), -1, 0)]), 0.0 * radius)
        tube = Form(np.stack([x, *np.moveaxis(slopes, -1, 0)]), np.zeros(x.shape))
        y, z, regular = np.zeros(x.shape), np.zeros(x.shape), np.zeros(len(x), dtype=bool)
        for k in range(_ROUNDS):
            matrices = e.matrices(e.values(tube.widened(y), p))
            product = matrices.jacobian[..., :width].left(inverse)
            if k == 0:
                z = _residual(at_centre.a[0], product, slopes, radius) + at_centre.r
            defect = product[..., :count].minus_one()
            image = z + (defect.most @ y[..., None])[..., 0]
            regular = done & (image < _SURE * y).all(axis=1) & (y < 1.0).all(axis=1)
            better = _WIDER * _solved(defect.most, z) + _TINY
            usable = ~regular & (better > 0.0).all(axis=1) & (better < 1.0).all(axis=1)
            if k == _ROUNDS - 1 or not usable.any():
                break
            y = np.where(usable[:, None], better, y)
        axes = np.argmax(np.abs(defect.a[1:]).sum(axis=(-1, -2)), axis=0).tolist()
        claims = self._claims(tube.widened(image), matrices)
        found = list[tuple[Leaf, int, tuple[Array, Array] | None]]()
        for i, axis in enumerate(axes):
            leaf, step = Leaf(OPEN, "no configuration is found"), 0.5 * slopes[i][:, axis]
            if done[i]:
                leaf = Leaf(OPEN, "no unique configuration is proved")
            if regular[i] and claims[i][0] != OPEN:
                leaf = Leaf(*claims[i], (x[i] * e.units).tolist(), (y[i] * e.units).tolist())
            found.append((leaf, axis, (x[i] - step, x[i] + step) if done[i] else None))
        return found

    def _claims(self, image: Form, matrices: Matrices) -> list[tuple[str, str]]:
        """Return what is claimed of each box if it is regular, and why no more is.

        Args:
            image: the forms (boxes, unknowns) that contain the configurations.
            matrices: over the tubes.
        """
        e, found = self.equations, list[tuple[str, str]]()
        low, high = image.a[0] - image.spread, image.a[0] + image.spread
        agree = (matrices.positive.a[0] - matrices.positive.spread > 0.0).all(axis=1)
        beyond = self._limits & ((low > e.upper) | (high < e.lower))
        crossed = self._limits & ((high >= e.upper) | (low <= e.lower))
        for i, is_controlled in enumerate(self._controlled(matrices.jacobian).tolist()):
            if not agree[i]:
                found.append((OPEN, "ends of a closure may be opposed"))
            elif beyond[i].any():
                found.append((LIMIT, e.names[int(beyond[i].argmax())]))
            elif crossed[i].any():
                found.append((REGULAR, f"a limit of {e.names[int(crossed[i].argmax())]} may be crossed"))
            elif not is_controlled:
                found.append((REGULAR, "a singularity of type 2 is not excluded"))
            else:
                found.append((PROVED, ""))
        return found

    def _controlled(self, jacobian: Form) -> Bools:
        """Return of which boxes (boxes,) no motion remains with all actuated joints locked: of type 2 there is none."""
        locked = jacobian[..., self.equations.locked]
        if locked.r.shape[-1] != locked.r.shape[-2]:  # actuated redundantly
            return np.zeros(len(locked.r), dtype=bool)
        left = _preconditioned(locked.left(_inverse(locked.a[0])).minus_one())
        weights = _solved(left, np.ones(left.shape[:2]))
        lesser = (left @ weights[..., None])[..., 0] < _SURE * weights
        return np.asarray(lesser.all(axis=1) & (weights > 0.0).all(axis=1))


def _point(x: Array) -> Form:
    return Form(x[None], np.zeros(x.shape))


def _residual(at_centre: Array, product: Form, slopes: Array, radius: Array) -> Array:
    """Return a bound (boxes, n) of |C F(X(eps), P(eps))|.

    Args:
        at_centre: (boxes, n) C F at eps = 0.
        product: C times the derivative by unknowns and parameters.
        slopes: (boxes, n, parameters) S.
        radius: (boxes, parameters) r.
    """
    n = slopes.shape[1]
    a = product.a[..., :n] @ slopes + product.a[..., n:] * radius[:, None, :]
    r = product.r[..., :n] @ np.abs(slopes) + product.r[..., n:] * radius[:, None, :]
    second = 0.5 * np.moveaxis(a[1:], 0, -1)  # (boxes, n, k, j): d/d eps_j of the column of eps_k
    squares = np.diagonal(second, axis1=-2, axis2=-1)
    mixed = np.abs(np.triu(second + np.swapaxes(second, -1, -2), 1)).sum(axis=(-1, -2))
    low = at_centre + np.minimum(squares, 0.0).sum(axis=-1)
    high = at_centre + np.maximum(squares, 0.0).sum(axis=-1)
    more = mixed + np.abs(a[0]).sum(axis=-1) + r.sum(axis=-1)
    return np.asarray(np.maximum(np.abs(low), np.abs(high)) + more)


def _preconditioned(product: Form) -> Array:
    """Return E for the preconditioner C - sum_j eps_j C W_j C, where C W = 1 + `product` with C constant."""
    slopes, rest = product.a[1:], np.abs(product.a[0]) + product.r
    found = rest + np.abs(slopes).sum(axis=0) @ rest
    for j, first in enumerate(slopes):
        found = found + np.abs(first @ first)
        for second in slopes[:j]:
            found = found + np.abs(first @ second + second @ first)
    return np.asarray(found)


def _inverse(matrices: Array) -> Array:
    """Return inverses; NaN where there is none."""
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full(matrices.shape, np.nan)
        return np.concatenate([_inverse(matrix[None]) for matrix in matrices])


def _solved(defect: Array, right: Array) -> Array:
    """Return (1 - E)^-1 (boxes, n, n) times vectors (boxes, n): all positive only if E is small."""
    return np.asarray((_inverse(np.eye(defect.shape[-1]) - defect) @ right[..., None])[..., 0])
