"""Convert a URDF to RAFF: any tree of revolute, continuous, prismatic and fixed joints, by Kleinfinger's parameters.

A moving joint becomes a link, whose frame `raff2urdf.urdf2raff.frames` chooses; a link of the URDF with another frame
becomes a RAFF frame, fixed to it, under its own name; a link with a fixed joint becomes a frame too (or a fixed link,
if its name is one of RAFF's default names of links). A joint variable differs from the URDF's by an offset at most:
RAFF's q = URDF's q + offset.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from raff2urdf.arrays import Array
from raff2urdf.constraints import Constraints
from raff2urdf.coupling import Coupling, coupling_of
from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.inertia import Inertia
from raff2urdf.joint_dynamics import JointDynamics
from raff2urdf.loops.mobility import loop_kind
from raff2urdf.placement import inverse
from raff2urdf.raff.document import (
    Document,
    JointType,
    RaffBase,
    RaffCoupling,
    RaffFrame,
    RaffInertial,
    RaffLink,
    RaffLoop,
    RaffPart,
    RaffRobot,
    RaffSensor,
    SensorConstraint,
)
from raff2urdf.raff.kleinfinger import Kleinfinger
from raff2urdf.readers.loops import successive
from raff2urdf.readers.loops.declaration import leave_out
from raff2urdf.readers.urdf import (
    default_value,
    effort,
    ends,
    friction,
    inertia,
    joints,
    limits,
    links,
    origin,
    root_first,
    velocity,
)
from raff2urdf.readers.xml_file import error_at
from raff2urdf.tree import BASE_JOINT, WORLD, in_si, kleinfinger
from raff2urdf.urdf2raff.file_units import LIMIT_TOLERANCE, FileUnits, shortest
from raff2urdf.urdf2raff.frames import EXACT, RigidBody, choose_frame, gather, path, robot_size, step
from raff2urdf.urdf2raff.names import Names, numbers, xml_name


@dataclass(frozen=True, slots=True)
class RaffImport:
    """A robot in RAFF, and how it corresponds to the URDF that it was made of.

    Attributes:
        document: the RAFF file, with this one robot.
        joints: the URDF's names of the joints that move -> RAFF's.
        offsets: RAFF's names of joints -> RAFF's q less the URDF's, rad or m; most are 0.
        nodes: the URDF's names of links -> RAFF's names of the nodes with the same pose.
        notes: comments on links and frames, by number.
    """

    document: Document
    joints: Mapping[str, str]
    offsets: Mapping[str, float]
    nodes: Mapping[str, str]
    notes: Mapping[int, str]


def import_tree(tree: Any, name: str, constraints: Constraints | None = None, units: str = "mm") -> RaffImport:
    """Convert a URDF to RAFF, without its graphics.

    Args:
        tree: its root element, from `readers.urdf.parse`. Planar, spherical and floating joints are replaced in it by
            successive ones; a floating joint that lets the whole robot move becomes a base that can move.
        name: of the file, in errors.
        constraints: the contents of its constraints file: loops, couplings, actuated joints, home, sensors.
        units: of the RAFF file's lengths: um, mm, cm or m.

    Raises:
        RaffError: `constraints` names what the URDF lacks, or has a coupling for which RAFF has no notation.
    """
    loop_ends = {loop[end]["node"] for loop in (constraints or {}).get("loops", []) for end in ("first", "second")}
    successive.replace_compound(tree, name, keep_root=root_first(tree)[0] not in loop_ends)
    return _Import(tree, name, constraints or {}, units, loop_ends).run()


class _Import:
    """Conversion of one URDF."""

    def __init__(self, tree: Any, name: str, constraints: Constraints, units: str, loop_ends: set[str]) -> None:
        self.tree, self.name, self.constraints = tree, name, constraints
        self.units = FileUnits(units)
        self.joint_of = {ends(joint)[1]: (i, joint) for i, joint in enumerate(joints(tree))}
        self.root = root_first(tree)[0]
        self.entries = {entry["name"]: entry for entry in constraints.get("joints", [])}
        self.placing = self.placing_joint(loop_ends)
        is_base = self.placing is not None and self.placing.get("name") == BASE_JOINT
        self.numbers = numbers([joint for joint in joints(tree) if not (is_base and joint is self.placing)])
        self.free_numbers = itertools.count(max(self.numbers.values(), default=0) + 1)
        self.names = Names(str(link.get("name")) for link in links(tree))
        self.parts: list[tuple[float, RaffPart]] = []  # each with its position in the file
        self.placed: dict[int, Array] = {}  # nodes by number, as placed by the written numbers, with joints at 0
        self.number_of: dict[str, int] = {}  # of the node with the pose of each link
        self.joints: dict[str, str] = {}
        self.offsets: dict[str, float] = {}
        self.nodes: dict[str, str] = {}
        self.notes: dict[int, str] = {}

    def run(self) -> RaffImport:
        """Convert body after body, from the base outwards."""
        base, placed, movable = self.root, np.eye(4), False
        if self.placing is not None:  # the root is the world
            base, placed = ends(self.placing)[1], origin(self.placing, self.name)
            movable = self.placing.get("type") == "floating"
        root = RigidBody(None, None, [(base, placed)], placed[:3, 2])
        bodies = gather(root, self.tree, self.name)
        self.length = robot_size(bodies)
        for body in bodies:
            body.frame = choose_frame(body, self.length)
        base_parameters, self.placed[0] = self.units.written(step(root.frame, self.length))
        self.add_links(root, 0)
        for body in bodies[1:]:
            self.add_body(body)
        loops = tuple(self.loop(entry) for entry in self.constraints.get("loops", []))
        self.parts.sort(key=lambda pair: pair[0])
        masses = self.inertials()
        robot = RaffRobot(
            name=xml_name(str(self.tree.get("name") or "robot")),
            base=RaffBase(base_parameters, inertial=masses.get(0)),
            parts=tuple(
                replace(part, inertial=masses.get(part.number))
                for part in self.with_actuated(part for _, part in self.parts)
            ),
            loops=loops,
            couplings=tuple(self.coupling(coupling_of(entry)) for entry in self.constraints.get("couplings", [])),
            sensor_constraints=tuple(self.sensor_constraints(movable)),
        )
        sensors = tuple(RaffSensor(**sensor) for sensor in self.constraints.get("sensors", []))
        gravity, name = self.constraints.get("gravity"), str(self.constraints.get("name") or robot.name)
        down = None if gravity is None else (gravity[0], gravity[1], gravity[2])
        document = Document(name, (robot,), sensors, self.units.document.units, down)
        return RaffImport(document, self.joints, self.offsets, self.nodes, self.notes)

    def placing_joint(self, loop_ends: set[str]) -> Any:
        """Return the joint that only places the robot in the world, or lets it move there; None if there is none."""
        of_root = [joint for joint in joints(self.tree) if ends(joint)[0] == self.root and self.root not in loop_ends]
        kind = of_root[0].get("type") if len(of_root) == 1 else ""
        return of_root[0] if kind == "floating" or (kind == "fixed" and self.root == WORLD) else None

    # --- links and frames ---------------------------------------------------------------------------------------

    def add_body(self, body: RigidBody) -> None:
        """Add a body's link and all that is fixed to it."""
        joint, position = body.joint, float(self.joint_of[body.links[0][0]][0])
        name = str(joint.get("name"))
        number = body.number = self.numbers[name]
        assert body.parent is not None
        branches = len(body.parent.children) > 1
        pred, placing = self.step(body.parent.number, ends(joint)[0], body.frame, name, position - 0.5, branches)
        prismatic = joint.get("type") == "prismatic"
        zero, local = self.units.written(placing)
        self.placed[number] = self.placed[pred] @ local
        read = kleinfinger(self.units.document, zero)
        offset = read.r if prismatic else read.theta
        home, allowed, fastest = self.motion(joint)
        at = self.units.tidied(offset + home, prismatic)
        same = next((link for link, pose in body.links if self.is_at(number, pose)), None)
        link = RaffLink(
            number=number,
            parameters=replace(zero, r=at) if prismatic else replace(zero, theta=at),
            type=JointType.PRISMATIC if prismatic else JointType.REVOLUTE,
            pred=pred,
            limits=None if allowed is None else self.units.shifted(allowed, offset, prismatic),
            velocity=None if fastest is None else self.units.tidied(fastest, prismatic, LIMIT_TOLERANCE),
            effort=effort(joint),
            name=self.names.new(same, f"{body.links[0][0]}_axis", f"link{number}"),
        )
        self.parts.append((position, self.with_dynamics(link, joint)))
        self.joints[name] = link.joint
        self.offsets[link.joint] = offset
        self.add_note(link, name, zero.r if prismatic else zero.theta)
        self.add_links(body, number, same, link.node)

    def add_links(self, body: RigidBody, number: int, same: str | None = None, node: str = "base") -> None:
        """Add frames for the links of a body that are not its node itself.

        Args:
            body: the body.
            number: of its node.
            same: the link that is the node. The base is any link with its pose and its name, or the world's.
            node: the node's name.
        """
        for link, pose in body.links:
            is_base = number == 0 and link in ("base", WORLD) and self.is_at(0, pose)
            if link == same or is_base:
                self.number_of[link], self.nodes[link] = number, node
                continue
            position, joint = self.joint_of.get(link, (-1, None))
            fixed = joint is not None and joint.get("type") == "fixed" and joint.get("name") in self.numbers
            frame_number = self.numbers[joint.get("name")] if fixed else next(self.free_numbers)
            parent = ends(joint)[0] if fixed else link
            pred, placing = self.step(number, parent, pose, link, position + 0.2)
            solid = fixed and link == f"link{frame_number}"
            self.number_of[link] = self.add_frame(placing, pred, link, frame_number, position + 0.3, solid)

    def step(
        self, pred: int, parent: str, pose: Array, name: str, position: float, branches: bool | None = None
    ) -> tuple[int, Kleinfinger]:
        """Find one step to a frame: from its body's node, or from a frame that is inserted between.

        Args:
            pred: the body's node.
            parent: its parent in the URDF, which may have a node of its own, on the same body.
            pose: (4, 4) the frame.
            name: after which an inserted frame is named.
            position: of an inserted frame in the file.
            branches: of a link, whether its body's parent has other children: only then gamma and epsilon may differ
                from 0.

        Returns:
            the node from which the step leads, and the parameters.
        """
        for node in dict.fromkeys((pred, self.number_of.get(parent, pred))):
            steps = path(self.placed[node], pose, self.length, branches is None or (branches and node == pred))
            if len(steps) == 1:
                return node, steps[0]
        between = self.add_frame(steps[0], node, f"{name}_stand", next(self.free_numbers), position)
        return between, step(inverse(self.placed[between]) @ pose, self.length)

    def add_frame(
        self, placing: Kleinfinger, pred: int, name: str, number: int, position: float, solid: bool = False
    ) -> int:
        """Add a frame, or a fixed link if it has the name of one; return its number."""
        written, local = self.units.written(placing)
        own_name = self.names.new(name, name, f"{'link' if solid else 'frame'}{number}")
        frame: RaffPart = RaffFrame(number, written, pred, own_name)
        if solid:
            frame = RaffLink(number, written, JointType.FIXED, pred, name=own_name)
        self.placed[number] = self.placed[pred] @ local
        self.parts.append((position, frame))
        if name in self.names.links:
            self.nodes[name] = frame.node
        return number

    def is_at(self, number: int, pose: Array) -> bool:
        """Return whether a node has a pose."""
        return float(np.abs(self.placed[number] - pose).max()) <= 10.0 * EXACT * max(self.length, 1.0)

    def inertials(self) -> dict[int, RaffInertial]:
        """Return the masses of the nodes, by number."""
        inertias: dict[int, Inertia] = {}
        for link in links(self.tree):
            number, body = self.number_of.get(str(link.get("name"))), inertia(link, self.name)
            if body is not None and number is not None:  # that of the world moves nothing
                inertias[number] = inertias[number] + body if number in inertias else body
        has_mass = any(body.mass > 0.0 for body in inertias.values())  # else there is only 0 of links between joints
        return {number: self.units.inertial(body) for number, body in inertias.items() if has_mass}

    def motion(self, joint: Any) -> tuple[float, tuple[float, float] | None, float | None]:
        """Return home, limits and velocity limit of a joint (rad, m)."""
        entry = self.entries.get(joint.get("name"), {})
        allowed, fastest = limits(joint), velocity(joint)
        home = 0.0 if self.constraints.get("loops") else default_value(allowed)
        return entry.get("home", home), allowed, fastest

    def with_dynamics(self, link: RaffLink, joint: Any) -> RaffLink:
        """Add the inertia of a joint's rotors and its friction to its link, in the file's units."""
        damping, dry = friction(joint)
        dynamics = JointDynamics(self.entries.get(joint.get("name"), {}).get("armature", 0.0), damping, dry)
        sizes = in_si(self.units.document, link, JointDynamics(1.0, 1.0, 1.0))

        def written(word: str, value: float, size: float) -> float | None:
            def back(number: float) -> float:
                return float(
                    getattr(in_si(self.units.document, link, JointDynamics()._replace(**{word: number})), word)
                )

            return shortest(value, value / size, back) if value else None

        armature, damped, resists = map(written, dynamics._fields, dynamics, sizes)
        return replace(link, armature=armature, damping=damped, friction=resists)

    def with_actuated(self, parts: Iterable[RaffPart]) -> Iterator[RaffPart]:
        """Declare which joints are actuated, if the file states it and it differs from RAFF's default."""
        stated = True if any("actuated" in entry for entry in self.entries.values()) else None
        actuated = {self.joints[name]: entry.get("actuated", stated) for name, entry in self.entries.items()}
        constrained = self.constraints.get("loops") or self.constraints.get("couplings")
        named = any(actuated.values()) and not (all(actuated.values()) and not constrained)
        for part in parts:
            if isinstance(part, RaffFrame) or not part.type:
                yield part
                continue
            has = actuated.get(part.joint, stated)
            if has and named:
                yield replace(part, actuated=True)
            elif has is False and not any(actuated.values()):
                yield replace(part, actuated=False)
            else:
                yield part

    def add_note(self, link: RaffLink, name: str, offset: float) -> None:
        """Comment on a joint that has another name, or another zero, in the URDF."""
        unit = self.units.document.units if link.type is JointType.PRISMATIC else "degrees"
        moved = f"; 0 here is {-offset:.10g} {unit} there" if offset else ""
        if name != link.joint or offset:
            self.notes[link.number] = f"{name}{moved}"

    # --- loops and sensors --------------------------------------------------------------------------------------

    def loop(self, entry: Mapping[str, Any]) -> RaffLoop:
        first, second = (self.loop_end(entry[end], entry["name"]) for end in ("first", "second"))
        return RaffLoop(first, second, loop_kind(entry["kind"]))

    def coupling(self, coupling: Coupling) -> RaffCoupling:
        """Return a coupling whose first linear term is that of the joint that follows.

        Raises:
            RaffError: there is no linear term, or no other one.
        """
        where = f"{self.name}: coupling '{coupling.name}' ({coupling})"
        for joint in coupling.terms:
            if joint not in self.joints:
                raise RaffError(f"{where} names '{joint}', which is not a joint that moves")
        linear = [joint for joint, coefficients in coupling.terms.items() if len(coefficients) == 1]
        if not linear or len(coupling.terms) == 1:
            why = "no joint is linear in it" if coupling.terms.keys() - linear else "it names one joint only"
            raise RaffError(f"{where} has no notation in RAFF, since {why}: {leave_out(coupling.name)}")
        by_joint = {part.joint: part for _, part in self.parts if isinstance(part, RaffLink)}
        links = {joint: by_joint[self.joints[joint]] for joint in coupling.terms}
        follower, drives = linear[0], []
        (factor,) = coupling.terms[follower]
        offset = self.offsets[links[follower].joint] + coupling.constant / factor
        for joint, coefficients in coupling.terms.items():
            if joint == follower:
                continue
            shifted = Polynomial([0.0, *coefficients])(Polynomial([-self.offsets[links[joint].joint], 1.0]))
            constant, *powers = (-c / factor for c in shifted.coef.tolist())
            offset += constant
            drives.append(self.units.drive(links[follower], links[joint], powers))
        numbers = [links[follower].number, *(drive.link for drive in drives)]
        name = None if coupling.name == "-".join(f"joint{number}" for number in numbers) else coupling.name
        at = self.units.tidied(offset, links[follower].type is JointType.PRISMATIC)
        return RaffCoupling(numbers[0], tuple(drives), at, name)

    def loop_end(self, end: Mapping[str, Any], loop: str) -> int:
        """Return the node of a loop's end: a new frame if it is none of the URDF's links."""
        carrier = self.node_number(end["node"], f"loop '{loop}'")
        at = self.placed[carrier] @ np.array(end["placement"], dtype=float)
        if self.is_at(carrier, at):
            return carrier
        pred, parameters = self.step(carrier, end["node"], at, loop, math.inf)
        number = next(self.free_numbers)
        return self.add_frame(parameters, pred, f"frame{number}", number, math.inf)

    def node_number(self, link: str, what: str) -> int:
        if link not in self.number_of:
            near = did_you_mean(link, [*self.number_of])
            raise error_at(self.name, self.tree, f"{what} names '{link}', which is not a link{near}")
        return self.number_of[link]

    def sensor_constraints(self, movable: bool) -> Iterator[SensorConstraint]:
        entries = self.constraints.get("sensor_constraints", [])
        for entry in entries:
            yield SensorConstraint(self.node_number(entry["node"], "a sensor constraint"), tuple(entry["sensors"]))
        if movable and not any(entry["node"] == "base" for entry in entries):
            yield SensorConstraint(0, (0,))
