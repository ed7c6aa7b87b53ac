"""`Bodies`: which bodies of a linkage count, how they hang together, and what of them tells assembly modes apart.

A universal or a ball joint is written as two or three joints that turn about axes through one point. The crosses
between them are no bodies that anybody counts, nor does it count how a rod is turned about the line through its two
ends: turned over by pi, with its joints' angles following, it places every other link alike. So a configuration is told
by points and directions: of each body the centres of its universal and ball joints, the axes of its hinges, the
directions of its slides.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly._kernels import (
    BALL,
    COLUMN,
    FIRST,
    KIND,
    PARENT,
    PRISMATIC,
    REVOLUTE,
    RIGID,
    SECOND,
    SLIDES,
    Tables,
)

Array = NDArray[np.float64]

_SAME = 1e-9  # characteristic lengths, radians: points and axes that coincide
_MEET = 1e-8  # ... as samples are closed to no more
_ENOUGH = 0.03  # two vectors so far from being parallel settle how a body is turned


class Feature(NamedTuple):
    """A point or a direction of a body: body 0 is the base, body k + 1 is moved by joint k. Without unit."""

    body: int
    direction: bool
    local: Array


class Mark(NamedTuple):
    """A feature that bodies may be told by.

    Attributes:
        feature: what it is.
        at: (3,) the point or the direction at home, in the base.
        fixed: whether it is on the base too, so that nothing can be told by it.
    """

    feature: Feature
    at: Array
    fixed: bool


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint between two bodies, of the tree or cut.

    Attributes:
        kind: REVOLUTE, PRISMATIC or BALL.
        sides: the two bodies, by number of `Bodies.body`.
        members: the two of the linkage's bodies that it joins.
        held: whether a motor holds it.
        carrier: a body (of the linkage) in which point and axis are fixed.
        point: (3,) on its axis, in the carrier.
        axis: (3,) of unit length, in the carrier; nothing for a ball.
        at: (3,) the point at home, in the base.
        along: (3,) the axis at home, in the base.
    """

    kind: int
    sides: tuple[int, int]
    members: tuple[int, int]
    held: bool
    carrier: int
    point: Array
    axis: Array
    at: Array
    along: Array


@dataclass(eq=False)
class Centre:
    """Passive joints that turn about axes through one point, as one: a hinge (1), a universal (2) or a ball joint (3).

    Attributes:
        joints: in no order.
        at: (3,) the point at home, in the base: on the hinge's axis, or where all axes meet.
        crosses: bodies between the joints.
    """

    joints: list[Joint]
    at: Array
    crosses: list[int] = field(default_factory=list)

    @property
    def freedoms(self) -> int:
        """1 for a hinge, 2 for a universal joint, 3 for a ball joint."""
        return 3 if self.joints[0].kind == BALL else len(self.joints)


