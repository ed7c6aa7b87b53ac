"""A tool path as a sensor: along a seam on a surface, at a distance and at angles to it.

What off-line programming of welding and inspection asks for. The tool's z points at the seam, its x where it travels:

    travel    x
    normal   -z, from the surface to the tool
    across    y = z cross x, to the right when one travels with the surface below

From there it is turned about x by the work angle, then about y by the travel angle, then about z by the roll. The two
angles are those of AWS A3.0, Standard Welding Terms and Definitions. Work angle: between the normal and the plane of
the seam and the tool's axis; for a positive one the tool leans to the right. Travel angle: in that plane, between the
tool's axis and what is perpendicular to the seam; a positive one is a push angle (the tool points where it travels), a
negative one a drag angle (it points back). In all,

    axis towards the tool  -z = cos(travel) (cos(work) normal + sin(work) across) - sin(travel) tangent.

Where a normal that was given is not perpendicular to the seam, the normal counts, and the travel is the part of the
seam's tangent across it.
"""

from __future__ import annotations

import math
import time
from bisect import bisect_right
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from cinegen.sensor import Reading, SensorError, SensorState, SensorStatus
from cinegen.toolpath.curve import PointError, smooth_runs
from cinegen.toolpath.stretch import Stretch
from raff2urdf.errors import did_you_mean

Array = NDArray[np.float64]

AGAIN = ("stay", "back", "loop")
"""What comes behind the end: it stays there; goes back and forth; goes to the beginning through the air, and again."""

_MOST = 100_000  # points
_FAR = 1e6  # m
_NONE = 1e-9  # m or rad: a stretch that is shorter is none


class _Leg(NamedTuple):
    """A part of the way, from rest to rest."""

    stretch: Stretch
    place: Callable[[float], pin.SE3]  # of the tool, by how far it is along the stretch
    begin: float  # m of the seam behind it when it begins
    gain: float  # m of the seam for each m of the stretch


