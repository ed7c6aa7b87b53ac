"""Numbers that only fit in another unit: mm typed for m, radians for degrees or the reverse.

A number that is typed is refused only if it can't be meant: it lies far beyond what the mechanism can do, and would fit
if it were 1000 or 57.3 times smaller. Such a number of a robot's own file is a warning (`doubts`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from cinegen.arrays import Array, Indices
from cinegen.errors import CinegenError
from cinegen.joints import translations
from cinegen.model.masses import stated
from cinegen.model.mechanism import Mechanism
from raff2urdf.quantities import ANGLE, LENGTH, shown

FAR = 10.0
"""A length beyond this multiple of the reach can't be meant."""

LONG = 50.0
"""Joints that are farther apart, m, are probably in mm."""

TURNS = 720.0
"""Greatest limit, rad, that may be one in degrees."""

FAR_TARGET = 100.0
"""The same for a target in a program, which may mean a direction by it."""


class ImplausibleError(CinegenError):
    """A number that would fit if it were 1000 or 57.3 times smaller: it was probably meant in another unit."""


def reach(mechanism: Mechanism) -> float:
    """Return a bound of the distance between the world's origin and any node, m.

    It is the longest sum of distances between successive joints and frames, with the strokes of prismatic joints; a
    stroke without limits counts as the characteristic length. A floating base does not count.
    """
    return mechanism.structure.derived(_reach)


def _reach(mechanism: Mechanism) -> float:
    model, far = mechanism.model, np.zeros(mechanism.model.njoints)
    for number in range(1, model.njoints):
        joint, stroke = model.joints[number], 0.0
        if joint.nq == 1 and translations(joint):
            limits = mechanism.limits[model.names[number]][:2]
            home = abs(float(mechanism.q_home[joint.idx_q]))
            stroke = max(abs(x) if math.isfinite(x) else home + mechanism.length for x in limits)
        step = float(np.linalg.norm(model.jointPlacements[number].translation))
        far[number] = far[model.parents[number]] + step + stroke
    ends = (far[frame.parentJoint] + float(np.linalg.norm(frame.placement.translation)) for frame in model.frames)
    return float(max([*ends, mechanism.length]))


def check_lengths(mechanism: Mechanism, name: str, values: Sequence[float], far: float = FAR) -> None:
    """Check that lengths in the workspace are not 1000 times too large.

    Args:
        mechanism: the robot.
        name: of the lengths, for the error, such as `x` or `goal: point`.
        values: coordinates or distances, m.
        far: multiple of the reach beyond which a length can't be meant.

    Raises:
        ImplausibleError: one is far beyond the robot's reach, and all would be within it in mm.
    """
    value, most = max(values, key=abs, default=0.0), reach(mechanism)
    if far * most < abs(value) <= 1000.0 * most and not mechanism.floating:
        raise ImplausibleError(
            f"{name}: {shown(value, LENGTH)} is far beyond the reach of {mechanism.name}, at most "
            f"{shown(most, LENGTH, 2)}: did you mean {value:.6g} mm?"
        )


def check_joint(mechanism: Mechanism, joint: str, values: Sequence[float]) -> None:
    """Check that values of a joint are not 1000 or 57.3 times too large.

    Args:
        mechanism: the robot.
        joint: name of the joint.
        values: rad or m.

    Raises:
        ImplausibleError: one is far beyond the joint's limits (by a revolution at least), and all would be within them
            in mm or degrees; or far beyond the robot's reach, for a prismatic joint. A revolute joint without limits is
            not checked.
    """
    low, high, *_ = mechanism.limits[joint]
    value, limited = max(values, key=abs), math.isfinite(low) and math.isfinite(high)
    if mechanism.is_prismatic(joint):
        factor, slack, dimension, other = 1000.0, high - low, LENGTH, f"{value:.6g} mm"
    else:
        factor, slack, dimension = math.degrees(1.0), 2.0 * math.pi, ANGLE
        other = f"{value:.6g} degrees, which are {math.radians(value):.4g} rad"

    def fit(factor: float, slack: float = 0.0) -> bool:
        return all(low - slack <= x / factor <= high + slack for x in values)

    if limited and not fit(1.0, slack) and fit(factor):
        limits = f"{shown(low, dimension)} to {shown(high, dimension)}"
        raise ImplausibleError(
            f"{joint}: {shown(value, dimension)} is far beyond its limits, {limits}: did you mean {other}?"
        )
    if mechanism.is_prismatic(joint):
        check_lengths(mechanism, joint, values)


def check_speed(mechanism: Mechanism, joint: str, value: float) -> None:
    """Check that a speed of a joint is not 1000 or 57.3 times too large.

    Args:
        mechanism: the robot.
        joint: name of the joint; only those of one variable that the model limits are checked.
        value: rad/s or m/s.

    Raises:
        ImplausibleError: it is far beyond the model's limit, and would be within it in mm/s or degrees/s.
    """
    most = mechanism.limits[joint].velocity if joint in mechanism.limits else math.inf
    slides = joint in mechanism.limits and mechanism.is_prismatic(joint)
    factor, unit, other = (1000.0, "m/s", "mm/s") if slides else (math.degrees(1.0), "rad/s", "degrees/s")
    if FAR * most < value <= factor * most:
        raise ImplausibleError(
            f"{joint}: {value:.6g} {unit} is far beyond its limit, {most:.6g} {unit}: did you mean {value:.6g} "
            f"{other}, which are {value / factor:.4g} {unit}?"
        )


