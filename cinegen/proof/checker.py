"""Check a certificate of a workspace by ball arithmetic (python-flint) alone: shares no code with what wrote it.

docs/proof.md has the mathematics; numbers of equations below are its. A certificate has the equations of a robot, a
region halved into boxes, and of each box a claim, a configuration x and a radius y; all else is computed again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations_with_replacement
from math import inf
from typing import Any, NamedTuple

from flint import arb, arb_mat, arb_poly, ctx

_GAP = arb(1e-12)  # equations that no variable changes hold as designed if they are off by less
_STEPS = 12  # of Newton's method on a face
_UP = arb(1 + 2.0**-20)  # more than rounding does to radii
_PAIRS = {0: [], 2: [(0, 2), (1, 2)], 3: [(0, 1), (1, 2), (2, 0)]}  # by the number of rotations: u_i . v_j
_RATES = {None: 0, "slide": 1, "turn": 3}  # numbers of rows
_ONE, _ZERO = arb_mat(4, 4, [int(i % 5 == 0) for i in range(16)]), arb_mat(4, 4)
_POINT, _ALONG = (arb_mat(4, 4, [int(i == k) for i in range(16)]) for k in (15, 11))  # origin; z
_AXES = _ONE - _POINT


class CertificateError(Exception):
    """A claim that is not confirmed; `box` is the number of the box that it is about, if it is about one."""

    box: int | None = None


class Value(NamedTuple):
    """c + sum_j g_j eta_j + [-r, r], |eta_j| <= 1."""

    c: arb
    g: Sequence[arb]
    r: arb

    def plus(self, other: Value) -> Value:
        """Return the sum."""
        return Value(self.c + other.c, [a + b for a, b in zip(self.g, other.g, strict=True)], self.r + other.r)

    def spread(self) -> arb:
        """Return a bound of the change by eta."""
        return sum(map(abs, self.g), arb(0))


class Slot(NamedTuple):
    """A factor of a chain: variables, whose sum is its value, what comes before, its matrix with derivatives, whether
    it turns, and whether it varies."""

    variables: list[int]
    value: Value
    before: arb_mat
    powers: list[arb_mat]
    turns: bool
    varies: bool


def _turn(x: arb, n: int) -> arb_mat:
    """Return the n-th derivative of the rotation by x about z: equation 2."""
    (s, c), r = x.mid().sin_cos(), x.rad()
    wide = [abs(b) * r + abs(a) * r * r / 2 + r**3 / 6 for a, b in ((s, c), (c, s))]
    s, c = s + arb(0, wide[0].upper()), c + arb(0, wide[1].upper())
    for _ in range(n):
        s, c = c, -s
    rest = int(n == 0)
    return arb_mat(4, 4, [c, -s, 0, 0, s, c, 0, 0, 0, 0, rest, 0, 0, 0, 0, rest])


class Robot:
    """The equations of a certificate."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data, self.length, self.variables = data, arb(data["length"]), data["variables"]
        self.unknown, self.over = data["unknown"], [int(k) for k in data["over"]]
        self.columns = [*self.unknown, *self.over, *(k for k in data["given"] if k not in self.over)]
        self.width, self.virtual = len(self.columns), set(data.get("virtual", []))
        self.columns += data.get("virtual", [])
        self.products = len(self.over) * (len(self.over) + 1) // 2 if self.virtual else 0
        self.units = [arb(self.variables[k]["unit"]) for k in self.columns]
        radius, self.placements = arb(data["radius"]), list[arb_mat]()
        self.radii = data.get("radii") or [[0] * 12 for _ in data["placements"]]
        for row, more in zip(data["placements"], self.radii, strict=True):
            r = [0 if x in (0, 1, -1) else radius for x in row[:9]] + [radius * self.length * (x != 0) for x in row[9:]]
            m = [arb(x, (w + arb(y)).upper()) for x, w, y in zip(row, r, more, strict=True)]
            self.placements.append(arb_mat([[*m[3 * i : 3 * i + 3], m[9 + i]] for i in range(3)] + [[0, 0, 0, 1]]))
        self.kinds, self.starts = list[str](), [0]
        for closure in data["closures"]:
            plain, turns = len(closure["translations"]) + closure["rotations"], closure["rotations"]
            self.kinds += ["equation"] * plain + ["positive"] * (turns > 0) + ["rate"] * _RATES[closure.get("rates")]
            self.starts.append(len(self.kinds))
        self.kinds += ["equation"] * len(data["couplings"])
        if any(self.kinds[i] != "equation" for i in data["rows"]):
            raise CertificateError("a row is no equation")

    def values(self, x: Sequence[Value], p: Sequence[Value]) -> list[Value]:
        """Return the values of all variables, rad and m; x is dimensionless."""
        values = [Value(arb(v["at"]), [arb(0)] * len(p[0].g), arb(0)) for v in self.variables]
        for k, v, unit in zip(self.unknown, x, self.units, strict=False):
            values[k] = Value(v.c * unit, [g * unit for g in v.g], v.r * unit)
        for k, v in zip(self.over, p, strict=True):
            values[k] = v
        return values

    def point(self, x: Sequence[arb], p: Sequence[arb]) -> list[Value]:
        """Return the values of all variables in a configuration."""
        return self.values([Value(a, [], arb(0)) for a in x], [Value(a, [], arb(0)) for a in p])

    def family(
        self, chain: Sequence[Sequence[int]], end: int, values: Sequence[Value], order: int, wide: bool
    ) -> tuple[list[Slot], arb_mat, list[arb_mat], dict[Any, arb_mat], list[arb_mat]]:
        """Return the slots of a chain, the placement of its end, derivatives by one, two or three of them, and axes.

        Angles about parallel axes are added up. With `wide` they are over all values, else at their middle."""
        slots, turned, is_turn = list[Slot](), _ONE, False
        for index, k in chain:
            value, slides, moved = values[k], self.variables[k]["prismatic"], turned * self.placements[index]
            names, before, turned = [k], moved, _ONE
            if is_turn and not slides and self.data["placements"][index][8] == 1 and not any(self.radii[index][2:9:3]):
                last, offset = slots[-1], moved * _POINT - _POINT
                powers = [power * offset for power in last.powers]
                slots[-1] = last._replace(powers=[_ONE + powers[0], *powers[1:]], turns=False)
                names, value, before = [*last.variables, k], last.value.plus(value), _ONE
                turned = moved * _AXES + _POINT
            q = arb(value.c.mid(), (value.c.rad() + value.spread() + value.r).upper()) if wide else value.c
            powers = [_ONE + _ALONG * q, _ALONG, _ZERO, _ZERO] if slides else [_turn(q, n) for n in range(order + 1)]
            slots.append(Slot(names, value, before, powers, not slides, not self.virtual.issuperset(names)))
            is_turn = not slides
        factors = [[slot.before * slot.powers[n] for slot in slots] for n in range(order + 1)]
        after, before, first, axes = [turned * self.placements[end]], _ONE, list[arb_mat](), list[arb_mat]()
        second = dict[Any, arb_mat]()
        for factor in reversed(factors[0]):
            after.insert(0, factor * after[0])
        for s in range(len(slots) if order else 0):
            along = before * factors[1][s]
            first.append(along * after[s + 1])
            axes.append(before * slots[s].before * _ALONG if slots[s].turns else _ZERO)
            if order > 1:
                second[s, s] = before * factors[2][s] * after[s + 1]
            for t in range(s + 1, len(slots) if order > 1 else 0):
                if slots[s].varies or slots[t].varies:
                    second[s, t] = along * factors[1][t] * after[t + 1]
                along = along * factors[0][t]
            before = before * factors[0][s]
        for key in combinations_with_replacement([s for s, slot in enumerate(slots) if slot.varies], 3 * (order == 3)):
            if key:
                third = after[key[-1] + 1]
                for s in reversed(range(key[-1] + 1)):
                    third = factors[key.count(s)][s] * third
                second[key] = third
        return slots, after[0], first, second, axes

    def closure(self, closure: Mapping[str, Any], values: Sequence[Value], order: int, wide: bool = False) -> Any:
        """Return slots and derivatives of an order of the residuals, of what is positive, with rotations, and of rates:
        of column s, or of column s by t.

        They are of V = B - A and of E = A^T V, with the placements A and B of both ends; or the relative angular
        velocity, a sum of axes a_s, whose derivatives by t before s are a_t x a_s."""
        ends = ((closure[end], closure[f"{end}_end"]) for end in ("first", "second"))
        if self.virtual and order == 2 and not closure["rotations"] and len(closure["translations"]) == 3:
            order = 3  # of V alone
        (slots, a, a1, a2, on_a), (others, b, b1, b2, on_b) = (self.family(*end, values, order, wide) for end in ends)
        turns, linear, n, rates = closure["rotations"], closure["translations"], len(slots), closure.get("rates")

        def back(m: arb_mat) -> arb_mat:
            return (m * _AXES).transpose()

        def residuals(v: arb_mat, *products: tuple[arb_mat, arb_mat]) -> list[arb]:
            if not turns and len(linear) % 3 == 0:
                return [v[i, 3] / self.length for i in linear]
            e = sum((x * y for x, y in products), _ZERO)
            out = [(v if len(linear) == 3 else e)[i, 3] / self.length for i in linear]
            out += [e[i, j] - e[j, i] if turns == 3 else e[i, j] for i, j in _PAIRS[turns]]
            out += [sum((e[i, i] for i in range(2 * (turns == 2), 3)), arb(0))] if turns else []
            return out + ([e[2, 3] / self.length] if rates == "slide" else [])

        def turn(s: int, t: int | None = None) -> list[arb]:
            side, sign, s = (on_a, -1, s) if s < n else (on_b, 1, s - n)
            if rates != "turn" or t is None:
                return [side[s][i, 3] * sign for i in range(3)] if rates == "turn" else []
            t -= 0 if side is on_a else n
            if not 0 <= t < s:
                return [arb(0)] * 3
            x, y = ([m[i, 3] for i in range(3)] for m in (side[t], side[s]))
            return [(x[i - 2] * y[i - 1] - x[i - 1] * y[i - 2]) * sign for i in range(3)]

        u, v = back(a), b - a * _POINT
        if order == 0:
            return [*slots, *others], residuals(v, (u, v)) + [arb(0)] * (3 * (rates == "turn"))
        us, vs = [back(x) for x in a1], [-(x * _POINT) for x in a1]
        if order == 1:
            first = [residuals(y, (x, v), (u, y)) for x, y in zip(us, vs, strict=True)]
            first += [residuals(y, (u, y)) for y in b1]
            return [*slots, *others], [row + turn(s) for s, row in enumerate(first)]
        second = {}
        third = {key: [-x[i, 3] / self.length for i in range(3)] for key, x in a2.items() if len(key) == 3}
        for key, x in b2.items():
            if len(key) == 3:
                third[tuple(n + s for s in key)] = [x[i, 3] / self.length for i in range(3)]
        a2, b2 = ({key: x for key, x in m.items() if len(key) == 2} for m in (a2, b2))
        for (s, t), x in a2.items():
            y = -(x * _POINT)
            second[s, t] = residuals(y, (back(x), v), (us[s], vs[t]), (us[t], vs[s]), (u, y))
        second |= {(s, t): residuals(_ZERO, (x, y)) for s, x in enumerate(us) for t, y in enumerate(b1, n)}
        second |= {(n + s, n + t): residuals(y, (u, y)) for (s, t), y in b2.items()}
        both = {(t, s): row for (s, t), row in second.items()} | second
        return [*slots, *others], third | {pair: row + turn(*pair) for pair, row in both.items()}

    def excludes(self, low: Sequence[float], high: Sequence[float]) -> bool:
        """Return whether no pose of a box has a configuration: equation 8."""
        values = self.point(
            [arb(0)] * len(self.unknown), [arb(a).union(arb(b)) for a, b in zip(low, high, strict=True)]
        )
        turning = {k for k in self.unknown if not self.variables[k]["prismatic"]}
        for k in {*self.unknown} - turning:
            ends = [
                inf if end is None or not self.data["bounds"]["limits"] else end for end in self.variables[k]["limits"]
            ]
            values[k] = Value(arb(ends[0]).union(arb(ends[1])), [], arb(0))
        return any(
            self._is_open(closure, values, turning)
            for closure in self.data["closures"]
            if len(closure["translations"]) == 3
        )

    def _is_open(self, closure: Mapping[str, Any], values: Sequence[Value], turning: set[int]) -> bool:
        """Return whether one of a closure's rods, between unknown rotations, is longer than all others together."""
        sides = list[list[arb_mat]]()
        for side in ("first", "second"):
            rods, along = list[arb_mat](), _ONE
            for index, k in [*closure[side], (closure[f"{side}_end"], None)]:
                along = along * self.placements[index]
                if k is None or k in turning:
                    rods.append(along * _POINT)
                    along = _ONE
                elif self.variables[k]["prismatic"]:
                    along = along * (_ONE + _ALONG * values[k].c)
                else:
                    along = along * _turn(values[k].c, 0)
            sides.append(rods)
        (a, *first), (b, *second) = sides
        vectors = [[m[i, 3] for i in range(3)] for m in (a - b, *first, *second)]
        shortest, longest = (
            [sum((size(x) ** 2 for x in rod), arb(0)).sqrt() for rod in vectors]
            for size in (arb.abs_lower, arb.abs_upper)
        )
        return any(a + b > sum(longest, arb(0)) for a, b in zip(shortest, longest, strict=True))

    def residual(self, values: Sequence[Value]) -> list[arb]:
        """Return the left sides of all equations, and what is positive among them."""
        out = [x for closure in self.data["closures"] for x in self.closure(closure, values, 0)[1]]
        for coupling in self.data["couplings"]:
            terms = [arb_poly([0, *c])(values[k].c) for k, c in coupling["terms"]]
            out.append((sum(terms, arb(0)) - coupling["constant"]) / coupling["size"])
        return out

    def jacobian(self, values: Sequence[Value]) -> list[list[arb]]:
        """Return the derivative by all columns at a point."""
        parts = [self.closure(closure, values, 1) for closure in self.data["closures"]]
        whole = [(slots, [[[x] for x in row] for row in rows]) for slots, rows in parts]
        terms = [coupling["terms"] for coupling in self.data["couplings"]]
        bends = [[(k, [arb_poly([0, *c]).derivative()(values[k].c)]) for k, c in term] for term in terms]
        return self._by_columns(whole, bends, 1)[0]

    def second(self, values: Sequence[Value], wide: bool) -> list[Any]:
        """Return second derivatives of the closures at a point, or over all values."""
        return [self.closure(closure, values, 2, wide)[1] for closure in self.data["closures"]]

    def change(self, values: Sequence[Value], here: list[Any], wide: list[Any]) -> list[list[list[arb]]]:
        """Return G_1 ... G_n, R_1 and R_2 (n + 2, rows, columns) of J + sum_j G_j eta_j + [-R_1 - R_2, R_1 + R_2]."""
        whole, n = list[Any](), len(values[0].g)
        more = self.products + 1 if self.virtual and n > len(self.over) else 0
        for closure, at, over in zip(self.data["closures"], here, wide, strict=True):
            slots, parts = self.closure(closure, values, 0)[0], list[Any]()
            varying = [t for t, slot in enumerate(slots) if slot.varies]
            by, spread = arb_mat([slots[t].value.g for t in varying]), [slots[t].value.spread() for t in varying]
            away = [slots[t].value.r for t in varying]
            for s in range(len(slots)) if wide is not here else varying:
                pairs = [(s, t) for t in varying]
                rows = list(zip(*(at[pair] for pair in pairs), strict=True))
                along = (arb_mat([list(row) for row in rows]) * by).tolist()
                for i, row in enumerate(rows):
                    half = [over[pair][i].rad() * _UP / 2 for pair in pairs]
                    along[i].append(sum((r * d for r, d in zip(half, spread, strict=True)), arb(0)))
                    along[i].append(sum(((abs(m) + r) * d for m, r, d in zip(row, half, away, strict=True)), arb(0)))
                    along[i] += self._sharper(at, over, s, i, slots, varying, along[i][n])
                parts.append(along)
            whole.append((slots if wide is not here else [slots[t] for t in varying], parts))
        bends = list[Any]()
        for coupling in self.data["couplings"]:
            bends.append([])
            for k, c in coupling["terms"]:
                v, bend = values[k], arb_poly([0, *c]).derivative().derivative()
                r = bend(arb(v.c, (v.spread() + v.r).upper())).rad()
                parts = [*(bend(v.c) * g for g in v.g), r * v.spread(), (abs(bend(v.c)) + r) * v.r]
                bends[-1].append((k, parts + ([arb(0)] * (more - 1) + [parts[n]]) * (more > 0)))
        return self._by_columns(whole, bends, n + 2 + more)

    def _sharper(
        self, at: Any, over: Any, s: int, i: int, slots: Sequence[Slot], varying: Sequence[int], least: arb
    ) -> list[arb]:
        """Return what third derivatives, where they are known, add to G for products of eps, and R_1 without that."""
        n, pairs = len(self.over), self.products if len(slots[0].value.g) > len(self.over) else 0
        near = [t for t in varying if tuple(sorted((s, t, t))) in at] if pairs and i < 3 else []  # not of rates
        if not near:
            return [arb(0)] * pairs + [least] * (pairs > 0)
        keys = [[tuple(sorted((s, t, u))) for u in near] for t in near]
        middle = arb_mat([[at[key][i] / 2 for key in row] for row in keys])
        radius = arb_mat([[over[key][i].rad() * _UP / 6 for key in row] for row in keys])
        value = [slots[t].value for t in near]
        linear = arb_mat([list(v.g[:n]) for v in value])
        size, rest = _reach(linear), _column([sum(map(abs, v.g[n:]), v.r) for v in value])
        by = linear.transpose() * middle * linear
        quads = [by[j, k] + (by[k, j] if j != k else 0) for j in range(n) for k in range(j, n)]
        far = (size * 2 + rest).transpose() * _abs(middle) * rest + (size + rest).transpose() * radius * (size + rest)
        return [*quads, far[0, 0]]

    def _by_columns(self, closures: Sequence[Any], couplings: Sequence[Any], n: int) -> list[list[list[arb]]]:
        """Return (n, rows, columns) from what belongs to slots (slots, rows, n) and to the variables of couplings."""
        out = [[[arb(0)] * len(self.columns) for _ in self.kinds] for _ in range(n)]
        at = {k: j for j, k in enumerate(self.columns)}
        for row, (slots, parts) in zip(self.starts, closures, strict=False):
            for slot, part in zip(slots, parts, strict=True):
                for j in (at[k] for k in slot.variables if k in at):
                    for i, numbers in enumerate(part, row):
                        for whole, x in zip(out, numbers, strict=True):
                            whole[i][j] += x * self.units[j]
        for i, (coupling, terms) in enumerate(zip(self.data["couplings"], couplings, strict=True), self.starts[-1]):
            for j, numbers in ((at[k], numbers) for k, numbers in terms if k in at):
                for whole, x in zip(out, numbers, strict=True):
                    whole[i][j] = x * self.units[j] / coupling["size"]
        return out


