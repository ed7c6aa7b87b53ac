"""Models that a program has built with Pinocchio, as a URDF and its constraints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from cinegen.errors import LoadError, UnknownNameError, warn
from cinegen.joints import axis, translations
from cinegen.model.urdf import kinematics
from raff2urdf.constraints import Constraints, loop_entry
from raff2urdf.coupling import Coupling, coupling_entry
from raff2urdf.readers.urdf import UNLIMITED, parse

_FREE = {"FreeFlyer": "floating", "Spherical": "spherical"}
_KINDS = {"CONTACT_6D": "rigid", "CONTACT_3D": "ball"}


def describe_model(
    model: pin.Model, loops: Sequence[Any] = (), couplings: Sequence[Coupling] = ()
) -> tuple[str, Constraints | None]:
    """Return a model as a URDF and, where it has loops or couplings, its constraints.

    A node is each body of the model, and each joint without one; frames of other types are left out.

    Args:
        model: revolute, prismatic and spherical joints, and a free flyer at the root.
        loops: `pinocchio.RigidConstraintModel`, CONTACT_6D for a rigid closure and CONTACT_3D for a ball joint.
        couplings: equations between its joints.

    Raises:
        LoadError: a joint or a loop is of a kind that no URDF and no constraint expresses.
        UnknownNameError: there is no such joint.
    """
    from yourdfpy import Robot

    from raff2urdf.urdf_object import ExactUrdf

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
    _check_order(model, urdf, robot)
    coupled = [coupling_entry(one.name, one.terms, one.constant) for one in couplings]
    closing = [_loop(constraint, f"loop{i + 1}", nodes) for i, constraint in enumerate(loops)]
    return urdf, {"loops": closing, "couplings": coupled} if closing or coupled else None


def _nodes(model: pin.Model) -> list[str]:
    """Return the name of each joint's body: of one with the joint's own frame, else the joint's."""
    names, taken = [""] * model.njoints, {frame.name for frame in model.frames if frame.type == pin.FrameType.BODY}
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
    from yourdfpy import Joint, Limit

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
    low, high = (float(x[at]) for x in (model.lowerPositionLimit, model.upperPositionLimit))
    made = Joint(name, "prismatic" if translations(joint) else "revolute", nodes[parent], nodes[j], placed, axis(joint))
    made.limit = Limit(effort, velocity)
    if joint.nq == 1 and np.isfinite([low, high]).all():
        made.limit.lower, made.limit.upper = low, high
    elif made.type == "revolute":
        made.type = "continuous"
    return made


def _frames(model: pin.Model, nodes: Sequence[str]) -> list[tuple[Any, Any]]:
    """Return the bodies that are fixed to those of joints, each with its joint."""
    from yourdfpy import Joint, Link

    found, taken = [], {*model.names}
    for frame in model.frames:
        if frame.type != pin.FrameType.BODY or frame.name in nodes:
            continue
        name = f"{frame.name}_fixed"
        while name in taken:
            name += "_"
        taken.add(name)
        placed = Joint(name, "fixed", nodes[frame.parentJoint], frame.name, frame.placement.homogeneous)
        found.append((Link(frame.name), placed))
    return found


def _loop(constraint: Any, name: str, nodes: Sequence[str]) -> dict[str, Any]:
    if not isinstance(constraint, pin.RigidConstraintModel) or constraint.type.name not in _KINDS:
        given = getattr(getattr(constraint, "type", None), "name", type(constraint).__name__)
        raise LoadError(
            f"loops: {given} closes no loop: give pinocchio.RigidConstraintModel of the type CONTACT_6D or CONTACT_3D"
        )
    first, second = nodes[constraint.joint1_id], nodes[constraint.joint2_id]
    placements = [placed.homogeneous for placed in (constraint.joint1_placement, constraint.joint2_placement)]
    return loop_entry(constraint.name or name, _KINDS[constraint.type.name], first, second, placements)


def _check_order(model: pin.Model, urdf: str, robot: str) -> None:
    """Warn if joints are in another order in q than in the model: Pinocchio sorts those of a URDF."""
    names = list(pin.buildModelFromXML(kinematics(parse(urdf, robot))).names)[1:]
    if names != list(model.names)[1:]:
        warn(f"model '{robot}': Pinocchio orders joints of a URDF by name, so those in q: mechanism.q_index finds them")
