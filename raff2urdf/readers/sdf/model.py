"""The contents of a model of an SDF: links, joints and frames, all in the outermost model's frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raff2urdf.errors import RaffError, defined_twice, did_you_mean, limits_reversed
from raff2urdf.readers.sdf.poses import WORLD, SdfPoses, named, pose
from raff2urdf.readers.urdf import SIZE, UNLIMITED, limit_value, number, numbers
from raff2urdf.readers.xml_file import error_at
from raff2urdf.writers.sdf import NAMESPACE

Array = NDArray[np.float64]

LOOP_KINDS = {
    "fixed": "rigid", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "ball": "ball",
}  # fmt: skip
"""Kinds of loops by the joint that closes them."""

TWO_AXES = ("universal", "revolute2")
COUPLING = "gearbox"  # couples two joints, and connects nothing
_AXES = {"revolute": 1, "continuous": 1, "prismatic": 1, **dict.fromkeys(TWO_AXES, 2)}
_JOINT_TYPES = (*LOOP_KINDS, *TWO_AXES, COUPLING)


@dataclass(slots=True, eq=False)
class SdfJoint:
    """A joint, everything in the outermost model's frame; one axis, pair of limits and velocity limit for each axis."""

    element: Any
    name: str
    kind: str
    parent: str
    child: str
    placement: Array
    axes: list[Array]
    limits: list[tuple[float, float]]
    velocities: list[float]


@dataclass(slots=True)
class SdfModel:
    """A model with its nested models; links and joints by full names, everything in the outermost model's frame."""

    name: str
    root: str | None = None
    links: dict[str, Any] = field(default_factory=dict)
    placements: dict[str, Array] = field(default_factory=dict)
    joints: list[SdfJoint] = field(default_factory=list)
    frames: dict[str, str] = field(default_factory=dict)  # with the links that they are attached to
    static: bool = False
    own: Any = None  # the element raff:robot


class Reader:
    """Reads models of one file, of one version."""

    def __init__(self, name: str, version: tuple[int, int]) -> None:
        self.name, self.version = name, version

    def model(self, element: Any) -> SdfModel:
        """Return a model with its nested models."""
        found = SdfModel(str(element.get("name", "model")))
        for include in element.iter("include"):
            uri = include.findtext("uri", "").strip()
            raise self._error(include, f"the included '{uri}' is not read: write its content into the file")
        around = element.getparent()
        poses = SdfPoses(self.name, element, pose(element, self.name), "")
        if around.tag == "world":
            poses = SdfPoses(self.name, around, np.eye(4), "").nested(element)
            poses.prefix = ""
        self._gather(poses, found)
        if not found.links:
            raise self._error(element, f"the model '{found.name}' has no link: add one")
        if element.get("canonical_link") is not None:
            found.root = poses.canonical()
        found.static = element.findtext("static", "").strip() in ("1", "true")
        found.own = element.find(f"{{{NAMESPACE}}}robot")
        return found

    def _error(self, element: Any, message: str) -> RaffError:
        return error_at(self.name, element, message)

    def _gather(self, poses: SdfPoses, found: SdfModel) -> None:
        for nested in poses.model.iterchildren("model"):
            self._gather(poses.nested(nested), found)
        for element in poses.model.iterchildren("link", "joint", "frame"):
            if not element.get("name"):
                raise self._error(element, f"this {element.tag} has no name: give it one")
        for link in poses.model.iterchildren("link"):
            own = poses.prefix + link.get("name")
            if link.get("name") == WORLD:
                raise self._error(link, f"a link can't be called '{WORLD}', which is the world itself: rename it")
            first = found.links.setdefault(own, link)
            if first is not link:
                raise self._error(link, defined_twice(f"link '{own}'", first.sourceline))
            found.placements[own] = poses.of_element(link)
        for frame in poses.model.iterchildren("frame"):
            own = poses.prefix + frame.get("name")
            if own not in found.links:
                found.frames[own] = poses.link(frame.get("name"), frame)
                found.placements[own] = poses.of_element(frame)
        known: dict[str, Any] = {}
        for joint in poses.model.iterchildren("joint"):
            own = joint.get("name")
            first = known.setdefault(own, joint)
            if first is not joint:
                raise self._error(joint, defined_twice(f"joint '{own}'", first.sourceline))
            found.joints.append(self._joint(joint, poses))

    def _joint(self, element: Any, poses: SdfPoses) -> SdfJoint:
        name, kind = poses.prefix + str(element.get("name", "")), str(element.get("type", ""))
        label = f"joint '{name}'"
        if kind not in _JOINT_TYPES:
            near = did_you_mean(kind, _JOINT_TYPES)
            raise self._error(element, f"{label} has the type '{kind}', which can't be converted{near}")
        ends = []
        for word in ("parent", "child"):
            end = element.find(word)
            text = "" if end is None else named(end)
            where = element if end is None else end
            if not text:
                raise self._error(where, f"{label} has no <{word}>: add it")
            ends.append(poses.link(text, where, f"{label} has the {word} '{text}', which is not a link"))
        if ends[0] == ends[1]:
            raise self._error(element, f"{label} joins '{ends[0]}' to itself: name two different links")
        found = SdfJoint(element, name, kind, ends[0], ends[1], poses.of_element(element), [], [], [])
        for word in ("axis", "axis2"):
            axis = element.find(word)
            if axis is not None and kind in _AXES:
                found.axes.append(self._axis(axis, label, found.placement, poses))
                found.limits.append(self._limits(axis, label))
                found.velocities.append(self._number(axis, "limit/velocity", label, math.inf))
        if len(found.axes) < _AXES.get(kind, 0):
            raise self._error(element, f"{label} has {len(found.axes)} of {_AXES[kind]} axes: add <axis> or <axis2>")
        return found

    def _axis(self, element: Any, label: str, placement: Array, poses: SdfPoses) -> Array:
        xyz = element.find("xyz")
        text = "0 0 1" if xyz is None else xyz.text or ""
        found = numbers(text)
        if found is None or len(found) != 3 or math.hypot(*found) <= 1e-9:
            at = element if xyz is None else xyz
            raise self._error(at, f"the axis '{text.strip()}' of {label} must be three numbers, not all 0{SIZE}")
        frame = placement
        expressed = None if xyz is None else xyz.get("expressed_in")
        if expressed:
            frame = poses.of(expressed, xyz)
        elif self.version < (1, 5) or element.findtext("use_parent_model_frame", "0").strip() in ("1", "true"):
            frame = poses.placed
        axis: Array = frame[:3, :3] @ np.array(found)
        return axis / np.linalg.norm(axis)

    def _limits(self, axis: Any, label: str) -> tuple[float, float]:
        low = self._number(axis, "limit/lower", label, -math.inf)
        high = self._number(axis, "limit/upper", label, math.inf)
        if low > high:
            raise self._error(axis.find("limit"), limits_reversed(label, low, high))
        return (low if low > -UNLIMITED else -math.inf), (high if high < UNLIMITED else math.inf)

    def _number(self, axis: Any, path: str, label: str, default: float) -> float:
        """Return a limit; -1, or nothing, is SDF's notation for no limit of velocity."""
        element = axis.find(path)
        if element is None or not (element.text or "").strip():
            return default
        text, word = element.text.strip(), path.rpartition("/")[2]
        unlimited = word == "velocity" and number(text) == -1.0
        return math.inf if unlimited else limit_value(element, text, word, label, self.name)
