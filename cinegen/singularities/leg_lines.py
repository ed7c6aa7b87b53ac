"""The lines of a parallel manipulator's legs: along its rods, or its actuators, from the base to the platform."""

from __future__ import annotations

from typing import NamedTuple

from cinegen.arrays import Array
from cinegen.assembly.families import Rod, recognise
from cinegen.assembly.linkage import Linkage
from cinegen.model import Mechanism
from cinegen.singularities.ball_joints import linkage_of
from cinegen.singularities.pluecker import PlueckerLine


class LegEnd(NamedTuple):
    """An end of a leg: the joint that moves its centre, and where it is in that joint's frame (m)."""

    joint: int
    local: Array


def leg_lines(mechanism: Mechanism, q: Array) -> tuple[PlueckerLine, ...]:
    """Return the lines along the legs that support the platform, in the order of their actuated joints; world, m.

    Args:
        mechanism: with six rods between base and platform, or a platform on three bars in a plane.
        q: (nq,) loops closed.

    Returns:
        none if the mechanism belongs to neither family.
    """
    q = mechanism.structure.checked(q)
    if mechanism.spherical is not None:
        return leg_lines(mechanism.successive, mechanism.spherical.to_successive(q))
    legs = mechanism.structure.derived(_legs)
    mechanism.structure.system.evaluate(q)
    placements = mechanism.structure.system.data.oMi
    return tuple(PlueckerLine.through(*(placements[end.joint].act(end.local) for end in leg)) for leg in legs)


def _legs(mechanism: Mechanism) -> tuple[tuple[LegEnd, LegEnd], ...]:
    """Return the ends of each leg, on the base and on the platform."""
    linkage = linkage_of(mechanism)
    if linkage is None:
        return ()
    family = recognise(linkage)
    if family is None or (family.name, family.bound) not in (("hexapod", 40), ("triad", 6)):
        return ()
    return tuple((_end(linkage, rod, 0), _end(linkage, rod, 1)) for rod in family.rods)


def _end(linkage: Linkage, rod: Rod, side: int) -> LegEnd:
    centre = rod.ends[side]
    carrier = centre.joints[0].carrier
    local = linkage.bodies.placements[carrier].actInv(centre.at) * linkage.mechanism.length
    return LegEnd(carrier + linkage.root, local)
