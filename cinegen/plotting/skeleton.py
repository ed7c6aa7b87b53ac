"""`Skeleton`: what is drawn of a mechanism on paper: its rigid parts by the points at which joints meet them.

The parts that people see are neither links nor joints of the file: a link that closes a loop rigidly is one part with
the link it closes onto, and the crosses of universal and ball joints have no size. So a part is all bodies that are
fixed to each other, and its points are the centres of the joints on it, each once.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from cinegen.model import Mechanism
from raff2urdf.document import LoopKind

Array = NDArray[np.float64]

_Anchor = tuple[int, Array]

_SAME = 1e-6  # characteristic lengths: points that coincide
_PARALLEL = 1e-6  # rad
_THIN, _FLAT = 1e-3, 0.25  # of a part's length, and of its width: what is on a line, and what is a plate


@dataclass(frozen=True, eq=False)
class Part:
    """A rigid part at a configuration.

    Attributes:
        points: (n, 3) the centres of its joints in the world, each once; and the mechanism's end, if that is on it.
        is_base: whether it is what the mechanism stands on.
        is_stalk: whether it stands on a plate: then its first point is the plate's middle, and no joint.
        normal: (3,) of a plate, up at home; None for what is none.
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
        points: (2, 3) its beginning and its end in the world.
        motor: whether it is actuated.
    """

    joint: str
    points: Array
    motor: bool


@dataclass(frozen=True, eq=False)
class Pose:
    """A skeleton at a configuration, in the world, m.

    Attributes:
        parts: the rigid parts, the base first.
        slides: the prismatic joints.
        motors: (n, 3) the centres of actuated joints that turn.
        end: (3,) the mechanism's end, or the node that was asked for.
    """

    parts: tuple[Part, ...]
    slides: tuple[Slide, ...]
    motors: Array
    end: Array

    @property
    def points(self) -> Array:
        """(n, 3) all of them."""
        return np.vstack(
            [*(part.points for part in self.parts), *(slide.points for slide in self.slides), self.end[None]]
        )


@dataclass(frozen=True, eq=False)
class _Fixed:
    """A part as points that are fixed to bodies, (body, (3,) in its axes), and its normal likewise."""

    anchors: tuple[_Anchor, ...]
    is_base: bool
    is_stalk: bool = False
    normal: _Anchor | None = None


class Skeleton:
    """A mechanism as parts and slides. Not for two threads at once: it keeps Pinocchio's scratch data.

    Args:
        mechanism: any.
        node: drawn as its end; the mechanism's end unless given.

    Raises:
        UnknownNameError: no such node.
    """

    def __init__(self, mechanism: Mechanism, node: str | None = None) -> None:
        self.mechanism = mechanism
        model = mechanism.model
        self._data = model.createData()
        frame = model.frames[mechanism.frame_id(mechanism.end if node is None else node)]
        self._end = int(frame.parentJoint), np.array(frame.placement.translation)
        self._base = int(model.frames[mechanism.frame_id(mechanism.nodes[0])].parentJoint)
        pin.forwardKinematics(model, self._data, mechanism.q_home)
        together = sorted(self._together(), key=lambda bodies: self._base not in bodies)
        self._parts = tuple(part for bodies in together for part in self._fixed(bodies))

    def at(self, q: Array) -> Pose:
        """Where all of it is at q (nq,)."""
        mechanism, model = self.mechanism, self.mechanism.model
        pin.forwardKinematics(model, self._data, mechanism.checked(q))
        parts = []
        for part in self._parts:
            normal = None if part.normal is None else self._data.oMi[part.normal[0]].rotation @ part.normal[1]
            parts.append(Part(self._points(part.anchors), part.is_base, part.is_stalk, normal))
        slides, motors = [], []
        for name in mechanism.joints:
            j = model.getJointId(name)
            motor = name in mechanism.actuated
            if mechanism.is_prismatic(name):
                ends = [self._beginning(j), self._point(j)]
                slides.append(Slide(name, np.array(ends), motor))
            elif motor:
                motors.append(self._point(j))
        return Pose(tuple(parts), tuple(slides), np.array(motors).reshape(-1, 3), self._point(*self._end))

    @cached_property
    def plane(self) -> Array | None:
        """(3,) the normal of the plane that all parts move in; None if there is none.

        It points along the first of z, y and x that it is not square to.
        """
        model, data, q = self.mechanism.model, self._data, self.mechanism.q_home
        if self.mechanism.floating or not self.mechanism.joints:
            return None
        jacobians = pin.computeJointJacobians(model, data, q)
        moving, turning = jacobians[:3], jacobians[3:]
        spun = np.linalg.norm(turning, axis=0) > 0.5
        if not spun.any():
            return None
        normal = turning[:, spun][:, 0]
        off = np.linalg.norm(np.cross(turning[:, spun].T, normal), axis=1).max()
        if max(off, np.abs(normal @ moving[:, ~spun]).max(initial=0.0)) > _PARALLEL:
            return None
        sign = next((np.sign(value) for value in normal[::-1] if abs(value) > _PARALLEL), 1.0)
        return np.asarray(sign * normal / np.linalg.norm(normal))

    # --- parts ---------------------------------------------------------------------------------------------------

    def _together(self) -> list[list[int]]:
        """Bodies that are fixed to each other."""
        model = self.mechanism.model
        part = list(range(model.njoints))
        for loop in self.mechanism.loops:
            if loop.kind is LoopKind.RIGID:
                new, old = part[self._body(loop.first)], part[self._body(loop.second)]
                part = [new if one == old else one for one in part]
        found: dict[int, list[int]] = {}
        for body in range(self._base, model.njoints):  # nothing is drawn of the world that a base floats in
            found.setdefault(part[body], []).append(body)
        return list(found.values())

    def _fixed(self, bodies: list[int]) -> list[_Fixed]:
        """What is drawn of bodies that are fixed to each other: a plate between joints that are parts of loops, with a
        stalk to every other joint on it and to the end; or else all points as one."""
        mechanism, model = self.mechanism, self.mechanism.model
        joints = [(j, (j, np.zeros(3))) for j in bodies if j != self._base]
        for j in range(self._base + 1, model.njoints):
            if model.parents[j] in bodies:
                joints.append((j, (int(model.parents[j]), np.array(model.jointPlacements[j].translation))))
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
        high = [anchor for anchor in others if abs(normal @ (self._point(*anchor) - middle)) > _FLAT * wide]
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
        """Those that don't coincide with one before."""
        kept: list[_Anchor] = []
        for anchor in anchors:
            here = self._point(*anchor)
            if all(np.linalg.norm(here - self._point(*other)) > _SAME * self.mechanism.length for other in kept):
                kept.append(anchor)
        return kept

    @staticmethod
    def _normal(points: Array) -> Array | None:
        """(3,) of the plate that points (n, 3) are on, up; None if they are on none."""
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

    def _points(self, anchors: Iterable[_Anchor]) -> Array:
        """(n, 3) in the world."""
        return np.array([self._point(*anchor) for anchor in anchors]).reshape(-1, 3)

    def _point(self, body: int, local: Array | None = None) -> Array:
        """(3,) in the world."""
        placement = self._data.oMi[body]
        return np.array(placement.translation if local is None else placement.act(local))

    def _beginning(self, joint: int) -> Array:
        """(3,) where a joint stands on the body before it."""
        model = self.mechanism.model
        return self._point(int(model.parents[joint]), np.array(model.jointPlacements[joint].translation))
