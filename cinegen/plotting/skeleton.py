"""`Skeleton`: a mechanism as it is drawn on paper: its rigid parts as the points at which joints meet them.

The visible parts are neither links nor joints of the file: a link that closes a loop rigidly is one part with the link
it closes onto, and the crosses of universal and ball joints have no size. So a part is all bodies that are fixed to
each other, and its points are the centres of the joints on it, each once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from cinegen.arrays import Array
from cinegen.joints import kinematic_data
from cinegen.model import Mechanism
from raff2urdf.raff.document import LoopKind

_Anchor = tuple[int, Array]

_SAME = 1e-6  # characteristic lengths: points that coincide
_PARALLEL = 1e-6  # rad
_THIN, _FLAT = 1e-3, 0.25  # of a part's length, and of its width: what is on a line, and what is a plate


@dataclass(frozen=True, eq=False)
class Part:
    """A rigid part at a configuration.

    Attributes:
        points: (n, 3) m, the centres of its joints in the world, each once; and the mechanism's end, if it is on it.
        is_base: whether it is the base of the mechanism.
        is_stalk: whether it is a bar on a plate: then its first point is the plate's middle, not a joint.
        normal: (3,) of a plate, up at home; None for other parts.
    """

    points: Array
    is_base: bool
    is_stalk: bool
    normal: Array | None


@dataclass(frozen=True, eq=False)
class Slide:
    """A prismatic joint at a configuration.

    Attributes:
        joint: its name.
        points: (2, 3) m, its beginning and its end in the world.
        actuated: whether it is actuated.
    """

    joint: str
    points: Array
    actuated: bool


@dataclass(frozen=True, eq=False)
class Pose:
    """A skeleton at a configuration, in the world, m.

    Attributes:
        parts: the rigid parts, the base first.
        slides: the prismatic joints.
        actuated: (n, 3) the centres of actuated joints that are not prismatic.
        end: (3,) the mechanism's end, or the node that was asked for.
    """

    parts: tuple[Part, ...]
    slides: tuple[Slide, ...]
    actuated: Array
    end: Array

    @property
    def points(self) -> Array:
        """(n, 3) all of them."""
        parts, slides = ([part.points for part in group] for group in (self.parts, self.slides))
        return np.vstack([*parts, *slides, self.end[None]])


@dataclass(frozen=True, eq=False)
class _Fixed:
    """A part as points that are fixed to bodies, (body, (3,) in its axes), and its normal likewise."""

    anchors: tuple[_Anchor, ...]
    is_base: bool
    is_stalk: bool = False
    normal: _Anchor | None = None


class Skeleton:
    """A mechanism as parts and prismatic joints. Not for two threads at once: it keeps Pinocchio's data.

    Args:
        mechanism: any.
        node: drawn as its end; the mechanism's end unless given.

    Raises:
        UnknownNameError: no such node.
    """

    def __init__(self, mechanism: Mechanism, node: str | None = None) -> None:
        self.mechanism = mechanism
        model = mechanism.model
        self._data = kinematic_data(model)
        frame = model.frames[mechanism.frame_id(mechanism.end if node is None else node)]
        self._end = int(frame.parentJoint), np.array(frame.placement.translation)
        self._base = int(model.frames[mechanism.frame_id(mechanism.nodes[0])].parentJoint)
        pin.forwardKinematics(model, self._data, mechanism.q_home)
        together = sorted(self._together(), key=lambda bodies: self._base not in bodies)
        self._parts = tuple(part for bodies in together for part in self._fixed(bodies))

    def at(self, q: Array) -> Pose:
        """Return the pose of all parts at q (nq,)."""
        mechanism, model = self.mechanism, self.mechanism.model
        pin.forwardKinematics(model, self._data, mechanism.structure.checked(q))
        parts = []
        for part in self._parts:
            normal = None if part.normal is None else self._data.oMi[part.normal[0]].rotation @ part.normal[1]
            parts.append(Part(self._points(part.anchors), part.is_base, part.is_stalk, normal))
        slides, centres = [], []
        for name in mechanism.joints:
            joint, actuated = model.getJointId(name), name in mechanism.actuated
            if mechanism.is_prismatic(name):
                slides.append(Slide(name, self._points([self._before(joint), (joint, np.zeros(3))]), actuated))
            elif actuated:
                centres.append((joint, np.zeros(3)))
        return Pose(tuple(parts), tuple(slides), self._points(centres), self._points([self._end])[0])

    # --- parts ---------------------------------------------------------------------------------------------------

    def _together(self) -> list[list[int]]:
        """Return groups of bodies that are fixed to each other."""
        model = self.mechanism.model
        part = list(range(model.njoints))
        for loop in self.mechanism.loops:
            if loop.kind is LoopKind.RIGID:
                new, old = part[self._body(loop.first)], part[self._body(loop.second)]
                part = [new if number == old else number for number in part]
        groups: dict[int, list[int]] = {}
        for body in range(self._base, model.njoints):  # the world around a floating base is not drawn
            groups.setdefault(part[body], []).append(body)
        return list(groups.values())

    def _fixed(self, bodies: list[int]) -> list[_Fixed]:
        """Return the parts that are drawn for bodies that are fixed to each other: a plate between joints that are
        parts of loops, with a stalk to every other joint on it and to the end; or else all points as one."""
        mechanism, model = self.mechanism, self.mechanism.model
        joints = [(j, (j, np.zeros(3))) for j in bodies if j != self._base]
        joints += [(j, self._before(j)) for j in range(self._base + 1, model.njoints) if model.parents[j] in bodies]
        looped = [anchor for j, anchor in joints if j in self._looped]
        for loop in mechanism.loops:
            ends = (loop.first, loop.first_placement), (loop.second, loop.second_placement)
            for node, placement in ends if loop.kind is not LoopKind.RIGID else ():
                if self._body(node) in bodies:
                    frame = model.frames[mechanism.frame_id(node)]
                    looped.append((self._body(node), np.array((frame.placement * placement).translation)))
        others = [anchor for j, anchor in joints if j not in self._looped]
        others += [self._end] if self._end[0] in bodies else []
        corners, is_base, body = self._apart(looped), self._base in bodies, bodies[0]
        points = self._points(corners)
        normal = self._normal(points)
        if normal is None:
            return [_Fixed(tuple(self._apart([*corners, *others])), is_base)]
        plate = _Fixed(tuple(corners), is_base, normal=(body, self._data.oMi[body].rotation.T @ normal))
        middle, wide = points.mean(axis=0), np.ptp(points, axis=0).max()
        foot = body, np.array(self._data.oMi[body].actInv(middle))
        high = [anchor for anchor in others if abs(normal @ (self._points([anchor])[0] - middle)) > _FLAT * wide]
        return [plate, *(_Fixed((foot, anchor), is_base, is_stalk=True) for anchor in self._apart(high))]

    @cached_property
    def _looped(self) -> frozenset[int]:
        """Joints that are parts of loops."""
        supports = self.mechanism.model.supports
        return frozenset(
            j
            for loop in self.mechanism.loops
            for j in set(supports[self._body(loop.first)]) ^ set(supports[self._body(loop.second)])
        )

    def _apart(self, anchors: list[_Anchor]) -> list[_Anchor]:
        """Return those that don't coincide with an earlier one."""
        points, same = self._points(anchors), _SAME * self.mechanism.length
        return [
            anchor for k, anchor in enumerate(anchors) if (np.linalg.norm(points[:k] - points[k], axis=1) > same).all()
        ]

    @staticmethod
    def _normal(points: Array) -> Array | None:
        """Return the normal (3,), up, of the plate that points (n, 3) are on; None if they are on none."""
        if len(points) < 3:
            return None
        _, sizes, axes = np.linalg.svd(points - points.mean(axis=0))
        if sizes[1] < _THIN * sizes[0] or sizes[2] > _FLAT * sizes[1]:
            return None
        sign = next((np.sign(value) for value in axes[2][::-1] if abs(value) > _PARALLEL), 1.0)
        return np.asarray(sign * axes[2])

    # --- points --------------------------------------------------------------------------------------------------

    def _body(self, node: str) -> int:
        return int(self.mechanism.model.frames[self.mechanism.frame_id(node)].parentJoint)

    def _points(self, anchors: Sequence[_Anchor]) -> Array:
        """Return the positions (n, 3) in the world, m."""
        return np.array([self._data.oMi[body].act(local) for body, local in anchors]).reshape(-1, 3)

    def _before(self, joint: int) -> _Anchor:
        """Return the origin of a joint on its parent."""
        model = self.mechanism.model
        return int(model.parents[joint]), np.array(model.jointPlacements[joint].translation)
