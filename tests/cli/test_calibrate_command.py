"""`cinegen calibrate`: from a file of measurements to a robot, its report, its picture and the next poses."""

from functools import partial

import pytest
from calibration_data import planar_arm

import raff2urdf


@pytest.fixture
def typed(printed, tmp_path):
    """`typed("planar_3r", "m.csv")`: what the command prints, in a folder with measurements."""
    (tmp_path / "m.csv").write_text(planar_arm(), encoding="utf-8")
    return partial(printed, "calibrate")


def test_the_robot_its_picture_and_the_next_poses_are_written(typed, tmp_path):
    words = "--vary", "link*.d", "--propose", 4, "--poses", "next.csv", "-o", "new.raff", "--plot", "residuals.png"
    printed = typed("planar_3r", "m.csv", *words)
    assert "1 outlier left out" in printed
    assert "pose 5, tool.y: -30" in printed
    assert "cross-validation, 5 parts" in printed
    robot = raff2urdf.load("new.raff").robot(None)
    assert abs(robot.nodes[2].parameters.d - 405.0) < 0.1  # mm
    lines = (tmp_path / "next.csv").read_text().splitlines()
    assert len(lines) == 2 + 4
    assert lines[0] == (tmp_path / "m.csv").read_text().splitlines()[0]
    assert all(line.endswith(",,") for line in lines[2:])
    assert (tmp_path / "residuals.png").read_bytes().startswith(b"\x89PNG")
    before = (tmp_path / "new.raff").read_text()
    assert "new.raff" in typed("planar_3r", "m.csv", "-o", "new.raff", code=1)  # nothing is replaced
    assert (tmp_path / "new.raff").read_text() == before


def test_what_is_written_twice(typed, tmp_path):
    """A gain counts once; one pose, however often it is measured, is no sign of a motion of the whole robot."""
    words = "planar_3r", "m.csv", "--vary", "link*.d", "--gain"
    assert typed(*words, "joint1,joint1") == typed(*words, "joint1")
    header, sigma, first, *_ = (tmp_path / "m.csv").read_text().splitlines()
    (tmp_path / "one.csv").write_text("\n".join([header, sigma, *[first] * 9]))
    printed = typed("planar_3r", "one.csv", "--vary", "link*.d")
    assert "can't be told apart" in printed
    assert "as one body" not in printed


def test_mistakes(typed, tmp_path):
    (tmp_path / "bad.csv").write_text("pose,joint1,joint3,tool.x\nsigma,,,1mm\na,1,2,x\n")
    assert "bad.csv, line 3, column tool.x: 'x' is not a length" in typed("planar_3r", "bad.csv", code=1)
    assert "--poses has no effect without --propose" in typed("planar_3r", "m.csv", "--poses", "p.csv", code=2)
    assert "--sigma" in typed("planar_3r", "m.csv", "--sigma", "link2.d", code=2)
    assert "is not above 0" in typed("planar_3r", "m.csv", "--sigma", "link2.d=0mm", code=1)
    assert "link2.r: it is not estimated" in typed(
        "planar_3r", "m.csv", "--vary", "*.d", "--sigma", "link2.r=1mm", code=1
    )
    unknown = typed("planar_3r", "m.csv", "--sigma", "lnk2.d=1mm, link2.q=1mm", code=1)
    assert "did you mean 'link2.d'" in unknown
    assert "link2 has no parameter 'q'" in unknown
    assert "absent.csv" in typed("planar_3r", "absent.csv", code=1)
    assert not (tmp_path / "new.raff").exists()
