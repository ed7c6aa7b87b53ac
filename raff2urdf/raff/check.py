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
from raff2urdf.raff import texts
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
    problems = [] if document.robots else [document.problem(texts.NO_ROBOT.format())]
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
            yield problem(texts.BAD_NAME, robot, "name", name=robot.name, keyword="robot")
    for other, sensor in duplicates(document.sensors, lambda sensor: sensor.number):
        yield problem(defined_twice(f"sensor {sensor.number}", other.line("number")), sensor, "number")


def _tree_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.problem
    numbers: dict[int, RaffPart] = {}
    for part in robot.parts:
        numbers.setdefault(part.number, part)
    for first, part in duplicates(robot.parts, lambda part: part.number):
        missing = sorted({part.pred for part in robot.parts} - numbers.keys() - {0})
        hint = texts.TO_NUMBER.format(number=missing[0]) if len(missing) == 1 else ""
        yield problem(defined_twice(f"the number {part.number}", first.line("number"), hint), part, "number")
    names: dict[str, RaffPart] = {}
    for part in robot.parts:
        at = (part, "name", "number")
        first = names.setdefault(part.node, part)
        if part.node in RESERVED:
            yield problem(texts.RESERVED_NAME, *at, name=part.node, owner=RESERVED[part.node])
        elif not is_xml_name(part.node):
            yield problem(texts.BAD_NAME, *at, name=part.node, keyword=part.keyword)
        elif first is not part and numbers[part.number] is part:
            yield problem(texts.NAME_TAKEN, *at, name=part.node, keyword=first.keyword, number=first.number)
    known = did_you_mean("", [texts.THE_BASE, *map(str, numbers)])
    for part in robot.parts:
        if part.pred != 0 and part.pred not in numbers:
            near = _probable_parent(robot, part) or known
            fields = {"keyword": part.keyword, "number": part.number, "pred": part.pred, "known": near}
            yield problem(texts.NO_PARENT, part, "pred", **fields)
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
        yield document.problem(
            texts.VELOCITY_TOO_SMALL, of, "velocity", what=what, value=of.velocity, too_slow=TOO_SLOW
        )
    if of.effort is not None and not of.effort > 0.0:
        yield document.problem(texts.EFFORT_TOO_SMALL, of, "effort", what=what, value=of.effort)
    for word in JointDynamics._fields:
        value = getattr(of, word)
        if value is not None and not value >= 0.0:
            yield document.problem(texts.BELOW_0, of, word, word=word, what=what, value=shown(value))


def _inertial_problems(document: Document, node: RaffNode, inertial: RaffInertial) -> Iterator[Problem]:
    what = label(node)

    def problem(text: str, word: str, **fields: object) -> Problem:
        return document.problem(text, inertial, word, "inertial", what=what, **fields)

    if inertial.mass is None and inertial.density is None:
        yield problem(texts.NO_MASS, "inertial")
    if inertial.mass is not None and inertial.mass < 0.0:
        yield problem(negative_mass(what, inertial.mass), "mass")
    for word in ("density", "radius"):
        value = getattr(inertial, word)
        if value is not None and not value > 0.0:
            yield problem(texts.NOT_ABOVE_0, word, quantity=word, value=shown(value))
    if inertial.density is None and inertial.radius is not None:
        yield problem(texts.RADIUS_OF_BARS, "radius")
    if inertial.density is not None:
        for word in ("mass", "centre", "moments", "products"):
            if word in inertial.locations or getattr(inertial, word) != getattr(_NO_INERTIAL, word):
                yield problem(texts.DENSITY_AND_MASS, word, other=word)
        if inertial.radius is None and not node.filenames:
            yield problem(texts.DENSITY_OF_NOTHING, "density")


_NO_INERTIAL = RaffInertial()


def _variable_problems(document: Document, link: RaffLink, names: Mapping[str, RaffPart]) -> Iterator[Problem]:
    problem, what = document.problem, f"link {link.number}"
    if link.compound is None:
        if link.variables:
            yield problem(texts.NO_VARIABLES, link.variables[0], "name", what=what)
        return
    if link.type is not JointType.FIXED or "type" in link.locations:
        yield problem(texts.TYPE_AND_JOINT, link, "type", what=what)
    known = VARIABLES[link.compound]
    for word in OF_JOINT:
        if getattr(link, word) is not None:
            first = next(iter(known))
            yield problem(texts.IN_A_VARIABLE, link, word, compound=link.compound, what=what, word=word, first=first)
    for other, variable in duplicates(link.variables, lambda variable: variable.name):
        message = defined_twice(f"variable {variable.name} of {what}", other.line("name"))
        yield problem(message, variable, "name")
    for variable in link.variables:
        subject = f"variable {variable.name} of {what}"
        if variable.name not in known:
            fields = {"compound": link.compound, "name": variable.name, "known": did_you_mean("", list(known))}
            yield problem(texts.NO_SUCH_VARIABLE, variable, "name", **fields)
        elif variable.home and known[variable.name]:
            yield problem(texts.HOME_IS_PARAMETER, variable, "home", what=subject, parameter=known[variable.name])
        yield from _limit_problems(document, subject, variable)
    for name in intermediate_names(link):
        if name in names:
            at = (names[name], "name") if "name" in names[name].locations else (link, "number")
            yield problem(texts.NAME_NEEDED, *at, name=name, what=what)


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
            hint = texts.TO_BASE.format(keyword=first.keyword, number=first.number)
            fields = {"keyword": numbers[at].keyword, "number": at, "shown": shown, "hint": hint}
            yield document.problem(texts.CYCLE, numbers[at], "pred", **fields)


