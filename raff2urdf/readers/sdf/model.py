"""What an SDF says of a model: links, joints and frames, all in the outermost model's frame, or errors by lines."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raff2urdf.errors import did_you_mean
from raff2urdf.readers.sdf.poses import WORLD, SdfPoses, error_at, named, pose
from raff2urdf.readers.urdf import SIZE, UNLIMITED, number, numbers
from raff2urdf.writers.sdf import NAMESPACE

Array = NDArray[np.float64]

ONE = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic"}
LOOPS = {"fixed": "rigid", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "ball": "ball"}
TWO = ("universal", "revolute2")
COUPLING = "gearbox"  # couples two joints, and holds nothing
_JOINTS = (*LOOPS, *TWO, COUPLING)


@dataclass(slots=True, eq=False)
class SdfJoint:
    """A joint, everything in the model's frame."""

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
    """A model with those within it, links and joints by their full names, everything in the outermost model's frame."""

    name: str
    root: str | None = None
    links: dict[str, Any] = field(default_factory=dict)
    placements: dict[str, Array] = field(default_factory=dict)
    joints: list[SdfJoint] = field(default_factory=list)
    frames: dict[str, str] = field(default_factory=dict)  # by the links that they are attached to
    fixed: bool = False  # static: it stands on the world
    ours: Any = None  # the element raff:robot


class Reader:
    """Models of one file, of one version."""

    def __init__(self, name: str, version: tuple[int, int]) -> None:
        self.name, self.version = name, version

    def model(self, element: Any) -> SdfModel:
        """A model and all within it."""
        found = SdfModel(str(element.get("name", "model")))
        for include in element.iter("include"):
            uri = include.findtext("uri", "").strip()
            raise error_at(self.name, include, f"it includes '{uri}': write what it holds into the file")
        around = element.getparent()
        poses = SdfPoses(self.name, around, np.eye(4), "").inner(element) if around.tag == "world" else None
        poses = poses or SdfPoses(self.name, element, pose(element, self.name), "")
        poses.prefix = ""
        self._gather(poses, found)
        if not found.links:
            raise error_at(self.name, element, f"the model '{found.name}' has no link")
        if element.get("canonical_link") is not None:
            found.root = poses.canonical()
        found.fixed = element.findtext("static", "").strip() in ("1", "true")
        found.ours = element.find(f"{{{NAMESPACE}}}robot")
        return found

    def _gather(self, poses: SdfPoses, found: SdfModel) -> None:
        for nested in poses.model.iterchildren("model"):
            self._gather(poses.inner(nested), found)
        for element in poses.model.iterchildren("link", "joint", "frame"):
            if not element.get("name"):
                raise error_at(self.name, element, f"a {element.tag} without a name")
        for link in poses.model.iterchildren("link"):
            own = poses.prefix + link.get("name")
            if link.get("name") == WORLD:
                raise error_at(self.name, link, f"a link can't be called '{WORLD}': that is the world itself")
            if own in found.links:
                raise error_at(
                    self.name, link, f"a second link '{own}': the first is on line {found.links[own].sourceline}"
                )
            found.links[own] = link
            found.placements[own] = poses.of_element(link)
        for frame in poses.model.iterchildren("frame"):
            own = poses.prefix + frame.get("name")
            if own not in found.links:
                found.frames[own] = poses.link(frame.get("name"), frame)
                found.placements[own] = poses.of_element(frame)
        known: dict[str, Any] = {}
        for joint in poses.model.iterchildren("joint"):
            first = known.setdefault(joint.get("name"), joint)
            if first is not joint:
                raise error_at(
                    self.name, joint, f"a second joint '{joint.get('name')}': the first is on line {first.sourceline}"
                )
            found.joints.append(self._joint(joint, poses, found))

    def _joint(self, element: Any, poses: SdfPoses, found: SdfModel) -> SdfJoint:
        name, kind = poses.prefix + str(element.get("name", "")), str(element.get("type", ""))
        said = f"joint '{name}'"
        if kind not in _JOINTS:
            raise error_at(
                self.name, element, f"{said} is of the type '{kind}', which can't be said{did_you_mean(kind, _JOINTS)}"
            )
        ends = []
        for word in ("parent", "child"):
            end = element.find(word)
            text = "" if end is None else named(end)
            where = element if end is None else end
            if not text:
                raise error_at(self.name, where, f"{said} has no {word}")
            link = poses.link(text, where, f"{said} has the {word} '{text}', no link")
            ends.append(link)
        if ends[0] == ends[1]:
            raise error_at(self.name, element, f"{said} holds '{ends[0]}' on itself")
        placement = poses.of_element(element)
        axes, limits, velocities = [], [], []
        for word in ("axis", "axis2"):
            axis = element.find(word)
            if axis is not None and kind not in ("fixed", "ball", COUPLING):
                axes.append(self._axis(axis, said, placement, poses))
                limits.append(self._limits(axis, said))
                velocities.append(self._number(axis, "limit/velocity", said, math.inf))
        wanted = 2 if kind in TWO else 1 if kind in ONE else 0
        if len(axes) < wanted:
            raise error_at(self.name, element, f"{said} wants {wanted} axes and has {len(axes)}")
        return SdfJoint(element, name, kind, ends[0], ends[1], placement, axes, limits, velocities)

    def _axis(self, element: Any, said: str, placement: Array, poses: SdfPoses) -> Array:
        xyz = element.find("xyz")
        text = "0 0 1" if xyz is None else xyz.text or ""
        found = numbers(text)
        if found is None or len(found) != 3 or math.hypot(*found) <= 1e-9:
            at = element if xyz is None else xyz
            raise error_at(self.name, at, f"the axis '{text.strip()}' of {said} must be three numbers, not all 0{SIZE}")
        frame = placement
        expressed = None if xyz is None else xyz.get("expressed_in")
        if expressed:
            frame = poses.of(expressed, xyz)
        elif self.version < (1, 5) or element.findtext("use_parent_model_frame", "0").strip() in ("1", "true"):
            frame = poses.placed
        axis: Array = frame[:3, :3] @ np.array(found)
        return axis / np.linalg.norm(axis)

    def _limits(self, axis: Any, said: str) -> tuple[float, float]:
        low = self._number(axis, "limit/lower", said, -math.inf)
        high = self._number(axis, "limit/upper", said, math.inf)
        if low > high:
            where = axis.find("limit")
            raise error_at(self.name, where, f"{said}: its lower limit of {low:g} is above its upper one of {high:g}")
        return (low if low > -UNLIMITED else -math.inf), (high if high < UNLIMITED else math.inf)

    def _number(self, axis: Any, path: str, said: str, default: float) -> float:
        """A limit; SDF writes -1 or nothing for no limit of velocity."""
        element = axis.find(path)
        if element is None or not (element.text or "").strip():
            return default
        value = number(element.text.strip())
        word = path.rpartition("/")[2]
        if math.isnan(value):
            raise error_at(self.name, element, f"{said}: its {word} limit '{element.text.strip()}' is no number")
        if word == "velocity" and value < 0.0:
            if value != -1.0:
                raise error_at(self.name, element, f"{said}: its limit of velocity is {value:g}, below 0")
            return math.inf
        return value
