"""Which family of parallel manipulators a linkage belongs to, by its structure alone: how many modes it can have.

With its motors held, a linkage is a set of groups of bodies, base among them, and passive joints. A rod is a group with
two centres of joints: it holds a distance. Where the end is does not matter. Known families:

    hexapod    six rods between base and platform, each with a universal and a ball joint at least: 40 modes
               (M. Raghavan, "The Stewart platform of general geometry has 40 configurations", J. Mechanical Design 115,
               1993); 16 where the rods meet in pairs at one of their ends in three points (see `triangle`)
    delta      three rods with universal joints, and a platform that does not turn: three spheres, 2
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
from numpy.typing import NDArray

from cinegen.assembly._kernels import MOTOR, PARENT, PRISMATIC, SLIDES, Tables
from cinegen.assembly.bodies import Bodies, Centre, Joint
from cinegen.assembly.linkage import Linkage

Array = NDArray[np.float64]

_SAME = 1e-8  # characteristic lengths, radians: samples are closed to no more
_STILL = 1e-7  # a platform that turns slower does not


class Rod(NamedTuple):
    """A body between two others that it keeps at a distance: its centres, the first on the base if one is."""

    body: int
    ends: tuple[Centre, Centre]
    others: tuple[int, int]

    @property
    def freedoms(self) -> int:
        """Of both joints together."""
        return self.ends[0].freedoms + self.ends[1].freedoms


class Legs(NamedTuple):
    """Six rods for given values of the motors, without unit.

    Attributes:
        base: (6, 3) their ends in the base.
        platform: (6, 3) their other ends, seen from `member`.
        lengths: (6,).
        member: the linkage's body that stands for the platform.
    """

    base: Array
    platform: Array
    lengths: Array
    member: int


@dataclass(frozen=True, eq=False)
class Family:
    """What a linkage was recognised as.

    Attributes:
        name: hexapod, delta, dyad or triad.
        words: what it is, for people.
        bound: how many modes it has at most, in the complex numbers.
        everywhere: whether that counts all modes, or only those of home's mode of operation.
        rods: between base and platform.
        names: of the rods.
        platform: number of the platform's group, -1 where there is none.
    """

    name: str
    words: str
    bound: int
    everywhere: bool
    rods: tuple[Rod, ...]
    names: tuple[str, ...]
    platform: int

    def legs(self, groups: Groups, motors: Array) -> Legs:
        """The rods, for values (motors,) of the motors."""
        base, platform = groups.placements(groups.base, motors), groups.placements(self.platform, motors)
        lengths = []
        for rod in self.rods:
            own = groups.placements(rod.body, motors)
            first, second = (groups.point(end, rod.body, own) for end in rod.ends)
            lengths.append(np.linalg.norm(second - first))
        return Legs(
            np.array([groups.point(rod.ends[0], groups.base, base) for rod in self.rods]),
            np.array([groups.point(rod.ends[1], self.platform, platform) for rod in self.rods]),
            np.array(lengths),
            next(iter(platform)),
        )


class Groups:
    """The bodies of a linkage while its motors are held: those that motors join are one."""

    def __init__(self, linkage: Linkage) -> None:
        self.linkage, bodies = linkage, linkage.bodies
        self.of = {int(body): int(group) for body, group in zip(bodies.body, bodies.group, strict=True)}
        self.base = self.of[int(bodies.body[0])]
        self.end = self.of[int(bodies.body[linkage.end])]
        self.centres: dict[int, list[Centre]] = defaultdict(list)
        crosses = bodies.crosses
        for centre in bodies.centres:
            for body in {side for joint in centre.joints for side in joint.sides} - crosses:
                if centre not in self.centres[self.of[body]]:
                    self.centres[self.of[body]].append(centre)

    def other(self, centre: Centre, group: int) -> int:
        """The group on the other side of a centre."""
        sides = {g for g, centres in self.centres.items() if centre in centres} - {group}
        return sides.pop() if len(sides) == 1 else group

    def placements(self, group: int, motors: Array) -> dict[int, Array]:
        """(4, 4) of each of the linkage's bodies in a group, seen from the first of them, for values of the motors."""
        bodies, tables = self.linkage.bodies, self.linkage.tables
        members = [b for b in range(len(bodies.body)) if self.of[int(bodies.body[b])] == group]
        found = {members[0]: np.eye(4)}
        while len(found) < len(members):
            for b in members:
                if b in found:
                    continue
                for a, placement in list(found.items()):
                    step = self._step(a, b, tables, motors)
                    if step is not None:
                        found[b] = placement @ step
                        break
        return found

    def _step(self, a: int, b: int, tables: Tables, motors: Array) -> Array | None:
        """(4, 4) of a body seen from another that is rigid with it, or that one motor holds; None if neither is so."""
        bodies = self.linkage.bodies
        if bodies.body[a] == bodies.body[b]:  # cut, and rigid
            return np.asarray(np.linalg.inv(_full(bodies.placements[a])) @ _full(bodies.placements[b]), dtype=float)
        if b and tables.joints[b - 1, PARENT] == a and tables.joints[b - 1, MOTOR] >= 0:
            return _joint(tables, b - 1, motors)
        if a and tables.joints[a - 1, PARENT] == b and tables.joints[a - 1, MOTOR] >= 0:
            return np.asarray(np.linalg.inv(_joint(tables, a - 1, motors)), dtype=float)
        return None

    def point(self, centre: Centre, group: int, placements: dict[int, Array]) -> Array:
        """(3,) where a centre is in a group, seen from its first body."""
        member = next(m for joint in centre.joints for m in joint.members if m in placements)
        return np.asarray((placements[member] @ np.append(self.linkage.bodies.local(member, centre.at), 1.0))[:3])

    def direction(self, joint: Joint, placements: dict[int, Array]) -> Array:
        """(3,) a joint's axis in a group that it is on, seen from the group's first body."""
        member = next(m for m in joint.members if m in placements)
        local = self.linkage.bodies.placements[member][:, :3].T @ joint.along
        return np.asarray(placements[member][:3, :3] @ local)

    def rods(self) -> list[Rod]:
        """Groups with two centres, the base apart."""
        found = []
        for group, centres in self.centres.items():
            if group == self.base or len(centres) != 2:
                continue
            others = self.other(centres[0], group), self.other(centres[1], group)
            ends = centres[0], centres[1]
            if others[1] == self.base:
                others, ends = (others[1], others[0]), (ends[1], ends[0])
            found.append(Rod(group, ends, others))
        return found

    def drivers(self, rod: Rod) -> tuple[str, ...]:
        """Names of the motors that change a rod's length, or carry its first end."""
        linkage, tables = self.linkage, self.linkage.tables
        within = [j for j in linkage.bodies.joints if j.held and {self.of[side] for side in j.sides} == {rod.body}]
        moved = {max(joint.members) - 1 for joint in within}
        if not moved:
            carriers = {m for joint in rod.ends[0].joints for m in joint.members if self.of_member(m) == self.base}
            moved = {int(k) for m in carriers for k in np.flatnonzero(tables.above[m]) if tables.joints[k, MOTOR] >= 0}
        return tuple(linkage.joint_names[k] for k in sorted(moved))

    def of_member(self, member: int) -> int:
        """The group of one of the linkage's bodies."""
        return int(self.linkage.bodies.group[member])


