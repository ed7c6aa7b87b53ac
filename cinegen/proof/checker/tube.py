"""A box with exactly one configuration: equations 3 to 5 of docs/proof.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from flint import arb, arb_mat

from cinegen.proof.checker.balls import (
    CertificateError,
    absolute,
    added,
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
        at = robot.parts(point, 2)
        residual, jacobian = robot.residual(point, at), robot.jacobian(point, at)
        self.inverse = c = inverse(arb_mat([jacobian[i][:k] for i in rows]))
        box = arb_mat(width, n)
        for j, r in enumerate(self.radius):
            box[k + j, j] = r
        all_columns, first = list(range(width)), pick(jacobian, rows, range(width))
        straight = arb_mat((-doubles(c * first * box)).tolist() + box.tolist()[k:])
        change = robot.change(self.wide(straight, 0), at, at)
        bent = [c * pick(m, rows, all_columns) * straight for m in change[:n]]
        pairs = [(a, b) for a in range(n) for b in range(a, n)]
        second = arb_mat([
            [(bent[a][i, b] + bent[b][i, a]) / (4 if a == b else 2) for a, b in pairs] for i in range(k)
        ])  # fmt: skip
        curved, rest = -doubles(second), arb_mat(width - k, len(pairs)).tolist()
        self.along = arb_mat([x + y for x, y in zip(straight.tolist(), curved.tolist() + rest, strict=True)])
        wide = self.wide(self.along, 1)
        change = robot.change(wide, at, robot.parts(wide, 2, True))
        self.parts, self.sharper = [jacobian, *change[: len(wide[0].g) + 2]], change[len(wide[0].g) + 2 :]
        self._check_rest(residual)
        # equation 3: |C F(X(eps), P(eps))| <= z
        constant, *by, unsure = self.less_identity(c, range(k))
        squares, curve = added_sizes(by[n:]), row_sums(curved)
        z = (
            row_sums(c * column([residual[i] for i in rows]))
            + row_sums(c * first * straight)
            + absolute(constant) * curve
        )
        z += row_sums(second + curved) + added([row_sums(m * curved) for m in by[:n]]) + squares * curve / 2
        z += absolute(c) * (pick(self.parts[-2], rows, all_columns) * row_sums(self.along)) / 3
        # equation 4: z + E y < y
        defect = added_sizes([constant, *by[:n]]) + squares + unsure
        image = upper(z + defect * column(self.y)).entries()
        if not all(a < y for a, y in zip(image, self.y, strict=True)):
            raise CertificateError("existence and uniqueness are not confirmed")
        self.defect = upper(defect)
        self.resolvent = inverse(identity(k) - self.defect)
        away = [a + b for a, b in zip(row_sums(self.along).entries(), image, strict=False)]
        self.ranges = [(x - a, x + a) for x, a in zip(self.x, away, strict=True)]

    def wide(self, along: arb_mat, y: int) -> list[Value]:
        """Return the values of all variables along a matrix, within y times the radius."""
        k, rows = len(self.x), along.tolist()
        x = [Value(a, row, b * y) for a, row, b in zip(self.x, rows, self.y, strict=False)]
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
