"""The family of parallel manipulators that a linkage belongs to, by its structure alone, and its number of modes.

With joints locked, a linkage is a set of rigid groups of bodies, base among them, and passive joints. A rod is a group
with two joint centres: it keeps a distance. Where the end is does not matter. Known families:

    hexapod    six rods between base and platform, each with a universal and a ball joint at least: 40 modes
               (M. Raghavan, "The Stewart platform of general geometry has 40 configurations", J. Mechanical Design 115,
               1993); 16 if the rods meet in pairs at one of their ends in three points (see `cinegen.hexapod`)
    delta      three rods with universal joints, and a platform that does not rotate: three spheres, 2
    dyad       two bodies and three hinges in a plane or about a point: 2 (five-bar, four-bar, and their like)
    triad      a platform on three such bars: 6 in a plane (3-RPR and 3-RRR: K. Hunt, "Structural kinematics of
               in-parallel-actuated robot-arms", 1983), 8 about a point (C. Gosselin, J. Sefrioui, M. Richard, "On the
               direct kinematics of spherical three-degree-of-freedom parallel manipulators", J. Mechanical Design 116,
               1994)
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.assembly._kernels.tables import COLUMN, PARENT
from cinegen.assembly.bodies import JointCentre, LinkageBodies, LinkageJoint
from cinegen.assembly.linkage import Linkage
from raff2urdf.raff.document import LoopKind

_SAME = 1e-8  # characteristic lengths, radians: samples are closed to no more
_STILL = 1e-7  # a platform that rotates slower does not


class Rod(NamedTuple):
    """A body between two others that it keeps at a distance: its centres, the first on the base if one is."""

    body: int
    ends: tuple[JointCentre, JointCentre]
    others: tuple[int, int]

    @property
    def dof(self) -> int:
        """DoF of both joints together."""
        return self.ends[0].dof + self.ends[1].dof


class SixLegs(NamedTuple):
    """Six rods for given values of the locked joints, dimensionless.

    Attributes:
        base: (6, 3) their ends in the base.
        platform: (6, 3) their other ends, in the frame of `member`.
        lengths: (6,).
        member: the linkage's body that stands for the platform.
    """

    base: Array
    platform: Array
    lengths: Array
    member: int


@dataclass(frozen=True, eq=False)
class Family:
    """The family a linkage was recognised as.

    Attributes:
        name: hexapod, delta, dyad or triad; of the inverse problem see `chains`.
        description: of the structure.
        bound: largest number of modes, in the complex numbers.
        everywhere: whether that counts all modes, or only those of home's mode of operation.
        rods: between base and platform.
        names: of the rods.
        platform: number of the platform's group, -1 if there is none.
        series: indices of six passive revolute joints in their order, if these are all.
    """

    name: str
    description: str
    bound: int
    everywhere: bool
    rods: tuple[Rod, ...] = ()
    names: tuple[str, ...] = ()
    platform: int = -1
    series: tuple[int, ...] = ()

    def legs(self, groups: RigidGroups, locked: Array) -> SixLegs:
        """Return the rods for values (locked,) of the locked joints."""
        base, platform = (groups.placements(group, locked) for group in (groups.base, self.platform))
        ends = [[groups.point(end, groups.placements(rod.body, locked)) for end in rod.ends] for rod in self.rods]
        return SixLegs(
            np.array([groups.point(rod.ends[0], base) for rod in self.rods]),
            np.array([groups.point(rod.ends[1], platform) for rod in self.rods]),
            np.array([np.linalg.norm(second - first) for first, second in ends]),
            next(iter(platform)),
        )


class RigidGroups:
    """The bodies of a linkage, those connected by locked joints as one.

    Attributes:
        of: the group of each body.
        base: group of the base.
        centres: of each group.
    """

    def __init__(self, linkage: Linkage) -> None:
        self._linkage, self._bodies = linkage, linkage.bodies
        self.of = self._bodies.group_of
        self.base = int(self._bodies.group[0])
        self.centres: dict[int, list[JointCentre]] = defaultdict(list)
        for centre in self._bodies.centres:
            sides = {side for joint in centre.joints for side in joint.sides} - self._bodies.crosses
            for group in {self.of[side] for side in sides}:
                self.centres[group].append(centre)

    def other(self, centre: JointCentre, group: int) -> int:
        """Return the group on the other side of a centre."""
        sides = {g for g, centres in self.centres.items() if centre in centres} - {group}
        return sides.pop() if len(sides) == 1 else group

    def placements(self, group: int, locked: Array) -> dict[int, pin.SE3]:
        """Return the placements of a group's bodies, as the linkage numbers them, in the frame of the first, for values
        (locked,) of the locked joints; dimensionless."""
        linkage, mechanism = self._linkage, self._linkage.mechanism
        q = linkage.configuration(linkage.unknowns(mechanism.q_home), locked)
        pin.forwardKinematics(mechanism.model, mechanism.structure.system.data, q)
        first, *left = np.flatnonzero(self._bodies.group == group).tolist()
        placements = {first: pin.SE3.Identity()}
        while left:
            steps = ((a, b, self._step(a, b)) for a in placements for b in left)
            a, b, step = next(candidate for candidate in steps if candidate[2] is not None)
            placements[b] = placements[a] * step
            left.remove(b)
        return placements

    def _step(self, a: int, b: int) -> pin.SE3 | None:
        """Return the placement of a body in the frame of another that it is rigidly connected to, or by one locked
        joint, where joints were placed last; None if neither is so."""
        bodies, linkage, joints = self._bodies, self._linkage, self._linkage.tables.joints
        if bodies.body[a] == bodies.body[b]:  # a rigid cut
            return bodies.placements[a].actInv(bodies.placements[b])
        for parent, child in ((a, b), (b, a)):
            if child and joints[child - 1, PARENT] == parent and joints[child - 1, COLUMN] > len(linkage.passive):
                step = linkage.mechanism.structure.system.data.liMi[child + linkage.root]
                step = pin.SE3(step.rotation, step.translation / linkage.mechanism.length)
                return step if child == b else step.inverse()
        return None

    def point(self, centre: JointCentre, placements: dict[int, pin.SE3]) -> Array:
        """Return where a centre (3,) is in the frame of a group's first body, for the group's placements."""
        member = next(m for joint in centre.joints for m in joint.members if m in placements)
        return np.asarray(placements[member].act(self._bodies.placements[member].actInv(centre.at)))

    def direction(self, joint: LinkageJoint, placements: dict[int, pin.SE3]) -> Array:
        """Return a joint's axis (3,) in the frame of the first body of a group that it is on."""
        member = next(m for m in joint.members if m in placements)
        return np.asarray(placements[member].rotation @ self._bodies.placements[member].rotation.T @ joint.along)

    def rods(self) -> list[Rod]:
        """Return the groups with two centres, except the base."""
        rods = []
        for group, centres in self.centres.items():
            if group != self.base and len(centres) == 2:
                ends = sorted(centres, key=lambda centre: self.other(centre, group) != self.base)
                others = self.other(ends[0], group), self.other(ends[1], group)
                rods.append(Rod(group, (ends[0], ends[1]), others))
        return rods

    def drivers(self, rod: Rod) -> tuple[str, ...]:
        """Return the names of the locked joints that change a rod's length, or move its first end."""
        linkage, bodies, tables = self._linkage, self._bodies, self._linkage.tables
        within = [j for j in bodies.joints if j.locked and {self.of[side] for side in j.sides} == {rod.body}]
        moved = {max(joint.members) - 1 for joint in within}
        if not moved:
            members = {m for joint in rod.ends[0].joints for m in joint.members if bodies.group[m] == self.base}
            above = {int(k) for m in members for k in np.flatnonzero(tables.above[m])}
            moved = {k for k in above if tables.joints[k, COLUMN] > len(linkage.passive)}
        return tuple(linkage.joint_names[k] for k in sorted(moved))


