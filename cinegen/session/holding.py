"""`Holding`: the torques that hold a robot of a session at rest, with what it carries; `BearingReporter`: the reactions
in its joints and loops, as a page draws them.

They are those of statics. A drag moves a robot kinematically: its accelerations are those of a user's pointer, which no
controller would follow, so they say nothing about actuators. `cinegen.dynamics.trajectory` has the torques of motions.
Reactions take milliseconds, and are computed outside the session's loop.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import pinocchio as pin
from msgspec import Struct

from cinegen.arrays import Array
from cinegen.dynamics import InverseDynamics, Payload, Reaction
from cinegen.dynamics.reactions import reactions
from cinegen.errors import CinegenError
from cinegen.model import Mechanism
from cinegen.session.state import CarriedMass, RobotState
from cinegen.typed_json import Vector3

_BOUND = 1e3
"""Torques beyond the moment of so many times the whole weight at the characteristic length occur next to a type 2
singularity only: there no actuator holds the load."""

_NOISE = 1e-9  # J: the torques of a robot whose links weigh nothing
_ROUND = (1.0, 2.0, 5.0, 10.0)
_LIGHT = 0.1  # kg


class HoldingError(CinegenError):
    """Torques of a robot can't be computed; the message has the reason."""


def why_no_forces(mechanism: Mechanism) -> str:
    """Return the reason why no torques of a robot can be computed; empty if they can."""
    if mechanism.unphysical:
        link, why = next(iter(mechanism.unphysical.items()))
        return f"link '{link}' has an inertia that no body can have: {why}"
    if mechanism.massless:
        return f"no mass is given for {', '.join(mechanism.massless)}"
    if not mechanism.actuated:
        return "it has no actuated joints"
    for joint in mechanism.actuated:
        if mechanism.model.joints[mechanism.model.getJointId(joint)].nv != 1:
            return f"joint '{joint}' has more than one variable"
    return ""


def largest_payload(mechanism: Mechanism) -> float:
    """Return the largest mass (kg) that a page offers as payload: the mass of the robot's moving links, rounded up to
    1, 2 or 5 times a power of ten."""
    mass = max(_LIGHT, moving_mass(mechanism))
    power = 10.0 ** np.floor(np.log10(mass))
    return float(f"{next(factor for factor in _ROUND if factor * power >= mass * (1.0 - 1e-9)) * power:.3g}")


def moving_mass(mechanism: Mechanism) -> float:
    """Return the mass (kg) of the links that joints move."""
    return float(sum(mechanism.model.inertias[j].mass for j in range(1, mechanism.model.njoints)))


class Holding:
    """Torques that hold a robot. For one thread at a time.

    Args:
        mechanism: mechanism of the robot.

    Attributes:
        carried: payload: a point mass at the origin of a node.
        dynamics: with that payload, and gravity as the robot's base pose has it.

    Raises:
        HoldingError: see `why_no_forces`.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        problem = why_no_forces(mechanism)
        if problem:
            raise HoldingError(problem)
        self.carried = CarriedMass(mechanism.end, 0.0)
        self.dynamics = InverseDynamics(mechanism)
        self._down = mechanism.gravity
        self._mass = moving_mass(mechanism)

    def load(self, carried: CarriedMass, base: pin.SE3) -> None:
        """Set the payload, and the base pose in the world (m)."""
        down = base.rotation.T @ self.dynamics.mechanism.gravity
        if carried == self.carried and np.array_equal(down, self._down):
            return
        payloads = [Payload(carried.node, carried.mass)] if carried.mass else []
        self.dynamics.set_loads(payloads, down)
        self.carried, self._down = carried, down

    def torques(self, q: Array) -> Array:
        """Return the torques and forces (actuated,) at q (nq,), N m and N; NaN where none hold the load, or loops are
        open."""
        mechanism = self.dynamics.mechanism
        try:
            efforts = self.dynamics.torques(q)
        except CinegenError:  # a recording with open loops
            return np.full(len(mechanism.actuated), np.nan)
        weight = np.linalg.norm(self._down) * (self._mass + self.carried.mass)
        steps = self.dynamics.tree.step[[mechanism.v_index(joint) for joint in mechanism.actuated]]
        held = np.abs(efforts * steps).max(initial=0.0) <= _BOUND * weight * mechanism.length + _NOISE
        return efforts if held else np.full(len(efforts), np.nan)


_COMPONENTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


class ReactionReport(Struct, frozen=True):
    """Reaction of a joint or a loop on the node behind it.

    Attributes:
        name: name of the joint or loop.
        kind: joint or loop.
        node: node that it acts on.
        point: where it acts, in the frame of the node (m).
        force: in the world (N), without undetermined components; None if statics determines none of them.
        moment: its amount (N m), likewise.
        undetermined: components that statics does not determine, in the axes of the joint.
    """

    name: str
    kind: Literal["joint", "loop"]
    node: str
    point: Vector3
    force: Vector3 | None
    moment: float | None
    undetermined: tuple[str, ...]


class BearingReporter:
    """Reports on the reactions in a robot. For one thread at a time.

    Args:
        mechanism: mechanism of the robot.

    Raises:
        HoldingError: see `cinegen.session.holding.why_no_forces`.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._holding = Holding(mechanism)

    def report(self, robot: RobotState) -> tuple[ReactionReport, ...]:
        """Return the reactions of all joints, then of all loops; none where no torques hold the load.

        Args:
            robot: state of the robot.
        """
        if robot.carried is None or robot.torques is None or np.isnan(robot.torques).any():
            return ()
        self._holding.load(robot.carried, robot.base)
        dynamics, still = self._holding.dynamics, np.zeros(self.mechanism.model.nv)
        balance = dynamics.balance(robot.q, still, still)
        if not balance.is_held:
            return ()
        return tuple(self._described(robot, reaction) for reaction in reactions(dynamics.tree, balance))

    def _described(self, robot: RobotState, reaction: Reaction) -> ReactionReport:
        node = self.mechanism.placement(robot.q, reaction.body)
        known = np.isfinite(reaction.wrench)
        wrench = np.where(known, reaction.wrench, 0.0)
        force = robot.base.rotation @ reaction.placement.rotation @ wrench[:3]
        return ReactionReport(
            reaction.name,
            "loop" if reaction.kind == "loop" else "joint",
            reaction.body,
            _vector(node.actInv(reaction.placement.translation)),
            _vector(force) if known[:3].any() else None,
            float(np.linalg.norm(wrench[3:])) if known[3:].any() else None,
            tuple(name for name, is_known in zip(_COMPONENTS, known, strict=True) if not is_known),
        )


def _vector(values: Array) -> Vector3:
    x, y, z = (float(value) for value in values)
    return x, y, z
