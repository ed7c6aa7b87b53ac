"""A mechanism described by values that can be printed or written."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from msgspec import Struct, to_builtins

from cinegen.loops.closed_loops import LoopConstraint
from cinegen.loops.motions import motions_of
from cinegen.model.masses import stated
from cinegen.model.mechanism import Mechanism
from raff2urdf.coupling import Coupling


class JointDescription(Struct, frozen=True):
    """A joint of a robot; null where it has no limit.

    Attributes:
        name: name of the joint.
        type: revolute or prismatic.
        home: value at home, rad or m.
        lower: lower limit, rad or m.
        upper: upper limit, rad or m.
        velocity: velocity limit, rad/s or m/s.
        effort: limit of the torque or force of its actuator, N m or N.
        actuated: whether it is actuated.
    """

    name: str
    type: Literal["revolute", "prismatic"]
    home: float
    lower: float | None
    upper: float | None
    velocity: float | None
    effort: float | None
    actuated: bool


class LoopDescription(Struct, frozen=True):
    """A loop of a robot.

    Attributes:
        name: name of the loop.
        kind: rigid, prismatic, revolute or ball.
        first: first node that it connects.
        second: second node.
    """

    name: str
    kind: str
    first: str
    second: str


class CouplingDescription(Struct, frozen=True):
    """An equation between joints: the sum over all terms of c1 q + c2 q^2 + ... is the constant; rad and m.

    Attributes:
        name: name of the coupling.
        terms: coefficients c1, c2, ... by joint; first the joint that follows.
        constant: the constant.
        equation: all of it as text.
    """

    name: str
    terms: dict[str, tuple[float, ...]]
    constant: float
    equation: str


def describe(mechanism: Mechanism) -> dict[str, Any]:
    """Return joints, loops, couplings, mobility, actuated joints, masses, closure and singular values at home; SI and
    radians.

    The mass is that of all links whose mass is stated, also of those that do not move.

    Singular values are dimensionless: lengths are divided by the characteristic length. Those of the loops and
    couplings are as many as their generic rank. Those of the end (`Mechanism.end`) are of its Jacobian in their null
    space.
    """
    q, end = mechanism.q_home, mechanism.end
    motions = motions_of(mechanism.structure.system, q, mechanism.loop_rank)
    units = np.array([mechanism.length] * 3 + [1.0] * 3)[:, None]
    end_sigma = np.linalg.svd(mechanism.jacobian(q, end) * mechanism.scale @ motions / units, compute_uv=False)
    return {
        "robot": mechanism.name,
        "dialects": list(mechanism.source.dialects),
        "notes": list(mechanism.source.notes),
        "nodes": list(mechanism.nodes),
        "joints": [to_builtins(describe_joint(mechanism, joint)) for joint in mechanism.joints],
        "balls": list(mechanism.balls),
        "loops": [to_builtins(describe_loop(loop)) for loop in mechanism.loops],
        "couplings": [to_builtins(describe_coupling(coupling)) for coupling in mechanism.couplings],
        "loop_rows": mechanism.structure.system.rows,
        "loop_rank": mechanism.loop_rank,
        "mobility": mechanism.mobility,
        "uncontrolled_dof": mechanism.structure.uncontrolled_dof,
        "idle": mechanism.structure.idle_nodes,
        "actuated": list(mechanism.actuated),
        "characteristic_length": mechanism.length,
        "gap_as_written": mechanism.gap_as_written,
        "closure_at_home": mechanism.closure(q),
        "loop_singular_values": mechanism.loop_singular_values(q).tolist(),
        "mass": sum(body.mass for body in stated(mechanism).values()),
        "massless": list(mechanism.massless),
        "unphysical": dict(mechanism.unphysical),
        "end": end,
        "end_singular_values": end_sigma.tolist(),
    }


def describe_loop(loop: LoopConstraint) -> LoopDescription:
    """Describe a loop."""
    return LoopDescription(loop.name, loop.kind.name.lower(), loop.first, loop.second)


def describe_coupling(coupling: Coupling) -> CouplingDescription:
    """Describe a coupling."""
    return CouplingDescription(coupling.name, dict(coupling.terms), coupling.constant, str(coupling))


def describe_joint(mechanism: Mechanism, joint: str) -> JointDescription:
    """Describe a joint."""
    lower, upper, velocity, effort = (bound if np.isfinite(bound) else None for bound in mechanism.limits[joint])
    kind: Literal["prismatic", "revolute"] = "prismatic" if mechanism.is_prismatic(joint) else "revolute"
    home = float(mechanism.q_home[mechanism.q_index(joint)])
    return JointDescription(joint, kind, home, lower, upper, velocity, effort, joint in mechanism.actuated)
