"""The joint that closes a loop: its kinds, which of two implies the other, and its entry in the constraints.

    kind         leaves free                               closed by
    rigid        nothing                                   a rigid loop
    prismatic    a translation along z                     a prismatic loop
    revolute     a rotation about z                        a revolute loop
    ball         all rotations                             a ball loop
    universal    rotations about both z axes, which are    a passive revolute joint and a revolute loop
                 perpendicular to each other
    cylindrical  a rotation about z, a translation along   a passive prismatic joint and a revolute loop
    planar       translations along x and y, a rotation    two passive prismatic joints and a revolute loop
                 about z
    screw        a rotation about z, and as much           a passive prismatic and a passive revolute joint, a
                 translation along it as the lead states   coupling of these, and a rigid loop

A passive joint is added at the first end, with an empty link.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.constraints import loop_entry
from raff2urdf.placement import inverse, rotation, translation, with_z
from raff2urdf.readers.loops.successive import Step
from raff2urdf.readers.urdf_tree import UrdfTree, along

KINDS = {
    **dict.fromkeys(("rigid", "fixed", "weld", "link"), "rigid"),
    **dict.fromkeys(("revolute", "continuous", "hinge"), "revolute"),
    **dict.fromkeys(("prismatic", "slider"), "prismatic"),
    **dict.fromkeys(("ball", "spherical", "point"), "ball"),
    **dict.fromkeys(("universal", "cylindrical", "planar"), ""),
}
"""The kind of joint by each word for it in some dialect; empty where it is the word itself."""

_X, _Y, _Z = np.eye(3)
_UPRIGHT = rotation(_X, np.pi / 2)
_STEPS: dict[str, tuple[Step, ...]] = {
    "universal": (("Z", "continuous", (0.0, 0.0, 1.0)),),
    "cylindrical": (("TZ", "prismatic", (0.0, 0.0, 1.0)),),
    "screw": (("TZ", "prismatic", (0.0, 0.0, 1.0)), ("Z", "continuous", (0.0, 0.0, 1.0))),
    "planar": (("TX", "prismatic", (1.0, 0.0, 0.0)), ("TY", "prismatic", (0.0, 1.0, 0.0))),
}
_SAME = 1e-6  # rad, or parts of the mechanism's size: two declarations of one loop are rounded differently


@dataclass(frozen=True, slots=True)
class LoopJoint:
    """A joint that closes a loop.

    Attributes:
        kind: rigid, prismatic, revolute, ball, universal, cylindrical, planar or screw.
        first: link at its first end.
        second: link at its second end.
        placed: (4, 4) of each end on its link; they coincide where the joint is at 0. The axis is z.
        lead: of a screw: translation of the second end by its rotation, m/rad.
    """

    kind: str
    first: str
    second: str
    placed: tuple[Array, Array]
    lead: float = 0.0

    def swapped(self) -> LoopJoint:
        """Return the same joint, seen from its second end."""
        return replace(self, first=self.second, second=self.first, placed=self.placed[::-1])

    def on_bodies(self, tree: UrdfTree) -> LoopJoint:
        """Return the same joint between the first links of the rigid bodies that it joins."""
        (link, at), (other, other_at) = tree.body(self.first), tree.body(self.second)
        return replace(self, first=link, second=other, placed=(at @ self.placed[0], other_at @ self.placed[1]))

    def add_to(self, tree: UrdfTree, name: str) -> tuple[dict[str, Any], list[str]]:
        """Return the loop as an entry of a constraints file, and the passive joints that were added to the tree."""
        first, placed, passive = self.first, self.placed[0], list[str]()
        if self.kind in _STEPS:
            if self.kind == "universal":  # the cross points to where the second axis is, at zero
                world = (tree.zero[self.second] @ self.placed[1])[:3, 2]
                turned = np.eye(4)
                turned[:3, :3] = with_z(_Z, (tree.zero[self.first] @ placed)[:3, :3].T @ world)
                placed = placed @ turned
            first, passive = tree.add_joints(first, placed, name, _STEPS[self.kind])
            placed = along(np.eye(4), _X) if self.kind == "universal" else np.eye(4)
        kind = "rigid" if self.kind == "screw" else "revolute" if self.kind in _STEPS else self.kind
        return loop_entry(name, kind, first, self.second, (placed, self.placed[1])), passive

    def couplings(self, name: str, passive: Sequence[str]) -> list[dict[str, Any]]:
        """Return the couplings of the passive joints that `add_to` has added."""
        if self.kind != "screw":
            return []
        terms = [{"joint": joint, "coefficients": [c]} for joint, c in zip(passive, (1.0, -self.lead), strict=True)]
        return [{"name": f"{name}_screw", "terms": terms, "constant": 0.0}]


def implies(tree: UrdfTree, cut: LoopJoint, other: LoopJoint) -> bool | None:
    """Return whether a loop that one joint closes satisfies another joint, too; None if they join other bodies."""
    if {tree.body(cut.first)[0], tree.body(cut.second)[0]} != {tree.body(other.first)[0], tree.body(other.second)[0]}:
        return None
    cut, other, size = cut.on_bodies(tree), other.on_bodies(tree), tree.size
    if cut.first != other.first:
        other = other.swapped()
    for sample in np.random.default_rng(0).uniform(-1.0, 1.0, (4, 3)):
        relative = cut.placed[0] @ _motion(cut, sample, size) @ inverse(cut.placed[1])
        between = inverse(other.placed[0]) @ relative @ other.placed[1]
        if np.abs(_residual(other, between, size)).max(initial=0.0) > _SAME:
            return False
    return True


def _motion(joint: LoopJoint, sample: Sequence[float] | Array, size: float) -> Array:
    """Return the placement (4, 4) of a joint's second end in its first, at values between -1 and 1."""
    (a, b, c), kind = sample, joint.kind
    if kind == "revolute":
        return rotation(_Z, a)
    if kind == "prismatic":
        return translation(a * size * _Z)
    if kind == "ball":
        return np.asarray(rotation(_X, a) @ rotation(_Y, b) @ rotation(_Z, c))
    if kind == "universal":
        return np.asarray(rotation(_Z, a) @ _UPRIGHT @ rotation(_Z, b))
    if kind == "cylindrical":
        return np.asarray(rotation(_Z, a) @ translation(b * size * _Z))
    if kind == "screw":
        return np.asarray(rotation(_Z, a) @ translation(a * joint.lead * _Z))
    if kind == "planar":
        return np.asarray(rotation(_Z, a) @ translation(size * np.array([b, c, 0.0])))
    return np.eye(4)


def _residual(joint: LoopJoint, placed: Array, size: float) -> Array:
    """Return numbers that are all 0 where a joint can have a placement (4, 4) of its second end in its first."""
    p, turned, kind = placed[:3, 3] / size, placed[:3, :3], joint.kind
    if kind == "screw":
        p[2] -= joint.lead / size * np.arctan2(turned[1, 0], turned[0, 0])
        return np.append(p, turned[:2, 2])
    if kind == "ball":
        return p
    if kind == "universal":
        return np.append(p, turned[2, 2])
    if kind == "planar":
        return np.append(p[2:], turned[:2, 2])
    if kind == "cylindrical":
        return np.append(p[:2], turned[:2, 2])
    if kind == "revolute":
        return np.append(p, turned[:3, 2] - _Z)
    return np.append(p[:2] if kind == "prismatic" else p, turned - np.eye(3))
