"""Mobility, and which joints have motors: properties of the mechanism, not of how it was written down."""

import math
import re
from collections.abc import Mapping

import numpy as np
import pytest
from mechanisms import CLOSED_CHAINS, KNOWN, delta, five_bar, four_bar, gough_stewart, serial

from raff2urdf import RaffError, loads
from raff2urdf.analysis import Analysis, analyse, loop_kinds
from raff2urdf.closure import gaps
from raff2urdf.tree import clusters


def analysis_of(text: str, loops: Mapping[str, str] | None = None) -> Analysis:
    document = loads(text)
    return analyse(document, document.robot(), loops)


# --- known mechanisms --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", KNOWN)
def test_the_mobility_of_known_mechanisms_is_found(name: str) -> None:
    text, mobility = KNOWN[name]
    assert analysis_of(text).mobility == mobility


# --- motors ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("text", "motors"), [
    (delta(), "1 6 12"),  # the three shoulders
    (four_bar(3), "1"),
    (five_bar(2), "1 4"),  # both on the base
    (KNOWN["planar 3-RRR"][0], "1 11 21"),
    (gough_stewart(), "3 13 23 33 43 53"),  # its pistons
    (KNOWN["truss"][0], ""),
], ids=["delta", "four-bar", "five-bar", "3-RRR", "6-UPS", "truss"])  # fmt: skip
def test_motors_sit_on_the_joints_nearest_the_base_that_suffice(text: str, motors: str) -> None:
    assert analysis_of(text).actuated == tuple(f"joint{number}" for number in motors.split())


def saying(text: str, **actuated: int) -> str:
    """The text with `actuated 0|1` in some links, given as link3=1."""
    for link, value in actuated.items():
        number = link.removeprefix("link")
        text, count = re.subn(rf"(link {number} {{ parameters)", rf"link {number} {{ actuated {value} parameters", text)
        assert count == 1
    return text


@pytest.mark.parametrize(("text", "said", "motors"), [
    (serial(4), {"link3": 1}, "3"),  # where one link says that it has a motor, those that say nothing have none
    (gough_stewart(), {f"link{10 * leg + 3}": 1 for leg in range(6)}, "3 13 23 33 43 53"),
    (four_bar(), {"link1": 1, "link3": 1}, "1 3"),  # more motors than freedoms: a redundantly driven parallelogram
    (serial(4), {"link2": 0}, "1 3 4"),
    (four_bar(), {"link1": 0}, "2"),
])  # fmt: skip
def test_motors_are_where_the_file_says(text: str, said: Mapping[str, int], motors: str) -> None:
    assert analysis_of(saying(text, **said)).actuated == tuple(f"joint{number}" for number in motors.split())


# --- how the loops stand as written ------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "kind", "says"), [
    ("frame5-fram6", "ball", r"no loop 'frame5-fram6': did you mean 'frame5-frame6'\?"),
    ("frame5-frame6", "bal", r"'bal' is not a kind of loop: did you mean 'ball'\?"),
    ("frame5-frame6", "weld", r"\(known: rigid, prismatic, revolute, ball\)"),
])  # fmt: skip
def test_asking_for_what_is_not_there_lists_what_is(name: str, kind: str, says: str) -> None:
    with pytest.raises(RaffError, match=says):
        analysis_of(four_bar(), {name: kind})


# --- home --------------------------------------------------------------------------------------------------------


def gap_at(text: str, home: Mapping[str, float], loops: Mapping[str, str] | None = None) -> float:
    """How far the loops stand open there."""
    document = loads(text)
    kinds = loop_kinds(document.robot(), loops)
    found = [0.0]
    for cluster in clusters(document, document.robot(), kinds, 1.0):
        found += gaps(cluster, np.array([home[joint.joint] for joint in cluster.joints]))
    return max(found)


@pytest.mark.parametrize("name", CLOSED_CHAINS)
def test_at_home_all_loops_are_closed(name: str) -> None:
    text, _ = KNOWN[name]
    home = analysis_of(text).home
    assert list(home) == [link.joint for link in loads(text).robot().links if link.type]
    assert gap_at(text, home) < 1e-12


ROUNDED = """RAFF rounded
robot r {
  base { }
  link 1 { parameters { theta 50 }        type 2 pred 0 }
  link 2 { parameters { theta -26 d 120 } type 2 pred 1 }
  link 3 { parameters { theta 89 d 400 }  type 2 pred 0 LIMITS }
  frame 4 { parameters { d 360 } pred 2 }
  frame 5 { parameters { d 240 } pred 3 }
  link 6 { parameters { theta 12 d 100 } type 2 pred 3 }
  constraint { frame 4 frame 5 type 2 }
}
"""


def test_what_is_written_roughly_is_closed_nearby_and_the_rest_stays() -> None:
    text = ROUNDED.replace("LIMITS", "")
    home = analysis_of(text).home
    assert gap_at(text, home) < 1e-12
    assert home["joint6"] == math.radians(12)
    for joint, written in (("joint1", 50), ("joint2", -26), ("joint3", 89)):
        assert 0.0 < abs(home[joint] - math.radians(written)) < 0.05