class Seam:
    """Leads a tool along a seam from the moment it is started, at constant speed, from rest to rest.

    At a corner (where the line through the points bends by more than 30 degrees) and at an edge (a point that stands
    twice, with two normals) the tool stops, turns about the seam's point, and goes on. Everywhere else the seam is a
    smooth curve through its points, and the normal turns evenly from each point to the next.

    Args:
        points: (n, 3) of the seam, in the world, m.
        normals: (n, 3) of the surface there, of any length but 0.
        distance: of the tool's origin from the seam, along the tool's axis, m.
        work: work angle, rad, less than a quarter of a turn.
        travel: travel angle, rad, less than a quarter of a turn; a push angle is positive.
        speed: along the seam, and wherever else the tool goes straight, m/s.
        roll: how the tool is turned about its own axis, rad: 0 has its x where it travels.
        approach: how much further off the tool begins and ends, along its axis, m.
        turning: how fast it turns at corners and edges, rad/s.
        ramp: s from rest to full speed.
        wait: s that it stays at its first place: the node must come there from where it is.
        again: one of `AGAIN`.
        url: what it is called.

    Attributes:
        length: of the seam, m.
        duration: from the first place to the last, s, without the wait.

    Raises:
        SensorError: there is no such seam; a `PointError` says at which point.
    """

    timeout = math.inf

    def __init__(
        self,
        points: ArrayLike,
        normals: ArrayLike,
        distance: float = 0.0,
        work: float = 0.0,
        travel: float = 0.0,
        speed: float = 0.02,
        *,
        roll: float = 0.0,
        approach: float = 0.0,
        turning: float = math.radians(45.0),
        ramp: float = 0.25,
        wait: float = 1.0,
        again: str = "stay",
        url: str = "seam:",
    ) -> None:
        _check_numbers(
            distance=distance, work=work, travel=travel, speed=speed, roll=roll, approach=approach, turning=turning,
            ramp=ramp, wait=wait,
        )  # fmt: skip
        if again not in AGAIN:
            raise SensorError(f"again: no '{again}'{did_you_mean(again, AGAIN)}")
        self.url = url
        self._speed, self._turning, self._ramp, self._wait, self._again = speed, turning, ramp, wait, again
        tilt = _turn(0, work) @ _turn(1, travel) @ _turn(2, roll)
        self._tool = pin.SE3(tilt, -distance * tilt[:, 2])  # as seen from the seam's frame
        self._curves = smooth_runs(*_checked(points, normals))
        self._begins = np.cumsum([0.0, *(curve.length for curve in self._curves)]).tolist()
        self.length: float = self._begins[-1]
        self._legs = self._way(approach)
        self.duration = sum(leg.stretch.duration for leg in self._legs)
        if again == "loop":
            self._legs += self._home()
        self._times = np.cumsum([0.0, *(leg.stretch.duration for leg in self._legs)]).tolist()
        self._begin: float | None = None
        self._now = 0.0  # s since it was started, at the last reading
        self._ended = False
        self._count = 0

    def __repr__(self) -> str:
        return f"<Seam {self.url}, {1000.0 * self.length:.0f} mm in {self.duration:.1f} s>"

    # --- of a sensor ---------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Begins to count the time, once."""
        if self._begin is None:
            self._now, self._ended, self._count = 0.0, False, 0
            self._begin = time.monotonic()

    def read(self) -> Reading | None:
        """Where the node should be at this moment: always new, until it has said its end."""
        if self._begin is None or self._ended:
            return None
        now = time.monotonic()
        self._now = now - self._begin
        self._count += 1
        self._ended = self._again == "stay" and self._now >= self._wait + self.duration
        return Reading(now, target=self.target(self._now))

    @property
    def status(self) -> SensorStatus:
        """Live until its end, with how much of the seam is behind it."""
        if self._begin is None:
            return SensorStatus(SensorState.CLOSED, f"{self.url} is not started")
        if self._ended:
            return SensorStatus(SensorState.CLOSED, f"{self.url} is at its end", self._count)
        leg, far = self._leg(self._now)
        behind = 1000.0 * (leg.begin + leg.gain * far)
        return SensorStatus(SensorState.LIVE, f"{self.url}: {behind:.0f} of {1000.0 * self.length:.0f} mm", self._count)

    def close(self) -> None:
        """Ends; when it is started again, it begins at its beginning."""
        self._begin = None

    # --- where it leads ------------------------------------------------------------------------------------------

    def target(self, since: float) -> pin.SE3:
        """Where the tool should be so many seconds after the start."""
        leg, far = self._leg(since)
        return leg.place(far)

    def at(self, along: float) -> pin.SE3:
        """Where the tool should be for a point of the seam.

        Args:
            along: m of the seam behind that point, cut to its length. At a corner, as the tool comes there.
        """
        i = min(max(bisect_right(self._begins, along) - 1, 0), len(self._curves) - 1)
        if i > 0 and along == self._begins[i]:
            i -= 1
        return self._frame(i, along - self._begins[i]) * self._tool

    def targets(self, step: float) -> list[pin.SE3]:
        """Where the tool should be, from the seam's first point to its last, at equal distances along it.

        Args:
            step: between two of them, m, at most.

        Raises:
            SensorError: the step is not more than 0.
        """
        if not 0.0 < step < math.inf:
            raise SensorError(f"a step along a seam must be more than 0 m, not {step}")
        count = max(1, math.ceil(self.length / step * (1.0 - 1e-12)))
        return [self.at(self.length * i / count) for i in range(count + 1)]

    def _leg(self, since: float) -> tuple[_Leg, float]:
        """On which leg it is so many seconds after the start, and how far along that."""
        passed, whole = max(0.0, since - self._wait), self._times[-1]
        if self._again == "back":
            passed = whole - abs(whole - passed % (2.0 * whole))
        elif self._again == "loop":
            passed %= whole
        i = min(bisect_right(self._times, passed) - 1, len(self._legs) - 1)
        return self._legs[i], self._legs[i].stretch.at(passed - self._times[i])

    def _frame(self, i: int, along: float) -> pin.SE3:
        """The seam's own frame on a curve, without distance and angles."""
        point, tangent, normal = self._curves[i].at(along)
        x = tangent - (tangent @ normal) * normal
        x /= math.sqrt(x @ x)
        (a, b, c), (d, e, f) = x, normal
        return pin.SE3(
            np.array([[a, b * f - c * e, -d], [b, c * d - a * f, -e], [c, a * e - b * d, -f]]),  # x, x cross n, -n
            point,
        )

    def _along(self, i: int) -> _Leg:
        """The leg on a curve."""
        curve = self._curves[i]
        stretch = Stretch(curve.length, self._speed, self._ramp)
        return _Leg(stretch, lambda far: self._frame(i, far) * self._tool, self._begins[i], 1.0)

    def _turned(self, i: int) -> list[_Leg]:
        """The leg on which the tool turns about the seam's point before a curve; none where it need not."""
        first, last = self._frame(i - 1, self._curves[i - 1].length), self._frame(i, 0.0)
        angle = float(np.linalg.norm(pin.log3(first.rotation.T @ last.rotation)))
        if angle < _NONE:
            return []
        way = _straight(first, last)
        stretch = Stretch(angle, self._turning, self._ramp)
        return [_Leg(stretch, lambda far: way(far / angle) * self._tool, self._begins[i], 0.0)]

    def _way(self, approach: float) -> list[_Leg]:
        """From the first place to the last."""
        legs = [self._along(0)]
        for i in range(1, len(self._curves)):
            legs += [*self._turned(i), self._along(i)]
        if approach < _NONE:
            return legs
        off = Stretch(approach, self._speed, self._ramp)
        first, last = self.at(0.0), self.at(self.length)
        near = _Leg(off, lambda far: first * _back(approach - far), 0.0, 0.0)
        return [near, *legs, _Leg(off, lambda far: last * _back(far), self.length, 0.0)]

    def _home(self) -> list[_Leg]:
        """From the last place to the first, through the air; nothing where they are the same."""
        first, last = self._legs[-1], self._legs[0]
        here, there = first.place(first.stretch.length), last.place(0.0)
        turn = float(np.linalg.norm(pin.log3(here.rotation.T @ there.rotation)))
        far = float(np.linalg.norm(there.translation - here.translation))
        length = max(far, turn * self._speed / self._turning)  # turns no faster than it may, either
        if length < _NONE:
            return []
        way = _straight(here, there)
        stretch = Stretch(length, self._speed, self._ramp)
        return [_Leg(stretch, lambda far: way(far / length), self.length, -self.length / length)]


