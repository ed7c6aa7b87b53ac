"""A slip of the pen in a robot that is drawn closed is named, and a robot without any is not doubted."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

import raff2urdf
from raff2urdf.loops.slips import Fault
from raff2urdf.raff.closing_edits import slips_of
from raff2urdf.raff.document import Document, LoopKind, RaffPart, RaffRobot
from raff2urdf.shipped import robots


def slips(document: Document, robot: RaffRobot, fault: Fault = Fault.OPEN) -> str | None:
    return slips_of(document, robot, {i: loop.kind for i, loop in enumerate(robot.loops)}, fault)


def with_number(robot: RaffRobot, part: RaffPart, word: str, value: float) -> RaffRobot:
    other = replace(part, parameters=replace(part.parameters, **{word: value}))
    return replace(robot, parts=tuple(other if one is part else one for one in robot.parts))


@pytest.mark.parametrize("name", ["five_bar", "gough", "tssm", "cusp_3rpr"])
@pytest.mark.parametrize("fault", [Fault.OPEN, Fault.ELSEWHERE])
def test_a_wrong_sign_or_a_digit_too_many_is_named_in_every_length_of_a_loop(name: str, fault: Fault) -> None:
    document = raff2urdf.load(name)
    robot = document.robot()
    ends = [getattr(loop, end) for loop in robot.loops for end in ("first", "second")]
    tried = 0
    for part in (part for part in robot.parts if part.number in ends and part.parameters.d):
        for factor in (-1.0, 10.0):
            said = slips(document, with_number(robot, part, "d", factor * part.parameters.d), fault)
            assert said is not None
            assert f"write 'd {part.parameters.d:.15g}' for 'd " in said
            assert f" in {part.keyword} {part.number}" in said
            tried += 1
    assert tried > 0


def shipped() -> Iterator[tuple[str, Document, RaffRobot]]:
    for name in robots():
        document = raff2urdf.load(name)
        yield from ((name, document, robot) for robot in document.robots)


def test_robots_that_are_right_are_not_doubted() -> None:
    for name, document, robot in shipped():
        assert slips(document, robot) is None, name


def test_a_rigid_loop_in_the_place_of_a_hinge_is_named() -> None:
    document = raff2urdf.load("four_bar")
    said = slips_of(document, document.robot(), {0: LoopKind.RIGID}, Fault.OPEN)
    assert said is not None
    assert "write 'type 2' for 'type 0' in the constraint" in said
