"""Joints that follow others: in couplings, and redundant actuated joints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from cinegen.arrays import Array
from cinegen.assembly.errors import ModesError
from cinegen.model import Mechanism
from raff2urdf import closure
from raff2urdf.coupling import Coupling, determining, leaders_first
from raff2urdf.readers.actuation import syntax_of


class _Mimic(NamedTuple):
    """A joint that follows a passive joint of its kind: ratio times its value, plus an offset (rad or m).

    Revolute joints follow by a ratio of 1 or -1: with another, angles that place links alike differ in one of them.
    """

    leader: str
    ratio: float
    offset: float


def followers(mechanism: Mechanism) -> tuple[list[Coupling], dict[str, _Mimic]]:
    """Return the couplings in which a joint follows the actuated ones, directly or one after another, with that joint
    first; and the joints that follow passive ones.

    Raises:
        ModesError: a coupling has joints that do neither, or that have the roots of a polynomial as values.
    """
    followed, mimics = determining(mechanism.couplings, mechanism.actuated), dict[str, _Mimic]()
    several = {coupling.follower for coupling in followed if len(coupling.terms[coupling.follower]) > 1}
    known = {*mechanism.actuated, *(coupling.follower for coupling in followed)} - several
    for coupling in leaders_first(mechanism.couplings):
        unknown = [joint for joint in coupling.terms if joint not in known]
        mimic = _mimic(mechanism, coupling, mimics) if len(unknown) == len(coupling.terms) else None
        if mimic is not None:
            mimics[coupling.follower] = mimic
        elif unknown:
            leaders = [joint for joint in unknown if joint != coupling.follower] or unknown
            raise ModesError(
                f"{mechanism.name}: coupling '{coupling.name}' does not determine {list_of(unknown)} linearly from "
                "actuated joints, nor from a passive one by a ratio of 1 or -1" + remedy(mechanism, leaders, "actuated")
            )
    return followed, mimics


def _mimic(mechanism: Mechanism, coupling: Coupling, mimics: Mapping[str, _Mimic]) -> _Mimic | None:
    """Return how the first joint of a coupling follows a passive one; None if it does not."""
    follower, leader, *others = [*coupling.terms, "", ""][:3]
    if others != [""] or not coupling.is_linear or follower in mimics:
        return None
    ratio = -coupling.terms[leader][0] / coupling.terms[follower][0]
    offset = coupling.constant / coupling.terms[follower][0]
    if leader in mimics:
        leader, factor, at = mimics[leader]
        ratio, offset = ratio * factor, offset + ratio * at
    kinds = [mechanism.is_prismatic(name) for name in (follower, leader)]
    alike = kinds[0] == kinds[1] and (kinds[0] or abs(ratio) == 1.0) and leader != follower
    return _Mimic(leader, ratio, offset) if alike and not any(m.leader == follower for m in mimics.values()) else None


def redundant_joints(
    mechanism: Mechanism, rows: list[Array], columns: list[int], names: list[str], follow: bool, mimics: int
) -> tuple[str, ...]:
    """Return the actuated joints whose values follow from those of the others.

    Args:
        mechanism: the mechanism.
        rows: derivatives of the loops at some configurations.
        columns: of the actuated joints that move loops.
        names: of these.
        follow: whether passive joints follow actuated ones in couplings.
        mimics: number of passive joints that follow passive ones, whose columns are 0.
    """
    count = mechanism.loop_rank - mechanism.structure.passive_rank
    if count == 0:
        return ()
    if follow:
        matrix = max((mechanism.structure.system.evaluate(q)[1] for q in mechanism.structure.samples), key=closure.rank)
        leaders = {joint for coupling in mechanism.couplings for joint in coupling.terms if joint != coupling.follower}
        ordered = dict(sorted(zip(columns, names, strict=True), key=lambda item: item[1] in leaders))
        dependent = closure.passive(matrix, [*mechanism.structure.passive_columns.tolist(), *ordered])
        raise ModesError(
            f"{mechanism.name}: {count} of its actuated joints follow from the others, by loops or couplings"
            + remedy(mechanism, [ordered[column] for column in dependent if column in ordered], "passive")
        )
    best: list[int] = []
    strongest = 0.0
    for matrix in rows:
        passive = np.linalg.svd(matrix[:, mechanism.structure.passive_columns])[0][
            :, mechanism.structure.passive_rank - mimics :
        ]
        _, r, order = qr(passive.T @ matrix[:, columns], mode="economic", pivoting=True)
        weakest = abs(r[count - 1, count - 1])
        if weakest > strongest:
            best, strongest = order[:count].tolist(), weakest
    return tuple(names[k] for k in sorted(best))


def remedy(mechanism: Mechanism, joints: Sequence[str], what: str) -> str:
    """Return the end of an error: which joints to declare so, and how; nothing if there are none."""
    how = f"; {syntax_of(Path(mechanism.source.name))} declares an actuated joint"
    return f": let {list_of(joints)} be {what}{how}" if joints else ""


def list_of(names: Iterable[str]) -> str:
    """Return names as text: 'a', 'b' and 'c'."""
    quoted = [f"'{name}'" for name in names]
    return quoted[0] if len(quoted) == 1 else f"{', '.join(quoted[:-1])} and {quoted[-1]}"
