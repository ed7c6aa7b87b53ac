"""A URDF's tree as simulators want it: at closed home, and which of its links are one rigid body.

The joint values of a URDF count from its own zero, where the loops of a closed robot stand open. A simulator begins
where the file places the bodies: so they are placed at closed home.
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

from raff2urdf.errors import RaffError
from raff2urdf.placement import rotation
from raff2urdf.readers.urdf import UNLIMITED

Array = NDArray[np.float64]

WORLD = "world"
"""The name that simulators keep for what does not move; a URDF's root of that name is the same."""

TURNS, SLIDES, FIXED = ("revolute", "continuous"), ("prismatic",), ("fixed",)


@dataclass(frozen=True)
class TreeAtHome:
    """A robot's tree at closed home.

    Attributes:
        model: the tree.
        home: the joint values there, by name (rad, m); 0 where none is said.

    Raises:
        RaffError: the tree holds what can't be written: joints of other kinds, joints that copy others, no one root.
    """

    model: yourdfpy.Robot
    home: Mapping[str, float]

    def __post_init__(self) -> None:
        name = f"robot '{self.model.name}'"
        for joint in self.model.joints:
            floats = joint.type == "floating" and joint is self.floating
            if joint.type not in (*TURNS, *SLIDES, *FIXED) and not floats:
                raise RaffError(
                    f"{name}: joint '{joint.name}' is {joint.type}: only what turns or slides can be written"
                )
            if joint.mimic is not None:
                raise RaffError(f"{name}: joint '{joint.name}' copies '{joint.mimic.joint}', which can't be written")
        known = {link.name for link in self.model.links}
        if WORLD in known and (self.root != WORLD or self.link[WORLD].visuals or self.link[WORLD].collisions):
            raise RaffError(f"{name}: link '{WORLD}': simulators keep that name for what does not move: rename it")
        if len(self.order) != len(known) - 1:
            raise RaffError(f"{name}: its links are not one tree under '{self.root}'")

    @cached_property
    def link(self) -> Mapping[str, yourdfpy.Link]:
        """Links by name."""
        return {link.name: link for link in self.model.links}

    @cached_property
    def children(self) -> Mapping[str, list[yourdfpy.Joint]]:
        """The joints on each link, in file order."""
        found: dict[str, list[yourdfpy.Joint]] = {}
        for joint in self.model.joints:
            found.setdefault(joint.parent, []).append(joint)
        return found

    @cached_property
    def root(self) -> str:
        """The link that stands on no other."""
        held = {joint.child for joint in self.model.joints}
        roots = [link.name for link in self.model.links if link.name not in held]
        if len(roots) != 1:
            raise RaffError(f"robot '{self.model.name}': {len(roots)} links stand on no other, instead of one")
        return str(roots[0])

    @cached_property
    def floating(self) -> yourdfpy.Joint | None:
        """The joint by which the robot moves freely in the world, if it does."""
        first = self.children.get(self.root, [])
        return first[0] if self.root == WORLD and len(first) == 1 and first[0].type == "floating" else None

    @cached_property
    def order(self) -> tuple[yourdfpy.Joint, ...]:
        """The joints, each behind the one that carries it, branch after branch."""
        found: list[yourdfpy.Joint] = []
        waiting = list(reversed(self.children.get(self.root, [])))
        while waiting and len(found) < len(self.model.joints):
            joint = waiting.pop()
            found.append(joint)
            waiting.extend(reversed(self.children.get(joint.child, [])))
        return tuple(found)

    @cached_property
    def holding(self) -> Mapping[str, yourdfpy.Joint]:
        """The joint by which each link but the root stands on its parent."""
        return {joint.child: joint for joint in self.model.joints}

    def value(self, joint: yourdfpy.Joint) -> float:
        """The joint's value at closed home (rad, m)."""
        return float(self.home.get(joint.name, 0.0))

    def placed(self, joint: yourdfpy.Joint) -> Array:
        """Where the joint's child stands on its parent at closed home (4, 4)."""
        origin = np.eye(4) if joint.origin is None else np.asarray(joint.origin, dtype=float)
        if joint.type in TURNS:
            return np.asarray(origin @ rotation(axis(joint), self.value(joint)))
        if joint.type in SLIDES:
            along = np.eye(4)
            along[:3, 3] = axis(joint) * self.value(joint)
            return np.asarray(origin @ along)
        return origin

    @cached_property
    def bearers(self) -> Mapping[str, tuple[str, Array]]:
        """Of each link, the link of its rigid body that a joint moves (or the root), and its placement there."""
        found = {self.root: (self.root, np.eye(4))}
        for joint in self.order:
            bearer, placement = found[joint.parent]
            rigid = joint.type in FIXED and joint.parent != WORLD
            found[joint.child] = (bearer, placement @ self.placed(joint)) if rigid else (joint.child, np.eye(4))
        return found

    @cached_property
    def rigid(self) -> Mapping[str, list[tuple[str, Array]]]:
        """Of each rigid body, by the link that bears it: the other links fixed on it, with their placements."""
        found: dict[str, list[tuple[str, Array]]] = {}
        for name, (bearer, placement) in self.bearers.items():
            if name == bearer:
                found[name] = []
            else:
                found[bearer].append((name, placement))
        return found

    @cached_property
    def moving(self) -> list[tuple[str, list[tuple[str, Array]]]]:
        """Those of `rigid` that can move."""
        still = {self.root} | {joint.child for joint in self.order if joint.type in FIXED}
        return [(bearer, fixed) for bearer, fixed in self.rigid.items() if bearer not in still]

    @cached_property
    def world(self) -> Mapping[str, Array]:
        """Where every link stands at closed home (4, 4)."""
        found = {self.root: np.eye(4)}
        for joint in self.order:
            found[joint.child] = found[joint.parent] @ self.placed(joint)
        return found

    def end(self, end: Mapping[str, Any]) -> tuple[str, Array]:
        """An end of a loop: its link, and where it is on it (4, 4).

        Raises:
            RaffError: there is no such link.
        """
        if end["node"] not in self.link:
            raise RaffError(f"robot '{self.model.name}': a loop ends on '{end['node']}', which is no link")
        return end["node"], np.array(end["placement"], dtype=float)

    def borne(self, end: Mapping[str, Any]) -> tuple[str, Array]:
        """The same, on the link that bears its rigid body.

        Raises:
            RaffError: there is no such link.
        """
        node, placement = self.end(end)
        bearer, on = self.bearers[node]
        return bearer, on @ placement


def axis(joint: yourdfpy.Joint) -> Array:
    """The joint's axis (3,), of length 1."""
    given = np.array([1.0, 0.0, 0.0]) if joint.axis is None else np.asarray(joint.axis, dtype=float)
    length = float(np.linalg.norm(given))
    if not length > 1e-9:
        raise RaffError(f"joint '{joint.name}': its axis has no length")
    return given / length


def limits(joint: yourdfpy.Joint) -> tuple[float, float]:
    """Low and high of a joint (rad, m); infinite where the URDF gives none."""
    given = joint.limit
    if joint.type == "continuous" or given is None or (given.lower is None and given.upper is None):
        return -math.inf, math.inf
    low, high = given.lower or 0.0, given.upper or 0.0
    return (low if low > -UNLIMITED else -math.inf), (high if high < UNLIMITED else math.inf)


def greatest(value: float | None) -> float:
    """A limit of speed or effort; infinite where the URDF gives none."""
    return math.inf if value is None or value >= UNLIMITED else float(value)


def unlike(name: str, taken: Collection[str]) -> str:
    """The name, or with `#2` and so on behind it where it is taken."""
    found, number = name, 1
    while found in taken:
        number += 1
        found = f"{name}#{number}"
    return found
