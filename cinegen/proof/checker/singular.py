"""Bounds of singular values over boxes: equation 6 of docs/proof.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from flint import acb_mat, arb, arb_mat

from cinegen.proof.checker.balls import (
    CertificateError,
    absolute,
    added,
    added_sizes,
    doubles,
    frobenius,
    identity,
    norms,
    pick,
    radii,
)  # fmt: skip
from cinegen.proof.checker.forms import Form
from cinegen.proof.checker.tube import Tube

_SPLIT = 1e-7  # part by which equal eigenvalues are taken apart: their vectors are orthogonal then


def smallest(tube: Tube) -> list[tuple[arb, arb]]:
    """Return the smallest singular values of type 1 and 2 from below and above: 1 / |K|_2, equation 6."""
    robot, data, second = tube.robot, tube.robot.data, tube.robot.data["second"]
    at = {k: j for j, k in enumerate(robot.columns)}
    twist, by = [at[k] for k in data["first"]], identity(len(data["first"]))
    for i, k in enumerate(data["first"]):
        by[i, i] = robot.length if robot.variables[k]["prismatic"] else arb(1)
    sizes = [_size(tube, list(range(len(tube.x))), [at[k] for k in data["single"]], twist, by)]
    if second is not None:
        opening = [at[k] for cluster in second["clusters"] for loop in cluster["openings"] for k in loop]
        opening += [at[k] for k in second["couplings"]]
        by, stretch = _by_opening(tube, second, len(opening))
        kept = _kept(tube, opening)
        if any(by[i, j] != 0 for j in kept for i in range(len(opening)) if i not in kept):
            raise CertificateError("loops do not open in their plane")
        single = [at[k] for k in data["single"] if k in data["passive"]]
        by = arb_mat([[by[i, j] for j in kept] for i in kept])
        low, high = _size(tube, tube.locked, single, [opening[i] for i in kept], by)
        sizes.append((low / stretch, high * stretch))
    return [(1 / high, 1 / low if low > 0 else arb(inf)) for low, high in sizes]


def _form(tube: Tube, rows: Sequence[int], columns: Sequence[int]) -> Form:
    *parts, bend, apart = (pick(m, rows, columns) for m in tube.parts)
    c, *g = (m.mid() for m in parts)
    return Form(c, g, absolute(bend + apart) + radii(added(parts)))


def _size(tube: Tube, columns: list[int], single: list[int], twist: list[int], by: arb_mat) -> tuple[arb, arb]:
    """Return bounds of |K|_2, K = N F_x^-1 F_w `by`."""
    rows, n, kinds = tube.robot.data["rows"], len(tube.low), tube.robot.kinds
    rates = [i for i, kind in enumerate(kinds) if kind == "rate"]
    f, w, of = _form(tube, rows, columns), _form(tube, rows, twist).times(by), _form(tube, rates, columns)
    bare, nothing, chosen = _form(tube, rates, twist).times(by), 0 * f.c, arb_mat(len(single), len(columns))
    for i, k in enumerate(single):
        chosen[i, columns.index(k)] = 1
    try:
        inverse = f.c.inv()
    except ZeroDivisionError:
        return arb(0), arb(inf)
    slopes, sizes = [-(inverse * m) for m in f.g], list[tuple[arb, arb, arb]]()
    for right, free in ((w, bare), (Form(identity(len(rows)), [nothing] * len(f.g), nothing), None)):
        c = inverse * right.c
        x = Form(c, [inverse * m + a * c for m, a in zip(right.g, slopes, strict=True)], 0 * right.r)
        x.add_products(slopes, x.g, n)
        whole = of.by(x, n)
        if free is not None:
            whole = whole.less(free)
        changes = [(chosen * a, b) for a, b in zip(x.g, whole.g, strict=True)]
        at, radius = (chosen * x.c, whole.c), norms([whole.r])[1]
        low, high = norms(at, 6)
        change = sum((norms(m)[1] for m in changes[:n]), sum(map(frobenius, changes[n:]), arb(0)))
        largest = high + change if free is None else (_square(at, changes) + change**2).sqrt()
        sizes.append((low - change - radius, largest + radius, norms([right.r + f.cubic(x, n)])[1]))
    (low, high, lack), (_, left, defect) = sizes
    if not defect < 1:
        return arb(0), arb(inf)
    rest = left / (1 - defect) * lack
    return low - rest, high + rest


def _square(at: Sequence[arb_mat], changes: Sequence[Sequence[arb_mat]]) -> arb:
    """Return |P|_2 of equation 6, a bound of |M_0 + sum_k M_k eta_k|_2^2 but for the squares of eta, of matrices one
    above the other."""
    gram, split = added([m.transpose() * m for m in at]), identity(at[0].ncols())
    for i in range(split.nrows()):
        split[i, i] = i * gram.trace() * _SPLIT
    v = doubles(acb_mat((gram + split).mid()).eig(right=True, algorithm="approx")[1].real)
    lack = frobenius([v.transpose() * v - identity(gram.nrows())])
    if not lack < 1:
        v, lack = identity(gram.nrows()), arb(0)
    turned, squares = [(m * v).transpose() for m in at], [v.transpose() * gram * v]
    for change in changes:
        product = added([m * by for m, by in zip(turned, change, strict=True)]) * v
        squares.append(product + product.transpose())
    return norms([added_sizes(squares)], 6)[1] / (1 - lack)


def _kept(tube: Tube, opening: list[int]) -> list[int]:
    """Return which openings do not change the equations that are left out: those in the plane of a planar loop."""
    rows = tube.robot.data["rows"]
    left = [i for i, kind in enumerate(tube.robot.kinds) if kind == "equation" and i not in rows]
    changed = [[any(m[i][j] != 0 for m in tube.parts) for j in opening] for i in left]
    kept = [a for a in range(len(opening)) if not any(row[a] for row in changed)]
    if len(opening) - len(kept) != sum(map(any, changed)):
        raise CertificateError("openings of loops change equations that are left out")
    return kept


def _by_opening(tube: Tube, second: Mapping[str, Any], count: int) -> tuple[arb_mat, arb]:
    """Return the openings of loops by dimensionless, mixed ones about the centres of the clusters' axes, and those of
    couplings by mixed ones; and what factor bounds how these centres move."""
    values, by, stretch, start = tube.wide(tube.along, tube.near), identity(count), arb(1), 0
    for cluster in second["clusters"]:
        length, about = arb(cluster["length"]), [arb(0)] * 3
        for chain, end, share, off in cluster["about"]:
            placed = tube.robot.family(chain, end, values, 0, True)[1]
            about = [a + (placed[i, 3] + arb(0, off)) * share for i, a in enumerate(about)]
        away = sum((a.rad() ** 2 for a in about), arb(0)).sqrt() / length / 2
        stretch = max(stretch, (away + (1 + away**2).sqrt()).upper())
        x, y, z = (a.mid() for a in about)
        block = identity(6)
        for k in range(3):
            block[k, k] = length
        block[0, 4], block[0, 5], block[1, 3], block[1, 5], block[2, 3], block[2, 4] = -z, y, z, -x, -y, x
        for a, row in enumerate(cluster["unmix"]):
            for b, factor in enumerate(row):
                for i in range(6):
                    for j in range(6):
                        by[start + 6 * a + i, start + 6 * b + j] = block[i, j] * arb(factor, tube.robot.data["radius"])
        start += 6 * len(cluster["unmix"])
    for a, row in enumerate(second["unmix"]):
        for b, factor in enumerate(row):
            by[start + a, start + b] = arb(factor, tube.robot.data["radius"])
    return by, stretch
