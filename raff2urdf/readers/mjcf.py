"""MJCF, MuJoCo's format, as a URDF and the loops that it closes; read by MuJoCo itself.

Bodies become links, joints keep their variables (a body's several joints are successive ones; a ball is three turns),
equality constraints of the kinds connect and weld become loops, the joints that actuators drive have motors, and the
keyframe `home`, or else the first, is where the mechanism stands. What couples joints (equality `joint`, tendons)
can't be said: one warning names it.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import yourdfpy
from numpy.typing import NDArray

from raff2urdf.constraints import Constraints
from raff2urdf.errors import RaffError, RaffWarning
from raff2urdf.placement import from_quaternion, rotation
from raff2urdf.readers import visuals
from raff2urdf.readers.urdf import LARGEST, UNLIMITED
from raff2urdf.writers.urdf import dumps

Array = NDArray[np.float64]

_WORLD = "world"
_HIDDEN = 3  # MuJoCo's viewer shows geoms of the groups 0 to 2; collision shapes stand in those above


def read(path: Path) -> tuple[str, Constraints]:
    """A URDF and what it can't say, from an MJCF.

    Meshes are not read, only named: they may be missing.

    Raises:
        RaffError: MuJoCo can't read it, for the reason that it gives; or the package `mujoco` is missing.
    """
    try:
        import mujoco
    except ImportError:
        raise RaffError(f"{path}: MJCF is read by the package 'mujoco', which is not installed") from None
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)  # what it warns of concerns simulation; it would write it into a file
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        meshes = _without_meshes(mujoco, spec)
        model = spec.compile()
    except (ValueError, OSError, RuntimeError) as error:
        raise RaffError(f"{path}: MuJoCo can't read it: {' '.join(str(error).split())}") from None
    finally:
        mujoco.set_mju_user_warning(before)
    placed = {"body": model.body_pos, "joint": model.jnt_pos, "equality": model.eq_data, "keyframe": model.key_qpos}
    for what, numbers in placed.items():
        if not np.abs(numbers).max(initial=0.0) <= LARGEST:
            raise RaffError(f"{path}: a {what} has a number beyond {LARGEST:g}")
    return _Writer(mujoco, model, spec.modelname or path.stem, meshes, str(path)).write()


def _without_meshes(mujoco: Any, spec: Any) -> dict[str, visuals.Shape]:
    """Puts a box in the place of every mesh, and takes all that is read from other files out.

    Returns:
        the meshes by the names of their geoms.
    """
    files = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes}
    folder = Path(spec.meshdir or "")
    found: dict[str, visuals.Shape] = {}
    for i, geom in enumerate(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_HFIELD:
            spec.delete(geom)
            continue
        if not geom.meshname:
            continue
        geom.name = geom.name or f"mesh {i}"
        mesh = files.get(geom.meshname)
        if mesh is not None and mesh.file:
            found[geom.name] = visuals.mesh((folder / mesh.file).as_posix(), mesh.scale)
        geom.meshname, geom.type, geom.size = "", mujoco.mjtGeom.mjGEOM_BOX, [1e-3, 1e-3, 1e-3]
    soft = {flex.name for flex in spec.flexes}
    joined = [equality for equality in spec.equalities if soft & {equality.name1, equality.name2}]
    for things in (joined, spec.sensors, spec.lights, spec.skins, spec.flexes, spec.meshes, spec.hfields):
        for thing in list(things):
            spec.delete(thing)
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in list(spec.textures):
        spec.delete(texture)
    spec.compiler.boundmass = spec.compiler.boundinertia = 1e-6  # of bodies that had meshes only
    return found


def _numbers(enumeration: Any) -> Any:
    """An enumeration's names as plain numbers: MuJoCo's own values don't equal those in its arrays."""
    members = {name: int(getattr(enumeration, name)) for name in dir(enumeration) if name.startswith("mj")}
    return SimpleNamespace(**members)


