"""Numbers that a program can't mean: degrees for radians, mm for m, a rate for a period, a flag for a number."""

import numpy as np
import pinocchio as pin
import pytest

from cinegen import CinegenError, Solver, inverse_kinematics

FAR = pin.SE3(np.eye(3), np.array([300.0, 0.0, 0.0]))
DEGREES = [90.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]


@pytest.fixture
def arm7(robot):
    return robot("arm7")


@pytest.mark.parametrize(
    ("mistake", "remedy"),
    [
        (lambda solver: Solver(solver.mechanism, 240), "1/240"),
        (lambda solver: setattr(solver, "dt", 240.0), "1/240"),
        (lambda solver: setattr(solver, "q", DEGREES), "90 degrees, which are 1.571 rad"),
        (lambda solver: Solver(solver.mechanism, 0.01, DEGREES), "90 degrees, which are 1.571 rad"),
        (lambda solver: solver.add_task("tool", offset=FAR), "300 mm"),
        (lambda solver: solver.add_task("tool", FAR), "300 mm"),
        (lambda solver: solver.add_task("tool", rotation=True), "0 to 3 translations and rotations, not 3 and True"),
        (lambda solver: solver.remove_task("tool"), "a task that add_task returned"),
        (lambda solver: inverse_kinematics(solver.mechanism, {"tool": FAR}), "300 mm"),
        (
            lambda solver: inverse_kinematics(solver.mechanism, {"tool": pin.SE3.Identity()}, DEGREES),
            "90 degrees, which are 1.571 rad",
        ),
    ],
)
def test_what_cannot_be_meant_is_an_error_with_the_remedy(arm7, mistake, remedy):
    solver = Solver(arm7, 1 / 240)
    with pytest.raises(CinegenError, match=remedy):
        mistake(solver)
    assert not solver.tasks
    assert np.array_equal(solver.q, arm7.q_home)


def test_a_flag_set_later_is_no_number_of_axes(arm7):
    solver = Solver(arm7, 1 / 240)
    task = solver.add_task("tool")
    task.rotation = True
    assert solver.step().status.name == "BAD_TARGET"
    task.rotation = 3
    assert solver.step().status.name == "FOLLOWING"


def test_remedies_are_accepted(arm7):
    solver = Solver(arm7, 1 / 240, np.radians(DEGREES))
    solver.add_task("tool", pin.SE3(FAR.rotation, FAR.translation / 1000.0), offset=FAR.translation / 1000.0)
    assert solver.step().status.name != "BAD_TARGET"
