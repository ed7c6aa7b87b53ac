"""The equations F(x; p) = 0 of any mechanism as data: chains of placements and variables, and what closes on what.

A variable is a joint that rotates about z or slides along z. Those of a pose are variables too: the pose is the end of
a chain of three prismatic joints and three revolute ones, R = Rz(rz) Ry(ry) Rx(rx), and the node's frame coincides with
it. So loops, poses and their derivatives need one formula. A closure is seen from the body where its two chains
branch, in the axes of the first joint behind it: what is parallel to the axes there, as all axes of a planar linkage
are, is exactly so, and the equations out of its plane are exactly 0.

Numbers are the model's, with a radius that encloses what the robot's file states: converting degrees and millimetres,
and composing placements, rounds by less. Exact zeros and ones stay exact.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.errors import CinegenError
from cinegen.joints import axis
from cinegen.model import Mechanism
from cinegen.singularities.ball_joints import balls
from cinegen.singularities.slice import POSE
from raff2urdf.raff.document import LoopKind

RADIUS = 2.0**-46
"""Radius of a number of a placement; times the characteristic length, of one that is a length."""

_AXES = ("x", "y", "z", "z", "y", "x")  # of the pose's joints, in the order of their chain x, y, z, rz, ry, rx
_CHAIN = (0, 1, 2, 5, 4, 3)  # indices of POSE in that order
_KINDS = {  # axes along which origins coincide, number of constrained rotations
    LoopKind.RIGID: ([0, 1, 2], 3),
    LoopKind.PRISMATIC: ([0, 1], 3),
    LoopKind.REVOLUTE: ([0, 1, 2], 2),
    LoopKind.BALL: ([0, 1, 2], 0),
}


class ProofError(CinegenError):
    """A proof that can't be attempted."""


