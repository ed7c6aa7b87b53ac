"""The equations of a proof and their derivatives, in affine arithmetic.

With axes u_i, v_j of a closure's two ends and their origins p_1, p_2, an equation is one of

    (p_2 - p_1) / L,    u_i . (p_2 - p_1) / L,    u_i . v_j,    u_i . v_j - u_j . v_i

(L: characteristic length) and its derivative by a joint of the second end with axis a through o is that of a rigid
rotation, a x (p_2 - o), a . (v_j x u_i), and reversed on the first end (`cinegen.assembly.certify`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.proof.affine import Form, cross, stacked

_PRODUCTS = {0: [], 2: [[(0, 2)], [(1, 2)]], 3: [[(0, 1), (1, 0)], [(1, 2), (2, 1)], [(2, 0), (0, 2)]]}
"""By the number of constrained rotations: axes whose products vanish, the second product of two subtracted."""

_AGREE = {0: [], 2: [2], 3: [0, 1, 2]}
"""... and whose sum of products is positive."""

_WIDE = 0.3  # rad and characteristic lengths: of the values over which equations are looked at


class Matrices(NamedTuple):
    """Derivatives and signs over boxes.

    Attributes:
        jacobian: (boxes, rows, unknowns + given coordinates), dimensionless but for the latter.
        positive: (boxes, .) positive numbers.
    """

    jacobian: Form
    positive: Form


class _Side(NamedTuple):
    axes: Form
    origins: Form


class Equations:
    """Evaluates the equations of a document (`cinegen.proof.document`).

    Attributes:
        unknown: indices of the variables that are unknown.
        over: indices of the variables that vary, the first of those that are given.
        locked: indices of the columns of a Jacobian whose motions the actuated joints must control: all but theirs.
        names: of these.
        units: (unknowns,) size of a dimensionless step.
        lower: (unknowns,) dimensionless limits, infinite where there are none.
        upper: (unknowns,) likewise.
        rows: indices of the equations that are not exactly 0; all at first.
    """

    def __init__(self, document: Mapping[str, Any]) -> None:
        self._document = document
        self.length, self.radius = float(document["length"]), float(document["radius"])
        numbers = np.array(document["placements"])
        self.rotations, self.origins = numbers[:, :9].reshape(-1, 3, 3), numbers[:, 9:, None]
        variables = document["variables"]
        self._at = np.array([one["at"] for one in variables])
        self.is_prismatic = np.array([one["prismatic"] for one in variables])
        self.unknown, self.over = list(document["unknown"]), [int(k) for k in document["over"]]
        given = [*self.over, *(k for k in document["given"] if k not in self.over)]
        self._column = {k: i for i, k in enumerate([*self.unknown, *given])}
        self.locked = [i for k, i in self._column.items() if k not in document["actuated"]]
        self.units = np.array([one["unit"] for one in variables])[self.unknown]
        self.names = [variables[k]["name"] for k in self.unknown]
        limits = [variables[k]["limits"] for k in self.unknown]
        low, high = ([x[i] for x in limits] for i in range(2))
        self.lower = np.array([-np.inf if x is None else x for x in low]) / self.units
        self.upper = np.array([np.inf if x is None else x for x in high]) / self.units
        closures = document["closures"]
        heights = [len(one["translations"]) + one["rotations"] for one in closures]
        self._starts = np.cumsum([0, *heights])
        self._height = int(self._starts[-1]) + len(document["couplings"])
        self.rows: Indices = np.arange(self._height)

    @property
    def start(self) -> Array:
        """(unknowns,) dimensionless values in the configuration that the document was written in."""
        return np.asarray(self._at[self.unknown] / self.units)

    @property
    def pose(self) -> Array:
        """(6,) coordinates of the pose, m and rad, where they do not vary."""
        return self._at[-6:]

    @pose.setter
    def pose(self, values: Array) -> None:
        self._at[-6:] = values

    def select(self, x: Array, p: Array) -> None:
        """Leave out the equations that no variable changes near a configuration: those across a planar linkage."""
        wide = [Form(one[None, None], np.full((1, len(one)), _WIDE)) for one in (x, p)]
        self.rows = np.flatnonzero(self.matrices(self.values(*wide)).jacobian.most[0].any(axis=-1))

    def values(self, x: Form, p: Form) -> list[Form]:
        """Return the values of all variables.

        Args:
            x: (boxes, unknowns) dimensionless.
            p: (boxes, parameters) m and rad.
        """
        n = len(x.a)
        constants = np.zeros((n, 1, len(self._at)))
        constants[0, 0] = self._at
        found = [Form(constants[:, :, k], np.zeros(1)) for k in range(len(self._at))]
        scaled = x.scaled(self.units)
        for i, k in enumerate(self.unknown):
            found[k] = scaled[..., i]
        for i, k in enumerate(self.over):
            found[k] = p[..., i]
        return found

    def residual(self, variables: Sequence[Form]) -> Form:
        """Return the equations (boxes, rows)."""
        placed, found = _Placed(self, variables), list[Form]()
        for closure in self._document["closures"]:
            (u, p), (v, q) = placed.ends(closure)
            gap = (q - p).scaled(np.array(1.0 / self.length))
            linear = closure["translations"]
            found += [gap[..., k] if len(linear) == 3 else (u[..., k] * gap).sum(-1) for k in linear]
            for terms in _PRODUCTS[closure["rotations"]]:
                products = [(u[..., a] * v[..., b]).sum(-1) for a, b in terms]
                found.append(products[0] if len(products) == 1 else products[0] - products[1])
        for coupling in self._document["couplings"]:
            found.append(self._coupling(coupling, variables)[0])
        return stacked(found)[..., self.rows]

    def _coupling(self, coupling: Mapping[str, Any], variables: Sequence[Form]) -> tuple[Form, dict[int, Form]]:
        """Return the residual of a coupling, and its slopes by variables."""
        zero = variables[0].scaled(np.array(0.0))
        one = Form(zero.a + (np.arange(len(zero.a)) == 0)[:, None], zero.r)
        residual, slopes = one.scaled(np.array(-coupling["constant"])), dict[int, Form]()
        for k, coefficients in coupling["terms"]:
            value, slope = zero, zero
            for c in reversed(coefficients):  # Horner's scheme
                slope = slope * variables[k] + value + one.scaled(np.array(c))
                value = (value + one.scaled(np.array(c))) * variables[k]
            residual, slopes[k] = residual + value, slope.scaled(np.array(1.0 / coupling["size"]))
        return residual.scaled(np.array(1.0 / coupling["size"])), slopes

    def matrices(self, variables: Sequence[Form]) -> Matrices:
        """Return the derivatives, and what is positive."""
        placed, count, n = _Placed(self, variables), len(self._column), len(variables[0].a)
        boxes = max(len(one.r) for one in variables)
        jacobian = Form(np.zeros((n, boxes, self._height, count)), np.zeros((boxes, self._height, count)))
        positive, units = list[Form](), np.concatenate([self.units, np.ones(count - len(self.units))])

        def write(form: Form, rows: slice, column: int) -> None:
            jacobian.a[:, :, rows, column], jacobian.r[:, rows, column] = form.a, form.r

        closures = self._document["closures"]
        for start, closure in zip(self._starts, closures, strict=False):
            (u, p), (v, q) = placed.ends(closure)
            linear, products = closure["translations"], _PRODUCTS[closure["rotations"]]
            turns = list[Form]()
            for terms in products:
                both = [cross(v[..., b], u[..., a]) for a, b in terms]
                turns.append(both[0] if len(both) == 1 else both[0] - both[1])
            if agree := _AGREE[closure["rotations"]]:
                positive.append((u[..., agree] * v[..., agree]).sum(-1).sum(-1))
            for sign, side, tip in ((-1.0, "first", p if len(linear) == 3 else q), (1.0, "second", q)):
                chain = [(i, k) for i, (_, k) in enumerate(closure[side]) if k in self._column]
                if not chain:
                    continue
                axes, origins = placed.axes(closure[side], [i for i, _ in chain])
                velocities = cross(axes, tip[..., None, :] - origins)
                angular = [(axes * turn[..., None, :]).sum(-1) for turn in turns]
                for i, (_, k) in enumerate(chain):
                    column, is_prismatic = self._column[k], self.is_prismatic[k]
                    unit, velocity = sign * units[column], (axes if is_prismatic else velocities)[..., i, :]
                    if len(linear) == 2:
                        velocity = stacked([(u[..., m] * velocity).sum(-1) for m in linear])
                    if linear:
                        write(velocity.scaled(unit / self.length), slice(start, start + len(linear)), column)
                    for row, turn in enumerate([] if is_prismatic else angular, start + len(linear)):
                        write(turn[..., i : i + 1].scaled(unit), slice(row, row + 1), column)
        for row, coupling in enumerate(self._document["couplings"], int(self._starts[-1])):
            for k, slope in self._coupling(coupling, variables)[1].items():
                if k in self._column:
                    unit = units[self._column[k]]
                    write(slope[..., None].scaled(unit), slice(row, row + 1), self._column[k])
        selected = jacobian[..., self.rows, :]
        return Matrices(selected, stacked(positive) if positive else selected[..., 0, :0])


class _Body(NamedTuple):
    """A body behind a variable: its axes, and those before parallel rotations, whose angles are added up."""

    axes: Form
    origin: Form
    before: Form
    angle: Form | None


class _Placed:
    """Placements along chains, each computed once."""

    def __init__(self, of: Equations, variables: Sequence[Form]) -> None:
        self._of, self._variables, self._n = of, variables, len(variables[0].a)
        axes, origin = np.zeros((self._n, 1, 3, 3)), np.zeros((self._n, 1, 3))
        axes[0, 0] = np.eye(3)
        fixed = Form(axes, np.zeros((1, 3, 3)))
        root = _Body(fixed, Form(origin, np.zeros((1, 3))), fixed, None)
        self._known: dict[tuple[tuple[int, int], ...], _Body] = {(): root}
        self._stations = dict[tuple[tuple[int, int], ...], _Side]()

    def _after(self, chain: tuple[tuple[int, int], ...]) -> _Body:
        """Return the body behind the last variable of a chain."""
        if chain not in self._known:
            (placement, k), last = chain[-1], self._after(chain[:-1])
            constant, value = self._of.rotations[placement], self._variables[k]
            origin = self._shifted(last, placement)
            if self._of.is_prismatic[k]:
                axes = last.axes.placed(constant, self._of.radius)
                self._stations[chain] = _Side(axes[..., 2], origin)
                self._known[chain] = _Body(axes, origin + axes[..., 2] * value[..., None], axes, None)
            else:
                angle, before = value, last.axes
                if last.angle is not None and constant[2, 2] == 1.0:
                    angle, before = last.angle + value, last.before
                before = before.placed(constant, self._of.radius)
                s, c = angle.sin_cos()
                plane = before[..., :2]
                ahead, aside = plane * c[..., None, None], plane * s[..., None, None]
                x, y = ahead[..., 0] + aside[..., 1], ahead[..., 1] - aside[..., 0]
                self._stations[chain] = _Side(before[..., 2], origin)
                self._known[chain] = _Body(stacked([x, y, before[..., 2]]), origin, before, angle)
        return self._known[chain]

    def _shifted(self, body: _Body, placement: int) -> Form:
        return body.origin + body.axes.placed(self._of.origins[placement], self._of.radius * self._of.length)[..., 0]

    def end(self, chain: Sequence[Sequence[int]], placement: int) -> tuple[Form, Form]:
        """Return axes, as columns (3, 3), and origin (3,) of an end."""
        body = self._after(tuple((i, k) for i, k in chain))
        return body.axes.placed(self._of.rotations[placement], self._of.radius), self._shifted(body, placement)

    def ends(self, closure: Mapping[str, Any]) -> list[tuple[Form, Form]]:
        """Return both ends of a closure."""
        return [self.end(closure[side], closure[f"{side}_end"]) for side in ("first", "second")]

    def axes(self, chain: Sequence[Sequence[int]], at: Sequence[int]) -> _Side:
        """Return the axes (., 3) of variables of a chain, and points on them (., 3)."""
        whole = tuple((i, k) for i, k in chain)
        self._after(whole)
        stations = [self._stations[whole[: i + 1]] for i in at]
        return _Side(stacked([one.axes for one in stations], -2), stacked([one.origins for one in stations], -2))
