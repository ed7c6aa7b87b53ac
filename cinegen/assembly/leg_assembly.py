"""`LegAssembly`: the joint values that belong to a placement of the platform, leg by leg."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.assembly._kernels.tables import COLUMN, LOST, Complex, LinkageScratch, LinkageTables, ParameterPath
from cinegen.assembly._kernels.tracking import solve_from
from cinegen.assembly.bodies import CutJoint
from cinegen.assembly.families import RigidGroups, Rod
from cinegen.assembly.linkage import ACCURACY, Linkage
from cinegen.assembly.linkage_tables import attached, scratch_of
from raff2urdf.closure import rank
from raff2urdf.raff.document import LoopKind

_ATTEMPTS = 40
_ROUNDING = 1e-9


class _Leg(NamedTuple):
    """Unknowns of a leg, the joints that are locked meanwhile, and the leg's own tables."""

    columns: list[int]
    others: list[int]
    tables: LinkageTables
    scratch: LinkageScratch


class LegAssembly:
    """Computes the passive joints of a linkage whose platform is fixed somewhere: one leg after the other, each by
    Newton's method from home, or else from random values.

    Args:
        linkage: with a platform.
        member: the linkage's body that stands for the platform.
    """

    def __init__(self, linkage: Linkage, member: int) -> None:
        self._linkage = linkage
        identity = np.vstack([np.eye(3), np.zeros(3)])
        self._cuts = [CutJoint(LoopKind.RIGID, (0, member), np.array([identity, identity])), *linkage.cuts]
        self._legs = [self._leg(columns, loops) for columns, loops in self._blocks()]

    def _blocks(self) -> list[tuple[list[int], list[int]]]:
        """Return unknowns and loops of each leg, in an order in which each needs those before it alone."""
        tables, known = self._linkage.tables, set[int]()
        unknowns = len(self._linkage.passive)
        needed = []
        for cut in self._cuts:
            joints = np.flatnonzero(tables.above[cut.bodies[0]] != tables.above[cut.bodies[1]])
            needed.append({int(c) for c in tables.joints[joints, COLUMN] if c < unknowns})
        blocks, left = [], list(range(len(needed)))
        while left:
            first = min(left, key=lambda loop: (loop != 0, len(needed[loop] - known)))
            columns, loops = needed[first] - known, {first}
            # loops that share unknowns belong together
            while first != 0 and (more := {loop for loop in left if needed[loop] & columns} - loops):
                loops |= more
                columns = columns.union(*(needed[loop] for loop in more)) - known
            if columns:
                blocks.append((sorted(columns), sorted(loops)))
            known |= columns
            left = [loop for loop in left if loop not in loops]
        return blocks

    def _leg(self, columns: list[int], loops: list[int]) -> _Leg:
        """Return the tables of a leg: its own unknowns, and all other joints locked."""
        tables, mechanism = self._linkage.tables, self._linkage.mechanism
        joints = tables.joints.copy()
        others = [k for k in range(len(joints)) if joints[k, COLUMN] not in columns]
        for k, column in enumerate(tables.joints[:, COLUMN]):
            joints[k, COLUMN] = len(columns) + 1 + others.index(k) if k in others else columns.index(column)
        vectors, local, differences, products = attached([self._cuts[loop] for loop in loops])
        tables = LinkageTables(joints, tables.constants, tables.above, vectors, local, differences, products, 0, 0)
        scratch, full = scratch_of(tables, len(columns)), 0
        for q in mechanism.structure.samples:  # the rank: a rod may rotate about itself
            solution = self._linkage.unknowns(q)
            values = self._values(solution, self._linkage.locked_values(q))
            self._linkage.kernel.evaluate(tables, _fixed(values[others]), np.append(solution[columns], 0.0), scratch)
            full = max(full, rank(scratch.matrix[: len(columns), :-1].real))
        return _Leg(columns, others, tables._replace(rank=full + 1), scratch)

    def _values(self, solution: Complex, locked: Array) -> Array:
        """Return the values (n,) of all joints."""
        return np.concatenate([solution.real, locked])[self._linkage.tables.joints[:, COLUMN]]

    def unknowns(self, placement: Array, locked: Array) -> Complex | None:
        """Return the passive joints' values (k + 1,) with the platform at a placement (4, 4), dimensionless; None if a
        leg can't be assembled so."""
        linkage = self._linkage
        solution = linkage.unknowns(linkage.mechanism.q_home)
        for number, leg in enumerate(self._legs):
            if number == 0:  # the base's vectors follow the platform's, its origin first
                leg.tables.local[1::2] = np.vstack([placement[:3, 3], placement[:3, :3].T])
            values = self._values(solution, locked)[leg.others]
            solved = _solve(leg, _fixed(values), solution[leg.columns])
            if solved is None:
                return None
            solution[leg.columns] = solved
        return solution


def _solve(leg: _Leg, path: ParameterPath, home: Complex) -> Complex | None:
    guess, ends, rng = np.append(home, 0.0)[None], np.zeros(1, dtype=np.int64), None
    for _ in range(_ATTEMPTS):
        solve_from(leg.tables, path, guess, ends, leg.scratch)
        if ends[0] != LOST:
            return np.asarray(guess[0, :-1])
        rng = rng or np.random.default_rng(0)
        guess[0, :-1] = home + rng.uniform(-np.pi, np.pi, size=len(home))
    return None


def _fixed(values: Array) -> ParameterPath:
    """Return the path on which joints stay at values (others,)."""
    lines, slices = np.zeros((2, len(values), 2), dtype=complex), np.zeros((2, 2), dtype=complex)
    lines[:, :, 0], slices[:, 0] = values, 1.0
    return ParameterPath(lines, slices, False, ACCURACY)


def is_out_of_reach(groups: RigidGroups, rod: Rod, platform: int, placement: Array, locked: Array) -> bool:
    """Return whether one of a rod's universal joints can't be assembled with the platform at a placement.

    A universal joint's second axis keeps its angles with the first and with the rod. Three directions with angles of
    given cosines exist if, and only if, the determinant of their scalar products is not negative.

    Args:
        groups: of the linkage.
        rod: from base to platform.
        platform: the platform's group.
        placement: (4, 4) of the platform's first body in the base, dimensionless.
        locked: (locked,) values.
    """
    on_rod = groups.placements(rod.body, locked)
    sides = (
        (groups.base, groups.placements(groups.base, locked)),
        (platform, {m: pin.SE3(placement) * local for m, local in groups.placements(platform, locked).items()}),
    )
    inner = [groups.point(end, on_rod) for end in rod.ends]
    outer = [groups.point(end, placements) for end, (_, placements) in zip(rod.ends, sides, strict=True)]
    along_inner, along_outer = ((b - a) / np.linalg.norm(b - a) for a, b in (inner, outer))
    for end, (group, placements) in zip(rod.ends, sides, strict=True):
        if len(end.joints) != 2:
            continue
        outer_joint, inner_joint = end.joints
        if group not in {groups.of[side] for side in outer_joint.sides}:
            outer_joint, inner_joint = inner_joint, outer_joint
        a = float(outer_joint.along @ inner_joint.along)
        b = float(groups.direction(inner_joint, on_rod) @ along_inner)
        c = float(groups.direction(outer_joint, placements) @ along_outer)
        if 1.0 - a * a - b * b - c * c + 2.0 * a * b * c < -_ROUNDING:
            return True
    return False
