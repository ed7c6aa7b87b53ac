"""Models that a program has built with Pinocchio, as a URDF and its constraints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.errors import LoadError, UnknownNameError
from cinegen.joints import axis, translations
from raff2urdf.constraints import Constraints, loop_entry
from raff2urdf.coupling import Coupling, coupling_entry
from raff2urdf.readers.loops.successive import ROTATIONS
from raff2urdf.readers.uncounted import note_of
from raff2urdf.readers.urdf import UNLIMITED

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
    from yourdfpy import Robot

    from raff2urdf.writers.urdf_object import ExactUrdf

    nodes = _nodes(model)
    links, joints = _bodies(model, nodes), [_joint(model, j, nodes) for j in range(1, model.njoints)]
    frames = _frames(model, nodes)
    links += [link for link, _ in frames]
    joints += [joint for _, joint in frames]
    names = [joint.name for joint in joints if joint.type in ("revolute", "continuous", "prismatic")]
    for name in (joint for coupling in couplings for joint in coupling.terms):
        if name not in names:
            raise UnknownNameError("joint", name, tuple(names))
    robot = model.name or "robot"
    urdf = ExactUrdf(Robot(robot, links, joints)).text()
    coupled = [coupling_entry(coupling.name, coupling.terms, coupling.constant) for coupling in couplings]
    closing = [_loop(constraint, f"loop{i + 1}", nodes) for i, constraint in enumerate(loops)]
    for kind, used in (("node", [link.name for link in links]), ("loop", [loop["name"] for loop in closing])):
        if twice := [name for name, count in Counter(used).items() if count > 1]:
            raise LoadError(f"model '{model.name}': {kind} name '{twice[0]}' is used twice: give each its own")
    values: Constraints = {"loops": closing, "couplings": coupled}
    if (down := model.gravity.linear.tolist()) != [0.0, 0.0, -9.81]:
        values["gravity"] = down
    if any(rotors := _rotors(model)):
        values["joints"] = [{"name": name, "armature": armature} for name, armature in rotors]
    stated = closing or coupled or len(values) > 2
    return urdf, values if stated else None, _left_out(model)


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


def _bodies(model: pin.Model, nodes: Sequence[str]) -> list[Any]:
    from yourdfpy import Inertial, Link

    links = []
    for name, body in zip(nodes, model.inertias, strict=True):
        centre = pin.SE3(np.eye(3), body.lever).homogeneous
        links.append(Link(name, Inertial(centre, float(body.mass), np.array(body.inertia)) if body.mass else None))
    return links


def _joint(model: pin.Model, j: int, nodes: Sequence[str]) -> Any:
    from yourdfpy import Dynamics, Joint, Limit

    joint, name, parent = model.joints[j], model.names[j], model.parents[j]
    kind = joint.shortname().removeprefix("JointModel")
    placed = model.jointPlacements[j].homogeneous
    if kind in _FREE and (kind != "FreeFlyer" or parent == 0):
        return Joint(name, _FREE[kind], nodes[parent], nodes[j], placed)
    if joint.nv != 1 or not kind.startswith(("R", "P")):
        raise LoadError(
            f"model '{model.name}': joint '{name}' is of the kind {kind}, which no URDF has: build it of revolute and "
            "prismatic joints, one after the other"
        )
    at, v = joint.idx_q, joint.idx_v
    effort, velocity = (min(float(x[v]), UNLIMITED) for x in (model.upperEffortLimit, model.upperVelocityLimit))
    low, high = np.clip([model.lowerPositionLimit[at], model.upperPositionLimit[at]], -UNLIMITED, UNLIMITED).tolist()
    made = Joint(name, "prismatic" if translations(joint) else "revolute", nodes[parent], nodes[j], placed, axis(joint))
    made.limit = Limit(effort, velocity)
    damping, dry = float(model.damping[v]), float(max(model.upperDryFrictionLimit[v], -model.lowerDryFrictionLimit[v]))
    made.dynamics = Dynamics(damping, dry) if damping or dry else None
    if joint.nq == 2 or (made.type == "revolute" and low == -UNLIMITED and high == UNLIMITED):
        made.type = "continuous"
    else:
        made.limit.lower, made.limit.upper = low, high
    return made


def _frames(model: pin.Model, nodes: Sequence[str]) -> list[tuple[Any, Any]]:
    """Return the links of frames that are fixed to the bodies of joints, each with its joint."""
    from yourdfpy import Joint, Link

    fixed, taken = [], {*model.names}
    for frame in model.frames:
        if frame.type not in _NODES or (frame.type == pin.FrameType.BODY and frame.name == nodes[frame.parentJoint]):
            continue
        name = f"{frame.name}_fixed"
        while name in taken:
            name += "_"
        taken.add(name)
        placed = Joint(name, "fixed", nodes[frame.parentJoint], frame.name, frame.placement.homogeneous)
        fixed.append((Link(frame.name), placed))
    return fixed


def _loop(constraint: Any, name: str, nodes: Sequence[str]) -> dict[str, Any]:
    if not isinstance(constraint, pin.RigidConstraintModel) or constraint.type.name not in _KINDS:
        kind = getattr(getattr(constraint, "type", None), "name", type(constraint).__name__)
        raise LoadError(
            f"loops: {kind} closes no loop: give pinocchio.RigidConstraintModel of the type CONTACT_6D or CONTACT_3D"
        )
    if not constraint.desired_contact_placement.isIdentity(0.0):
        raise LoadError(
            f"loops: {constraint.name or name}: its ends meet: move desired_contact_placement into one of them"
        )
    first, second = nodes[constraint.joint1_id], nodes[constraint.joint2_id]
    placements = [placed.homogeneous for placed in (constraint.joint1_placement, constraint.joint2_placement)]
    return loop_entry(constraint.name or name, _KINDS[constraint.type.name], first, second, placements)
