"""The command `cinegen modes`: all assembly modes, on the terminal, as JSON and in the page."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from cinegen.assembly import assembly_modes
from cinegen.user_units import pose_numbers


def rows(said):
    """Of a table: the mode's number as written, its numbers, and what is noted."""
    row = re.compile(r"^ {2,}(\d+\**)((?: +-?\d+\.\d+)*) *(.*)$", re.MULTILINE)
    return [(number, [*map(float, numbers.split())], note) for number, numbers, note in row.findall(said)]


@pytest.mark.parametrize(
    "values", [["0.9", "0.95", "1", "1.05", "1.0", "1.01"], ["900mm,", "95 cm, 1000mm 1050mm,1 m,1.01m"]]
)
def test_lengths_are_typed_with_blanks_or_commas_in_m_or_with_units(robot, printed, values):
    expected = assembly_modes(robot("gough"), [0.9, 0.95, 1.0, 1.05, 1.0, 1.01]).as_dict()
    assert json.loads(printed("modes", "gough", "--values", *values, "--json")) == [expected]


def test_modes_at_a_mode_that_was_listed_contain_it(printed):
    """What one copies from the table and types again is marked there; its rods have one length for a pose."""
    first = rows(printed("modes", "tssm"))
    numbers = first[3][1]
    again = rows(printed("modes", "tssm", "--at", ",".join(map(str, numbers))))
    (marked,) = [values for number, values, _ in again if number.endswith("*")]
    np.testing.assert_allclose(marked[:3], numbers[:3], atol=1.1e-5)
    np.testing.assert_allclose(marked[3:], numbers[3:], atol=0.011)
    assert len(again) == len(first)
    for _, row, _ in first:  # typed with two or three digits, they move a little
        assert min(np.abs(np.subtract(row[:3], other[1][:3])).max() for other in again) < 5e-4


def test_a_pose_may_be_typed_by_name_and_without_orientation(robot, printed):
    gough = robot("gough")
    report = json.loads(printed("modes", "gough", "--at", "x=-20mm", "y=0.03,z=88 cm", "--json"))[0]
    assert min(math.dist(mode["position"], (-0.02, 0.03, 0.88)) for mode in report["modes"]) < 1e-4
    report = json.loads(printed("modes", "gough", "--at", "rz=25", "--json"))[0]
    home = pose_numbers(gough.placement(gough.q_home, "platform"))
    turned = pin.rpy.rpyToMatrix(np.radians([*home[3:5], 25.0]))
    assert min(np.abs(np.array(mode["rotation"]) - turned).max() for mode in report["modes"]) < 1e-4


def test_where_solutions_meet_it_says_so(printed):
    """Both cranks of the five-bar outward: its rods, 400 mm each, reach across the 800 mm between them."""
    ((_, numbers, note),) = rows(printed("modes", "five_bar", "--values", 180, 0))
    np.testing.assert_allclose(numbers[:2], [0.0, 0.0], atol=1e-6)
    assert "2 solutions coincide" in note


def test_where_there_is_no_mode_it_says_what_stays_open(printed):
    asked = "--values", 0.1, 2, 0.1, 2, 0.1, 2
    said = printed("modes", "gough", *asked, code=1)
    assert "no assembly mode" in said
    assert "There is none." in said
    assert "The closest configuration" in said
    assert rows(said) == []
    assert json.loads(printed("modes", "gough", *asked, "--json", code=1))[0]["modes"] == []
    assert printed("modes", "gough", *asked, "--view", code=1) == said


def test_what_is_not_proved_is_not_called_all(printed):
    path = Path(__file__).parents[1] / "robots/data/peaucellier.raff"
    said = " ".join(printed("modes", path).split())
    assert "4 assembly modes" in said
    assert "These are all" not in said
    assert "There may be more. Monodromy: 4 complex solutions" in said
    assert "the last 6 monodromy loops found no more; trace test satisfied to " in said
    assert "in infinitely many configurations (self-motions): joint6, joint7 move (1 DoF, a curve of degree 2)" in said
    assert "2 self-motions found; not excluded: modes and self-motions that neither paths nor 64 random starts" in said
    report = json.loads(printed("modes", path, "--json"))[0]
    assert (report["complete"], report["trace_test"]) == (False, True)
    curves = [(m["dimension"], m["degree"], m["moving"]) for m in report["self_motions"]]
    assert curves == [(1, 2, ["joint6", "joint7"])] * 2
    assert all(mode["isolated"] for mode in report["modes"])
