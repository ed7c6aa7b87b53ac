"""The equations of a proof, and their first derivatives, over many boxes at a time.

Rotations about parallel axes that follow each other on a chain are written in the sums of their angles, so that each
factor of a placement depends on one value, its slot's:

    R(a) T R(b) = Trans(R(a) t) R(a + b),    T = Trans(t)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.jit.compiled import prepare
from cinegen.proof._kernels.boxes import evaluate_boxes
from cinegen.proof._kernels.memory import (
    NO_RATES,
    PLACEMENT,
    SLIDE_RATE,
    SLIDES,
    TURN_RATES,
    TURNS,
    TURNS_OFFSET,
    BoxMemory,
)

_RATES = {
    None: (NO_RATES, 0),
    "slide": (SLIDE_RATE, 1),
    "turn": (TURN_RATES, 3),
    "placement": (PLACEMENT, 12),
}  # and numbers of rows
_ORIGIN = np.diag([0.0, 0.0, 0.0, 1.0])
_SHORT = 1e-9  # part of a box: as good as its centre
_ONE = np.stack([np.eye(4), np.zeros((4, 4))])


class Point(NamedTuple):
    """Equations and derivatives at points, each a midpoint and a radius.

    Attributes:
        residual: (boxes, 2, rows).
        jacobian: (boxes, 2, rows, columns), dimensionless but for the coordinates of the pose.
    """

    residual: Array
    jacobian: Array


class Change(NamedTuple):
    """The derivative over boxes: J + sum_k (G_k + T_k) eta_k + [-R, R], R = R_1 + R_2.

    Attributes:
        by: (boxes, eta, rows, columns) G, of the second derivatives.
        bent: (boxes, rows, columns) R_1, what they and third ones change.
        apart: (boxes, rows, columns) R_2, by the distance from X(eps).
        sharper: (boxes, products, rows, columns) T, of the third derivatives where they are known, by the products of
            eps, the last of eta.
    """

    by: Array
    bent: Array
    apart: Array
    sharper: Array

    @property
    def whole(self) -> Array:
        """(boxes, eta, rows, columns) G + T."""
        first = self.by.shape[1] - self.sharper.shape[1]
        return np.concatenate([self.by[:, :first], self.by[:, first:] + self.sharper], axis=1)

    def nearer(self, shares: Array) -> Change:
        """Return the change if the distance from X(eps) is at most a share (boxes,) of what it was."""
        return self._replace(apart=self.apart * shares[:, None, None])


class _Slot(NamedTuple):
    kind: int
    variables: list[int]
    before: Array
    offset: Array


class Equations:
    """Evaluates the equations of a document (`cinegen.proof.exported_equations`).

    Attributes:
        unknown: indices of the variables that are unknown.
        over: indices of the variables that vary, the first of those that are given.
        locked: indices of the columns of a Jacobian whose motions the actuated joints must control: all but theirs.
        names: of the unknowns.
        units: (unknowns,) size of a dimensionless step.
        lower: (unknowns,) dimensionless limits, infinite where there are none.
        upper: (unknowns,) likewise.
        rows: indices of the equations that are not exactly 0; all at first.
        positive: indices of what is not 0 but positive.
        rates: indices of what is no equation, but yields velocities of joints.
        has_radii: whether dimensions have tolerances.
        count: number of variables.
        width: number of columns that are not velocities of virtual joints.
        column: of each variable.
    """

    def __init__(self, document: Mapping[str, Any]) -> None:
        self._document, variables = document, document["variables"]
        numbers = np.array(document["placements"])
        radii = np.array(document.get("radii", np.zeros(numbers.shape)))
        self._placements, self.has_radii = np.zeros((len(numbers), 2, 4, 4)), "radii" in document
        for k, part in enumerate((numbers, radii)):
            self._placements[:, k, :3, :3], self._placements[:, k, :3, 3] = part[:, :9].reshape(-1, 3, 3), part[:, 9:]
        self._placements[:, 0, 3, 3] = 1.0
        self._at = np.array([variable["at"] for variable in variables])
        self._slides = [variable["prismatic"] for variable in variables]
        self.unknown, self.over = list(document["unknown"]), [int(k) for k in document["over"]]
        columns = [*self.unknown, *self.over, *(k for k in document["given"] if k not in self.over)]
        self.width, self.count, self._joints = len(columns), len(variables), int(document["joints"])
        columns += document.get("virtual", [])
        self.column = {k: i for i, k in enumerate(columns)}
        self._column = np.zeros((len(variables), len(columns)))
        self._column[columns, np.arange(len(columns))] = [variables[k]["unit"] for k in columns]
        self.units = np.array([variables[k]["unit"] for k in self.unknown])
        self.locked = [i for i, k in enumerate(columns[: self.width]) if k not in document["actuated"]]
        self.names = [variables[k]["name"] for k in self.unknown]
        limits = np.array([variables[k]["limits"] for k in self.unknown], dtype=float).reshape(-1, 2)
        self.lower = np.where(np.isnan(limits[:, 0]), -np.inf, limits[:, 0]) / self.units
        self.upper = np.where(np.isnan(limits[:, 1]), np.inf, limits[:, 1]) / self.units
        self._memory, kinds = self._arranged()
        self._evaluate = prepare(evaluate_boxes, BoxMemory)
        self.rows, self.positive, self.rates = (np.flatnonzero(kinds == kind) for kind in range(3))

    @property
    def start(self) -> Array:
        """(unknowns,) dimensionless values in the configuration that the document was written in."""
        return np.asarray(self._at[self.unknown] / self.units)

    @property
    def pose(self) -> Array:
        """(6,) coordinates of the pose, m and rad, where they do not vary."""
        return self._at[self._joints : self._joints + 6]

    @pose.setter
    def pose(self, values: Array) -> None:
        self._at[self._joints : self._joints + 6] = values

    def select(self, x: Array, p: Array) -> None:
        """Leave out the equations that no variable changes near a configuration: those across a planar linkage."""
        along = np.concatenate([np.zeros((len(x), len(p))), np.eye(len(p))])[None]
        change = self.change(x[None], p[None], along, np.ones((1, len(x))))
        parts = np.abs(self.at(x[None], p[None]).jacobian[0, 0]) + np.abs(change.by[0]).sum(axis=0)
        is_left = (parts + change.bent[0] + change.apart[0])[:, : self.width].any(axis=-1)
        self.rows = np.array([i for i in self.rows if is_left[i]], dtype=np.intp)

    def at(self, x: Array, p: Array) -> Point:
        """Return equations and derivatives at points.

        Args:
            x: (boxes, unknowns) dimensionless.
            p: (boxes, parameters) m and rad.
        """
        values = self.values(x, p)
        n, rows, columns, m = len(x), self._memory.rows, self._column.shape[1], len(self.over)
        whole = Point(np.zeros((n, 2, rows)), np.zeros((n, 2, rows, columns)))
        flat = np.zeros((n, len(self._at), m)), np.zeros((n, len(self._at)))
        self._run(1, values, *flat, whole, None)
        for row, coupling in enumerate(self._document["couplings"], rows - len(self._document["couplings"])):
            size = coupling["size"]
            whole.residual[:, 0, row] = -coupling["constant"] / size
            for k, c in coupling["terms"]:
                curve = np.polynomial.Polynomial([0.0, *c])
                whole.residual[:, 0, row] += curve(values[:, k]) / size
                whole.jacobian[:, 0, row] += curve.deriv()(values[:, k])[:, None] * self._column[k] / size
        return whole

    def change(self, x: Array, p: Array, along: Array, y: Array) -> Change:
        """Return how the derivatives change over boxes.

        Args:
            x: (boxes, unknowns) dimensionless, at the centre.
            p: (boxes, parameters) m and rad, at the centre.
            along: (boxes, unknowns + parameters, eta) their change by eps, or by eps and their products.
            y: (boxes, unknowns) radius about X(eps).
        """
        n, rows, count, m = len(x), self._memory.rows, len(self.unknown), along.shape[2]
        values, g, r = self.values(x, p), np.zeros((n, len(self._at), m)), np.zeros((n, len(self._at)))
        g[:, self.unknown], g[:, self.over] = along[:, :count] * self.units[:, None], along[:, count:]
        r[:, self.unknown] = y * self.units
        whole = self._no_change(n, m, m - len(self.over))
        self._run(2, values, g, r, None, whole)
        if self.has_radii:  # those of the second derivatives at the centre are not halved
            point = self._no_change(n, m, 0)
            self._run(2, values, _SHORT * g, 0.0 * r, None, point)
            whole.bent[:] += 2.0 / _SHORT * point.bent
        for row, coupling in enumerate(self._document["couplings"], rows - len(self._document["couplings"])):
            for k, c in coupling["terms"]:
                bend, column = np.polynomial.Polynomial([0.0, *c]).deriv(2), self._column[k] / coupling["size"]
                spread, size = np.abs(g[:, k]).sum(axis=-1), np.abs(column)
                far = np.abs(bend.deriv()(values[:, k])) * (spread + r[:, k])
                whole.by[:, :, row] += (bend(values[:, k])[:, None] * g[:, k])[..., None] * column
                whole.bent[:, row] += (far * spread)[:, None] * size
                whole.apart[:, row] += ((np.abs(bend(values[:, k])) + far) * r[:, k])[:, None] * size
        return whole

    def placed(self, chain: Sequence[Sequence[int]], end: int, values: Array, radius: Array) -> tuple[Array, Array]:
        """Return the origin (boxes, 3) of the end of a chain and its radius, m.

        Args:
            chain: placements and variables.
            end: a placement.
            values: (boxes, variables) rad and m.
            radius: (boxes, variables) likewise.
        """
        turn, at = (
            (np.tile(np.eye(3), (len(values), 1, 1)), np.zeros((len(values), 3, 3))),
            np.zeros((2, len(values), 3)),
        )
        for index, k in [*chain, [end, -1]]:
            fixed, unsure = self._placements[index, :, :3]
            moved = turn[0] @ fixed, np.abs(turn[0]) @ unsure + turn[1] @ (np.abs(fixed) + unsure)
            at += np.array([m[..., 3] for m in moved])
            turn = moved[0][..., :3], moved[1][..., :3]
            if k < 0:
                continue
            q, r = values[:, k, None], radius[:, k, None]
            if self._slides[k]:
                at[0] += turn[0][:, :, 2] * q
                at[1] += np.abs(turn[0][:, :, 2]) * r + turn[1][:, :, 2] * (np.abs(q) + r)
                continue
            s, c, turned = np.sin(q), np.cos(q), np.zeros((2, len(values), 3, 3))
            turned[0, :, :2, :2] = np.stack([np.hstack([c, -s]), np.hstack([s, c])], axis=1)
            turned[0, :, 2, 2] = 1.0
            turned[1, :, :2, :2] = np.abs(turned[0, :, :2, 1::-1]) * r[..., None] + 0.5 * (r * r)[..., None]
            low = np.abs(turn[0]) @ turned[1] + turn[1] @ (np.abs(turned[0]) + turned[1])
            turn = turn[0] @ turned[0], low
        return at[0], at[1]

    # --- slots -------------------------------------------------------------------------------------------------------

    def values(self, x: Array, p: Array) -> Array:
        """Return the values (boxes, variables), rad and m."""
        values = np.tile(self._at, (len(x), 1))
        values[:, self.unknown], values[:, self.over] = x * self.units, p
        return values

    def _run(self, order: int, values: Array, g: Array, r: Array, at: Point | None, change: Change | None) -> None:
        memory, n, m = self._memory, len(values), g.shape[2]
        rows, columns = memory.rows, self._column.shape[1]
        change = change or self._no_change(n, m, 0)
        memory.resize(count=n, order=order, parameters=m, sums=m + 2, pairs=change.sharper.shape[1])
        at = at or Point(np.zeros((n, 2, rows)), np.zeros((n, 2, rows, columns)))
        inputs = values @ self._sums.T, np.einsum("sv,bvn->bsn", self._sums, g), r @ self._sums.T
        names = "q", "along", "away", "residual", "jacobian", "by", "bent", "apart", "sharper"
        for name, numbers in zip(names, (*inputs, *at, *change), strict=True):
            memory.point_at(name, np.ascontiguousarray(numbers))
        self._evaluate(memory.handle)

    def _no_change(self, n: int, m: int, pairs: int) -> Change:
        rows, columns = self._memory.rows, self._column.shape[1]
        shape = (n, rows, columns)
        sizes = (n, m, rows, columns), shape, shape, (n, pairs, rows, columns)
        return Change(*(np.zeros(size) for size in sizes))

    def _slots(self, chain: Sequence[Sequence[int]], end: int) -> tuple[list[_Slot], Array]:
        """Return the slots of a chain, and the placement of its end behind the last one; matrices (2, 4, 4)."""
        slots, turned, is_turn, none = list[_Slot](), _ONE, False, np.zeros((2, 4, 4))
        for index, k in chain:
            placement, slides = self._placements[index], self._slides[k]
            moved = _product(turned, placement)
            if is_turn and not slides and placement[0, 2, 2] == 1.0 and not placement[1, :3, 2].any():
                offset = moved @ _ORIGIN - _ORIGIN * [[[1.0]], [[0.0]]]
                slots[-1] = slots[-1]._replace(kind=TURNS_OFFSET, offset=offset)
                slots.append(_Slot(TURNS, [*slots[-1].variables, k], _ONE, none))
                turned = moved - offset
            else:
                slots.append(_Slot(SLIDES if slides else TURNS, [k], moved, none))
                turned = _ONE
            is_turn = not slides
        return slots, _product(turned, self._placements[end])

    def _arranged(self) -> tuple[BoxMemory, Indices]:
        """Return the memory of the kernel, and the kinds of rows (rows,): an equation, what is positive, a rate."""
        closures, couplings = self._document["closures"], self._document["couplings"]
        chains = [[self._slots(c[side], c[f"{side}_end"]) for side in ("first", "second")] for c in closures]
        lengths = np.array([[len(slots) for slots, _ in pair] for pair in chains]).reshape(-1, 2)
        slots = [slot for pair in chains for chain, _ in pair for slot in chain]
        self._sums = np.zeros((len(slots), len(self._at)))
        for i, slot in enumerate(slots):
            self._sums[i, slot.variables] = 1.0
        kinds, rows = list[int](), list[int]()
        for closure in closures:
            rows.append(len(kinds))
            kinds += [0] * (len(closure["translations"]) + closure["rotations"]) + [1] * (closure["rotations"] > 0)
            kinds += [2] * _RATES[closure.get("rates")][1]
        kinds += [0] * len(couplings)
        longest, n = int(lengths.max(initial=0)), len(self.over)
        memory = BoxMemory(
            closures=len(closures), slots=len(slots), longest=longest, ends=longest + 1, rows=len(kinds),
            columns=self._column.shape[1], parameters=n, sums=n + 2, over=n,
        )  # fmt: skip
        memory.length, memory.unsure = float(self._document["length"]), 1.0 if self.has_radii else 1.0 / 3.0
        starts = np.concatenate([[0], np.cumsum(lengths)])
        for c, (closure, pair) in enumerate(zip(closures, chains, strict=True)):
            memory.chain[c] = starts[2 * c : 2 * c + 3]
            memory.linear[c], memory.turns[c], memory.row[c] = (
                len(closure["translations"]),
                closure["rotations"],
                rows[c],
            )
            memory.end[c] = [end for _, end in pair]
            memory.rates[c] = _RATES[closure.get("rates")][0]
        for i, slot in enumerate(slots):
            memory.kind[i], memory.before[i], memory.offset[i] = slot.kind, slot.before, slot.offset
        memory.by_slot[:] = self._sums @ self._column
        virtual = set(self._document.get("virtual", []))
        memory.virtual[:] = [virtual.issuperset(slot.variables) for slot in slots]
        return memory, np.array(kinds)


def _product(a: Array, b: Array) -> Array:
    """Return the product of matrices (2, 4, 4): midpoints and radii."""
    size = np.abs(a[0])
    return np.stack([a[0] @ b[0], size @ b[1] + a[1] @ (np.abs(b[0]) + b[1])])