def _abs(m: arb_mat) -> arb_mat:
    return arb_mat(m.nrows(), m.ncols(), [abs(x) for x in m.entries()])


def _sizes(matrices: Sequence[arb_mat]) -> arb_mat:
    """Return the sums of absolute values of matrices."""
    entries = zip(*(m.entries() for m in matrices), strict=True)
    return arb_mat(matrices[0].nrows(), matrices[0].ncols(), [sum(map(abs, x), arb(0)) for x in entries])


def _reach(m: arb_mat) -> arb_mat:
    """Return the sums of absolute values of rows."""
    return _abs(m) * arb_mat(m.ncols(), 1, [1] * m.ncols())


def _pick(rows: Sequence[Sequence[arb]], at: Sequence[int], columns: Sequence[int]) -> arb_mat:
    return arb_mat(len(at), len(columns), [rows[i][j] for i in at for j in columns])


def _column(values: Sequence[Any]) -> arb_mat:
    return arb_mat(len(values), 1, list(values))


def _identity(n: int) -> arb_mat:
    return arb_mat(n, n, [int(i % (n + 1) == 0) for i in range(n * n)])


def _inverse(m: arb_mat) -> arb_mat:
    try:
        return m.mid().inv().mid()
    except ZeroDivisionError:
        raise CertificateError("a matrix is singular") from None


