"""`prove`: boxes of poses in which a robot has exactly one configuration on a branch, within limits, regular.

docs/proof.md derives the test: a parametric Krawczyk operator about X(eps) = x_0 + S eps, S = -F_x^-1 F_p diag(r). A
box that fails is halved along the axis along which F_x varies most. What is written here is a claim: the result is
that of `cinegen.proof.checker`, which shares no code with this module.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.proof.clearance import Clearances
from cinegen.proof.equations import Change, Equations, Point
from cinegen.proof.reach import ReachTest
from cinegen.proof.singular import SingularValues

BOXES = 10_000
"""Default number of boxes that are tested."""

_BATCH, _FEW = 256, 2  # boxes that are tested together; while the other sign of a determinant is looked for
_NEWTON, _CONVERGED = 8, 1e-9
_ROUNDS = 4  # radii of a tube that are tried, 0 first
_WIDER = 1.25  # times the radius that would just do: a margin for the checker
_LOST = 8  # halvings of a box in whose middle no configuration is found
_SURE = 0.98  # part of a bound that is used: the rest is a margin for the checker
_SURE_OF_SIGMA = 0.95  # likewise of a singular value, which the checker bounds by powers
_LEAST = 1e-7  # part of a range of the region: boxes that are smaller are not halved
_ROUNDED = 1e-9  # by so much a box is farther out than the edge of the region
_TINY = 1e-11  # rad and characteristic lengths: smallest radius

PROVED, REGULAR, LIMIT, SIGMA, OPEN, OUTSIDE = "proved", "regular", "limit", "sigma", "open", "outside"
NEAR, UNREACHABLE = "clearance", "unreachable"
"""Claims of a box: everything holds; one configuration, no more is claimed; ... and a joint is beyond a limit in all of
it; ... and a singular value is below its bound in all of it; nothing; it is not in the region; ... and two bodies are
near in all of it; no configuration."""

ROUND = {"box": 0, "cylinder": 2, "ball": 6}
"""Shapes of regions: so many coordinates, the first ones, lie in an ellipse or ellipsoid that touches their ranges."""


@dataclass(frozen=True)
class Leaf:
    """A box that is not halved.

    Attributes:
        claim: what is claimed of it.
        reason: why no more is claimed; or the joint that is beyond its limit, or the singular value.
        x: (unknowns,) the configuration at its centre, rad and m.
        y: (unknowns,) radius of the tube in which the configuration is the only one, rad and m.
        more: what shows that bodies are apart, or near, JSON values.
    """

    claim: str
    reason: str
    x: list[float] = field(default_factory=list)
    y: list[float] = field(default_factory=list)
    more: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class _Box:
    node: int
    low: Array
    high: Array
    x: Array
    lost: int = 0  # halvings since a configuration was found
    determinant: float = 0.0  # of the locked joints' matrix, at the centre of what was halved


class _Tested(NamedTuple):
    """A box that was tested: its claim; the axis along which it would be halved; configurations at the centres of both
    halves, None where none is found; the determinant of the locked joints' matrix at its centre, and whether it has the
    same sign in all of it."""

    leaf: Leaf
    axis: int
    halves: tuple[Array, Array] | None
    determinant: float
    is_sure: bool


class Prover:
    """Halves a region until its boxes are proved, or a number of them is tested.

    Args:
        equations: as many as there are unknowns.
        reach: excludes boxes that no configuration reaches.
        limits: whether joints must stay within theirs.
        sigma: what the smallest singular values must be above, if there are
        values: which bounds them.
        clearances: which bounds the distances of bodies, if that is wanted.
    """

    def __init__(
        self, equations: Equations, reach: ReachTest, limits: bool, sigma: float | None = None,
        values: SingularValues | None = None, clearances: Clearances | None = None,
    ) -> None:  # fmt: skip
        self.equations, self._reach, self._limits, self._sigma, self._values = equations, reach, limits, sigma, values
        self._clearances = clearances
        self.nodes = list[tuple[int, int, int] | Leaf | None]()
        self.tested = 0

    def run(
        self, low: Array, high: Array, x: Array, boxes: int, shape: str = "box", whole: bool = False,
        report: Callable[[float], None] | None = None,
    ) -> bool:  # fmt: skip
        """Prove a region; return whether all of it is.

        Args:
            low: (parameters,) its lower ends, m and rad.
            high: its upper ends.
            x: (unknowns,) dimensionless configuration at its centre.
            boxes: number of boxes that are tested.
            shape: of `ROUND`.
            whole: whether to stop at the first box that is not proved.
            report: is called with the share of the volume that is not halved any more.
        """
        self.nodes, self.tested, waiting = [None], 0, [_Box(0, low, high, x)]
        decided, volume, all_proved, signs, other = 0.0, float(np.prod(high - low)), True, set[float](), 0.0
        centre, radius, count = 0.5 * (low + high), 0.5 * (high - low), ROUND[shape]
        while waiting:
            if (
                other and not whole
            ):  # that sign refutes the region: down to a small box, where the determinant is largest
                waiting.sort(key=lambda box: _urgency(box, other))
            some = _FEW if other * waiting[0].determinant > 0.0 else _BATCH
            batch, waiting = waiting[:some], waiting[some:]
            budget = boxes - self.tested - len(waiting)
            self.tested += len(batch)
            for box, (leaf, axis, halves, determinant, is_sure) in zip(batch, self._tested(batch), strict=True):
                if box.node == 0:
                    other = -float(np.sign(determinant))
                elif is_sure and leaf.x:
                    signs.add(float(np.sign(determinant)))
                    other = -next(iter(signs)) if len(signs) == 1 else 0.0
                axis = axis if halves else int(np.argmax((box.high - box.low) / (high - low)))
                middle, lost = 0.5 * (box.low[axis] + box.high[axis]), 0 if halves else box.lost + 1
                nearest = (np.clip(centre, box.low, box.high) - centre) / radius
                if (nearest[:count] ** 2).sum() > 1.0 + _ROUNDED:
                    leaf = Leaf(OUTSIDE, "")
                splits = leaf.claim in (REGULAR, OPEN) and budget >= 2 and lost <= _LOST
                if not splits or box.high[axis] - box.low[axis] < _LEAST * (high - low)[axis]:
                    self.nodes[box.node] = leaf
                    decided += float(np.prod(box.high - box.low))
                    all_proved = all_proved and leaf.claim in (PROVED, OUTSIDE)
                    continue
                budget, first = budget - 2, len(self.nodes)
                self.nodes[box.node] = (axis, first, first + 1)
                self.nodes += [None, None]
                ends = box.high.copy(), box.low.copy()
                ends[0][axis] = ends[1][axis] = middle
                x_low, x_high = halves or (box.x, box.x)
                waiting.append(_Box(first, box.low, ends[0], x_low, lost, determinant))
                waiting.append(_Box(first + 1, ends[1], box.high, x_high, lost, determinant))
            if whole and not all_proved:
                return False
            if report is not None:
                report(decided / volume)
        return all_proved

    def tree(self) -> list[Any]:
        """Return the nodes in preorder: the axis of a halved box, or a leaf as JSON values."""
        nodes, stack = list[Any](), [0]
        while stack:
            node = self.nodes[stack.pop()]
            assert node is not None
            if isinstance(node, Leaf):
                tube = {"x": node.x, "y": node.y, **node.more} if node.x else {}
                nodes.append({"claim": node.claim, "reason": node.reason, **tube})
            else:
                nodes.append(node[0])
                stack += [node[2], node[1]]
        return nodes

    # --- one batch ---------------------------------------------------------------------------------------------------

    def solve(self, p: Array, x: Array) -> tuple[Array, Array, Bools]:
        """Return configurations (boxes, unknowns) by Newton's method, inverse Jacobians, and which converged."""
        e, done = self.equations, np.zeros(len(x), dtype=bool)
        inverse = np.zeros((len(x), x.shape[1], x.shape[1]))
        for _ in range(_NEWTON):
            values = e.at(x, p)
            inverse = _inverse(values.jacobian[:, 0, e.rows, : x.shape[1]])
            step = -(inverse @ values.residual[:, 0, e.rows, None])[..., 0]
            size = np.abs(step).max(axis=1)
            done = size < _CONVERGED
            step *= np.minimum(1.0, 0.5 / np.maximum(size, _TINY))[:, None]
            x = x + np.where(np.isfinite(step), step, 0.0)
            if done.all():
                break
        return x, inverse, done

    def _tested(self, batch: list[_Box]) -> list[_Tested]:
        e, count = self.equations, len(self.equations.unknown)
        low, high = np.array([box.low for box in batch]), np.array([box.high for box in batch])
        centre = 0.5 * (low + high)
        radius = np.maximum(high - centre, centre - low)
        x, inverse, done = self.solve(centre, np.array([box.x for box in batch]))
        x, inverse = np.where(done[:, None], x, 0.0), np.where(done[:, None, None], inverse, 0.0)
        at = e.at(x, centre)
        along = self._along(x, centre, radius, inverse, at)
        y, image, regular = np.zeros(x.shape), np.zeros(x.shape), np.zeros(len(x), dtype=bool)
        for k in range(_ROUNDS):
            change = e.change(x, centre, along, y)
            z, bends, defect = self._image(at, change, inverse, along)
            image = z + (defect @ y[..., None])[..., 0]
            regular = done & (image < _SURE * y).all(axis=1) & (y < 1.0).all(axis=1)
            better = _WIDER * _solved(defect, z) + _TINY
            usable = ~regular & (better > 0.0).all(axis=1) & (better < 1.0).all(axis=1)
            if k == _ROUNDS - 1 or not usable.any():
                break
            y = np.where(usable[:, None], better, y)
        axes = np.argmax(bends, axis=1).tolist()
        determinants, is_sure = self._determinants(at, change)
        claims = self._claims(x, np.abs(along[:, :count]).sum(axis=-1) + image, is_sure)
        best = [i for i in range(len(x)) if regular[i] and claims[i][0] == PROVED]
        if self._values is not None and best:
            points, tubes = Point(*(m[best] for m in at)), (x[best], centre[best], along[best], y[best])
            least, most = self._values.smallest(*tubes, points, e.change(*tubes, sharp=True))
            for k, i in enumerate(best):
                claims[i] = self._judged(least[:, k], most[:, k])
        best = [i for i in range(len(x)) if regular[i] and claims[i][0] == PROVED]
        more: dict[int, Mapping[str, Any]] = {}
        if self._clearances is not None and best:
            distances = self._clearances.examine(x[best], centre[best], along[best], y[best])
            for i, result in zip(best, distances, strict=True):
                more[i] = result.claim
                if not result.is_apart:
                    axes[i] = result.axis
                    claims[i] = (NEAR, result.near) if result.is_near else (REGULAR, f"{result.near} may be near")
        tested = list[_Tested]()
        excluded = self._reach.excludes(low, high)
        for i, axis in enumerate(axes):
            leaf, step = Leaf(OPEN, "no configuration is found"), 0.5 * along[i, :count, axis]
            if done[i]:
                leaf = Leaf(OPEN, "no unique configuration is proved")
            if regular[i] and claims[i][0] != OPEN:
                leaf = Leaf(*claims[i], (x[i] * e.units).tolist(), (y[i] * e.units).tolist(), more.get(i, {}))
            if excluded[i] and not regular[i]:
                leaf = Leaf(UNREACHABLE, "")
            halves = (x[i] - step, x[i] + step) if done[i] else None
            tested.append(_Tested(leaf, axis, halves, float(determinants[i]) if done[i] else 0.0, bool(is_sure[i])))
        return tested

    def _along(self, x: Array, centre: Array, radius: Array, inverse: Array, at: Point) -> Array:
        """Return how X and P (boxes, unknowns + parameters, .) change by eps and by its products."""
        e, count, n = self.equations, x.shape[1], centre.shape[1]
        slopes = -(inverse @ at.jacobian[:, 0, e.rows, count : count + n]) * radius[:, None, :]
        along = np.concatenate([slopes, radius[..., None] * np.eye(n)], axis=1)
        return _curved(inverse[:, None] @ e.change(x, centre, along, 0.0 * x).by[:, :, e.rows], along)

    def _image(self, at: Point, change: Change, inverse: Array, along: Array) -> tuple[Array, Array, Array]:
        """Return z (boxes, unknowns), how much each eps changes C F_x (boxes, n), and E (boxes, unknowns, unknowns).

        Args:
            at: at the centres.
            change: over the boxes.
            inverse: C.
            along: (boxes, unknowns + parameters, n + n (n + 1) / 2) of X and P, by eps and its products.
        """
        rows, count, n = self.equations.rows, inverse.shape[1], along.shape[1] - inverse.shape[1]
        width, size, spread = count + n, np.abs(inverse), np.abs(along).sum(axis=-1)[..., None]
        jacobian, unsure = at.jacobian[:, 0, rows, :width], at.jacobian[:, 1, rows, :width]
        bent, apart = change.bent[:, rows, :width], change.apart[:, rows, :width]
        by = inverse[:, None] @ change.by[:, :, rows, :width]
        z = size @ (at.residual[:, 1, rows, None] + (unsure + bent / 3.0) @ spread)
        z += np.abs(inverse @ at.residual[:, 0, rows, None])
        z = z[..., 0] + np.abs(inverse @ jacobian @ along[..., :n]).sum(axis=-1)
        curved = np.abs(along[..., n:]).sum(axis=-1)[..., None]
        z += (
            np.abs(by[:, :n] @ along[:, None, :, n:]).sum(axis=(1, -1))
            + (0.5 * np.abs(by[:, n:]).sum(axis=1) @ curved)[..., 0]
        )
        constant = np.abs(inverse @ jacobian[..., :count] - np.eye(count)) + size @ unsure[..., :count]
        z += (constant @ curved[:, :count])[..., 0]
        bends = np.abs(by[..., :count])
        defect = constant + bends.sum(axis=1) + size @ (bent + apart)[..., :count]
        return z, bends[:, :n].sum(axis=(-1, -2)), defect

    def _claims(self, x: Array, radius: Array, is_sure: Bools) -> list[tuple[str, str]]:
        """Return what is claimed of each box if it is regular, and why no more is.

        Args:
            x: (boxes, unknowns) the configurations are within
            radius: (boxes, unknowns) of it.
            is_sure: (boxes,) whether no motion remains with all actuated joints locked.
        """
        e, claims, low, high = self.equations, list[tuple[str, str]](), x - radius, x + radius
        beyond = self._limits & ((low > e.upper) | (high < e.lower))
        crossed = self._limits & ((high >= e.upper) | (low <= e.lower))
        for i, is_controlled in enumerate(is_sure.tolist()):
            if beyond[i].any():
                claims.append((LIMIT, e.names[int(beyond[i].argmax())]))
            elif crossed[i].any():
                claims.append((REGULAR, f"a limit of {e.names[int(crossed[i].argmax())]} may be crossed"))
            elif not is_controlled:
                claims.append((REGULAR, "a singularity of type 2 is not excluded"))
            else:
                claims.append((PROVED, ""))
        return claims

    def _judged(self, least: Array, most: Array) -> tuple[str, str]:
        """Return what is claimed of a box by bounds (2,) of its singular values from below and above."""
        assert self._sigma is not None
        if (most < _SURE_OF_SIGMA * self._sigma).any():
            return SIGMA, f"sigma_{1 + int(most.argmin())}"
        if (_SURE_OF_SIGMA * least > self._sigma).all():
            return PROVED, ""
        return REGULAR, f"sigma_{1 + int(least.argmin())} may be less"

    def _determinants(self, at: Point, change: Change) -> tuple[Array, Bools]:
        """Return the determinant (boxes,) of the locked joints' matrix at the centre, and whether it has the same sign
        in all of the box: no singularity of type 2."""
        rows, locked = self.equations.rows, self.equations.locked
        if len(rows) != len(locked):  # actuated redundantly
            return np.zeros(len(at.residual)), np.zeros(len(at.residual), dtype=bool)
        middle, unsure = (at.jacobian[:, k][:, rows][..., locked] for k in range(2))
        left = _inverse(middle)
        rest = unsure + (change.bent + change.apart)[:, rows][..., locked]
        rest = np.abs(left @ middle - np.eye(len(rows))) + np.abs(left) @ rest
        slopes = np.moveaxis(left[:, None] @ change.by[:, :, rows][..., locked], 1, 0)
        n = len(self.equations.over)
        total = _preconditioned(slopes[:n], rest + np.abs(slopes[n:]).sum(axis=0))
        weights = _solved(total, np.ones(total.shape[:2]))
        lesser = (total @ weights[..., None])[..., 0] < _SURE * weights
        return np.linalg.det(middle), np.asarray(lesser.all(axis=1) & (weights > 0.0).all(axis=1))


