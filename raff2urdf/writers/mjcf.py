"""A robot as MJCF, the format of MuJoCo.

- Bodies stand at closed home, and `ref` of each joint is its value there: joint values keep the URDF's own zero, and
  the simulation begins with all loops closed, with or without the keyframe `home`.
- Either end of a loop is a site, so that its equality does not depend on where the bodies begin. Rigid is a `weld`,
  ball a `connect`, revolute two `connect`, at the origins and at a characteristic length along z. A prismatic loop is a
  body of its own on a slide, welded to the second end: no equality of MuJoCo leaves one line free.
- Motors are position servos, which hold home.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any

import numpy as np
import yourdfpy
from lxml import etree
from numpy.typing import NDArray

from raff2urdf.formats import Described
from raff2urdf.readers.urdf import UNLIMITED
from raff2urdf.residual import log
from raff2urdf.tree import BASE_JOINT, characteristic_length
from raff2urdf.writers.bodies import FIXED, SLIDES, TURNS, WORLD, TreeAtHome, axis, greatest, limits, unlike
from raff2urdf.writers.inertia import Inertia, Inertias, sum_of
from raff2urdf.writers.mujoco_meshes import with_readable_meshes
from raff2urdf.xml_text import comment, numeral, numerals, text_of

Array = NDArray[np.float64]

GRAVITY = 9.81  # m/s2
STEP = 1.0 / 250.0
"""A step of the simulation, as a part of sqrt(length / gravity), the time in which a robot of that characteristic
length falls; at most a millisecond."""
STIFF = 2.0
"""Time constant of the loops (`solref`) in steps: the least that MuJoCo allows. With its own, 0.02 s, the loops of a
heavy robot sag by millimetres."""
IMPEDANCE = (0.999, 0.9999, 0.001)
"""`solimp` of the loops: nearly rigid. With MuJoCo's own, from 0.9 on, the ends part under load."""
SERVO = 20.0
"""A servo's stiffness is the inertia that its joint moves at home times the square of a rate: so many times
sqrt(gravity / length). Under its own weight a robot sags by some 1 / SERVO^2 rad."""
NARROW = 1e-9
"""rad or m: MuJoCo refuses a range without width, so a joint that may not move at all gets this one."""


def files(described: Described) -> dict[str, bytes]:
    """What is written: the robot, and those of its meshes that MuJoCo can't read as they are, as binary STL."""
    converted: dict[str, bytes] = {}
    bodies = replace(described.bodies, model=with_readable_meshes(described, converted))
    text = mjcf(bodies, described.constraints, described.inertias)
    return {f"{described.stem}.xml": text.encode(), **converted}


def mjcf(bodies: TreeAtHome, constraints: Mapping[str, Any], inertias: Inertias) -> str:
    """The text of the file.

    Args:
        bodies: the robot's tree at closed home.
        constraints: its loops and motors, as in constraints.schema.json.
        inertias: of its links.

    Raises:
        RaffError: the tree, or a loop, holds what MJCF can't say.
    """
    return text_of(_Writer(bodies, constraints, inertias).root())


