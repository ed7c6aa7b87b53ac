"""Singularities between two configurations: a singular value changes its sign on the path from one to the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike, Bools
from cinegen.errors import ClosureError
from cinegen.loops.motions import free_motions, orthonormal
from cinegen.model import Mechanism
from cinegen.singularities.ball_joints import counted_passive
from raff2urdf.closure import rank

_SURE = 0.7  # product of the cosines between singular vectors that belong together
_DEPTH = 7  # times a path is halved until they do
_EXCLUDED = 12  # times a path is halved until it is excluded that a value vanishes
_HALVES = 30  # of a path, to where the sign changes
_ZERO = 1e-12  # of a matrix: a smaller singular value is 0, and its vectors are arbitrary
_CURVED = 1.05  # length of a path between two matrices, of their distance
_BENT = 3.0  # likewise, of a path that may change its direction where branches cross
_ASIDE = 0.47  # part of a path where it is halved: singularities of symmetric robots lie in the middle


class Rows(NamedTuple):
    """A matrix that belongs to each configuration, which is singular where the mechanism is.

    Attributes:
        of: returns the matrix (rows, columns) at q (nq,), dimensionless; it is continuous.
        rank: number of its singular values that do not vanish generically.
    """

    of: Callable[[Array], Array]
    rank: int

    def sigma(self, matrices: Array) -> Array:
        """Return the smallest of these singular values (n,), of matrices (n, rows, columns)."""
        return np.asarray(np.linalg.svd(matrices, compute_uv=False)[:, self.rank - 1])

    def is_singular(self, matrix: Array) -> bool:
        """Return whether a matrix (rows, columns) is singular to rounding: its vectors have no sign there."""
        return bool(self.sigma(matrix[None])[0] <= _ZERO * np.linalg.norm(matrix))


class Crossing(NamedTuple):
    """A singularity that is passed: the part x of the path from one configuration to the other, and q (nq,) there."""

    x: float
    q: Array


def of_passive_joints(mechanism: Mechanism) -> Rows:
    """Return the passive joints' columns in the loops' screw matrix, a ball joint as one: singular at type 2, where the
    actuated joints lose control."""
    cut = mechanism.structure.screws.cut if mechanism.structure.passive_rank else 0
    return Rows(lambda q: counted_passive(mechanism, q), mechanism.structure.passive_rank + cut)


def of_end(mechanism: Mechanism) -> Rows:
    """Return the motions of the end (`Mechanism.end`) that all loops allow, in its own axes: singular at type 1.

    Its rotations count if they don't follow from its translations, as in a mechanism that only translates.
    """
    candidates = [of_node(mechanism, mechanism.end, count) for count in (3, 6)]
    ranks = [max(rank(of(q)) for q in mechanism.structure.samples) for of in candidates]
    return Rows(candidates[ranks[1] > ranks[0]], max(ranks))


def of_node(mechanism: Mechanism, node: str, count: int) -> Callable[[Array], Array]:
    """Return a function of q (nq,): a node's motions (count, nv) that all loops allow, dimensionless, along its own
    three axes, and with 6 also about them; a floating base is fixed."""
    model, system, frame = mechanism.model, mechanism.structure.own_system(), mechanism.frame_id(node)
    units = np.repeat([1.0 / mechanism.length, 1.0], 3)[:count, None] * mechanism.scale
    fixed = 6 if mechanism.floating else 0

    def moved(q: Array) -> Array:
        loops = system.evaluate(q)[1]
        pin.updateFramePlacement(model, system.data, frame)
        jacobian = pin.getFrameJacobian(model, system.data, frame, pin.ReferenceFrame.LOCAL).reshape(6, -1)
        rows = np.asarray(jacobian[:count] * units)
        rows[:, :fixed] = 0.0
        if not mechanism.loop_rank:
            return rows
        cut = system.cut_rates()
        motions = orthonormal(free_motions(loops, mechanism.loop_rank)[0], cut)
        whole = np.vstack([motions, cut @ motions])  # orthonormal
        return np.asarray(rows @ motions @ whole.T)  # the basis may jump from one q to the next, this does not

    return moved


def crossings(rows: Rows, path: Callable[[float], Array]) -> Iterator[Crossing]:
    """Find where the smallest singular value passes through 0 on the path between two configurations.

    As singular vectors are continuous, one of the pair seems to be reversed where their value changes its sign; where
    they are not alike enough to decide, the path is halved.

    Args:
        rows: the matrix.
        path: returns q (nq,) on it, loops closed, for a part from 0 to 1; short enough not to turn back.
    """

    def matrix(x: float) -> Array:
        return rows.of(path(x))

    def brackets(x: float, a: Array, y: float, b: Array, depth: int) -> Iterator[tuple[float, Array, float]]:
        if not may_cross(rows, a, b):
            return
        alignment, sure = _alignment(a, b, rows.rank)
        if depth and not sure:
            middle = x + _ASIDE * (y - x)
            c = matrix(middle)
            yield from brackets(x, a, middle, c, depth - 1)
            yield from brackets(middle, c, y, b, depth - 1)
        elif alignment < 0.0:
            yield x, a, y

    for low, at_low, high in brackets(0.0, matrix(0.0), 1.0, matrix(1.0), _DEPTH):
        for _ in range(_HALVES):
            middle = 0.5 * (low + high)
            at_middle = matrix(middle)
            if rows.is_singular(at_middle):
                low = middle
                break
            if _alignment(at_low, at_middle, rows.rank)[0] < 0.0:
                high = middle
            else:
                low, at_low = middle, at_middle
        yield Crossing(low, path(low))


def may_cross(rows: Rows, a: Array, b: Array) -> bool:
    """Return whether the singular value can pass through 0 between two matrices, see `can_vanish`."""
    sigma = rows.sigma(np.array([a, b]))
    return bool(can_vanish(sigma[0], sigma[1], np.linalg.norm(b - a)))


def can_vanish(first: ArrayLike, second: ArrayLike, distance: ArrayLike) -> Bools:
    """Return whether singular values can pass through 0 between matrices that are so far apart.

    By Weyl's inequality the matrix changes by at least as much as both values together then: on the straight path to
    the other matrix where it has full rank, else on one that is bent a little, as between unit vectors.
    """
    return np.asarray(np.add(first, second) <= np.multiply(_CURVED, distance))


def turned(rows: Rows, a: Array, b: Array) -> bool:
    """Return whether the singular value has changed its sign from one matrix to another that is near it."""
    return may_cross(rows, a, b) and _alignment(a, b, rows.rank)[0] < 0.0


def passes_type_2(mechanism: Mechanism, path: Array) -> bool:
    """Return whether a path may pass a singularity of type 2, where the actuated joints lose control.

    The smallest singular value of the passive joints must not vanish: it can't between two matrices that are much
    nearer to each other than to a singular one (Weyl's inequality). Where that does not exclude it, the path is
    divided. An unchanged sign would not do: where two branches cross, a path that goes over to the other one keeps it.
    Ends that are singular themselves are not passed.

    Args:
        mechanism: robot.
        path: (n, nq) configurations, loops closed; the loops are closed between two, as near to straight as possible.
    """
    if not mechanism.is_constrained or not mechanism.structure.passive_rank:
        return False
    rows = of_passive_joints(mechanism)

    def passes(a: Array, b: Array, first: Array, last: Array, depth: int, at_end: tuple[bool, bool]) -> bool:
        if rows.sigma(np.array([first, last])).sum() > _BENT * np.linalg.norm(last - first):
            return False
        if not depth or (any(at_end) and 2 * depth <= _EXCLUDED):
            return not any(at_end)
        middle = mechanism.close(mechanism.interpolate(a, b, _ASIDE))
        between = rows.of(middle)
        return passes(a, middle, first, between, depth - 1, (at_end[0], False)) or passes(
            middle, b, between, last, depth - 1, (False, at_end[1])
        )

    def passes_step(k: int) -> bool:
        first, last = matrices[k], matrices[k + 1]
        at_end = k == 0 and rows.is_singular(first), k == len(path) - 2 and rows.is_singular(last)
        return passes(path[k], path[k + 1], first, last, _EXCLUDED, at_end)

    matrices = [rows.of(q) for q in path]
    try:
        return any(passes_step(k) for k in range(len(path) - 1))
    except ClosureError:  # only at a singularity
        return True


def _alignment(a: Array, b: Array, rank: int) -> tuple[float, bool]:
    """Return the product of the cosines between the singular vectors of two matrices, negative after a change of sign;
    and whether that is sure. By Wedin's theorem they rotate no further than the matrix changes, relative to the gap
    between their singular value and the next one."""
    u, sigma, vt = np.linalg.svd(np.array([a, b]), full_matrices=False)
    alignment = float((u[0, :, rank - 1] @ u[1, :, rank - 1]) * (vt[0, rank - 1] @ vt[1, rank - 1]))
    apart = float((sigma[:, rank - 2] - sigma[:, rank - 1]).min()) if rank > 1 else np.inf
    return alignment, abs(alignment) >= _SURE and float(np.linalg.norm(b - a)) <= apart
