"""Singular curves on slices, against closed forms; and the command that draws and writes them."""

import json
import math

import numpy as np
import pytest

from cinegen.mission import MissionRecorder, RobotSample
from cinegen.plotting.loci import draw_loci
from cinegen.singularities import SingularityType, singularity
from cinegen.singularities.crossing import _alignment
from cinegen.singularities.loci import singular_loci
from cinegen.singularities.slice import Axis, Coordinates, Slice, SliceError, about_home


@pytest.fixture(scope="module")
def five_bar(robot):
    """The whole plane of the five-bar's tool."""
    of = Slice(robot("five_bar"), (Axis("x", -0.7, 0.7), Axis("y", -0.55, 0.72)))
    return singular_loci(of, 12)


def test_a_five_bar_is_singular_of_type_1_on_circles_about_its_motors(five_bar):
    """Arms of 250 and 400 about (-150, 0) and (150, 0): stretched at 650, folded at 150."""
    curves = [curve for curve in five_bar.curves if curve.kind is SingularityType.TYPE_1]
    assert {curve.kind for curve in five_bar.curves if curve.border} == {SingularityType.TYPE_1}
    points = np.vstack([curve.points for curve in curves])
    away = np.array([np.hypot(points[:, 0] - x, points[:, 1]) for x in (-0.15, 0.15)])
    off = np.abs(away[:, :, None] - [0.65, 0.15]).min(axis=(0, 2))
    assert off.max() < 1e-6
    # all four circles, as far as they bound what can be reached
    for x in (-0.15, 0.15):
        for radius in (0.65, 0.15):
            assert (np.abs(np.hypot(points[:, 0] - x, points[:, 1]) - radius) < 1e-6).sum() > 4
    across = [np.hypot(*np.meshgrid(five_bar.u - x, five_bar.v, indexing="ij")) for x in (-0.15, 0.15)]
    inside = np.all([(distance > 0.15) & (distance < 0.65) for distance in across], axis=0)
    assert (five_bar.reached == inside).all()


def test_and_of_type_2_on_the_circle_about_elbows_that_fall_together(five_bar):
    """Inner bars of 250 let the elbows meet at (0, 200), and at (0, -200)."""
    curves = [curve for curve in five_bar.curves if curve.kind is SingularityType.TYPE_2]
    assert sum(len(curve.points) for curve in curves) > 3
    for curve in curves:
        for (u, v), q in zip(curve.points, curve.q, strict=True):
            assert min(abs(np.hypot(u, v - y) - 0.4) for y in (-0.2, 0.2)) < 1e-6
            kind = singularity(five_bar.of.mechanism, q, tolerance=1e-5).kind
            assert kind in (SingularityType.TYPE_2, SingularityType.BOTH)
            assert np.allclose(five_bar.of.mechanism.placement(q, "tool").translation[:2], (u, v), atol=1e-9)


def test_over_two_motors_a_serial_arm_is_singular_where_it_is_stretched(robot):
    of = Slice(robot("planar_3r"), (Axis("joint2", -0.8, 0.9), Axis("joint3", -0.9, 0.8)), {"joint1": 0.3})
    loci = singular_loci(of, 8)
    points = np.vstack([curve.points for curve in loci.curves])
    assert {curve.kind for curve in loci.curves} == {SingularityType.TYPE_1}
    assert np.abs(points[:, 0]).max() < 1e-6  # of a 3R with its orientation: joint 2 alone decides


def test_the_picture_and_the_numbers_say_the_same(five_bar):
    figure = draw_loci(five_bar)
    axes = figure.axes[0]
    drawn = sum(len(line.get_xdata()) for line in axes.lines)
    assert drawn == sum(len(curve.points) for curve in five_bar.curves) + 1  # and home
    assert axes.get_xlabel() == "x (m)"
    said = five_bar.as_dict()
    assert json.loads(json.dumps(said)) == said
    assert len(said["type 1"]) == len(said["u"])


@pytest.mark.parametrize(("name", "axes", "fixed", "words"), [
    ("delta4", ("x", "rz"), {}, "rz of platform can't be given independently of x, y, z"),
    ("gough", ("x", "y"), {"y": 0.0}, "given twice: x, y, y"),
])  # fmt: skip
def test_coordinates_that_make_no_slice_are_told(robot, name, axes, fixed, words):
    with pytest.raises(SliceError, match=words.replace("(", r"\(")):
        Slice(robot(name), (Axis(axes[0], -0.1, 0.1), Axis(axes[1], -0.1, 0.1)), fixed)


def test_a_slice_out_of_reach_and_a_range_without_extent_are_told(robot):
    far = Slice(robot("five_bar"), (Axis("x", 3.0, 4.0), Axis("y", -0.1, 0.1)))
    with pytest.raises(SliceError, match="no point of this slice over x and y can be reached from home"):
        singular_loci(far, 5)
    with pytest.raises(SliceError, match="x from 1 to 1 is no range"):
        Slice(robot("five_bar"), (Axis("x", 1.0, 1.0), Axis("y", -0.1, 0.1)))
    with pytest.raises(SliceError, match="a grid of 1 points has no cells"):
        singular_loci(far, 1)


