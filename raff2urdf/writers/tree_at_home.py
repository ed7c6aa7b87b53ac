"""A URDF's tree for simulators: at closed home, with its links grouped into rigid bodies.

At the zero of a URDF's joints, the loops of a closed robot are open. A simulation begins at the poses in the file: so
links are placed at closed home.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import yourdfpy
from numpy.typing import NDArray

from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.placement import joint_motion
from raff2urdf.readers.urdf import UNLIMITED
from raff2urdf.tree import WORLD

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TreeAtHome:
    """A robot's tree at closed home.

    Attributes:
        model: the tree.
        home: the joint values there, by name (rad, m); 0 for other joints.

    Raises:
        RaffError: the tree can't be written: other types of joints, mimic joints, several roots.
    """

    model: yourdfpy.Robot
    home: Mapping[str, float]

    def __post_init__(self) -> None:
        name = f"robot '{self.model.name}'"
        for joint in self.model.joints:
            base = joint.type == "floating" and joint is self.floating
            if self.kind(joint) not in ("revolute", "prismatic", "fixed") and not base:
                remedy = "replace it by revolute, continuous, prismatic or fixed ones"
                raise RaffError(f"{name}: joint '{joint.name}' of the type {joint.type} can't be written: {remedy}")
            if joint.mimic is not None:
                raise RaffError(f"{name}: joint '{joint.name}' mimics '{joint.mimic.joint}': remove its <mimic>")
        known = {link.name for link in self.model.links}
        if WORLD in known and (self.root != WORLD or self.link[WORLD].visuals or self.link[WORLD].collisions):
            raise RaffError(f"{name}: link '{WORLD}': simulators reserve that name for what does not move: rename it")
        if len(self.order) != len(known) - 1:
            raise RaffError(f"{name}: its links are not one tree under '{self.root}': connect them to it")

    @cached_property
    def link(self) -> Mapping[str, yourdfpy.Link]:
        """Links by name."""
        return {link.name: link for link in self.model.links}

    @cached_property
    def joint_of(self) -> Mapping[str, yourdfpy.Joint]:
        """The joint between each link and its parent, by the link's name."""
        return {joint.child: joint for joint in self.model.joints}

    @cached_property
    def children(self) -> Mapping[str, list[yourdfpy.Joint]]:
        """The joints of each link's children, in file order."""
        found: dict[str, list[yourdfpy.Joint]] = {}
        for joint in self.model.joints:
            found.setdefault(joint.parent, []).append(joint)
        return found

    @cached_property
    def root(self) -> str:
        """The link without a parent."""
        roots = [str(link.name) for link in self.model.links if link.name not in self.joint_of]
        if len(roots) != 1:
            listed = ", ".join(roots[:8])
            message = f"{len(roots)} links have no parent ({listed}): exactly one must be the root"
            raise RaffError(f"robot '{self.model.name}': {message}")
        return roots[0]

    @cached_property
    def floating(self) -> yourdfpy.Joint | None:
        """The floating joint between world and base; None if the base is fixed."""
        first = self.children.get(self.root, [])
        return first[0] if self.root == WORLD and len(first) == 1 and first[0].type == "floating" else None

    @cached_property
    def order(self) -> tuple[yourdfpy.Joint, ...]:
        """The joints in depth-first order, from the root on."""
        found: list[yourdfpy.Joint] = []
        pending = list(reversed(self.children.get(self.root, [])))
        while pending and len(found) < len(self.model.joints):
            found.append(pending.pop())
            pending.extend(reversed(self.children.get(found[-1].child, [])))
        return tuple(found)

    def value(self, joint: yourdfpy.Joint) -> float:
        """Return the joint's value at closed home (rad, m)."""
        return float(self.home.get(joint.name, 0.0))

    def placed(self, joint: yourdfpy.Joint) -> Array:
        """Return the placement (4, 4) of the joint's child on its parent at closed home."""
        origin = np.eye(4) if joint.origin is None else np.asarray(joint.origin, dtype=float)
        if joint.type in ("fixed", "floating"):
            return origin
        return np.asarray(origin @ joint_motion(joint.type == "prismatic", self.axis(joint), self.value(joint)))

    @cached_property
    def world(self) -> Mapping[str, Array]:
        """Placement (4, 4) of every link at closed home."""
        found = {self.root: np.eye(4)}
        for joint in self.order:
            found[joint.child] = found[joint.parent] @ self.placed(joint)
        return found

    @cached_property
    def carriers(self) -> Mapping[str, tuple[str, Array]]:
        """By link: the link that represents its rigid body (moved by a joint, or the root), and its placement on it."""
        found = {self.root: (self.root, np.eye(4))}
        for joint in self.order:
            carrier, placement = found[joint.parent]
            rigid = joint.type == "fixed" and joint.parent != WORLD
            found[joint.child] = (carrier, placement @ self.placed(joint)) if rigid else (joint.child, np.eye(4))
        return found

    @cached_property
    def rigid(self) -> Mapping[str, list[tuple[str, Array]]]:
        """Rigid bodies by the link that represents them: the other links fixed to it, with their placements."""
        found: dict[str, list[tuple[str, Array]]] = {}
        for name, (carrier, placement) in self.carriers.items():
            fixed = found.setdefault(carrier, [])
            if name != carrier:
                fixed.append((name, placement))
        return found

    @cached_property
    def moving(self) -> list[tuple[str, list[tuple[str, Array]]]]:
        """The bodies of `rigid` that can move."""
        return [
            (carrier, fixed)
            for carrier, fixed in self.rigid.items()
            if carrier != self.root and self.joint_of[carrier].type != "fixed"
        ]

    def end(self, end: Mapping[str, Any]) -> tuple[str, Array]:
        """Return the link of a loop's end, and the end's placement (4, 4) on it.

        Raises:
            RaffError: there is no such link.
        """
        if end["node"] not in self.link:
            known = did_you_mean(end["node"], list(self.link))
            raise RaffError(f"robot '{self.model.name}': a loop ends at '{end['node']}', which is not a link{known}")
        return end["node"], np.array(end["placement"], dtype=float)

    @staticmethod
    def kind(joint: yourdfpy.Joint) -> str:
        """Return the kind of a joint: revolute, prismatic, fixed or floating."""
        return "revolute" if joint.type == "continuous" else str(joint.type)

    @staticmethod
    def axis(joint: yourdfpy.Joint) -> Array:
        """Return the joint's unit axis (3,)."""
        given = np.array([1.0, 0.0, 0.0]) if joint.axis is None else np.asarray(joint.axis, dtype=float)
        length = float(np.linalg.norm(given))
        if not length > 1e-9:
            raise RaffError(f"joint '{joint.name}' has the axis 0 0 0: give it a direction")
        return given / length

    @staticmethod
    def limits(joint: yourdfpy.Joint) -> tuple[float, float]:
        """Return the lower and upper limit of a joint (rad, m); infinite if the URDF gives none."""
        given = joint.limit
        if joint.type == "continuous" or given is None or (given.lower is None and given.upper is None):
            return -math.inf, math.inf
        low, high = given.lower or 0.0, given.upper or 0.0
        return (low if low > -UNLIMITED else -math.inf), (high if high < UNLIMITED else math.inf)

    @staticmethod
    def greatest(joint: yourdfpy.Joint, word: str) -> float:
        """Return a joint's limit of `velocity` or `effort`; infinite if the URDF gives none."""
        value = None if joint.limit is None else getattr(joint.limit, word)
        return math.inf if value is None or value >= UNLIMITED else float(value)


