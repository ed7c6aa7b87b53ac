"""`BearingReporter`: the reactions in the joints and loops of a robot at rest, as a page draws them.

They take milliseconds, and are computed outside the session's loop.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from msgspec import Struct

from cinegen.arrays import Array
from cinegen.dynamics import Reaction
from cinegen.dynamics.reactions import reactions
from cinegen.model import Mechanism
from cinegen.session.holding import Holding
from cinegen.session.state import RobotState
from cinegen.typed_json import Vector3

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
        return tuple(self._described(robot, one) for one in reactions(dynamics.tree, balance))

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