class _Writer:
    """A compiled model as a tree of joints, and loops."""

    def __init__(self, mujoco: Any, model: Any, robot: str, meshes: dict[str, visuals.Shape], name: str) -> None:
        self.mujoco, self.model, self.robot, self.meshes, self.name = mujoco, model, robot, meshes, name
        self.links: list[yourdfpy.Link] = []
        self.joints: list[yourdfpy.Joint] = []
        self.entries: list[dict[str, Any]] = []
        self.floating: str | None = None
        self.taken: set[str] = {_WORLD}
        self.bodies = [_WORLD, *self._all_named("BODY", model.nbody, "body")[1:]]
        self.called = self._all_named("JOINT", model.njnt, "joint")
        self.taken |= {*self.bodies, *self.called}
        self.motors = self._motors()
        self.home = model.key_qpos[self._key()] if model.nkey else model.qpos0

    def write(self) -> tuple[str, Constraints]:
        for body in range(self.model.nbody):
            self.links.append(yourdfpy.Link(name=self.bodies[body], visuals=list(self._visuals(body))))
            if body:
                self._body(body)
        loops = list(self._loops())
        urdf = dumps(yourdfpy.Robot(name=self.robot, links=self.links, joints=self.joints))
        said: Constraints = {
            "robot": self.robot,
            "nodes": self.bodies,
            "floating": self.floating,
            "joints": self.entries,
            "loops": loops,
        }
        return urdf, said

    def _named(self, kind: str, index: int, word: str) -> str:
        found = self.mujoco.mj_id2name(self.model, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind}"), index)
        return str(found or f"{word}{index}")

    def _all_named(self, kind: str, count: int, word: str) -> list[str]:
        """Names of all that is of a kind; what has none gets one that is free."""
        find, sort = self.mujoco.mj_id2name, getattr(self.mujoco.mjtObj, f"mjOBJ_{kind}")
        said = [find(self.model, sort, i) for i in range(count)]
        taken, names = set(said), []
        for i, name in enumerate(said):
            names.append(str(name or _free(f"{word}{i}", taken)))
        return names

    def _key(self) -> int:
        names = [self._named("KEY", k, "") for k in range(self.model.nkey)]
        return names.index("home") if "home" in names else 0

    def _motors(self) -> set[int]:
        """Joints that an actuator drives, itself or by a tendon."""
        transmission, model, driven = _numbers(self.mujoco.mjtTrn), self.model, set()
        for i in range(len(model.actuator_trnid)):
            target = int(model.actuator_trnid[i, 0])
            if model.actuator_trntype[i] in (transmission.mjTRN_JOINT, transmission.mjTRN_JOINTINPARENT):
                driven.add(target)
            elif model.actuator_trntype[i] == transmission.mjTRN_TENDON:
                first, count = model.tendon_adr[target], model.tendon_num[target]
                wraps = range(first, first + count)
                joint = _numbers(self.mujoco.mjtWrap).mjWRAP_JOINT
                driven |= {int(model.wrap_objid[w]) for w in wraps if model.wrap_type[w] == joint}
        return driven

    def _body(self, body: int) -> None:
        """The joints of a body, one after another, each about where the last has brought it."""
        model = self.model
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        father, child = self.bodies[model.body_parentid[body]], self.bodies[body]
        placed = _placement(model.body_pos[body], model.body_quat[body])
        steps = list(self._steps(body, range(first, first + count)))
        if steps and steps[0][0].type == "floating":
            self.floating = steps[0][0].name
            self._add(steps[0][0], father, child, placed)
            return
        at = np.zeros(3)
        for step, anchor in steps:
            straight = step is steps[-1][0] and not anchor.any()
            holds = child if straight else _free(f"{step.name}_axis", self.taken)
            if not straight:
                self.links.append(yourdfpy.Link(name=holds))
            turned = step.origin.copy()
            turned[:3, 3] += anchor - at
            self._add(step, father, holds, placed @ turned)
            father, at, placed = holds, anchor, np.eye(4)
        if father != child or not steps:
            back = placed.copy()
            back[:3, 3] += placed[:3, :3] @ -at
            name = _free(f"{child}_fixed", self.taken)
            self.joints.append(yourdfpy.Joint(name=name, type="fixed", parent=father, child=child, origin=back))

    def _add(self, joint: yourdfpy.Joint, parent: str, child: str, origin: Array) -> None:
        joint.parent, joint.child, joint.origin = parent, child, origin
        self.joints.append(joint)

    def _steps(self, body: int, joints: range) -> Iterator[tuple[yourdfpy.Joint, Array]]:
        """A body's joints as those of a URDF, moved back to their zeros, and their anchors in the body's frame."""
        kinds, model = _numbers(self.mujoco.mjtJoint), self.model
        for j in joints:
            name, at = self.called[j], int(model.jnt_qposadr[j])
            kind, anchor, axis = model.jnt_type[j], model.jnt_pos[j], model.jnt_axis[j]
            motor = {"actuated": j in self.motors} if self.motors else {}
            if kind == kinds.mjJNT_FREE:
                if body == 1 and np.count_nonzero(model.body_parentid == 0) == 2:  # all but the world: the base moves
                    yield yourdfpy.Joint(name=name, type="floating", parent="", child=""), np.zeros(3)
                    return
                for i, letter in enumerate("XYZ"):
                    self.entries.append({"name": f"{name}_T{letter}", "home": 0.0, **motor})
                    yield self._joint(f"{name}_T{letter}", "prismatic", np.eye(3)[i], None, 0.0), np.zeros(3)
            if kind in (kinds.mjJNT_FREE, kinds.mjJNT_BALL):
                ball = kind == kinds.mjJNT_BALL
                turns = _turns(self.home[at : at + 4]) if ball else (0.0, 0.0, 0.0)
                for i, letter in enumerate("XYZ"):
                    self.entries.append({"name": f"{name}_{letter}", "home": turns[i], **motor})
                    centre = anchor if ball else np.zeros(3)
                    yield self._joint(f"{name}_{letter}", "continuous", np.eye(3)[i], None, 0.0), centre
                continue
            limits = tuple(map(float, model.jnt_range[j])) if model.jnt_limited[j] else None
            self.entries.append({"name": name, "home": float(self.home[at]), **motor})
            sort = "prismatic" if kind == kinds.mjJNT_SLIDE else "revolute" if limits else "continuous"
            yield self._joint(name, sort, axis, limits, float(model.qpos0[at])), np.array(anchor)

    def _joint(self, name: str, kind: str, axis: Array, limits: Any, zero: float) -> yourdfpy.Joint:
        """A joint that stands where its body does while its variable is `zero`."""
        joint = yourdfpy.Joint(name=name, type=kind, parent="", child="", axis=np.array(axis))
        joint.origin = np.eye(4)
        if kind == "prismatic":
            joint.origin[:3, 3] = -zero * np.array(axis)
        else:
            joint.origin = rotation(axis / np.linalg.norm(axis), -zero)
        low, high = limits or (-UNLIMITED, UNLIMITED)
        joint.limit = yourdfpy.Limit(effort=UNLIMITED, velocity=UNLIMITED)
        if kind != "continuous":
            joint.limit.lower, joint.limit.upper = low, high
        return joint

    def _loops(self) -> Iterator[dict[str, Any]]:
        model, kinds = self.model, _numbers(self.mujoco.mjtEq)
        lost = []
        for e in range(model.neq):
            kind, data = model.eq_type[e], model.eq_data[e]
            name = self._named("EQUALITY", e, "equality")
            if kind not in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                lost.append(name)
                continue
            if not model.eq_active0[e]:
                continue
            connect = kind == kinds.mjEQ_CONNECT
            ends = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
            if model.eq_objtype[e] == int(self.mujoco.mjtObj.mjOBJ_SITE):
                owners = [int(model.site_bodyid[site]) for site in ends]
                placements = [_placement(model.site_pos[site], model.site_quat[site]) for site in ends]
            elif connect:
                owners = list(ends)
                placements = [_placement(data[0:3], None), _placement(data[3:6], None)]
            else:
                owners = list(ends)
                placements = [_placement(data[3:6], data[6:10]), _placement(data[0:3], None)]
            first, second = (
                {"node": self.bodies[owner], "placement": placement.tolist()}
                for owner, placement in zip(owners, placements, strict=True)
            )
            yield {"name": name, "kind": "ball" if connect else "rigid", "first": first, "second": second}
        lost += [self._named("TENDON", t, "tendon") for t in range(model.ntendon) if model.tendon_limited[t]]
        if lost:
            listed = ", ".join(f"'{name}'" for name in lost[:8]) + (" and more" if len(lost) > 8 else "")
            message = f"{self.name}: what couples joints is left out: {listed}"
            warnings.warn(message, RaffWarning, stacklevel=6)

    def _visuals(self, body: int) -> Iterator[yourdfpy.Visual]:
        model, kinds = self.model, _numbers(self.mujoco.mjtGeom)
        for g in range(int(model.body_geomadr[body]), int(model.body_geomadr[body]) + int(model.body_geomnum[body])):
            if model.geom_group[g] >= _HIDDEN or body == 0:
                continue
            material = int(model.geom_matid[g])
            look = visuals.material(model.mat_rgba[material] if material >= 0 else model.geom_rgba[g])
            placed = _placement(model.geom_pos[g], model.geom_quat[g])
            for shape, offset in self._shapes(kinds, g):
                yield yourdfpy.Visual(origin=placed @ offset, geometry=shape, material=look)

    def _shapes(self, kinds: Any, geom: int) -> Iterator[visuals.Shape]:
        """A geom as shapes that a URDF has; an ellipsoid as the box around it."""
        mesh = self.meshes.get(self._named("GEOM", geom, "geom"))
        a, b, c = (float(x) for x in self.model.geom_size[geom])
        kind = self.model.geom_type[geom]
        if mesh is not None:
            yield mesh
        elif kind in (kinds.mjGEOM_BOX, kinds.mjGEOM_ELLIPSOID):
            yield visuals.box([2.0 * a, 2.0 * b, 2.0 * c])
        elif kind == kinds.mjGEOM_SPHERE:
            yield visuals.sphere(a)
        elif kind == kinds.mjGEOM_CYLINDER:
            yield visuals.cylinder(a, 2.0 * b)
        elif kind == kinds.mjGEOM_CAPSULE:
            yield from visuals.capsule(a, 2.0 * b)


def _free(name: str, taken: set[Any]) -> str:
    """A name that is not taken yet, for something that the file does not name."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _placement(position: Array, quaternion: Array | None) -> Array:
    placement = np.eye(4)
    placement[:3, 3] = position
    if quaternion is not None:
        placement[:3, :3] = from_quaternion(*quaternion)
    return placement


def _turns(wxyz: Array) -> tuple[float, float, float]:
    """Angles a, b, c of the rotation Rx(a) Ry(b) Rz(c)."""
    r = from_quaternion(*wxyz)
    a = math.atan2(-r[1, 2], r[2, 2])
    ca, sa = math.cos(a), math.sin(a)
    return (
        a,
        math.atan2(r[0, 2], ca * r[2, 2] - sa * r[1, 2]),
        math.atan2(ca * r[1, 0] + sa * r[2, 0], ca * r[1, 1] + sa * r[2, 1]),
    )
