"""The lines of a parallel manipulator's legs: along its rods, or its jacks, from the base to the platform."""

from __future__ import annotations

import weakref
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cinegen.assembly.families import Rod, recognise
from cinegen.assembly.linkage import Linkage, ModesError
from cinegen.model import Mechanism
from cinegen.singularities.lines import Line

Array = NDArray[np.float64]


class Ends(NamedTuple):
    """Of a leg: which joint its centre goes with, and where it is there (m)."""

    joint: int
    local: Array


class Legs(NamedTuple):
    """Legs that hold a platform by forces along their lines, in the order of their motors.

    Attributes:
        ends: of each leg, on the base and on the platform.
        flat: whether they all stay in a plane.
    """

    ends: tuple[tuple[Ends, Ends], ...]
    flat: bool


_KNOWN: weakref.WeakKeyDictionary[Mechanism, Legs | None] = weakref.WeakKeyDictionary()


def legs_of(mechanism: Mechanism) -> Legs | None:
    """The legs of a mechanism whose platform stands on rods; None where it does not."""
    if mechanism not in _KNOWN:
        _KNOWN[mechanism] = _found(mechanism)
    return _KNOWN[mechanism]


def leg_lines(mechanism: Mechanism, q: Array) -> tuple[Line, ...]:
    """The lines along the legs that hold the platform, in the order of their motors, in the world, m.

    Args:
        mechanism: with six rods between base and platform, or a platform on three bars in a plane.
        q: (nq,) loops closed.

    Returns:
        none where the mechanism belongs to neither family.
    """
    legs = legs_of(mechanism)
    if legs is None:
        return ()
    mechanism.system.evaluate(mechanism.checked(q))
    placements = mechanism.system.data.oMi
    return tuple(Line.through(*(placements[end.joint].act(end.local) for end in pair)) for pair in legs.ends)


def _found(mechanism: Mechanism) -> Legs | None:
    try:
        linkage = Linkage(mechanism)
    except ModesError:
        return None
    family = recognise(linkage)
    if family is None or family.name not in ("hexapod", "triad"):
        return None
    if family.name == "triad" and family.bound != 6:
        return None
    ends = tuple((_end(linkage, rod, 0), _end(linkage, rod, 1)) for rod in family.rods)
    return Legs(ends, family.name == "triad")


def _end(linkage: Linkage, rod: Rod, side: int) -> Ends:
    """The rod's own point of one of its ends."""
    bodies, centre = linkage.bodies, rod.ends[side]
    carrier = centre.joints[0].carrier
    local = bodies.local(carrier, centre.at) * linkage.mechanism.length
    return Ends(carrier + linkage.root, local)
