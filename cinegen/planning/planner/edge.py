"""An edge: the simplest motion between two configurations, if nothing comes too near anywhere on it."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.collision.clearance import Clearance
from cinegen.errors import ClosureError
from cinegen.model import Mechanism
from cinegen.tolerances import CLOSURE

Array = NDArray[np.float64]

_FINEST = 1e-4  # rad or lengths: half a piece; what such short ones don't show to be clear, is not
_BEND = 5e-4  # rad or lengths: so far may closing the loops lead from the middle of a piece


def edge(clearance: Clearance, begin: Array, end: Array, safety: float) -> Array | None:
    """Goes from one configuration to another, joints straight; with loops, motors straight and the others after them.

    Clear all along, not at samples: at the middle of each piece of it all distances are measured, and are to be longer
    by the safety distance than anything can move from there to the ends of the piece; else the piece is halved (F.
    Schwarzer, M. Saha and J.-C. Latombe, "Exact collision checking of robot paths", 2004). Where it meets something,
    that is found first on long pieces.

    With loops, each middle is closed again with its motors held. A piece may be no longer than that closing bends it by
    `_BEND` at most, and what it does bend is added to how far things can move. So it does not lead over singularities
    where motors lose their hold, to another assembly mode: no piece of such a way gets so short.

    Args:
        clearance: of the mechanism.
        begin: (nq,) within all limits, loops closed.
        end: (nq,).
        safety: m.

    Returns:
        (n, nq) both ends and all middles, loops closed; joints go straight between these. None: something is too near,
        a joint would have to leave its limits, or loops can't be closed on the way.
    """
    mechanism = clearance.mechanism
    if not all(_stands(mechanism, q) and clearance.least(q) >= safety for q in (begin, end)):
        return None
    known = {0.0: begin, 1.0: end}  # by the part of the way
    pieces = deque([(0.0, 1.0)])
    while pieces:
        first, last = pieces.popleft()
        middle = _middle(mechanism, known[first], known[last])
        if middle is None or clearance.least(middle.q) < safety:
            return None
        known[part := (first + last) / 2.0] = middle.q
        distances, ways = clearance.bounds(middle.q, mechanism.integrate(middle.q, middle.reach))
        if middle.bend <= _BEND and (distances - ways >= safety).all():
            continue
        if float(np.abs(middle.reach / mechanism.scale).max(initial=0.0)) < _FINEST:
            return None
        pieces += [(first, part), (part, last)]
    return np.array([known[part] for part in sorted(known)])


class _Middle(NamedTuple):
    """Attributes:
    q: (nq,) the middle of a piece, loops closed.
    reach: (nv,) by how much joints differ from q at most, anywhere on the piece, rad and m.
    bend: how far closing the loops led from the straight way, rad or characteristic lengths.
    """

    q: Array
    reach: Array
    bend: float


def _middle(mechanism: Mechanism, begin: Array, end: Array) -> _Middle | None:
    """None where loops can't be closed, or only elsewhere, or beyond a limit."""
    straight = mechanism.interpolate(begin, end, 0.5)
    half = np.abs(mechanism.difference(straight, end))
    if not mechanism.loops:
        return _Middle(straight, half, 0.0)
    try:
        q = mechanism.close(straight, locked=_held(mechanism))
    except ClosureError:
        return None
    bent = np.abs(mechanism.difference(straight, q))
    bend = float((bent / mechanism.scale).max())
    if bend > float((half / mechanism.scale).max()) or not _stands(mechanism, q):
        return None
    # from where loops are closed back to the straight way, half of it, and as far again to where they are closed
    return _Middle(q, half + 2.0 * bent, bend)


def _held(mechanism: Mechanism) -> tuple[str, ...]:
    """Motors; none where there are more of them than loops leave freedoms, for they can't all be where one likes."""
    return mechanism.actuated if len(mechanism.actuated) <= mechanism.mobility else ()


def _stands(mechanism: Mechanism, q: Array) -> bool:
    """Whether a configuration is within all limits, loops closed."""
    return bool(mechanism.limits.within(q)) and mechanism.closure(q) <= CLOSURE