def shape_of(geometry: yourdfpy.Geometry | None) -> tuple[str, Array, str]:
    """Return kind, sizes and file of a shape; an empty kind without a shape.

    Sizes are the sides (3,) of a box, radius and length of a cylinder along z, the radius of a sphere, m; and the
    scales (3,) of a mesh, which alone has a file.
    """
    for kind, words in _SIZES.items():
        solid = getattr(geometry, kind, None)
        if solid is not None:
            sizes = [1.0 if getattr(solid, word) is None else getattr(solid, word) for word in words]
            found = np.concatenate([np.ravel(size) for size in sizes]).astype(float)
            return (
                kind,
                np.array(np.broadcast_to(found, 3)) if kind == "mesh" else found,
                getattr(solid, "filename", ""),
            )
    return "", np.zeros(0), ""


_SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",), "mesh": ("scale",)}


def loop_element(elements: Mapping[str, str], loop: Mapping[str, Any], format: str) -> str:
    """Return the name that a format has for a kind of loop.

    Args:
        elements: the format's names, by kind.
        loop: an entry of the constraints.
        format: its name, for the error.

    Raises:
        RaffError: the format has none.
    """
    if loop["kind"] not in elements:
        known = did_you_mean(loop["kind"], list(elements))
        raise RaffError(f"loop '{loop['name']}': {format} has no loops of the kind '{loop['kind']}'{known}")
    return elements[loop["kind"]]


def unique_name(name: str, taken: Collection[str]) -> str:
    """Return the name, with `#2` and so on appended if it is taken."""
    found, number = name, 1
    while found in taken:
        number += 1
        found = f"{name}#{number}"
    return found
