"""`ByActuatedJoints`: evaluates cells over actuated joints, loops closed from cell to cell."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.batch import BatchEvaluator, Evaluations
from cinegen.tolerances import AT_LIMIT
from cinegen.workspace.cells import Cells, CellStatus
from cinegen.workspace.chunks import back_and_forth, neighbours
from cinegen.workspace.specification import MapSpecification

Array = NDArray[np.float64]

_REACHABLE, _OPEN = int(CellStatus.REACHABLE), int(CellStatus.LOOPS_OPEN)  # numpy compares enumerations slowly
_BEYOND_LIMITS = int(CellStatus.BEYOND_LIMITS)
_FIELDS = tuple(Evaluations.__dataclass_fields__)


class ByActuatedJoints:
    """Evaluates chunk after chunk.

    Args:
        spec: a specification over actuated joints.
        sampler: of its mechanism and node.
    """

    def __init__(self, spec: MapSpecification, sampler: BatchEvaluator) -> None:
        self.spec, self._sampler = spec, sampler
        mechanism = spec.mechanism
        names = [
            name for name in mechanism.joints if name not in mechanism.actuated and not mechanism.is_prismatic(name)
        ]
        self._passive = np.array([mechanism.q_index(name) for name in names], dtype=np.intp)

    def cells(self, chunk: tuple[slice, ...]) -> Cells:
        """Evaluate the cells of a chunk."""
        spec, region = self.spec, self.spec.region
        values = region.joint_values(spec.mechanism, region.values(chunk))
        if spec.mechanism.loops:
            shape = [len(range(*part.indices(part.stop))) for part in chunk]
            order = back_and_forth(shape)
            done = self._sampler.follow(np.ascontiguousarray(values[order]))
            inverse = np.argsort(order)
            done = Evaluations(*(getattr(done, name)[inverse] for name in _FIELDS))
            status = self._judged(done)
            if not (status == _REACHABLE).all():
                self._retry(values, neighbours(shape), done, status)
        else:
            done = self._sampler.follow(values)
            status = self._judged(done)
        done.q[status != _REACHABLE] = np.nan
        return Cells(spec, status, done, self._modes(values) if "solutions" in spec.quantities else None)

    def _judged(self, done: Evaluations) -> NDArray[np.uint8]:
        """Return the status (n,) of cells, after passive joints are moved by whole turns to within their limits."""
        done.q[:, self._passive] = self._unwound(done.q[:, self._passive])
        status = np.where(np.isfinite(done.closure), _REACHABLE, _OPEN).astype(np.uint8)
        if self.spec.limits:
            status[np.isfinite(done.q).all(axis=1) & ~self.spec.mechanism.limits.within(done.q)] = _BEYOND_LIMITS
        return status

    def _retry(self, values: Array, near: NDArray[np.intp], done: Evaluations, status: NDArray[np.uint8]) -> None:
        """Retry cells that the path through the chunk did not reach: from each neighbour that is reachable and, where
        none is, straight from home. Changes `done` and `status`."""
        home = self.spec.mechanism.q_home

        def reaches(start: Array, cell: int) -> bool:
            found = self._sampler.follow(values[cell : cell + 1], start)
            now = self._judged(found)[0]
            if now == _REACHABLE or (now, status[cell]) == (_BEYOND_LIMITS, _OPEN):
                status[cell] = now
                for name in _FIELDS:
                    getattr(done, name)[cell] = getattr(found, name)[0]
            return bool(now == _REACHABLE)

        waiting = deque(np.flatnonzero(status == _REACHABLE).tolist())
        left = np.flatnonzero(status != _REACHABLE).tolist()
        for first in (None, *left):
            if first is not None and status[first] != _REACHABLE and reaches(home, first):
                waiting.append(first)
            while waiting:
                here = waiting.popleft()
                for cell in near[here].tolist():
                    if cell >= 0 and status[cell] != _REACHABLE and reaches(done.q[here], cell):
                        waiting.append(cell)

    def _unwound(self, angles: Array) -> Array:
        """Return angles (n, k) of passive joints within their limits, or else within half a turn of home: the number
        of whole turns on the path makes no difference."""
        limits, home = self.spec.mechanism.limits, self.spec.mechanism.q_home[self._passive]
        near_home = home + (angles - home + np.pi) % (2.0 * np.pi) - np.pi
        low, high = limits.lower[self._passive], limits.upper[self._passive]
        with np.errstate(invalid="ignore"):
            above = low + (angles - low + AT_LIMIT) % (2.0 * np.pi) - AT_LIMIT
            within = np.where(np.isfinite(low), above, near_home)
        allowed = (near_home >= low - AT_LIMIT) & (near_home <= high + AT_LIMIT)
        return np.where(allowed | (within > high + AT_LIMIT), near_home, within)

    def _modes(self, values: Array) -> NDArray[np.int32]:
        """Return (n,) the number of assembly modes, as `assembly_modes` counts them, without regard to limits."""
        from cinegen.assembly import assembly_modes

        mechanism = self.spec.mechanism
        if not mechanism.loops:
            return np.ones(len(values), dtype=np.int32)
        return np.array([len(assembly_modes(mechanism, joints)) for joints in values], dtype=np.int32)