def _full(placement: Array) -> Array:
    return np.vstack([placement, [0.0, 0.0, 0.0, 1.0]])


def _joint(tables: Tables, k: int, motors: Array) -> Array:
    """(4, 4) of a joint's body in its parent."""
    constants, value = tables.constants[k], float(motors[tables.joints[k, MOTOR]])
    fixed, moved = np.eye(4), np.eye(4)
    fixed[:3, :3], fixed[:3, 3] = constants[:9].reshape(3, 3), constants[9:12]
    if tables.joints[k, SLIDES]:
        moved[:3, 3] = value * constants[12:15]
    else:
        moved[:3, :3] = pin.exp3(value * constants[12:15])
    return np.asarray(fixed @ moved)


def recognise(linkage: Linkage) -> Family | None:
    """The family that a linkage belongs to; None where it is none that is known."""
    passive = [joint for joint in linkage.bodies.joints if not joint.held]
    if not passive or any(joint.kind == PRISMATIC for joint in passive):
        return None
    groups = Groups(linkage)
    moving = [group for group, centres in groups.centres.items() if group != groups.base and centres]
    rods = groups.rods()
    if all(centre.freedoms == 1 for centre in linkage.bodies.centres):
        # parallel at home may be so by chance
        where = {_in_a_plane_or_about_a_point(linkage.bodies_at(q)) for q in linkage.mechanism.samples}
        only = where.pop()
        return _of_hinges(groups, moving, only) if not where and only is not None else None
    platforms = [group for group in moving if group not in {rod.body for rod in rods}]
    if len(platforms) != 1 or any(rod.others != (groups.base, platforms[0]) for rod in rods):
        return None
    if set(groups.centres[platforms[0]]) != {rod.ends[1] for rod in rods}:
        return None
    if len(rods) == 6 and all(rod.freedoms >= 5 for rod in rods):
        words = "six rods between base and platform"
        return Family("hexapod", words, 40, True, *_ordered(groups, rods), platform=platforms[0])
    if len(rods) == 3 and all(rod.freedoms == 4 for rod in rods) and not _turns(linkage, platforms[0]):
        words = "three rods on a platform that keeps its orientation"
        return Family("delta", words, 2, False, *_ordered(groups, rods), platform=platforms[0])
    return None