class Exporter:
    """Writes the equations of a mechanism and of the pose of a node.

    Args:
        mechanism: without ball joints of one piece (`Mechanism.successive`).
        node: whose pose.
        at: (6,) the pose, in the order of `POSE`, where nothing varies.
        over: ranges of the coordinates that vary, m and rad.
        coordinates: names of all that are given.
        constant: names of those along which the node never moves; the others follow.
        limits: whether all joint values are wanted. Else those of a ball joint that carries the node are left out.
        bodies: joints whose placements are wanted, too.
    """

    _turned: Sequence[tuple[str, int]] = ()  # axes and variables of what turns the node about its origin, besides

    def __init__(
        self, mechanism: Mechanism, node: str, at: Array, over: Mapping[str, tuple[float, float]],
        coordinates: Collection[str], constant: Collection[str], limits: bool, bodies: Sequence[int] = (),
    ) -> None:  # fmt: skip
        self._mechanism, self._model, self._length = mechanism, mechanism.model, mechanism.length
        self._placements = list[list[float]]()
        self._index = dict[bytes, int]()
        self._joints = [mechanism.model.getJointId(name) for name in mechanism.joints]
        self._variable = {j: k for k, j in enumerate(self._joints)}
        self._turns = {j: _to_z(axis(self._model.joints[j])) for j in self._joints}
        self._first = dict[int, pin.SE3]()
        for j in range(1, self._model.njoints):
            placed = self._placed(j) * pin.SE3(self._turns.get(j, np.eye(3)), np.zeros(3))
            self._first.setdefault(int(self._model.parents[j]), placed)
        self._bodies = bodies
        self._node, self._at, self._over, self._coordinates = node, at, over, coordinates
        self._known = {*coordinates, *constant}
        self._frame = self._model.frames[mechanism.frame_id(node)]
        self._rotation = any(name in coordinates for name in POSE[3:])
        chain = [j for j in map(int, self._model.supports[self._frame.parentJoint]) if j in self._variable]
        self._threes = [tuple(mechanism.joints.index(name) for name in three) for three in balls(mechanism)]
        is_known = self._rotation and len(self._known) == 6
        self._is_on_ball = is_known and not limits and tuple(self._variable[j] for j in chain[-3:]) in self._threes
        if self._is_on_ball:
            for j in chain[-3:]:
                del self._variable[j]

    def document(self, q: Array) -> dict[str, Any]:
        """Return the equations as JSON values; joints that are not unknown are as in q (nq,)."""
        mechanism, model, count = self._mechanism, self._model, len(self._joints)
        frame = self._frame
        loops = mechanism.structure.system
        closures = [closure for i in range(len(mechanism.loops)) for closure in self._of_loop(i)]
        second, second_end = self._chain(0, frame.parentJoint, frame.placement)
        end = pin.SE3.Identity()
        if self._rotation and second:  # compare origins on the last axis, where fewer joints move them
            end = self._of_joint(frame.parentJoint)
            second_end = self._placement(pin.SE3.Identity())
        first, first_end = self._target(end)
        pose = {
            "first": first, "first_end": first_end, "second": second, "second_end": second_end,
            "translations": [0, 1, 2], "rotations": 3 * (self._rotation and not self._is_on_ball),
        }  # fmt: skip
        bodies = [self._body(joint) for joint in self._bodies]
        chains = [closure[side] for closure in (*closures, pose, *bodies) for side in ("first", "second")]
        used = {k for chain in chains for _, k in chain}
        used |= {self._variable[model.getJointId(name)] for coupling in mechanism.couplings for name in coupling.terms}
        follow = {count + k for k, name in enumerate(POSE) if name not in self._known}
        known = {mechanism.joints.index(name) for name in (*mechanism.held, *mechanism.structure.idle_joints)}
        low, high = mechanism.limits.lower, mechanism.limits.upper
        at = [mechanism.q_index(name) for name in mechanism.joints]
        variables = [
            {
                "name": name,
                "prismatic": mechanism.is_prismatic(name),
                "limits": [float(x) if np.isfinite(x) else None for x in (low[k], high[k])],
                "at": float(q[k]),
                "unit": float(mechanism.scale[mechanism.v_index(name)]),
            }
            for name, k in zip(mechanism.joints, at, strict=True)
        ] + [
            {"name": name, "prismatic": k < 3, "limits": [None, None], "at": float(self._at[k]), "unit": 1.0}
            for k, name in enumerate(POSE)
        ]  # fmt: skip
        document = {
            "robot": mechanism.name,
            "node": self._node,
            "length": self._length,
            "radius": RADIUS,
            "variables": variables,
            "joints": count,
            "unknown": sorted(used & {*range(count), *follow} - known),
            "given": [count + POSE.index(name) for name in self._coordinates],
            "actuated": sorted(self._variable[model.getJointId(name)] for name in mechanism.actuated),
            "over": {str(count + POSE.index(name)): list(map(float, ends)) for name, ends in self._over.items()},
            "closures": [*closures, pose],
            "bodies": bodies,
            "couplings": [
                {
                    "terms": [
                        [self._variable[model.getJointId(name)], list(map(float, c))] for name, c in each.terms.items()
                    ],
                    "constant": float(each.constant),
                    "size": float(size),
                }
                for each, size in zip(mechanism.couplings, loops.coupling_sizes, strict=True)
            ],
        }  # fmt: skip
        return {**document, "placements": self._placements}

    # --- chains ------------------------------------------------------------------------------------------------------

    def _placed(self, j: int) -> pin.SE3:
        placement = pin.SE3(self._model.jointPlacements[j])
        if j not in self._variable:  # a free base stays where it is
            data = self._model.joints[j].createData()
            self._model.joints[j].calc(data, self._mechanism.q_home)
            placement = placement * data.M
        return placement

    def _chain(self, branch: int, joint: int, end: pin.SE3) -> tuple[list[list[int]], int]:
        """Return placements and variables from a branch's body to a joint's, and the placement of an end on it."""
        first = self._first.get(branch, pin.SE3.Identity())
        turn = pin.SE3(first.rotation, first.translation if branch else np.zeros(3))
        before, chain = turn.inverse(), list[list[int]]()
        supports = list(map(int, self._model.supports[joint]))
        for j in supports[supports.index(branch) + 1 :]:
            before = before * self._placed(j)
            if j in self._variable:
                turned = pin.SE3(self._turns[j], np.zeros(3))
                chain.append([self._placement(before * turned), self._variable[j]])
                before = turned.inverse()
        return chain, self._placement(before * end)

    def _of_loop(self, i: int) -> list[dict[str, Any]]:
        """Return what closes the i-th loop."""
        anchor, kind = self._mechanism.structure.system.anchors[i], self._mechanism.loops[i].kind
        return self._closures(*anchor, *_KINDS[kind])

    def _closures(
        self, a: int, on_a: pin.SE3, b: int, on_b: pin.SE3, linear: Sequence[int], rotations: int
    ) -> list[dict[str, Any]]:
        """Return the closure of a loop; where the pose is known better than the joints that carry the node, its ends
        meet on the pose, or their origins do."""
        ends = [(a, on_a), (b, on_b)]
        chains = [list(map(int, self._model.supports[j])) for j, _ in ends]
        branch = [x for x, y in zip(*chains, strict=False) if x == y][-1]
        plain: dict[str, Any] = {"translations": list(linear), "rotations": rotations}
        node, names = self._frame.parentJoint, ("first", "second")
        on_node = [i for i in range(2) if branch == 0 and chains[i][-1] == node]
        if len(on_node) == 1 and len(linear) == 3:
            i = on_node[0]
            if rotations == 3:  # any frame of the body will do: that of the node
                moved = ends[i][1].inverse() * self._frame.placement
                ends = [(j, end * moved) for j, end in ends]
            offset = self._frame.placement.inverse() * ends[i][1]
            target = dict(zip((names[i], f"{names[i]}_end"), self._target(offset), strict=True))
            if self._rotation and len(self._known) == 6:
                j, end = ends[1 - i]
                return [plain | target | self._side(names[1 - i], branch, j, end)]
            if np.abs(offset.translation).max() < RADIUS * self._length:
                sides = [self._side(name, branch, j, end) for name, (j, end) in zip(names, ends, strict=True)]
                meeting = {"translations": [0, 1, 2], "rotations": 0}
                turned = {"translations": [], "rotations": rotations}
                return [meeting | sides[1 - i] | target, turned | sides[0] | sides[1]]
        sides = [self._side(name, branch, j, end) for name, (j, end) in zip(names, ends, strict=True)]
        return [plain | sides[0] | sides[1]]

    def _side(self, name: str, branch: int, joint: int, end: pin.SE3) -> dict[str, Any]:
        return dict(zip((name, f"{name}_end"), self._chain(branch, joint, end), strict=True))

    def _body(self, joint: int) -> dict[str, Any]:
        """Return what yields the placement of a joint's body, in the axes of the base."""
        if joint == self._frame.parentJoint and self._rotation and len(self._known) == 6:
            second, second_end = self._target(self._frame.placement.inverse())
        else:
            second, second_end = self._chain(0, joint, pin.SE3.Identity())
        return {
            "first": [], "first_end": self._placement(pin.SE3.Identity()), "second": second, "second_end": second_end,
            "translations": [], "rotations": 0, "rates": "placement",
        }  # fmt: skip

    def _of_joint(self, joint: int) -> pin.SE3:
        """Return the placement, in the node, of the last variable's frame on its chain."""
        while joint not in self._turns:
            joint = int(self._model.parents[joint])
        return self._frame.placement.inverse() * pin.SE3(self._turns[joint], np.zeros(3))

    def _target(self, end: pin.SE3) -> tuple[list[list[int]], int]:
        """Return the chain of the pose, whose variables follow those of the joints, and an end in the node."""
        count = len(self._joints)
        before, chain = pin.SE3(self._first.get(0, pin.SE3.Identity()).rotation, np.zeros(3)).inverse(), []
        steps = [(name, count + k) for name, k in zip(_AXES, _CHAIN, strict=True)][: 6 if self._rotation else 3]
        for name, k in [*steps[:3], *self._turned, *steps[3:]]:
            turned = pin.SE3(_to_z(np.eye(3)["xyz".index(name)]), np.zeros(3))
            chain.append([self._placement(before * turned), k])
            before = turned.inverse()
        return chain, self._placement(before * end)

    def _placement(self, placement: pin.SE3) -> int:
        """Return the index of a placement; what rounding moved off 0, 1 or -1 is moved back."""
        rotation, translation = np.array(placement.rotation), np.array(placement.translation)
        whole = np.rint(rotation)
        rotation = np.where(np.abs(rotation - whole) < RADIUS, whole, rotation)
        translation = np.where(np.abs(translation) < RADIUS * self._length, 0.0, translation)
        numbers = np.concatenate([rotation.ravel(), translation]) + 0.0
        key = numbers.tobytes()
        if key not in self._index:
            self._index[key] = len(self._placements)
            self._placements.append(numbers.tolist())
        return self._index[key]


def _to_z(direction: Array) -> Array:
    """Return a rotation (3, 3) that brings z to a direction: a cyclic permutation where it is an axis."""
    k = int(np.argmax(np.abs(direction)))
    if direction[k] == 1.0 and np.count_nonzero(direction) == 1:
        return np.roll(np.eye(3), k + 1, axis=0)
    return np.asarray(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction).matrix())