def recognise(linkage: Linkage) -> Family | None:
    """Return the family that a linkage belongs to; None if it is none of the known ones."""
    passive = linkage.bodies.passive
    if not passive or linkage.has_mimics or any(joint.kind is LoopKind.PRISMATIC for joint in passive):
        return None
    groups = RigidGroups(linkage)
    moving = [group for group, centres in groups.centres.items() if group != groups.base and centres]
    rods = groups.rods()
    if all(centre.dof == 1 for centre in linkage.bodies.centres):
        # parallel at home may be so by chance
        where = {_in_a_plane_or_about_a_point(linkage.bodies_at(q)) for q in linkage.mechanism.structure.samples}
        only = where.pop()
        return _of_hinges(groups, linkage, moving, only) if not where and only is not None else None
    platforms = [group for group in moving if group not in {rod.body for rod in rods}]
    if len(platforms) != 1 or any(rod.others != (groups.base, platforms[0]) for rod in rods):
        return None
    if set(groups.centres[platforms[0]]) != {rod.ends[1] for rod in rods}:
        return None
    if len(rods) == 6 and all(rod.dof >= 5 for rod in rods):
        description = "six rods between base and platform"
        return Family("hexapod", description, 40, True, *_ordered(groups, linkage, rods), platforms[0])
    if len(rods) == 3 and all(rod.dof == 4 for rod in rods) and not _rotates(linkage, platforms[0]):
        description = "three rods on a platform that keeps its orientation"
        return Family("delta", description, 2, False, *_ordered(groups, linkage, rods), platforms[0])
    return None