@dataclass
class _Writer:
    bodies: TreeAtHome
    constraints: Mapping[str, Any]
    inertias: Inertias
    meshes: dict[tuple[str, tuple[float, ...]], str] = field(default_factory=dict)
    qpos: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.inertia = dict(self.inertias.links)
        self.length = characteristic_length(np.array([m[:3, 3] for m in self.bodies.world.values()]))
        self.fall = math.sqrt(self.length / GRAVITY)  # s
        self.names = set(self.bodies.link) | {joint.name for joint in self.bodies.model.joints}
        self.element: dict[str, etree._Element] = {}

    def root(self) -> etree._Element:
        root = etree.Element("mujoco", model=self.bodies.model.name)
        root.append(comment(self._preface()))
        etree.SubElement(root, "compiler", angle="radian", autolimits="true")
        timestep = min(0.001, float(f"{STEP * self.fall:.0e}"))
        etree.SubElement(root, "option", timestep=numeral(timestep), integrator="implicitfast")
        default = etree.SubElement(root, "default")
        etree.SubElement(default, "geom", contype="0", conaffinity="0", group="2")
        etree.SubElement(default, "site", group="3")
        etree.SubElement(default, "equality", solref=numerals((STIFF * timestep, 1.0)), solimp=numerals(IMPEDANCE))
        custom, asset = etree.SubElement(root, "custom"), etree.SubElement(root, "asset")
        self._custom(custom)
        equality = etree.Element("equality")
        self._worldbody(etree.SubElement(root, "worldbody"), equality)
        self._assets(asset)
        actuator = etree.Element("actuator")
        ctrl = self._motors(actuator)
        keyframe = etree.Element("keyframe")
        etree.SubElement(keyframe, "key", name="home", qpos=numerals(self.qpos))
        if ctrl:
            keyframe[0].set("ctrl", numerals(ctrl))
        root.extend(part for part in (equality, actuator) if len(part))
        if self.qpos:
            root.append(keyframe)
        for part in (custom, asset):
            if not len(part):
                root.remove(part)
        return root

    def _preface(self) -> list[str]:
        lines = [
            "Bodies stand at home; each joint's ref is its value there.",
            self.inertias.sentence(),
            "Bodies pass through each other unless the source gave them shapes for collisions.",
        ]
        if any(greatest(j.limit.velocity) < math.inf for j in self.bodies.order if j.limit is not None):
            lines.append("MJCF knows no limits of velocity: they stand in custom, as velocity:JOINT (rad/s, m/s).")
        if self.constraints["loops"]:
            lines.append("The links that a loop joins stand in custom, as LOOP.first and LOOP.second.")
        if any(loop["kind"] == "revolute" for loop in self.constraints["loops"]):
            lines.append("A revolute loop is two connects: LOOP, and LOOP.axis further along its axis.")
        if any(loop["kind"] == "prismatic" for loop in self.constraints["loops"]):
            lines.append(
                "A prismatic loop is a body of its own on a slide, both called as the loop, welded to the second end. "
                "It bears half the mass of the body it is welded to."
            )
        return [line for line in lines if line]

    def _custom(self, custom: etree._Element) -> None:
        for joint in self.bodies.order:
            fastest = greatest(joint.limit.velocity) if joint.limit is not None else math.inf
            if joint.type in (*TURNS, *SLIDES) and fastest < math.inf:
                etree.SubElement(custom, "numeric", name=f"velocity:{joint.name}", data=numeral(fastest))
        for loop in self.constraints["loops"]:
            for which in ("first", "second"):
                etree.SubElement(custom, "text", name=f"{loop['name']}.{which}", data=loop[which]["node"])

    # --- bodies --------------------------------------------------------------------------------------------------

    def _worldbody(self, world: etree._Element, equality: etree._Element) -> None:
        bodies = self.bodies
        if bodies.root == WORLD:
            self.element[WORLD] = world
        else:
            ground = self._ground(world, BASE_JOINT)
            self.element[bodies.root] = etree.SubElement(ground, "body", name=bodies.root)
        for joint in bodies.order:
            body = etree.SubElement(self._carrier(joint), "body", name=joint.child, **pose(bodies.placed(joint)))
            self.element[joint.child] = body
            self._joint(body, joint)
        sliders = [self._loop(equality, loop) for loop in self.constraints["loops"]]
        for name, body in self.element.items():
            if name == WORLD:
                continue
            inertial(body, self.inertia[name])
            self._shapes(body, bodies.link[name])
        for body, inertia in filter(None, sliders):
            inertial(body, inertia)
        self._read_home(world)

    def _carrier(self, joint: yourdfpy.Joint) -> etree._Element:
        """The body that carries the joint's child: its parent, or the ground."""
        carrier = self.element[joint.parent]
        return self._ground(carrier, joint.name) if joint.parent == WORLD and joint.type in FIXED else carrier

    def _ground(self, world: etree._Element, name: str) -> etree._Element:
        """A body for what is fixed in the world to stand on, called as the joint that fixes it.

        Pinocchio 4.1 knows neither the place nor the sites of a fixed body that stands on nothing.
        """
        ground = etree.SubElement(world, "body", name=unlike(name, self.bodies.link))
        inertial(ground, Inertia())
        return ground

    def _joint(self, body: etree._Element, joint: yourdfpy.Joint) -> None:
        if joint.type == "floating":
            etree.SubElement(body, "freejoint", name=joint.name)
            return
        if joint.type not in (*TURNS, *SLIDES):
            return
        said = {"axis": numerals(axis(joint)), "ref": numeral(self.bodies.value(joint))}
        low, high = limits(joint)
        if not math.isinf(low) or not math.isinf(high):
            said["range"] = numerals(bounds(low, high))
        kind = "hinge" if joint.type in TURNS else "slide"
        etree.SubElement(body, "joint", name=joint.name, type=kind, **said)

    def _shapes(self, body: etree._Element, link: yourdfpy.Link) -> None:
        for shape in (*link.visuals, *link.collisions):
            geometry = shape.geometry
            if geometry is None:
                continue
            geom = etree.SubElement(body, "geom")
            if geometry.box is not None:
                geom.attrib.update({"type": "box", "size": numerals(np.asarray(geometry.box.size) / 2.0)})
            elif geometry.cylinder is not None:
                size = (geometry.cylinder.radius, geometry.cylinder.length / 2.0)
                geom.attrib.update({"type": "cylinder", "size": numerals(size)})
            elif geometry.sphere is not None:
                geom.attrib.update({"type": "sphere", "size": numeral(geometry.sphere.radius)})
            elif geometry.mesh is not None:
                geom.attrib.update({"type": "mesh", "mesh": self._mesh(geometry.mesh)})
            geom.attrib.update(pose(np.eye(4) if shape.origin is None else shape.origin))
            if isinstance(shape, yourdfpy.Collision):
                geom.attrib.update({"contype": "1", "conaffinity": "1", "group": "4"})
            elif shape.material is not None and shape.material.color is not None:
                geom.set("rgba", numerals(shape.material.color.rgba))

    def _mesh(self, mesh: yourdfpy.Mesh) -> str:
        scale = tuple(np.broadcast_to(1.0 if mesh.scale is None else mesh.scale, 3).tolist())
        key = (mesh.filename, scale)
        if key not in self.meshes:
            self.meshes[key] = unlike(PurePosixPath(mesh.filename).stem, self.meshes.values())
        return self.meshes[key]

    def _assets(self, asset: etree._Element) -> None:
        for (filename, scale), name in self.meshes.items():
            # A shell has moments where a thin or open surface encloses nothing; masses are said by the bodies anyway.
            mesh = etree.SubElement(asset, "mesh", name=name, file=filename, inertia="shell")
            if scale != (1.0, 1.0, 1.0):
                mesh.set("scale", numerals(scale))

    def _read_home(self, world: etree._Element) -> None:
        """The values at home, in MuJoCo's order: that of the joints in the file."""
        for joint in world.iter("joint", "freejoint"):
            if joint.tag == "freejoint":
                here = self.bodies.placed(self.bodies.order[0])
                self.qpos += [*here[:3, 3].tolist(), *quaternion(here[:3, :3])]
            else:
                self.qpos.append(float(joint.get("ref")))

    # --- loops ---------------------------------------------------------------------------------------------------

    def _loop(self, equality: etree._Element, loop: Mapping[str, Any]) -> tuple[etree._Element, Inertia] | None:
        """Adds a loop; returns the body that a prismatic one needs, with its inertia."""
        name, kind = loop["name"], loop["kind"]
        first, second = (self.bodies.borne(loop[which]) for which in ("first", "second"))
        slider = self._slider(name, first, second) if kind == "prismatic" else None
        if slider is None:
            ends = [(self.element[bearer], placement) for bearer, placement in (first, second)]
        else:
            ends = [(slider[0], np.eye(4)), (self.element[second[0]], second[1])]
        word = "weld" if kind in ("rigid", "prismatic") else "connect"
        self._equality(equality, word, name, ends)
        if kind == "revolute":
            further = np.eye(4)
            further[2, 3] = self.length
            self._equality(equality, word, f"{name}.axis", [(body, placement @ further) for body, placement in ends])
        return slider

    @staticmethod
    def _equality(equality: etree._Element, word: str, name: str, ends: Iterable[tuple[etree._Element, Array]]) -> None:
        sites = []
        for (body, placement), which in zip(ends, ("first", "second"), strict=True):
            site = etree.SubElement(body, "site", name=f"{name}.{which}")
            site.set("pos", numerals(placement[:3, 3]))  # even if 0: Pinocchio 4.1 takes what is in its memory
            site.set("quat", numerals(quaternion(placement[:3, :3])))
            sites.append(site.get("name", ""))
        etree.SubElement(equality, word, name=name, site1=sites[0], site2=sites[1])

    def _slider(self, name: str, first: tuple[str, Array], second: tuple[str, Array]) -> tuple[etree._Element, Inertia]:
        """A body that slides along z of the first end, placed where the second end is.

        It takes half of the body that it is welded to: a body without mass would make the weld as soft as it is light.
        """
        world = self.bodies.world
        placed = np.linalg.solve(world[first[0]] @ first[1], world[second[0]] @ second[1])
        way = float(placed[2, 3])
        along = np.eye(4)
        along[2, 3] = way
        called = unlike(name, self.names)
        self.names.add(called)
        body = etree.SubElement(self.element[first[0]], "body", name=called, **pose(first[1] @ along))
        etree.SubElement(body, "joint", name=called, type="slide", axis="0 0 1", ref=numeral(way))
        bearer, on = second
        parts = [(bearer, np.eye(4)), *self.bodies.rigid[bearer]]
        whole = sum_of(self.inertia[link].seen_from(placement) for link, placement in parts)
        if bearer in {moving for moving, _ in self.bodies.moving}:
            for link, _ in parts:
                self.inertia[link] = self.inertia[link].share(0.5)
            whole = whole.share(0.5)
        elif whole.mass <= 0.0:  # it is welded to what stands still: its mass moves nothing
            whole = Inertia(1.0, np.zeros(3), self.length**2 / 10.0 * np.eye(3))
        return body, whole.seen_from(np.asarray(np.linalg.inv(on)))

    # --- motors --------------------------------------------------------------------------------------------------

    def _motors(self, actuator: etree._Element) -> list[float]:
        """Adds a servo for each motor; returns what holds them at home."""
        joints = {joint.name: joint for joint in self.bodies.order}
        held = []
        for entry in self.constraints["joints"]:
            if not entry.get("actuated", True) or entry["name"] not in joints:
                continue
            joint = joints[entry["name"]]
            servo = etree.SubElement(
                actuator, "position", name=joint.name, joint=joint.name,
                kp=f"{self._moved(joint) * (SERVO / self.fall) ** 2:.6g}", dampratio="1",
            )  # fmt: skip
            low, high = limits(joint)
            if not math.isinf(low) or not math.isinf(high):
                servo.set("ctrlrange", numerals(bounds(low, high)))
            effort = greatest(joint.limit.effort) if joint.limit is not None else math.inf
            if 0.0 < effort < math.inf:
                servo.set("forcerange", numerals((-effort, effort)))
            held.append(self.bodies.value(joint))
        return held

    def _moved(self, joint: yourdfpy.Joint) -> float:
        """What the joint moves at home, the tree alone: kg m2 about its axis, or kg."""
        outer, parts = {joint.child}, [joint.child]
        for other in self.bodies.order:
            if other.parent in outer:
                outer.add(other.child)
                parts.append(other.child)
        world = self.bodies.world
        whole = sum_of(self.inertias.links[name].seen_from(world[name]) for name in parts)
        if joint.type in SLIDES:
            return whole.mass
        here = world[joint.child]
        z = here[:3, :3] @ axis(joint)
        arm = np.cross(z, whole.centre - here[:3, 3])
        return float(z @ whole.matrix @ z + whole.mass * (arm @ arm))