class Bodies:
    """The bodies of a linkage and the joints between them.

    Args:
        tables: of the linkage; its features aren't needed.
        placements: (n + 1, 3, 4) of base and bodies at home, without unit.
        end: the body whose whole placement counts.

    Attributes:
        placements: as given.
        body: (n + 1,) number of the body that base and each joint's body belong to; those that are cut and rigid are
            one.
        joints: between bodies of different numbers.
        group: (n + 1,) number of the group of bodies that are one while the motors are held.
    """

    def __init__(self, tables: Tables, placements: Array, end: int) -> None:
        self.placements, self._end = placements, end
        self.body = np.arange(len(tables.joints) + 1)
        for first, second, kind in tables.loops:
            if kind == RIGID:
                self.body[self.body == self.body[second]] = self.body[first]
        self.joints: list[Joint] = []
        for k, joint in enumerate(tables.joints):
            kind = PRISMATIC if joint[SLIDES] else REVOLUTE
            self._add(kind, joint[PARENT], k + 1, joint[COLUMN] < 0, k + 1, np.zeros(3), tables.constants[k, 12:15])
        for loop, anchors in zip(tables.loops, tables.anchors, strict=True):
            if loop[KIND] != RIGID:
                self._add(
                    int(loop[KIND]),
                    loop[FIRST],
                    loop[SECOND],
                    False,
                    int(loop[FIRST]),
                    anchors[0, 9:12],
                    anchors[0, 6:9],
                )

        self.group = self.body.copy()
        for joint in self.joints:
            if joint.held:
                first, second = (self.group[member] for member in joint.members)
                self.group[self.group == second] = first

    def _add(self, kind: int, first: int, second: int, held: bool, carrier: int, point: Array, axis: Array) -> None:
        sides = int(self.body[first]), int(self.body[second])
        if sides[0] != sides[1]:
            at, along = self.point(carrier, point), self.placements[carrier, :, :3] @ axis
            members = int(first), int(second)
            self.joints.append(Joint(kind, sides, members, held, carrier, point, axis, at, along))

    def point(self, carrier: int, local: Array) -> Array:
        """(3,) a point of a body at home, in the base."""
        placement = self.placements[carrier]
        return np.asarray(placement[:, :3] @ local + placement[:, 3])

    def local(self, carrier: int, at: Array) -> Array:
        """(3,) a point at home in a body's axes."""
        placement = self.placements[carrier]
        return np.asarray(placement[:, :3].T @ (at - placement[:, 3]))

    @cached_property
    def at(self) -> dict[int, list[Joint]]:
        """The joints on each body."""
        found: dict[int, list[Joint]] = defaultdict(list)
        for joint in self.joints:
            for side in joint.sides:
                found[side].append(joint)
        return found

    @cached_property
    def centres(self) -> list[Centre]:
        """The passive joints, those of universal and ball joints together; slides are not among them."""
        turning = [joint for joint in self.joints if not joint.held and joint.kind in (REVOLUTE, BALL)]
        owner = {id(joint): Centre([joint], joint.at) for joint in turning}
        alone = self.common_point is not None  # a spherical linkage: its links are real ones
        for body, joints in self.at.items():
            if alone or body == self.body[0] or len(joints) != 2:
                continue
            first, second = joints
            if any(joint.held or joint.kind != REVOLUTE for joint in joints):
                continue
            meeting = _meeting(first, second)
            one, two = owner[id(first)], owner[id(second)]
            if meeting is None or one is two or not all(_through(c, meeting) for c in (one, two)):
                continue
            together = Centre([*one.joints, *two.joints], meeting, [*one.crosses, *two.crosses, body])
            for joint in together.joints:
                owner[id(joint)] = together
        found = list({id(centre): centre for centre in owner.values()}.values())
        # More than three axes through one point are a spherical linkage: its links are real ones.
        kept = [centre for centre in found if centre.freedoms <= 3]
        return kept + [Centre([joint], joint.at) for c in found if c.freedoms > 3 for joint in c.joints]

    @cached_property
    def common_point(self) -> Array | None:
        """(3,) where the axes of all passive joints meet; None where they don't, or some joint slides."""
        joints = [joint for joint in self.joints if not joint.held]
        if not joints or any(joint.kind != REVOLUTE for joint in joints):
            return None
        along, at = np.array([joint.along for joint in joints]), np.array([joint.at for joint in joints])
        # (I - a a^T) (c - p) = 0 for all axes
        across = np.eye(3) - along[:, :, None] * along[:, None, :]
        matrix, right = across.reshape(-1, 3), (across @ at[:, :, None]).ravel()
        centre, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=_ENOUGH)
        return centre if rank == 3 and np.abs(matrix @ centre - right).max() < _MEET else None

    @cached_property
    def crosses(self) -> frozenset[int]:
        """Bodies that don't count."""
        return frozenset(cross for centre in self.centres for cross in centre.crosses)

    # --- features ------------------------------------------------------------------------------------------------

    @cached_property
    def features(self) -> list[Feature]:
        """What tells configurations apart: points and directions that settle where all groups are.

        They are few: what else there is on a group that is settled by two vectors and a point is a polynomial in these
        (a third vector is their product), so that it can't differ where they don't.
        """
        known: set[int] = set()  # marks, by id
        chosen: list[Mark] = []
        for group in sorted(self._marks, key=lambda g: (-len(self._marks[g]), g)):
            marks = self._marks[group]
            while (best := _next([m for m in marks if m.fixed or id(m) in known], marks)) is not None:
                known.add(id(best))
                chosen.append(best)
            if _settled([m for m in marks if m.fixed or id(m) in known]):
                known |= {id(mark) for mark in marks}
        return [mark.feature for mark in chosen]

    @cached_property
    def _marks(self) -> dict[int, list[Mark]]:
        """Of each group but the base's its points and directions that are no other group's only by chance: those of its
        joints. Joints are shared, and so are their marks."""
        base, found = int(self.group[0]), defaultdict[int, list[Mark]](list)
        slides = [joint for joint in self.joints if joint.kind == PRISMATIC and not joint.held]
        for groups, marks in (*map(self._of_centre, self.centres), *map(self._of_slide, slides)):
            for group in groups - {base}:
                found[group] += marks
        for group, marks in found.items():
            if all(mark.feature.direction for mark in marks):
                marks.append(self._own(int(np.flatnonzero(self.group == group)[0]), None))
        rods = {group for group in found if self._is_rod(group)}
        for group, marks in found.items():
            if not _settled(marks) and (
                group not in rods or (group == self.group[self._end] and len(rods) == len(found))
            ):
                member = self._end if group == self.group[self._end] else int(np.flatnonzero(self.group == group)[0])
                marks += [self._own(member, axis) for axis in np.eye(3)]
        return dict(found)

    def _is_rod(self, group: int) -> bool:
        """Whether a group has two centres, of more than one freedom each, and nothing else: how it is turned about the
        line between them doesn't count."""
        on = [joint for joint in self.joints if not joint.held and group in map(self.group_of, joint.sides)]
        centres = [c for c in self.centres if c.freedoms > 1 and any(joint in on for joint in c.joints)]
        return len(centres) == 2 and all(any(joint in c.joints for c in centres) for joint in on)

    def _of_centre(self, centre: Centre) -> tuple[set[int], list[Mark]]:
        """The groups that a centre joins, and its marks."""
        groups = {self.group_of(side) for joint in centre.joints for side in joint.sides if side not in self.crosses}
        fixed, joint = int(self.group[0]) in groups, centre.joints[0]
        local = self.local(joint.carrier, centre.at)
        marks = [Mark(Feature(joint.carrier, False, local), centre.at, fixed)]
        if centre.freedoms == 1:
            marks.append(Mark(Feature(joint.carrier, True, joint.axis), joint.along, fixed))
        return groups, marks

    def _of_slide(self, joint: Joint) -> tuple[set[int], list[Mark]]:
        groups = {self.group_of(side) for side in joint.sides}
        fixed = int(self.group[0]) in groups
        return groups, [Mark(Feature(joint.carrier, True, joint.axis), joint.along, fixed)]

    def _own(self, member: int, axis: Array | None) -> Mark:
        """A direction of a body, or its origin."""
        if axis is None:
            return Mark(Feature(member, False, np.zeros(3)), self.point(member, np.zeros(3)), False)
        return Mark(Feature(member, True, axis), self.placements[member, :, :3] @ axis, False)

    def group_of(self, body: int) -> int:
        """The group of a body, by the number that it has in `body`."""
        return int(self.group[np.flatnonzero(self.body == body)[0]])


