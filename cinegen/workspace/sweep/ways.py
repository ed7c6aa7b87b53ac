"""`Ways`: how a mechanism goes straight from one point of a region to another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.errors import ClosureError
from cinegen.ik.seeker import Seeker
from cinegen.ik.task import FrameTask
from cinegen.tolerances import AT_LIMIT
from cinegen.workspace.specification import MapSpecification

Array = NDArray[np.float64]

JUMP = 0.7
"""rad or lengths: a joint that goes further in one step may have changed its branch."""

_GOAL = 1e-10  # rad or lengths that may be left
_SAME = 1e-4  # rad or lengths
_STEPS = (1, 4, 16)  # a way is gone in as few as will do


class Ways:
    """Between points of a specification's region.

    Args:
        specification: which.
        values: (n, axes) coordinates of the points, m or rad; a point is named by its number.
    """

    def __init__(self, spec: MapSpecification, values: Array) -> None:
        mechanism = self._mechanism = spec.mechanism
        self._turning = np.zeros(mechanism.model.nv, dtype=bool)
        for name in mechanism.joints:
            if not mechanism.is_prismatic(name):
                limited = spec.limits and np.isfinite(mechanism.limits[name].lower)
                self._turning[mechanism.v_index(name)] = not limited
        self._rounding = AT_LIMIT if spec.limits else np.inf
        if spec.of_motors:
            self._motors = spec.region.motors_at(mechanism, values)
            self._at = self._closed
        else:
            self._points, self._rotations = spec.region.poses_at(spec.home, values)
            task = FrameTask(spec.node, pin.SE3.Identity(), 3, spec.rotation)
            self._seeker = Seeker(spec.mechanism, (task,), spec.limits)
            self._at = self._posed

    def away(self, q: Array, other: Array) -> float:
        """How far the joint that is farthest goes between two configurations (nq,), rad or lengths."""
        return self._mechanism.distance(q, other)

    def same(self, q: Array, other: Array) -> bool:
        """Whether two configurations (nq,) are one, whole turns of joints without limits apart."""
        gaps = self._mechanism.scaled_difference(q, other)
        gaps[self._turning] = (gaps[self._turning] + np.pi) % (2.0 * np.pi) - np.pi
        return bool(np.abs(gaps).max(initial=0.0) <= _SAME)

    def onward(self, q: Array, one: int, other: int, regular: Callable[[Array, Array], bool]) -> Array | None:
        """The configuration (nq,) at another point, led there from q at one; None where the branch ends before.

        Args:
            q: (nq,).
            one: the point of q.
            other: to which.
            regular: whether a step between two configurations stays on its branch.
        """
        for steps in _STEPS:
            there = q
            for x in np.linspace(0.0, 1.0, steps + 1)[1:]:
                found = self._at(one, other, float(x), there)
                if found is None or self.away(there, found) > JUMP or not regular(there, found):
                    break
                there = found
            else:
                return there
        return None

    def between(self, one: int, q: Array, other: int, end: Array) -> Callable[[float], Array]:
        """From q (nq,) at one point to the end (nq,) at another: the configuration at a part of the way, 0 to 1."""

        def way(x: float) -> Array:
            if x in (0.0, 1.0):
                return end if x else q
            guess = self._mechanism.interpolate(q, end, x)
            found = self._at(one, other, x, guess)
            return found if found is not None else q if x < 0.5 else end

        return way

    # --- one place -----------------------------------------------------------------------------------------------

    def _posed(self, one: int, other: int, x: float, guess: Array) -> Array | None:
        a, b = (self._rotations[point if len(self._rotations) > 1 else 0] for point in (one, other))
        rotation = a if a is b or x == 0.0 else b if x == 1.0 else a @ pin.exp3(x * pin.log3(a.T @ b))
        place = self._points[one] + x * (self._points[other] - self._points[one])
        self._seeker.tasks[0].target = pin.SE3(rotation, place)
        return self._seeker.best if self._seeker.seek(guess, _GOAL) else None

    def _closed(self, one: int, other: int, x: float, guess: Array) -> Array | None:
        mechanism = self._mechanism
        values = self._motors[one] + x * (self._motors[other] - self._motors[one])
        try:
            q = mechanism.configuration(dict(zip(mechanism.actuated, values, strict=True)), guess)
            found = np.asarray(mechanism.close(q, mechanism.actuated))
        except ClosureError:
            return None
        return found if mechanism.limits.within(found, self._rounding) else None
