"""`prove`: boxes of poses in which a robot has exactly one configuration on a branch, within limits, regular.

docs/proof.md derives the test: a parametric Krawczyk operator about X(eps) = x_0 + S eps, S = -F_x^-1 F_p diag(r). A
box that fails is halved along the axis to which the residual of X(eps) owes most. What is written here is a claim: the
result is that of `cinegen.proof.checker`, which shares no code with this module.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from cinegen.arrays import Array, Bools
from cinegen.proof.clearance import Clearances
from cinegen.proof.equations import Equations
from cinegen.proof.reach import ReachTest
from cinegen.proof.singular import SingularValues
from cinegen.proof.tubes import TINY, determinants, inverses, tubes

BOXES = 10_000
"""Default number of boxes that are tested."""

_BATCH, _FEW = 256, 2  # boxes that are tested together; while the other sign of a determinant is looked for
_NEWTON, _CONVERGED = 8, 1e-9
_LOST = 8  # halvings of a box in whose middle no configuration is found
_SURE_OF_SIGMA = 0.95  # part of a bound of a singular value that is used: the checker bounds it by powers
_LEAST = 1e-7  # part of a range of the region: boxes that are smaller are not halved
_ROUNDED = 1e-9  # by so much a box is farther out than the edge of the region

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
            inverse = inverses(values.jacobian[:, 0, e.rows, : x.shape[1]])
            step = -(inverse @ values.residual[:, 0, e.rows, None])[..., 0]
            size = np.abs(step).max(axis=1)
            done = size < _CONVERGED
            step *= np.minimum(1.0, 0.5 / np.maximum(size, TINY))[:, None]
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
        proved = tubes(e, x, inverse, centre, radius)
        regular, axes = proved.regular & done, proved.axes.tolist()
        signs, is_sure = determinants(e, proved.at, proved.change)
        claims = self._claims(x, np.abs(proved.along[:, :count]).sum(axis=-1) + proved.near, is_sure)
        best = [i for i in range(len(x)) if regular[i] and claims[i][0] == PROVED]
        if self._values is not None and best:
            least, most = self._values.smallest(proved.some(best))
            for k, i in enumerate(best):
                claims[i] = self._judged(least[:, k], most[:, k])
        best = [i for i in range(len(x)) if regular[i] and claims[i][0] == PROVED]
        more: dict[int, Mapping[str, Any]] = {}
        if self._clearances is not None and best:
            for i, result in zip(best, self._clearances.examine(proved.some(best)), strict=True):
                more[i] = result.claim
                if not result.is_apart:
                    axes[i] = result.axis
                    claims[i] = (NEAR, result.near) if result.is_near else (REGULAR, f"{result.near} may be near")
        tested = list[_Tested]()
        excluded = self._reach.excludes(low, high)
        for i, axis in enumerate(axes):
            leaf, step = Leaf(OPEN, "no configuration is found"), 0.5 * proved.along[i, :count, axis]
            if done[i]:
                leaf = Leaf(OPEN, "no unique configuration is proved")
            if regular[i] and claims[i][0] != OPEN:
                leaf = Leaf(*claims[i], (x[i] * e.units).tolist(), (proved.y[i] * e.units).tolist(), more.get(i, {}))
            if excluded[i] and not regular[i]:
                leaf = Leaf(UNREACHABLE, "")
            halves = (x[i] - step, x[i] + step) if done[i] else None
            tested.append(_Tested(leaf, axis, halves, float(signs[i]) if done[i] else 0.0, bool(is_sure[i])))
        return tested

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


def _urgency(box: _Box, sign: float) -> tuple[float, float]:
    """Return what is least for the box that is tested next where a sign of the determinant is looked for."""
    if not sign * box.determinant > 0.0:
        return np.inf, 0.0
    return float(np.prod(box.high - box.low)), -sign * box.determinant
