"""`ByMotors`: the configurations of cells that say what the motors do, loops closed from cell to cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cinegen.solve.sample import Evaluations, Sampler
from cinegen.study.maps.settled import How, Settled
from cinegen.study.maps.survey import Survey

_BEYOND = 1e-9  # rad or m that a joint may be beyond its limit


class ByMotors:
    """For one survey; used for piece after piece.

    Args:
        survey: over motors.
        sampler: of its mechanism and node.
    """

    def __init__(self, survey: Survey, sampler: Sampler) -> None:
        self.survey, self._sampler = survey, sampler
        mechanism = survey.mechanism
        names = [name for name in mechanism.joints if name not in mechanism.actuated and not mechanism.slides(name)]
        self._passive = np.array([mechanism.q_index(name) for name in names], dtype=np.intp)

    def settle(self, piece: tuple[slice, ...]) -> tuple[Settled, Evaluations]:
        """All cells of a piece of the survey's region, to and fro, so that each is next to the one before."""
        values = self.survey.region.motors(self.survey.mechanism, piece)
        if self.survey.mechanism.loops:
            order = to_and_fro([len(range(*s.indices(s.stop))) for s in piece])
            there = self._sampler.led(np.ascontiguousarray(values[order]))
            back = np.empty_like(order)
            back[order] = np.arange(len(order))
            done = Evaluations(*(getattr(there, name)[back] for name in there.__dataclass_fields__))
        else:
            done = self._sampler.led(values)
        done.q[:, self._passive] = self._turned(done.q[:, self._passive])
        how = np.where(np.isfinite(done.closure), How.GIVEN, How.OPEN).astype(np.uint8)
        if self.survey.limits:
            model = self.survey.mechanism.model
            low, high = model.lowerPositionLimit - _BEYOND, model.upperPositionLimit + _BEYOND
            how[((done.q < low) | (done.q > high)).any(axis=1)] = How.BEYOND
        q = done.q
        if not (how == How.GIVEN).all():
            q = np.where((how == How.GIVEN)[:, None], q, np.nan)
        return Settled(q, how, self._modes(values) if "solutions" in self.survey.quantities else None), done

    def _turned(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """Angles (n, k) of passive joints, by whole turns to where limits let them be, else to within half a turn of
        home: how often a loop has gone round on its way makes no difference."""
        model, home = self.survey.mechanism.model, self.survey.mechanism.q_home[self._passive]
        about_home = home + (angles - home + np.pi) % (2.0 * np.pi) - np.pi
        low, high = model.lowerPositionLimit[self._passive], model.upperPositionLimit[self._passive]
        with np.errstate(invalid="ignore"):
            within = np.where(np.isfinite(low), low + (angles - low + _BEYOND) % (2.0 * np.pi) - _BEYOND, about_home)
        allowed = (about_home >= low - _BEYOND) & (about_home <= high + _BEYOND)
        return np.where(allowed | (within > high + _BEYOND), about_home, within)

    def _modes(self, values: NDArray[np.float64]) -> NDArray[np.int32]:
        """(n,) how many assembly modes there are, as `assembly_modes` counts them: joint limits make no difference."""
        from cinegen.study.modes import assembly_modes

        mechanism = self.survey.mechanism
        if not mechanism.loops:
            return np.ones(len(values), dtype=np.int32)
        return np.array([len(assembly_modes(mechanism, motors)) for motors in values], dtype=np.int32)


def to_and_fro(shape: list[int]) -> NDArray[np.intp]:
    """Numbers of a grid's cells, each next to the one before: every other line goes backwards."""
    order = np.zeros((1,), dtype=np.intp)
    for count in shape:
        grown = order[:, None] * count + np.arange(count)
        grown[1::2] = grown[1::2, ::-1]
        order = grown.ravel()
    return order
