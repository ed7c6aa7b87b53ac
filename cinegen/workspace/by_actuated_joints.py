"""`ByActuatedJoints`: evaluates cells over actuated joints, loops closed from cell to cell."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.arrays import Array, Indices
from cinegen.ik.batch import BatchEvaluator, Evaluations
from cinegen.singularities.branch import flood, neighbours
from cinegen.workspace.cells import Cells, CellStatus
from cinegen.workspace.chunks import back_and_forth
from cinegen.workspace.specification import MapSpecification

_, _REACHABLE, _, _, _, _OPEN, _BEYOND_LIMITS = map(int, CellStatus)  # numpy compares these faster
_FIELDS = tuple(Evaluations.__dataclass_fields__)


class ByActuatedJoints:
    """Evaluates chunk after chunk.

    Args:
        spec: a specification over actuated joints.
        batch: evaluator of its mechanism and node.
    """

    def __init__(self, spec: MapSpecification, batch: BatchEvaluator) -> None:
        self.spec, self._batch = spec, batch
        mechanism = spec.mechanism
        names = [
            name for name in mechanism.joints if name not in mechanism.actuated and not mechanism.is_prismatic(name)
        ]
        self._passive = np.array([mechanism.q_index(name) for name in names], dtype=np.intp)
        home, limits = mechanism.q_home[self._passive], mechanism.limits
        low, high = limits.lower[self._passive], limits.upper[self._passive]
        with np.errstate(invalid="ignore"):  # within half a revolution of these, angles are within their limits
            near_home = np.clip(home, low + np.pi, high - np.pi)
            self._middles = np.where(high - low < 2.0 * np.pi, 0.5 * (low + high), near_home)

    def cells(self, chunk: tuple[slice, ...]) -> Cells:
        """Evaluate the cells of a chunk."""
        spec, region = self.spec, self.spec.region
        values = region.joint_values(spec.mechanism, region.values(chunk))
        shape = [cells.stop - cells.start for cells in chunk]
        order: Any = back_and_forth(shape) if spec.mechanism.is_constrained else slice(None)
        done = self._batch.follow(np.ascontiguousarray(values[order]))
        inverse = np.argsort(order) if spec.mechanism.is_constrained else order
        done = Evaluations(*(getattr(done, name)[inverse] for name in _FIELDS))
        status = self._judged(done)
        if spec.mechanism.is_constrained and not (status == _REACHABLE).all():
            self._retry(values, neighbours(shape), done, status)
        done.q[status != _REACHABLE] = np.nan
        return Cells(spec, status, done, self._modes(values) if "solutions" in spec.quantities else None)

    def _judged(self, done: Evaluations) -> NDArray[np.uint8]:
        """Return the status (n,) of cells, after passive joints are moved by revolutions to within their limits."""
        done.q[:, self._passive] -= 2.0 * np.pi * np.rint((done.q[:, self._passive] - self._middles) / (2.0 * np.pi))
        status = np.where(np.isfinite(done.closure), _REACHABLE, _OPEN).astype(np.uint8)
        if self.spec.limits:
            status[np.isfinite(done.q).all(axis=1) & ~self.spec.mechanism.limits.within(done.q)] = _BEYOND_LIMITS
        return status

    def _retry(self, values: Array, near: Indices, done: Evaluations, status: NDArray[np.uint8]) -> None:
        """Retry cells that the path through the chunk did not reach: from each neighbour that is reachable and, where
        none is, straight from home. Changes `done` and `status`."""
        home = self.spec.mechanism.q_home

        def solved(start: Array, cell: int) -> bool:
            if status[cell] == _REACHABLE:
                return False
            evaluations = self._batch.follow(values[cell : cell + 1], start)
            now = self._judged(evaluations)[0]
            if now == _REACHABLE or (now, status[cell]) == (_BEYOND_LIMITS, _OPEN):
                status[cell] = now
                for name in _FIELDS:
                    getattr(done, name)[cell] = getattr(evaluations, name)[0]
            return bool(now == _REACHABLE)

        def reach(known: int, cell: int) -> bool:
            return solved(done.q[known], cell)

        neighbours_of = near.tolist()
        flood(np.flatnonzero(status == _REACHABLE).tolist(), neighbours_of, reach)
        for first in np.flatnonzero(status != _REACHABLE).tolist():
            if solved(home, first):
                flood([first], neighbours_of, reach)

    def _modes(self, values: Array) -> NDArray[np.int32]:
        """Return (n,) the number of assembly modes, as `assembly_modes` counts them, without regard to limits."""
        from cinegen.assembly import assembly_modes

        mechanism = self.spec.mechanism
        if not mechanism.is_constrained:
            return np.ones(len(values), dtype=np.int32)
        return np.array([len(assembly_modes(mechanism, joints)) for joints in values], dtype=np.int32)
