"""One attempt to get to a goal, from step to step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.clearance import Clearance
from cinegen.collision.mesh_check import MeshCheck
from cinegen.ik import Solver
from cinegen.ik.objectives import Objective
from cinegen.planning.keep import Keep
from cinegen.planning.planner.status import PlanStatus

Array = NDArray[np.float64]

_REST = 1e-5  # rad or lengths in a step: less is no motion
_STILL = 6  # steps without motion, and it is stuck
_PATIENCE = 300  # steps in which it comes no nearer to the goal than it was
_NEARER = 1e-4  # rad or lengths, that count as nearer
_AGAINST = 1e-3  # rad or lengths from a limit: the joint stands on it


@dataclass(frozen=True, eq=False)
class Attempt:
    """What one attempt came to.

    Attributes:
        words: what led it.
        status: REACHED, IN_COLLISION, STUCK, CIRCLED, JOINT_LIMIT or STEP_LIMIT.
        path: (steps + 1, nq) where it went, the start first.
        held_by: pairs of bodies that held the last step back, by name, nearest first.
        reason: the end, in words.
    """

    words: str
    status: PlanStatus
    path: Array
    held_by: tuple[tuple[str, str], ...]
    reason: str


def attempt(
    clearance: Clearance,
    start: Array,
    lead: Objective,
    left: Callable[[Array], float],
    arrived: Callable[[Array], bool],
    safety: float,
    most: int,
    words: str,
    pushed: bool = False,
) -> Attempt:
    """Follows what leads until it arrives, or gets no nearer. Never nearer than the safety distance to anything.

    Args:
        clearance: of the mechanism.
        start: (nq,) loops closed.
        lead: how the joints should move, for the goal's sake and around obstacles.
        left: how far it is to the goal.
        arrived: whether that will do.
        safety: m.
        most: steps.
        words: what leads, in words.
        pushed: whether a field pushes the mechanism away from obstacles.
    """
    mechanism = clearance.mechanism
    solver = Solver(mechanism, 1.0, start)
    keep = Keep(clearance, safety)
    solver.barriers, solver.objectives = (keep,), (lead,)
    path, nearest, since, still = [solver.q], np.inf, 0, 0

    def ended(status: PlanStatus, reason: str) -> Attempt:
        return Attempt(words, status, np.array(path), _held_by(clearance, keep, path[-1]), reason)

    while not arrived(path[-1]):
        if len(path) > most:
            return ended(PlanStatus.STEP_LIMIT, f"{most} steps did not suffice")
        path.append(solver.step().q)
        still = still + 1 if mechanism.distance(path[-2], path[-1]) < _REST else 0
        distance = left(path[-1])
        since = 0 if distance < nearest - _NEARER else since + 1
        nearest = min(nearest, distance)
        if still == _STILL:
            return ended(*_why(clearance, keep, path[-1], pushed))
        if since == _PATIENCE:
            return ended(PlanStatus.CIRCLED, f"moved on for {_PATIENCE} steps and came no nearer to the goal")
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


def _held_by(clearance: Clearance, keep: Keep, q: Array) -> tuple[tuple[str, str], ...]:
    distances = clearance.distances(q)
    near = [int(pair) for pair in np.argsort(distances) if distances[pair] < 1.5 * keep.stop]
    return tuple(clearance.names(pair) for pair in near)


def _why(clearance: Clearance, keep: Keep, q: Array, pushed: bool) -> tuple[PlanStatus, str]:
    """Why nothing moves any more; whether a field pushed."""
    held, limits = _held_by(clearance, keep, q), _limits(clearance, q)
    at_limits = f"{', '.join(limits)} at the limit" if limits else ""
    if held:
        pairs = " and ".join(f"'{one}' against '{other}'" for one, other in held)
        return PlanStatus.STUCK, f"led into what it must keep clear of: {pairs}" + (f"; {at_limits}" if limits else "")
    if limits:
        return PlanStatus.JOINT_LIMIT, at_limits
    distances = clearance.distances(q)
    if pushed and len(distances):
        one, other = clearance.names(int(distances.argmin()))
        apart = f"'{one}' is {1e3 * float(distances.min()):.3g} mm from '{other}'"
        return PlanStatus.STUCK, f"what tasks to the goal and what pushes away balance: {apart}"
    return PlanStatus.STUCK, "nothing leads on: singular, or as near to the goal as that way leads"


def _limits(clearance: Clearance, q: Array) -> list[str]:
    """Joints that stand on a limit."""
    mechanism, found = clearance.mechanism, []
    for name, limits in mechanism.limits.items():
        value, near = q[mechanism.q_index(name)], _AGAINST * mechanism.scale[mechanism.v_index(name)]
        if not limits.lower + near <= value <= limits.upper - near:
            found.append(name)
    return found