def pose(placement: Array) -> dict[str, str]:
    """A placement (4, 4) as attributes; none for what is nothing."""
    said = {}
    if placement[:3, 3].any():
        said["pos"] = numerals(placement[:3, 3])
    if not np.array_equal(placement[:3, :3], np.eye(3)):
        said["quat"] = numerals(quaternion(placement[:3, :3]))
    return said


def quaternion(turned: Array) -> tuple[float, float, float, float]:
    """A rotation (3, 3) as a unit quaternion w x y z."""
    vector = log(turned)
    half = math.sqrt(float(vector @ vector)) / 2.0
    x, y, z = (vector * (0.5 if half < 1e-9 else math.sin(half) / (2.0 * half))).tolist()
    return math.cos(half), x, y, z


def bounds(low: float, high: float) -> tuple[float, float]:
    """Limits that MuJoCo accepts: finite, with some width."""
    low, high = max(low, -UNLIMITED), min(high, UNLIMITED)
    return (low, high) if high > low else (low - NARROW, high + NARROW)


def inertial(body: etree._Element, inertia: Inertia) -> None:
    """Adds mass and inertia as the first of a body's parts behind its joint."""
    m = inertia.matrix
    full = (m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2])
    if inertia.mass > 0.0:
        said = {"mass": numeral(inertia.mass), "fullinertia": numerals(full)}
    else:
        said = {"mass": "0", "diaginertia": "0 0 0"}
    element = etree.Element("inertial", pos=numerals(inertia.centre), **said)
    body.insert(sum(part.tag in ("joint", "freejoint") for part in body), element)
