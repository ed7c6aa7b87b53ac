"""`cinegen calibrate`: from a file of measurements to a robot, its report, its picture and the next poses."""

from functools import partial

import numpy as np
import pytest

import raff2urdf
from cinegen.design import Design, Measurements, Parameters
from cinegen.design.calibration.observation import Observation
from cinegen.design.poses import random_poses


@pytest.fixture
def typed(printed, tmp_path):
    """`typed("five_bar", "m.csv")`: what the command prints, in a folder with measurements of a five-bar whose link 2
    is 1 mm longer; pose 5 has an outlier of 3 mm."""
    parameters = Parameters("five_bar", ["*.d"])
    mechanism = parameters.mechanism
    q = random_poses(Design(parameters), 20, 1, 0.6)
    columns = [*mechanism.actuated, "tool.x", "tool.y"]
    values = np.column_stack([q[:, mechanism.q_index(joint)] for joint in mechanism.actuated] + [np.zeros((20, 2))])
    sigmas = [0.0, 0.0, 2e-5, 2e-5]
    observation = Observation(parameters, Measurements.of(mechanism, columns, values, sigmas))
    truth = parameters.with_changed({"link2.d": "251mm"})
    values[:, 2:] = observation.predict(truth, derivatives=False).values
    values[:, 2:] += 2e-5 * np.random.default_rng(3).normal(size=(20, 2))
    values[4, 3] += 3e-3
    (tmp_path / "m.csv").write_text(Measurements.of(mechanism, columns, values, sigmas).text())
    return partial(printed, "calibrate")


def test_the_robot_its_picture_and_the_next_poses_are_written(typed, tmp_path):
    words = "--vary", "link*.d", "--propose", 4, "--poses", "next.csv", "-o", "new.raff", "--plot", "residuals.png"
    printed = typed("five_bar", "m.csv", *words)
    assert "1 outlier left out" in printed
    assert "pose 5, tool.y: -3.0" in printed
    assert "cross-validation, 5 parts" in printed
    robot = raff2urdf.load("new.raff").robot(None)
    assert abs(robot.nodes[2].parameters.d - 251.0) < 0.1  # mm
    lines = (tmp_path / "next.csv").read_text().splitlines()
    assert len(lines) == 2 + 4
    assert lines[0] == (tmp_path / "m.csv").read_text().splitlines()[0]
    assert all(line.endswith(",,") for line in lines[2:])
    assert (tmp_path / "residuals.png").read_bytes().startswith(b"\x89PNG")
    before = (tmp_path / "new.raff").read_text()
    assert "new.raff" in typed("five_bar", "m.csv", "-o", "new.raff", code=1)  # nothing is replaced
    assert (tmp_path / "new.raff").read_text() == before


def test_mistakes(typed, tmp_path):
    (tmp_path / "bad.csv").write_text("pose,joint1,joint3,tool.x\nsigma,,,1mm\na,1,2,x\n")
    assert "bad.csv, line 3, column tool.x: 'x' is not a length" in typed("five_bar", "bad.csv", code=1)
    assert "--poses has no effect without --propose" in typed("five_bar", "m.csv", "--poses", "p.csv", code=2)
    assert "--sigma" in typed("five_bar", "m.csv", "--sigma", "link2.d", code=2)
    assert "is not above 0" in typed("five_bar", "m.csv", "--sigma", "link2.d=0mm", code=1)
    assert "absent.csv" in typed("five_bar", "absent.csv", code=1)
    assert not (tmp_path / "new.raff").exists()
