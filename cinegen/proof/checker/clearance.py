"""Distances between bodies over boxes: equation 9 of docs/proof.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement, product
from typing import Any

from flint import arb, arb_mat

from cinegen.proof.checker.balls import CertificateError, absolute, added_sizes, column, row_sums
from cinegen.proof.checker.equations import Robot
from cinegen.proof.checker.forms import Form
from cinegen.proof.checker.tube import Tube


class Bodies:
    """The bodies of a robot over a box."""

    def __init__(self, tube: Tube) -> None:
        self._data, self._n, along = tube.robot.data, len(tube.low), tube.along
        robot = Robot({**self._data, "closures": self._data["bodies"], "couplings": [], "rows": [], "virtual": []})
        point, wide, n, count = robot.point(tube.x, tube.centre), tube.wide(along, tube.near), self._n, along.ncols()
        centre = robot.parts(point, 2)
        change = robot.change(wide, centre, robot.parts(wide, 2, True))
        jacobian, *by, bend, apart = (
            arb_mat(m) for m in (robot.jacobian(point, centre), *change[:count], *change[-2:])
        )
        slopes, turned, unsure = jacobian * along, [m * along / 2 for m in by], absolute(bend + apart) / 2
        away = column([*tube.near, *[0] * (along.nrows() - len(tube.near))])
        rest = unsure * row_sums(along) + added_sizes([jacobian, *(m / 2 for m in by), unsure]) * away
        parts = [[slopes[i, k] for i in range(slopes.nrows())] for k in range(count)]
        products = {pair: q for q, pair in enumerate(combinations_with_replacement(range(n), 2), n)}
        for (j, m), k in product(enumerate(turned), range(count)):
            bends, q = [m[i, k] for i in range(m.nrows())], products.get((min(j, k), max(j, k)))
            if q is None:
                rest += absolute(column(bends))
            else:
                parts[q] = [a + b for a, b in zip(parts[q], bends, strict=True)]
        numbers = [robot.residual(point, centre), *parts, rest.entries()]
        placed = list[Form]()
        for start in range(0, len(numbers[0]), 12):
            c, *g, r = (_placement(x[start : start + 12], robot.length) for x in numbers)
            placed.append(Form(c, g, r))
        self._shapes = [_Shape(shape, placed[shape["body"]]) for shape in self._data["shapes"]]

    def are_apart(self, planes: Sequence[Sequence[int]]) -> bool:
        """Return whether each pair is farther apart than asked for, by planes that move with the first body."""
        if len(planes) != len(self._data["pairs"]):
            raise CertificateError("planes are not as many as pairs of bodies")
        return all(self._is_apart(i, j, plane) for (i, j), plane in zip(self._data["pairs"], planes, strict=True))

    def _is_apart(self, i: int, j: int, plane: Sequence[int]) -> bool:
        first, second = self._shapes[i], self._shapes[j]
        normal = arb_mat(4, 1, [*plane, 0])
        heights, size = (normal.transpose() * first.points).entries(), (normal.transpose() * normal)[0, 0].sqrt()
        top = max(range(len(heights)), key=lambda k: float(heights[k]))
        least = (arb(self._data["bounds"]["clearance"]) + first.radius + second.radius) * size
        least += max(h.upper() for h in heights) - heights[top]
        along, moves = (first.body.c * normal).transpose(), (first.moves + second.moves) * size
        touched = (along * first.placed.c)[0, top]
        if all(x - touched - moves > least for x in (along * second.placed.c).entries()):
            return True
        c, *g, r = (_column(m, top, second.points.ncols()) for m in (first.placed.c, *first.placed.g, first.placed.r))
        away, turned = second.placed.less(Form(c, g, r)), first.body.times(normal).transposed()
        beyond = turned.by(away, self._n)
        return all(x > least for x in (beyond.c - added_sizes([*beyond.g, beyond.r])).entries())

    def are_near(self, pair: int, weights: Sequence[Sequence[float]]) -> str:
        """Return the names of a pair of bodies, points of which are nearer than asked for; the points are weighted
        means of corners."""
        ends, most, names = list[Form](), arb(self._data["bounds"]["clearance"]), list[str]()
        for i, numbers in zip(self._data["pairs"][pair], weights, strict=True):
            shape, w = self._shapes[i], [arb(x) for x in numbers]
            if not all(x >= 0 for x in w) or self._data["shapes"][i]["slack"] is None:
                raise CertificateError("a point is not known to be of a body")
            ends.append(shape.body.times(shape.points * column(w) * (1 / sum(w, arb(0)))))
            most += shape.radius - arb(self._data["shapes"][i]["slack"])
            names.append(self._data["shapes"][i]["name"])
        size = sum((x * x for x in ends[0].less(ends[1]).sizes().entries()), arb(0)).sqrt()
        if not size < most:
            raise CertificateError("bodies are not known to be near")
        return " and ".join(names)


class _Shape:
    """A shape over a box: its corners, its radius, and how far its points are from those at the centre at most."""

    def __init__(self, data: Mapping[str, Any], body: Form) -> None:
        self.body, self.radius = body, arb(data["radius"])
        self.points = arb_mat([[*point, 1] for point in data["points"]]).transpose()
        self.placed = body.times(self.points)
        moves = added_sizes([*self.placed.g, self.placed.r])
        squares = [sum((moves[i, k] ** 2 for i in range(3)), arb(0)) for k in range(moves.ncols())]
        self.moves = max(x.sqrt().upper() for x in squares)


def _column(m: arb_mat, at: int, count: int) -> arb_mat:
    """Return a column, several times."""
    return arb_mat([[m[i, at]] * count for i in range(m.nrows())])


def _placement(numbers: Sequence[arb], length: arb) -> arb_mat:
    return arb_mat(3, 4, [x * length if i % 4 == 3 else x for i, x in enumerate(numbers)])
