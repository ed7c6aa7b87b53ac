"""`Slice`: two coordinates of a mechanism vary while the others are fixed; the configuration of each point."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError, ClosureError
from cinegen.loops.motions import motions_of
from cinegen.model import Mechanism
from cinegen.singularities.branch import BranchTracker
from cinegen.singularities.crossing import of_end
from raff2urdf.closure import rank
from raff2urdf.errors import near_names

POSE = ("x", "y", "z", "rx", "ry", "rz")
"""Coordinates of a pose: metres, and roll, pitch and yaw in radians, R = Rz(rz) Ry(ry) Rx(rx)."""

_CLOSED = 1e-10  # rad or characteristic lengths
_ITERATIONS = 15


class SliceError(CinegenError):
    """A slice that can't be made; names the wrong coordinate, and those that exist."""


class Axis(NamedTuple):
    """A coordinate and its range, m or rad."""

    name: str
    low: float
    high: float


class Coordinates:
    """Coordinates of a node's pose, or the values of actuated joints, and the configurations that belong to them.

    Of a pose as many coordinates are given as are independent: a delta's rotations are not, and those of an arm with
    two joints follow from its position.

    Args:
        mechanism: with the node.
        names: coordinates that must be given, of `POSE` or all of `mechanism.actuated`.
        node: whose pose; the mechanism's end by default.

    Attributes:
        independent: the coordinates that are given everywhere, those asked for first.
        over_joints: whether they are actuated joints.
        home: values of all coordinates at home, m and rad.

    Raises:
        SliceError: coordinates that don't exist, that are mixed, or that can't be given independently.
        UnknownNameError: no such node.
    """

    def __init__(self, mechanism: Mechanism, names: Sequence[str], node: str | None = None) -> None:
        self.mechanism = mechanism
        self.node = mechanism.end if node is None else node
        self.over_joints = bool(names) and all(name in mechanism.actuated for name in names)
        self._check(names)
        if len(set(names)) < len(names):
            raise SliceError(f"{mechanism.name}: a coordinate is given twice: {', '.join(names)}")
        self.independent = tuple(mechanism.actuated) if self.over_joints else self._select(names)
        self.home = self.coordinates(mechanism.q_home)
        missing = [name for name in names if name not in self.independent]
        if missing:
            raise SliceError(
                f"{mechanism.name}: {', '.join(missing)} of {self.node} can't be given independently of "
                f"{', '.join(self.independent)}"
            )

    def _check(self, names: Iterable[str]) -> None:
        """Refuse names that are no coordinates here: of several, one that is none anywhere."""
        actuated = self.mechanism.actuated
        wrong = [name for name in names if name not in (actuated if self.over_joints else POSE)]
        if not wrong:
            return
        name = min(wrong, key=(*POSE, *actuated).__contains__)
        near = near_names(name, [*POSE, *actuated])
        hint = f" (did you mean '{near[0]}'?)" if near and near[0] != name else ""
        if name in self.mechanism.joints and name not in actuated:
            hint = " (this joint is not actuated)"
        choice = f"{', '.join(POSE)} (of {self.node}), or actuated joints alone: {', '.join(actuated)}"
        raise SliceError(f"{self.mechanism.name}: no coordinate '{name}' here{hint}: there are {choice}")

    def _select(self, names: Sequence[str]) -> tuple[str, ...]:
        """Return coordinates of the pose that can all be given, those asked for first."""
        mechanism, chosen = self.mechanism, list[str]()
        for name in (*names, *(name for name in POSE if name not in names)):
            tried = [*chosen, name]
            if max(rank(self.rates(q, tried)) for q in mechanism.structure.samples) == len(tried):
                chosen = tried
        return tuple(chosen)

    def rates(self, q: Array, names: list[str]) -> Array:
        """Return the derivatives of coordinates along the free motions, dimensionless."""
        rows = self._rows(q, self.mechanism.placement(q, self.node))[1][[POSE.index(name) for name in names]]
        return np.asarray(rows @ motions_of(self.mechanism.structure.system, q, self.mechanism.loop_rank))

    def coordinates(self, q: Array) -> dict[str, float]:
        """Return all coordinates at q (nq,), m and rad."""
        if self.over_joints:
            return {name: float(q[self.mechanism.q_index(name)]) for name in self.mechanism.actuated}
        placement = self.mechanism.placement(q, self.node)
        values = (*placement.translation, *pin.rpy.matrixToRpy(placement.rotation))
        return dict(zip(POSE, map(float, values), strict=True))

    def at(self, values: Mapping[str, float], q: Array) -> Array | None:
        """Return the configuration (nq,) for values of all independent coordinates, from q; None if none is found."""
        if not self.over_joints:
            return self._newton(values, q)
        try:
            return self.mechanism.close(self.mechanism.configuration(values, q), self.mechanism.actuated)
        except ClosureError:
            return None

    def from_home(self, coordinates: Mapping[str, float], steps: int = 40) -> Array | None:
        """Return the configuration (nq,) for some values, the others as at home, reached from home in small steps; None
        if the branch ends before.

        Raises:
            SliceError: a coordinate that doesn't exist.
        """
        self._check(coordinates)
        goal = {**{name: self.home[name] for name in self.independent}, **coordinates}
        q: Array | None = self.mechanism.q_home
        for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
            values = {name: self.home[name] + part * (value - self.home[name]) for name, value in goal.items()}
            q = self.at(values, q) if q is not None else None
        return q

    def _newton(self, values: Mapping[str, float], q: Array) -> Array | None:
        system = self.mechanism.structure.system
        rotation = pin.rpy.rpyToMatrix(*(values.get(name, self.home[name]) for name in POSE[3:]))
        target = pin.SE3(rotation, np.array([values.get(name, self.home[name]) for name in POSE[:3]]))
        chosen = [POSE.index(name) for name in self.independent]
        best = np.inf
        for _ in range(_ITERATIONS):
            error, rows = self._rows(q, target)
            loops, jacobian = system.evaluate(q)
            residual = np.concatenate([loops, error[chosen]])
            gap = np.abs(residual).max(initial=0.0)
            if gap < _CLOSED:
                return q
            if gap > 2.0 * best:  # Newton's method would be nearer: there is nothing here
                return None
            best = min(best, gap)
            step = np.linalg.lstsq(np.vstack([jacobian, rows[chosen]]), -residual, rcond=1e-9)[0]
            longest = np.abs(step).max(initial=0.0)
            if not math.isfinite(longest):
                return None
            q = system.integrate(q, step * min(1.0, 0.5 / max(longest, 1e-300)))
        return None

    def _rows(self, q: Array, target: pin.SE3) -> tuple[Array, Array]:
        """Return the error (6,) of the node's pose, along the world's axes and as a rotation vector in the target's,
        and its derivative (6, nv); dimensionless."""
        mechanism = self.mechanism
        placement = mechanism.placement(q, self.node)
        local = mechanism.jacobian(q, self.node) * mechanism.scale
        away = target.rotation.T @ placement.rotation
        error = np.concatenate([(placement.translation - target.translation) / mechanism.length, pin.log3(away)])
        rows = np.vstack([placement.rotation @ local[:3] / mechanism.length, pin.Jlog3(away) @ local[3:]])
        return error, rows


