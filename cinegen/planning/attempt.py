"""One attempt to reach a goal, step by step, and its status."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance
from cinegen.collision.mesh_check import MeshCheck
from cinegen.ik import Solver
from cinegen.ik.objectives import Objective
from cinegen.planning.clearance_barrier import ClearanceBarrier
from cinegen.singularities.crossing import passes_type_2
from raff2urdf.quantities import LENGTH, shown

_REST = 1e-5  # rad or characteristic lengths in a step: less is no motion
_STILL = 6  # steps without motion end an attempt
_PATIENCE = 300  # steps without progress end an attempt
_PROGRESS = 1e-4  # rad or characteristic lengths nearer to the goal
_AT_LIMIT = 1e-3  # rad or characteristic lengths from a limit


class PlanStatus(Enum):
    """Status of a plan, or of one attempt."""

    REACHED = "reached"
    IN_COLLISION = "in collision"
    STUCK = "stuck"
    CIRCLED = "circled"
    START_IN_COLLISION = "start in collision"
    GOAL_IN_COLLISION = "goal in collision"
    OUT_OF_REACH = "goal out of reach"
    JOINT_LIMIT = "joint limit"
    SINGULARITY = "singularity"
    STEP_LIMIT = "step limit"
    TIME_LIMIT = "time limit"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, eq=False, repr=False)
class Attempt:
    """Result of one attempt.

    Attributes:
        strategy: what was followed.
        status: REACHED, IN_COLLISION, STUCK, CIRCLED, JOINT_LIMIT, SINGULARITY, STEP_LIMIT, TIME_LIMIT or
            INTERRUPTED.
        path: (steps + 1, nq) configurations, the start first.
        blocked_by: names of the pairs of bodies that restricted the last step, nearest first.
        reason: why the attempt ended.
    """

    strategy: str
    status: PlanStatus
    path: Array
    blocked_by: tuple[tuple[str, str], ...]
    reason: str

    def __repr__(self) -> str:
        return f"<Attempt {self.status.name} after {len(self.path) - 1} steps: {self.strategy}>"


def attempt(
    clearance: Clearance,
    start: Array,
    objective: Objective,
    remaining: Callable[[Array], float],
    arrived: Callable[[Array], bool],
    safety: float,
    most: int,
    strategy: str,
    repelled: bool = False,
    deadline: float = math.inf,
    interrupted: Callable[[], bool] = lambda: False,
) -> Attempt:
    """Follow an objective until it arrives, makes no progress, or would pass a singularity of type 2. The safety
    distance is kept everywhere.

    Args:
        clearance: distances of the mechanism.
        start: (nq,) start configuration, loops closed.
        objective: motion to the goal, around obstacles.
        remaining: distance of a configuration from the goal.
        arrived: whether a configuration is at the goal.
        safety: safety distance, m.
        most: largest number of steps.
        strategy: description for reports.
        repelled: whether the objective contains a repulsion.
        deadline: value of `time.monotonic` at which the attempt ends, s.
        interrupted: asked before each step: whether the attempt ends because another planner has reached the goal.
    """
    mechanism = clearance.mechanism
    solver = Solver(mechanism, 1.0, start)
    barrier = ClearanceBarrier(clearance, safety, approach=math.log(2.0))  # half of the remaining distance in a step
    solver.barriers, solver.objectives = (barrier,), (objective,)
    path, nearest, since, still = [solver.q], np.inf, 0, 0

    def ended(status: PlanStatus, reason: str) -> Attempt:
        return Attempt(strategy, status, np.array(path), _blocked_by(clearance, barrier, path[-1]), reason)

    while not arrived(path[-1]):
        if len(path) > most:
            return ended(PlanStatus.STEP_LIMIT, f"the goal is not reached in {most} steps")
        if time.monotonic() >= deadline:
            return ended(PlanStatus.TIME_LIMIT, f"the goal is not reached in {len(path) - 1} steps")
        if interrupted():
            return ended(PlanStatus.INTERRUPTED, f"another planner reached the goal after {len(path) - 1} steps")
        path.append(solver.step().q)
        if passes_type_2(mechanism, np.array(path[-2:])):
            path.pop()
            return ended(PlanStatus.SINGULARITY, "a singularity of type 2, beyond which actuated joints don't lead")
        still = still + 1 if mechanism.distance(path[-2], path[-1]) < _REST else 0
        distance = remaining(path[-1])
        since = 0 if distance < nearest - _PROGRESS else since + 1
        nearest = min(nearest, distance)
        if still == _STILL:
            return ended(*_why_stopped(clearance, barrier, path[-1], repelled))
        if since == _PATIENCE:
            return ended(PlanStatus.CIRCLED, f"moved for {_PATIENCE} steps without coming nearer to the goal")
    return ended(PlanStatus.REACHED, "")


def checked(made: Attempt, check: MeshCheck) -> Attempt:
    """Check the path of an attempt against the meshes.

    Returns:
        the attempt as it is where nothing touches on its path; else one that is IN_COLLISION, its path cut off before
        the contact.
    """
    contact = check.first_contact(made.path)
    if contact is None:
        return made
    where = "at the start" if contact.index < 0 else f"between steps {contact.index} and {contact.index + 1}"
    reason = f"the check against the meshes found contact {where}: {contact.reason}"
    return replace(made, status=PlanStatus.IN_COLLISION, path=made.path[: max(contact.index, 0) + 1], reason=reason)


def _blocked_by(clearance: Clearance, barrier: ClearanceBarrier, q: Array) -> tuple[tuple[str, str], ...]:
    distances = clearance.distances(q)
    near = [int(pair) for pair in np.argsort(distances) if distances[pair] < 1.5 * barrier.stop]
    return tuple(clearance.names(pair) for pair in near)


def _why_stopped(clearance: Clearance, barrier: ClearanceBarrier, q: Array, repelled: bool) -> tuple[PlanStatus, str]:
    """Return why the motion stopped."""
    mechanism = clearance.mechanism
    blocked, limits = _blocked_by(clearance, barrier, q), []
    for name, (lower, upper, *_) in mechanism.limits.items():
        value, near = q[mechanism.q_index(name)], _AT_LIMIT * mechanism.scale[mechanism.v_index(name)]
        if lower < upper and not lower + near <= value <= upper - near:
            limits.append(name)
    at_limits = f"{', '.join(limits)} at the limit" if limits else ""
    if blocked:
        pairs = " and ".join(f"'{link}' near '{other}'" for link, other in blocked)
        return PlanStatus.STUCK, f"blocked at the safety distance: {pairs}" + (f"; {at_limits}" if limits else "")
    if limits:
        return PlanStatus.JOINT_LIMIT, at_limits
    distances = clearance.distances(q)
    if repelled and len(distances):
        link, other = clearance.names(int(distances.argmin()))
        near = f"'{link}' is {shown(float(distances.min()), LENGTH, 3)} from '{other}'"
        return PlanStatus.STUCK, f"local minimum: attraction and repulsion cancel; {near}"
    return PlanStatus.STUCK, "singular, or as near to the goal as this strategy comes"
