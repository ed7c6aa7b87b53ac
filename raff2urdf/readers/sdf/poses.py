"""Where everything of an SDF stands: poses relative to each other, names looked up, models within models."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.placement import from_origin, from_quaternion, inverse
from raff2urdf.readers.urdf import SIZE, numbers

Array = NDArray[np.float64]

WORLD = "world"


def error_at(name: str, element: Any, message: str) -> RaffError:
    """What is wrong with an element of the file of that name."""
    return RaffError(f"{name}:{element.sourceline}: {message}")


def pose(element: Any, name: str) -> Array:
    """The matrix (4, 4) of an element's <pose>, in whatever frame it names; `name` is the file's."""
    written = element.find("pose")
    text = "" if written is None else (written.text or "").strip()
    if not text:
        return np.eye(4)
    found = numbers(text)
    quaternion = written.get("rotation_format") == "quat_xyzw"
    if found is None or len(found) != (7 if quaternion else 6):
        raise error_at(name, written, f"the pose '{text}' must be {'seven' if quaternion else 'six'} numbers{SIZE}")
    matrix = np.eye(4)
    matrix[:3, 3] = found[:3]
    if quaternion:
        x, y, z, w = found[3:]
        if math.hypot(x, y, z, w) <= 1e-9:
            raise error_at(name, written, f"the quaternion of the pose '{text}' is 0: it turns no way")
        matrix[:3, :3] = from_quaternion(w, x, y, z)
    else:
        degrees = written.get("degrees", "false") in ("1", "true")
        matrix = from_origin(found[:3], [math.radians(a) if degrees else a for a in found[3:]])
    return matrix


class SdfPoses:
    """Where the links, joints, frames and models of one model stand, in the outermost model's frame.

    Names are looked up in the model itself; `inner::name` is in a model within it.
    """

    def __init__(self, name: str, model: Any, placed: Array, prefix: str) -> None:
        self.name, self.model, self.placed, self.prefix = name, model, placed, prefix
        self.elements: dict[str, Any] = {}
        for tag in ("link", "model", "frame", "joint"):  # files before 1.7 give a joint and a link the same name
            for element in model.iterchildren(tag):
                self.elements.setdefault(str(element.get("name", "")), element)
        self.found: dict[Any, Array] = {}
        self.within: dict[Any, SdfPoses] = {}
        self.asked: set[Any] = set()

    def of(self, name: str, where: Any) -> Array:
        """The placement of what bears this name; `where` is the element that speaks of it."""
        if name in ("__model__", ""):
            return self.placed
        element, inner, rest = self._find(name)
        if inner is not None:
            return inner.of(rest, where)
        if element is not None:
            return self.of_element(element)
        if name == WORLD:
            return np.eye(4)
        known = [*self.elements, "__model__"]
        raise error_at(self.name, where, f"no frame '{name}'{did_you_mean(name, known)}")

    def of_element(self, element: Any) -> Array:
        """The placement of a link, joint, frame or model."""
        chain, at = [], element  # each is placed relative to the next
        while at is not None and at not in self.found:
            if at in self.asked:
                raise error_at(self.name, at, f"the pose of '{at.get('name')}' is given relative to itself")
            self.asked.add(at)
            chain.append(at)
            at = self._find(self._base(at)[0])[0]
        for one in reversed(chain):
            self.found[one] = self.of(*self._base(one)) @ pose(one, self.name)
        self.asked.difference_update(chain)
        return self.found[element]

    def inner(self, model: Any) -> SdfPoses:
        """The same of a model within this one."""
        if model not in self.within:
            prefix, placed, held = f"{self.prefix}{model.get('name')}::", self.of_element(model), np.eye(4)
            if model.get("placement_frame"):  # that is what the pose places
                held = SdfPoses(self.name, model, np.eye(4), prefix).of(model.get("placement_frame"), model)
            self.within[model] = SdfPoses(self.name, model, placed @ inverse(held), prefix)
        return self.within[model]

    def link(self, name: str, where: Any, wrong: str = "") -> str:
        """The link, by its full name, that a name stands for: what a frame is attached to, a joint's child.

        Args:
            name: of a link, a frame, a joint or a model.
            where: the element that speaks of it.
            wrong: what to say if there is none.
        """
        passed = set()
        while name not in ("__model__", ""):
            element, inner, rest = self._find(name)
            if inner is not None:
                return inner.link(rest, where, wrong)
            if element is None and name == WORLD:
                return WORLD
            if element is None:
                near = did_you_mean(name, [WORLD, *self.elements])
                raise error_at(self.name, where, (wrong or f"no link or frame '{name}'") + near)
            if element.tag == "link":
                return self.prefix + name
            if element.tag == "model":
                return self.inner(element).canonical()
            if element in passed:
                raise error_at(self.name, element, f"the {element.tag} '{name}' is attached to itself")
            passed.add(element)
            child, where = element.find("child"), element
            name = element.get("attached_to", "") if element.tag == "frame" else "" if child is None else named(child)
        return self.canonical()

    def canonical(self) -> str:
        """The link, by its full name, that the model's own frame is attached to."""
        said = self.model.get("canonical_link")
        if said:
            return self.link(said, self.model, f"the canonical link '{said}' does not exist")
        for link in self.model.iterchildren("link"):
            return self.prefix + str(link.get("name", ""))
        for model in self.model.iterchildren("model"):
            return self.inner(model).canonical()
        raise error_at(self.name, self.model, f"the model '{self.model.get('name', '')}' has no link")

    def _find(self, name: str) -> tuple[Any, SdfPoses | None, str]:
        """The element of that name; or the model within this one where the rest of the name is to be looked up."""
        if name in ("__model__", WORLD, ""):
            return None, None, ""
        if name in self.elements:
            return self.elements[name], None, ""
        for model in self.model.iterchildren("model"):
            if name.startswith(f"{model.get('name')}::"):
                return None, self.inner(model), name[len(str(model.get("name"))) + 2 :]
        return None, None, ""

    def _base(self, element: Any) -> tuple[str, Any]:
        """The name of what an element's pose is relative to, and the element that says so."""
        pose = element.find("pose")
        said = None if pose is None else pose.get("relative_to") or pose.get("frame")
        if said:
            return str(said), pose
        if element.tag == "joint":
            child = element.find("child")
            return ("", element) if child is None else (named(child), child)
        return (element.get("attached_to") or "" if element.tag == "frame" else ""), element


def named(end: Any) -> str:
    """The name that a joint's <parent> or <child> holds."""
    return str(end.get("link_name") or end.text or "").strip()
