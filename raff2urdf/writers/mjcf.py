"""Write a robot as MJCF, the format of MuJoCo.

- Bodies are placed at closed home, and `ref` of each joint is its value there: joint values keep the URDF's own zero,
  and the simulation begins with all loops closed, with or without the keyframe `home`.
- Either end of a loop is a site, so that its equality does not depend on the initial poses of the bodies. Rigid is a
  `weld`, ball a `connect`, revolute two `connect`, at the origins and at a characteristic length along z. A prismatic
  loop is a body of its own on a prismatic joint, welded to the second end: MuJoCo has no equality that leaves a
  translation free.
- Couplings are equalities of joints, or of fixed tendons where they join more than two joints.
- Actuators are position servos, which keep home.
- MuJoCo reads meshes as OBJ and binary STL. Others are converted to STL.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from lxml import etree
from numpy.polynomial import Polynomial
from scipy.spatial.transform import Rotation

from raff2urdf.arrays import Array
from raff2urdf.bounds import UNLIMITED
from raff2urdf.coupling import Coupling
from raff2urdf.errors import RaffError
from raff2urdf.escape import unique_name
from raff2urdf.inertia import ROUNDED, Inertia, sum_of
from raff2urdf.placement import inverse, translation
from raff2urdf.tree import BASE_JOINT, WORLD
from raff2urdf.writers.inertia import Inertias, inertias
from raff2urdf.writers.mjcf_meshes import MeshAssets
from raff2urdf.writers.tree_at_home import TreeAtHome, shape_of
from raff2urdf.writers.xml_text import comment, numeral, numerals, text_of

if TYPE_CHECKING:
    from yourdfpy import Joint, Link

    from raff2urdf.conversion import Translation
    from raff2urdf.writers import WriteOptions


GRAVITY = 9.81  # m/s2
STEP = 1.0 / 250.0
"""Time step of the simulation, as a part of sqrt(length / gravity), the time in which a robot of that characteristic
length falls; at most a millisecond."""
STIFF = 2.0
"""Time constant of the loops (`solref`) in time steps: the least that MuJoCo allows. With its default of 0.02 s, the
loops of a heavy robot sag by millimetres."""
IMPEDANCE = (0.999, 0.9999, 0.001)
"""`solimp` of the loops: nearly rigid. With MuJoCo's default, from 0.9 on, the ends separate under load."""
SERVO = 20.0
"""A servo's stiffness is the inertia that its joint moves at home times the square of a rate, `SERVO`
sqrt(gravity / length). Under its own weight a robot sags by some 1 / SERVO^2 rad."""
ROUNDING = 1e-12
"""The sum of two principal moments exceeds the third by this part of it at least: MuJoCo refuses rounding errors."""
NARROW = 1e-9
"""rad or m: MuJoCo refuses an empty range, so a joint that may not move at all gets this one."""

_EQUALITIES = {"rigid": "weld", "prismatic": "weld", "revolute": "connect", "ball": "connect"}
_DYNAMICS = {"friction": "frictionloss"}
_MOST_POWERS = 4  # of a polynomial in MuJoCo

End = tuple[str, Array]
"""A body and a placement (4, 4) on it."""


def files(translation: Translation, stem: str, options: WriteOptions) -> dict[str, bytes]:
    """Return the robot, and those of its meshes that MuJoCo can't read as they are, as binary STL."""
    tree, meshes = TreeAtHome(translation), MeshAssets(translation, stem)
    masses = inertias(tree.model, options.density, translation.surface, tree.moving)
    text = text_of(_Writer(tree, masses, meshes, translation.analysis.length).root())
    meshes.warn()
    return {f"{stem}.xml": text.encode(), **meshes.converted}


