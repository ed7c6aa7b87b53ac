"""The quantity of a map's cells that comes from tolerances: how accurate the node's position is."""

from __future__ import annotations

from collections.abc import Collection
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from cinegen.arrays import Array
from cinegen.design import Tolerances
from cinegen.workspace.errors import MapError
from raff2urdf.raff.reader import parse

if TYPE_CHECKING:
    from cinegen.workspace.cells import Cells
    from cinegen.workspace.specification import MapSpecification


ACCURACY = "accuracy"
"""The name of the quantity."""

KEYS = ("raff", "sigma", "play", "encoder")
"""Keys of `MapSpecification.tolerances`: the text of the robot's RAFF file, and what `Tolerances` takes."""

_SAME = 1e-9  # m, rad


def accuracy(cells: Cells) -> Array:
    """Return (n,) the root mean square error of the node's position by the tolerances, m; NaN at singularities of type
    2, where it has no bound."""
    errors, q = np.full(len(cells.status), np.nan), cells.evaluations.q
    known = np.isfinite(q).all(axis=1)
    if known.any():
        errors[known] = _tolerances_of(cells.spec).accuracy(q[known], cells.spec.node)
    return errors


@lru_cache(maxsize=2)
def _tolerances_of(spec: MapSpecification) -> Tolerances:
    document = parse(spec.tolerances["raff"], spec.mechanism.source.name)
    sigma, play, encoder = (spec.tolerances.get(key) for key in ("sigma", "play", "encoder"))
    return Tolerances(document, sigma, play, encoder, robot=spec.mechanism.name)


def check_tolerances(spec: MapSpecification, wanted: Collection[str]) -> None:
    """Check that a specification has what the accuracy takes.

    Raises:
        MapError: tolerances are missing, are not wanted, or belong to another robot.
        DesignError: a tolerance is wrong.
    """
    if ACCURACY not in wanted:
        if spec.tolerances:
            raise MapError(f"tolerances: no quantity of this map takes them: add {ACCURACY}")
        return
    if not spec.tolerances:
        raise MapError(f"{ACCURACY} takes tolerances: give them (--sigma 'link*.d=0.05mm', --play, --encoder)")
    if "raff" not in spec.tolerances or set(spec.tolerances) - set(KEYS):
        raise MapError(f"tolerances have the keys {', '.join(KEYS)}, not {', '.join(map(str, spec.tolerances))}")
    robot, other = spec.mechanism, _tolerances_of(spec).design.mechanism
    same = robot.joints == other.joints and robot.actuated == other.actuated and robot.nodes == other.nodes
    if not same or np.abs(robot.q_home - other.q_home).max(initial=0.0) > _SAME:
        raise MapError(
            f"{ACCURACY}: {robot.name} is not as its RAFF file describes it: leave out options that change its loops"
        )
