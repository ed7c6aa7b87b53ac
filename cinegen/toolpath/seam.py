"""`Seam`: a tool path along a seam on a surface, at a distance and at angles to it, as a sensor.

Off-line programming of welding and inspection asks for such paths. The tool's z axis points at the seam, its x axis in
the direction of travel:

    travel    x
    normal   -z, from the surface to the tool
    across    y = z cross x, to the right of the direction of travel with the surface below

From there it is rotated about x by the work angle, then about y by the travel angle, then about z by the roll. The two
angles are those of AWS A3.0, Standard Welding Terms and Definitions. Work angle: between the normal and the plane of
the seam and the tool's axis; for a positive one the tool leans to the right. Travel angle: in that plane, between the
tool's axis and the perpendicular of the seam; a positive one is a push angle (the tool points in the direction of
travel), a negative one a drag angle (it points back). In all,

    axis towards the tool  -z = cos(travel) (cos(work) normal + sin(work) across) - sin(travel) tangent.

If a normal is not perpendicular to the seam, it is used as given, and the direction of travel is the component of the
seam's tangent perpendicular to it.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array, ArrayLike, Bools
from cinegen.sensor import Reading, SensorError, TimedSensor
from cinegen.toolpath.curve import PointError, smooth_runs
from raff2urdf.errors import did_you_mean
from raff2urdf.quantities import LENGTH, shown

AGAIN = ("stay", "back", "loop")
"""At the end: stay there; go back and forth; or return to the start along a straight line, and repeat."""

_MOST = 100_000  # points
_FAR = 1e6  # m
_NONE = 1e-9  # m: shorter segments are left out


class SpeedProfile(NamedTuple):
    """A motion from rest to rest with constant speed in between; neither speed nor acceleration jumps.

    The speed grows as 3 x^2 - 2 x^3 of the part x of the ramp. If the length is too short for it, the speed is lower.

    Attributes:
        length: m or rad, more than 0.
        speed: m/s or rad/s, more than 0.
        ramp: s from rest to full speed.
    """

    length: float
    speed: float
    ramp: float

    @property
    def top(self) -> float:
        """Greatest speed, m/s or rad/s."""
        return min(self.speed, self.length / self.ramp) if self.ramp > 0.0 else self.speed

    @property
    def duration(self) -> float:
        """Time from rest to rest, s."""
        return self.ramp + self.length / self.top

    def at(self, time: float) -> float:
        """Return the distance (m or rad) covered after a time (s)."""
        if time > 0.5 * self.duration:
            return self.length - self._covered(max(0.0, self.duration - time))
        return self._covered(max(0.0, time))

    def _covered(self, time: float) -> float:
        """Return the distance in the first half."""
        if time >= self.ramp:
            return self.top * (time - 0.5 * self.ramp)
        x = time / self.ramp
        return self.top * self.ramp * x * x * x * (1.0 - 0.5 * x)


class _Segment(NamedTuple):
    """A part of the path, from rest to rest."""

    profile: SpeedProfile
    pose: Callable[[float], pin.SE3]  # of the tool, by the distance along the segment
    begin: float  # m of the seam before it
    gain: float  # m of the seam for each m of the segment


class Seam(TimedSensor):
    """Guides a tool along a seam from the moment it is started, at constant speed, from rest to rest.

    At a corner (where the line through the points changes its direction by more than 30 degrees) and at an edge (a
    point that is given twice, with two normals) the tool stops, rotates about the seam's point, and continues.
    Everywhere else the seam is a smooth curve through its points, and the normal is interpolated at constant angular
    speed from each point to the next.

    Args:
        points: (n, 3) m, points of the seam in the world.
        normals: (n, 3) of the surface there, of any length but 0.
        distance: m, of the tool's origin from the seam along the tool's axis.
        work: work angle, rad, less than pi/2.
        travel: travel angle, rad, less than pi/2; a push angle is positive.
        speed: m/s, along the seam and along straight lines.
        roll: rad, rotation of the tool about its own axis: 0 has its x axis in the direction of travel.
        approach: m, additional distance along the tool's axis at the start and at the end.
        turning: rad/s, angular speed at corners and edges.
        ramp: s from rest to full speed.
        wait: s at the first pose, in which the robot gets there.
        again: one of `AGAIN`.
        url: its name.

    Attributes:
        length: of the seam, m.
        duration: from the first pose to the last, s, without the wait.

    Raises:
        SensorError: the seam is impossible; a `PointError` gives the point.
    """

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
            raise SensorError(f"unknown value '{again}' of again{did_you_mean(again, AGAIN)}")
        super().__init__(url)
        self._speed, self._turning, self._ramp, self._wait, self._again = speed, turning, ramp, wait, again
        x, y, z = np.eye(3)
        tilt = pin.exp3(work * x) @ pin.exp3(travel * y) @ pin.exp3(roll * z)
        self._tool = pin.SE3(tilt, -distance * tilt[:, 2])  # in the seam's frame
        self._curves = smooth_runs(*_checked(points, normals))
        self._begins = np.cumsum([0.0, *(curve.length for curve in self._curves)]).tolist()
        self.length: float = self._begins[-1]
        self._segments = self._path(approach)
        self.duration = sum(segment.profile.duration for segment in self._segments)
        if again == "loop":
            first, last = self._segments[0].pose(0.0), self._segments[-1].pose(self._segments[-1].profile.length)
            self._segments += self._straight(last, first, pin.SE3.Identity(), self.length, 0.0)
        self._times = np.cumsum([0.0, *(segment.profile.duration for segment in self._segments)]).tolist()

    def __repr__(self) -> str:
        return f"<Seam {self.url}, {shown(self.length, LENGTH)} in {self.duration:.1f} s>"

    # --- as a sensor ---------------------------------------------------------------------------------------------

    def reading_at(self, seconds: float) -> Reading:
        """Return the target at this moment."""
        self._count += 1
        return Reading(seconds, target=self.target(seconds))

    @property
    def progress(self) -> str:
        """Finished length of the seam."""
        segment, far = self._segment(self._now)
        done = segment.begin + segment.gain * far
        return f"{self.url}: {done:.3f} of {self.length:.3f} m"

    @property
    def ended(self) -> bool:
        """True when the last pose was reported, unless the seam is repeated."""
        return self._again == "stay" and self._now >= self._wait + self.duration

    # --- targets ------------------------------------------------------------------------------------------

    def target(self, time: float) -> pin.SE3:
        """Return the pose of the tool in the world, a time (s) after the start."""
        segment, far = self._segment(time)
        return segment.pose(far)

    def at(self, along: float) -> pin.SE3:
        """Return the pose of the tool in the world for a point of the seam.

        Args:
            along: m of the seam before that point, clipped to its length. At a corner, before the tool rotates.
        """
        i = min(max(bisect_right(self._begins, along) - 1, 0), len(self._curves) - 1)
        if i > 0 and along == self._begins[i]:
            i -= 1
        return self._on_curve(i, along - self._begins[i])

    def targets(self, step: float) -> list[pin.SE3]:
        """Return poses of the tool in the world from the seam's first point to its last, at equal distances.

        Args:
            step: m between two of them, at most.

        Raises:
            SensorError: the step is not more than 0.
        """
        if not 0.0 < step < math.inf:
            raise SensorError(f"a step along a seam must be more than 0 m, not {step}")
        count = max(1, math.ceil(self.length / step * (1.0 - 1e-12)))
        return [self.at(self.length * i / count) for i in range(count + 1)]

    def _segment(self, time: float) -> tuple[_Segment, float]:
        """Return the segment at a time (s) after the start, and the distance along it."""
        passed, whole = max(0.0, time - self._wait), self._times[-1]
        if self._again == "back":
            passed = whole - abs(whole - passed % (2.0 * whole))
        elif self._again == "loop":
            passed %= whole
        i = min(bisect_right(self._times, passed) - 1, len(self._segments) - 1)
        return self._segments[i], self._segments[i].profile.at(passed - self._times[i])

    def _frame(self, i: int, along: float) -> pin.SE3:
        """Return the seam's own frame on a curve, without distance and angles."""
        point, tangent, normal = self._curves[i].at(along)
        x = tangent - (tangent @ normal) * normal
        x /= math.sqrt(x @ x)
        (a, b, c), (d, e, f) = x, normal
        return pin.SE3(
            np.array([[a, b * f - c * e, -d], [b, c * d - a * f, -e], [c, a * e - b * d, -f]]),  # x, x cross n, -n
            point,
        )

    def _on_curve(self, i: int, along: float) -> pin.SE3:
        """Return the pose of the tool on a curve."""
        return self._frame(i, along) * self._tool

    def _path(self, approach: float) -> list[_Segment]:
        """Return the segments from the first pose to the last."""
        segments: list[_Segment] = []
        for i, curve in enumerate(self._curves):
            begin = self._begins[i]
            if i:
                before, after = self._frame(i - 1, self._curves[i - 1].length), self._frame(i, 0.0)
                segments += self._straight(before, after, self._tool, begin, begin)
            profile = SpeedProfile(curve.length, self._speed, self._ramp)
            segments.append(_Segment(profile, partial(self._on_curve, i), begin, 1.0))
        first, last, same = self.at(0.0), self.at(self.length), pin.SE3.Identity()
        away = pin.SE3(np.eye(3), np.array([0.0, 0.0, -approach]))
        before = self._straight(first * away, first, same, 0.0, 0.0)
        return [*before, *segments, *self._straight(last, last * away, same, self.length, self.length)]

    def _straight(self, start: pin.SE3, goal: pin.SE3, tool: pin.SE3, begin: float, end: float) -> list[_Segment]:
        """Return the motion between two poses that carry the tool, none if they are the same: the origin on a straight
        line, a rotation about one axis at the same time.

        Args:
            start: where it begins.
            goal: where it ends.
            tool: pose of the tool in these.
            begin: m of the seam before the motion.
            end: m of the seam after it.
        """
        rotation, step = pin.log3(start.rotation.T @ goal.rotation), goal.translation - start.translation
        # neither the speed nor the angular speed is exceeded
        length = float(max(np.linalg.norm(step), np.linalg.norm(rotation) * self._speed / self._turning))
        if length < _NONE:
            return []

        def pose(far: float) -> pin.SE3:
            part = far / length
            return pin.SE3(start.rotation @ pin.exp3(part * rotation), start.translation + part * step) * tool

        profile = SpeedProfile(length, self._speed, self._ramp)
        return [_Segment(profile, pose, begin, (end - begin) / length)]