def _ordered(groups: RigidGroups, linkage: Linkage, rods: list[Rod]) -> tuple[tuple[Rod, ...], tuple[str, ...]]:
    """Return the rods in the order of the actuated joints that drive them, and names after these; as they are, and
    numbered, if not each has one of its own."""
    actuated, drivers = linkage.mechanism.actuated, [groups.drivers(rod) for rod in rods]
    if any(len(driving) != 1 for driving in drivers) or len(set(drivers)) < len(rods):
        return tuple(rods), tuple(f"rod {k + 1}" for k in range(len(rods)))
    order = sorted(range(len(rods)), key=lambda k: actuated.index(drivers[k][0]))
    return tuple(rods[k] for k in order), tuple(f"the rod of '{drivers[k][0]}'" for k in order)


def _of_hinges(groups: RigidGroups, linkage: Linkage, moving: list[int], where: str) -> Family | None:
    hinges = {id(centre) for centres in groups.centres.values() for centre in centres}
    if len(moving) == 2 and len(hinges) == 3:
        return Family("dyad", f"two bodies and three hinges {where}", 2, True)
    for platform in moving if len(moving) == 4 and len(hinges) == 6 else ():
        on = {groups.other(centre, platform) for centre in groups.centres[platform]}
        if len(groups.centres[platform]) == 3 and on == set(moving) - {platform}:
            rods = [rod for rod in groups.rods() if platform in rod.others]
            bound = 6 if where == "in a plane" else 8
            description = f"a platform on three bars {where}"
            return Family("triad", description, bound, True, *_ordered(groups, linkage, rods), platform)
    return None


def _in_a_plane_or_about_a_point(bodies: LinkageBodies) -> str | None:
    """Return whether all passive axes are parallel, or all meet in one point, as bodies are now."""
    axes = np.array([joint.along for joint in bodies.passive])
    if np.abs(np.cross(axes, axes[0])).max() < _SAME:
        return "in a plane"
    return "about a point" if bodies.common_point is not None else None


def _rotates(linkage: Linkage, platform: int) -> bool:
    """Return whether the platform rotates in any motion that the loops allow."""
    mechanism = linkage.mechanism
    joint = int(np.flatnonzero(linkage.bodies.group == platform)[0]) + linkage.root
    columns = [mechanism.v_index(name) for name in linkage.joint_names]  # a base that could move is fixed
    for q in mechanism.structure.samples:
        rows = (mechanism.loop_jacobian(q) * mechanism.scale)[:, columns]
        motions = np.linalg.svd(rows)[2][mechanism.loop_rank :].T
        data = mechanism.structure.system.data
        rotations = (pin.computeJointJacobian(mechanism.model, data, q, joint)[3:] * mechanism.scale)[:, columns]
        if np.abs(rotations @ motions).max(initial=0.0) > _STILL:
            return True
    return False
