"""What the grammar can't say: unknown fathers, cycles, duplicates, empty limits, names, constraints on nothing.

`check_tree` judges what a document must hold to be a document at all. `check` also wants every constraint to
name nodes and sensors that exist: an excerpt (figure 5 of the paper is one) may be read, but not converted.
`check_sizes` is for those who compute with the lengths.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator

from raff2urdf.document import Document, JointType, RaffFrame, RaffLink, RaffNode, RaffRobot
from raff2urdf.errors import Problem, RaffError, RaffWarning, SourceLocation, did_you_mean

# XML 1.0 (fifth edition), production [5] Name, without the colon, which belongs to namespaces.
_START = (
    "A-Z_a-z\xc0-\xd6\xd8-\xf6\xf8-\u02ff\u0370-\u037d\u037f-\u1fff\u200c-\u200d\u2070-\u218f\u2c00-\u2fef"
    "\u3001-\ud7ff\uf900-\ufdcf\ufdf0-\ufffd\U00010000-\U000effff"
)
_XML_NAME = f"[{_START}][{_START}\\-.0-9\xb7\u0300-\u036f\u203f-\u2040]*"
_ASCII_NAME = "[A-Za-z_][A-Za-z0-9_.-]*"  # the same; the long one takes 8 ms to compile


def is_xml_name(name: str) -> bool:
    """Whether a URDF can bear this name."""
    return re.fullmatch(_ASCII_NAME if name.isascii() else _XML_NAME, name) is not None


LARGEST = 1e12
"""m: no length may be greater; its square must leave room for the rest."""

RESERVED = {"base": "the root", "world": "what the base stands in", "universe": "Pinocchio's root"}


def check_tree(document: Document) -> None:
    """Raises RaffError with every problem of names, numbers, fathers and limits."""
    _raise(document, [problem for robot in document.robots for problem in _tree_problems(document, robot)])


def check(document: Document) -> None:
    """Raises RaffError with every problem; what is odd but clear is a `RaffWarning`."""
    problems = [] if document.robots else [document.source.problem("the file holds no robot")]
    for robot in document.robots:
        problems += _tree_problems(document, robot)
        problems += _constraint_problems(document, robot)
    _raise(document, problems)
    for robot in document.robots:
        _warn(document, robot)


def check_sizes(document: Document, robot: RaffRobot) -> None:
    """Raises RaffError where a length is too great to compute with."""
    problems = list(_size_problems(document, robot))
    if problems:
        raise RaffError(problems)


def _raise(document: Document, problems: list[Problem]) -> None:
    problems = [*_file_problems(document), *problems]
    if problems:
        raise RaffError(sorted(problems, key=lambda p: (p.place.line, p.place.column) if p.place else (0, 0)))


def _file_problems(document: Document) -> Iterator[Problem]:
    problem = document.source.problem
    seen: dict[str, SourceLocation | None] = {}
    for robot in document.robots:
        place = robot.places.get("name")
        if robot.name in seen:
            yield problem(f"a second robot '{robot.name}'{_first(seen[robot.name])}", place)
        elif not is_xml_name(robot.name):
            yield problem(_no_name(robot.name, "robot"), place)
        seen[robot.name] = place
    numbers: dict[int, SourceLocation | None] = {}
    for sensor in document.sensors:
        place = sensor.places.get("number")
        if sensor.number in numbers:
            yield problem(f"a second sensor {sensor.number}{_first(numbers[sensor.number])}", place)
        numbers[sensor.number] = place


def _tree_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.source.problem
    numbers: dict[int, RaffLink | RaffFrame] = {}
    for part in robot.parts:
        place = part.places.get("number")
        if part.number in numbers:
            twin = numbers[part.number]
            yield problem(f"a second {_kind(part)} {part.number}{_first(twin.places.get('number'))}", place)
        else:
            numbers[part.number] = part
    names: dict[str, RaffLink | RaffFrame] = {}
    for part in robot.parts:
        place = part.places.get("name") or part.places.get("number")
        if part.node in RESERVED:
            yield problem(f"the name '{part.node}' is taken: it means {RESERVED[part.node]}", place)
        elif not is_xml_name(part.node):
            yield problem(_no_name(part.node, _kind(part)), place)
        elif part.node in names and numbers[part.number] is part:
            twin = names[part.node]
            yield problem(f"the name '{part.node}' is taken by {_kind(twin)} {twin.number}", place)
        names.setdefault(part.node, part)
    for part in robot.parts:
        if part.pred != 0 and part.pred not in numbers:
            known = ["0 (the base)", *map(str, numbers)]
            yield problem(
                f"{_kind(part)} {part.number} stands on {part.pred}, which does not exist{did_you_mean('', known)}",
                part.places.get("pred"),
            )
    yield from _cycles(document, robot, numbers)
    for link in robot.links:
        if link.limits and not link.limits[0] <= link.limits[1]:
            low, high = link.limits
            message = f"the limits of link {link.number} are empty: low {low:g} is above high {high:g}"
            yield problem(message, link.places.get("limits"))
        if link.velocity is not None and not link.velocity > 0:
            message = f"the velocity limit of link {link.number} must be above 0"
            yield problem(message, link.places.get("velocity"))


def _cycles(document: Document, robot: RaffRobot, numbers: dict[int, RaffLink | RaffFrame]) -> Iterator[Problem]:
    """One problem for each ring of fathers (linear: every node is walked over once)."""
    state: dict[int, int] = {0: -1}  # number -> the walk that met it
    for walk, start in enumerate(numbers):
        trail = []
        at = start
        while at in numbers and at not in state:
            state[at] = walk
            trail.append(at)
            at = numbers[at].pred
        if at in numbers and state[at] == walk:
            ring = trail[trail.index(at) :]
            shown = " -> ".join(map(str, [*ring[:8], *(["..."] if len(ring) > 8 else []), at]))
            message = f"{_kind(numbers[at])} {at} stands on itself: its fathers are {shown}"
            yield document.source.problem(message, numbers[at].places.get("pred"))


def _size_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    for node in (robot.base, *robot.parts):
        for word in ("r", "d", "epsilon"):
            if not abs(document.metres(getattr(node.parameters, word))) <= LARGEST:
                message = (
                    f"{word} of {_kind(node)} {node.number} is beyond {LARGEST:g} m: nothing can be computed there"
                )
                yield document.source.problem(message, node.places.get("parameters"))


def _constraint_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.source.problem
    known = {0, *(part.number for part in robot.parts)}
    sensors = {sensor.number for sensor in document.sensors}
    for loop in robot.loops:
        for end, number in (("first", loop.first), ("second", loop.second)):
            if number not in known:
                message = f"a loop of robot '{robot.name}' ends at {number}, which does not exist"
                yield problem(message + did_you_mean("", [str(n) for n in sorted(known)]), loop.places.get(end))
        if loop.first == loop.second:
            yield problem(f"a loop joins {loop.first} to itself", loop.places.get("first"))
    for constraint in robot.sensor_constraints:
        if constraint.node not in known:
            message = f"a sensor constraint of robot '{robot.name}' holds {constraint.node}, which does not exist"
            yield problem(message, constraint.places.get("node"))
        for number in constraint.sensors:
            if number != 0 and number not in sensors:
                listed = ", ".join(map(str, sorted(sensors))) or "none"
                yield problem(
                    f"unknown sensor {number} (declared: {listed})", constraint.places.get(f"sensor {number}")
                )


def _warn(document: Document, robot: RaffRobot) -> None:
    """Warnings for what is understood, but probably not meant."""

    def warn(message: str, part: RaffNode, word: str) -> None:
        warnings.warn(str(document.source.problem(message, part.places.get(word))), RaffWarning, stacklevel=4)

    for link in robot.links:
        if link.type is JointType.FIXED:
            for word in ("limits", "velocity"):
                if getattr(link, word) is not None:
                    warn(f"link {link.number} is fixed: its {word} mean nothing", link, word)
            if link.actuated:
                warn(f"link {link.number} is fixed: it has no joint to actuate", link, "actuated")
        elif link.limits:
            home = link.parameters.theta if link.type is JointType.REVOLUTE else link.parameters.r
            if not link.limits[0] <= home <= link.limits[1]:
                message = f"link {link.number} is written at {home:g}, outside its limits {link.limits}"
                warn(message, link, "limits")


def _kind(part: RaffNode) -> str:
    return part.keyword


def _first(place: SourceLocation | None) -> str:
    return f": the first is on line {place.line}" if place else ""


def _no_name(name: str, kind: str) -> str:
    rule = "a name begins with a letter or '_' and has no spaces (it becomes an XML name)"
    return f"'{name}' can't name a {kind}: {rule}"
