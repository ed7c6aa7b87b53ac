"""The tree of a robot for simulators: at closed home, with its links grouped into rigid bodies.

At the zero of a URDF's joints, the loops of a closed robot are open. A simulation begins at the poses in the file: so
links are placed at closed home.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from raff2urdf.arrays import Array
from raff2urdf.bounds import UNLIMITED
from raff2urdf.coupling import Coupling, coupling_of
from raff2urdf.escape import unique_name
from raff2urdf.placement import joint_motion
from raff2urdf.readers.urdf_file import SHAPES
from raff2urdf.tree import WORLD

if TYPE_CHECKING:
    from yourdfpy import Geometry, Joint, Link, Robot

    from raff2urdf.conversion import Translation


Z_AXIS = np.array([0.0, 0.0, 1.0])
"""The axis (3,) of every joint, in its own frame."""


class TreeAtHome:
    """A robot's tree at closed home.

    Attributes:
        model: the tree of its URDF; ends of loops that are not on a link's frame are links of their own.
        home: the joint values at closed home, by name (rad, m), of the joints that move.
        entries: of these joints in the constraints file, by name, with their `limits` and `velocity`, None without any,
            and their friction.
        gravity: acceleration in the world (3,), m/s2; None if the file gives none.
        loops: its entries of the loops.
        couplings: its couplings.
        link: links by name.
        joint_of: the joint between each link and its parent, by the link's name.
        root: the link without a parent: the world, or a base at its origin.
        order: the joints in depth-first order, from the root on.
        floating: the joint between world and a base that can move; None if the base is fixed.
    """

    def __init__(self, translation: Translation) -> None:
        self.model, self.loops = _with_ends(translation.model.robot, translation.constraints["loops"])
        self.home, self.gravity = translation.analysis.home, translation.constraints.get("gravity")
        bounds = {joint.name: _bounds(joint) for joint in self.model.joints if joint.limit is not None}
        self.entries = {entry["name"]: entry | bounds[entry["name"]] for entry in translation.constraints["joints"]}
        self.couplings: list[Coupling] = [coupling_of(entry) for entry in translation.constraints.get("couplings", [])]
        self.link: dict[str, Link] = {link.name: link for link in self.model.links}
        self.joint_of: dict[str, Joint] = {joint.child: joint for joint in self.model.joints}
        self.root = next(iter(self.link))
        children = [part.node for part in translation.robot.outward]
        children += [link.name for link in self.model.links[len(translation.model.robot.links) :]]
        self.order = [self.joint_of[child] for child in ("base", *children) if child in self.joint_of]
        self.floating = self.joint_of["base"] if translation.robot.movable else None

    def placed(self, joint: Joint) -> Array:
        """Return the placement (4, 4) of the joint's child on its parent at closed home."""
        origin = np.asarray(joint.origin, dtype=float)
        if joint.name not in self.home:
            return origin
        return np.asarray(origin @ joint_motion(joint.type == "prismatic", Z_AXIS, self.home[joint.name]))

    @cached_property
    def world(self) -> Mapping[str, Array]:
        """Placement (4, 4) of every link at closed home."""
        placements = {self.root: np.eye(4)}
        for joint in self.order:
            placements[joint.child] = placements[joint.parent] @ self.placed(joint)
        return placements

    @cached_property
    def carriers(self) -> Mapping[str, tuple[str, Array]]:
        """By link: the link that represents its rigid body (moved by a joint, or the root), and its placement on it."""
        carried = {self.root: (self.root, np.eye(4))}
        for joint in self.order:
            carrier, placement = carried[joint.parent]
            rigid = joint.type == "fixed" and joint.parent != WORLD
            carried[joint.child] = (carrier, placement @ self.placed(joint)) if rigid else (joint.child, np.eye(4))
        return carried

    @cached_property
    def rigid(self) -> Mapping[str, list[tuple[str, Array]]]:
        """Rigid bodies by the link that represents them: their links, this one first, with their placements on it."""
        bodies: dict[str, list[tuple[str, Array]]] = {}
        for name, (carrier, placement) in self.carriers.items():
            bodies.setdefault(carrier, []).append((name, placement))
        return bodies

    @cached_property
    def moving(self) -> Mapping[str, list[tuple[str, Array]]]:
        """The bodies of `rigid` that can move."""
        fixed = {self.root, *(joint.child for joint in self.order if joint.type == "fixed")}
        return {carrier: parts for carrier, parts in self.rigid.items() if carrier not in fixed}


def _with_ends(robot: Robot, loops: Sequence[Mapping[str, Any]]) -> tuple[Robot, list[dict[str, Any]]]:
    """Return a robot that has a link at each end of a loop that is not on a link's frame, behind its own links, and the
    loops between links' frames."""
    from yourdfpy import Joint, Link, Robot

    links, joints, copies = list(robot.links), list(robot.joints), [dict(loop) for loop in loops]
    for loop, which in product(copies, ("first", "second")):
        end = loop[which]
        if not np.array_equal(end["placement"], np.eye(4)):
            name = unique_name(f"{loop['name']}.{which}", [link.name for link in links])
            links.append(Link(name=name))
            joints.append(Joint(name, "fixed", end["node"], name, origin=np.array(end["placement"])))
            loop[which] = {"node": name, "placement": np.eye(4)}
    return Robot(robot.name, links, joints), copies


def _bounds(joint: Joint) -> dict[str, Any]:
    """Return limits, velocity limit and effort limit of a joint, None where it has none; and its friction."""
    limit, resisting = joint.limit, joint.dynamics
    low, high = limit.lower, limit.upper
    unlimited = low is None or high is None or (low <= -UNLIMITED and high >= UNLIMITED)
    return {
        "limits": None if unlimited else [low, high],
        "velocity": limit.velocity if limit.velocity < UNLIMITED else None,
        "effort": limit.effort if 0.0 < limit.effort < UNLIMITED else None,
        "damping": 0.0 if resisting is None else resisting.damping,
        "friction": 0.0 if resisting is None else resisting.friction,
    }


def shape_of(geometry: Geometry) -> tuple[str, Array, str]:
    """Return kind, sizes and file of a shape.

    Sizes are the sides (3,) of a box, radius and length of a cylinder along z, the radius of a sphere, m; and the
    scales (3,) of a mesh, which alone has a file.
    """
    kind = next(kind for kind in SHAPES if getattr(geometry, kind) is not None)
    solid = getattr(geometry, kind)
    sizes = np.hstack([getattr(solid, word) for word in SHAPES[kind]]).astype(float)
    return kind, sizes, getattr(solid, "filename", "")
