"""A stick figure of a mechanism without shapes: bars from joint to joint, a drum on each revolute axis."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import coal
import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.joints import axis, kinematic_data, translations

_THICK = 0.06  # of the median length: radius of a bar
_THINNEST = 0.002  # of the robot's size: it would not be seen otherwise
_BAR, _JOINT = (0.0, 0.45, 0.7, 1.0), (0.2, 0.22, 0.25, 1.0)  # Okabe and Ito's blue; nearly black


def stick_figure(
    model: pin.Model, bar: Callable[[float, float], coal.ShapeBase] = coal.Cylinder
) -> Iterator[pin.GeometryObject]:
    """Yield bars for every body of a model, from its joint to the joints and frames that it carries.

    Args:
        model: model of a mechanism.
        bar: shape of bars and drums, of a radius and a length.
    """
    bodies = {frame.parentJoint: i for i, frame in reversed(list(enumerate(model.frames))) if _is_body(frame)}
    ends: dict[int, list[Array]] = {j: [] for j in range(model.njoints)}
    for j in range(1, model.njoints):
        ends[model.parents[j]].append(np.array(model.jointPlacements[j].translation))
    for frame in model.frames:
        if _is_body(frame):
            ends[frame.parentJoint].append(np.array(frame.placement.translation))
    lengths = [float(np.linalg.norm(point)) for points in ends.values() for point in points]
    longer = [length for length in lengths if length > 1e-3 * max(lengths)]
    data = kinematic_data(model)
    pin.forwardKinematics(model, data, pin.neutral(model))
    size = float(np.ptp([placement.translation for placement in data.oMi], axis=0).max())
    radius = max(_THICK * (float(np.median(longer)) if longer else 1.0), _THINNEST * size)
    for j, points in ends.items():
        carrier = bodies.get(j)
        if carrier is None:  # nothing is named there, so nothing can be shown
            continue
        solids = [
            (f"bar {j} {i}", bar(radius, float(np.linalg.norm(point))), _along(point, point / 2.0), _BAR)
            for i, point in enumerate(_apart(points, radius))
        ]
        joint = model.joints[j]
        if j and joint.nv == 1 and not translations(joint):
            solids.append((f"joint {j}", bar(1.5 * radius, 4.0 * radius), _along(axis(joint), np.zeros(3)), _JOINT))
        elif j:
            solids.append((f"joint {j}", coal.Sphere(1.5 * radius), pin.SE3.Identity(), _JOINT))
        for name, shape, placement, colour in solids:
            solid = pin.GeometryObject(name, j, carrier, placement, shape)
            solid.meshColor = np.array(colour)
            yield solid


def _is_body(frame: pin.Frame) -> bool:
    return bool(frame.type == pin.FrameType.BODY)


def _apart(points: list[Array], radius: float) -> list[Array]:
    """Return the points that are neither at the origin nor repeated."""
    apart: list[Array] = []
    for point in points:
        if np.linalg.norm(point) > radius and all(np.linalg.norm(point - other) > 0.1 * radius for other in apart):
            apart.append(point)
    return apart


def _along(direction: Array, centre: Array) -> pin.SE3:
    """Return the placement of a cylinder along a direction, with its centre at a point."""
    return pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction).matrix(), centre)
