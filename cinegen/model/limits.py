"""Limits of joints: position, velocity and effort."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, Bools
from cinegen.joints import translations
from cinegen.tolerances import AT_LIMIT
from raff2urdf.errors import counted, did_you_mean


class JointLimits(NamedTuple):
    """Limits of a joint; infinite where it has none.

    Attributes:
        lower: least position, rad or m.
        upper: greatest position, rad or m.
        velocity: greatest speed, rad/s or m/s.
        effort: greatest torque or force, N m or N.
    """

    lower: float
    upper: float
    velocity: float
    effort: float


class Limits(Mapping[str, JointLimits]):
    """The limits of a mechanism's joints by name, and as arrays that must not be changed.

    Args:
        model: with its limits set.
        joints: names of the joints that move, each of one number.

    Attributes:
        lower: (nq,) least positions, rad and m; -inf where there is none, and for a free base.
        upper: (nq,) greatest positions, rad and m; inf likewise.
        velocity: (nv,) greatest speeds, rad/s and m/s; inf likewise.
        effort: (nv,) greatest torques and forces, N m and N; inf likewise.
    """

    def __init__(self, model: pin.Model, joints: Sequence[str]) -> None:
        self.lower, self.upper = _fixed(model.lowerPositionLimit), _fixed(model.upperPositionLimit)
        self.velocity, self.effort = _fixed(model.upperVelocityLimit), _fixed(model.upperEffortLimit)
        by_name = {name: model.joints[model.getJointId(name)] for name in joints}
        self._index = {name: (int(joint.idx_q), int(joint.idx_v)) for name, joint in by_name.items()}
        limited = np.isfinite(self.lower) & np.isfinite(self.upper)
        revolute = [j.idx_q for j in by_name.values() if not translations(j) and limited[j.idx_q]]
        self._revolute = np.array(revolute, dtype=np.intp)  # with two limits
        self._middle = (self.lower[self._revolute] + self.upper[self._revolute]) / 2.0

    def __getitem__(self, joint: str) -> JointLimits:
        if joint not in self._index:
            raise KeyError(f"no joint '{joint}'{did_you_mean(str(joint), tuple(self._index))}")
        i, j = self._index[joint]
        values = self.lower[i], self.upper[i], self.velocity[j], self.effort[j]
        return JointLimits(*map(float, values))

    def __iter__(self) -> Iterator[str]:
        return iter(self._index)

    def __len__(self) -> int:
        return len(self._index)

    def __repr__(self) -> str:
        return f"<Limits of {counted(len(self), 'joint')}>"

    def within(self, q: Array, rounding: float = AT_LIMIT) -> Bools:
        """Return whether no joint of q (..., nq) is beyond its limits by more than `rounding` (rad, m); shape (...)."""
        return np.asarray(((q >= self.lower - rounding) & (q <= self.upper + rounding)).all(axis=-1))

    def exceeded(self, q: Array, rounding: float = 0.0) -> dict[str, float]:
        """Return the joints of q (nq,) beyond a limit by more than `rounding`, each with that limit; rad and m."""
        below, above = q < self.lower - rounding, q > self.upper + rounding
        bounds = np.where(below, self.lower, self.upper)
        return {name: float(bounds[i]) for name, (i, _) in self._index.items() if below[i] or above[i]}

    def unwound(self, q: Array) -> Array:
        """Return q (nq,) with whole revolutions taken from each revolute joint that has two limits, so that it is as
        near to the middle between them as it can be."""
        unwound = np.array(q, dtype=float)
        unwound[self._revolute] -= 2.0 * np.pi * np.rint((unwound[self._revolute] - self._middle) / (2.0 * np.pi))
        return unwound

    def outside(self, q: Array) -> dict[str, float]:
        """Return the joints of q (nq,) that no whole revolutions bring within their limits, as `exceeded` does."""
        return self.exceeded(self.unwound(q), AT_LIMIT)


def _fixed(values: Array) -> Array:
    fixed = np.array(values, dtype=float)
    fixed.flags.writeable = False
    return fixed