@dataclass
class _Writer:
    tree: TreeAtHome
    inertias: Inertias
    meshes: MeshAssets
    length: float

    def __post_init__(self) -> None:
        self.inertia = dict(self.inertias.links)
        self.fall = math.sqrt(self.length / GRAVITY)  # s
        self.names = {*self.tree.link, *(joint.name for joint in self.tree.order)}
        self.element: dict[str, etree._Element] = {}

    def root(self) -> etree._Element:
        root = etree.Element("mujoco", model=self.tree.model.name)
        root.append(comment(self.preface()))
        etree.SubElement(root, "compiler", angle="radian", autolimits="true")
        timestep = min(0.001, float(f"{STEP * self.fall:.0e}"))
        option = etree.SubElement(root, "option", timestep=numeral(timestep), integrator="implicitfast")
        if self.tree.gravity is not None:
            option.set("gravity", numerals(self.tree.gravity))
        default = etree.SubElement(root, "default")
        etree.SubElement(default, "geom", contype="0", conaffinity="0", group="2")
        etree.SubElement(default, "site", group="3")
        etree.SubElement(default, "equality", solref=numerals((STIFF * timestep, 1.0)), solimp=numerals(IMPEDANCE))
        custom, asset, world, tendon, equality, actuator, keyframe = (
            etree.SubElement(root, name)
            for name in ("custom", "asset", "worldbody", "tendon", "equality", "actuator", "keyframe")
        )
        self.add_custom(custom)
        self.add_bodies(world, equality)
        for coupling in self.tree.couplings:
            self.add_coupling(equality, tendon, coupling)
        for name, (file, scale) in self.meshes.files.items():
            # A shell has moments even if a thin or open surface encloses nothing; the masses are those of the bodies.
            mesh = etree.SubElement(asset, "mesh", name=name, file=file, inertia="shell")
            if scale != (1.0, 1.0, 1.0):
                mesh.set("scale", numerals(scale))
        qpos, ctrl = self.home(world), self.add_actuators(actuator)
        if qpos:
            key = etree.SubElement(keyframe, "key", name="home", qpos=numerals(qpos))
            if ctrl:
                key.set("ctrl", numerals(ctrl))
        for part in (custom, asset, tendon, equality, actuator, keyframe):
            if not len(part):
                root.remove(part)
        return root

    def preface(self) -> list[str]:
        kinds = {loop["kind"] for loop in self.tree.loops}
        lines = [
            "Bodies are placed at home; each joint's ref is its value there.",
            self.inertias.sentence(),
            "Bodies pass through each other.",
        ]
        if any(entry["velocity"] is not None for entry in self.tree.entries.values()):
            lines.append("MJCF has no velocity limits: they are in custom, as velocity:JOINT (rad/s, m/s).")
        if kinds:
            lines.append("The links that a loop joins are in custom, as LOOP.first and LOOP.second.")
        if "revolute" in kinds:
            lines.append("A revolute loop is two connects: LOOP, and LOOP.axis further along its axis.")
        if "prismatic" in kinds:
            lines.append(
                "A prismatic loop is a body of its own on a prismatic joint, both named as the loop, welded to the "
                "second end. It has half the mass of the body that it is welded to."
            )
        return lines

    def add_custom(self, custom: etree._Element) -> None:
        for name, entry in self.tree.entries.items():
            if entry["velocity"] is not None:
                etree.SubElement(custom, "numeric", name=f"velocity:{name}", data=numeral(entry["velocity"]))
        for loop in self.tree.loops:
            for which in ("first", "second"):
                etree.SubElement(custom, "text", name=f"{loop['name']}.{which}", data=loop[which]["node"])

    # --- bodies --------------------------------------------------------------------------------------------------

    def add_bodies(self, world: etree._Element, equality: etree._Element) -> None:
        tree = self.tree
        if tree.root == WORLD:
            self.element[WORLD] = world
        else:
            self.element[tree.root] = etree.SubElement(self.ground(world, BASE_JOINT), "body", name=tree.root)
        for joint in tree.order:
            parent = self.element[joint.parent]
            if joint.parent == WORLD and joint.type == "fixed":
                parent = self.ground(parent, joint.name)
            body = etree.SubElement(parent, "body", name=joint.child, **pose(tree.placed(joint)))
            self.element[joint.child] = body
            self.add_joint(body, joint)
        sliders = [self.add_loop(equality, loop) for loop in self.tree.loops]
        for name, body in self.element.items():
            if name != WORLD:
                add_inertial(body, self.inertia[name])
                self.add_shapes(body, tree.link[name])
        for body, inertia in filter(None, sliders):
            add_inertial(body, inertia)

    def ground(self, world: etree._Element, name: str) -> etree._Element:
        """Add a body to the world for something that is fixed there, named as the joint that fixes it.

        Pinocchio 4.1 ignores the pose and the sites of a fixed body without a parent.
        """
        ground = etree.SubElement(world, "body", name=unique_name(name, self.tree.link))
        add_inertial(ground, Inertia())
        return ground

    def add_joint(self, body: etree._Element, joint: Joint) -> None:
        entry = self.tree.entries.get(joint.name)
        if entry is not None:
            kind = "slide" if joint.type == "prismatic" else "hinge"
            ref = numeral(self.tree.home[joint.name])
            values = limit("range", entry)
            if entry["effort"] is not None:
                values["actuatorfrcrange"] = numerals((-entry["effort"], entry["effort"]))
            for word in ("armature", "damping", "friction"):
                if entry.get(word):
                    values[_DYNAMICS.get(word, word)] = numeral(entry[word])
            etree.SubElement(body, "joint", name=joint.name, type=kind, axis="0 0 1", ref=ref, **values)
        elif joint.type == "floating":
            etree.SubElement(body, "freejoint", name=joint.name)

    def add_shapes(self, body: etree._Element, link: Link) -> None:
        for shape in link.visuals:
            kind, size, file = shape_of(shape.geometry)
            mesh = self.meshes.name(file, tuple(size.tolist())) if kind == "mesh" else ""
            if mesh is None:
                continue
            half = {"box": (0.5, 0.5, 0.5), "cylinder": (1.0, 0.5)}.get(kind, (1.0,))
            geom = etree.SubElement(body, "geom", type=kind)
            geom.set(*(("mesh", mesh) if mesh else ("size", numerals(size * half))))
            geom.attrib.update(pose(np.eye(4) if shape.origin is None else shape.origin))
            if shape.material is not None:
                geom.set("rgba", numerals(shape.material.color.rgba))

    def home(self, world: etree._Element) -> list[float]:
        """Return the values at home, in MuJoCo's order: that of the joints in the file."""
        qpos: list[float] = []
        for joint in world.iter("joint", "freejoint"):
            if joint.tag == "freejoint":
                base = self.tree.placed(self.tree.order[0])  # the floating joint
                qpos += [*base[:3, 3].tolist(), *quaternion(base[:3, :3])]
            else:
                qpos.append(float(joint.get("ref")))
        return qpos

    # --- loops ---------------------------------------------------------------------------------------------------

    def add_loop(self, equality: etree._Element, loop: Mapping[str, Any]) -> tuple[etree._Element, Inertia] | None:
        """Add a loop; return the body that a prismatic one needs, with its inertia."""
        name, word, slider = loop["name"], _EQUALITIES[loop["kind"]], None
        first, second = (self.tree.carriers[loop[which]["node"]] for which in ("first", "second"))
        ends = [(self.element[carrier], placement) for carrier, placement in (first, second)]
        if loop["kind"] == "prismatic":
            slider = self.add_slider(name, first, second)
            ends[0] = (slider[0], np.eye(4))
        self.add_equality(equality, word, name, ends)
        if loop["kind"] == "revolute":
            further = translation((0.0, 0.0, self.length))
            ends = [(body, placement @ further) for body, placement in ends]
            self.add_equality(equality, word, f"{name}.axis", ends)
        return slider

    @staticmethod
    def add_equality(
        equality: etree._Element, word: str, name: str, ends: Iterable[tuple[etree._Element, Array]]
    ) -> None:
        sites = []
        for (body, placement), which in zip(ends, ("first", "second"), strict=True):
            site = etree.SubElement(body, "site", name=f"{name}.{which}")
            site.set("pos", numerals(placement[:3, 3]))  # even if 0: Pinocchio 4.1 reads uninitialised memory else
            site.set("quat", numerals(quaternion(placement[:3, :3])))
            sites.append(site.get("name", ""))
        etree.SubElement(equality, word, name=name, site1=sites[0], site2=sites[1])

    def add_slider(self, name: str, first: End, second: End) -> tuple[etree._Element, Inertia]:
        """Add a body that slides along z of the first end, placed at the second end.

        It takes half the mass of the body that it is welded to: without mass, the weld would be soft.
        """
        world = self.tree.world
        between = inverse(world[first[0]] @ first[1]) @ world[second[0]] @ second[1]
        height = float(between[2, 3])
        body_name = unique_name(name, self.names)
        self.names.add(body_name)
        placed = pose(first[1] @ translation((0.0, 0.0, height)))
        body = etree.SubElement(self.element[first[0]], "body", name=body_name, **placed)
        etree.SubElement(body, "joint", name=body_name, type="slide", axis="0 0 1", ref=numeral(height))
        carrier, on_it = second
        whole = sum_of(self.inertia[link].in_frame(placement) for link, placement in self.tree.rigid[carrier])
        if carrier in self.tree.moving:
            for link, _ in self.tree.rigid[carrier]:
                self.inertia[link] = self.inertia[link].share(0.5)
            whole = whole.share(0.5)
        elif whole.mass <= 0.0:  # it is welded to something fixed: its mass moves nothing
            whole = Inertia(1.0, np.zeros(3), self.length**2 / 10.0 * np.eye(3))
        return body, whole.in_frame(inverse(on_it))

    def add_coupling(self, equality: etree._Element, tendon: etree._Element, coupling: Coupling) -> None:
        """Add a coupling as MuJoCo counts: y - y0 = a0 + a1 (x - x0) + ... + a4 (x - x0)^4, from values at home.

        Of more than two joints, y is the length of a fixed tendon, and so is x of a curve.

        Raises:
            RaffError: several joints have a curve, or its degree is too high.
        """
        curved = [joint for joint, coefficients in coupling.terms.items() if len(coefficients) > 1]
        linear = {joint: coefficients[0] for joint, coefficients in coupling.terms.items() if joint not in curved}
        if not linear or len(curved) > 1 or any(len(coupling.terms[joint]) > _MOST_POWERS for joint in curved):
            what = f"a coupling with curves of several joints, or of a degree above {_MOST_POWERS}"
            raise RaffError(
                f"robot '{self.tree.model.name}': coupling '{coupling.name}': MJCF has no notation for {what}"
            )
        factor, driving = 1.0, curved
        if len(coupling.terms) <= 2:
            follower, *others = linear
            factor, driving = linear.pop(follower), [*curved, *others]
        home, (driver, *_) = self.tree.home, [*driving, ""]
        values = {joint: home[joint] for joint in coupling.terms}
        curve = Polynomial([0.0, *coupling.terms.get(driver, ())])
        curve = curve(Polynomial([home.get(driver, 0.0), 1.0]))
        slopes = curve.coef.tolist()[1:] if driver else []
        powers = [-coupling.evaluate(values)[0] / factor, *(-c / factor for c in slopes)]
        polycoef = numerals([*powers, *[0.0] * _MOST_POWERS][: _MOST_POWERS + 1])
        if len(coupling.terms) <= 2:
            joints = {"joint1": follower, **({"joint2": driver} if driver else {})}
            etree.SubElement(equality, "joint", name=coupling.name, **joints, polycoef=polycoef)
            return
        lengths = {"tendon1": linear, **({"tendon2": {driver: 1.0}} if driver else {})}
        names = dict(zip(lengths, (coupling.name, f"{coupling.name}.curve"), strict=False))
        for word, terms in lengths.items():
            fixed = etree.SubElement(tendon, "fixed", name=names[word])
            for joint, c in terms.items():
                etree.SubElement(fixed, "joint", joint=joint, coef=numeral(c))
        etree.SubElement(equality, "tendon", name=coupling.name, **names, polycoef=polycoef)

    # --- actuators -----------------------------------------------------------------------------------------------

    def add_actuators(self, actuator: etree._Element) -> list[float]:
        """Add a servo for each actuated joint; return the targets that keep home."""
        targets = []
        for joint in self.tree.model.joints:
            entry = self.tree.entries.get(joint.name)
            if entry is not None and entry["actuated"]:
                stiffness = f"{self.moved_inertia(joint) * (SERVO / self.fall) ** 2:.6g}"
                values = {"joint": joint.name, "kp": stiffness, "dampratio": "1", **limit("ctrlrange", entry)}
                etree.SubElement(actuator, "position", name=joint.name, **values)
                targets.append(self.tree.home[joint.name])
        return targets

    def moved_inertia(self, joint: Joint) -> float:
        """Return the inertia that the joint moves at home, of the tree alone: kg m2 about its axis, or kg."""
        moved = {joint.child: None}  # in order
        for other in self.tree.order:
            if other.parent in moved:
                moved[other.child] = None
        world = self.tree.world
        whole = sum_of(self.inertias.links[name].in_frame(world[name]) for name in moved)
        if joint.type == "prismatic":
            return whole.mass
        z, origin = world[joint.child][:3, 2:].T
        arm = np.cross(z, whole.centre - origin)
        return float(z @ whole.matrix @ z + whole.mass * (arm @ arm))


