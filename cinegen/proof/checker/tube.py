"""A box with exactly one configuration: equations 3 to 5 of docs/proof.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement, product
from typing import Any

from flint import arb, arb_mat

from cinegen.proof.checker.balls import (
    CertificateError,
    absolute,
    added_sizes,
    column,
    doubles,
    identity,
    inverse,
    pick,
    row_sums,
    upper,
)  # fmt: skip
from cinegen.proof.checker.equations import Robot, Value

_NEARER = 3  # times that z + E y takes the place of y
_GAP = arb(1e-12)  # equations that no variable changes hold as designed if they are off by less


def middle(low: Sequence[float], high: Sequence[float]) -> tuple[list[arb], list[arb]]:
    """Return the centre of a box, and its radius about that."""
    centre = [(arb(a) / 2 + arb(b) / 2).mid() for a, b in zip(low, high, strict=True)]
    return centre, [max(arb(b) - c, c - a).upper() for a, b, c in zip(low, high, centre, strict=True)]


class Tube:
    """A box with exactly one configuration within y of X(eps): equations 3 to 5.

    Raises:
        CertificateError: that is not confirmed.
    """

    def __init__(self, robot: Robot, low: Sequence[float], high: Sequence[float], leaf: Mapping[str, Any]) -> None:
        n, k, width, rows = len(low), len(robot.unknown), robot.width, robot.data["rows"]
        self.robot, self.low = robot, low
        self.locked = [i for i, k in enumerate(robot.columns[:width]) if k not in robot.data["actuated"]]
        self.x, self.y = (
            doubles(column([arb(a) / u for a, u in zip(leaf[name], robot.units[:k], strict=True)])).entries()
            for name in "xy"
        )
        if len(rows) != k or not all(0 < y < 1 for y in self.y):
            raise CertificateError("the equations are not as many as the unknowns, or a radius is none")
        self.centre, self.radius = middle(low, high)
        point = robot.point(self.x, self.centre)
        centre = robot.parts(point, 2)
        residual, jacobian = robot.residual(point, centre), robot.jacobian(point, centre)
        self.inverse = c = inverse(arb_mat([jacobian[i][:k] for i in rows]))
        box = arb_mat(width, n)
        for j, r in enumerate(self.radius):
            box[k + j, j] = r
        all_columns, first = list(range(width)), pick(jacobian, rows, range(width))
        straight = arb_mat((-doubles(c * first * box)).tolist() + box.tolist()[k:])
        change = robot.change(self.wide(straight, [arb(0)] * k), centre, centre)
        bent = [c * pick(m, rows, all_columns) * straight for m in change[:n]]
        pairs = [(a, b) for a in range(n) for b in range(a, n)]
        second = arb_mat([
            [(bent[a][i, b] + bent[b][i, a]) / (4 if a == b else 2) for a, b in pairs] for i in range(k)
        ])  # fmt: skip
        curved, rest = -doubles(second), arb_mat(width - k, len(pairs)).tolist()
        self.along = arb_mat([x + y for x, y in zip(straight.tolist(), curved.tolist() + rest, strict=True)])
        wide = self.wide(self.along, self.y)
        change = robot.change(wide, centre, robot.parts(wide, 2, True))
        third = change[n + len(pairs) : -2]
        both = [_added_rows(*m) for m in zip(change[n : n + len(pairs)], third, strict=True)]
        self.parts = [jacobian, *change[:n], *both, *change[-2:]]
        self._check_rest(residual)
        z = (
            row_sums(c * column([residual[i] for i in rows]))
            + row_sums(c * first * straight)
            + row_sums(second + curved)
        )
        z += absolute(c) * (pick(self.parts[-2], rows, all_columns) * row_sums(self.along)) / 3
        self._enclose(z, [c * pick(m, rows, all_columns) / 3 for m in third], straight, curved)

    def _enclose(self, z: arb_mat, third: Sequence[arb_mat], straight: arb_mat, curved: arb_mat) -> None:
        """Check existence and uniqueness, and find where the configuration is; z: part of that of equation 3."""
        n, k, curve = len(self.low), len(self.x), row_sums(curved)
        constant, *by, unsure = self.less_identity(self.inverse, range(k))
        halves = [(m - pick(t.tolist(), range(k), range(k))) / 2 for m, t in zip(by[n:], third, strict=True)]
        pairs, cubes = list(combinations_with_replacement(range(n), 2)), dict[Any, list[arb]]()
        bent, cubed = (
            [(m * curved).transpose().tolist() for m in by[:n]],
            [(t * straight).transpose().tolist() for t in third],
        )
        for (q, pair), a in product(enumerate(pairs), range(n)):
            total = cubes.setdefault(tuple(sorted((a, *pair))), [arb(0)] * k)
            total[:] = [x + u + v for x, u, v in zip(total, bent[a][q], cubed[q][a], strict=True)]
        z += added_sizes([column(x) for x in cubes.values()]) + (added_sizes(halves) + absolute(constant)) * curve
        # equation 4: z + E y < y
        defect = added_sizes([constant, *by]) + unsure
        near = upper(z + defect * column(self.y))
        if not all(a < y for a, y in zip(near.entries(), self.y, strict=True)):
            raise CertificateError("existence and uniqueness are not confirmed")
        for _ in range(_NEARER):
            near = upper(z + defect * near)
        self.near, self.defect = near.entries(), upper(defect)
        self.resolvent = inverse(identity(k) - self.defect)
        share = max((a / y).upper() for a, y in zip(self.near, self.y, strict=True))
        self.parts[-1] = [[x * share for x in row] for row in self.parts[-1]]
        away = [a + b for a, b in zip(row_sums(self.along).entries(), self.near, strict=False)]
        self.ranges = [(x - a, x + a) for x, a in zip(self.x, away, strict=True)]

    def wide(self, along: arb_mat, radius: Sequence[arb]) -> list[Value]:
        """Return the values of all variables along a matrix, the unknowns within a radius."""
        k, rows = len(self.x), along.tolist()
        x = [Value(a, row, b) for a, row, b in zip(self.x, rows, radius, strict=False)]
        return self.robot.values(x, [Value(a, row, arb(0)) for a, row in zip(self.centre, rows[k:], strict=False)])

    def _check_rest(self, residual: Sequence[arb]) -> None:
        """Check what is positive, and that the equations that are left out hold everywhere."""
        width = self.robot.width
        away = column([*self.y, *[0] * (width - len(self.y))])
        away += row_sums(self.along)
        for i, value in enumerate(residual):
            part = arb_mat([m[i][:width] for m in self.parts])
            if self.robot.kinds[i] == "positive":
                if not value > row_sums((absolute(part) * away).transpose())[0, 0]:
                    raise CertificateError("ends of a closure may be opposed")
            elif (
                self.robot.kinds[i] == "equation"
                and i not in self.robot.data["rows"]
                and not (abs(value) < _GAP and part == part * 0)
            ):
                raise CertificateError("an equation is left out that variables change, or that does not hold")

    def less_identity(self, left: arb_mat, columns: Sequence[int]) -> list[arb_mat]:
        """Return the parts of C W - 1, W some columns of the derivative."""
        first, *by, bend, apart = (pick(m, self.robot.data["rows"], columns) for m in self.parts)
        return [left * first - identity(len(columns)), *(left * m for m in by), absolute(left) * absolute(bend + apart)]


def _added_rows(first: Sequence[Sequence[arb]], second: Sequence[Sequence[arb]]) -> list[list[arb]]:
    return [[a + b for a, b in zip(x, y, strict=True)] for x, y in zip(first, second, strict=True)]
