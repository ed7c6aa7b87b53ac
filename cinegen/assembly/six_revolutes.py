"""`SixRevolutes`: modes of a loop of six revolute joints, as in the inverse problem of an arm, by elimination."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pinocchio as pin
from flint import arb, arb_mat

from cinegen.arrays import Array, Complex
from cinegen.assembly.bodies import LinkageJoint
from cinegen.assembly.distinct_solutions import SAME
from cinegen.assembly.elimination import BITS, DEGREE, DegenerateError, closures
from cinegen.assembly.exact_tree import ExactAxis, exact
from cinegen.assembly.linkage import Linkage
from cinegen.assembly.results import AssemblyModes
from cinegen.balls import frame, precise
from cinegen.hexapod import SolutionCounts
from cinegen.joints import common_point
from raff2urdf.raff.document import LoopKind

_EXACT = 1e-12  # rad, characteristic lengths: axes that were meant to meet, or to be parallel


class SixRevolutes:
    """Solves a linkage for one set of values of its locked joints after another.

    Args:
        linkage: to solve.
        series: indices of its six passive joints, from the base to the base.

    Attributes:
        special: "three axes through one point" or "three axes parallel" if three successive ones are so to within
            rounding, whatever the values of locked joints; else empty. Elimination does not count their solutions.
    """

    def __init__(self, linkage: Linkage, series: Sequence[int]) -> None:
        self._linkage = linkage
        self._joints = [linkage.bodies.passive[k] for k in series]
        self._sides = self._ordered()
        self.special = self._special()

    def modes(self, asked: Array) -> AssemblyModes | None:
        """Return all modes with the locked joints as in q (nq,) `asked`; None if elimination does not count them."""
        linkage, locked = self._linkage, self._linkage.locked_values(asked)
        try:
            all_closures = closures(self._constants(locked))
        except DegenerateError:
            return None
        modes, features, times = list[Array](), list[Complex](), list[int]()
        for number, angles in enumerate(all_closures.angles):
            q = linkage.closed(linkage.configuration(self._solution(angles), locked))
            if q is None and number < all_closures.real:
                return None
            if q is None:
                continue
            its = linkage.features(linkage.unknowns(q)[None], locked)[0]
            same = [k for k, other in enumerate(features) if np.abs(other - its).max() < SAME]
            if same:
                times[same[0]] += 1
            else:
                modes.append(q)
                features.append(its)
                times.append(1)
        curve = any(n > 1 and linkage.can_move(linkage.unknowns(q), locked) for q, n in zip(modes, times, strict=True))
        if curve:
            return None
        counts = SolutionCounts(sum(times), DEGREE - sum(times), 0, sum(n for n in times if n > 1), 0)
        method = (
            f"six revolute joints in series: elimination to a polynomial of degree {DEGREE}, in ball arithmetic: "
            f"{counts.real} real, {counts.complex} complex"
        )
        return AssemblyModes(
            linkage.mechanism, linkage.actuated_values(asked), tuple(modes), tuple(times), True, method, counts, None,
            None, (), (True,) * len(modes),
        )  # fmt: skip

    # --- geometry -----------------------------------------------------------------------------------------------------

    def _ordered(self) -> list[tuple[int, int]]:
        """Return the bodies, as the linkage numbers them, by which the loop enters and leaves each joint."""
        group, sides = self._linkage.bodies.group, []
        current = group[0]
        for joint in self._joints:
            first, second = joint.members
            enters, leaves = (first, second) if group[first] == current else (second, first)
            sides.append((enters, leaves))
            current = group[leaves]
        return sides

    def _solution(self, angles: Array) -> Complex:
        """Return the unknowns (k + 1,) for angles (6,) from one side to the other."""
        linkage = self._linkage
        solution = np.zeros(len(linkage.passive) + 1, dtype=complex)
        for joint, (enters, _), angle in zip(self._joints, self._sides, angles, strict=True):
            if _is_in_tree(joint):
                at = linkage.passive.index(linkage.joint_names[joint.members[1] - 1])
                solution[at] = angle if enters == joint.members[0] else -angle
        return solution

    def _constants(self, locked: Array) -> list[arb_mat]:
        """Return K1 to K6 for values (locked,) of the locked joints, see `elimination`; dimensionless."""
        linkage, ends, constants = self._linkage, [], []
        q = linkage.configuration(linkage.unknowns(linkage.mechanism.q_home), locked)
        with precise(BITS):
            rigid = self._rigid(q)
            for joint, (enters, _) in zip(self._joints, self._sides, strict=True):
                first, second = self._frames(joint)
                ends.append((first, second) if enters == joint.members[0] else (second, first))
            for k, (_, leaves) in enumerate(self._sides):
                after = (k + 1) % len(self._sides)
                between = _between(rigid, leaves, self._sides[after][0])
                rows = (ends[k][1].inv() * between * ends[after][0]).tolist()
                size = arb(linkage.mechanism.length)
                constants.append(arb_mat([[*row[:3], row[3] / size] for row in rows[:3]] + [[0, 0, 0, 1]]))
        return constants

    def _rigid(self, q: Array) -> dict[tuple[int, int], arb_mat]:
        """Return the placements, m, of bodies in bodies that locked joints, at q (nq,), or rigid cuts hold there."""
        linkage, mechanism = self._linkage, self._linkage.mechanism
        rigid = {}
        for name in linkage.locked:
            j = mechanism.model.getJointId(name)
            step = ExactAxis(mechanism.model.joints[j]).step(arb(float(q[mechanism.q_index(name)])))
            pair = int(mechanism.model.parents[j]) - linkage.root, j - linkage.root
            rigid[pair] = exact(mechanism.model.jointPlacements[j]) * step
        for cut, (_, first, _, second) in zip(linkage.cuts, mechanism.structure.system.anchors, strict=True):
            if cut.kind is LoopKind.RIGID:
                rigid[cut.bodies] = exact(first) * exact(second).inv()
        return rigid | {(b, a): placement.inv() for (a, b), placement in rigid.items()}

    def _frames(self, joint: LinkageJoint) -> tuple[arb_mat, arb_mat]:
        """Return the frames, m, whose common z axis a joint rotates about, in its first and its second body."""
        linkage, mechanism = self._linkage, self._linkage.mechanism
        if _is_in_tree(joint):
            j = joint.members[1] + linkage.root
            aside = np.eye(3)[np.abs(joint.axis).argmin()]
            local = frame(np.column_stack([aside, aside, joint.axis]), np.zeros(3))
            return exact(mechanism.model.jointPlacements[j]) * local, local
        at = next(k for k, cut in enumerate(linkage.cuts) if cut.bodies == joint.members and cut.kind is joint.kind)
        _, first, _, second = mechanism.structure.system.anchors[at]
        return exact(first), exact(second)

    def _special(self) -> str:
        """Return what three successive axes are that do not depend on locked joints."""
        constants = self._constants(self._linkage.locked_values(self._linkage.mechanism.q_home))
        placed = [pin.SE3(np.array([float(x) for x in k.entries()]).reshape(4, 4)) for k in constants]
        for before, after in pairwise(placed[:5]):
            lines = [before.inverse(), pin.SE3.Identity(), after]
            axes = np.array([line.rotation[:, 2] for line in lines])
            if np.abs(np.cross(axes, axes[1])).max() < _EXACT:
                return "three axes parallel"
            common = common_point(np.array([line.translation for line in lines]), axes)
            if common is not None and common[1] < _EXACT:
                return "three axes through one point"
        return ""


def _is_in_tree(joint: LinkageJoint) -> bool:
    return joint.carrier == joint.members[1]


def _between(rigid: dict[tuple[int, int], arb_mat], first: int, second: int) -> arb_mat:
    """Return the placement of a body in another one that is connected to it rigidly."""
    known = {first: exact(pin.SE3.Identity())}
    while second not in known:
        known |= {b: known[a] * step for (a, b), step in rigid.items() if a in known and b not in known}
    return known[second]
