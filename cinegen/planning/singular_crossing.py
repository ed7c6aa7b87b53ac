"""Paths of closed mechanisms through singularities of type 2, and torques, which stay bounded at certain speeds only.

At such a singularity the mechanism can move while all actuated joints are locked. No torque does work on that motion t,
so gravity and inertia must not, either: t^T (M a + c + g) = 0. Along a path q(s) this is a linear condition,

    alpha s'' + beta s'^2 + gamma = 0 ,

which gives the acceleration at each speed (S. Briot and V. Arakelian, "Optimal force generation in parallel
manipulators for passing through the singular positions", Int. J. Robotics Research 27, 2008). With the singular value
decomposition S N = U sigma V^T of what the actuated joints move in a basis N of the mechanism's motions, the torques
that inertia, speed and gravity need are U sigma^-1 V^T N^T tau. Multiplied by the smallest of sigma, they and their
limits are finite everywhere, and at the singularity, where that is 0, torques within limits are this condition.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.optimize

from cinegen.arrays import Array
from cinegen.dynamics import InverseDynamics, plain
from cinegen.dynamics.loads import LoadedTree
from cinegen.errors import CinegenError
from cinegen.model import Mechanism
from cinegen.tolerances import NEAR_SINGULAR
from raff2urdf.errors import counted

_TRIED = 30  # configurations of a path by which its guides are chosen
_INDEPENDENT = 1e-3  # smallest singular value of the guides' motions, dimensionless


def guided(mechanism: Mechanism, path: Array) -> Mechanism:
    """Return a mechanism in which other joints than the actuated ones drive the motion: those that determine it best
    all along a path, its singularities of type 2 included.

    Args:
        mechanism: with as many actuated joints as degrees of freedom.
        path: (n, nq) configurations, loops closed.

    Raises:
        CinegenError: actuation is redundant or lacking, or no joints determine the motion all along the path.
    """
    tree, moving = LoadedTree(mechanism), plain.columns_of(mechanism)
    tried = path[np.unique(np.linspace(0, len(path) - 1, _TRIED).astype(np.intp))]
    bases = [plain.motions_at(tree, q).basis for q in tried]
    mobility = min(basis.shape[1] for basis in bases)
    if len(mechanism.actuated) != mobility or any(basis.shape[1] != mobility for basis in bases):
        raise CinegenError(
            f"{mechanism.name}: a singularity can be crossed only with as many actuated joints as degrees of freedom: "
            f"it has {len(mechanism.actuated)} and {max(basis.shape[1] for basis in bases)}"
        )
    model = mechanism.model
    names = [name for name in mechanism.joints if model.joints[model.getJointId(name)].nv == 1]
    rows = np.array([mechanism.v_index(name) for name in names]) - moving.start
    best, chosen = 0.0, list[int]()
    for basis in bases:
        *_, order = scipy.linalg.qr(basis[rows].T, pivoting=True, mode="economic")
        some = sorted(order[:mobility].tolist())
        least = min(np.linalg.svd(other[rows[some]], compute_uv=False)[-1] for other in bases)
        if least > best:
            best, chosen = float(least), some
    if best < _INDEPENDENT:
        raise CinegenError(
            f"{mechanism.name}: no choice of {counted(mobility, 'joint')} determines its motion all along this path: "
            "divide the path"
        )
    return replace(mechanism, actuated=tuple(names[k] for k in chosen))


class CrossingDynamics:
    """Torques along a path that may pass through singularities of type 2.

    Args:
        dynamics: the mechanism and its loads.
        driven: the same mechanism, as `guided` returns it.
    """

    def __init__(self, dynamics: InverseDynamics, driven: Mechanism) -> None:
        self._tree, self._guides = dynamics.tree, LoadedTree(driven)
        self._columns = plain.actuated_columns(dynamics.mechanism)
        self._guide_columns = plain.actuated_columns(driven)

    def terms(self, q: Array, tangent: Array, bend: Array) -> tuple[Array, Array, Array, float]:
        """Return the torques (actuated,) that s'', s'^2 and rest need, N m and N, multiplied by a weight, and this: 1
        unless a singularity is near, and 0 at it.

        Args:
            q: (nq,) configuration.
            tangent: (guides,) derivatives of the guides by the path's parameter.
            bend: (guides,) their second derivatives.
        """
        tree, mechanism = self._tree, self._tree.mechanism
        moving = plain.columns_of(mechanism)
        motions, by_guides = plain.motions_at(tree, q), plain.motions_at(self._guides, q)
        first, second = np.zeros((2, mechanism.model.nv))
        first[self._guide_columns], second[self._guide_columns] = tangent, bend
        v, a, *_ = plain.complete(self._guides, q, first, second, by_guides)
        rest = np.zeros(len(v))
        static = tree.torques(q, rest, rest)
        needed = np.column_stack([tree.torques(q, rest, v) - static, tree.torques(q, v, a) - static, static])
        work = motions.basis.T @ (needed[moving] * mechanism.scale[moving, None])
        u, sigma, vt = np.linalg.svd(motions.actuated)
        weight = min(1.0, sigma[-1] / NEAR_SINGULAR)
        if weight == 1.0:
            inverse = 1.0 / sigma
        else:  # weight / sigma, which is 1 / NEAR_SINGULAR where it is 0 / 0
            ratios = np.divide(sigma[-1], sigma, out=np.ones_like(sigma), where=sigma > sigma[-1])
            inverse = ratios / NEAR_SINGULAR
        efforts = (u * inverse) @ (vt @ work) / self._tree.step[self._columns, None]
        return efforts[:, 0], efforts[:, 1], efforts[:, 2], float(weight)

    def side(self, q: Array) -> float:
        """Return the determinant of the actuated joints' motions by those of the guides: 0 at singularities of type
        2."""
        motions, by_guides = plain.motions_at(self._tree, q), plain.motions_at(self._guides, q)
        return float(np.linalg.det(np.linalg.solve(by_guides.actuated.T, motions.actuated.T)))


def crossings(side: Callable[[float], float], grid: Array) -> Array:
    """Return the parameters at which a function, of which a sign changes between two of a grid (n,), is 0."""
    values = [side(s) for s in grid.tolist()]
    roots = [
        scipy.optimize.brentq(side, a, b, xtol=1e-14, rtol=1e-15)
        for a, b, before, after in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True)
        if before * after < 0.0
    ]
    return np.array(roots)