def _sum(matrices: Sequence[arb_mat]) -> arb_mat:
    return sum(matrices[1:], matrices[0])


def _norms(parts: Sequence[arb_mat], squarings: int = 3) -> tuple[arb, arb]:
    """Return the largest singular value of matrices one above the other, from below and above: |M|^2 is at most the
    largest sum of a row of |(M^T M)^(2^k)|, to the power 2^-k; one of its columns is near the direction."""
    power = gram = _sum([m.transpose() * m for m in parts])
    if not any(gram[i, i] != 0 for i in range(gram.nrows())):
        return arb(0), arb(0)
    for _ in range(squarings):
        power = power * power
    sums = [x.upper() for x in _reach(power).entries()]
    t = power.mid() * _column([int(x == max(sums)) for x in sums])
    size = (t.transpose() * t)[0, 0]
    low = ((t.transpose() * gram * t)[0, 0] / size).lower() if size > 0 else arb(0)
    return low.sqrt().lower() if low > 0 else arb(0), max(sums).root(2 ** (squarings + 1)).upper()


def _frobenius(parts: Sequence[arb_mat]) -> arb:
    return sum((x * x for m in parts for x in m.entries()), arb(0)).upper().sqrt()


class Form(NamedTuple):
    """A matrix over a box: C + sum_k G_k eta_k + [-R, R], eta the eps_j and their products."""

    c: arb_mat
    g: list[arb_mat]
    r: arb_mat

    def times(self, by: arb_mat) -> Form:
        """Return the product with a matrix."""
        return Form(self.c * by, [m * by for m in self.g], self.r * _abs(by))

    def add_products(self, left: Sequence[arb_mat], right: Sequence[arb_mat], n: int) -> None:
        """Add what products of the parts by eps_j are by eps_j eps_k."""
        pairs = [(j, k) for j in range(n) for k in range(j, n)]
        for q, (j, k) in enumerate(pairs, n):
            self.g[q] += left[j] * right[j] if j == k else left[j] * right[k] + left[k] * right[j]

    def sizes(self, n: int) -> tuple[arb_mat, arb_mat]:
        """Return the sums of sizes of the parts by eps, and by their products."""
        return _sizes(self.g[:n]), _sizes(self.g[n:])

    def cubic(self, sizes: tuple[arb_mat, arb_mat], right: tuple[arb_mat, arb_mat, arb_mat]) -> arb_mat:
        """Return a bound of what the product with X has beyond the products of eps, by sizes of parts of both."""
        centre, linear, squares = right
        return self.r * (centre + linear + squares) + sizes[0] * squares + sizes[1] * (linear + squares)


