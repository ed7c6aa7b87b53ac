"""Check a certificate of a workspace by ball arithmetic (python-flint) alone: shares no code with what wrote it.

docs/proof.md has the mathematics; numbers of equations below are its. A certificate has the equations of a robot, a
region halved into boxes, and of each box a claim, a configuration x and a radius y; all else is computed again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import inf
from typing import Any

from flint import arb, arb_mat, ctx

_GAP = arb(1e-12)  # equations that no variable changes hold as designed if they are off by less
_STEPS = 12  # of Newton's method on a face
_PAIRS = {0: [], 2: [[(0, 2)], [(1, 2)]], 3: [[(0, 1), (1, 0)], [(1, 2), (2, 1)], [(2, 0), (0, 2)]]}
_AGREE = {0: [], 2: [2], 3: [0, 1, 2]}


class CertificateError(Exception):
    """A claim that is not confirmed; `box` is the number of the box that it is about, if it is about one."""

    box: int | None = None


class BallForm:
    """c + sum_j g_j eps_j + [-r, r], |eps_j| <= 1."""

    __slots__ = ("c", "g", "r")

    def __init__(self, c: Any, g: Sequence[Any] = (), r: Any = 0) -> None:
        self.c, self.g, self.r = arb(c), g, arb(r)

    def spread(self) -> arb:
        """Return a bound of the distance from c."""
        return sum((abs(x) for x in self.g), self.r)

    def is_zero(self) -> bool:
        """Return whether it is exactly 0."""
        return bool(self.c.is_zero() and self.r.is_zero() and all(x.is_zero() for x in self.g))

    def __add__(self, other: BallForm) -> BallForm:
        g = [a + b for a, b in zip(self.g, other.g, strict=True)] if self.g and other.g else self.g or other.g
        return BallForm(self.c + other.c, g, self.r + other.r)

    def __neg__(self) -> BallForm:
        return self.times(arb(-1))

    def times(self, k: arb) -> BallForm:
        """Return the product with a number."""
        return BallForm(self.c * k, [x * k for x in self.g], self.r * abs(k))

    def __mul__(self, other: BallForm) -> BallForm:  # equation 1
        if not other.g and other.r.is_zero():
            return self.times(other.c)
        if not self.g and self.r.is_zero():
            return other.times(self.c)
        s, t = self.spread() - self.r, other.spread() - other.r
        g = (self.times(other.c) + other.times(self.c)).g
        halves = [a * b / 2 for a, b in zip(self.g, other.g, strict=True)] if self.g and other.g else []
        r = s * t - sum(map(abs, halves), arb(0)) + (abs(self.c) + s) * other.r + self.r * (abs(other.c) + t + other.r)
        return BallForm(sum(halves, self.c * other.c), g, r)

    def sin_cos(self) -> tuple[BallForm, BallForm]:
        """Return sine and cosine: equation 2."""
        t, (s, c) = self.spread(), self.c.sin_cos()
        if t.is_zero():
            return BallForm(s), BallForm(c)
        out = []
        for value, slope in ((s, c), (c, -s)):
            q = value * t * t / 4
            out.append(BallForm(value - q, [slope * x for x in self.g], abs(slope) * self.r + abs(q) + t**3 / 6))
        return out[0], out[1]


Vector = list[BallForm]


def _sum(forms: Sequence[BallForm]) -> BallForm:
    return sum(forms[1:], forms[0]) if forms else BallForm(0)


def _dot(u: Vector, v: Vector) -> BallForm:
    return _sum([a * b for a, b in zip(u, v, strict=True)])


def _minus(u: Vector, v: Vector) -> Vector:
    return [a + -b for a, b in zip(u, v, strict=True)]


def _cross(u: Vector, v: Vector) -> Vector:
    return [u[i] * v[j] + -(u[j] * v[i]) for i, j in ((1, 2), (2, 0), (0, 1))]


class Robot:
    """The equations of a certificate."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data, self.length = data, arb(data["length"])
        self.variables, self.unknown = data["variables"], data["unknown"]
        self.over = [int(k) for k in data["over"]]
        self.columns = [*self.unknown, *self.over, *(k for k in data["given"] if k not in self.over)]
        self.units = [arb(self.variables[k]["unit"]) for k in self.columns]
        radius = arb(data["radius"])
        self.placements = [
            [arb(x, 0 if x in (0, 1, -1) else radius) for x in row[:9]]
            + [arb(x, 0 if x == 0 else radius * self.length) for x in row[9:]]
            for row in data["placements"]
        ]

    def evaluate(
        self, x: Sequence[BallForm], p: Sequence[BallForm]
    ) -> tuple[list[BallForm], list[list[BallForm]], list[BallForm]]:
        """Return residuals, derivatives (rows of columns) and positive numbers; x and derivatives dimensionless."""
        values = [BallForm(v["at"]) for v in self.variables]
        for k, form, unit in zip(self.unknown, x, self.units, strict=False):
            values[k] = form.times(unit)
        for k, form in zip(self.over, p, strict=True):
            values[k] = form
        bodies: dict[Any, Any] = {
            (): ([[BallForm(int(i == j)) for i in range(3)] for j in range(3)], [BallForm(0)] * 3, None, None)
        }
        stations: dict[Any, Any] = {}

        def moved(body: Any, index: int) -> tuple[list[Vector], Vector]:
            m = self.placements[index]
            axes = [[_sum([body[0][j][i].times(m[3 * j + k]) for j in range(3)]) for i in range(3)] for k in range(3)]
            return axes, [_sum([body[1][i]] + [body[0][j][i].times(m[9 + j]) for j in range(3)]) for i in range(3)]

        def body(chain: tuple[tuple[int, int], ...]) -> Any:
            if chain not in bodies:
                (index, k), last = chain[-1], body(chain[:-1])
                axes, origin = moved(last, index)
                stations[chain], value = (axes[2], origin), values[k]
                if self.variables[k]["prismatic"]:
                    bodies[chain] = axes, [o + a * value for o, a in zip(origin, axes[2], strict=True)], None, None
                else:
                    if last[2] is not None and self.placements[index][8] == 1:  # parallel axes: angles add up
                        axes, value = moved((last[2], last[1]), index)[0], last[3] + value
                    s, c = value.sin_cos()
                    u = [a * c + b * s for a, b in zip(axes[0], axes[1], strict=True)]
                    v = [b * c + -(a * s) for a, b in zip(axes[0], axes[1], strict=True)]
                    bodies[chain] = [u, v, axes[2]], origin, axes, value
            return bodies[chain]

        residual, jacobian, positive = list[BallForm](), list[list[BallForm]](), list[BallForm]()
        for closure in self.data["closures"]:
            chains = [tuple((i, k) for i, k in closure[side]) for side in ("first", "second")]
            (u, a), (v, b) = (
                moved(body(c), closure[f"{s}_end"]) for c, s in zip(chains, ("first", "second"), strict=True)
            )
            gap, linear, pairs = _minus(b, a), closure["translations"], _PAIRS[closure["rotations"]]
            residual += [(gap[k] if len(linear) == 3 else _dot(u[k], gap)).times(1 / self.length) for k in linear]
            turns = list[Vector]()
            for terms in pairs:
                products = [_dot(u[i], v[j]) for i, j in terms]
                residual.append(products[0] if len(terms) == 1 else products[0] + -products[1])
                both = [_cross(v[j], u[i]) for i, j in terms]
                turns.append(both[0] if len(terms) == 1 else _minus(*both))
            if agree := _AGREE[closure["rotations"]]:
                positive.append(_sum([_dot(u[i], v[i]) for i in agree]))
            rows = [[BallForm(0)] * len(self.columns) for _ in range(len(linear) + len(pairs))]
            for sign, chain, tip in ((-1, chains[0], a if len(linear) == 3 else b), (1, chains[1], b)):
                for n, (_, k) in enumerate(chain):
                    if k in self.columns:
                        at, (axis, origin) = self.columns.index(k), stations[chain[: n + 1]]
                        slides, unit = self.variables[k]["prismatic"], sign * self.units[self.columns.index(k)]
                        speed = axis if slides else _cross(axis, _minus(tip, origin))
                        parts = [speed[i] if len(linear) == 3 else _dot(u[i], speed) for i in linear]
                        column = [x.times(unit / self.length) for x in parts]
                        column += [BallForm(0) if slides else _dot(axis, turn).times(unit) for turn in turns]
                        for row, entry in zip(rows, column, strict=True):
                            row[at] = entry
            jacobian += rows
        for coupling in self.data["couplings"]:
            total, row, size = (
                BallForm(-arb(coupling["constant"])),
                [BallForm(0)] * len(self.columns),
                arb(coupling["size"]),
            )
            for k, coefficients in coupling["terms"]:
                value, slope = BallForm(0), BallForm(0)
                for c in reversed(coefficients):
                    slope = slope * values[k] + value + BallForm(c)
                    value = (value + BallForm(c)) * values[k]
                total = total + value
                if k in self.columns:
                    row[self.columns.index(k)] = slope.times(self.units[self.columns.index(k)] / size)
            residual.append(total.times(1 / size))
            jacobian.append(row)
        return residual, jacobian, positive


