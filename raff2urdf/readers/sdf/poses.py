"""Poses in an SDF, each in the frame that it is relative to."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.errors import did_you_mean, warn
from raff2urdf.placement import from_origin, from_quaternion, inverse
from raff2urdf.readers.loops.implausible import in_degrees
from raff2urdf.readers.urdf import SIZE, numbers
from raff2urdf.readers.xml_file import NAMESPACE, error_at
from raff2urdf.tree import WORLD


def pose(element: Any, name: str) -> Array:
    """Return the placement (4, 4) of an element's <pose>, in whatever frame it names; `name` is the file's."""
    written = element.find("pose")
    text = "" if written is None else (written.text or "").strip()
    if not text:
        return np.eye(4)
    values = numbers(text)
    quaternion = written.get("rotation_format") == "quat_xyzw"
    if values is None or len(values) != (7 if quaternion else 6):
        six = "six numbers, x y z and roll pitch yaw" + (f": '{text} 0 0 0'" if values and len(values) == 3 else "")
        raise error_at(name, written, f"the pose '{text}' must be {'seven numbers' if quaternion else six}{SIZE}")
    if not quaternion:
        degrees = written.get("degrees", "false") in ("1", "true")
        if not degrees and in_degrees(values[3:]):
            why = f"the pose '{text}' turns by more than a revolution, since angles are in radians"
            warn(f'{name}:{written.sourceline}: {why}: if these are degrees, write <pose degrees="true">')
        return from_origin(values[:3], [math.radians(a) if degrees else a for a in values[3:]])
    x, y, z, w = values[3:]
    if math.hypot(x, y, z, w) <= 1e-9:
        raise error_at(name, written, f"the quaternion of the pose '{text}' is 0, which is not a rotation")
    return from_quaternion(values[:3], (w, x, y, z))


MERGED = f"{{{NAMESPACE}}}merged"
"""Attribute of a model whose links, joints and frames belong to the model around it."""


class SdfPoses:
    """Poses of the links, joints, frames and nested models of one model, in the outermost model's frame.

    Names are looked up in the model itself, with all that are merged with it; `inner::name` is in a nested model.

    Args:
        name: of the file, in errors.
        model: the element.
        placed: (4, 4), of the model.
        prefix: of full names of its links.
    """

    def __init__(self, name: str, model: Any, placed: Array, prefix: str) -> None:
        self.name, self.model, self.placed, self.prefix = name, model, placed, prefix
        self.merged = [model]
        for each in self.merged:
            self.merged += [inner for inner in each.iterchildren("model") if inner.get(MERGED)]
        self.elements: dict[str, Any] = {}
        for tag in ("link", "model", "frame", "joint"):  # files before 1.7 give a joint and a link the same name
            for element in self.children(tag):
                self.elements.setdefault(str(element.get("name", "")), element)
        for reserved in ("__model__", WORLD, ""):
            self.elements.pop(reserved, None)
        self._known: dict[Any, Array] = {}
        self._nested: dict[Any, SdfPoses] = {}
        self._pending: set[Any] = set()

    def children(self, tag: str) -> Iterator[Any]:
        """Yield the elements of a tag, with those of merged models."""
        inner = (element for model in self.merged for element in model.iterchildren(tag))
        return (element for element in inner if not element.get(MERGED))

    def of(self, name: str, where: Any) -> Array:
        """Return the pose of what has this name; `where` is the element that names it."""
        poses, name = self.owner(name)
        if name in ("__model__", ""):
            return self.around(where) if poses is self else poses.placed
        if name in poses.elements:
            return poses.of_element(poses.elements[name])
        if name == WORLD:
            return np.eye(4)
        raise error_at(
            self.name, where, f"there is no frame '{name}'{did_you_mean(name, [*poses.elements, '__model__'])}"
        )

    def of_element(self, element: Any) -> Array:
        """Return the pose of a link, joint, frame or model."""
        chain, at = [], element  # each is placed relative to the next
        while at is not None and at not in self._known:
            if at in self._pending:
                raise error_at(
                    self.name, at, f"the pose of '{at.get('name')}' is given relative to itself: name another frame"
                )
            self._pending.add(at)
            chain.append(at)
            at = self.elements.get(self._relative_to(at)[0])
        for at in reversed(chain):
            self._known[at] = self.of(*self._relative_to(at)) @ pose(at, self.name)
        self._pending.difference_update(chain)
        return self._known[element]

    def nested(self, model: Any) -> SdfPoses:
        """Return the poses of a nested model."""
        if model not in self._nested:
            prefix = f"{self.prefix}{model.get('name')}::"
            self._nested[model] = SdfPoses(self.name, model, self._of_model(model), prefix)
        return self._nested[model]

    def around(self, element: Any) -> Array:
        """Return the frame of the model that holds an element: this one, or one that is merged with it."""
        posed = element.getparent() if element.tag == "pose" else element
        model = next(posed.iterancestors("model"), None)
        return self._of_model(model) if model in self.merged[1:] else self.placed

    def _of_model(self, model: Any) -> Array:
        """Return the frame of an inner model."""
        placed = self.of_element(model)
        if model.get("placement_frame"):  # the frame that the pose places
            inner = SdfPoses(self.name, model, np.eye(4), "")
            placed = placed @ inverse(inner.of(model.get("placement_frame"), model))
        return placed

    def link(self, name: str, where: Any, wrong: str = "") -> str:
        """Return the full name of the link that a name refers to: what a frame is attached to, a joint's child.

        Args:
            name: of a link, a frame, a joint or a model.
            where: the element that names it.
            wrong: the error if there is none.
        """
        passed = set()
        while name not in ("__model__", ""):
            poses, inner = self.owner(name)
            if poses is not self:
                return poses.link(inner, where, wrong)
            element = self.elements.get(name)
            if name == WORLD:
                return WORLD
            if element is None:
                near = did_you_mean(name, [WORLD, *self.elements])
                raise error_at(self.name, where, (wrong or f"there is no link or frame '{name}'") + near)
            if element.tag == "link":
                return self.prefix + name
            if element.tag == "model":
                return self.nested(element).canonical()
            if element in passed:
                raise error_at(
                    self.name, element, f"the {element.tag} '{name}' is attached to itself: name another frame"
                )
            passed.add(element)
            child, where = element.find("child"), element
            name = element.get("attached_to", "") if element.tag == "frame" else "" if child is None else named(child)
        return self.canonical(next(where.iterancestors("model"), self.model))

    def canonical(self, model: Any = None) -> str:
        """Return the full name of the link that the frame of the model, or of a merged one, is attached to."""
        model = model if model in self.merged else self.model
        name = model.get("canonical_link")
        if name:
            return self.link(name, model, f"the canonical link '{name}' does not exist")
        for inner in model.iterchildren("link", "model"):
            if inner.tag == "link" or inner in self.merged:
                return self.canonical(inner) if inner in self.merged else self.prefix + str(inner.get("name", ""))
        for nested in model.iterchildren("model"):
            return self.nested(nested).canonical()
        raise error_at(self.name, model, f"the model '{model.get('name', '')}' has no link: add one")

    def owner(self, name: str) -> tuple[SdfPoses, str]:
        """Return the poses of the model, this or a nested one, that a name refers to, and the name in it."""
        if name not in self.elements:
            for model in self.children("model"):
                if name.startswith(f"{model.get('name')}::"):
                    return self.nested(model).owner(name[len(str(model.get("name"))) + 2 :])
        return self, name

    def _relative_to(self, element: Any) -> tuple[str, Any]:
        """Return the name of what an element's pose is relative to, and the element that names it."""
        pose = element.find("pose")
        name = None if pose is None else pose.get("relative_to") or pose.get("frame")
        if name:
            return str(name), pose
        if element.tag == "joint":
            child = element.find("child")
            return ("", element) if child is None else (named(child), child)
        return (element.get("attached_to") or "" if element.tag == "frame" else ""), element


def named(end: Any) -> str:
    """Return the name in a joint's <parent> or <child>."""
    return str(end.get("link_name") or end.text or "").strip()
