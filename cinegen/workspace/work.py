"""Pieces of a map: settled, measured and written; what processes and machines do, each for itself."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from socket import gethostname
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.batch import Evaluations, Sampler
from cinegen.singularities.ball_joints import balls as balls_of
from cinegen.singularities.crossing import of_passive_joints
from cinegen.workspace.by_motors import ByMotors
from cinegen.workspace.by_pose import ByPose
from cinegen.workspace.errors import MapError
from cinegen.workspace.measured import Cells, measured
from cinegen.workspace.settled import How, Settled
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.storage.store import Index, Store

Array = NDArray[np.float64]
Values = NDArray[Any]

_LEAN = {"solutions", "sigma_1", "sigma_2", "margin", "solid_angle", "clearance"}
"""Quantities that look at neither placements nor Jacobians nor more than one singular value."""


class Surveyor:
    """Evaluates pieces of a region; the values of a piece do not depend on what was evaluated before."""

    def __init__(self, spec: MapSpecification) -> None:
        self.spec = spec
        balls = balls_of(spec.mechanism) if spec.mechanism.loops else ()
        second = "sigma_2" in spec.quantities
        self._sampler = Sampler(spec.mechanism, spec.node, *spec.counted, balls, second, not _lean(spec))
        self._by = (ByMotors if spec.of_motors else ByPose)(spec, self._sampler)

    def values(self, piece: tuple[slice, ...]) -> dict[str, Values]:
        """All that is to be known of a piece's cells: by name (n, ...), the last axis fastest."""
        settled, done = self._settled(piece)
        cells = Cells(self.spec, settled, done)
        reached = np.isin(settled.how, [int(how) for how in How if how.reached])
        found: dict[str, Values] = {}
        for name in self.spec.quantities:
            values = measured(name, cells)
            if not reached.all() and name != "solutions":
                values = np.where(reached, values, np.nan).astype(values.dtype)
            found[name] = values
        return {**found, "configuration": settled.q, "reachable": reached, "settled": settled.how}

    def _settled(self, piece: tuple[slice, ...]) -> tuple[Settled, Evaluations]:
        settled, done = self._by.settle(piece)
        if "sigma_2" in self.spec.quantities:
            self._fill_second(settled.q, done.second)
        return settled, done

    def _fill_second(self, configurations: Array, second: Array) -> None:
        """Where the quick way could not tell: axes of a ball joint in a plane, dependent columns."""
        left = np.flatnonzero(np.isfinite(configurations[:, 0]) & ~np.isfinite(second))
        if not len(left):
            return
        rows = of_passive_joints(self.spec.mechanism)
        for k in left:
            second[k] = rows.sigma(rows.of(configurations[k])[None])[0]


def _lean(spec: MapSpecification) -> bool:
    """Whether the smallest singular values, or none, are all that is wanted of the sampler."""
    if not _LEAN.issuperset(spec.quantities):
        return False
    rows = min(sum(spec.counted), spec.freedoms)
    return "sigma_1" not in spec.quantities or spec.rank == rows


# --- what is handed out --------------------------------------------------------------------------------------------


class Job(NamedTuple):
    """The map that pieces are of, as others find it.

    Attributes:
        path: of the map.
        specification: SHA-256 of its specification's text: that it is the one that is meant.
        chunks: cells along each axis of a piece.
    """

    path: str
    spec: str
    chunks: Index

    @classmethod
    def of(cls, store: Store) -> Job:
        """Of a map that is there."""
        return cls(str(store.path), store.digest, store.chunks)


_ONE = Lock()  # surveyors have scratch of their own, and Python would run no two at a time


def make(job: Job, indices: Sequence[Index]) -> None:
    """Makes some pieces of a map, unless they are there, and writes them.

    Raises:
        MapError: the map can't be read or written.
    """
    with _ONE:
        store = _store(job)
        for index in indices:
            if not store.is_done(index):  # by a process that was thought dead
                store.write(index, _surveyor(job).values(store.cells(index)))


def look_after(job: Job, indices: Sequence[Index]) -> None:
    """Reads some pieces that are written: those that are damaged are to be made again.

    Raises:
        MapError: the map can't be read, or not written.
    """
    store = _store(job)
    for index in indices:
        if not store.is_sound(index):
            store.forget(index)


@lru_cache(maxsize=2)
def _store(job: Job) -> Store:
    """From what stands at the path; once in each process."""
    if not Path(job.path).exists():
        raise MapError(f"{gethostname()} sees no map at {job.path}: all machines must see it at the same path")
    store = Store(job.path)
    if Job.of(store) != job:
        raise MapError(f"{gethostname()} sees another map at {job.path}: all machines must see the same one there")
    return store


@lru_cache(maxsize=2)
def _surveyor(job: Job) -> Surveyor:
    return Surveyor(_store(job).spec)