def _constraint_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    problem = document.problem
    if not (robot.loops or robot.couplings or robot.sensor_constraints):
        return
    known = did_you_mean("", [str(number) for number in sorted({0, *(part.number for part in robot.parts)})])
    sensors = {sensor.number for sensor in document.sensors}
    declared = ", ".join(map(str, sorted(sensors))) or texts.NONE
    for loop in robot.loops:
        for end, number in (("first", loop.first), ("second", loop.second)):
            if number not in robot.nodes:
                yield problem(texts.NO_END, loop, end, robot=robot.name, number=number, known=known)
        if loop.first == loop.second:
            yield problem(texts.LOOP_TO_ITSELF, loop, "first", number=loop.first)
    yield from _coupling_problems(document, robot)
    for constraint in robot.sensor_constraints:
        if constraint.node not in robot.nodes:
            yield problem(texts.NO_NODE, constraint, "node", robot=robot.name, number=constraint.node, known=known)
        for number in constraint.sensors:
            if number != 0 and number not in sensors:
                yield problem(texts.NO_SENSOR, constraint, f"sensor {number}", number=number, declared=declared)


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
            yield problem(texts.NAME_OF_COUPLING, coupling, "name", name=coupling.name)
        if coupling.name in loops:
            yield problem(texts.NAME_OF_LOOP, coupling, "name", name=coupling.name)
        drives = [(f"drive {i}", drive.link) for i, drive in enumerate(coupling.drives)]
        ends = [("follower", coupling.follower), *drives]
        for i, (word, number) in enumerate(ends):
            if number in compound:
                yield problem(texts.COUPLES_COMPOUND, coupling, word, number=number, compound=compound[number])
            elif number not in moving:
                yield problem(texts.COUPLES_NOTHING, coupling, word, number=number, known=known)
            elif number in (other for _, other in ends[:i]):
                yield problem(texts.COUPLED_TWICE, coupling, word, number=number, known=known)
        yield from _drive_problems(document, coupling, moving)


def _drive_problems(document: Document, coupling: RaffCoupling, moving: Mapping[int, RaffLink]) -> Iterator[Problem]:
    """Yield what is wrong with the drives of a coupling between links that move."""
    for i, drive in enumerate(coupling.drives):
        if drive.link not in moving or coupling.follower not in moving:
            continue
        at, word = (coupling, f"drive {i}"), drive.kind.name.lower()
        follows, drives = (moving[number].type for number in (coupling.follower, drive.link))
        ends_of = {"follower": coupling.follower, "link": drive.link, "own": follows.name.lower()}
        if drive.kind is DriveKind.RATIO and follows is not drives:
            yield document.problem(texts.RATIO_OF_TWO_TYPES, *at, **ends_of, other=drives.name.lower())
        if drive.kind in (DriveKind.LEAD, DriveKind.RADIUS) and follows is drives:
            yield document.problem(texts.SCREW_OF_ONE_TYPE, *at, **ends_of, word=word)
        if not any(drive.numbers):
            yield document.problem(texts.DRIVES_BY_0, *at, **ends_of, word=word)


def _unit_problems(document: Document, robot: RaffRobot) -> Iterator[Problem]:
    """Yield a problem if all lengths are below 1 mm and the file does not state that mm are meant."""
    size, node = longest(robot)
    if not document.states_units and 0.0 < size < LEAST_SIZE:
        yield document.problem(texts.SMALL, node, "parameters", robot=robot.name, least=LEAST_SIZE, size=shown(size))


def _probable_parent(robot: RaffRobot, part: RaffPart) -> str:
    """Return the only node without a child, of those that are not below a part without parent, as its likely parent."""
    below = {part.number}
    while children := {child.number for child in robot.parts if child.pred in below} - below:
        below |= children
    ends = robot.nodes.keys() - below - {child.pred for child in robot.parts}
    return texts.DID_YOU_MEAN.format(word=ends.pop() or texts.THE_BASE) if len(ends) == 1 else ""
