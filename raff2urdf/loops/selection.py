"""Which joints are actuated where a file does not state it: independent ones, and sensible ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.closure import passive, rank

_CLEAR = 1e-3
"""Part of a column that must remain beside those chosen before, at all configurations."""

_FOLLOWS = 1e-9
"""The same of a joint that follows others: its coupling determines it, however large the coefficients of these are."""


class Candidate(NamedTuple):
    """A joint that could be actuated.

    Attributes:
        name: of the joint.
        column: its index in a step.
        depth: number of joints between it and the base.
        actuated: whether it is; None where the file does not state it.
        follows: whether it follows others in a coupling.
        prismatic: whether it slides.
        driven: whether it has limits of position, velocity or effort, as drives have.
        spins: whether it takes part in an idle motion.
    """

    name: str
    column: int
    depth: int
    actuated: bool | None
    follows: bool
    prismatic: bool
    driven: bool
    spins: bool


def determined(jacobians: Sequence[Array], candidates: Sequence[Candidate], compound: Sequence[int] = ()) -> list[str]:
    """Return the joints that the others determine; what remains is a set of joints that determines the mechanism.

    Joints that a file states to be passive are determined before others, then those that follow others in couplings,
    then those that take part in idle motions, then those furthest from the base, of these bare hinges first. Pistons,
    which slide between bodies that both move, remain in preference to all others. Where the file leaves the choice
    open, the joints that remain are independent at all configurations given, as far as possible.

    Args:
        jacobians: of the loops, (rows, nv) each, with a row for each idle motion (`raff2urdf.loops.idle`), which no
            joint needs to drive; the generic rank is reached at the last one.
        candidates: the joints, in file order.
        compound: columns of joints that are not one number, which can't be actuated.
    """
    stated = any(joint.actuated is not None for joint in candidates)
    least = min((joint.depth for joint in candidates), default=0)

    def preference(joint: Candidate) -> tuple[bool, bool, bool, bool, int, bool]:
        piston = joint.prismatic and joint.depth > least and not stated
        return joint.actuated is not False, not joint.follows, not joint.spins, piston, -joint.depth, joint.driven

    names = {joint.column: joint.name for joint in candidates}
    order = [*compound, *(joint.column for joint in sorted(reversed(candidates), key=preference))]
    margins = {joint.column: _FOLLOWS for joint in candidates if joint.follows}
    first = [] if stated else _clearly_independent(jacobians, order, margins)
    chosen = passive(jacobians[-1], [*first, *(column for column in order if column not in first)])
    return [names[column] for column in chosen if column in names]


def _clearly_independent(jacobians: Sequence[Array], order: Sequence[int], margins: Mapping[int, float]) -> list[int]:
    """Return columns that are independent at all configurations by their margin, those earlier in `order` first."""
    most = rank(jacobians[-1])
    bases = [np.zeros((len(jacobian), 0)) for jacobian in jacobians]
    chosen: list[int] = []
    for column in order:
        if len(chosen) == most:
            break
        rests = [_remainder(jacobian[:, column], basis) for jacobian, basis in zip(jacobians, bases, strict=True)]
        sizes = [float(np.linalg.norm(rest)) for rest in rests]
        wholes = [float(np.linalg.norm(jacobian[:, column])) for jacobian in jacobians]
        if all(size > margins.get(column, _CLEAR) * whole > 0.0 for size, whole in zip(sizes, wholes, strict=True)):
            chosen.append(column)
            parts = zip(bases, rests, sizes, strict=True)
            bases = [np.column_stack([basis, rest / size]) for basis, rest, size in parts]
    return chosen


def _remainder(column: Array, basis: Array) -> Array:
    for _ in range(2):  # twice is enough (Kahan, Parlett)
        column = column - basis @ (basis.T @ column)
    return column