def _mat(rows: Sequence[Sequence[Any]]) -> arb_mat:
    return arb_mat([list(row) for row in rows])


def _abs(m: arb_mat) -> arb_mat:
    return arb_mat(m.nrows(), m.ncols(), [abs(x).upper() for x in m.entries()])


def _mid(m: arb_mat) -> arb_mat:
    return arb_mat(m.nrows(), m.ncols(), [x.mid() for x in m.entries()])


def _times(left: arb_mat, rows: Sequence[Sequence[BallForm]], n: int) -> tuple[list[arb_mat], arb_mat]:
    """Return a constant matrix times a matrix of forms: coefficients of 1, eps_1 ... eps_n, and radii."""
    zero = arb(0)
    parts = [_mat([[x.c for x in row] for row in rows])]
    parts += [_mat([[x.g[j] if x.g else zero for x in row] for row in rows]) for j in range(n)]
    return [left * part for part in parts], _abs(left) * _mat([[x.r for x in row] for row in rows])


class Tube:
    """A box with exactly one configuration within y of X(eps) = x + S eps: equations 3 to 5.

    Raises:
        CertificateError: that is not confirmed.
    """

    def __init__(self, robot: Robot, low: Sequence[float], high: Sequence[float], leaf: Mapping[str, Any]) -> None:
        n, k, rows = len(low), len(robot.unknown), robot.data["rows"]
        self.robot, self.rows, self.claim, self.reason = robot, rows, leaf["claim"], leaf["reason"]
        units = robot.units[:k]
        self.x = [arb(x) / u for x, u in zip(leaf["x"], units, strict=True)]
        self.x = [x.mid() for x in self.x]
        self.y = [(arb(y) / u).mid() for y, u in zip(leaf["y"], units, strict=True)]
        self.centre, self.radius = zip(
            *[(arb(a) / 2 + arb(b) / 2, arb(b) / 2 - arb(a) / 2) for a, b in zip(low, high, strict=True)], strict=True
        )
        self.low, self.high = low, high
        if len(rows) != k or not all(0 < y < 1 for y in self.y):
            raise CertificateError("the equations are not as many as the unknowns, or a radius is none")
        residual, jacobian, _ = robot.evaluate([BallForm(x) for x in self.x], [BallForm(c) for c in self.centre])
        point = _mid(_mat([[f.c for f in jacobian[i]] for i in rows]))
        square = arb_mat(k, k, [point[i, j] for i in range(k) for j in range(k)])
        self.inverse = _inverse(square)
        by = _mid(self.inverse * arb_mat(k, n, [point[i, k + j] * self.radius[j] for i in range(k) for j in range(n)]))
        self.slopes = [[-by[i, j] for j in range(n)] for i in range(k)]
        one = [[arb(int(i == j)) for j in range(n)] for i in range(n)]
        p = [BallForm(c, [r * x for x in row]) for c, r, row in zip(self.centre, self.radius, one, strict=True)]
        if not all(abs(f.c) < _GAP for i, f in enumerate(residual) if i not in rows):
            raise CertificateError("an equation that no variable changes does not hold")
        # equation 3: |C F(X(eps), P(eps))| <= z
        tube = [BallForm(x, s) for x, s in zip(self.x, self.slopes, strict=True)]
        parts, rest = self._product(robot.evaluate(tube, p)[1], n, k)
        at = self.inverse * arb_mat(k, 1, [residual[i].c for i in rows])
        along = arb_mat(
            k + n,
            n,
            [self.slopes[i][j] for i in range(k) for j in range(n)]
            + [x for r, row in zip(self.radius, one, strict=True) for x in [r * e for e in row]],
        )
        second, first, third = [part * along for part in parts[1:]], parts[0] * along, rest * _abs(along)
        z = []
        for i in range(k):
            squares = [second[j][i, j] / 2 for j in range(n)]
            mixed = sum((abs(second[a][i, b] + second[b][i, a]) / 2 for a in range(n) for b in range(a)), arb(0))
            ends = [
                at[i, 0] + sum((x for x in squares if (x > 0) is up or not (x > 0 or x < 0)), arb(0))
                for up in (True, False)
            ]
            more = mixed + sum((abs(first[i, j]) + third[i, j] for j in range(n)), arb(0))
            z.append(max(abs(e).upper() for e in ends) + more)
        # equation 4: K = z + E y < y
        wide = [BallForm(x, s, y) for x, s, y in zip(self.x, self.slopes, self.y, strict=True)]
        _, self.jacobian, positive = robot.evaluate(wide, p)
        if any(not f.is_zero() for i, row in enumerate(self.jacobian) if i not in rows for f in row):
            raise CertificateError("an equation is left out that variables change")
        if not all(f.c - f.spread() > 0 for f in positive):
            raise CertificateError("ends of a closure may be opposed")
        parts, rest = self._product(self.jacobian, n, k)
        image = []
        for i in range(k):
            e = [
                sum((abs(part[i, j]) for part in parts[1:]), abs(parts[0][i, j] - int(i == j)) + rest[i, j])
                for j in range(k)
            ]
            image.append((sum((a * y for a, y in zip(e, self.y, strict=True)), z[i])).upper())
        if not all(a < y for a, y in zip(image, self.y, strict=True)):
            raise CertificateError("existence and uniqueness are not confirmed")
        self.share = max((a / y).upper() for a, y in zip(image, self.y, strict=True))
        self.ranges = [
            (x - w, x + w)
            for x, w in ((x, sum(map(abs, s), a)) for x, s, a in zip(self.x, self.slopes, image, strict=True))
        ]

    def _product(self, jacobian: list[list[BallForm]], n: int, k: int) -> tuple[list[arb_mat], arb_mat]:
        return _times(self.inverse, [jacobian[i][: k + n] for i in self.rows], n)

    def at(self, p: Sequence[arb]) -> list[arb]:
        """Return X at a pose."""
        eps = [(a - c) / r for a, c, r in zip(p, self.centre, self.radius, strict=True)]
        return [
            x + sum((s * e for s, e in zip(row, eps, strict=True)), arb(0))
            for x, row in zip(self.x, self.slopes, strict=True)
        ]

    def meets(self, x: Sequence[arb], p: Sequence[arb], other: Tube) -> bool:
        """Return whether the configuration of this box at a pose is that of the other: equation 6."""
        for _ in range(_STEPS):
            residual, _, _ = self.robot.evaluate([BallForm(a.mid()) for a in x], [BallForm(a) for a in p])
            step = (self.inverse * arb_mat(len(x), 1, [residual[i].c for i in self.rows])).entries()
            away = max((abs(s) / y).upper() for s, y in zip(step, self.y, strict=True)) / (1 - self.share)
            inside = [abs(a.mid() - b) < y for a, b, y in zip(x, self.at(p), self.y, strict=True)]
            near = [abs(a.mid() - b) + away * y < w for a, b, y, w in zip(x, other.at(p), self.y, other.y, strict=True)]
            if all(inside) and all(near):
                return True
            x = [(a.mid() - s).mid() for a, s in zip(x, step, strict=True)]
        return False

    def status(self) -> tuple[str, int]:
        """Return proved, limit or regular, and the sign of the locked joints' determinant, 0 if it may vanish."""
        n, sign, columns = len(self.low), 0, self.robot.columns
        locked = [i for i, k in enumerate(columns) if k not in self.robot.data["actuated"]]
        limits = (
            [self.robot.variables[k]["limits"] for k in self.robot.unknown]
            if self.robot.data["bounds"]["limits"]
            else []
        )
        inside = True
        for (low, high), unit, (least, most) in zip(self.ranges, self.robot.units, limits, strict=False):
            ends = [None if x is None else arb(x, abs(x) * 2.0**-50) / unit for x in (least, most)]
            if (ends[0] is not None and high < ends[0]) or (ends[1] is not None and low > ends[1]):
                return "limit", 0
            inside = inside and (ends[0] is None or low > ends[0]) and (ends[1] is None or high < ends[1])
        if len(locked) == len(self.rows):  # equation 5
            rows = [[self.jacobian[i][j] for j in locked] for i in self.rows]
            left = _inverse(_mid(_mat([[f.c for f in row] for row in rows])))
            parts, rest = _times(left, rows, n)
            size = len(locked)
            parts[0] -= arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])
            rest += _abs(parts[0])
            total = rest + sum((_abs(part) for part in parts[2:]), _abs(parts[1])) * rest
            for a in range(1, n + 1):
                total += _abs(parts[a] * parts[a])
                for b in range(1, a):
                    total += _abs(parts[a] * parts[b] + parts[b] * parts[a])
            identity = arb_mat(size, size, [int(i == j) for i in range(size) for j in range(size)])
            ones = arb_mat(size, 1, [1] * size)
            weights = _mid(_inverse(identity - _mid(total)) * ones)
            after = total * weights
            if all(w > 0 and a < w for a, w in zip(after.entries(), weights.entries(), strict=True)):
                sign = 1 if left.det() > 0 else -1 if left.det() < 0 else 0
        return ("proved" if inside and sign else "regular"), sign