class Slice(Coordinates, BranchTracker):
    """Two coordinates vary, of a node's pose or two actuated joints; the others stay at home, or at given values.

    Args:
        mechanism: with the node.
        axes: two of `POSE` or two of `mechanism.actuated`.
        fixed: values of others, m and rad.
        node: whose pose; the mechanism's end by default.

    Attributes:
        axes: as given.

    Raises:
        SliceError: as of `Coordinates`; or an empty range.
        UnknownNameError: no such node.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        axes: tuple[Axis, Axis],
        fixed: Mapping[str, float] | None = None,
        node: str | None = None,
    ) -> None:
        self.axes, self._fixed = axes, dict(fixed or {})
        Coordinates.__init__(self, mechanism, [*(axis.name for axis in axes), *self._fixed], node)
        for axis in axes:
            if not (math.isfinite(axis.low) and math.isfinite(axis.high) and axis.low < axis.high):
                raise SliceError(
                    f"{axis.name} from {axis.low:g} to {axis.high:g} is no range: give the lower end first"
                )
        BranchTracker.__init__(self, mechanism, of_end(mechanism), self.over_joints)

    def start(self) -> tuple[float, float]:
        """Return home's two coordinates; if it is not on the slice, those of the nearest point."""
        nearest = [min(max(self.home[axis.name], axis.low), axis.high) for axis in self.axes]
        return nearest[0], nearest[1]

    def given(self, u: float, v: float) -> dict[str, float]:
        """Return all independent coordinates at a point of the slice."""
        values = {**self.home, **self._fixed, self.axes[0].name: u, self.axes[1].name: v}
        return {name: values[name] for name in self.independent}

    def configuration(self, values: Array, guess: Array) -> Array | None:
        """Return a configuration (nq,) near a guess (nq,) at a point (2,) of the slice; None if there is none near."""
        return self.at(self.given(*values.tolist()), guess)


def about_home(mechanism: Mechanism, name: str, node: str | None = None) -> Axis:
    """Return a coordinate's range about home: a characteristic length to both sides, or a quarter of a revolution,
    within an actuated joint's limits.

    Raises:
        SliceError: no such coordinate, or a joint that can't move.
        UnknownNameError: no such node.
    """
    home = Coordinates(mechanism, [name], node).home[name]
    is_length = name in POSE[:3] or (name in mechanism.joints and mechanism.is_prismatic(name))
    reach = mechanism.length if is_length else 0.5 * math.pi
    low, high = home - reach, home + reach
    if name in mechanism.actuated:
        low, high = max(low, mechanism.limits[name].lower), min(high, mechanism.limits[name].upper)
        if low == high:
            raise SliceError(f"{mechanism.name}: {name} can't move: its limits are equal. Name another")
    return Axis(name, low, high)
