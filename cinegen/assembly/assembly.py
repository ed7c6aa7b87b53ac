"""`Assembly`: the joints' values that belong to a placement of the platform, leg by leg."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly._kernels import (
    COLUMN,
    FIRST,
    LOST,
    MOTOR,
    RIGID,
    SECOND,
    Complex,
    Path,
    Scratch,
    Tables,
    residuals,
    settle,
)
from cinegen.assembly.linkage import ACCURACY, Linkage, scratch_of
from raff2urdf.closure import rank

Array = NDArray[np.float64]

_TRIES = 40


class Assembly:
    """Finds the passive joints of a linkage whose platform is held somewhere: one leg after the other, each by Newton's
    method from home, or else from random values.

    Args:
        linkage: whose.
        member: the linkage's body that stands for the platform.
    """

    def __init__(self, linkage: Linkage, member: int) -> None:
        self._linkage = linkage
        tables = linkage.tables
        held = np.zeros((1, 2, 12))
        held[0, :, :9] = np.eye(3).ravel()
        self._all = tables._replace(
            loops=np.vstack([[0, member, RIGID], tables.loops]), anchors=np.concatenate([held, tables.anchors])
        )
        self._legs = [self._leg(columns, loops) for columns, loops in self._blocks()]

    def _blocks(self) -> list[tuple[list[int], list[int]]]:
        """Unknowns and loops of each leg, in an order in which each needs those before it alone."""
        tables, known = self._all, set[int]()
        needed = []
        for loop in tables.loops:
            joints = np.flatnonzero(tables.above[loop[FIRST]] != tables.above[loop[SECOND]])
            needed.append({int(c) for c in tables.joints[joints, COLUMN] if c >= 0})
        blocks, left = [], list(range(len(tables.loops)))
        while left:
            first = min(left, key=lambda loop: (loop != 0, len(needed[loop] - known)))
            columns, loops = needed[first] - known, {first}
            growing = True
            while growing and first != 0:  # loops that share unknowns belong together
                more = {loop for loop in left if needed[loop] & columns}
                growing = not more <= loops
                loops |= more
                columns |= set().union(*(needed[loop] - known for loop in more)) if more else set()
            if columns:
                blocks.append((sorted(columns), sorted(loops)))
            known |= columns
            left = [loop for loop in left if loop not in loops]
        return blocks

    def _leg(self, columns: list[int], loops: list[int]) -> tuple[list[int], list[int], Tables, Scratch]:
        """The tables of a leg: its own unknowns, and all other joints as motors."""
        joints = self._all.joints.copy()
        others = [k for k in range(len(joints)) if joints[k, COLUMN] not in columns]
        for k in range(len(joints)):
            joints[k, MOTOR] = others.index(k) if k in others else -1
            joints[k, COLUMN] = columns.index(joints[k, COLUMN]) if k not in others else -1
        tables = self._all._replace(
            joints=joints,
            loops=np.ascontiguousarray(self._all.loops[loops]),
            anchors=np.ascontiguousarray(self._all.anchors[loops]),
            wanted=np.zeros((0, 2), dtype=np.int64),
            local=np.zeros((0, 3)),
        )
        scratch = scratch_of(tables, len(columns), len(others))
        return columns, others, tables._replace(rank=self._rank(columns, others, tables, scratch) + 1), scratch

    def _rank(self, columns: list[int], others: list[int], tables: Tables, scratch: Scratch) -> int:
        """How many of a leg's unknowns its loops determine: a rod may turn about itself."""
        found = 0
        for q in self._linkage.mechanism.samples:
            values = self._values(self._linkage.unknowns(q), self._linkage.motor_values(q))
            solution = np.append(self._linkage.unknowns(q)[columns], 0.0)
            residuals(tables, _still(values[others]), solution, scratch)
            found = max(found, rank(scratch.matrix[:-1, :-1].real))
        return found

    def _values(self, solution: Complex, motors: Array) -> Array:
        """(n,) of all joints."""
        joints = self._linkage.tables.joints
        return np.array([motors[j[MOTOR]] if j[MOTOR] >= 0 else solution[j[COLUMN]].real for j in joints])

    def unknowns(self, placement: Array, motors: Array) -> Complex | None:
        """(k + 1,) the passive joints' values with the platform at a placement (4, 4), without unit; None where legs
        can't be assembled so."""
        linkage = self._linkage
        solution = linkage.unknowns(linkage.mechanism.q_home)
        joints = linkage.tables.joints
        values = self._values(solution, motors)
        at = {int(j[COLUMN]): k for k, j in enumerate(joints) if j[COLUMN] >= 0}
        for number, (columns, others, tables, scratch) in enumerate(self._legs):
            if number == 0:
                tables.anchors[0, 0, :9], tables.anchors[0, 0, 9:] = placement[:3, :3].T.ravel(), placement[:3, 3]
            found = self._settled(tables, _still(values[others]), solution[columns], scratch)
            if found is None:
                return None
            solution[columns] = found
            for column in columns:
                values[at[column]] = solution[column].real
        return solution

    def _settled(self, tables: Tables, path: Path, home: Complex, scratch: Scratch) -> Complex | None:
        guess, ends, rng = np.append(home, 0.0)[None], np.zeros(1, dtype=np.int64), None
        for _ in range(_TRIES):
            settle(tables, path, guess, ends, scratch)
            if ends[0] != LOST:
                return np.asarray(guess[0, :-1])
            rng = rng or np.random.default_rng(0)
            guess[0, :-1] = home + rng.uniform(-np.pi, np.pi, size=len(home))
        return None


def _still(values: Array) -> Path:
    """Joints that are held at values (others,)."""
    lines, slices = np.zeros((2, len(values), 2), dtype=complex), np.zeros((2, 2), dtype=complex)
    lines[:, :, 0], slices[:, 0] = values, 1.0
    return Path(lines, slices, False, ACCURACY)
