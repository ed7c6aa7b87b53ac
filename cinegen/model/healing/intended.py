"""Relations of joint axes that a description nearly satisfies, so that it is meant to satisfy them exactly.

Axes on the same body stay where they are relative to each other in every configuration. Two of them that are parallel,
at right angles, or intersect, but for a small error, are meant to.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.joints import axis
from cinegen.loops.closed_loops import ClosedLoops
from raff2urdf.raff.document import LoopKind
from raff2urdf.residual import skew

Relation = tuple[int, int, int, str]
"""A body, two of its axes, and what is nearly true: parallel, perpendicular, intersecting or coincident."""

_TOLERANCE = 2e-3
"""rad, or characteristic lengths: relations that are further from true are not meant."""


class _Axis(NamedTuple):
    """An axis in its body's frame: a direction (3,) and a point (3,), and how they change with a twist."""

    direction: Array
    point: Array
    twist: int
    by_rotation: Array
    by_translation: Array


def relations(system: ClosedLoops) -> list[Relation]:
    """Return the relations of axes that are nearly satisfied."""
    satisfied: list[Relation] = []
    for body, axes in enumerate(_axes(system)):
        for i, first in enumerate(axes):
            for k, second in enumerate(axes[:i]):
                across = np.cross(first.direction, second.direction)
                between = (second.point - first.point) / system.length
                if np.linalg.norm(across) < _TOLERANCE:
                    satisfied.append((body, i, k, "parallel"))
                    if np.linalg.norm(np.cross(between, first.direction)) < _TOLERANCE:
                        satisfied.append((body, i, k, "coincident"))
                    continue
                if abs(first.direction @ second.direction) < _TOLERANCE:
                    satisfied.append((body, i, k, "perpendicular"))
                if abs(between @ across) < _TOLERANCE * np.linalg.norm(across):
                    satisfied.append((body, i, k, "intersecting"))
    return satisfied


def errors(system: ClosedLoops, wanted: list[Relation], twists: int) -> tuple[Array, Array]:
    """Return by how much relations are not satisfied, and the derivative (rows, 6 twists) by the geometry; see
    `cinegen.model.healing.heal.by_geometry`."""
    values, rows = [np.zeros(0)], [np.zeros((0, 6 * twists))]
    bodies = _axes(system)
    for body, i, k, what in wanted:
        first, second = bodies[body][i], bodies[body][k]
        turn_first, shift_first = _changes(first, twists, system.length)
        turn_second, shift_second = _changes(second, twists, system.length)
        across = np.cross(first.direction, second.direction)
        by_across = skew(first.direction) @ turn_second - skew(second.direction) @ turn_first
        between, by_between = (second.point - first.point) / system.length, shift_second - shift_first
        if what == "parallel":
            value, row = across, by_across
        elif what == "perpendicular":
            value = np.array([first.direction @ second.direction])
            row = (first.direction @ turn_second + second.direction @ turn_first)[None]
        elif what == "intersecting":
            value, row = np.array([between @ across]), (between @ by_across + across @ by_between)[None]
        else:
            value = np.cross(first.direction, between)
            row = skew(first.direction) @ by_between - skew(between) @ turn_first
        values.append(value)
        rows.append(row)
    return np.concatenate(values), np.concatenate(rows)


def _axes(system: ClosedLoops) -> list[list[_Axis]]:
    """Return the axes on each body: of the joint that carries it, of the joints on it, and of loops closed there."""
    model, count = system.model, system.model.njoints - 1
    bodies: list[list[_Axis]] = [[] for _ in range(count + 1)]
    for j in range(1, count + 1):
        if model.joints[j].nv == 1:
            along = axis(model.joints[j])
            bodies[j].append(_Axis(along, np.zeros(3), count + j - 1, skew(along), -np.eye(3)))
            bodies[model.parents[j]].append(_placed(model.jointPlacements[j], along, j - 1))
    for i, (loop, (a, on_a, b, on_b)) in enumerate(zip(system.loops, system.anchors, strict=True)):
        if loop.kind in (LoopKind.REVOLUTE, LoopKind.PRISMATIC):
            z = np.array([0.0, 0.0, 1.0])
            bodies[a].append(_placed(on_a, z, 2 * count + i))
            bodies[b].append(_placed(on_b, z, 2 * count + len(system.loops) + i))
    return bodies


def _placed(placement: pin.SE3, along: Array, twist: int) -> _Axis:
    rotation = np.array(placement.rotation)
    return _Axis(rotation @ along, np.array(placement.translation), twist, -rotation @ skew(along), rotation)


def _changes(axis: _Axis, twists: int, length: float) -> tuple[Array, Array]:
    """Return the derivatives of an axis's direction and of its point, in characteristic lengths."""
    turn, shift = np.zeros((3, 6 * twists)), np.zeros((3, 6 * twists))
    at = 6 * axis.twist
    turn[:, at + 3 : at + 6], shift[:, at : at + 3] = axis.by_rotation, axis.by_translation
    return turn, shift