def test_a_joint_with_equal_limits_has_no_range_about_home(raff):
    arm = raff("robot r { base { } link 1 { type 2 pred 0 parameters { theta 10 d 300 } limits { 10 10 } } }")
    with pytest.raises(SliceError, match=r"joint1 can't move: its limits are equal\. Name another"):
        about_home(arm, "joint1")


# --- the command -------------------------------------------------------------------------------------------------


def test_the_command_says_what_is_singular_at_a_pose(root, typed):
    said = typed("singular", root / "robots/tssm.raff", "--at", "x=0,y=0,z=20mm,rx=0,ry=0,rz=90").out
    assert said.startswith("tssm: type 2")
    assert "general complex (5a): all six legs belong to one linear complex" in said


def test_the_command_draws_and_writes_a_scan(root, tmp_path, monkeypatch, typed):
    monkeypatch.chdir(tmp_path)
    file = str(root / "robots/five_bar.raff")
    said = typed("singular", file, "--over", "x=-650..650mm,y=-0.5..0.65", "--grid", "5").out
    assert "five_bar-singular.png and five_bar-singular.json are written" in said
    assert (tmp_path / "five_bar-singular.png").read_bytes().startswith(b"\x89PNG")
    written = json.loads((tmp_path / "five_bar-singular.json").read_text())
    assert written["axes"] == ["x", "y"]
    assert {curve["kind"] for curve in written["curves"]} >= {"type 1"}


def test_the_command_finds_where_a_recorded_way_is_singular_between_its_samples(robot, tmp_path, typed):
    """The TSSM's platform turned from 80 degrees to 100 over the base: Fichter's singularity is at 90."""
    mechanism = robot("tssm")
    pose = {"x": 0.0, "y": 0.0, "z": 0.02, "rx": 0.0, "ry": 0.0}
    turns = np.radians([80.0, 84.0, 88.0, 92.0, 96.0, 100.0])
    coordinates = Coordinates(mechanism, (*pose, "rz"))
    with MissionRecorder(tmp_path / "run.jsonl", {"tssm": mechanism}) as recorder:
        for k, turn in enumerate(turns):
            recorder.write(float(k), {"tssm": RobotSample(coordinates.from_home({**pose, "rz": turn}), "IDLE")})
    (report,) = json.loads(typed("singular", tmp_path / "run.jsonl", "--json").out)
    (passed,) = [entry for entry in report["found"] if "passed" in entry["kind"] and "type 2" in entry["kind"]]
    assert 2.0 < passed["time"] < 3.0
    assert coordinates.coordinates(np.array(passed["q"]))["rz"] == pytest.approx(0.5 * math.pi, abs=1e-3)


@pytest.mark.parametrize(("code", "arguments", "words"), [
    (1, ["--over", "x"], "--over x: name two coordinates"),
    (1, ["--at", "jont1=10"], "no coordinate 'jont1' here (did you mean 'joint1'?): there are x, y, z, rx, ry, rz"),
    (1, ["--at", "joint1=10,x=1"], "no coordinate 'joint1' here: there are"),
    (1, ["--at", "joint2=10"], "no coordinate 'joint2' here (this joint is not actuated): there are"),
    (1, ["--at", "x=90"], "--at x: 90 m is far beyond the reach of linkage, at most 0.8 m: did you mean 90 mm?"),
    (1, ["--over", "x=-550..550,y=-700..700"], "did you mean -550 mm?"),
    (1, ["--over", "rz=-7..7rad,x"], "more than one revolution: did you mean -7..7deg?"),
    (1, ["--at", "x=0.9"], "--at x=0.9 can't be reached along a straight line from home on its branch"),
    (1, ["--over", "x,y", "--grid", "3", "--plot", "a.tiff9"], "a.tiff9: can't be written"),
    (2, ["--over", "x=1,y"], "'1' is one number: write LOW..HIGH"),
    (2, ["--over", "x=1..b,y"], "--over: x: 'b' is not a length"),
    (2, ["--at", "x"], "'x': write NAME=VALUE, such as x=0.1 or rz=15 (m and degrees)"),
    (2, ["--at", "joint1=1m"], "--at: joint1: '1m' is a length: an angle is wanted"),
    (2, ["--at", "x=1,x=2"], "--at: x is given twice"),
])  # fmt: skip
def test_what_the_command_cant_do_and_numbers_that_are_none_are_told(
    root, tmp_path, monkeypatch, typed, code, arguments, words
):
    monkeypatch.chdir(tmp_path)
    assert words in typed("singular", root / "robots/five_bar.raff", *arguments, code=code).err


@pytest.mark.parametrize("size", [5.0, -5.0])
def test_of_a_single_singular_value_the_sign_is_sure_however_far_apart_matrices_are(size):
    """There is no next one that it could change places with."""
    a, b = np.array([[1.0, 0.0]]), np.array([[size, 0.1]])
    alignment, is_sure = _alignment(a, b, 1)
    assert alignment == pytest.approx(size / np.hypot(size, 0.1))
    assert is_sure
