"""Models that a program has built with Pinocchio, as a URDF and its constraints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.errors import LoadError, UnknownNameError
from cinegen.joints import axis, translations
from raff2urdf.bounds import UNLIMITED
from raff2urdf.constraints import Constraints
from raff2urdf.coupling import Coupling
from raff2urdf.inertia import Inertia
from raff2urdf.joint_dynamics import JointDynamics
from raff2urdf.readers.loops.successive import ROTATIONS
from raff2urdf.readers.uncounted import note_of
from raff2urdf.readers.urdf_builder import UNBOUNDED, UrdfBuilder

_FREE = {"FreeFlyer": "floating", "Spherical": "spherical"}
_NODES = (pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.SENSOR)
_KINDS = {"CONTACT_6D": "rigid", "CONTACT_3D": "ball"}


def describe_model(
    model: pin.Model, loops: Sequence[Any] = (), couplings: Sequence[Coupling] = ()
) -> tuple[str, Constraints | None, tuple[str, ...]]:
    """Return a model as a URDF, with its constraints where it has what a URDF has not, and notes on what is left out.

    A node is each body, operational frame and sensor of the model, and each joint without a body. Limits, inertias,
    gravity, friction and armatures are those of the model; its reference configurations are not taken.

    Args:
        model: revolute, prismatic and spherical joints, and a free flyer at the root.
        loops: `pinocchio.RigidConstraintModel`, CONTACT_6D for a rigid closure and CONTACT_3D for a ball joint.
        couplings: equations between its joints.

    Friction whose limits differ by direction counts as the larger of both.

    Raises:
        LoadError: a joint or a loop is of a kind that no URDF and no constraint expresses; or a name is used twice.
        UnknownNameError: there is no such joint.
    """
    nodes, names = _nodes(model), [name for name, joint in _joints(model) if joint.nv == 1]
    builder = UrdfBuilder(model.name or "robot", model.names)
    for node, body in zip(nodes, model.inertias, strict=True):
        inertia = Inertia(float(body.mass), np.array(body.lever), np.array(body.inertia))
        builder.add_link(node, (), inertia if body.mass else None)
    for j in range(1, model.njoints):
        _add_joint(builder, model, j, nodes)
    frames = [frame for frame in model.frames if frame.type in _NODES and not _is_body(frame, nodes)]
    for frame in frames:
        builder.add_link(frame.name)
        name = builder.free_name(f"{frame.name}_fixed")
        builder.add_fixed(name, nodes[frame.parentJoint], frame.name, frame.placement.homogeneous)
    for name in (joint for coupling in couplings for joint in coupling.terms):
        if name not in names:
            raise UnknownNameError("joint", name, tuple(names))
    for coupling in couplings:
        builder.add_coupling(coupling.name, coupling.terms, coupling.constant)
    for i, constraint in enumerate(loops, 1):
        _add_loop(builder, constraint, getattr(constraint, "name", "") or f"loop{i}", nodes)
    urdf, values = builder.result((), None, model.gravity.linear.tolist())
    used = {"node": [*nodes, *(frame.name for frame in frames)], "loop": [loop["name"] for loop in values["loops"]]}
    for kind, listed in used.items():
        if twice := [name for name, count in Counter(listed).items() if count > 1]:
            raise LoadError(f"model '{model.name}': {kind} name '{twice[0]}' is used twice: give each its own")
    values["joints"] = [{"name": name, "armature": armature} for name, armature in _rotors(model)]
    stated = {key: values[key] for key in ("loops", "couplings", "gravity", "joints") if values.get(key)}
    return urdf, {"loops": [], **stated} if stated else None, _left_out(model)


def _joints(model: pin.Model) -> list[tuple[str, Any]]:
    """Return the joints with their names, without the universe."""
    return list(zip(model.names, model.joints, strict=True))[1:]


def _rotors(model: pin.Model) -> list[tuple[str, float]]:
    """Return the joints of the URDF, each with its armature; none if there are no armatures."""
    rotors: list[tuple[str, float]] = []
    for name, joint in _joints(model):
        if joint.nv == 1:
            rotors.append((name, float(model.armature[joint.idx_v])))
        elif joint.nv == 3:
            rotors += [(f"{name}_{letter}", 0.0) for letter in ROTATIONS]
    return rotors if any(armature for _, armature in rotors) else []


def _left_out(model: pin.Model) -> tuple[str, ...]:
    """Return a note on the friction and armatures of joints of several variables."""
    fields = {"damping": model.damping, "friction": model.upperDryFrictionLimit, "armature": model.armature}
    several = [(name, joint) for name, joint in _joints(model) if joint.nv > 1]
    named = {
        word: [name for name, joint in several if values[joint.idx_v : joint.idx_v + joint.nv].any()]
        for word, values in fields.items()
    }
    return tuple(note_of(named))


def _nodes(model: pin.Model) -> list[str]:
    """Return the name of each joint's body: of one with the joint's own frame, else the joint's."""
    names, taken = [""] * model.njoints, {frame.name for frame in model.frames if frame.type in _NODES}
    for frame in model.frames:
        is_own = frame.type == pin.FrameType.BODY and frame.placement.isIdentity(0.0)
        if is_own and not names[frame.parentJoint]:
            names[frame.parentJoint] = frame.name
    for j, name in enumerate(names):
        if not name:
            made = "base" if j == 0 else f"{model.names[j]}_body"
            while made in taken:
                made += "_"
            names[j] = made
            taken.add(made)
    return names