def _vectors(marks: list[Mark]) -> Array:
    """The two largest singular values of all directions, and of the ways between all points."""
    points = [mark.at for mark in marks if not mark.feature.direction]
    rows = [mark.at for mark in marks if mark.feature.direction] + [point - points[0] for point in points[1:]]
    values = np.linalg.svd(np.array([*rows, np.zeros(3), np.zeros(3)]), compute_uv=False)
    return np.asarray(np.minimum(values[:2], 1.0))


def _settled(marks: list[Mark]) -> bool:
    """Whether a body is where it is, if these are where they are."""
    return any(not mark.feature.direction for mark in marks) and bool(_vectors(marks)[1] > _ENOUGH)


def _next(known: list[Mark], marks: list[Mark]) -> Mark | None:
    """The mark that settles most beyond what is known; None where there is nothing more to settle."""
    if _settled(known):
        return None

    def score(mark: Mark) -> float:
        with_it = [*known, mark]
        return any(not m.feature.direction for m in with_it) + float(_vectors(with_it).sum())

    now = any(not m.feature.direction for m in known) + float(_vectors(known).sum())
    left = [mark for mark in marks if all(mark is not m for m in known)]
    best = max(left, key=score, default=None)
    return best if best is not None and score(best) > now + _SAME else None


def _meeting(first: Joint, second: Joint) -> Array | None:
    """(3,) where two axes meet at home; None if they don't, or are parallel."""
    normal = np.cross(first.along, second.along)
    square = float(normal @ normal)
    if square < _SAME:
        return None
    between = second.at - first.at
    if abs(between @ normal) > _SAME * np.sqrt(square):
        return None
    return np.asarray(first.at + first.along * (np.cross(between, second.along) @ normal / square))


def _through(centre: Centre, point: Array) -> bool:
    """Whether the axes of all joints of a centre go through a point."""
    return all(np.linalg.norm(np.cross(joint.along, point - joint.at)) < 10.0 * _SAME for joint in centre.joints)
