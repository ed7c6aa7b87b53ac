"""The equations of a certificate, and their derivatives over boxes: equations 1 and 2 of docs/proof.md."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement
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


def rotation(x: arb, n: int) -> arb_mat:
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
            powers = [ONE + ALONG * q, ALONG, _ZERO, _ZERO] if slides else [rotation(q, n) for n in range(order + 1)]
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
        if order == 0:
            return [*slots, *others], residuals(v, (u, v)) + [arb(0)] * (3 * (rates == "turn"))
        us, vs = [back(x) for x in a1], [-(x * POINT) for x in a1]
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
            y = -(x * POINT)
            second[s, t] = residuals(y, (back(x), v), (us[s], vs[t]), (us[t], vs[s]), (u, y))
        second |= {(s, t): residuals(_ZERO, (x, y)) for s, x in enumerate(us) for t, y in enumerate(b1, n)}
        second |= {(n + s, n + t): residuals(y, (u, y)) for (s, t), y in b2.items()}
        both = {(t, s): row for (s, t), row in second.items()} | second
        return [*slots, *others], third | {pair: row + turn(*pair) for pair, row in both.items()}

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
        size, rest = row_sums(linear), column([sum(map(abs, v.g[n:]), v.r) for v in value])
        by = linear.transpose() * middle * linear
        quads = [by[j, k] + (by[k, j] if j != k else 0) for j in range(n) for k in range(j, n)]
        far = (size * 2 + rest).transpose() * absolute(middle) * rest + (size + rest).transpose() * radius * (
            size + rest
        )
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
