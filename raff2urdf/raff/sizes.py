"""Sizes of a document's numbers: what is too large for computations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from raff2urdf.errors import Problem, RaffError
from raff2urdf.raff.compound import expanded
from raff2urdf.raff.document import Document, RaffInertial, RaffNode, RaffRobot
from raff2urdf.tree import coupling_of, joint_dynamics

LARGEST = 1e12
"""Largest length, m: its square, times the number of links, must stay finite and keep enough digits."""

SMALLEST = 1.0 / LARGEST
"""The largest coefficient of a joint in a coupling is no smaller, rad and m."""


def longest(robot: RaffRobot) -> tuple[float, RaffNode]:
    """Return the longest length among the parameters of a robot, in the file's unit, and its node."""
    nodes = (robot.base, *robot.parts)
    return max(((max(map(abs, node.parameters.lengths)), node) for node in nodes), key=lambda pair: pair[0])


def check_sizes(document: Document, robot: RaffRobot) -> None:
    """Check that no length, mass, moment of inertia, number of a joint's friction and coefficient of a coupling is too
    large for computations.

    Raises:
        RaffError: with every problem.
    """
    raise_problems(_too_large(document, robot))


def _too_large(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.problem
    if document.gravity is not None and not max(map(abs, document.gravity)) <= LARGEST:
        yield problem(f"a number of 'gravity' is beyond {LARGEST:g} m/s2, the largest")
    for node in (robot.base, *robot.parts):
        lengths = {word: abs(document.metres(getattr(node.parameters, word))) for word in ("r", "d", "epsilon")}
        for word in (word for word, length in lengths.items() if not length <= LARGEST):
            yield problem(f"{word} of {label(node)} is beyond {LARGEST:g} m, the largest length", node, "parameters")
        for word, largest in sizes(document, node.inertial) if node.inertial is not None else ():
            if not largest <= LARGEST:
                at = (node.inertial, word, "inertial")
                why = f"'{word}' of the inertial of {label(node)} is beyond {LARGEST:g} in SI units, the largest"
                yield problem(why, *at)
    for link in expanded(robot).links:
        for word, value in joint_dynamics(document, link)._asdict().items():
            if not value <= LARGEST:
                yield problem(f"the {word} of {link.joint} is beyond {LARGEST:g} in SI units, the largest", link, word)
    yield from _large_couplings(document, robot)


def _large_couplings(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    """Yield a problem for each coefficient and constant of a coupling that is too large, or too small."""
    problem = document.problem
    for i, coupling in enumerate(robot.couplings):
        equation, follower = coupling_of(document, robot, i), coupling.follower
        terms = list(equation.terms.values())[1:]
        for j, (drive, coefficients) in enumerate(zip(coupling.drives, terms, strict=True)):
            if not SMALLEST <= max(map(abs, coefficients)) <= LARGEST:
                what = f"what link {drive.link} adds to link {follower}"
                why = f"{what} has coefficients beyond {LARGEST:g} in SI units, or all below {SMALLEST:g}"
                yield problem(why, coupling, f"drive {j}")
        if not abs(equation.constant) <= LARGEST:
            why = f"the 'offset' of link {follower} in a coupling is beyond {LARGEST:g} in SI units, the largest"
            yield problem(why, coupling, "offset")


def label(node: RaffNode) -> str:
    """Return a node as errors name it."""
    return f"{node.keyword} {node.number}" if node.number else "the base"


def sizes(document: Document, inertial: RaffInertial) -> Iterator[tuple[str, float]]:
    """Yield the largest number of each statement in SI units."""
    for word in ("mass", "density"):
        yield word, abs(getattr(inertial, word) or 0.0)
    yield "radius", document.metres(abs(inertial.radius or 0.0))
    yield "centre", document.metres(max(map(abs, inertial.centre)))
    for word in ("moments", "products"):
        yield word, document.metres(document.metres(max(map(abs, getattr(inertial, word)))))


def raise_problems(problems: Iterable[Problem]) -> None:
    """Raise all problems, if there are any.

    Raises:
        RaffError: with every problem.
    """
    if listed := list(problems):
        raise RaffError(listed)
