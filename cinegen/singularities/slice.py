"""`Slice`: two coordinates of a mechanism vary while the others stay; the configuration that belongs to each point."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.errors import CinegenError, ClosureError
from cinegen.ik.resolve import free_motions
from cinegen.model import Mechanism
from raff2urdf.closure import rank

Array = NDArray[np.float64]

POSE = ("x", "y", "z", "rx", "ry", "rz")
"""Coordinates of a pose: metres, and roll, pitch and yaw in radians, R = Rz(rz) Ry(ry) Rx(rx)."""

_CLOSED = 1e-10  # rad or characteristic lengths
_ITERATIONS = 15
_THERE = 1e-7  # rad or characteristic lengths: a configuration that far from its point is another's
_JUMP = 0.7  # rad or characteristic lengths: a neighbour that is further away is on another branch


class SliceError(CinegenError):
    """A slice that can't be made: says which coordinate is wrong, and which there are."""


class Axis(NamedTuple):
    """A coordinate and how far it goes, m or rad."""

    name: str
    low: float
    high: float


class Coordinates:
    """Coordinates of a node's pose, or the values of motors, and the configurations that belong to them.

    Of a pose as many coordinates are held as can be held: a delta's rotations follow from nothing, and those of an arm
    with two joints from where it is.

    Args:
        mechanism: which.
        names: those that must be held, of `POSE` or all of `mechanism.actuated`.
        node: whose pose; the mechanism's end unless said.

    Attributes:
        held: the coordinates that are given everywhere, those asked for first.
        home: where they are at home, and all others too, m and rad.

    Raises:
        SliceError: coordinates that there are not, that are mixed, or that can't be given independently.
        UnknownNameError: no such node.
    """

    def __init__(self, mechanism: Mechanism, names: Sequence[str], node: str | None = None) -> None:
        self.mechanism = mechanism
        self.node = mechanism.end if node is None else node
        self.of_motors = bool(names) and all(name in mechanism.actuated for name in names)
        self._check(names)
        if len(set(names)) < len(names):
            raise SliceError(f"{mechanism.name}: a coordinate is given twice: {', '.join(names)}")
        self.held = tuple(mechanism.actuated) if self.of_motors else self._independent(names)
        self.home = self.coordinates(mechanism.q_home)
        missing = [name for name in names if name not in self.held]
        if missing:
            raise SliceError(
                f"{mechanism.name}: {', '.join(missing)} of {self.node} can't be given independently of "
                f"{', '.join(self.held)}"
            )

    def _check(self, names: Iterable[str]) -> None:
        """Refuse names that are no coordinates here: of several, one that is none anywhere."""
        actuated = self.mechanism.actuated
        wrong = [name for name in names if name not in (actuated if self.of_motors else POSE)]
        if not wrong:
            return
        name = min(wrong, key=(*POSE, *actuated).__contains__)
        near = difflib.get_close_matches(name, [*POSE, *actuated], n=1)
        hint = f" (did you mean '{near[0]}'?)" if near and near[0] != name else ""
        if name in self.mechanism.joints and name not in actuated:
            hint = " (this joint is not actuated)"
        choice = f"{', '.join(POSE)} (of {self.node}), or motors alone: {', '.join(actuated)}"
        raise SliceError(f"{self.mechanism.name}: no coordinate '{name}' here{hint}: there are {choice}")

    def _independent(self, names: Sequence[str]) -> tuple[str, ...]:
        """Coordinates that can all be given, those asked for first."""
        mechanism, held = self.mechanism, list[str]()
        for name in (*names, *(name for name in POSE if name not in names)):
            tried = [*held, name]
            if max(rank(self._moved(q, tried)) for q in mechanism.samples) == len(tried):
                held = tried
        return tuple(held)

    def _moved(self, q: Array, names: list[str]) -> Array:
        """How the free motions change coordinates, without unit."""
        rows = self._rows(q, self.mechanism.placement(q, self.node))[1][[POSE.index(name) for name in names]]
        loops = self.mechanism.system.evaluate(q)[1]
        return np.asarray(rows @ free_motions(loops, self.mechanism.loop_rank)[0])

    def coordinates(self, q: Array) -> dict[str, float]:
        """All coordinates at q (nq,), m and rad."""
        if self.of_motors:
            return {name: float(q[self.mechanism.q_index(name)]) for name in self.mechanism.actuated}
        placement = self.mechanism.placement(q, self.node)
        values = (*placement.translation, *pin.rpy.matrixToRpy(placement.rotation))
        return dict(zip(POSE, map(float, values), strict=True))

    def at(self, given: Mapping[str, float], q: Array) -> Array | None:
        """The configuration (nq,) for values of all coordinates that are held, from q; None where none is found."""
        if not self.of_motors:
            return self._newton(given, q)
        try:
            return self.mechanism.close(self.mechanism.configuration(given, q), self.mechanism.actuated)
        except ClosureError:
            return None

    def led(self, given: Mapping[str, float], steps: int = 40) -> Array | None:
        """The configuration (nq,) for some values, the others as at home, led from home in small steps; None where the
        branch ends before.

        Raises:
            SliceError: a value of a coordinate that there is not.
        """
        self._check(given)
        goal = {**{name: self.home[name] for name in self.held}, **given}
        q: Array | None = self.mechanism.q_home
        for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
            values = {name: self.home[name] + part * (value - self.home[name]) for name, value in goal.items()}
            q = self.at(values, q) if q is not None else None
        return q

    def _newton(self, given: Mapping[str, float], q: Array) -> Array | None:
        system = self.mechanism.system
        rotation = pin.rpy.rpyToMatrix(*(given.get(name, self.home[name]) for name in POSE[3:]))
        target = pin.SE3(rotation, np.array([given.get(name, self.home[name]) for name in POSE[:3]]))
        chosen = [POSE.index(name) for name in self.held]
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
        """How far the node is from a target (6,), along the world's axes and as a rotation vector in the target's; and
        its derivative (6, nv); without unit."""
        mechanism = self.mechanism
        placement = mechanism.placement(q, self.node)
        local = mechanism.jacobian(q, self.node) * mechanism.scale
        away = target.rotation.T @ placement.rotation
        error = np.concatenate([(placement.translation - target.translation) / mechanism.length, pin.log3(away)])
        rows = np.vstack([placement.rotation @ local[:3] / mechanism.length, pin.Jlog3(away) @ local[3:]])
        return error, rows


