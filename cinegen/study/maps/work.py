"""A piece of a map: settled, measured and written; what processes and machines do, each for itself."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.solve.sample import Evaluations, Sampler
from cinegen.study.maps.by_motors import ByMotors
from cinegen.study.maps.by_pose import ByPose
from cinegen.study.maps.quantities import QUANTITIES, Cells
from cinegen.study.maps.settled import How, Settled
from cinegen.study.maps.store import Store
from cinegen.study.maps.survey import Survey

Array = NDArray[np.float64]
Values = NDArray[Any]


class Surveyor:
    """Settles and measures pieces of a survey's region."""

    def __init__(self, survey: Survey) -> None:
        self.survey = survey
        balls = None
        if "sigma_2" in survey.quantities:
            from cinegen.study.singular.counted import balls as balls_of

            balls = balls_of(survey.mechanism)
        self._sampler = Sampler(survey.mechanism, survey.node, *survey.counted, balls)
        self._by = ByMotors(survey, self._sampler) if survey.of_motors else ByPose(survey)

    def values(self, piece: tuple[slice, ...]) -> dict[str, Values]:
        """All that is to be known of a piece's cells: by name (n, ...), the last axis fastest."""
        settled, done = self._settled(piece)
        cells = Cells(self.survey, settled, done)
        reached = np.isin(settled.how, [int(how) for how in How if how.reached])
        found: dict[str, Values] = {}
        for name in self.survey.quantities:
            values = np.asarray(QUANTITIES[name].of(cells), dtype=QUANTITIES[name].dtype)
            if not reached.all() and name != "solutions":
                values = np.where(reached, values, np.nan).astype(values.dtype)
            found[name] = values
        return {**found, "configuration": settled.q, "reachable": reached, "settled": settled.how}

    def _settled(self, piece: tuple[slice, ...]) -> tuple[Settled, Evaluations]:
        if isinstance(self._by, ByMotors):
            settled, done = self._by.settle(piece)
        else:
            settled = self._by.settle(piece)
            done = _spread(self._sampler.at(settled.q[np.isfinite(settled.q[:, 0])]), settled.q)
        if "sigma_2" in self.survey.quantities:
            self._fill_second(settled.q, done.second)
        return settled, done

    def _fill_second(self, configurations: Array, second: Array) -> None:
        """Where the quick way could not tell: axes of a ball joint in a plane, dependent columns."""
        rows = None
        for k in np.flatnonzero(np.isfinite(configurations[:, 0]) & ~np.isfinite(second)):
            if rows is None:
                from cinegen.study.singular.crossing import of_passive_joints

                rows = of_passive_joints(self.survey.mechanism)
            second[k] = rows.sigma(rows.of(configurations[k])[None])[0]


def _spread(done: Evaluations, configurations: Array) -> Evaluations:
    """Not a number where there is no configuration."""
    good = np.isfinite(configurations[:, 0])
    if good.all():
        return done
    spread = []
    for name in done.__dataclass_fields__:
        values = getattr(done, name)
        full = np.full((len(good), *values.shape[1:]), np.nan)
        full[good] = values
        spread.append(full)
    return Evaluations(*spread)


@lru_cache(maxsize=2)
def _at_work(path: str, text: str) -> tuple[Store, Surveyor]:
    """For a map: made once in each process, from what stands in it."""
    store = Store(path)
    return store, Surveyor(store.survey)


def do(path: str, text: str, indices: Sequence[tuple[int, ...]]) -> int:
    """Makes some pieces of a map and writes them; cells that are reachable.

    Args:
        path: of the map.
        text: of its survey: that it is the one that is meant.
        indices: of the pieces.

    Raises:
        MapError: the map can't be read or written.
    """
    store, surveyor = _at_work(path, text)
    reached = 0
    for index in indices:
        if store.is_done(index):  # by a process that was thought dead
            continue
        values = surveyor.values(store.cells(index))
        store.write(index, values)
        reached += int(values["reachable"].sum())
    return reached
