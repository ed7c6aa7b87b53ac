"""`LinkageBodies`: which bodies of a linkage count, how they are connected, and which features distinguish modes.

A universal or a ball joint is written as two or three revolute joints with axes through one point. The crosses between
them do not count as bodies, and neither does the rotation of a rod about the line through its two ends: by pi,
with its joints' angles following, it places every other link alike. So configurations are compared by points and
directions: of each body the centres of its universal and ball joints, the axes of its hinges, the directions of its
prismatic joints.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.assembly._kernels.tables import COLUMN, IS_PRISMATIC, PARENT
from cinegen.jit.compiled import Table
from cinegen.joints import common_point
from raff2urdf.raff.document import LoopKind

_MEET = 1e-8  # characteristic lengths: distance of axes that meet, as samples are closed to no more
_INDEPENDENT = 0.03  # sine of two vectors that determine the orientation of a body


class CutJoint(NamedTuple):
    """A joint that closes a loop.

    Attributes:
        kind: of the joint.
        bodies: its first and second body: 0 is the base, k + 1 is moved by joint k.
        anchors: (2, 4, 3) axes x, y, z and origin of each end in its body, lengths dimensionless.
    """

    kind: LoopKind
    bodies: tuple[int, int]
    anchors: Array


class Feature(NamedTuple):
    """A point or a direction that may distinguish modes.

    Attributes:
        body: it is fixed in.
        is_direction: whether it is a direction.
        local: (3,) in the body's axes, dimensionless.
        at: (3,) the same at home, in the base.
        fixed: whether it is on the base too, so that it distinguishes nothing.
    """

    body: int
    is_direction: bool
    local: Array
    at: Array
    fixed: bool


@dataclass(frozen=True, eq=False)
class LinkageJoint:
    """A joint between two bodies, of the tree or cut.

    Attributes:
        kind: revolute, prismatic or ball.
        sides: the two bodies, as `LinkageBodies.body` numbers them.
        members: the same as the linkage numbers them.
        locked: whether its value is given.
        single: whether it is no part of a universal or a ball joint.
        carrier: a body (of the linkage) in which point and axis are fixed.
        axis: (3,) unit vector, in the carrier; of no use for a ball.
        at: (3,) a point of the axis at home, in the base.
        along: (3,) the axis at home, in the base.
    """

    kind: LoopKind
    sides: tuple[int, int]
    members: tuple[int, int]
    locked: bool
    single: bool
    carrier: int
    axis: Array
    at: Array
    along: Array


@dataclass(eq=False)
class JointCentre:
    """Passive revolute joints with axes through one point, as one: a hinge, a universal or a ball joint.

    Attributes:
        joints: in no order.
        at: (3,) the point at home, in the base: on the hinge's axis, or where all axes meet.
        crosses: bodies between the joints.
    """

    joints: list[LinkageJoint]
    at: Array
    crosses: list[int] = field(default_factory=list)

    @property
    def dof(self) -> int:
        """1 for a hinge, 2 for a universal joint, 3 for a ball joint."""
        return 3 if self.joints[0].kind is LoopKind.BALL else len(self.joints)


class LinkageBodies:
    """The bodies of a linkage and the joints between them.

    Args:
        joints: (n, 3) see `LinkageTables.joints`.
        axes: (n, 3) of the joints, each in its body.
        unknowns: number of passive joints.
        cuts: the joints that close loops.
        placements: (n + 1) of base and bodies at home, dimensionless.
        end: the body whose whole placement counts.
        distinct: joints that are no part of a universal or a ball joint.

    Attributes:
        placements: as given.
        body: (n + 1,) number of the body that base and each joint's body belong to; a rigid cut makes two one.
        joints: between bodies of different numbers.
        group: (n + 1,) number of the group of bodies that are one while locked joints don't move.
    """

    def __init__(
        self, joints: Table, axes: Array, unknowns: int, cuts: Sequence[CutJoint], placements: list[pin.SE3], end: int,
        distinct: Collection[int] = (),
    ) -> None:  # fmt: skip
        self.placements, self._end = placements, end
        self.body = np.arange(len(joints) + 1)
        for cut in cuts:
            if cut.kind is LoopKind.RIGID:
                first, second = self.body[list(cut.bodies)]
                self.body[self.body == second] = first
        self.joints: list[LinkageJoint] = []
        for k, joint in enumerate(joints):
            kind = LoopKind.PRISMATIC if joint[IS_PRISMATIC] else LoopKind.REVOLUTE
            locked, members = bool(joint[COLUMN] > unknowns), (int(joint[PARENT]), k + 1)
            self._add(kind, members, locked, k in distinct, k + 1, np.zeros(3), axes[k])
        for cut in cuts:
            if cut.kind is not LoopKind.RIGID:
                self._add(cut.kind, cut.bodies, False, False, cut.bodies[0], cut.anchors[0, 3], cut.anchors[0, 2])
        self.group = self.body.copy()
        for joint in self.joints:
            if joint.locked:
                first, second = self.group[list(joint.members)]
                self.group[self.group == second] = first

    def _add(
        self, kind: LoopKind, members: tuple[int, int], locked: bool, single: bool, carrier: int, point: Array,
        axis: Array,
    ) -> None:  # fmt: skip
        first, second = (int(self.body[member]) for member in members)
        if first != second:
            at, along = self.placements[carrier].act(point), self.placements[carrier].rotation @ axis
            self.joints.append(LinkageJoint(kind, (first, second), members, locked, single, carrier, axis, at, along))

    @cached_property
    def group_of(self) -> dict[int, int]:
        """The group of each body."""
        return {int(body): int(group) for body, group in zip(self.body, self.group, strict=True)}

    @cached_property
    def passive(self) -> list[LinkageJoint]:
        """The joints that are not locked."""
        return [joint for joint in self.joints if not joint.locked]

    @cached_property
    def centres(self) -> list[JointCentre]:
        """The passive joints except prismatic ones, those of universal and ball joints together."""
        owner = {id(j): JointCentre([j], j.at) for j in self.passive if j.kind is not LoopKind.PRISMATIC}
        on_body = defaultdict[int, list[LinkageJoint]](list)
        for joint in self.joints:
            for side in joint.sides:
                on_body[side].append(joint)
        spherical = self.common_point is not None  # then its links are real ones
        refused = list[tuple[LinkageJoint, LinkageJoint]]()
        for body, joints in on_body.items():
            if spherical or body == self.body[0] or len(joints) != 2:
                continue
            first, second = joints
            if any(joint.locked or joint.single or joint.kind is not LoopKind.REVOLUTE for joint in joints):
                continue
            left, right = owner[id(first)], owner[id(second)]
            meeting = None if left is right else _meeting([*left.joints, *right.joints])
            if meeting is None:
                continue
            if left.dof + right.dof > 3:  # the next axis may lie along the rod, and belong to its other end
                refused.append((first, second))
                continue
            merged = JointCentre([*left.joints, *right.joints], meeting, [*left.crosses, *right.crosses, body])
            for joint in merged.joints:
                owner[id(joint)] = merged
        for pair in refused:
            centres = {id(centre): centre for centre in (owner[id(joint)] for joint in pair)}
            joints = [joint for centre in centres.values() for joint in centre.joints]
            if _meeting(joints) is not None:  # more than three axes through one point are a spherical linkage
                owner |= {id(joint): JointCentre([joint], joint.at) for joint in joints}
        return list({id(centre): centre for centre in owner.values()}.values())

    @cached_property
    def common_point(self) -> Array | None:
        """(3,) where the axes of all passive joints meet; None where they don't, or some joint is not revolute."""
        revolute = all(joint.kind is LoopKind.REVOLUTE for joint in self.passive)
        return _meeting(self.passive) if self.passive and revolute else None

    @cached_property
    def crosses(self) -> frozenset[int]:
        """Bodies that don't count."""
        return frozenset(cross for centre in self.centres for cross in centre.crosses)

    # --- features -----------------------------------------------------------------------------------------------------

    @cached_property
    def features(self) -> list[Feature]:
        """Points and directions that determine the placements of all groups but the rotations of `unturned`: of each
        group but the base those of its joints, which it shares with other groups."""
        end, by_group = int(self.group[self._end]), self._by_group
        for group, features in by_group.items():
            member = self._end if group == end else int(np.flatnonzero(self.group == group)[0])
            placement = self.placements[member]
            if all(feature.is_direction for feature in features):
                features.append(Feature(member, False, np.zeros(3), placement.translation, False))
            if not _determine(features) and group not in self.unturned:
                features += [Feature(member, True, axis, placement.rotation @ axis, False) for axis in np.eye(3)]
        distinct = {id(feature): feature for features in by_group.values() for feature in features}
        return [feature for feature in distinct.values() if not feature.fixed]

    @cached_property
    def _by_group(self) -> dict[int, list[Feature]]:
        base, by_group = int(self.group[0]), defaultdict[int, list[Feature]](list)
        directions = [j for j in self.passive if j.kind is LoopKind.PRISMATIC]
        for groups, features in (*map(self._of_centre, self.centres), *map(self._of_direction, directions)):
            for group in groups - {base}:
                by_group[group] += features
        return by_group

    @cached_property
    def unturned(self) -> frozenset[int]:
        """The groups whose rotation about themselves distinguishes no modes: all rods, but for the end if there is
        nothing else."""
        rods = frozenset(group for group in self._by_group if self._is_rod(group))
        return rods - {int(self.group[self._end])} if len(rods) == len(self._by_group) else rods

    @property
    def ignores_end(self) -> bool:
        """True if modes that differ only in the end's rotation about itself are one mode."""
        end = int(self.group[self._end])
        return end in self.unturned and not _determine(self._by_group[end])

    def _is_rod(self, group: int) -> bool:
        """Return whether a group has two centres, of more than one DoF each, and nothing else, or is a half of such a
        rod that a prismatic joint lengthens: its rotation about the line between them does not count."""
        on, centres = self._on(group)
        if any(group in (self.group_of[side] for side in joint.sides) for joint in self.telescopes):
            return True
        return len(centres) == 2 and all(any(joint in c.joints for c in centres) for joint in on)

    def _on(self, group: int) -> tuple[list[LinkageJoint], list[JointCentre]]:
        """Return the passive joints of a group, and the centres of more than one DoF."""
        on = [joint for joint in self.passive if group in (self.group_of[side] for side in joint.sides)]
        return on, [c for c in self.centres if c.dof > 1 and any(joint in on for joint in c.joints)]

    @cached_property
    def telescopes(self) -> list[LinkageJoint]:
        """The passive prismatic joints that lengthen a rod.

        Each half of such a rod has one centre and, except for the prismatic joint, no joint that is not of this centre;
        the joint is along the line between the centres c1 and c2: (c2 - c1) x axis = 0.
        """
        telescopes = []
        for slide in (joint for joint in self.passive if joint.kind is LoopKind.PRISMATIC):
            halves = [self._on(self.group_of[side]) for side in slide.sides]
            if any(len(centres) != 1 for _, centres in halves):
                continue
            first, second = (centres[0] for _, centres in halves)
            others = [joint for joints, _ in halves for joint in joints if joint is not slide]
            is_rod = all(joint in first.joints or joint in second.joints for joint in others)
            if is_rod and np.abs(np.cross(second.at - first.at, slide.along)).max() < _MEET:
                telescopes.append(slide)
        return telescopes

    def _of_centre(self, centre: JointCentre) -> tuple[set[int], list[Feature]]:
        """Return the groups that a centre connects, and its features."""
        sides = {side for joint in centre.joints for side in joint.sides} - self.crosses
        groups, joint = {self.group_of[side] for side in sides}, centre.joints[0]
        local, fixed = self.placements[joint.carrier].actInv(centre.at), int(self.group[0]) in groups
        features = [Feature(joint.carrier, False, local, centre.at, fixed)]
        return groups, features + (self._of_direction(joint)[1] if centre.dof == 1 else [])

    def _of_direction(self, joint: LinkageJoint) -> tuple[set[int], list[Feature]]:
        groups = {self.group_of[side] for side in joint.sides}
        fixed = int(self.group[0]) in groups
        return groups, [Feature(joint.carrier, True, joint.axis, joint.along, fixed)]


def _determine(features: list[Feature]) -> bool:
    """Return whether a body's placement follows from these: a point, and two directions or differences of points."""
    points = [feature.at for feature in features if not feature.is_direction]
    rows = [feature.at for feature in features if feature.is_direction] + [point - points[0] for point in points[1:]]
    values = np.linalg.svd(np.array([*rows, np.zeros(3), np.zeros(3)]), compute_uv=False)
    return bool(points) and bool(values[1] > _INDEPENDENT)


def _meeting(joints: list[LinkageJoint]) -> Array | None:
    """Return where the axes of joints meet at home (3,); None if they don't, or are parallel."""
    nearest = common_point(*(np.array([getattr(joint, name) for joint in joints]) for name in ("at", "along")))
    return nearest[0] if nearest is not None and nearest[1] < _MEET else None
