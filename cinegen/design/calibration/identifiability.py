"""Which combinations of parameters measurements determine, and which they can't tell apart, as text.

With whitened measurements and columns scaled by the expected errors, J = U S V^T at the nominal geometry. Its rank is
counted there: at other values of the parameters it jumps up, because combinations that are exactly dependent then
become distinguishable in theory, by effects of second order that drown in noise. The rows of V_r^T are the combinations
that are estimated.

A dependency is a change of parameters that changes no reading. Those with the fewest parameters are the clearest; among
all that contain a parameter, the one of least 1-norm is taken, by linear programming.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lstsq, svd
from scipy.optimize import linprog

from cinegen.arrays import Array
from raff2urdf.errors import counted, first_of

DEPENDENT = 1e-9
"""Singular values below this fraction of the largest are those of dependent combinations."""

WEAK = 0.01
"""Combinations whose standard deviation exceeds 1 / WEAK expected errors are not estimated."""

_ZERO = 1e-7  # of rows of V of length 1
LISTED = 6
"""Parameters of a dependency up to which they are named."""


@dataclass(frozen=True, eq=False)
class Dependency:
    """Parameters of which some changes change no reading.

    Attributes:
        names: of the parameters.
        changes: (count, names) independent changes, m, rad, or dimensionless for gains; the largest of each is of the
            size of an expected error.
        text: the same as text.
    """

    names: tuple[str, ...]
    changes: Array
    text: str

    def __repr__(self) -> str:
        return f"<Dependency: {self.text}>"


@dataclass(frozen=True, eq=False)
class Subspace:
    """Combinations of parameters that measurements determine, at nominal geometry.

    Attributes:
        basis: (parameters, combinations) orthonormal columns; times the expected errors they are changes of parameters.
        singular_values: (combinations,) reciprocal standard deviations of these in expected errors.
        errors: (parameters,) expected ones.
        rank: number of independent combinations, with those that are too weak to be estimated.
    """

    basis: Array
    singular_values: Array
    errors: Array
    rank: int

    @property
    def changes(self) -> Array:
        """(parameters, combinations) changes of the parameters by one unit of each combination."""
        return np.asarray(self.errors[:, None] * self.basis)

    @property
    def lengths(self) -> Array:
        """(parameters,) part of each that is determined: 1 if it is by itself, 0 if it has no effect."""
        return np.asarray(np.linalg.norm(self.basis, axis=1))


def subspace(jacobian: Array, errors: Array) -> Subspace:
    """Return the combinations that measurements determine.

    Args:
        jacobian: (rows, parameters) of whitened readings, at nominal geometry.
        errors: (parameters,) expected; 0 for those that are not estimated.
    """
    scaled = jacobian * errors
    _, s, vt = svd_by_qr(scaled)
    rank = int((s > DEPENDENT * s.max(initial=0.0)).sum())
    count = int((s[:rank] > WEAK).sum())
    return Subspace(vt[:count].T, s[:count], errors, rank)


def svd_by_qr(matrix: Array) -> tuple[Array, Array, Array]:
    """Return U, S and V^T by QR iterations: divide and conquer, as in numpy, fails on some matrices of dependent
    columns that differ from each other by rounding."""
    u, s, vt = svd(matrix, full_matrices=False, lapack_driver="gesvd")
    return u, s, vt


def _solved(matrix: Array, wanted: Array) -> Array:
    """Return the least-squares solution of smallest norm, by a QR decomposition with pivoting."""
    return np.asarray(lstsq(matrix, wanted, cond=_ZERO, lapack_driver="gelsy")[0])


def dependencies(
    space: Subspace,
    names: Sequence[str],
    units: Sequence[str],
    parents: Mapping[str, str] | None = None,
    motions: Array | None = None,
) -> list[Dependency]:
    """Return independent dependencies of the parameters that have an effect, those of the fewest parameters first.

    Args:
        space: the combinations that are determined.
        names: of the parameters.
        units: `m`, `rad` or "" of each.
        parents: of nodes, for the words.
        motions: (bodies, 6, parameters) twists of bodies by the parameters: dependencies with which these move as one
            are preferred.
    """
    rows, lengths = space.basis, space.lengths
    effective = np.flatnonzero(lengths > _ZERO)
    groups = list[list[int]]()
    for k in effective:
        for group in groups:
            cosine = rows[group[0]] @ rows[k] / (lengths[group[0]] * lengths[k])
            if np.linalg.norm(rows[k] / lengths[k] - np.sign(cosine) * rows[group[0]] / lengths[group[0]]) < _ZERO:
                group.append(int(k))
                break
        else:
            groups.append([int(k)])
    described = [_parallel(group, space, names, units) for group in groups if len(group) > 1]
    chosen = [group[0] for group in groups]
    first = _as_one(rows, chosen, motions * space.errors) if motions is not None and chosen else []
    for w in _circuits(rows, chosen, first):
        used = np.flatnonzero(np.abs(w) > _ZERO * np.abs(w).max()).tolist()
        involved, changes = tuple(names[k] for k in used), w[used] * space.errors[used]
        described.append(
            Dependency(involved, changes[None], _together(involved, changes, [units[k] for k in used], parents or {}))
        )
    return described


def _as_one(rows: Array, chosen: Sequence[int], motions: Array) -> list[Array]:
    """Return independent dependencies with which all bodies move as one, a simple motion and few parameters each."""
    moved = motions[:, :, list(chosen)] / max(float(np.abs(motions).max(initial=0.0)), 1e-300)
    apart = np.vstack([rows[list(chosen)].T, (moved[:-1] - moved[-1]).reshape(-1, len(chosen))])
    _, s, vt = svd(apart, lapack_driver="gesvd")
    null = vt[int((s > _ZERO * s[0]).sum()) :].T
    u, s, _ = svd_by_qr(moved[-1] @ null)
    directions = _echelon(u[:, s > _ZERO].T)
    weighted = list[Array]()
    for direction in directions:
        weights = _fewest(np.vstack([apart, moved[-1]]), np.append(np.zeros(len(apart)), direction))
        if weights is not None:
            w = np.zeros(len(rows))
            w[list(chosen)] = weights
            weighted.append(w / np.abs(w).max())
    return weighted


def _echelon(matrix: Array) -> Array:
    """Return the reduced row echelon form of independent rows."""
    reduced, done = matrix.copy(), 0
    for column in range(reduced.shape[1]):
        if done == len(reduced):
            break
        pivot = done + int(np.argmax(np.abs(reduced[done:, column])))
        if abs(reduced[pivot, column]) < _ZERO:
            continue
        reduced[[done, pivot]] = reduced[[pivot, done]]
        reduced[done] /= reduced[done, column]
        others = np.arange(len(reduced)) != done
        reduced[others] -= np.outer(reduced[others, column], reduced[done])
        done += 1
    return reduced


def _fewest(a: Array, wanted: Array) -> Array | None:
    """Return the solution of a x = wanted of least 1-norm, which has few components; None if there is none."""
    if np.linalg.norm(a @ _solved(a, wanted) - wanted) > _ZERO * np.linalg.norm(wanted):
        return None
    u, s, _ = svd_by_qr(a)
    left = u[:, s > _ZERO * s[0]].T
    done = linprog(np.ones(2 * a.shape[1]), A_eq=np.hstack([left @ a, -left @ a]), b_eq=left @ wanted)
    if done.status != 0:
        return None
    weights = done.x[: a.shape[1]] - done.x[a.shape[1] :]
    support = np.abs(weights) > _ZERO * np.abs(weights).max()
    sparse = np.zeros(a.shape[1])
    sparse[support] = _solved(a[:, support], wanted)
    return sparse


def _circuits(rows: Array, chosen: Sequence[int], first: Sequence[Array] = ()) -> list[Array]:
    """Return independent dependencies of rows of which no two are parallel, those that are known first."""
    matrix = rows[list(chosen)].T  # (combinations, chosen)
    unit = matrix / np.linalg.norm(matrix, axis=0)
    count = unit.shape[1] - int((svd_by_qr(unit)[1] > _ZERO).sum()) if unit.size else 0
    candidates = list[Array]()
    for k in range(unit.shape[1] if count else 0):
        others = np.delete(np.arange(unit.shape[1]), k)
        weights = _fewest(unit[:, others], unit[:, k])
        if weights is not None:
            w = np.zeros(len(rows))
            w[list(chosen)] = np.insert(-weights, k, 1.0) / np.linalg.norm(matrix, axis=0)
            candidates.append(w / np.abs(w).max())
    candidates.sort(key=lambda w: int((np.abs(w) > _ZERO).sum()))
    picked = list(first)
    for w in candidates:
        if len(picked) < count and (svd_by_qr(np.array([*picked, w]))[1] > _ZERO).sum() > len(picked):
            picked.append(w)
    return picked


def _parallel(group: Sequence[int], space: Subspace, names: Sequence[str], units: Sequence[str]) -> Dependency:
    """Return the dependency of parameters that have the same effect but for a factor."""
    first, rows, errors = group[0], space.basis, space.errors
    factors = [float(rows[k] @ rows[first] / (rows[first] @ rows[first]) * errors[first] / errors[k]) for k in group]
    changes = np.zeros((len(group) - 1, len(group)))
    for i, k in enumerate(group[1:]):
        changes[i, 0], changes[i, i + 1] = -factors[i + 1] * errors[k], errors[k]
    involved, text = [names[k] for k in group], ""
    if all(units[k] == units[first] for k in group) and np.allclose(np.abs(factors), 1.0, atol=1e-6):
        if min(factors) > 0.0:
            text = "their sum"
        elif len(group) == 2:
            text = "their difference"
    if not text:
        text = involved[0]
        for k, factor in zip(group[1:], factors[1:], strict=True):
            unit = "" if units[k] == units[first] else f" {units[first] or 1}/{units[k] or 1}"
            size = "" if abs(abs(factor) - 1.0) < 1e-6 and not unit else f"{abs(factor):.4g}{unit} "
            text += f" {'+' if factor > 0.0 else '-'} {size}{names[k]}"
    return Dependency(tuple(involved), changes, f"{', '.join(involved[:-1])} and {involved[-1]}: only {text}")


def _together(names: tuple[str, ...], changes: Array, units: Sequence[str], parents: Mapping[str, str]) -> str:
    scale = {"m": 1e3, "rad": np.degrees(1.0), "": 1.0}
    shown = {"m": "mm", "rad": "deg", "": ""}
    lead = int(np.argmax(np.abs(changes)))
    sizes = changes / changes[lead] / scale[units[lead]]
    if len(names) <= LISTED:
        texts = [
            f"{name} {size * scale[unit]:+.3g} {shown[unit]}".rstrip()
            for name, size, unit in zip(names, sizes, units, strict=True)
        ]
        return f"no reading changes with {', '.join(texts)}"
    nodes = list(dict.fromkeys(name.rpartition(".")[0] for name in names))
    for node in nodes:
        children = [each for each in nodes if each != node]
        if all(parents.get(each) == node for each in children):
            back = f"{first_of(children, 8)} on it moved back"
            return f"{node} moved, and {back}: no reading changes ({counted(len(names), 'parameter')})"
    return f"{counted(len(names), 'parameter')} of {first_of(nodes, 8)}: no reading changes if they change together"
