"""Build a URDF and the contents of its constraints file, from other formats."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from yourdfpy import Dynamics, Geometry, Joint, Limit, Link, Material, Robot, Visual

from raff2urdf.arrays import Array, ArrayLike
from raff2urdf.bounds import UNLIMITED
from raff2urdf.constraints import Constraints, loop_entry
from raff2urdf.coupling import coupling_entry
from raff2urdf.inertia import Inertia
from raff2urdf.joint_dynamics import JointDynamics
from raff2urdf.placement import inverse, joint_motion, translation
from raff2urdf.writers.urdf_object import ExactUrdf, geometry, inertial, material_of

UNBOUNDED = (-math.inf, math.inf)

GRAVITY = (0.0, 0.0, -9.81)
"""Acceleration in the world, m/s2, where a file states none: that of Pinocchio and MuJoCo."""

_NONE = JointDynamics()

Shape = tuple[Geometry, Array]
"""A shape, and its placement (4, 4) in the visual."""


class Converted(NamedTuple):
    """A robot of another format: its URDF, its constraints, the elements that were ignored, notes about what was read,
    and the joints that plugins control."""

    urdf: str
    constraints: Constraints
    ignored: list[str]
    notes: list[str]
    driven: Collection[str] = ()


class UrdfBuilder:
    """A URDF that is being built.

    Attributes:
        taken: names that are taken; `free_name` adds to them.
    """

    def __init__(self, robot: str, taken: Iterable[str]) -> None:
        self.taken = set(taken)
        self._robot = Robot(robot)
        self._entries: list[dict[str, Any]] = []
        self._loops: list[dict[str, Any]] = []
        self._couplings: list[dict[str, Any]] = []
        self._balls: list[dict[str, Any]] = []

    def free_name(self, name: str) -> str:
        """Return a name for something without a name in the file."""
        while name in self.taken:
            name += "_"
        self.taken.add(name)
        return name

    def add_link(self, name: str, visuals: Iterable[Visual] = (), inertia: Inertia | None = None) -> None:
        """Add a link; its inertia is in its own axes, None if the file gives none."""
        self._robot.links.append(Link(name, inertial(inertia), list(visuals)))

    def add_fixed(self, name: str, parent: str, child: str, origin: Array, kind: str = "fixed") -> None:
        """Add a fixed joint, or a floating one."""
        self._robot.joints.append(Joint(name=name, type=kind, parent=parent, child=child, origin=origin))

    def add_joint(
        self,
        name: str,
        prismatic: bool,
        ends: tuple[str, str],
        placed: Array,
        axis: Array,
        *,
        zero: float = 0.0,
        home: float = 0.0,
        limits: tuple[float, float] = UNBOUNDED,
        velocity: float = math.inf,
        effort: float = math.inf,
        dynamics: JointDynamics = _NONE,
        actuated: bool | None = None,
    ) -> None:
        """Add a joint that moves.

        Args:
            name: of the joint.
            prismatic: whether it is prismatic; else it is revolute.
            ends: the parent and the child.
            placed: (4, 4), the child on its parent at the value `zero`.
            axis: (3,) in the child's frame.
            zero: value of the joint at that placement, rad or m.
            home: value at home, rad or m.
            limits: low and high, rad or m; infinite without limits.
            velocity: limit, rad/s or m/s; infinite without a limit.
            effort: limit, N m or N; infinite without a limit.
            dynamics: the inertia of its rotors, and its friction.
            actuated: whether it is actuated; None if the file does not declare it.
        """
        axis = np.array(axis, dtype=float)
        kind = "prismatic" if prismatic else "continuous" if limits == UNBOUNDED else "revolute"
        limit = Limit(min(effort, UNLIMITED), min(velocity, UNLIMITED))
        if kind != "continuous":
            limit.lower, limit.upper = max(limits[0], -UNLIMITED), min(limits[1], UNLIMITED)
        origin = placed @ inverse(joint_motion(prismatic, axis / np.linalg.norm(axis), zero))
        joint = Joint(name, kind, *ends, axis=axis, origin=origin, limit=limit)
        armature, damping, friction = dynamics
        if damping or friction:
            joint.dynamics = Dynamics(damping, friction)
        self._robot.joints.append(joint)
        entry = {"name": name, "home": home, **({"armature": armature} if armature else {})}
        self._entries.append(entry | ({} if actuated is None else {"actuated": actuated}))

    def add_ball(self, name: str, joints: Sequence[str]) -> None:
        """Declare that three successive revolute joints, added already, are a ball joint."""
        self._balls.append({"name": name, "joints": list(joints)})

    def add_loop(self, name: str, kind: str, first: tuple[str, ArrayLike], second: tuple[str, ArrayLike]) -> None:
        """Add a loop between two ends: nodes, and placements (4, 4) on them."""
        (node, at), (other, other_at) = first, second
        self._loops.append(loop_entry(name, kind, node, other, (at, other_at)))

    def add_coupling(self, name: str, terms: Mapping[str, Sequence[float]], constant: float = 0.0) -> None:
        """Add a coupling; its terms are coefficients of each joint's variable (rad, m) and its powers."""
        self._couplings.append(coupling_entry(name, terms, constant))

    def result(
        self, nodes: Sequence[str], floating: str | None, gravity: Sequence[float] = GRAVITY
    ) -> tuple[str, Constraints]:
        """Return the text of the URDF and its constraints."""
        values: Constraints = {
            "robot": self._robot.name,
            "nodes": list(nodes),
            "floating": floating,
            "joints": self._entries,
            "loops": self._loops,
        }
        if tuple(gravity) != GRAVITY:
            values["gravity"] = [float(x) for x in gravity]
        if self._balls:
            values["balls"] = self._balls
        if self._couplings:
            values["couplings"] = self._couplings
        return ExactUrdf(self._robot).text(), values


def shapes(kind: str, sizes: ArrayLike, file: str = "", height: float = 0.0) -> Iterator[Shape]:
    """Yield a shape as URDF has it, at a height along z; a capsule is a cylinder and two spheres there.

    Args:
        kind: box, cylinder, capsule, sphere or mesh.
        sizes: m: sides (3,) of a box; radius and length of a cylinder or capsule along z; radius of a sphere; scales
            (3,) of a mesh.
        file: of a mesh.
        height: m.
    """
    values = np.asarray(sizes, dtype=float)
    if kind == "capsule":
        yield from shapes("cylinder", values)
        for end in (-0.5, 0.5):
            yield from shapes("sphere", values[:1], height=end * float(values[1]))
        return
    yield geometry(kind, values, file), translation((0.0, 0.0, height))


def material(rgba: ArrayLike) -> Material:
    """Return a colour, from 0 to 1, as a material that is named by it, so that a name never has two meanings."""
    clipped = np.clip(np.asarray(rgba, dtype=float), 0.0, 1.0)
    name = "".join(f"{round(255 * value):02x}" for value in clipped.tolist())
    return material_of(f"c{name}", clipped)
