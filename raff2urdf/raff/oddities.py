"""Warnings about a document: valid input that is probably not intended."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from raff2urdf.errors import Problem, duplicates, first_on
from raff2urdf.quantities import typed_in_radians
from raff2urdf.raff.compound import VARIABLES
from raff2urdf.raff.document import OF_JOINT, CompoundKind, Document, JointType, RaffLink, RaffNode, RaffRobot
from raff2urdf.raff.sizes import LARGEST, label, longest, sizes
from raff2urdf.raff.writer import number as shown
from raff2urdf.tree import stated_inertia


def oddities(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    """Yield warnings: valid input that is probably not intended."""
    problem = document.problem
    size, longest_node = longest(robot)
    if document.metres(size) > LONGEST and document.units == "m":
        what = f"the longest length of robot '{robot.name}' is {shown(size)} m"
        why = f"{what}: if lengths are in mm, write 'units mm' for 'units m'"
        yield problem(why, longest_node, "parameters")
    for first, loop in duplicates(robot.loops, lambda loop: (*sorted((loop.first, loop.second)), loop.kind)):
        why = f"this loop was declared before{first_on(first.line('first'))}: remove one of them"
        yield problem(why, loop, "first")
    for node in (robot.base, *robot.parts):
        yield from _angles_in_radians(document, node)
        yield from _moments_in_metres(document, node, document.metres(size))
        if node.inertial is not None and all(size <= LARGEST for _, size in sizes(document, node.inertial)):
            unphysical = stated_inertia(document, node.inertial).why_unphysical()
            why = f"no body can have the inertia of {label(node)}: {unphysical}; no forces can be computed"
            yield from [problem(why, node.inertial, "moments", "inertial")] if unphysical is not None else []
    for link in robot.links:
        yield from _variables_outside_limits(document, link)
        yield from _useless_efforts(document, link)
        yield from _odd_joint(document, link)


def _odd_joint(document: Document, link: RaffLink) -> Iterator[Problem]:
    """Yield warnings about what a link without a joint has, and about limits that home exceeds or that are radians."""
    if link.type is JointType.FIXED and not link.compound:
        for word in OF_JOINT:
            if getattr(link, word):
                yield document.problem(f"link {link.number} is fixed, so '{word}' has no effect: remove it", link, word)
    elif link.limits:
        what = f"link {link.number}"
        home = link.parameters.theta if link.type is JointType.REVOLUTE else link.parameters.r
        degrees = _degrees(link) if link.type is JointType.REVOLUTE else None
        if not link.limits[0] <= home <= link.limits[1]:
            yield document.problem(_outside(what, home, link.limits, degrees), link, "limits")
        elif degrees is not None:
            listed = " ".join(degrees)
            why = f"the limits of {what} are {listed} degrees if they are in radians: angles are in degrees, write "
            yield document.problem(f"{why}'limits {{ {listed} }}'", link, "limits")


LONGEST = 100.0
"""Longest length, m, above which a file in metres probably is one in mm."""


def _angles_in_radians(document: Document, node: RaffNode) -> Iterator[Problem]:
    """Yield a warning for each angle that is a part of pi, with four digits at least."""
    for word in ("alpha", "gamma", "theta"):
        value = getattr(node.parameters, word)
        written = shown(value).lstrip("-")
        parts = [] if len(written.strip("0").replace(".", "")) < 4 else [30, 45, 60, 90, 120, 135, 150, 180, 270]
        for part in parts:
            digits = len(written.partition(".")[2])
            if abs(value) < math.tau and round(math.radians(part), digits) == abs(value):
                signed = shown(math.copysign(part, value))
                what = f"'{word} {shown(value)}' of {label(node)} is {signed} degrees in radians"
                why = f"{what}: angles are in degrees, write '{word} {signed}'"
                yield document.problem(why, node, "parameters")


def _degrees(link: RaffLink) -> list[str] | None:
    """Return the limits of a revolute link in degrees, if they are probably in radians."""
    degrees = typed_in_radians(link.limits or ())
    return None if degrees is None else list(map(shown, degrees))


def _moments_in_metres(document: Document, node: RaffNode, size: float) -> Iterator[Problem]:
    """Yield a warning if moments of inertia are those of a body that is a thousandth of the robot, of `size` m."""
    inertial = node.inertial
    if inertial is None or document.units == "m" or not inertial.mass or max(inertial.moments) <= 0.0:
        return
    radius = document.metres(math.sqrt(max(inertial.moments) / inertial.mass))
    if 0.01 * size < 1e3 * radius < size:
        factor = document.metres(1.0) ** -2
        moments = " ".join(f"{factor * moment:.6g}" for moment in inertial.moments)
        why = (
            f"the moments of {label(node)} are those of a body of {1000.0 * radius:.2g} mm: if they are in "
            f"kg m2, write 'moments {{ {moments} }}'"
        )
        yield document.problem(why, inertial, "moments")


def _useless_efforts(document: Document, link: RaffLink) -> Iterator[Problem]:
    ball = link.compound is CompoundKind.BALL
    for what, of in [(f"link {link.number}", link)] + [
        (f"variable {variable.name} of link {link.number}", variable) for variable in link.variables
    ]:
        if of.effort is not None and (of.actuated is False or (ball and not of.actuated)):
            why = f"the joint of {what} is passive, so 'effort' has no effect: remove it, or write 'actuated 1'"
            yield document.problem(why, of, "effort")


def _variables_outside_limits(document: Document, link: RaffLink) -> Iterator[Problem]:
    for variable in link.variables:
        word = VARIABLES[link.compound][variable.name] if link.compound else None
        home = getattr(link.parameters, word) if word else variable.home
        if variable.limits and not variable.limits[0] <= home <= variable.limits[1]:
            message = _outside(f"variable {variable.name} of link {link.number}", home, variable.limits)
            yield document.problem(message, variable, "limits")


def _outside(what: str, home: float, limits: tuple[float, float], degrees: Sequence[str] | None = None) -> str:
    low, high = map(shown, limits)
    hint = f"; if these are radians, write 'limits {{ {degrees[0]} {degrees[1]} }}'" if degrees else ""
    return f"home {shown(home)} of {what} is outside its limits {low} to {high}: change either{hint}"