def _ordered(groups: Groups, rods: list[Rod]) -> tuple[tuple[Rod, ...], tuple[str, ...]]:
    """Rods in the order of the motors that drive them, and after which they are named; as they are, and numbered, where
    not each has one of its own."""
    actuated = groups.linkage.mechanism.actuated
    drivers = [groups.drivers(rod) for rod in rods]
    if any(len(own) != 1 for own in drivers) or len(set(drivers)) < len(rods):
        return tuple(rods), tuple(f"rod {k + 1}" for k in range(len(rods)))
    order = sorted(range(len(rods)), key=lambda k: actuated.index(drivers[k][0]))
    return tuple(rods[k] for k in order), tuple(f"the rod of '{drivers[k][0]}'" for k in order)


def _of_hinges(groups: Groups, moving: list[int], where: str) -> Family | None:
    hinges = {id(centre) for centres in groups.centres.values() for centre in centres}
    if len(moving) == 2 and len(hinges) == 3:
        return Family("dyad", f"two bodies and three hinges {where}", 2, True, (), (), -1)
    if len(moving) == 4 and len(hinges) == 6:
        for platform in moving:
            bars = [group for group in moving if group != platform]
            on = {groups.other(centre, platform) for centre in groups.centres[platform]}
            if len(groups.centres[platform]) == 3 and on == set(bars):
                bound = 6 if where == "in a plane" else 8
                rods = [rod for rod in groups.rods() if platform in rod.others]
                words = f"a platform on three bars {where}"
                return Family("triad", words, bound, True, *_ordered(groups, rods), platform=platform)
    return None


def _in_a_plane_or_about_a_point(bodies: Bodies) -> str | None:
    """Whether all passive axes are parallel, or all meet in one point, as bodies are now."""
    axes = np.array([joint.along for joint in bodies.joints if not joint.held])
    if np.abs(np.cross(axes, axes[0])).max() < _SAME:
        return "in a plane"
    return "about a point" if bodies.common_point is not None else None


def _turns(linkage: Linkage, platform: int) -> bool:
    """Whether the platform turns in any motion that the loops allow."""
    mechanism = linkage.mechanism
    joint = int(np.flatnonzero(linkage.bodies.group == platform)[0]) + linkage.root
    columns = [mechanism.v_index(name) for name in linkage.joint_names]  # a base that could move stands still
    for q in mechanism.samples:
        rows = (mechanism.loop_jacobian(q) * mechanism.scale)[:, columns]
        motions = np.linalg.svd(rows)[2][mechanism.loop_rank :].T
        data = mechanism.system.data
        turning = (pin.computeJointJacobian(mechanism.model, data, q, joint)[3:] * mechanism.scale)[:, columns]
        if np.abs(turning @ motions).max(initial=0.0) > _STILL:
            return True
    return False
