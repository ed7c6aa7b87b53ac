"""A `robot.yaml` beside a URDF: loops between frames, motors, joints that become others."""

import numpy as np
import pytest
from urdf_text import joint_at, limit, links, robot

import cinegen
import raff2urdf

LINKS = ("ground", "crank", "coupler", "end_a", "rocker", "end_b")
JOINTS = (
    ("drive", "ground", "crank", "0 0 0"),
    ("elbow", "crank", "coupler", "0.2 0 0"),
    ("loop_A", "coupler", "end_a", "0.4 0 0"),
    ("swing", "ground", "rocker", "0.4 0 0"),
    ("loop_B", "rocker", "end_b", "0.2 0.1 0"),
)
URDF = robot(links(*LINKS), *(joint_at(*joint, limit(-4, 4), "revolute") for joint in JOINTS), name="linkage")
YAML = """closed_loop: [['loop_A', 'loop_B']]
type: ['6d']
name_mot: ['drive']
"""


@pytest.fixture
def write(tmp_path):
    def write(yaml=YAML, urdf=URDF, name="robot.yaml"):
        (tmp_path / "robot.urdf").write_text(urdf)
        (tmp_path / name).write_text(yaml)
        return tmp_path / "robot.urdf"

    return write


def test_a_closed_loop_joins_the_frames_behind_its_joints(write):
    mechanism = cinegen.load(write())
    (loop,) = mechanism.loops
    assert (loop.name, loop.first, loop.second, loop.rows) == ("loop_A-loop_B", "end_a", "end_b", 6)
    assert mechanism.actuated == ("drive",)
    assert mechanism.mobility == 2  # the pin itself may turn
    assert mechanism.closure(mechanism.q_home) < 1e-12
    assert mechanism.gap_as_written > 0.1


@pytest.mark.parametrize(("kind", "joints"), [
    ("SPHERICAL", ("elbow_X", "elbow_Y", "elbow_Z")),
    ("UJOINT_XY", ("elbow_X", "elbow_Y")),
    ("UJOINT_ZX", ("elbow_Z", "elbow_X")),
    ("FIXED", ()),
])  # fmt: skip
def test_joints_are_replaced(write, kind, joints):
    extra = f"joint_name: ['elbow']\njoint_type: ['{kind}']\n"
    mechanism = cinegen.load(write("name_mot: [drive, swing]\n" + extra))
    assert tuple(joint for joint in mechanism.joints if joint.startswith("elbow")) == joints
    assert (mechanism.nodes, mechanism.actuated) == (LINKS, ("drive", "swing"))
    if len(joints) > 1:
        first = mechanism.jacobian(mechanism.q_home, "coupler")[3:, mechanism.v_index(joints[0])]
        assert np.allclose(np.abs(first), np.eye(3)["XYZ".index(joints[0][-1])])


def test_a_motor_of_several_freedoms_drives_all_of_them(write):
    text = "name_mot: [elbow]\njoint_name: [elbow]\njoint_type: [UJOINT_YZ]\n"
    assert cinegen.load(write(text)).actuated == ("elbow_Y", "elbow_Z")


def test_without_motors_they_are_chosen(write):
    mechanism = cinegen.load(write(YAML.replace("name_mot: ['drive']", "name_mot: []").replace("6d", "3d")))
    assert len(mechanism.actuated) == mechanism.mobility
    assert "drive" in mechanism.actuated


def test_a_joint_that_is_not_there_is_not_replaced_and_told(write):
    text = YAML + "joint_name: ['elbo']\njoint_type: ['SPHERICAL']\n"
    with pytest.warns(raff2urdf.RaffWarning, match=r"robot.yaml:4: joint 'elbo' is not in the URDF.*mean 'elbow'"):
        assert "elbow" in cinegen.load(write(text)).joints


@pytest.mark.parametrize(("change", "says"), [
    (("'loop_B'", "'loop_C'"), r"robot.yaml:1: .*no joint or link 'loop_C': did you mean 'loop_A' or 'loop_B'"),
    (("['6d']", "6d"), r"robot.yaml:2: type must be a list"),
    (("'loop_A', ", ""), r"robot.yaml:1: a closed loop must be a pair of frames"),
    (("'drive'", "'driver'"), r"robot.yaml:3: 'driver' in name_mot is not a joint that moves: did you mean 'drive'"),
    (("['drive']", "['drive'"), r"robot.yaml:\d: invalid YAML"),
    ((YAML, "- a\n"), r"robot.yaml:1: it must hold closed_loop"),
    ((YAML, YAML + "joint_name: [elbow]\njoint_type: [HINGE]\n"), r"robot.yaml:5: .*not 'HINGE'"),
])  # fmt: skip
def test_what_is_wrong_is_told_by_its_line(write, change, says):
    assert change[0] in YAML
    with pytest.raises(cinegen.CinegenError, match=says):
        cinegen.load(write(YAML.replace(*change)))


def test_a_yaml_of_another_program_is_passed_over(tmp_path):
    (tmp_path / "r.urdf").write_text('<robot name="r"><link name="a"/></robot>')
    (tmp_path / "r.yaml").write_text("controllers: [a]\n")
    assert cinegen.load(tmp_path / "r.urdf").loops == ()