def _straight(first: pin.SE3, last: pin.SE3) -> Callable[[float], pin.SE3]:
    """From one place to another, by a part from 0 to 1: the origin straight, the turn about one axis."""
    turn = pin.log3(first.rotation.T @ last.rotation)
    step = last.translation - first.translation
    return lambda part: pin.SE3(first.rotation @ pin.exp3(part * turn), first.translation + part * step)


def _back(far: float) -> pin.SE3:
    """Off the work along the tool's own axis, m."""
    return pin.SE3(np.eye(3), np.array([0.0, 0.0, -far]))


def _turn(axis: int, angle: float) -> Array:
    """About x, y or z, (3, 3)."""
    return np.asarray(pin.exp3(angle * np.eye(3)[axis]))


def _checked(points: ArrayLike, normals: ArrayLike) -> tuple[Array, Array]:
    """Points (n, 3) and normals (n, 3) of length 1."""
    try:
        found, given = np.array(points, dtype=float), np.array(normals, dtype=float)
    except (TypeError, ValueError):
        raise SensorError("a seam's points and normals must be numbers, three each") from None
    if found.ndim != 2 or found.shape[1] != 3 or found.shape != given.shape:
        raise SensorError(f"a seam needs as many normals as points, three numbers each: {found.shape}, {given.shape}")
    if len(found) > _MOST:
        raise SensorError(f"a seam of more than {_MOST} points")
    _raise_where(~np.isfinite(found).all(axis=1) | ~np.isfinite(given).all(axis=1), "its numbers must be finite")
    _raise_where(np.abs(found).max(axis=1) > _FAR, f"it is more than {_FAR:.0e} m away")
    largest = np.abs(given).max(axis=1)
    _raise_where(largest == 0.0, "its normal is 0 0 0, which points nowhere")
    given /= largest[:, None]  # or squares overflow
    return found, given / np.linalg.norm(given, axis=1)[:, None]


def _raise_where(wrong: NDArray[np.bool_], message: str) -> None:
    if wrong.any():
        raise PointError(int(np.argmax(wrong)), message)


def _check_numbers(**numbers: float) -> None:
    for name, value in numbers.items():
        try:
            finite = math.isfinite(value)
        except (TypeError, OverflowError):
            finite = False
        if not finite:
            raise SensorError(f"{name} must be a number, not {value}")
        if name in ("work", "travel") and not abs(value) < 0.5 * math.pi:
            raise SensorError(f"{name} must be less than 90 degrees to either side")
        if name in ("speed", "turning") and not value > 0.0:
            raise SensorError(f"{name} must be more than 0")
        if name in ("approach", "ramp", "wait") and not value >= 0.0:
            raise SensorError(f"{name} must be 0 or more")
