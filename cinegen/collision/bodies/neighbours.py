"""Joints whose bodies are bound to touch: those that follow one another, in the tree or through a loop, and those that
turn about one point."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from cinegen.joints import translations
from cinegen.model.mechanism import Mechanism
from raff2urdf.document import LoopKind

Array = NDArray[np.float64]

Hinge = dict[int, Array]
"""A point that several bodies share: for the joint that each moves with, where the point is in that joint's frame, m;
it stays there."""

_SAME = 1e-6  # of the characteristic length


def neighbours(mechanism: Mechanism) -> frozenset[tuple[int, int]]:
    """Pairs of joints, each with the smaller number first, whose bodies are neighbours.

    Bodies are neighbours where one joint carries the other, where a loop was cut between them, and where they share a
    point: two or three joints that turn about one point are a universal joint or a ball joint, and the links on its two
    sides meet there as they would at one joint. A rigid loop joins two parts of one link: the neighbours of either part
    are neighbours of both.
    """
    model = mechanism.model
    found = {(int(model.parents[j]), j) for j in range(1, model.njoints)}
    found |= {_ordered(first, second) for first, _, second, _ in mechanism.system.anchors}
    for hinge in _hinges(mechanism):
        found.update(combinations(sorted(hinge), 2))
    parts = _parts_of_links(mechanism)
    found = {_ordered(i, j) for pair in found for i, j in product(*(parts[joint] for joint in pair))}
    return frozenset((i, j) for i, j in found if i != j)


def _parts_of_links(mechanism: Mechanism) -> list[set[int]]:
    """Return for each joint the joints that carry parts of the same link: itself, and those joined by rigid loops."""
    parts = [{joint} for joint in range(mechanism.model.njoints)]
    for loop, (first, _, second, _) in zip(mechanism.loops, mechanism.system.anchors, strict=True):
        if loop.kind == LoopKind.RIGID:
            joined = parts[first] | parts[second]
            for joint in joined:
                parts[joint] = joined
    return parts


def _hinges(mechanism: Mechanism) -> list[Hinge]:
    """The points about which links turn; those that are one, whatever joints they belong to, are together."""
    near = _SAME * mechanism.length
    found: list[Hinge] = []
    for new in _single(mechanism):
        same = [hinge for hinge in found if any(np.linalg.norm(hinge[j] - new[j]) <= near for j in hinge.keys() & new)]
        found = [hinge for hinge in found if not any(hinge is other for other in same)]
        found.append({joint: point for hinge in (*same, new) for joint, point in hinge.items()})
    return found


def _single(mechanism: Mechanism) -> Iterator[Hinge]:
    """For each joint that turns, cut or not, a point of its axis."""
    model = mechanism.model
    for j in range(1, model.njoints):
        if translations(model.joints[j]) == 0:
            yield {int(model.parents[j]): np.array(model.jointPlacements[j].translation), j: np.zeros(3)}
    for loop, (first, at, second, there) in zip(mechanism.loops, mechanism.system.anchors, strict=True):
        if loop.kind != LoopKind.PRISMATIC and first != second:
            yield {first: np.array(at.translation), second: np.array(there.translation)}


def _ordered(first: int, second: int) -> tuple[int, int]:
    return (first, second) if first < second else (second, first)