def _urgency(box: _Box, sign: float) -> tuple[float, float]:
    """Return what is least for the box that is tested next where a sign of the determinant is looked for."""
    if not sign * box.determinant > 0.0:
        return np.inf, 0.0
    return float(np.prod(box.high - box.low)), -sign * box.determinant


def _curved(by: Array, along: Array) -> Array:
    """Return how X and P change by eps_j and by eps_j eps_k, j <= k, so that the second derivative of C F vanishes.

    Args:
        by: (boxes, n, unknowns, columns) C G.
        along: (boxes, unknowns + parameters, n) S and diag(r).
    """
    n = along.shape[2]
    second = by[..., : along.shape[1]] @ along[:, None]  # (boxes, j, unknowns, k)
    j, k = np.triu_indices(n)
    products = -0.5 * (second[:, j, :, k] + second[:, k, :, j]) * np.where(j == k, 0.5, 1.0)[:, None, None]
    products = np.moveaxis(products, 0, -1)
    return np.concatenate([along, np.concatenate([products, np.zeros((len(by), n, len(j)))], axis=1)], axis=2)


def _preconditioned(slopes: Array, rest: Array) -> Array:
    """Return E for the preconditioner C - sum_j eps_j C W_j C, where C W = 1 + sum_j eps_j `slopes`_j +- `rest`."""
    total = rest + np.abs(slopes).sum(axis=0) @ rest
    for j, first in enumerate(slopes):
        total = total + np.abs(first @ first)
        for second in slopes[:j]:
            total = total + np.abs(first @ second + second @ first)
    return np.asarray(total)


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