def check_configuration(mechanism: Mechanism, q: Array) -> None:
    """Check a configuration (nq,) as `check_joint` does its joints.

    Raises:
        ImplausibleError: as `check_joint`.
    """
    index, low, high, names = mechanism.structure.derived(_plausible)
    values = q[index]
    for i in np.flatnonzero((values < low) | (values > high)):
        check_joint(mechanism, names[i], [float(values[i])])


def _plausible(mechanism: Mechanism) -> tuple[Indices, Array, Array, list[str]]:
    """Return the index in q, and limits that no plausible value exceeds, of each joint that `check_joint` checks."""
    names = [name for name in mechanism.joints if name in mechanism.limits]
    low, high = np.array([mechanism.limits[name][:2] for name in names]).reshape(-1, 2).T
    slides = np.array([mechanism.is_prismatic(name) for name in names], dtype=bool)
    far = FAR * reach(mechanism)  # of a short stroke a program may mean a start beyond it
    bounds = np.where(slides, -far, low - 2.0 * math.pi), np.where(slides, far, high + 2.0 * math.pi)
    return np.array([mechanism.q_index(name) for name in names], dtype=np.intp), *bounds, names


def check_revolution(name: str, low: float, high: float) -> None:
    """Check that a range of an orientation is one revolution at most.

    Raises:
        ImplausibleError: it is more, and would be less in degrees or not at all.
    """
    if high - low > 2.0 * math.pi * (1.0 + 1e-9):
        degrees = f": did you mean {low:g}..{high:g}deg?" if high - low <= 360.0 else ""
        range_shown = f"{shown(low, ANGLE)} to {shown(high, ANGLE)}"
        raise ImplausibleError(f"{name}: {range_shown} is more than one revolution{degrees}")


def doubts(mechanism: Mechanism) -> list[str]:
    """Return what a file in m, kg and rad probably means in another unit: limits of joints, lengths, moments of
    inertia. Each text names the first of its kind and what it would be."""
    kinds = [list(kind(mechanism)) for kind in (_limits_in_degrees, _lengths_in_mm, _moments_in_mm)]
    return [f"{kind[0]}{f' (and {len(kind) - 1} more)' * (len(kind) > 1)}" for kind in kinds if kind]


def _limits_in_degrees(mechanism: Mechanism) -> Iterator[str]:
    for name in mechanism.joints:
        if name not in mechanism.limits or mechanism.is_prismatic(name):
            continue
        low, high = mechanism.limits[name][:2]
        largest = max(abs(low), abs(high))
        if 4.0 * math.pi + 0.1 < largest <= TURNS and all(value == round(value) for value in (low, high)):
            yield (
                f"joint '{name}' turns {largest / math.tau:.0f} times within its limits, {low:g} and {high:g} rad: if "
                f"these are degrees, write {math.radians(low):.10g} and {math.radians(high):.10g}"
            )


def _lengths_in_mm(mechanism: Mechanism) -> Iterator[str]:
    """Yield distances from a joint to the one before it, but not to the world, in which a robot may be anywhere."""
    model = mechanism.model
    places = {str(model.names[i]): model.jointPlacements[i] for i in range(1, model.njoints) if model.parents[i] > 0}
    frames = [model.frames[mechanism.frame_id(node)] for node in mechanism.nodes]
    places |= {frame.name: frame.placement for frame in frames if frame.parentJoint > 0}
    for loop in mechanism.loops:
        places[f"loop '{loop.name}' on {loop.first}"] = loop.first_placement
        places[f"loop '{loop.name}' on {loop.second}"] = loop.second_placement
    for name, place in places.items():
        far = [float(x) for x in place.translation]
        if math.hypot(*far) > LONG:
            metres = " ".join(f"{x / 1000.0:.10g}" for x in far)
            size = f"{math.hypot(*far):.6g} m"
            yield f"{name} is {size} from the joint before it: if lengths are in mm, write {metres} here"


def _moments_in_mm(mechanism: Mechanism) -> Iterator[str]:
    """Yield bodies that are far too large, but not placeholders, whose moments are alike."""
    most = reach(mechanism)
    for link, body in stated(mechanism).items():
        least, _, moment = np.linalg.eigvalsh(body.matrix).tolist()
        size = math.sqrt(moment / body.mass) if body.mass > 0.0 and moment > 1.01 * least else 0.0
        if FAR * most < size and 0.03 * most < size / 1000.0 < most:
            yield (
                f"link '{link}' has the moments of inertia of a body of {size:.3g} m, far beyond the robot's reach, "
                f"{shown(most, LENGTH, 2)}: if they are in kg mm2, write a millionth, {moment / 1e6:.6g} at most"
            )
