"""The tree of a URDF as the readers of loops need it: placements at zero, rigid bodies, and chains of joints."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from lxml import etree

from raff2urdf.arrays import Array
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.placement import roll_pitch_yaw, with_z
from raff2urdf.readers.loops.successive import Step, massless_link
from raff2urdf.readers.urdf import ends, joints, links, origin, three
from raff2urdf.readers.xml_file import error_at


class UrdfTree:
    """A URDF whose joints form a tree.

    Attributes:
        root: its root element.
        name: of the file, in errors.
        base: name of the link without a parent.
        zero: placement (4, 4) of each link in the base, with all joints at 0.
    """

    def __init__(self, root: Any, name: str) -> None:
        self.root, self.name = root, name
        self.links = {str(link.get("name")): link for link in links(root)}
        self.joints = {str(joint.get("name")): joint for joint in joints(root)}
        self._above = {ends(joint)[1]: joint for joint in self.joints.values()}
        self._bodies: dict[str, tuple[str, Array]] = {}
        self.base = next(link for link in self.links if link not in self._above)
        self.zero = {self.base: np.eye(4)}
        for link in self.links:
            path = []
            while link not in self.zero:
                path.append(self._above[link])
                link = ends(path[-1])[0]
            for joint in reversed(path):
                parent, child = ends(joint)
                self.zero[child] = self.zero[parent] @ origin(joint, name)

    def above(self, link: str) -> list[Any]:
        """Return the joints between a link and the base, the link's own one first."""
        chain = []
        while link in self._above:
            chain.append(self._above[link])
            link = ends(chain[-1])[0]
        return chain

    def between(self, first: str, second: str) -> tuple[list[Any], list[Any]]:
        """Return the joints from the nearest common ancestor of two links to each of them."""
        chain, other = self.above(first)[::-1], self.above(second)[::-1]
        while chain and other and chain[0] is other[0]:
            chain, other = chain[1:], other[1:]
        return chain, other

    @cached_property
    def size(self) -> float:
        """Largest extent of the links' origins along an axis of the base, with all joints at 0, m."""
        return max(float(np.ptp([placed[:3, 3] for placed in self.zero.values()], axis=0).max()), 1e-6)

    def body(self, link: str) -> tuple[str, Array]:
        """Return the first link of the rigid body that a link belongs to, and the link's placement (4, 4) on it."""
        if link not in self._bodies:
            self._bodies[link] = self._body(link)
        return self._bodies[link]

    def _body(self, link: str) -> tuple[str, Array]:
        carrier = link
        for joint in self.above(link):
            if joint.get("type") != "fixed":
                break
            carrier = ends(joint)[0]
        return carrier, np.linalg.inv(self.zero[carrier]) @ self.zero[link]

    def link(self, element: Any, name: str | None, what: str) -> str:
        """Return the name of a link, without the scopes of SDF.

        Args:
            element: that names it.
            name: as given.
            what: the element, in errors.

        Raises:
            RaffError: no such link.
        """
        full = (name or "").strip()
        if full in self.links:
            return full
        scoped = full.rpartition("::")[2]
        if scoped in self.links:
            return scoped
        if scoped == "world":
            return self.base
        why = f"names '{full}', which is not a link{did_you_mean(full, list(self.links))}" if full else "names no link"
        raise error_at(self.name, element, f"{what} {why}")

    def error(self, element: Any, message: str) -> RaffError:
        """Return an error with the line of an element."""
        return error_at(self.name, element, message)

    def vector(self, element: Any | None, word: str = "xyz", default: str = "1 0 0") -> Array:
        """Return a unit vector (3,) of an element's attribute; of the default without the element.

        Raises:
            RaffError: it is not three numbers, or all are 0.
        """
        if element is None:
            return np.array([float(x) for x in default.split()])
        direction = np.array(three(element, word, self.name, default))
        if np.linalg.norm(direction) <= 1e-9:
            raise self.error(element, f"the axis of <{element.tag}> must not be 0 0 0")
        return np.asarray(direction / np.linalg.norm(direction))

    def free_name(self, name: str) -> str:
        """Return a name that no link and no joint has."""
        while name in self.links or name in self.joints:
            name += "_"
        return name

    def add_joints(self, link: str, placed: Array, name: str, steps: Sequence[Step]) -> tuple[str, list[str]]:
        """Add successive passive joints to a link, with an empty link behind each.

        Args:
            link: the parent.
            placed: (4, 4) of the first joint on it.
            name: from which the joints and links are named.
            steps: suffix of the name, type and axis of each.

        Returns:
            the last link, and the names of the joints.
        """
        names: list[str] = []
        before = self.links[link]
        for suffix, kind, vector in steps:
            free = self.free_name(f"{name}_{suffix}")
            body = massless_link(free)
            joint = etree.Element("joint", name=free, type=kind)
            etree.SubElement(joint, "parent", link=link)
            etree.SubElement(joint, "child", link=free)
            etree.SubElement(joint, "origin", xyz=_text(placed[:3, 3]), rpy=_text(roll_pitch_yaw(placed)))
            etree.SubElement(joint, "axis", xyz=_text(vector))
            if kind == "prismatic":
                etree.SubElement(joint, "limit", lower="-1e9", upper="1e9", effort="1e9", velocity="1e9")
            before.addnext(body)
            body.addnext(joint)
            self.zero[free] = self.zero[link] @ placed
            self.links[free], self.joints[free], self._above[free] = body, joint, joint
            names.append(free)
            link, before, placed = free, body, np.eye(4)
        return link, names


def text_of(root: Any) -> str:
    """Return the text of a URDF, with every element on its line unless joints were added."""
    text: str = etree.tostring(root, encoding="unicode")
    return "\n" * (int(root.sourceline) - 1) + text


def along(placed: Array, direction: Array, near: Array | None = None) -> Array:
    """Return a placement (4, 4) at the origin of another one, with its z along a unit vector (3,) of that one.

    Args:
        placed: (4, 4).
        direction: (3,) unit vector, in the axes of `placed`.
        near: (3,) vector to which x is as near as possible.
    """
    turned = np.eye(4)
    turned[:3, :3] = np.eye(3) if np.array_equal(direction, (0.0, 0.0, 1.0)) else with_z(direction, near)
    return np.asarray(placed @ turned)


def _text(values: Sequence[float] | Array) -> str:
    return " ".join(repr(float(x)) for x in values)
