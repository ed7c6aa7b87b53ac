"""Bounds of the smallest singular values over many boxes at a time: they are 1 / |K|, K = N F_x^-1 F_w of each type."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cinegen.arrays import Array
from cinegen.proof.equations import Equations
from cinegen.proof.matrices import Matrices, products
from cinegen.proof.tubes import Tubes

_EXACT = 1e-9  # velocities with which openings across a planar linkage change the equations left out are larger
_SPLIT = 1e-7  # part by which equal eigenvalues are taken apart: the checker has the same vectors then


class SingularValues:
    """Bounds singular values over boxes.

    Args:
        equations: of a document with velocities (`cinegen.proof.velocities`).
        document: its JSON values.
    """

    def __init__(self, equations: Equations, document: Mapping[str, Any]) -> None:
        e, length, variables = equations, float(document["length"]), document["variables"]
        self._equations, self._second = e, document["second"]
        self._twist = [e.column[k] for k in document["first"]]
        self._by_twist = np.diag([length if variables[k]["prismatic"] else 1.0 for k in document["first"]])
        self._single = [e.column[k] for k in document["single"]]
        self._passive = [e.column[k] for k in document["single"] if k in document["passive"]]
        if self._second is not None:
            loops = [k for cluster in self._second["clusters"] for loop in cluster["openings"] for k in loop]
            self._opening = np.array([e.column[k] for k in (*loops, *self._second["couplings"])], dtype=np.intp)

    def smallest(self, tubes: Tubes) -> tuple[Array, Array]:
        """Return bounds (types, boxes) of the smallest singular values from below and above, of type 1 and 2."""
        e, n, at, change = self._equations, tubes.centre.shape[1], tubes.at, tubes.change
        whole = Matrices(at.jacobian[:, 0], change.whole, at.jacobian[:, 1] + change.bent + change.apart)
        by_twist = np.tile(self._by_twist, (len(tubes.x), 1, 1))
        sizes = [self._size(whole, n, list(range(len(e.unknown))), self._single, self._twist, by_twist)]
        if self._second is not None:
            across = sorted({*range(whole.c.shape[1])} - {*e.rows, *e.positive, *e.rates})
            kept = np.abs(whole.part(across, self._opening).c).max(axis=(0, 1), initial=0.0) < _EXACT
            by_opening, stretch = self._by_opening(tubes)
            by_opening = by_opening[:, kept][:, :, kept]
            low, high = self._size(whole, n, e.locked, self._passive, self._opening[kept], by_opening)
            sizes.append((low / stretch, high * stretch))
        low, high = np.array(sizes).swapaxes(0, 1)
        return 1.0 / high, np.where(low > 0.0, 1.0 / low, np.inf)

    def _size(
        self, whole: Matrices, n: int, columns: list[int], single: list[int], twist: Any, by: Array
    ) -> tuple[Array, Array]:
        """Return bounds (boxes,) of |K|_2 from below and above.

        Args:
            whole: of the derivatives of all rows.
            n: number of parameters.
            columns: of F_x.
            single: those of joints whose velocities count by themselves.
            twist: columns of F_w.
            by: (boxes, twist, .) factor of F_w.
        """
        e, m = self._equations, len(columns)
        minus = np.tile(-np.eye(m), (len(by), 1, 1))
        f, w = whole.part(e.rows, columns), whole.part(e.rows, twist).times(by).beside(minus)
        rates, bare = whole.part(e.rates, columns), whole.part(e.rates, twist).times(by)
        bare = bare.beside(np.zeros((len(by), len(e.rates), m)))
        inverse = _inverse(f.c)
        slopes = inverse[:, None] @ f.g
        x = -(inverse @ w.c)
        g = -(inverse[:, None] @ w.g) - slopes @ x[:, None]
        g[:, n:] -= products(slopes, g, n)
        velocities = Matrices(x, g, np.zeros(x.shape))
        lack, whole = w.r + f.cubic(velocities, n), rates.by(velocities, n)
        at = [columns.index(i) for i in single]
        c = np.concatenate([x[:, at], whole.c + bare.c], axis=1)
        slopes = np.concatenate([g[:, :, at], whole.g + bare.g], axis=2)
        rest = whole.r + bare.r
        least, most, defect = list[Array](), list[Array](), list[Array]()
        for part in (slice(0, -m), slice(-m, None)):
            size, radius, linear = (_norm(a[..., part]) for a in (c, rest, slopes[:, :n]))
            change = linear.sum(axis=1) + np.linalg.norm(slopes[:, n:, :, part], axis=(-1, -2)).sum(axis=1)
            least.append(size - change - radius)
            largest = size + change if most else np.hypot(_near(c[..., part], slopes[..., part]), change)
            most.append(largest + radius)
            defect.append(_norm(lack[..., part]))
        more = most[1] / (1.0 - defect[1]) * defect[0]
        is_small = defect[1] < 1.0
        return np.where(is_small, least[0] - more, 0.0), np.where(is_small, most[0] + more, np.inf)

    def _by_opening(self, tubes: Tubes) -> tuple[Array, Array]:
        """Return the openings of loops (boxes, ., .) by dimensionless and mixed ones about the centres of the clusters'
        axes, and what factor (boxes,) bounds how these centres move."""
        assert self._second is not None
        x, e, blocks, stretch = tubes.x, self._equations, list[Array](), np.ones(len(tubes.x))
        values, radius, count = e.values(x, tubes.centre), np.zeros((len(x), e.count)), x.shape[1]
        spread = np.abs(tubes.along).sum(axis=-1)
        radius[:, e.unknown], radius[:, e.over] = (spread[:, :count] + tubes.near) * e.units, spread[:, count:]
        for cluster in self._second["clusters"]:
            about, away, by = np.zeros((len(x), 3)), np.zeros((len(x), 3)), np.tile(np.eye(6), (len(x), 1, 1))
            for chain, end, share, off in cluster["about"]:
                middle, r = e.placed(chain, end, values, radius)
                about, away = about + share * middle, away + share * (r + off)
            turned = np.linalg.norm(away, axis=1) / cluster["length"] / 2.0
            stretch = np.maximum(stretch, turned + np.hypot(1.0, turned))
            by[:, :3, :3] *= cluster["length"]
            by[:, :3, 3:] = -np.cross(np.eye(3), about[:, None]).swapaxes(1, 2)
            blocks.append(
                np.einsum("lm,bij->blimj", cluster["unmix"], by).reshape(len(x), 6 * len(cluster["unmix"]), -1)
            )
        if self._second["couplings"]:
            blocks.append(np.tile(self._second["unmix"], (len(x), 1, 1)))
        whole, start = np.zeros((len(x), len(self._opening), len(self._opening))), 0
        for block in blocks:
            stop = start + block.shape[1]
            whole[:, start:stop, start:stop] = block
            start = stop
        return whole, stretch


def _near(c: Array, g: Array) -> Array:
    """Return |P|_2^(1/2) of equation 6 of docs/proof.md: |c + sum_k g_k eta_k|_2, but for the squares of eta.

    Args:
        c: (boxes, rows, columns).
        g: (boxes, eta, rows, columns).
    """
    c = np.where(np.isfinite(c), c, 0.0)
    gram, split = c.swapaxes(1, 2) @ c, _SPLIT * np.diag(np.arange(c.shape[2]))
    v = np.linalg.eigh(gram + split * np.trace(gram, axis1=1, axis2=2)[:, None, None])[1]
    turned = c @ v
    products = turned.swapaxes(1, 2)[:, None] @ (g @ v[:, None])
    sizes = np.abs(products + products.swapaxes(2, 3)).sum(axis=1) + np.abs(turned.swapaxes(1, 2) @ turned)
    return np.sqrt(_norm(sizes))


def _norm(matrices: Array) -> Array:
    """Return the largest singular values; infinite where a number is not finite."""
    if not matrices.size:
        return np.zeros(matrices.shape[:-2])
    is_finite = np.asarray(np.isfinite(matrices).all(axis=(-1, -2)))
    norms = np.linalg.norm(np.where(is_finite[..., None, None], matrices, 0.0), 2, axis=(-2, -1))
    return np.asarray(np.where(is_finite, norms, np.inf))


def _inverse(matrices: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(matrices))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(matrices))
