"""Mobility, and which joints have motors: properties of the mechanism, not of how it was written down."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import pytest
from making import axis
from mechanisms import KNOWN, delta, four_bar, gough_stewart, polygon, ring, serial, shift
from small_robots import four_bar as rough_four_bar

import raff2urdf
from raff2urdf import loads
from raff2urdf.closure import gaps
from raff2urdf.loops.mobility import Analysis, analyse, loop_kinds
from raff2urdf.loops.slips import Fault
from raff2urdf.raff.closing_edits import slips_of
from raff2urdf.raff.document import Document, RaffPart, RaffRobot
from raff2urdf.shipped import robots
from raff2urdf.tree import clusters, placements


def analysis_of(text: str, loops: Mapping[str, str] | None = None) -> Analysis:
    document = loads(text)
    return analyse(document, document.robot(), loops)


# --- known mechanisms --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KNOWN)
def test_the_mobility_of_known_mechanisms_is_found(name: str) -> None:
    text, mobility = KNOWN[name]
    analysis = analysis_of(text)
    assert analysis.mobility == len(analysis.actuated) == mobility


# --- motors ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "motors"), [
    (delta(), "1 6 12"),  # the three shoulders
    (four_bar(3), "1"),
    (polygon(5, 2), "1 4"),  # both on the base
    (KNOWN["planar 3-RRR"][0], "1 4 8"),
    (gough_stewart(), "3 9 14 19 24 29"),  # its pistons
    (KNOWN["truss"][0], ""),
], ids=["delta", "four-bar", "five-bar", "3-RRR", "6-UPS", "truss"])  # fmt: skip
def test_motors_sit_on_the_joints_nearest_the_base_that_suffice(text: str, motors: str) -> None:
    assert analysis_of(text).actuated == tuple(f"joint{number}" for number in motors.split())


def saying(text: str, **actuated: int) -> str:
    """The text with `actuated 0|1` in some links, given as link3=1."""
    for link, value in actuated.items():
        number = link.removeprefix("link")
        text, count = re.subn(rf"\blink {number} {{", rf"link {number} {{ actuated {value}", text)
        assert count == 1
    return text


@pytest.mark.parametrize(("text", "said", "motors"), [
    (serial(4), {"link3": 1}, "3"),  # where one link says that it has a motor, those that say nothing have none
    (gough_stewart(), {f"link{piston}": 1 for piston in (3, 9, 14, 19, 24, 29)}, "3 9 14 19 24 29"),
    (four_bar(), {"link1": 1, "link3": 1}, "1 3"),  # more motors than freedoms: a redundantly driven parallelogram
    (serial(4), {"link2": 0}, "1 3 4"),
    (four_bar(), {"link1": 0}, "2"),
    (delta(), {"link6": 0}, "1 2 12"),
])  # fmt: skip
def test_motors_are_where_the_file_says(text: str, said: Mapping[str, int], motors: str) -> None:
    assert analysis_of(saying(text, **said)).actuated == tuple(f"joint{number}" for number in motors.split())


# --- how the loops stand as written ------------------------------------------------------------------------------


def test_the_gap_is_a_part_of_the_characteristic_length() -> None:
    """Ends 4 mm apart, over the root of 3 times the mean square distance of the axes from their centre."""
    corners = [(math.cos(a), math.sin(a), 0.0) for a in (0.1, 1.6, 3.3, 4.9)]
    text = ring([axis(corner) for corner in corners], off=shift("x", 0.004))
    loop = loads(text).robot().loops[0]
    placed = placements(loads(text), loads(text).robot())
    axes = np.array([*corners[:3], placed[loop.first][:3, 3]])
    radius = math.sqrt(((axes - axes.mean(axis=0)) ** 2).sum() * 3.0 / 4.0)
    assert analysis_of(text).gap == pytest.approx(0.004 / radius, rel=1e-9)


# --- home --------------------------------------------------------------------------------------------------------


def gap_at(text: str, home: Mapping[str, float], loops: Mapping[str, str] | None = None) -> float:
    """How far the loops stand open there."""
    document = loads(text)
    kinds = loop_kinds(document.robot(), loops)
    all_gaps = [0.0]
    for cluster in clusters(document, document.robot(), kinds, 1.0):
        all_gaps += gaps(cluster, np.array([home[joint.joint] for joint in cluster.joints]))
    return max(all_gaps)


def rounded(limits: str = "") -> str:
    """Its rocker has limits, and carries a joint that is in no loop."""
    return rough_four_bar(words=("", "", limits), more="link 6 { parameters { theta 12 d 100 } type 2 pred 3 }")


def test_what_is_written_roughly_is_closed_nearby_and_the_rest_stays() -> None:
    text = rounded()
    home = analysis_of(text).home
    assert list(home) == ["joint1", "joint2", "joint3", "joint6"]
    assert gap_at(text, home) < 1e-12
    assert home["joint6"] == math.radians(12)
    for joint, written in (("joint1", 50), ("joint2", -26), ("joint3", 89)):
        assert 0.0 < abs(home[joint] - math.radians(written)) < 0.05


@pytest.mark.parametrize(("low", "high", "wanted"), [(100, 120, 100), (60, 87, 87)])
def test_home_is_inside_the_limits(low: float, high: float, wanted: float) -> None:
    text = rounded(f"limits {{ {low} {high} }}")
    home = analysis_of(text).home
    assert gap_at(text, home) < 1e-12
    assert home["joint3"] == pytest.approx(math.radians(wanted), abs=1e-12)


def test_where_no_closed_configuration_is_inside_the_limits_the_nearest_closed_one_is_home() -> None:
    assert analysis_of(rounded("limits { 200 210 }")).home == analysis_of(rounded()).home


# --- slips ------------------------------------------------------------------------------------------------------------
# A slip of the pen in a robot that is drawn closed is named, and a robot without any is not doubted.


def slips(document: Document, robot: RaffRobot, fault: Fault = Fault.OPEN) -> str | None:
    return slips_of(document, robot, {i: loop.kind for i, loop in enumerate(robot.loops)}, fault)


def with_number(robot: RaffRobot, part: RaffPart, word: str, value: float) -> RaffRobot:
    other = replace(part, parameters=replace(part.parameters, **{word: value}))
    return replace(robot, parts=tuple(other if old is part else old for old in robot.parts))


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