def _checked(points: ArrayLike, normals: ArrayLike) -> tuple[Array, Array]:
    """Return points (n, 3) and unit normals (n, 3)."""
    try:
        xyz, axes = np.array(points, dtype=float), np.array(normals, dtype=float)
    except (TypeError, ValueError):
        raise SensorError("a seam's points and normals must be numbers, three for each") from None
    if xyz.ndim != 2 or xyz.shape[1] != 3 or xyz.shape != axes.shape:
        raise SensorError(f"a seam needs as many normals as points, three numbers each: {xyz.shape}, {axes.shape}")
    if len(xyz) > _MOST:
        raise SensorError(f"a seam of more than {_MOST} points")
    _raise_where(~np.isfinite(xyz).all(axis=1) | ~np.isfinite(axes).all(axis=1), "its numbers must be finite")
    _raise_where(np.abs(xyz).max(axis=1) > _FAR, f"it is more than {_FAR:.0e} m away")
    largest = np.abs(axes).max(axis=1)
    _raise_where(largest == 0.0, "its normal is 0 0 0: give a direction")
    axes /= largest[:, None]  # or squares overflow
    return xyz, axes / np.linalg.norm(axes, axis=1)[:, None]


def _raise_where(wrong: Bools, message: str) -> None:
    if wrong.any():
        raise PointError(int(np.argmax(wrong)), message)


def _check_numbers(**numbers: float) -> None:
    for name, value in numbers.items():
        try:
            finite = math.isfinite(value)
        except (TypeError, OverflowError):
            finite = False
        if not finite:
            raise SensorError(f"{name} must be a finite number, not {value}")
        if name in ("work", "travel") and not abs(value) < 0.5 * math.pi:
            raise SensorError(f"{name} must be between -90 and 90 degrees")
        if name in ("speed", "turning") and not value > 0.0:
            raise SensorError(f"{name} must be more than 0")
        if name in ("approach", "ramp", "wait") and not value >= 0.0:
            raise SensorError(f"{name} must be 0 or more")