def pose(placement: Array) -> dict[str, str]:
    """Return a placement (4, 4) as attributes; none for zeros."""
    attributes = {}
    if placement[:3, 3].any():
        attributes["pos"] = numerals(placement[:3, 3])
    if not np.array_equal(placement[:3, :3], np.eye(3)):
        attributes["quat"] = numerals(quaternion(placement[:3, :3]))
    return attributes


def quaternion(rotation: Array) -> list[float]:
    """Return a rotation (3, 3) as a unit quaternion w x y z, w >= 0."""
    x, y, z, w = Rotation.from_matrix(rotation).as_quat(canonical=True).tolist()
    return [w, x, y, z]


def limit(word: str, entry: Mapping[str, Any]) -> dict[str, str]:
    """Return a joint's limits as an attribute that MuJoCo accepts: finite, and not empty; none without limits."""
    if entry["limits"] is None:
        return {}
    low, high = np.clip(entry["limits"], -UNLIMITED, UNLIMITED).tolist()
    return {word: numerals((low, high) if high > low else (low - NARROW, high + NARROW))}


def add_inertial(body: etree._Element, inertia: Inertia) -> None:
    """Insert mass and inertia after a body's joint."""
    m = inertia.matrix
    a, b, c = np.linalg.eigvalsh(m).tolist()
    if 0.0 < (lacking := c * (1.0 + ROUNDING) - a - b) <= ROUNDED * c:  # a plate: MuJoCo has no tolerance for rounding
        m = m + lacking * np.eye(3)
    full = (m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2])
    values = {"mass": "0", "diaginertia": "0 0 0"}
    if inertia.mass > 0.0:
        values = {"mass": numeral(inertia.mass), "fullinertia": numerals(full)}
    element = etree.Element("inertial", pos=numerals(inertia.centre), **values)
    body.insert(sum(part.tag in ("joint", "freejoint") for part in body), element)


# --- meshes ------------------------------------------------------------------------------------------------------
