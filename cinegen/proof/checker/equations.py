"""The equations of a certificate, and their derivatives over boxes: equations 1 and 2 of docs/proof.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement, product
from typing import Any, NamedTuple

from flint import arb, arb_mat, arb_poly

from cinegen.proof.checker.balls import CertificateError, absolute, column, row_sums

_UP = arb(1 + 2.0**-20)  # more than rounding does to radii
_PAIRS = {0: [], 2: [(0, 2), (1, 2)], 3: [(0, 1), (1, 2), (2, 0)]}  # by the number of rotations: u_i . v_j
_RATES = {None: 0, "slide": 1, "turn": 3, "placement": 12}  # numbers of rows
ONE, _ZERO = arb_mat(4, 4, [int(i % 5 == 0) for i in range(16)]), arb_mat(4, 4)
POINT, ALONG = (arb_mat(4, 4, [int(i == k) for i in range(16)]) for k in (15, 11))  # origin; z
_AXES = ONE - POINT


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


class Parts(NamedTuple):
    """Rows of a closure: slots, values, derivatives (slots, rows), second ones (slots, slots that vary) of each row,
    third ones by their slots."""

    slots: list[Slot]
    values: list[arb]
    first: list[list[arb]]
    second: list[arb_mat]
    third: dict[Any, list[arb]]


def rotations(x: arb, order: int) -> list[arb_mat]:
    """Return the rotation by x about z, and its derivatives up to an order: equation 2."""
    (s, c), r, powers = x.mid().sin_cos(), x.rad(), list[arb_mat]()
    wide = [abs(b) * r + abs(a) * r * r / 2 + r**3 / 6 for a, b in ((s, c), (c, s))]
    s, c = s + arb(0, wide[0].upper()), c + arb(0, wide[1].upper())
    for n in range(order + 1):
        rest = int(n == 0)
        powers.append(arb_mat(4, 4, [c, -s, 0, 0, s, c, 0, 0, 0, 0, rest, 0, 0, 0, 0, rest]))
        s, c = c, -s
    return powers


class Robot:
    """The equations of a certificate."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data, self.length, self.variables = data, arb(data["length"]), data["variables"]
        self.unknown, self.over = data["unknown"], [int(k) for k in data["over"]]
        self.columns = [*self.unknown, *self.over, *(k for k in data["given"] if k not in self.over)]
        self.width, self.virtual = len(self.columns), set(data.get("virtual", []))
        self.columns += data.get("virtual", [])
        self.products = len(self.over) * (len(self.over) + 1) // 2
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
        slots, turned, is_turn = list[Slot](), ONE, False
        for index, k in chain:
            value, slides, moved = values[k], self.variables[k]["prismatic"], turned * self.placements[index]
            names, before, turned = [k], moved, ONE
            if is_turn and not slides and self.data["placements"][index][8] == 1 and not any(self.radii[index][2:9:3]):
                last, offset = slots[-1], moved * POINT - POINT
                powers = [power * offset for power in last.powers]
                slots[-1] = last._replace(powers=[ONE + powers[0], *powers[1:]], turns=False)
                names, value, before = [*last.variables, k], last.value.plus(value), ONE
                turned = moved * _AXES + POINT
            q = arb(value.c.mid(), (value.c.rad() + value.spread() + value.r).upper()) if wide else value.c
            powers = [ONE + ALONG * q, ALONG, _ZERO, _ZERO] if slides else rotations(q, order)
            slots.append(Slot(names, value, before, powers, not slides, not self.virtual.issuperset(names)))
            is_turn = not slides
        factors = [[slot.before * slot.powers[n] for slot in slots] for n in range(order + 1)]
        after, before, first, axes = [turned * self.placements[end]], ONE, list[arb_mat](), list[arb_mat]()
        second = dict[Any, arb_mat]()
        for factor in reversed(factors[0]):
            after.insert(0, factor * after[0])
        for s in range(len(slots) if order else 0):
            along = before * factors[1][s]
            first.append(along * after[s + 1])
            axes.append(before * slots[s].before * ALONG if slots[s].turns else _ZERO)
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

    def closure(self, closure: Mapping[str, Any], values: Sequence[Value], order: int, wide: bool) -> Parts:
        """Return the residuals, what is positive, with rotations, and rates, with derivatives up to an order: of column
        s, or of column s by t.

        They are of V = B - A and of E = A^T V, with the placements A and B of both ends; or the relative angular
        velocity, a sum of axes a_s, whose derivatives by t before s are a_t x a_s."""
        ends = ((closure[end], closure[f"{end}_end"]) for end in ("first", "second"))
        if order == 2 and not closure["rotations"] and len(closure["translations"]) == 3:
            order = 3  # of V alone
        (slots, a, a1, a2, on_a), (others, b, b1, b2, on_b) = (self.family(*end, values, order, wide) for end in ends)
        turns, linear, n, rates = closure["rotations"], closure["translations"], len(slots), closure.get("rates")
        slots = slots + others

        def back(m: arb_mat) -> arb_mat:
            return (m * _AXES).transpose()

        def residuals(v: arb_mat, *products: tuple[arb_mat, arb_mat]) -> list[arb]:
            if not turns and len(linear) % 3 == 0 and rates != "placement":
                return [v[i, 3] / self.length for i in linear]
            e = sum((x * y for x, y in products), _ZERO)
            out = [(v if len(linear) == 3 else e)[i, 3] / self.length for i in linear]
            out += [e[i, j] - e[j, i] if turns == 3 else e[i, j] for i, j in _PAIRS[turns]]
            out += [sum((e[i, i] for i in range(2 * (turns == 2), 3)), arb(0))] if turns else []
            if rates == "placement":
                return [e[i, j] / (self.length if j == 3 else 1) for i in range(3) for j in range(4)]
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

        u, v = back(a), b - a * POINT
        value = residuals(v, (u, v)) + [arb(0)] * (3 * (rates == "turn"))
        if order == 0:
            return Parts(slots, value, [], [], {})
        us, vs = [back(x) for x in a1], [-(x * POINT) for x in a1]
        first = [residuals(y, (x, v), (u, y)) for x, y in zip(us, vs, strict=True)] if not wide else []
        first = [row + turn(s) for s, row in enumerate(first + [residuals(y, (u, y)) for y in b1 if not wide])]
        second, third = dict[Any, list[arb]](), dict[Any, list[arb]]()
        for start, side, sign in ((0, a2, -1), (n, b2, 1)):
            for key, x in side.items():
                if len(key) == 3:
                    third[tuple(start + s for s in key)] = [sign * x[i, 3] / self.length for i in range(3)]
                elif sign > 0:
                    second[start + key[0], start + key[1]] = residuals(x, (u, x))
                else:
                    (s, t), y = key, -(x * POINT)
                    second[key] = residuals(y, (back(x), v), (us[s], vs[t]), (us[t], vs[s]), (u, y))
        if order > 1:
            second |= {(s, t): residuals(_ZERO, (x, y)) for s, x in enumerate(us) for t, y in enumerate(b1, n)}
        both = {pair: row + turn(*pair) for (s, t), row in second.items() for pair in {(s, t), (t, s)}}
        varying = [t for t, slot in enumerate(slots) if slot.varies]
        none, pairs = [arb(0)] * len(value), list(product(range(len(slots)), varying))
        parts = [both.get(pair, none) for pair in pairs]
        bends = [arb_mat(len(slots), len(varying), [part[i] for part in parts]) for i in range(len(value))]
        return Parts(slots, value, first, bends, third)

    def parts(self, values: Sequence[Value], order: int, wide: bool = False) -> list[Parts]:
        """Return the rows of all closures, with derivatives up to an order, at a point or over all values."""
        return [self.closure(closure, values, order, wide) for closure in self.data["closures"]]

    def residual(self, values: Sequence[Value], parts: Sequence[Parts]) -> list[arb]:
        """Return the left sides of all equations, and what is positive among them."""
        out = [x for part in parts for x in part.values]
        for coupling in self.data["couplings"]:
            terms = [arb_poly([0, *c])(values[k].c) for k, c in coupling["terms"]]
            out.append((sum(terms, arb(0)) - coupling["constant"]) / coupling["size"])
        return out

    def jacobian(self, values: Sequence[Value], parts: Sequence[Parts]) -> list[list[arb]]:
        """Return the derivative by all columns at a point."""
        closures = [[[column([row[i] for row in part.first])] for i in range(len(part.values))] for part in parts]
        terms = [coupling["terms"] for coupling in self.data["couplings"]]
        bends = [[(k, [arb_poly([0, *c]).derivative()(values[k].c)]) for k, c in term] for term in terms]
        return self._by_columns(parts, closures, bends, 1)[0]

    def change(self, values: Sequence[Value], at: Sequence[Parts], wide: Sequence[Parts]) -> list[list[list[arb]]]:
        """Return G, T, R_1 and R_2 (., rows, columns) of J + sum_k (G_k + T_k) eta_k + [-R_1 - R_2, R_1 + R_2]; T
        belongs to products of eps among eta."""
        closures, n = list[list[list[arb_mat]]](), len(values[0].g)
        products = self.products if n > len(self.over) else 0
        for centre, over in zip(at, wide, strict=True):
            along = [_sum([values[k] for k in slot.variables]) for slot in centre.slots if slot.varies]
            by, spread, away = (
                arb_mat(len(along), n, [g for v in along for g in v.g]),
                column([v.spread() for v in along]),
                column([v.r for v in along]),
            )
            closures.append([])
            for i, (m, unsure) in enumerate(zip(centre.second, over.second, strict=True)):
                half = arb_mat(m.nrows(), m.ncols(), [x.rad() * _UP / 2 for x in unsure.entries()])
                sharper = self._sharper(centre, over, i, along, half * spread) if products else [half * spread]
                closures[-1].append([m * by, *sharper, (absolute(m) + half) * away])
        bends = list[Any]()
        for coupling in self.data["couplings"]:
            bends.append([])
            for k, c in coupling["terms"]:
                v, bend = values[k], arb_poly([0, *c]).derivative().derivative()
                r = bend(arb(v.c, (v.spread() + v.r).upper())).rad()
                parts = [*(bend(v.c) * g for g in v.g), *[arb(0)] * products]
                bends[-1].append((k, [*parts, r * v.spread(), (abs(bend(v.c)) + r) * v.r]))
        return self._by_columns(at, closures, bends, n + products + 2)

    def _sharper(self, at: Parts, over: Parts, i: int, along: Sequence[Value], bent: arb_mat) -> list[arb_mat]:
        """Return T and R_1 of a row: third derivatives, where they are known, and what is not."""
        n, by, least = len(self.over), [[arb(0)] * self.products for _ in at.slots], bent.entries()
        varying = [t for t, slot in enumerate(at.slots) if slot.varies]
        for s in varying if i < 3 and at.third else []:  # not of rates
            near = [k for k, t in enumerate(varying) if tuple(sorted((s, t, t))) in at.third]
            keys = [[tuple(sorted((s, varying[k], varying[u]))) for u in near] for k in near]
            middle = arb_mat([[at.third[key][i] / 2 for key in row] for row in keys])
            radius = arb_mat([[over.third[key][i].rad() * _UP / 6 for key in row] for row in keys])
            linear = arb_mat([list(along[t].g[:n]) for t in near])
            size, rest = row_sums(linear), column([sum(map(abs, along[t].g[n:]), along[t].r) for t in near])
            quads = linear.transpose() * middle * linear
            by[s] = [quads[j, k] + (quads[k, j] if j != k else 0) for j in range(n) for k in range(j, n)]
            far = (size * 2 + rest).transpose() * absolute(middle) * rest
            least[s] = (far + (size + rest).transpose() * radius * (size + rest))[0, 0]
        return [arb_mat(len(by), self.products, [x for row in by for x in row]), column(least)]

    def _by_columns(
        self, parts: Sequence[Parts], closures: Sequence[Any], couplings: Sequence[Any], n: int
    ) -> list[list[list[arb]]]:
        """Return (n, rows, columns) from the matrices (slots, .), beside each other, of each row of closures, and from
        what belongs to the variables of couplings."""
        out, at = [list[list[arb]]() for _ in range(n)], {k: j for j, k in enumerate(self.columns)}
        for part, rows in zip(parts, closures, strict=True):
            moving = sorted({at[k] for slot in part.slots for k in slot.variables if k in at})
            units = [self.units[j] if self.columns[j] in s.variables else 0 for j in moving for s in part.slots]
            by = arb_mat(len(moving), len(part.slots), units)
            for row in rows:
                for whole, numbers in zip(out, (x for m in row for x in (by * m).transpose().tolist()), strict=True):
                    whole.append([arb(0)] * len(self.columns))
                    for j, x in zip(moving, numbers, strict=True):
                        whole[-1][j] = x
        for coupling, terms in zip(self.data["couplings"], couplings, strict=True):
            for whole in out:
                whole.append([arb(0)] * len(self.columns))
            for j, numbers in ((at[k], numbers) for k, numbers in terms if k in at):
                for whole, x in zip(out, numbers, strict=True):
                    whole[-1][j] = x * self.units[j] / coupling["size"]
        return out


def _sum(values: Sequence[Value]) -> Value:
    total, *rest = values
    for value in rest:
        total = total.plus(value)
    return total