def _is_body(frame: pin.Frame, nodes: Sequence[str]) -> bool:
    """Return whether a frame is a joint's own body."""
    return bool(frame.type == pin.FrameType.BODY and frame.name == nodes[frame.parentJoint])


def _add_joint(builder: UrdfBuilder, model: pin.Model, j: int, nodes: Sequence[str]) -> None:
    """Add a joint.

    Raises:
        LoadError: URDF has no such joint.
    """
    joint, name, parent = model.joints[j], model.names[j], model.parents[j]
    kind = joint.shortname().removeprefix("JointModel")
    placed = model.jointPlacements[j].homogeneous
    if kind in _FREE and (kind != "FreeFlyer" or parent == 0):
        builder.add_fixed(name, nodes[parent], nodes[j], placed, _FREE[kind])
        return
    if joint.nv != 1 or not kind.startswith(("R", "P")):
        raise LoadError(
            f"model '{model.name}': joint '{name}' is of the kind {kind}, which no URDF has: build it of revolute and "
            "prismatic joints, one after the other"
        )
    at, v = joint.idx_q, joint.idx_v
    slides, limits = translations(joint) > 0, (float(model.lowerPositionLimit[at]), float(model.upperPositionLimit[at]))
    is_free = joint.nq == 2 or (not slides and limits[0] <= -UNLIMITED and limits[1] >= UNLIMITED)
    dry = float(max(model.upperDryFrictionLimit[v], -model.lowerDryFrictionLimit[v]))
    builder.add_joint(
        name, slides, (nodes[parent], nodes[j]), placed, axis(joint), limits=UNBOUNDED if is_free else limits,
        velocity=float(model.upperVelocityLimit[v]), effort=float(model.upperEffortLimit[v]),
        dynamics=JointDynamics(0.0, float(model.damping[v]), dry),
    )  # fmt: skip


def _add_loop(builder: UrdfBuilder, constraint: Any, name: str, nodes: Sequence[str]) -> None:
    """Add a loop.

    Raises:
        LoadError: the constraint closes no loop.
    """
    if not isinstance(constraint, pin.RigidConstraintModel) or constraint.type.name not in _KINDS:
        kind = getattr(getattr(constraint, "type", None), "name", type(constraint).__name__)
        raise LoadError(
            f"loops: {kind} closes no loop: give pinocchio.RigidConstraintModel of the type CONTACT_6D or CONTACT_3D"
        )
    if not constraint.desired_contact_placement.isIdentity(0.0):
        raise LoadError(f"loops: {name}: its ends meet: move desired_contact_placement into one of them")
    first = nodes[constraint.joint1_id], constraint.joint1_placement.homogeneous
    second = nodes[constraint.joint2_id], constraint.joint2_placement.homogeneous
    builder.add_loop(name, _KINDS[constraint.type.name], first, second)