@contextmanager
def _about(box: int) -> Iterator[None]:
    """Note in an error which box it is about."""
    try:
        yield
    except CertificateError as error:
        error.box = box
        raise


def _inverse(m: arb_mat) -> arb_mat:
    try:
        return _mid(m.inv())
    except ZeroDivisionError:
        raise CertificateError("a matrix is singular") from None


def check(certificate: Mapping[str, Any], report: Callable[[int, int], None] = lambda done, of: None) -> dict[str, Any]:
    """Return the result of a certificate: shares of the region's volume, witnesses, and numbers of boxes and faces.

    Raises:
        CertificateError: a claim is not confirmed.
    """
    with ctx.workprec(64):
        try:
            return _result(certificate, report)
        except CertificateError:
            raise
        except Exception as error:  # numbers and structures of any kind
            raise CertificateError(f"it is damaged ({type(error).__name__}: {error})") from None


def _result(certificate: Mapping[str, Any], report: Callable[[int, int], None]) -> dict[str, Any]:
    robot, ends = Robot(certificate), list(certificate["over"].values())
    tree, leaves, pairs = iter(certificate["tree"]), list[Tube | None](), list[tuple[Tube, Tube, int]]()
    shares = list[float]()

    def read(low: list[float], high: list[float], share: float) -> Any:
        node = next(tree)
        if isinstance(node, dict):
            with _about(len(leaves)):
                leaves.append(None if node["claim"] == "open" else Tube(robot, low, high, node))
            shares.append(share)
            report(len(leaves), len(certificate["tree"]))
            return leaves[-1]
        middle = (low[node] + high[node]) / 2
        if not low[node] < middle < high[node]:
            raise CertificateError("a box is empty")
        parts = [
            read(*ends, share / 2) for ends in ((low, _with(high, node, middle)), (_with(low, node, middle), high))
        ]
        return node, *parts, low, high

    def faces(a: Any, b: Any, axis: int) -> None:
        """Collect the pairs of boxes of two neighbours along an axis that share a face."""
        if a is None or b is None:
            return
        if not isinstance(a, Tube):
            k, first, second, *_ = a
            for part in [second] if k == axis else [first, second]:
                faces(part, b, axis)
        elif not isinstance(b, Tube):
            k, first, second, *_ = b
            for part in [first] if k == axis else [first, second]:
                faces(a, part, axis)
        elif all(
            max(x, y) < min(u, v)
            for i, (x, y, u, v) in enumerate(zip(a.low, b.low, a.high, b.high, strict=True))
            if i != axis
        ):
            pairs.append((a, b, axis))

    def inner(node: Any) -> None:
        if isinstance(node, tuple):
            faces(node[1], node[2], node[0])
            inner(node[1])
            inner(node[2])

    low, high = ([float(x[i]) for x in ends] for i in range(2))
    if not all(-inf < a < b < inf for a, b in zip(low, high, strict=True)):
        raise CertificateError("the region is empty")
    root = read(low, high, 1.0)
    if next(tree, None) is not None:
        raise CertificateError("boxes are left over")
    inner(root)
    meeting, apart = list[tuple[Tube, Tube]](), list[tuple[Tube, Tube]]()
    for a, b, axis in pairs:  # all faces: a branch may not close on itself
        p = [arb(max(x, y)) / 2 + arb(min(u, v)) / 2 for x, y, u, v in zip(a.low, b.low, a.high, b.high, strict=True)]
        p[axis] = arb(a.high[axis])
        (meeting if a.meets(a.at(p), p, b) else apart).append((a, b))
    start = certificate["start"]
    pose, x = list(map(float, start["pose"])), [arb(v) / u for v, u in zip(start["x"], robot.units, strict=False)]
    begun = [t for t in leaves if t and _inside(t, pose) and t.meets(x, [arb(v) for v in pose], t)]
    branch, dropped = set[int](), set[int]()
    while begun:
        branch, border = {id(begun[0])}, [begun[0]]
        while border:
            tube = border.pop()
            near = [b if a is tube else a for a, b in meeting if tube in (a, b)]
            new = [t for t in near if id(t) not in branch | dropped]
            branch |= set(map(id, new))
            border += new
        wrong = [b for a, b in apart if id(a) in branch and id(b) in branch]
        if not wrong:
            break
        dropped |= {id(t) for t in wrong if t is not begun[0]} or {id(wrong[0])}
        begun = [t for t in begun if id(t) not in dropped]
        branch = set()
    found: dict[str, float] = {"proved": 0.0, "refuted": 0.0, "undecided": 0.0}
    witnesses, signs = list[dict[str, Any]](), dict[int, Tube]()
    for i, (leaf, share) in enumerate(zip(leaves, shares, strict=True)):
        with _about(i):
            status, sign = leaf.status() if leaf and id(leaf) in branch else ("undecided", 0)
            if leaf and id(leaf) in branch and leaf.claim in ("proved", "limit") and status != leaf.claim:
                raise CertificateError(f"a box is {status}, not {leaf.claim}")
        if leaf and id(leaf) in branch:
            signs.setdefault(sign, leaf)
            if status == "limit":
                witnesses.append(_witness(leaf, limit=leaf.reason))
        found[{"proved": "proved", "limit": "refuted"}.get(status, "undecided")] += share
    if 1 in signs and -1 in signs:
        witnesses += [_witness(signs[s], determinant=s) for s in (1, -1)]
    return {**found, "witnesses": witnesses, "boxes": len(leaves), "faces": len(pairs)}


def _witness(leaf: Tube, **why: Any) -> dict[str, Any]:
    names = [leaf.robot.variables[k]["name"] for k in (*leaf.robot.over, *leaf.robot.unknown)]
    values = [*map(float, leaf.centre), *(float(x * u) for x, u in zip(leaf.x, leaf.robot.units, strict=False))]
    n = len(leaf.centre)
    return {
        "pose": dict(zip(names[:n], values, strict=False)),
        "configuration": dict(zip(names[n:], values[n:], strict=True)),
        **why,
    }


def _inside(leaf: Tube, p: Sequence[float]) -> bool:
    return all(a <= x <= b for a, x, b in zip(leaf.low, p, leaf.high, strict=True))


def _with(ends: list[float], k: int, value: float) -> list[float]:
    return [*ends[:k], value, *ends[k + 1 :]]
