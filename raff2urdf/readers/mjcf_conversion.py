"""Convert a model of MuJoCo to a URDF and its constraints."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from yourdfpy import Visual

from raff2urdf.arrays import Array
from raff2urdf.constraints import Constraints
from raff2urdf.errors import RaffError, run_all
from raff2urdf.inertia import Inertia
from raff2urdf.joint_dynamics import JointDynamics
from raff2urdf.placement import from_quaternion, inverse, roll_pitch_yaw, translation
from raff2urdf.readers import uncounted
from raff2urdf.readers.loops.declaration import leave_out
from raff2urdf.readers.urdf import LEAST_SPEED, TOO_SLOW
from raff2urdf.readers.urdf_builder import UNBOUNDED, Shape, UrdfBuilder, material, shapes
from raff2urdf.tree import WORLD

_HIDDEN = 3  # MuJoCo's viewer shows geoms of the groups 0 to 2; collision shapes are in those above


class _Joint(NamedTuple):
    """A joint of one degree of freedom."""

    name: str
    prismatic: bool
    axis: Array
    anchor: Array  # in the body's frame
    values: dict[str, Any]  # zero, home, limits, velocity, effort, dynamics, actuated


class MjcfConversion:
    """A compiled model."""

    def __init__(self, mujoco: Any, model: Any, robot: str, meshes: dict[str, Shape], name: str) -> None:
        self.mujoco, self.model, self.meshes, self.name = mujoco, model, meshes, name
        self.bodies = [WORLD, *self.all_names("body", model.nbody)[1:]]
        self.joint_names = self.all_names("joint", model.njnt)
        self.urdf = UrdfBuilder(robot, [WORLD, *self.bodies, *self.joint_names])
        self.actuated = self.actuated_joints()
        self.floating: str | None = None
        self.ignored: list[str] = []
        self.notes: list[str] = []
        self.hinges: set[str] = set()
        keys = [model.key(k).name for k in range(model.nkey)]
        key = keys.index("home") if "home" in keys else 0
        self.home = model.key_qpos[key] if keys else model.qpos0
        if keys:
            self.notes.append(f"home is the keyframe {repr(keys[key]) if keys[key] else key + 1}")

    def read(self, ignore: Collection[str], masses: Mapping[int, Inertia]) -> tuple[str, Constraints]:
        """Return the URDF and the constraints; masses by the index of the body."""
        run_all(
            [
                *(partial(self.add_body, body, name, masses) for body, name in enumerate(self.bodies)),
                *self.equalities(ignore),
            ]
        )
        self.notes += uncounted.note_of(self.uncounted())
        off = self.model.opt.disableflags & int(self.mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        gravity = [0.0, 0.0, 0.0] if off else self.model.opt.gravity.tolist()
        return self.urdf.result(self.bodies, self.floating, gravity)

    def add_body(self, body: int, name: str, masses: Mapping[int, Inertia]) -> None:
        """Add a body, with its joints."""
        self.urdf.add_link(name, self.visuals(body), masses.get(body))
        if body:
            self.add_joints(body)

    def uncounted(self) -> dict[str, list[str]]:
        """Return what acts on joints and is not read, with the names of these joints."""
        model = self.model
        dofs = [self.joint_names[j] for j in model.dof_jntid]
        tendons, compound = (
            self.all_names("tendon", model.ntendon),
            (self.mujoco.mjtJoint.mjJNT_FREE, self.mujoco.mjtJoint.mjJNT_BALL),
        )
        compounds = np.isin(model.jnt_type[model.dof_jntid], [int(kind) for kind in compound])
        actuators = self.all_names("actuator", model.nu)
        indirect = [not self.is_direct(i) for i in range(model.nu)]
        acting = (
            ("damping", dofs, compounds * model.dof_damping),
            ("damping", tendons, model.tendon_damping),
            ("damping", actuators, indirect * model.actuator_damping),
            ("nonlinear damping", dofs, model.dof_dampingpoly),
            ("nonlinear damping", tendons, model.tendon_dampingpoly),
            ("nonlinear damping", actuators, model.actuator_dampingpoly),
            ("friction", dofs, compounds * model.dof_frictionloss),
            ("friction", tendons, model.tendon_frictionloss),
            ("springs", self.joint_names, model.jnt_stiffness),
            ("springs", tendons, model.tendon_stiffness),
            ("armature", dofs, compounds * model.dof_armature),
            ("armature", tendons, model.tendon_armature),
            ("armature", actuators, indirect * model.actuator_armature),
            ("gravity compensation", self.bodies, model.body_gravcomp),
        )
        named: dict[str, dict[str, None]] = {}
        for word, names, numbers in acting:
            named.setdefault(word, {}).update({name: None for name, x in zip(names, numbers, strict=True) if np.any(x)})
        return {word: list(names) for word, names in named.items()}

    def name_of(self, kind: str, index: int) -> str:
        """Return the name of an object: a body, a joint, ..."""
        return getattr(self.model, kind)(index).name or f"{kind}{index}"

    def all_names(self, kind: str, count: int) -> list[str]:
        """Return the names of all objects of a kind; those without one get one that is free."""
        names = [getattr(self.model, kind)(i).name for i in range(count)]
        free = UrdfBuilder("", filter(None, names)).free_name
        return [name or free(f"{kind}{i}") for i, name in enumerate(names)]

    def actuated_joints(self) -> set[int]:
        """Return the joints that an actuator drives, directly or by a tendon."""
        transmission, model, driven = self.mujoco.mjtTrn, self.model, set()
        for i in range(len(model.actuator_trnid)):
            target = int(model.actuator_trnid[i, 0])
            kind = transmission(model.actuator_trntype[i])
            if kind in (transmission.mjTRN_JOINT, transmission.mjTRN_JOINTINPARENT):
                driven.add(target)
            elif kind == transmission.mjTRN_TENDON:
                first, count = model.tendon_adr[target], model.tendon_num[target]
                wraps = range(first, first + count)
                joint = int(self.mujoco.mjtWrap.mjWRAP_JOINT)
                driven |= {int(model.wrap_objid[w]) for w in wraps if model.wrap_type[w] == joint}
        return driven

    # --- joints -------------------------------------------------------------------------------------------------

    def add_joints(self, body: int) -> None:
        """Add the joints of a body, one after another, each in the frame that the last one moves."""
        model, urdf = self.model, self.urdf
        parent, child = self.bodies[model.body_parentid[body]], self.bodies[body]
        placed = from_quaternion(model.body_pos[body], model.body_quat[body])
        first = int(model.body_jntadr[body])
        numbers = range(first, first + int(model.body_jntnum[body]))
        free = int(self.mujoco.mjtJoint.mjJNT_FREE)
        # A free joint of the only body on the world frees the base.
        if body == 1 and np.count_nonzero(model.body_parentid == 0) == 2 and free in model.jnt_type[numbers]:
            self.floating = self.joint_names[first]
            placed = _placement(self.home, int(model.jnt_qposadr[first]))
            urdf.add_fixed(self.floating, parent, child, placed, "floating")
            return
        joints = [joint for j in numbers for joint in self.successive(j)]
        for j in numbers:
            if model.jnt_type[j] == int(self.mujoco.mjtJoint.mjJNT_BALL) and not model.jnt_limited[j]:
                urdf.add_ball(self.joint_names[j], [f"{self.joint_names[j]}_{letter}" for letter in "XYZ"])
        for joint in joints:
            placed = placed @ translation(joint.anchor)
            link = child
            if joint is not joints[-1] or joint.anchor.any():
                link = urdf.free_name(f"{joint.name}_axis")
                urdf.add_link(link, (), None if joint is joints[-1] else Inertia())
            urdf.add_joint(joint.name, joint.prismatic, (parent, link), placed, joint.axis, **joint.values)
            parent, placed = link, translation(-joint.anchor)
        if parent != child or not joints:
            urdf.add_fixed(urdf.free_name(f"{child}_fixed"), parent, child, placed)

    def successive(self, j: int) -> Iterator[_Joint]:
        """Yield the joints of one degree of freedom of a joint."""
        kinds, model = self.mujoco.mjtJoint, self.model
        name, at, kind = self.joint_names[j], int(model.jnt_qposadr[j]), kinds(model.jnt_type[j])
        actuated = {"actuated": j in self.actuated} if self.actuated else {}
        if kind in (kinds.mjJNT_FREE, kinds.mjJNT_BALL):
            if kind == kinds.mjJNT_FREE:
                moved = inverse(_placement(model.qpos0, at)) @ _placement(self.home, at)
                for axis, letter, home in zip(np.eye(3), "XYZ", moved[:3, 3].tolist(), strict=True):
                    yield _Joint(f"{name}_T{letter}", True, axis, np.zeros(3), {"home": home, **actuated})
            else:
                moved = from_quaternion(np.zeros(3), self.home[at : at + 4])
            anchor = np.zeros(3) if kind == kinds.mjJNT_FREE else np.array(model.jnt_pos[j])
            for axis, letter, angle in zip(np.eye(3), "XYZ", _xyz_angles(moved), strict=True):
                yield _Joint(f"{name}_{letter}", False, axis, anchor, {"home": angle, **actuated})
            return
        low, high = map(float, model.jnt_range[j]) if model.jnt_limited[j] else UNBOUNDED
        values = {"zero": float(model.qpos0[at]), "home": float(self.home[at]), "limits": (low, high), **actuated}
        values |= {"velocity": self.velocity(name), "effort": self.effort(j), "dynamics": self.dynamics(j)}
        yield _Joint(name, kind == kinds.mjJNT_SLIDE, model.jnt_axis[j], np.array(model.jnt_pos[j]), values)

    def velocity(self, joint: str) -> float:
        """Return the velocity limit of a joint, rad/s or m/s, that raff2urdf writes; infinite without one."""
        number = self.mujoco.mj_name2id(self.model, self.mujoco.mjtObj.mjOBJ_NUMERIC, f"velocity:{joint}")
        if number < 0:
            return math.inf
        limit = float(self.model.numeric(number).data[0])
        if not limit > LEAST_SPEED:
            raise RaffError(f"{self.name}: velocity:{joint} in <custom> is {limit:g}: {TOO_SLOW}")
        return limit

    def dynamics(self, j: int) -> JointDynamics:
        """Return the inertia of rotors and the friction of a joint of one degree of freedom, with those of the
        actuators on it."""
        model, dof = self.model, self.model.jnt_dofadr[j]
        drives = [i for i in range(model.nu) if self.is_direct(i) and model.actuator_trnid[i, 0] == j]
        gears = model.actuator_gear[drives, 0] ** 2
        return JointDynamics(
            float(model.dof_armature[dof] + gears @ model.actuator_armature[drives]),
            float(model.dof_damping[dof] + gears @ model.actuator_damping[drives]),
            float(model.dof_frictionloss[dof]),
        )

    def is_direct(self, i: int) -> bool:
        """Return whether an actuator acts on a joint of one degree of freedom."""
        model, kinds, joints = self.model, self.mujoco.mjtTrn, self.mujoco.mjtJoint
        on_joint = model.actuator_trntype[i] in (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT))
        scalar = (int(joints.mjJNT_HINGE), int(joints.mjJNT_SLIDE))
        return bool(on_joint and model.jnt_type[model.actuator_trnid[i, 0]] in scalar)

    def effort(self, j: int) -> float:
        """Return the limit of the torque (N m) or force (N) of a joint's actuators: the least of the joint's range and
        the sum of theirs, in the weaker direction unless that is 0. Infinite without one."""
        model, transmission = self.model, self.mujoco.mjtTrn
        kinds = (int(transmission.mjTRN_JOINT), int(transmission.mjTRN_JOINTINPARENT))
        drives = [i for i in range(model.nu) if model.actuator_trntype[i] in kinds and model.actuator_trnid[i, 0] == j]
        ranges = [np.sum([self.force_range(i) for i in drives], axis=0)] if drives else []
        ranges += [model.jnt_actfrcrange[j]] if model.jnt_actfrclimited[j] else []
        strengths = [np.abs(pair) for pair in ranges]
        return min((float(pair.min() or pair.max()) for pair in strengths), default=math.inf)

    def force_range(self, i: int) -> Array:
        """Return the least and greatest force (2,) of an actuator on its joint; infinite without a limit."""
        model, ends = self.model, np.array(UNBOUNDED)
        motor = model.actuator_gaintype[i] == int(self.mujoco.mjtGain.mjGAIN_FIXED) and (
            model.actuator_biastype[i] == int(self.mujoco.mjtBias.mjBIAS_NONE)
            and model.actuator_dyntype[i] == int(self.mujoco.mjtDyn.mjDYN_NONE)
        )
        if motor and model.actuator_ctrllimited[i] and model.actuator_gainprm[i, 0] != 0.0:
            ends = np.sort(model.actuator_gainprm[i, 0] * model.actuator_ctrlrange[i])
        if model.actuator_forcelimited[i]:
            ends = np.clip(ends, *model.actuator_forcerange[i])
        gear = float(model.actuator_gear[i, 0])
        return np.sort(gear * ends) if gear else np.zeros(2)

    # --- equality constraints -----------------------------------------------------------------------------------

    def equalities(self, ignore: Collection[str]) -> Iterator[Callable[[], None]]:
        """Yield what adds each loop and coupling; note what is ignored."""
        model, kinds = self.model, self.mujoco.mjtEq
        names = self.all_names("equality", model.neq)
        active = {name for e, name in enumerate(names) if model.eq_active0[e]}
        text = int(self.mujoco.mjtObj.mjOBJ_TEXT)  # of raff2urdf, which writes a hinge as two points on its axis
        ours = {self.mujoco.mj_id2name(model, text, i) for i in range(model.ntext)}
        self.hinges = {name for name in active if f"{name}.axis" in active and f"{name}.first" in ours}
        for e, name in enumerate(names):
            kind = kinds(model.eq_type[e])
            if not model.eq_active0[e] or name in ignore:
                why = "" if model.eq_active0[e] else " (not active)"
                self.ignored.append(f"equality constraint '{name}'{why}")
            elif name.endswith(".axis") and name.removesuffix(".axis") in self.hinges:
                continue
            elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                yield partial(self.add_loop, name, e, kind == kinds.mjEQ_CONNECT)
            elif kind in (kinds.mjEQ_JOINT, kinds.mjEQ_TENDON):
                yield partial(self.add_coupling, name, e, kind == kinds.mjEQ_TENDON)
            else:
                yield partial(self.refuse, name, kind.name[5:].lower())
        tendons = self.all_names("tendon", model.ntendon)
        self.ignored += [f"limits of tendon '{name}'" for t, name in enumerate(tendons) if model.tendon_limited[t]]

    def refuse(self, name: str, kind: str) -> None:
        """Raise the error of an equality constraint that is not read."""
        what = f"the equality constraint '{name}' is of a kind that is not read ({kind})"
        raise RaffError(f"{self.name}: {what}: {leave_out(name)}")

    def add_loop(self, name: str, e: int, connect: bool) -> None:
        """Add a loop. A weld whose rotation counts nothing constrains the position alone, as a connect does."""
        model, data = self.model, self.model.eq_data[e]
        owners = [int(model.eq_obj1id[e]), int(model.eq_obj2id[e])]
        if model.eq_objtype[e] == int(self.mujoco.mjtObj.mjOBJ_SITE):
            placements = [from_quaternion(model.site_pos[site], model.site_quat[site]) for site in owners]
            owners = [int(model.site_bodyid[site]) for site in owners]
        elif connect:
            placements = [translation(data[0:3]), translation(data[3:6])]
        else:
            if not np.linalg.norm(data[6:10]) > 1e-9:
                what = f"the relpose of the equality constraint '{name}' has the quaternion 0, which is no rotation"
                raise RaffError(f"{self.name}: {what}: {leave_out(name)}")
            placements = [from_quaternion(data[3:6], data[6:10]), translation(data[0:3])]
        mocap = [owner for owner in owners if model.body_mocapid[owner] >= 0]
        if mocap:
            (held,) = {*owners} - {*mocap} or {mocap[0]}
            what = "connects" if connect else "welds"
            self.notes.append(
                f"the equality constraint '{name}' {what} '{self.bodies[held]}' to the mocap body "
                f"'{self.bodies[mocap[0]]}', a handle: left out, since a task on '{self.bodies[held]}' moves it"
            )
            return
        first, second = ((self.bodies[o], placement) for o, placement in zip(owners, placements, strict=True))
        kind = "revolute" if name in self.hinges else "ball" if connect or data[10] == 0.0 else "rigid"
        self.urdf.add_loop(name, kind, first, second)

    def add_coupling(self, name: str, e: int, tendons: bool) -> None:
        """Add the coupling of two joints, or of the lengths of two fixed tendons; or of one with a constant.

        MuJoCo's equation is y - y0 = a0 + a1 (x - x0) + ... + a4 (x - x0)^4, with the values x0, y0 at `qpos0`.
        """
        model = self.model
        first, other = int(model.eq_obj1id[e]), int(model.eq_obj2id[e])
        y, y0 = self.length(name, first) if tendons else self.variable(first)
        x, x0 = ({}, 0.0) if other < 0 else self.length(name, other) if tendons else self.variable(other)
        a = model.eq_data[e, : 5 if other >= 0 else 1]
        terms = {joint: [c] for joint, c in y.items()}
        curve: Sequence[float] = Polynomial(a)(Polynomial([-x0, 1.0])).trim().coef.tolist()
        constant = y0 + curve[0]
        if len(curve) > 2 and len(x) > 1:
            what = f"the equality constraint '{name}' is a curve of a tendon with {len(x)} joints"
            raise RaffError(f"{self.name}: {what}, but only one joint can be read: {leave_out(name)}")
        for joint, factor in x.items():
            powers = [-c * factor**power for power, c in enumerate(curve[1:], 1)]
            terms[joint] = [sum(pair) for pair in zip_longest(terms.get(joint, []), powers, fillvalue=0.0)]
        moving = {joint: powers for joint, powers in terms.items() if any(powers)}
        if not moving:
            raise RaffError(f"{self.name}: the equality constraint '{name}' constrains no joint: {leave_out(name)}")
        self.urdf.add_coupling(name, moving, constant)

    def variable(self, joint: int) -> tuple[dict[str, float], float]:
        """Return a joint as a sum of joints with factors, and its value at `qpos0`."""
        return {self.joint_names[joint]: 1.0}, float(self.model.qpos0[self.model.jnt_qposadr[joint]])

    def length(self, equality: str, tendon: int) -> tuple[dict[str, float], float]:
        """Return the length of a fixed tendon as a sum of joints with factors, and its value at `qpos0`."""
        model, terms = self.model, dict[str, float]()
        first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
        for w in range(first, first + count):
            if model.wrap_type[w] != int(self.mujoco.mjtWrap.mjWRAP_JOINT):
                spatial = self.name_of("tendon", tendon)
                what = f"the equality constraint '{equality}' constrains the spatial tendon '{spatial}'"
                raise RaffError(f"{self.name}: {what}, whose length is no sum of joint values: {leave_out(equality)}")
            joint = self.joint_names[model.wrap_objid[w]]
            terms[joint] = terms.get(joint, 0.0) + float(model.wrap_prm[w])
        return terms, float(model.tendon_length0[tendon])

    # --- visuals ------------------------------------------------------------------------------------------------

    def visuals(self, body: int) -> Iterator[Visual]:
        """Yield the visuals of a body."""
        model = self.model
        for g in range(int(model.body_geomadr[body]), int(model.body_geomadr[body]) + int(model.body_geomnum[body])):
            if model.geom_group[g] >= _HIDDEN or body == 0:
                continue
            matid = int(model.geom_matid[g])
            rgba = model.mat_rgba[matid] if matid >= 0 else model.geom_rgba[g]
            if not np.isfinite(rgba).all():
                label = f"geom '{self.name_of('geom', g)}' of body '{self.name_of('body', body)}'"
                raise RaffError(f"{self.name}: {label}: its rgba must be four numbers, not {rgba.tolist()}")
            placed = from_quaternion(model.geom_pos[g], model.geom_quat[g])
            for shape, offset in self.shapes_of(g):
                yield Visual(origin=placed @ offset, geometry=shape, material=material(rgba))

    def shapes_of(self, geom: int) -> Iterator[Shape]:
        """Yield the shapes of a geom that URDF has; an ellipsoid becomes the box around it."""
        mesh = self.meshes.get(self.name_of("geom", geom))
        kinds = self.mujoco.mjtGeom
        a, b, c = (2.0 * float(x) for x in self.model.geom_size[geom])
        sizes = {
            kinds.mjGEOM_BOX: ("box", [a, b, c]),
            kinds.mjGEOM_ELLIPSOID: ("box", [a, b, c]),
            kinds.mjGEOM_SPHERE: ("sphere", [a / 2.0]),
            kinds.mjGEOM_CYLINDER: ("cylinder", [a / 2.0, b]),
            kinds.mjGEOM_CAPSULE: ("capsule", [a / 2.0, b]),
        }
        kind = kinds(self.model.geom_type[geom])
        if mesh is not None:
            yield mesh
        elif kind in sizes:
            yield from shapes(*sizes[kind])


def _placement(qpos: Array, at: int) -> Array:
    """Return the placement (4, 4) of a free joint, whose seven values begin at an index."""
    return from_quaternion(qpos[at : at + 3], qpos[at + 3 : at + 7])


def _xyz_angles(placed: Array) -> list[float]:
    """Return the angles a, b, c of the rotation Rx(a) Ry(b) Rz(c), whose inverse has the angles -a, -b, -c of URDF."""
    turned = np.eye(4)
    turned[:3, :3] = placed[:3, :3].T
    return [0.0 - angle for angle in roll_pitch_yaw(turned)]