class Tube:
    """A box with exactly one configuration within y of X(eps): equations 3 to 5.

    Raises:
        CertificateError: that is not confirmed.
    """

    def __init__(self, robot: Robot, low: Sequence[float], high: Sequence[float], leaf: Mapping[str, Any]) -> None:
        n, k, width, rows = len(low), len(robot.unknown), robot.width, robot.data["rows"]
        self.robot, self.claim, self.reason, self.low, self.high = robot, leaf["claim"], leaf["reason"], low, high
        self.x = [(arb(x) / u).mid() for x, u in zip(leaf["x"], robot.units[:k], strict=True)]
        self.y = [(arb(y) / u).mid() for y, u in zip(leaf["y"], robot.units[:k], strict=True)]
        if len(rows) != k or not all(0 < y < 1 for y in self.y):
            raise CertificateError("the equations are not as many as the unknowns, or a radius is none")
        self.centre = [(arb(a) / 2 + arb(b) / 2).mid() for a, b in zip(low, high, strict=True)]
        self.radius = [max(arb(b) - c, c - a).upper() for a, b, c in zip(low, high, self.centre, strict=True)]
        point = robot.point(self.x, self.centre)
        residual, jacobian, here = robot.residual(point), robot.jacobian(point), robot.second(point, False)
        self.inverse = c = _inverse(arb_mat([jacobian[i][:k] for i in rows]))
        box = arb_mat(width, n)
        for j, r in enumerate(self.radius):
            box[k + j, j] = r
        all_columns, first = list(range(width)), _pick(jacobian, rows, range(width))
        straight = arb_mat((-(c * first * box).mid()).tolist() + box.tolist()[k:])
        change = robot.change(self._wide(straight, 0), here, here)
        bent = [c * _pick(m, rows, all_columns) * straight for m in change[:n]]
        pairs = [(a, b) for a in range(n) for b in range(a, n)]
        second = arb_mat([
            [(bent[a][i, b] + bent[b][i, a]) / (4 if a == b else 2) for a, b in pairs] for i in range(k)
        ])  # fmt: skip
        curved, rest = -second.mid(), arb_mat(width - k, len(pairs)).tolist()
        self.along = arb_mat([x + y for x, y in zip(straight.tolist(), curved.tolist() + rest, strict=True)])
        wide = self._wide(self.along, 1)
        change = robot.change(wide, here, robot.second(wide, True))
        self.parts, self.sharper = [jacobian, *change[: len(wide[0].g) + 2]], change[len(wide[0].g) + 2 :]
        self._check_rest(residual)
        # equation 3: |C F(X(eps), P(eps))| <= z
        constant, *by, unsure = self.less_identity(c, range(k))
        squares, curve = _sizes(by[n:]), _reach(curved)
        z = _reach(c * _column([residual[i] for i in rows])) + _reach(c * first * straight) + _abs(constant) * curve
        z += _reach(second - second.mid()) + _sum([_reach(m * curved) for m in by[:n]]) + squares * curve / 2
        z += _abs(c) * (_pick(self.parts[-2], rows, all_columns) * _reach(self.along)) / 3
        # equation 4: z + E y < y
        defect = _sizes([constant, *by[:n]]) + squares + unsure
        image = [x.upper() for x in (z + defect * _column(self.y)).entries()]
        if not all(a < y for a, y in zip(image, self.y, strict=True)):
            raise CertificateError("existence and uniqueness are not confirmed")
        self.defect = arb_mat(k, k, [a.upper() for a in defect.entries()])
        self.resolvent = _inverse(_identity(k) - self.defect)
        away = [(a + b).upper() for a, b in zip(_reach(self.along).entries(), image, strict=False)]
        self.ranges = [(x - a, x + a) for x, a in zip(self.x, away, strict=True)]

    def _wide(self, along: arb_mat, y: int) -> list[Value]:
        """Return the values of all variables along a matrix, within y times the radius."""
        k, rows = len(self.x), along.tolist()
        x = [Value(a, row, b * y) for a, row, b in zip(self.x, rows, self.y, strict=False)]
        return self.robot.values(x, [Value(a, row, arb(0)) for a, row in zip(self.centre, rows[k:], strict=False)])

    def _check_rest(self, residual: Sequence[arb]) -> None:
        """Check what is positive, and that the equations that are left out hold everywhere."""
        width = self.robot.width
        away = _column([*self.y, *[0] * (width - len(self.y))])
        reach = _reach(self.along) + away
        for i, value in enumerate(residual):
            part = arb_mat([m[i][:width] for m in self.parts])
            if self.robot.kinds[i] == "positive":
                if not value > _reach((_abs(part) * reach).transpose())[0, 0]:
                    raise CertificateError("ends of a closure may be opposed")
            elif (
                self.robot.kinds[i] == "equation"
                and i not in self.robot.data["rows"]
                and not (abs(value) < _GAP and part == part * 0)
            ):
                raise CertificateError("an equation is left out that variables change, or that does not hold")

    def less_identity(self, left: arb_mat, columns: Sequence[int]) -> list[arb_mat]:
        """Return the parts of C W - 1, W some columns of the derivative."""
        first, *by, bend, apart = (_pick(m, self.robot.data["rows"], columns) for m in self.parts)
        return [left * first - _identity(len(columns)), *(left * m for m in by), _abs(left) * _abs(bend + apart)]

    def smallest(self) -> list[tuple[arb, arb]]:
        """Return the smallest singular values of type 1 and 2 from below and above: 1 / |K|_2, equation 6."""
        robot, data, second = self.robot, self.robot.data, self.robot.data["second"]
        at = {k: j for j, k in enumerate(robot.columns)}
        twist, by = [at[k] for k in data["first"]], _identity(len(data["first"]))
        for i, k in enumerate(data["first"]):
            by[i, i] = robot.length if robot.variables[k]["prismatic"] else arb(1)
        sizes = [self._size(list(range(len(self.x))), [at[k] for k in data["single"]], twist, by)]
        if second is not None:
            opening = [at[k] for cluster in second["clusters"] for loop in cluster["openings"] for k in loop]
            opening += [at[k] for k in second["couplings"]]
            by, stretch = self._by_opening(second, len(opening))
            kept = self._kept(opening)
            if any(by[i, j] != 0 for j in kept for i in range(len(opening)) if i not in kept):
                raise CertificateError("loops do not open in their plane")
            single = [at[k] for k in data["single"] if k in data["passive"]]
            by = arb_mat([[by[i, j] for j in kept] for i in kept])
            low, high = self._size(self.locked, single, [opening[i] for i in kept], by)
            sizes.append((low / stretch, high * stretch))
        return [(1 / high, 1 / low if low > 0 else arb(inf)) for low, high in sizes]

    def _form(self, rows: Sequence[int], columns: Sequence[int]) -> Form:
        first, *by, bend, apart = (_pick(m, rows, columns) for m in self.parts)
        *more, bend = (_pick(m, rows, columns) for m in self.sharper)
        n = len(self.low)
        return Form(first, by[:n] + [a + b for a, b in zip(by[n:], more, strict=True)], _abs(bend + apart))

    def _size(self, columns: list[int], single: list[int], twist: list[int], by: arb_mat) -> tuple[arb, arb]:
        """Return bounds of |K|_2, K = N F_x^-1 F_w `by`."""
        rows, n, kinds = self.robot.data["rows"], len(self.low), self.robot.kinds
        rates = [i for i, kind in enumerate(kinds) if kind == "rate"]
        f, w, of = self._form(rows, columns), self._form(rows, twist).times(by), self._form(rates, columns)
        bare, nothing, pick = self._form(rates, twist).times(by), 0 * f.c, arb_mat(len(single), len(columns))
        for i, k in enumerate(single):
            pick[i, columns.index(k)] = 1
        f_size, of_size = f.sizes(n), of.sizes(n)
        try:
            inverse = f.c.inv()
        except ZeroDivisionError:
            return arb(0), arb(inf)
        slopes, sizes = [-(inverse * m) for m in f.g], list[tuple[arb, arb, arb]]()
        for right, free in ((w, bare), (Form(_identity(len(rows)), [nothing] * len(f.g), nothing), None)):
            c = inverse * right.c
            x = Form(c, [inverse * m + a * c for m, a in zip(right.g, slopes, strict=True)], 0 * right.r)
            x.add_products(slopes, x.g, n)
            size = (_abs(c), *x.sizes(n))
            whole = Form(of.c * c, [of.c * m + a * c for m, a in zip(x.g, of.g, strict=True)], of.cubic(of_size, size))
            whole.add_products(of.g, x.g, n)
            if free is not None:
                whole = Form(whole.c - free.c, [a - b for a, b in zip(whole.g, free.g, strict=True)], whole.r + free.r)
            changes = [(pick * a, b) for a, b in zip(x.g, whole.g, strict=True)]
            low, high = _norms([pick * x.c, whole.c], 6)
            rest = sum((_norms(m)[1] for m in changes[:n]), _norms([whole.r])[1])
            rest += sum(map(_frobenius, changes[n:]), arb(0))
            sizes.append((low - rest, high + rest, _norms([right.r + f.cubic(f_size, size)])[1]))
        (low, high, lack), (_, left, defect) = sizes
        if not defect < 1:
            return arb(0), arb(inf)
        rest = left / (1 - defect) * lack
        return low - rest, high + rest

    def _kept(self, opening: list[int]) -> list[int]:
        """Return which openings do not change the equations that are left out: those in the plane of a planar loop."""
        rows = self.robot.data["rows"]
        left = [i for i, kind in enumerate(self.robot.kinds) if kind == "equation" and i not in rows]
        changed = [[any(m[i][j] != 0 for m in self.parts) for j in opening] for i in left]
        kept = [a for a in range(len(opening)) if not any(row[a] for row in changed)]
        if len(opening) - len(kept) != sum(map(any, changed)):
            raise CertificateError("openings of loops change equations that are left out")
        return kept

    def _by_opening(self, second: Mapping[str, Any], count: int) -> tuple[arb_mat, arb]:
        """Return the openings of loops by dimensionless, mixed ones about the centres of the clusters' axes, and what
        factor bounds how these centres move."""
        values, by, stretch, start = self._wide(self.along, 1), _identity(count), arb(1), 0
        for cluster in second["clusters"]:
            length, about = arb(cluster["length"]), [arb(0)] * 3
            for chain, end, share, off in cluster["about"]:
                placed = self.robot.family(chain, end, values, 0, True)[1]
                about = [a + (placed[i, 3] + arb(0, off)) * share for i, a in enumerate(about)]
            away = sum((a.rad() ** 2 for a in about), arb(0)).sqrt() / length / 2
            stretch = max(stretch, (away + (1 + away**2).sqrt()).upper())
            x, y, z = (a.mid() for a in about)
            one = _identity(6)
            for k in range(3):
                one[k, k] = length
            one[0, 4], one[0, 5], one[1, 3], one[1, 5], one[2, 3], one[2, 4] = -z, y, z, -x, -y, x
            for a, row in enumerate(cluster["unmix"]):
                for b, factor in enumerate(row):
                    for i in range(6):
                        for j in range(6):
                            by[start + 6 * a + i, start + 6 * b + j] = one[i, j] * arb(
                                factor, self.robot.data["radius"]
                            )
            start += 6 * len(cluster["unmix"])
        return by, stretch

    def at(self, p: Sequence[arb]) -> list[arb]:
        """Return X at a pose."""
        eps = [(a - c) / r for a, c, r in zip(p, self.centre, self.radius, strict=True)]
        eps += [a * b for i, a in enumerate(eps) for b in eps[i:]]
        return [x + s for x, s in zip(self.x, (self.along * _column(eps)).entries(), strict=False)]

    def meets(self, x: Sequence[arb], p: Sequence[arb], other: Tube) -> bool:
        """Return whether the configuration of this box at a pose is that of the other: equation 7."""
        for _ in range(_STEPS):
            x = [a.mid() for a in x]
            residual = self.robot.residual(self.robot.point(x, p))
            step = (self.inverse * _column([residual[i] for i in self.robot.data["rows"]])).entries()
            size = _column([abs(a).upper() for a in step])
            away = _column([a.upper() for a in (self.resolvent * size * _UP).entries()])
            solved = (size + self.defect * away).entries()
            inside = all(abs(a - b) < y for a, b, y in zip(x, self.at(p), self.y, strict=True))
            inside = inside and all(a <= b for a, b in zip(solved, away.entries(), strict=True))
            ends = zip(x, other.at(p), away.entries(), other.y, strict=True)
            near = [abs(a - b) + v < w for a, b, v, w in ends]
            if inside and all(near):
                return True
            x = [a - s for a, s in zip(x, step, strict=True)]
        return False

    def status(self) -> tuple[str, int]:
        """Return proved, limit, sigma or regular, and the sign of the locked joints' determinant, 0 if unknown."""
        sign, inside, variables, n, bounds = 0, True, self.robot.variables, len(self.low), self.robot.data["bounds"]
        columns = self.robot.columns[: self.robot.width]
        self.locked = locked = [i for i, k in enumerate(columns) if k not in self.robot.data["actuated"]]
        if bounds["limits"]:
            for (low, high), k, unit in zip(self.ranges, self.robot.unknown, self.robot.units, strict=False):
                for end, sense in zip(variables[k]["limits"], (1, -1), strict=True):
                    if end is not None:
                        limit = arb(end, abs(end) * 2.0**-50) / unit
                        if sense * (limit - (high if sense > 0 else low)) > 0:
                            return "limit", 0
                        inside = inside and bool(sense * ((low if sense > 0 else high) - limit) > 0)
        if len(locked) == len(self.x):  # equation 5
            left = _inverse(_pick(self.parts[0], self.robot.data["rows"], locked))
            first, *by, rest = self.less_identity(left, locked)
            bent = [m.mid() for m in by[:n]]
            rest += _sizes([first, *by[n:], *(m - m.mid() for m in by[:n])])
            total = rest + _sizes(bent) * rest
            for a, m in enumerate(bent):
                total += _sizes([m * m, *(m * other + other * m for other in bent[:a])])
            weights = (_inverse(_identity(len(locked)) - total) * _column([1] * len(locked))).mid()
            if all(w > 0 and a < w for a, w in zip((total * weights).entries(), weights.entries(), strict=True)):
                sign = 1 if left.det() > 0 else -1 if left.det() < 0 else 0
        if bounds["sigma"] is not None and inside and sign:
            below, inside = [], self.claim != "regular"  # of which no more is claimed
            for name, (least, most) in zip(("sigma_1", "sigma_2"), self.smallest() if inside else [], strict=False):
                below += [name] if most < bounds["sigma"] else []
                inside = inside and bool(least > bounds["sigma"])
            if below and self.robot.data["exact"]:
                self.reason = below[0]
                return "sigma", sign
        return ("proved" if inside and sign else "regular"), sign