class Slice(Coordinates):
    """Two coordinates vary, of a node's pose or of the motors; the others stay where home, or the caller, has them.

    Args:
        mechanism: which.
        axes: the two, two of `POSE` or two of `mechanism.actuated`.
        fixed: values of others, m and rad.
        node: whose pose; the mechanism's end unless said.

    Attributes:
        axes: as given.

    Raises:
        SliceError: as of `Coordinates`; or an axis that goes nowhere.
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
        super().__init__(mechanism, [*(axis.name for axis in axes), *self._fixed], node)
        for axis in axes:
            if not (math.isfinite(axis.low) and math.isfinite(axis.high) and axis.low < axis.high):
                raise SliceError(
                    f"{axis.name} from {axis.low:g} to {axis.high:g} is no range: give the lower end first"
                )

    def start(self) -> tuple[float, float]:
        """Where home is on the two axes; the nearest point of the slice where it is not on it."""
        here = [min(max(self.home[axis.name], axis.low), axis.high) for axis in self.axes]
        return here[0], here[1]

    def given(self, u: float, v: float) -> dict[str, float]:
        """All coordinates that are held at a point of the slice."""
        values = {**self.home, **self._fixed, self.axes[0].name: u, self.axes[1].name: v}
        return {name: values[name] for name in self.held}

    def configuration(self, u: float, v: float, q: Array, jump: float = _JUMP) -> Array | None:
        """The configuration (nq,) at a point of the slice on the branch of q; None where there is none near.

        Args:
            u: the first axis, m or rad.
            v: the second.
            q: (nq,) of a point near it.
            jump: how far joints may be from q, rad or characteristic lengths.
        """
        found = self.at(self.given(u, v), q)
        if found is None:
            return None
        mechanism = self.mechanism
        passive = np.ones(mechanism.model.nv, dtype=bool)
        if self.of_motors:
            passive[[mechanism.v_index(name) for name in mechanism.actuated]] = False
        away = np.abs(mechanism.scaled_difference(q, found))[passive]
        return found if away.max(initial=0.0) <= jump else None

    def is_at(self, u: float, v: float, q: Array) -> bool:
        """Whether q (nq,) is a configuration of a point of the slice."""
        here = self.coordinates(q)
        away = max(abs(here[axis.name] - value) for axis, value in zip(self.axes, (u, v), strict=True))
        return away <= _THERE * max(self.mechanism.length, 1.0)


def about_home(mechanism: Mechanism, name: str, node: str | None = None) -> Axis:
    """A coordinate's range about home: a characteristic length to both sides, or a quarter of a turn; a motor's limits.

    Raises:
        SliceError: no such coordinate.
        UnknownNameError: no such node.
    """
    home = Coordinates(mechanism, [name], node).home[name]
    slides = name in POSE[:3] or (name in mechanism.joints and mechanism.is_prismatic(name))
    reach = mechanism.length if slides else 0.5 * math.pi
    low, high = home - reach, home + reach
    if name in mechanism.actuated:
        low, high = max(low, mechanism.limits[name].lower), min(high, mechanism.limits[name].upper)
    return Axis(name, low, high)
