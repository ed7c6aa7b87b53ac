"""Motions that keep the safety distance everywhere, not at samples only."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cinegen.arrays import Array
from cinegen.collision.clearance import Clearance
from cinegen.errors import ClosureError
from cinegen.model import Mechanism
from cinegen.planning.path_constraints import Projection
from cinegen.singularities.crossing import passes_type_2
from cinegen.tolerances import CLOSURE

_SHORTEST = 1e-4  # rad or characteristic lengths: half of a segment that is not divided any more
_SHORTEST_PART = 1e-9  # of a motion, that is not divided any more: joints jump there, however short it is
_LONGEST = 0.05  # rad or characteristic lengths: half of a segment that is divided where constraints are kept
_MOST_CURVATURE = 5e-4  # rad or characteristic lengths: how far closing the loops may move the middle of a segment


def clear_motion(
    clearance: Clearance,
    begin: Array,
    end: Array,
    safety: float,
    straight: Sequence[str] | None = None,
    project: Projection | None = None,
) -> Array | None:
    """Return the simplest motion between two configurations that keeps the safety distance: joints straight; with
    loops, actuated joints straight, and the others by closing the loops.

    It is clear everywhere, not at samples: at the middle of each segment all distances must exceed the safety distance
    by more than anything can move from there to the ends of the segment; else the segment is halved, for the pairs of
    bodies that are left (F. Schwarzer, M. Saha and J.-C. Latombe, "Exact collision checking of robot paths", 2004).
    Collisions are found early: the end is tested first, then long segments.

    With loops, each middle is closed with its actuated joints locked. Closing must not move it by more than
    `_MOST_CURVATURE`, and twice that motion is added to how far things can move: an estimate, no bound, of how far the
    closed loops lead from the straight motion. A motion that may pass a singularity of type 2 is refused
    (`passes_type_2`).

    Args:
        clearance: distances of the mechanism.
        begin: (nq,) configuration within all limits, loops closed.
        end: (nq,) configuration.
        safety: safety distance, m.
        straight: with loops, joints that move straight; by default the actuated ones. If they don't determine the
            others, all joints move as near to straight as the loops allow, and may pass a singularity of type 2, where
            actuated joints reverse.
        project: with constraints along the path, the projection onto them, loops closed; both ends satisfy them.

    Returns:
        both ends and all middles (n, nq), loops closed, joints straight in between. None if something is too near, a
        joint would leave its limits, loops can't be closed, or a singularity of type 2 would be passed.
    """
    mechanism = clearance.mechanism
    at_rest = np.zeros(mechanism.model.nv)
    if not _is_valid(mechanism, end):
        return None
    if clearance.uncertain(end, at_rest, safety, clearance.every_pair) is None:  # what is proved below covers both ends
        return None
    known = {0.0: begin, 1.0: end}  # by the part of the motion
    segments = deque([(0.0, 1.0, clearance.every_pair)])
    while segments:
        first, last, pairs = segments.popleft()
        middle = _middle(mechanism, known[first], known[last], straight, project)
        left = None if middle is None else clearance.uncertain(middle.q, middle.reach, safety, pairs, middle.half)
        if middle is None or left is None:
            return None
        known[part := (first + last) / 2.0] = middle.q
        size = float(np.abs(middle.half / mechanism.scale).max(initial=0.0))
        if middle.curvature > _MOST_CURVATURE:
            left = pairs  # nothing is known of the ends yet
        elif not len(left) and (project is None or size < _LONGEST):
            continue
        if last - first < _SHORTEST_PART:
            return None
        if float(np.abs(middle.reach / mechanism.scale).max(initial=0.0)) < _SHORTEST:
            return None
        segments += [(first, part, left), (part, last, left)]
    motion = np.array([known[part] for part in sorted(known)])
    return None if straight is None and passes_type_2(mechanism, motion) else motion


class _Middle(NamedTuple):
    """Attributes:
    q: (nq,) middle of a segment, loops closed.
    half: (nv,) motion from the middle of the straight segment to its end, rad and m.
    reach: (nv,) largest difference of each joint from q anywhere on the segment, rad and m.
    curvature: distance by which closing the loops moved the middle, rad or characteristic lengths.
    """

    q: Array
    half: Array
    reach: Array
    curvature: float


def _middle(
    mechanism: Mechanism, begin: Array, end: Array, locked: Sequence[str] | None, project: Projection | None
) -> _Middle | None:
    """Return the middle; None if loops can't be closed or constraints satisfied, or only far away or beyond a limit."""
    straight = mechanism.interpolate(begin, end, 0.5)
    half = mechanism.difference(straight, end)
    reach = np.abs(half)
    if project is None and not mechanism.is_constrained:
        return _Middle(straight, half, reach, 0.0)
    if locked is None:  # more actuated joints than DoF can't all be chosen
        locked = mechanism.actuated if len(mechanism.actuated) <= mechanism.mobility else ()
    try:
        q = mechanism.close(straight, locked=locked) if project is None else project(straight)
    except ClosureError:
        return None
    if q is None:
        return None
    moved = np.abs(mechanism.difference(straight, q))
    curvature = float((moved / mechanism.scale).max())
    if curvature > float((reach / mechanism.scale).max()) or not mechanism.limits.within(q):
        return None
    # from closed loops back to the straight motion, half of it, and as far again to closed loops
    return _Middle(q, half, reach + 2.0 * moved, curvature)


def _is_valid(mechanism: Mechanism, q: Array) -> bool:
    """Return whether a configuration is within all limits, loops closed."""
    return bool(mechanism.limits.within(q)) and (not mechanism.is_constrained or mechanism.closure(q) <= CLOSURE)