class Node(NamedTuple):
    """A box that is halved along an axis."""

    axis: int
    parts: tuple[Any, Any]


def _faces(node: Any) -> Iterator[tuple[Tube, Tube, int]]:
    """Yield the pairs of boxes below a node that share a face, and the axis across it."""
    if isinstance(node, Node):
        yield from _between(*node.parts, node.axis)
        for part in node.parts:
            yield from _faces(part)


def _between(a: Any, b: Any, axis: int) -> Iterator[tuple[Tube, Tube, int]]:
    if isinstance(a, Node):
        for part in a.parts[1:] if a.axis == axis else a.parts:
            yield from _between(part, b, axis)
    elif isinstance(b, Node):
        for part in b.parts[:1] if b.axis == axis else b.parts:
            yield from _between(a, part, axis)
    elif a is not None and b is not None:
        ends = zip(a.low, b.low, a.high, b.high, strict=True)
        if all(max(x, y) < min(u, v) for i, (x, y, u, v) in enumerate(ends) if i != axis):
            yield a, b, axis


def _branch(robot: Robot, root: Any, leaves: Sequence[Tube | None]) -> set[int]:
    """Return the numbers of the boxes on the branch of the start: equation 7."""
    number = {id(tube): i for i, tube in enumerate(leaves)}
    meeting, apart = ({i: list[int]() for i in range(len(leaves))} for _ in range(2))
    for a, b, axis in _faces(root):  # all of them: a branch may not close on itself
        ends = zip(a.low, b.low, a.high, b.high, strict=True)
        p = [((arb(max(x, y)) + arb(min(u, v))) / 2).mid() for x, y, u, v in ends]
        p[axis] = arb(a.high[axis])
        neighbours = meeting if a.meets(a.at(p), p, b) else apart
        neighbours[number[id(a)]].append(number[id(b)])
        neighbours[number[id(b)]].append(number[id(a)])
    start, lost = robot.data["start"], set[int]()
    pose, x = list(map(float, start["pose"])), [arb(v) / u for v, u in zip(start["x"], robot.units, strict=False)]
    for first, tube in enumerate(leaves):
        if tube is None or not all(a <= v <= b for a, v, b in zip(tube.low, pose, tube.high, strict=True)):
            continue
        while first not in lost and tube.meets(x, [arb(v) for v in pose], tube):
            branch, border = {first}, [first]
            while border:
                new = set(meeting[border.pop()]) - branch - lost
                branch |= new
                border += new
            wrong = {b for a in branch for b in apart[a] if b in branch}
            if not wrong:
                return branch
            lost |= wrong - {first} or wrong
    return set()


