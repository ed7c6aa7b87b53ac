"""`ByMotors`: the configurations of cells that say what the motors do, loops closed from cell to cell."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from cinegen.ik.batch import Evaluations, Sampler
from cinegen.tolerances import AT_LIMIT
from cinegen.workspace.neighbours import neighbours, to_and_fro
from cinegen.workspace.settled import How, Settled
from cinegen.workspace.specification import MapSpecification

Array = NDArray[np.float64]

_GIVEN, _OPEN, _BEYOND_LIMITS = int(How.GIVEN), int(How.OPEN), int(How.BEYOND)  # numpy is slow to compare others
_FIELDS = tuple(Evaluations.__dataclass_fields__)


class ByMotors:
    """For one specification; used for piece after piece.

    Args:
        specification: over motors.
        sampler: of its mechanism and node.
    """

    def __init__(self, spec: MapSpecification, sampler: Sampler) -> None:
        self.spec, self._sampler = spec, sampler
        mechanism = spec.mechanism
        names = [
            name for name in mechanism.joints if name not in mechanism.actuated and not mechanism.is_prismatic(name)
        ]
        self._passive = np.array([mechanism.q_index(name) for name in names], dtype=np.intp)

    def settle(self, piece: tuple[slice, ...]) -> tuple[Settled, Evaluations]:
        """All cells of a piece of the specification's region."""
        values = self.spec.region.motors(self.spec.mechanism, piece)
        if self.spec.mechanism.loops:
            shape = [len(range(*s.indices(s.stop))) for s in piece]
            done = self._in_turn(values, shape)
            how = self._judged(done)
            if not (how == _GIVEN).all():
                self._look_again(values, neighbours(shape), done, how)
        else:
            done = self._sampler.led(values)
            how = self._judged(done)
        q = done.q
        if not (how == _GIVEN).all():
            q = np.where((how == _GIVEN)[:, None], q, np.nan)
        return Settled(q, how, self._modes(values) if "solutions" in self.spec.quantities else None), done

    def _in_turn(self, values: Array, shape: list[int]) -> Evaluations:
        """To and fro, so that each cell is next to the one before."""
        order = to_and_fro(shape)
        there = self._sampler.led(np.ascontiguousarray(values[order]))
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        return Evaluations(*(getattr(there, name)[back] for name in _FIELDS))

    def _judged(self, done: Evaluations) -> NDArray[np.uint8]:
        """(n,) how cells came to be, once passive joints are turned to where they may be."""
        done.q[:, self._passive] = self._turned(done.q[:, self._passive])
        how = np.where(np.isfinite(done.closure), _GIVEN, _OPEN).astype(np.uint8)
        if self.spec.limits:
            how[np.isfinite(done.q).all(axis=1) & ~self.spec.mechanism.limits.within(done.q)] = _BEYOND_LIMITS
        return how

    def _look_again(self, values: Array, near: NDArray[np.intp], done: Evaluations, how: NDArray[np.uint8]) -> None:
        """Cells that the way from cell to cell has not led to, for it ends in dead ends: from each neighbour that is
        given, and where there is none straight from home. Changes what is done, and how."""
        home = self.spec.mechanism.q_home

        def leads(start: Array, cell: int) -> bool:
            found = self._sampler.led(values[cell : cell + 1], start)
            now = self._judged(found)[0]
            if now == _GIVEN or (now, how[cell]) == (_BEYOND_LIMITS, _OPEN):
                how[cell] = now
                for name in _FIELDS:
                    getattr(done, name)[cell] = getattr(found, name)[0]
            return bool(now == _GIVEN)

        waiting = deque(np.flatnonzero(how == _GIVEN).tolist())
        left = np.flatnonzero(how != _GIVEN).tolist()
        for first in (None, *left):
            if first is not None and how[first] != _GIVEN and leads(home, first):
                waiting.append(first)
            while waiting:
                here = waiting.popleft()
                for cell in near[here].tolist():
                    if cell >= 0 and how[cell] != _GIVEN and leads(done.q[here], cell):
                        waiting.append(cell)

    def _turned(self, angles: Array) -> Array:
        """Angles (n, k) of passive joints, by whole turns to where limits let them be, else to within half a turn of
        home: how often a loop has gone round on its way makes no difference."""
        limits, home = self.spec.mechanism.limits, self.spec.mechanism.q_home[self._passive]
        about_home = home + (angles - home + np.pi) % (2.0 * np.pi) - np.pi
        low, high = limits.lower[self._passive], limits.upper[self._passive]
        with np.errstate(invalid="ignore"):
            within = np.where(np.isfinite(low), low + (angles - low + AT_LIMIT) % (2.0 * np.pi) - AT_LIMIT, about_home)
        allowed = (about_home >= low - AT_LIMIT) & (about_home <= high + AT_LIMIT)
        return np.where(allowed | (within > high + AT_LIMIT), about_home, within)

    def _modes(self, values: Array) -> NDArray[np.int32]:
        """(n,) how many assembly modes there are, as `assembly_modes` counts them: joint limits make no difference."""
        from cinegen.assembly import assembly_modes

        mechanism = self.spec.mechanism
        if not mechanism.loops:
            return np.ones(len(values), dtype=np.int32)
        return np.array([len(assembly_modes(mechanism, motors)) for motors in values], dtype=np.int32)
