"""The contents of a model of an SDF: links, joints and frames, all in the outermost model's frame.

Poses are given relative to each other, by names, in nested models.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.bounds import UNLIMITED
from raff2urdf.errors import RaffError, did_you_mean, limits_reversed, run_all
from raff2urdf.readers import drives
from raff2urdf.readers.screw import lead, parameter
from raff2urdf.readers.sdf.poses import SdfPoses, named, pose
from raff2urdf.readers.urdf import check_friction, direction, limit_value, number
from raff2urdf.readers.urdf_builder import UNBOUNDED
from raff2urdf.readers.urdf_file import MEANT, by_name
from raff2urdf.readers.xml_file import error_at, own_element
from raff2urdf.tree import WORLD

LOOP_KINDS = {
    "fixed": "rigid", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "ball": "ball",
}  # fmt: skip
"""Kinds of loops by the joint that closes them."""


TWO_AXES = ("universal", "revolute2")
GEARBOX = "gearbox"  # couples two joints, and connects nothing
_AXES = {"revolute": 1, "continuous": 1, "prismatic": 1, "screw": 1, "universal": 2, "revolute2": 2, GEARBOX: 2}
_JOINT_TYPES = tuple(dict.fromkeys((*LOOP_KINDS, *_AXES)))


class SdfMimic(NamedTuple):
    """An equation of two axes, in rad or m: follower = multiplier (leader - reference) + offset.

    Attributes:
        element: in the file.
        joint: full name of the leader.
        axis: index of the leader's axis.
    """

    element: Any
    joint: str
    axis: int
    multiplier: float
    offset: float
    reference: float


class SdfAxis(NamedTuple):
    """An axis of a joint: its direction (3,) in the outermost model's frame, limits, velocity limit, effort limit,
    what it mimics, and its viscous and Coulomb friction."""

    direction: Array
    limits: tuple[float, float] = UNBOUNDED
    velocity: float = math.inf
    effort: float = math.inf
    mimic: SdfMimic | None = None
    damping: float = 0.0
    friction: float = 0.0


@dataclass(slots=True, eq=False)
class SdfJoint:
    """A joint, everything in the outermost model's frame.

    Attributes:
        lead: of a screw: translation along its axis by rotation about it, m/rad.
        ratio: of a gearbox: the angle of its child about its second axis is -ratio times that of its parent about its
            first one.
        reference: link from which a gearbox counts both angles.
    """

    element: Any
    name: str
    kind: str
    parent: str
    child: str
    placement: Array
    axes: list[SdfAxis]
    lead: float = 0.0
    ratio: float = 1.0
    reference: str = ""


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
    raff_robot: Any = None  # the element raff:robot
    gravity: Any = None  # the element of the world around it
    driven: set[tuple[str, int]] = field(default_factory=set)  # joints that plugins control, and the axis: 0 or 1
    notes: list[str] = field(default_factory=list)


class SdfModelReader:
    """Reads models of one file, and of those that it includes."""

    def __init__(self, name: str) -> None:
        self.name = name

    def model(self, element: Any) -> SdfModel:
        """Return a model with its nested models."""
        model = SdfModel(str(element.get("name") or "model"))
        around = element.getparent()
        poses = SdfPoses(self.name, element, pose(element, self.name), "")
        if around.tag == "world":
            poses = SdfPoses(self.name, around, np.eye(4), "").nested(element)
            poses.prefix = ""
            model.gravity = around.find("gravity")
        self._gather(poses, model)
        if not model.links:
            raise self._error(element, f"the model '{model.name}' has no link: add one")
        if element.get("canonical_link") is not None:
            model.root = poses.canonical()
        model.static = element.findtext("static", "").strip() in ("1", "true")
        model.raff_robot = own_element(element, self.name)
        return model

    def _error(self, element: Any, message: str) -> RaffError:
        return error_at(self.name, element, message)

    def _gather(self, poses: SdfPoses, model: SdfModel) -> None:
        nested, links, joints, frames = (
            by_name(list(poses.children(tag)), self.name, poses.prefix) for tag in ("model", "link", "joint", "frame")
        )
        for inner in nested.values():
            self._gather(poses.nested(inner), model)
        for name, link in links.items():
            if name == WORLD:
                if next(link.iterchildren("inertial", "visual", "collision"), None) is not None:
                    raise self._error(link, f"a link can't be called '{WORLD}', which is the world itself: rename it")
                model.notes.append(f"the empty link '{WORLD}' is taken for the world itself")
                continue
            model.links[poses.prefix + name] = link
            model.placements[poses.prefix + name] = poses.of_element(link)
        for name, frame in frames.items():
            if poses.prefix + name not in model.links:
                model.frames[poses.prefix + name] = poses.link(name, frame)
                model.placements[poses.prefix + name] = poses.of_element(frame)

        def read(joint: Any) -> None:
            model.joints.append(self._joint(joint, poses, model.notes))

        run_all(partial(read, joint) for joint in joints.values())
        model.driven |= {
            (poses.prefix + joint, axis) for whole in poses.merged for joint, axis, _ in drives.of_plugins(whole)
        }
        if poses.prefix and poses.model.findtext("static", "").strip() in ("1", "true"):
            model.notes.append(f"<static> of the nested model '{poses.prefix[:-2]}' is not read")

    def _joint(self, element: Any, poses: SdfPoses, notes: list[str]) -> SdfJoint:
        name, kind = poses.prefix + str(element.get("name", "")), str(element.get("type", ""))
        label = f"joint '{name}'"
        if kind not in _JOINT_TYPES:
            near = did_you_mean(MEANT.get(kind, kind), _JOINT_TYPES)
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
        placement = poses.of_element(element)
        written = [axis for word in ("axis", "axis2")[: _AXES.get(kind, 0)] if (axis := element.find(word)) is not None]
        if kind in TWO_AXES and len(written) == 2 and written[1].find("xyz") is None:
            notes.append(f"axis2 of {label} is not given: 0 0 1, as SDF has it by default; for another, add <axis2>")
        axes = [self._axis(axis, label, placement, poses) for axis in written]
        if len(axes) < _AXES.get(kind, 0):
            raise self._error(element, f"{label} has {len(axes)} of {_AXES[kind]} axes: add <axis> or <axis2>")
        joint = SdfJoint(element, name, kind, ends[0], ends[1], placement, axes)
        if kind == "screw":
            joint.lead = lead(element, label, self.name)
        if kind == GEARBOX:
            body = element.find("gearbox_reference_body")
            if body is None:
                raise self._error(element, f"{label} has no <gearbox_reference_body>: add it")
            text = (body.text or "").strip()
            joint.reference = poses.link(text, body, f"{label} counts its angles from '{text}', which is not a link")
            joint.ratio = parameter(element, "gearbox_ratio", label, self.name, 1.0)
        return joint

    def _mimic(self, element: Any, label: str, poses: SdfPoses) -> SdfMimic:
        axis = element.get("axis", "axis")
        if axis not in ("axis", "axis2"):
            raise self._error(element, f"{label} mimics the axis '{axis}', which must be axis or axis2")
        owner, joint_name = poses.owner(element.get("joint", ""))
        words = (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
        values = [parameter(element, word, label, self.name, default) for word, default in words]
        return SdfMimic(element, owner.prefix + joint_name, int(axis == "axis2"), *values)

    def _axis(self, element: Any, label: str, frame: Array, poses: SdfPoses) -> SdfAxis:
        xyz = element.find("xyz")
        vector = direction(*((element, "0 0 1") if xyz is None else (xyz, xyz.text or "")), label, self.name)
        expressed = None if xyz is None else xyz.get("expressed_in")
        if expressed:
            frame = poses.of(expressed, xyz)
        elif element.findtext("use_parent_model_frame", "0").strip() in ("1", "true"):
            frame = poses.around(element)
        axis: Array = frame[:3, :3] @ vector
        low = self._number(element, "limit/lower", label, -math.inf)
        high = self._number(element, "limit/upper", label, math.inf)
        if low > high:
            raise self._error(element.find("limit"), limits_reversed(label, low, high))
        limits = (low if low > -UNLIMITED else -math.inf), (high if high < UNLIMITED else math.inf)
        velocity, effort = (self._number(element, f"limit/{word}", label, math.inf) for word in ("velocity", "effort"))
        mimic = element.find("mimic")
        mimicked = None if mimic is None else self._mimic(mimic, label, poses)
        damping, friction = (self._friction(element, word, label) for word in ("damping", "friction"))
        return SdfAxis(axis / np.linalg.norm(axis), limits, velocity, effort, mimicked, damping, friction)

    def _friction(self, axis: Any, word: str, label: str) -> float:
        element = axis.find(f"dynamics/{word}")
        text = "" if element is None else (element.text or "").strip()
        return check_friction(element, text, word, label, self.name) if text else 0.0

    def _number(self, axis: Any, path: str, label: str, default: float) -> float:
        """Return a limit; -1, or nothing, is SDF's notation for no limit of velocity or effort."""
        element = axis.find(path)
        if element is None or not (element.text or "").strip():
            return default
        text, word = element.text.strip(), path.rpartition("/")[2]
        unlimited = word in ("velocity", "effort") and number(text) == -1.0
        return math.inf if unlimited else limit_value(element, text, word, label, self.name)


# --- poses -------------------------------------------------------------------------------------------------------
