"""Checks of a document beyond its grammar: parents, cycles, duplicates, limits, names, ends of constraints.

`check_tree` checks what every document needs. `check` also requires that constraints name nodes and sensors that exist:
an excerpt (such as figure 5 of the paper) can be read, but not converted. `sizes.check_sizes` is for code that computes
with the lengths.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from raff2urdf.errors import Problem, defined_twice, did_you_mean, duplicates, limits_reversed, warn
from raff2urdf.joint_dynamics import JointDynamics
from raff2urdf.raff.compound import VARIABLES, intermediate_names
from raff2urdf.raff.document import (
    LEAST_SIZE,
    OF_JOINT,
    Document,
    DriveKind,
    JointType,
    RaffCoupling,
    RaffInertial,
    RaffLink,
    RaffMotion,
    RaffNode,
    RaffPart,
    RaffRobot,
)
from raff2urdf.raff.oddities import oddities
from raff2urdf.raff.sizes import label, longest, raise_problems
from raff2urdf.raff.writer import number as shown
from raff2urdf.readers.urdf import LEAST_SPEED, TOO_SLOW, negative_mass

# XML 1.0 (fifth edition), production [5] Name, without the colon, which belongs to namespaces.
_START = (
    "A-Z_a-z\xc0-\xd6\xd8-\xf6\xf8-\u02ff\u0370-\u037d\u037f-\u1fff\u200c-\u200d\u2070-\u218f\u2c00-\u2fef"
    "\u3001-\ud7ff\uf900-\ufdcf\ufdf0-\ufffd\U00010000-\U000effff"
)
XML_NAME = f"[{_START}][{_START}\\-.0-9\xb7\u0300-\u036f\u203f-\u2040]*"
_ASCII_NAME = "[A-Za-z_][A-Za-z0-9_.-]*"  # the same for ASCII; the long expression takes 8 ms to compile


RESERVED = {"base": "the root", "world": "the frame of the world", "universe": "Pinocchio's root"}


def is_xml_name(name: str) -> bool:
    """Return whether a URDF element can have this name."""
    return re.fullmatch(_ASCII_NAME if name.isascii() else XML_NAME, name) is not None


def check_tree(document: Document) -> None:
    """Check names, numbers, parents and limits.

    Raises:
        RaffError: with every problem.
    """
    raise_problems(
        [*_file_problems(document), *(p for robot in document.robots for p in _tree_problems(document, robot))]
    )


def check(document: Document) -> None:
    """Check a document that is to be converted; warn (`RaffWarning`) of what is valid but odd.

    Raises:
        RaffError: with every problem.
    """
    problems = [] if document.robots else [document.problem("the file has no robot: add 'robot NAME { }'")]
    problems += _file_problems(document)
    for robot in document.robots:
        problems += [*_tree_problems(document, robot), *_constraint_problems(document, robot)]
        problems += _unit_problems(document, robot)
    raise_problems(problems)
    for robot in document.robots:
        for problem in oddities(document, robot):
            warn(str(problem))


def _file_problems(document: Document) -> Iterator[Problem]:
    problem = document.problem
    for first, robot in duplicates(document.robots, lambda robot: robot.name):
        yield problem(defined_twice(f"robot '{robot.name}'", first.line("name")), robot, "name")
    for robot in {robot.name: robot for robot in reversed(document.robots)}.values():
        if not is_xml_name(robot.name):
            yield problem(_bad_name(robot.name, "robot"), robot, "name")
    for other, sensor in duplicates(document.sensors, lambda sensor: sensor.number):
        yield problem(defined_twice(f"sensor {sensor.number}", other.line("number")), sensor, "number")


def _bad_name(name: str, keyword: str) -> str:
    """Return why a name names nothing in XML."""
    letters = "has only letters, digits, '_', '-' and '.' (it becomes an XML name)"
    return f"'{name}' can't name a {keyword}: a name begins with a letter or '_', and {letters}"


def _tree_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.problem
    numbers: dict[int, RaffPart] = {}
    for part in robot.parts:
        numbers.setdefault(part.number, part)
    for first, part in duplicates(robot.parts, lambda part: part.number):
        missing = sorted({part.pred for part in robot.parts} - numbers.keys() - {0})
        hint = f", probably this one to {missing[0]}, which is named and missing" if len(missing) == 1 else ""
        yield problem(defined_twice(f"the number {part.number}", first.line("number"), hint), part, "number")
    names: dict[str, RaffPart] = {}
    for part in robot.parts:
        at = (part, "name", "number")
        first = names.setdefault(part.node, part)
        if part.node in RESERVED:
            yield problem(f"the name '{part.node}' is reserved for {RESERVED[part.node]}: choose another one", *at)
        elif not is_xml_name(part.node):
            yield problem(_bad_name(part.node, part.keyword), *at)
        elif first is not part and numbers[part.number] is part:
            yield problem(f"the name '{part.node}' is that of {first.keyword} {first.number}: choose another one", *at)
    known = did_you_mean("", ["0 (the base)", *map(str, numbers)])
    for part in robot.parts:
        if part.pred != 0 and part.pred not in numbers:
            near = _probable_parent(robot, part) or known
            why = f"the parent of {part.keyword} {part.number} is {part.pred}, which does not exist{near}"
            yield problem(why, part, "pred")
    yield from _cycles(document, numbers)
    for node in (robot.base, *robot.parts):
        if node.inertial is not None:
            yield from _inertial_problems(document, node, node.inertial)
    for link in robot.links:
        yield from _limit_problems(document, f"link {link.number}", link)
        yield from _variable_problems(document, link, names)


def _limit_problems(document: Document, what: str, of: RaffMotion) -> Iterator[Problem]:
    if of.limits and not of.limits[0] <= of.limits[1]:
        yield document.problem(limits_reversed(what, *of.limits), of, "limits")
    if of.velocity is not None and not min(document.metres(of.velocity), math.radians(of.velocity)) > LEAST_SPEED:
        yield document.problem(f"the velocity limit of {what} is {of.velocity:g}: {TOO_SLOW}", of, "velocity")
    if of.effort is not None and not of.effort > 0.0:
        why = f"the effort limit of {what} is {of.effort:g}: it must be above 0 (N m or N), or left out"
        yield document.problem(why, of, "effort")
    for word in JointDynamics._fields:
        value = getattr(of, word)
        if value is not None and not value >= 0.0:
            yield document.problem(f"the {word} of {what} is {shown(value)}: it must not be negative", of, word)


def _inertial_problems(document: Document, node: RaffNode, inertial: RaffInertial) -> Iterator[Problem]:
    what = label(node)

    def problem(message: str, word: str) -> Problem:
        return document.problem(message, inertial, word, "inertial")

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
            why = f"{what} has a 'density' but no graphics: name files, or give the 'radius' of its bars"
            yield problem(why, "density")


_NO_INERTIAL = RaffInertial()


def _variable_problems(document: Document, link: RaffLink, names: Mapping[str, RaffPart]) -> Iterator[Problem]:
    problem, what = document.problem, f"link {link.number}"
    if link.compound is None:
        if link.variables:
            why = f"{what} has variables but no joint that has several: remove them, or write 'joint' for 'type'"
            yield problem(why, link.variables[0], "name")
        return
    if link.type is not JointType.FIXED or "type" in link.locations:
        yield problem(f"{what} has both 'type' and 'joint': remove one of them", link, "type")
    known = VARIABLES[link.compound]
    for word in OF_JOINT:
        if getattr(link, word) is not None:
            remedy = f"write '{word}' for one of them, in 'variable {next(iter(known))} {{ }}'"
            yield problem(f"the {link.compound} joint of {what} has several variables: {remedy}", link, word)
    for other, variable in duplicates(link.variables, lambda variable: variable.name):
        message = defined_twice(f"variable {variable.name} of {what}", other.line("name"))
        yield problem(message, variable, "name")
    for variable in link.variables:
        subject = f"variable {variable.name} of {what}"
        if variable.name not in known:
            listed = did_you_mean("", list(known))
            yield problem(f"a {link.compound} joint has no variable '{variable.name}'{listed}", variable, "name")
        elif variable.home and known[variable.name]:
            why = f"the home of {subject} is '{known[variable.name]}' of its parameters: write it there"
            yield problem(why, variable, "home")
        yield from _limit_problems(document, subject, variable)
    for name in intermediate_names(link):
        if name in names:
            at = (names[name], "name") if "name" in names[name].locations else (link, "number")
            yield problem(f"the name '{name}' is needed for a joint of {what}: choose another one", *at)


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
            first = numbers[min(cycle)]
            hint = f", such as to 'pred 0' in {first.keyword} {first.number}"
            why = f"{label(numbers[at])} is part of a cycle of parents: {shown}: change the 'pred' of one of them{hint}"
            yield document.problem(why, numbers[at], "pred")


def _constraint_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.problem
    if not (robot.loops or robot.couplings or robot.sensor_constraints):
        return
    known = did_you_mean("", [str(number) for number in sorted({0, *(part.number for part in robot.parts)})])
    sensors = {sensor.number for sensor in document.sensors}
    declared = ", ".join(map(str, sorted(sensors))) or "none"
    for loop in robot.loops:
        for end, number in (("first", loop.first), ("second", loop.second)):
            if number not in robot.nodes:
                what = f"a loop of robot '{robot.name}' ends at {number}, which does not exist{known}"
                why = f"{what}: add 'frame {number}', or name another one"
                yield problem(why, loop, end)
        if loop.first == loop.second:
            yield problem(f"a loop joins node {loop.first} to itself: name two different nodes", loop, "first")
    yield from _coupling_problems(document, robot)
    for constraint in robot.sensor_constraints:
        if constraint.node not in robot.nodes:
            why = f"a sensor constraint of robot '{robot.name}' names {constraint.node}, which does not exist{known}"
            yield problem(why, constraint, "node")
        for number in constraint.sensors:
            if number != 0 and number not in sensors:
                yield problem(f"sensor {number} is not declared (declared: {declared})", constraint, f"sensor {number}")


def _coupling_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.problem
    moving = {link.number: link for link in robot.links if link.type is not JointType.FIXED}
    compound = {link.number: link.compound for link in robot.links if link.compound}
    known = did_you_mean("", [str(number) for number in moving])
    names: dict[str, RaffCoupling] = {}
    ends_exist = all({loop.first, loop.second} <= robot.nodes.keys() for loop in robot.loops)
    loops = robot.loop_names if ends_exist else ()
    for coupling in robot.couplings:
        if coupling.name is not None and names.setdefault(coupling.name, coupling) is not coupling:
            why = f"the name '{coupling.name}' is that of another coupling: choose another one"
            yield problem(why, coupling, "name")
        if coupling.name in loops:
            yield problem(f"the name '{coupling.name}' is that of a loop: choose another one", coupling, "name")
        drives = [(f"drive {i}", drive.link) for i, drive in enumerate(coupling.drives)]
        ends = [("follower", coupling.follower), *drives]
        for i, (word, number) in enumerate(ends):
            if number in compound:
                why = f"a coupling names link {number}, whose {compound[number]} joint has several variables: write it"
                yield problem(f"{why} as successive links, each with a 'type'", coupling, word)
            elif number not in moving:
                why = f"a coupling names link {number}, which is not a link that moves: name another one{known}"
                yield problem(why, coupling, word)
            elif number in (other for _, other in ends[:i]):
                yield problem(f"a coupling names link {number} twice: name another one{known}", coupling, word)
        yield from _drive_problems(document, coupling, moving)


def _drive_problems(document: Document, coupling: RaffCoupling, moving: Mapping[int, RaffLink]) -> Iterator[Problem]:
    """Yield what is wrong with the drives of a coupling between links that move."""
    follower = coupling.follower
    for i, drive in enumerate(coupling.drives):
        if drive.link not in moving or follower not in moving:
            continue
        at, word = (coupling, f"drive {i}"), drive.kind.name.lower()
        follows, drives = (moving[number].type.name.lower() for number in (follower, drive.link))
        if drive.kind is DriveKind.RATIO and follows != drives:
            types = f"link {follower} is {follows} and link {drive.link} {drives}"
            why = f"'ratio' couples joints of one type, but {types}: use 'lead' (a screw) or 'radius' (a rack)"
            yield document.problem(why, *at)
        if drive.kind in (DriveKind.LEAD, DriveKind.RADIUS) and follows == drives:
            types = f"links {follower} and {drive.link} are both {follows}"
            why = f"'{word}' couples a prismatic and a revolute joint, but {types}: use 'ratio'"
            yield document.problem(why, *at)
        if not any(drive.numbers):
            yield document.problem(f"link {drive.link} does not drive link {follower}: its '{word}' is 0", *at)


def _unit_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    """Yield a problem if all lengths are below 1 mm and the file does not state that mm are meant."""
    size, node = longest(robot)
    if not document.states_units and 0.0 < size < LEAST_SIZE:
        why = (
            f"all lengths of robot '{robot.name}' are below {LEAST_SIZE:g} mm, the longest is {shown(size)} "
            "mm: did you mean metres? Write 'units m' after the first line, or 'units mm' if they are in mm"
        )
        yield document.problem(why, node, "parameters")


def _probable_parent(robot: RaffRobot, part: RaffPart) -> str:
    """Return the only node without a child, of those that are not below a part without parent, as its likely parent."""
    below = {part.number}
    while children := {child.number for child in robot.parts if child.pred in below} - below:
        below |= children
    ends = robot.nodes.keys() - below - {child.pred for child in robot.parts}
    return f": did you mean '{ends.pop() or '0 (the base)'}'?" if len(ends) == 1 else ""
