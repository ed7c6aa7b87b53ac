"""Checks of a document beyond its grammar: parents, cycles, duplicates, limits, names, ends of constraints.

`check_tree` checks what every document needs. `check` also requires that constraints name nodes and sensors that exist:
an excerpt (such as figure 5 of the paper) can be read, but not converted. `check_sizes` is for code that computes with
the lengths.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping

from raff2urdf.errors import (
    Problem,
    RaffError,
    RaffWarning,
    SourceLocation,
    defined_twice,
    did_you_mean,
    duplicates,
    limits_reversed,
)
from raff2urdf.raff.compound import VARIABLES, intermediate_names
from raff2urdf.raff.document import (
    LEAST_SIZE,
    CompoundKind,
    Document,
    DriveKind,
    JointType,
    RaffCoupling,
    RaffInertial,
    RaffLink,
    RaffNode,
    RaffPart,
    RaffRobot,
    RaffSensor,
    RaffVariable,
)
from raff2urdf.raff.writer import number as shown
from raff2urdf.readers.urdf import LEAST_SPEED, TOO_SLOW, negative_mass
from raff2urdf.tree import stated_inertia

# XML 1.0 (fifth edition), production [5] Name, without the colon, which belongs to namespaces.
_START = (
    "A-Z_a-z\xc0-\xd6\xd8-\xf6\xf8-\u02ff\u0370-\u037d\u037f-\u1fff\u200c-\u200d\u2070-\u218f\u2c00-\u2fef"
    "\u3001-\ud7ff\uf900-\ufdcf\ufdf0-\ufffd\U00010000-\U000effff"
)
_XML_NAME = f"[{_START}][{_START}\\-.0-9\xb7\u0300-\u036f\u203f-\u2040]*"
_ASCII_NAME = "[A-Za-z_][A-Za-z0-9_.-]*"  # the same for ASCII; the long expression takes 8 ms to compile

LARGEST = 1e12
"""Largest length, m: its square, times the number of links, must stay finite and keep enough digits."""

RESERVED = {"base": "the root", "world": "the frame of the world", "universe": "Pinocchio's root"}


def is_xml_name(name: str) -> bool:
    """Return whether a URDF element can have this name."""
    return re.fullmatch(_ASCII_NAME if name.isascii() else _XML_NAME, name) is not None


def check_tree(document: Document) -> None:
    """Check names, numbers, parents and limits.

    Raises:
        RaffError: with every problem.
    """
    _raise([*_file_problems(document), *(p for robot in document.robots for p in _tree_problems(document, robot))])


def check(document: Document) -> None:
    """Check a document that is to be converted; warn (`RaffWarning`) of what is valid but odd.

    Raises:
        RaffError: with every problem.
    """
    problems = [] if document.robots else [document.source.problem("the file has no robot: add 'robot NAME { }'")]
    problems += _file_problems(document)
    for robot in document.robots:
        problems += [*_tree_problems(document, robot), *_constraint_problems(document, robot)]
        problems += _unit_problems(document, robot)
    _raise(problems)
    for robot in document.robots:
        for problem in _oddities(document, robot):
            warnings.warn(str(problem), RaffWarning, stacklevel=3)


def check_sizes(document: Document, robot: RaffRobot) -> None:
    """Check that no length, mass and moment of inertia is too large for computations.

    Raises:
        RaffError: with every problem.
    """
    problems = []
    for node in (robot.base, *robot.parts):
        lengths = {word: abs(document.metres(getattr(node.parameters, word))) for word in ("r", "d", "epsilon")}
        for word in (word for word, length in lengths.items() if not length <= LARGEST):
            message = f"{word} of {label(node)} is beyond {LARGEST:g} m, the largest length"
            problems.append(document.source.problem(message, node.locations.get("parameters")))
        for word, largest in _sizes(document, node.inertial) if node.inertial is not None else ():
            if not largest <= LARGEST:
                message = f"'{word}' of the inertial of {label(node)} is beyond {LARGEST:g} in SI units, the largest"
                problems.append(document.source.problem(message, _place(node.inertial, word)))
    _raise(problems)


def label(node: RaffNode) -> str:
    """Return a node as errors name it."""
    return f"{node.keyword} {node.number}" if node.number else "the base"


def _sizes(document: Document, inertial: RaffInertial) -> Iterator[tuple[str, float]]:
    """Yield the largest number of each statement in SI units."""
    for word in ("mass", "density"):
        yield word, abs(getattr(inertial, word) or 0.0)
    yield "radius", document.metres(abs(inertial.radius or 0.0))
    yield "centre", document.metres(max(map(abs, inertial.centre)))
    for word in ("moments", "products"):
        yield word, document.metres(document.metres(max(map(abs, getattr(inertial, word)))))


def _place(inertial: RaffInertial | None, word: str) -> SourceLocation | None:
    locations = inertial.locations if inertial is not None else {}
    return locations.get(word) or locations.get("inertial")


def _raise(problems: Iterable[Problem]) -> None:
    if found := list(problems):
        raise RaffError(found)


def _file_problems(document: Document) -> Iterator[Problem]:
    problem = document.source.problem
    for first, robot in duplicates(document.robots, lambda robot: robot.name):
        yield problem(defined_twice(f"robot '{robot.name}'", _line(first, "name")), robot.locations.get("name"))
    for robot in {robot.name: robot for robot in reversed(document.robots)}.values():
        if not is_xml_name(robot.name):
            yield problem(_bad_name(robot.name, "robot"), robot.locations.get("name"))
    for other, sensor in duplicates(document.sensors, lambda sensor: sensor.number):
        message = defined_twice(f"sensor {sensor.number}", _line(other, "number"))
        yield problem(message, sensor.locations.get("number"))


def _tree_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.source.problem
    numbers: dict[int, RaffPart] = {}
    for part in robot.parts:
        numbers.setdefault(part.number, part)
    for first, part in duplicates(robot.parts, lambda part: part.number):
        message = defined_twice(f"the number {part.number}", _line(first, "number"))
        yield problem(message, part.locations.get("number"))
    names: dict[str, RaffPart] = {}
    for part in robot.parts:
        at = part.locations.get("name") or part.locations.get("number")
        first = names.setdefault(part.node, part)
        if part.node in RESERVED:
            yield problem(f"the name '{part.node}' is reserved for {RESERVED[part.node]}: choose another one", at)
        elif not is_xml_name(part.node):
            yield problem(_bad_name(part.node, part.keyword), at)
        elif first is not part and numbers[part.number] is part:
            yield problem(f"the name '{part.node}' is that of {first.keyword} {first.number}: choose another one", at)
    for part in robot.parts:
        if part.pred != 0 and part.pred not in numbers:
            known = did_you_mean("", ["0 (the base)", *map(str, numbers)])
            message = f"the parent of {part.keyword} {part.number} is {part.pred}, which does not exist{known}"
            yield problem(message, part.locations.get("pred"))
    yield from _cycles(document, numbers)
    for node in (robot.base, *robot.parts):
        if node.inertial is not None:
            yield from _inertial_problems(document, node, node.inertial)
    for link in robot.links:
        yield from _limit_problems(document, f"link {link.number}", link)
        yield from _variable_problems(document, link, names)


def _limit_problems(document: Document, what: str, of: RaffLink | RaffVariable) -> Iterator[Problem]:
    if of.limits and not of.limits[0] <= of.limits[1]:
        yield document.source.problem(limits_reversed(what, *of.limits), of.locations.get("limits"))
    if of.velocity is not None and not min(document.metres(of.velocity), math.radians(of.velocity)) > LEAST_SPEED:
        message = f"the velocity limit of {what} is {of.velocity:g}: {TOO_SLOW}"
        yield document.source.problem(message, of.locations.get("velocity"))
    if of.effort is not None and not of.effort > 0.0:
        message = f"the effort limit of {what} is {of.effort:g}: it must be above 0 (N m or N), or left out"
        yield document.source.problem(message, of.locations.get("effort"))


def _inertial_problems(document: Document, node: RaffNode, inertial: RaffInertial) -> Iterator[Problem]:
    def problem(message: str, word: str) -> Problem:
        return document.source.problem(message, _place(inertial, word))

    what = label(node)
    if inertial.mass is None and inertial.density is None:
        yield problem(f"the inertial of {what} has no 'mass' (kg), nor a 'density' (kg/m3)", "inertial")
    if inertial.mass is not None and inertial.mass < 0.0:
        yield problem(negative_mass(what, inertial.mass), "mass")
    for word in ("density", "radius"):
        value = getattr(inertial, word)
        if value is not None and not value > 0.0:
            yield problem(f"the {word} of {what} is {shown(value)}: it must be above 0", word)
    if inertial.density is None and inertial.radius is not None:
        yield problem(f"'radius' of {what} is that of bars of a 'density': add it, or remove 'radius'", "radius")
    if inertial.density is not None:
        for word in ("mass", "centre", "moments", "products"):
            if word in inertial.locations or getattr(inertial, word) != getattr(_NO_INERTIAL, word):
                yield problem(f"{what} has a 'density', from which '{word}' follows: remove one of them", word)
        if inertial.radius is None and not node.filenames:
            message = f"{what} has a 'density' but no graphics: name files, or give the 'radius' of its bars"
            yield problem(message, "density")


_NO_INERTIAL = RaffInertial()


def _variable_problems(document: Document, link: RaffLink, names: Mapping[str, RaffPart]) -> Iterator[Problem]:
    problem, at, what = document.source.problem, link.locations, f"link {link.number}"
    if link.compound is None:
        if link.variables:
            message = f"{what} has variables but no joint that has several: remove them, or write 'joint' for 'type'"
            yield problem(message, link.variables[0].locations.get("name"))
        return
    if link.type is not JointType.FIXED or "type" in at:
        yield problem(f"{what} has both 'type' and 'joint': remove one of them", at.get("type"))
    known = VARIABLES[link.compound]
    for word in ("limits", "velocity", "effort", "actuated"):
        if getattr(link, word) is not None:
            message = f"the {link.compound} joint of {what} has several variables: write '{word}' for one of them, in "
            yield problem(f"{message}'variable {next(iter(known))} {{ }}'", at.get(word))
    for other, variable in duplicates(link.variables, lambda variable: variable.name):
        line = other.locations["name"].line if "name" in other.locations else None
        yield problem(defined_twice(f"variable {variable.name} of {what}", line), variable.locations.get("name"))
    for variable in link.variables:
        own = f"variable {variable.name} of {what}"
        if variable.name not in known:
            message = f"a {link.compound} joint has no variable '{variable.name}'{did_you_mean('', list(known))}"
            yield problem(message, variable.locations.get("name"))
        elif variable.home and known[variable.name]:
            message = f"the home of {own} is '{known[variable.name]}' of its parameters: write it there"
            yield problem(message, variable.locations.get("home"))
        yield from _limit_problems(document, own, variable)
    for name in intermediate_names(link):
        if name in names:
            message = f"the name '{name}' is needed for a joint of {what}: choose another one"
            yield problem(message, names[name].locations.get("name") or at.get("number"))


def _cycles(document: Document, numbers: dict[int, RaffPart]) -> Iterator[Problem]:
    """Yield one problem for each cycle of parents. Every node is visited once."""
    visited: dict[int, int] = {0: -1}  # number -> the start of the walk that met it
    for start in numbers:
        trail = []
        at = start
        while at in numbers and at not in visited:
            visited[at] = start
            trail.append(at)
            at = numbers[at].pred
        if at in numbers and visited[at] == start:
            cycle = trail[trail.index(at) :]
            shown = " -> ".join(map(str, [*cycle[:8], *(["..."] if len(cycle) > 8 else []), at]))
            message = (
                f"{numbers[at].keyword} {at} is part of a cycle of parents: {shown}: change the 'pred' of one of them"
            )
            yield document.source.problem(message, numbers[at].locations.get("pred"))


def _constraint_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.source.problem
    known = sorted({0, *(part.number for part in robot.parts)})
    sensors = {sensor.number for sensor in document.sensors}
    for loop in robot.loops:
        for end, number in (("first", loop.first), ("second", loop.second)):
            if number not in robot.nodes:
                message = f"a loop of robot '{robot.name}' ends at {number}, which does not exist"
                yield problem(message + did_you_mean("", [str(n) for n in known]), loop.locations.get(end))
        if loop.first == loop.second:
            yield problem(
                f"a loop joins node {loop.first} to itself: name two different nodes", loop.locations.get("first")
            )
    yield from _coupling_problems(document, robot)
    for constraint in robot.sensor_constraints:
        if constraint.node not in robot.nodes:
            message = f"a sensor constraint of robot '{robot.name}' names {constraint.node}, which does not exist"
            yield problem(message + did_you_mean("", [str(n) for n in known]), constraint.locations.get("node"))
        for number in constraint.sensors:
            if number != 0 and number not in sensors:
                message = (
                    f"sensor {number} is not declared (declared: {', '.join(map(str, sorted(sensors))) or 'none'})"
                )
                yield problem(message, constraint.locations.get(f"sensor {number}"))


def _coupling_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.source.problem
    moving = {link.number: link for link in robot.links if link.type is not JointType.FIXED}
    compound = {link.number: link.compound for link in robot.links if link.compound}
    names: dict[str, RaffCoupling] = {}
    ends_exist = all({loop.first, loop.second} <= robot.nodes.keys() for loop in robot.loops)
    loops = robot.loop_names if ends_exist else ()
    for coupling in robot.couplings:
        at = coupling.locations
        if coupling.name is not None and names.setdefault(coupling.name, coupling) is not coupling:
            yield problem(f"the name '{coupling.name}' is that of another coupling: choose another one", at.get("name"))
        if coupling.name in loops:
            yield problem(f"the name '{coupling.name}' is that of a loop: choose another one", at.get("name"))
        ends = [("follower", coupling.follower)] + [(f"drive {i}", one.link) for i, one in enumerate(coupling.drives)]
        for i, (word, number) in enumerate(ends):
            if number in compound:
                message = (
                    f"a coupling names link {number}, whose {compound[number]} joint has several variables: "
                    "write it as successive links, each with a 'type'"
                )
                yield problem(message, at.get(word))
            elif number not in moving:
                known = did_you_mean("", [str(n) for n in moving])
                yield problem(f"a coupling names link {number}, which is not a link that moves{known}", at.get(word))
            elif number in (other for _, other in ends[:i]):
                yield problem(f"a coupling names link {number} twice: name it once", at.get(word))
        for i, drive in enumerate(coupling.drives):
            if drive.link not in moving or coupling.follower not in moving:
                continue
            where = at.get(f"drive {i}")
            own, other = moving[coupling.follower].type, moving[drive.link].type
            word = drive.kind.name.lower()
            if drive.kind is DriveKind.RATIO and own is not other:
                yield problem(
                    f"'ratio' couples joints of one type, but link {coupling.follower} is {own.name.lower()} and link "
                    f"{drive.link} {other.name.lower()}: use 'lead' (a screw) or 'radius' (a rack)",
                    where,
                )
            if drive.kind in (DriveKind.LEAD, DriveKind.RADIUS) and own is other:
                yield problem(
                    f"'{word}' couples a prismatic and a revolute joint, but links {coupling.follower} and "
                    f"{drive.link} are both {own.name.lower()}: use 'ratio'",
                    where,
                )
            if not any(drive.numbers):
                yield problem(f"link {drive.link} does not drive link {coupling.follower}: its '{word}' is 0", where)


def _unit_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    """Yield a problem if all lengths are below 1 mm and the file does not state that mm are meant."""
    size, node = document.longest(robot)
    if not document.states_units and 0.0 < size < LEAST_SIZE:
        message = (
            f"all lengths of robot '{robot.name}' are below {LEAST_SIZE:g} mm, the longest is {shown(size)} mm: did "
            "you mean metres? Write 'units m' after the first line, or 'units mm' if they are in mm"
        )
        yield document.source.problem(message, node.locations.get("parameters"))


def _oddities(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    """Yield warnings: valid input that is probably not intended."""
    problem = document.source.problem
    for node in (robot.base, *robot.parts):
        if node.inertial is not None and all(size <= LARGEST for _, size in _sizes(document, node.inertial)):
            why = stated_inertia(document, node.inertial).why_unphysical()
            if why is not None:
                message = f"no body can have the inertia of {label(node)}: {why}; no forces can be computed"
                yield problem(message, _place(node.inertial, "moments"))
    for link in robot.links:
        yield from _variables_outside_limits(document, link)
        yield from _useless_efforts(document, link)
        if link.type is JointType.FIXED and not link.compound:
            for word in ("limits", "velocity", "effort", "actuated"):
                if getattr(link, word):
                    message = f"link {link.number} is fixed, so '{word}' has no effect: remove it"
                    yield problem(message, link.locations.get(word))
        elif link.limits:
            home = link.parameters.theta if link.type is JointType.REVOLUTE else link.parameters.r
            if not link.limits[0] <= home <= link.limits[1]:
                low, high = map(shown, link.limits)
                message = (
                    f"home {shown(home)} of link {link.number} is outside its limits {low} to {high}: change either"
                )
                yield problem(message, link.locations.get("limits"))


def _useless_efforts(document: Document, link: RaffLink) -> Iterator[Problem]:
    ball = link.compound is CompoundKind.BALL
    for what, of in [(f"link {link.number}", link)] + [
        (f"variable {variable.name} of link {link.number}", variable) for variable in link.variables
    ]:
        if of.effort is not None and (of.actuated is False or (ball and not of.actuated)):
            message = f"the joint of {what} is passive, so 'effort' has no effect: remove it, or write 'actuated 1'"
            yield document.source.problem(message, of.locations.get("effort"))


def _variables_outside_limits(document: Document, link: RaffLink) -> Iterator[Problem]:
    for variable in link.variables:
        word = VARIABLES[link.compound][variable.name] if link.compound else None
        home = getattr(link.parameters, word) if word else variable.home
        if variable.limits and not variable.limits[0] <= home <= variable.limits[1]:
            low, high = map(shown, variable.limits)
            what = f"home {shown(home)} of variable {variable.name} of link {link.number}"
            message = f"{what} is outside its limits {low} to {high}: change either"
            yield document.source.problem(message, variable.locations.get("limits"))


def _line(thing: RaffRobot | RaffPart | RaffSensor, word: str) -> int | None:
    return thing.locations[word].line if word in thing.locations else None


def _bad_name(name: str, keyword: str) -> str:
    rule = "a name begins with a letter or '_' and has no spaces (it becomes an XML name)"
    return f"'{name}' can't name a {keyword}: {rule}"