def check(
    certificate: Mapping[str, Any], report: Callable[[int, int], None] = lambda done, of: None,
    dropped: set[int] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return the result of a certificate: shares of the region's volume, witnesses, and the number of boxes.

    With `dropped`, numbers of boxes whose claims are not confirmed are added to it, and these boxes are undecided.

    Raises:
        CertificateError: a claim is not confirmed.
    """
    with ctx.workprec(64):
        try:
            return _result(certificate, report, dropped)
        except CertificateError:
            raise
        except Exception as error:  # numbers and structures of any kind
            raise CertificateError(f"it is damaged ({type(error).__name__}: {error})") from None


def _result(
    certificate: Mapping[str, Any], report: Callable[[int, int], None], dropped: set[int] | None
) -> dict[str, Any]:
    robot, tree, leaves, shares = Robot(certificate), iter(certificate["tree"]), list[Tube | None](), list[float]()
    unreachable = dict[int, list[float]]()

    def refuse(box: int, error: CertificateError) -> None:
        if dropped is None:
            error.box = box
            raise error
        dropped.add(box)

    def read(low: list[float], high: list[float], share: float) -> Any:
        node = next(tree)
        if isinstance(node, dict):
            is_in = node["claim"] != "outside"
            if not is_in and not square(low, high) > 1:
                raise CertificateError("a box that is called outside is not")
            leaves.append(None)
            shares.append(share * is_in)
            report(len(leaves), len(certificate["tree"]))
            try:
                if node["claim"] == "unreachable":
                    if not robot.excludes(low, high):
                        raise CertificateError("a pose is not out of reach")
                    unreachable[len(leaves) - 1] = [(a + b) / 2 for a, b in zip(low, high, strict=True)]
                elif is_in and node["claim"] != "open":
                    leaves[-1] = Tube(robot, low, high, node)
            except CertificateError as error:
                refuse(len(leaves) - 1, error)
            return leaves[-1]
        middle = (low[node] + high[node]) / 2
        if not low[node] < middle < high[node]:
            raise CertificateError("a box is empty")
        ends = [*high[:node], middle, *high[node + 1 :]], [*low[:node], middle, *low[node + 1 :]]
        return Node(node, (read(low, ends[0], share / 2), read(ends[1], high, share / 2)))

    def square(low: Sequence[float], high: Sequence[float]) -> arb:
        """Return the square of a box's distance from the centre, in the axes of the round part of the region."""
        total, count = arb(0), {"box": 0, "cylinder": 2, "ball": 6}[certificate["shape"]]
        for a, b, (start, end) in list(zip(low, high, certificate["over"].values(), strict=True))[:count]:
            c, r = (arb(start) + end) / 2, (arb(end) - start) / 2
            total += (max(a - c, c - b, arb(0)) / r) ** 2
        return total

    low, high = ([float(x[i]) for x in certificate["over"].values()] for i in range(2))
    if not all(-inf < a < b < inf for a, b in zip(low, high, strict=True)):
        raise CertificateError("the region is empty")
    root = read(low, high, 1.0)
    if next(tree, None) is not None:
        raise CertificateError("boxes are left over")
    statuses, found = list[str](), dict[str, float]()
    witnesses, signs, branch = list[dict[str, Any]](), dict[int, Tube](), _branch(robot, root, leaves)
    for i, (leaf, share) in enumerate(zip(leaves, shares, strict=True)):
        status = "undecided" if share else "outside"
        if leaf is not None and i in branch:
            status, sign = leaf.status()
            signs.setdefault(sign, leaf)
            if status in ("limit", "sigma"):
                witnesses.append(_witness(leaf, **{status: leaf.reason}))
            if leaf.claim in ("proved", "limit", "sigma") and status != leaf.claim:
                refuse(i, CertificateError(f"a box is {status}, not {leaf.claim}"))
        elif i in unreachable:
            status, pose = "refuted", zip((robot.variables[k]["name"] for k in robot.over), unreachable[i], strict=True)
            witnesses.append({"pose": dict(pose), "configuration": {}})
        status = {"regular": "undecided", "limit": "refuted", "sigma": "refuted"}.get(status, status)
        statuses.append(status)
        found[status] = found.get(status, 0.0) + share
    if 1 in signs and -1 in signs:
        witnesses += [_witness(signs[s], determinant=s) for s in (1, -1)]
    found = {key: found.get(key, 0.0) / sum(shares) for key in ("proved", "refuted", "undecided")}
    return {**found, "statuses": statuses, "witnesses": witnesses, "boxes": sum(share > 0 for share in shares)}


def _witness(leaf: Tube, **why: Any) -> dict[str, Any]:
    robot, n = leaf.robot, len(leaf.centre)
    names = [robot.variables[k]["name"] for k in (*robot.over, *robot.unknown)]
    values = [*map(float, leaf.centre), *(float(x * u) for x, u in zip(leaf.x, robot.units, strict=False))]
    found = list(zip(names, values, strict=True))
    return {"pose": dict(found[:n]), "configuration": dict(found[n:]), **why}
