"""Problems of a file that don't need each other are reported in one answer."""

import json
import re

import pytest

import cinegen
import raff2urdf
from cinegen.collision import SceneError, load_scene
from cinegen.design.calibration.measurements import Measurements
from cinegen.design.errors import DesignError
from cinegen.design.synthesis.task_file import load_task
from cinegen.mission import MissionError, MissionRecorder, Player, Recording, RobotSample
from cinegen.sensor import SensorError
from cinegen.toolpath.seam_file import read_points
from raff2urdf import RaffError

URDF = """<robot name="a"><link name="base"/><link name="arm"/>
<joint name="one" type="revolut"><parent link="bas"/><child link="arm"/></joint>
<joint name="two" type="fixed"><child link="arm"/></joint>
<joint name="three" type="prismatic"><parent link="arm"/><child link="hand"/><limit lower="2" upper="1"/></joint>
<link name="hand"><inertial><mass value="-1"/></inertial>
<visual><geometry><sphere radius="x"/></geometry></visual></link>
</robot>"""

MJCF = """<mujoco>
  <worldbody>
    <body name="a" pox="1 2 3">
      <joint name="one"
        type="revolute"/>
      <geom size="0.1"/>
      <body name="b" quat="0 0 0 0">
        <joint name="two" axis="1 x 0"/>
        <geom type="box" size="1"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="fiur"/><x:motor joint="two"/>
  </actuator>
  <equality>
    <connect name="e" body1="a" body2="c" anchor="0 0 0"/>
  </equality>
  <keyframe><key qpos="0 0 0"/></keyframe>
</mujoco>
"""

UNLIKE = """<mujoco>
  <worldbody><body><joint name="one"/><geom size="0.1"/></body><site name="p"/><site name="q"/></worldbody>
  <tendon><spatial name="t"><site site="p"/><site site="q"/></spatial></tendon>
  <equality><tendon name="first" tendon1="t"/><joint name="second" joint1="one"/><tendon name="third" tendon1="t"/>
  </equality>
</mujoco>
"""

TASK = """ties = 3
nodes = "end"
starts = 0
[parameters]
"link2.d" = 5
[reach]
x = "1..."
y = "5 parsec"
[[objective]]
maximise = "sigma"
[[objective]]
minimise = "sigma_1"
[constraints]
joint_limits = "yes"
mas = 3
mass = -1
[load]
payload = 0
wrench = [1, 2]
"""

SCENE = """robot = "planar_3r"
safety = -1
up = [0, 0, 0]
gaol = 3
node = "tol"
allowed_collisions = [["lnk1", "lnk2"]]
locked = ["a", "b"]
path = { upright = 1, line = [0, 0] }
start = { joints = { jiont1 = 1, joint2 = "x" } }
goal = { point = 5 }
attached = [{ kind = "bux", node = "tol" }]
[[obstacle]]
kind = "spere"
[[obstacle]]
kind = "sphere"
point = [1]
radus = 1
[[obstacle]]
kind = "cylinder"
radus = 1
length = -1
[[obstacle]]
kind = "mesh"
rpy = 0
scale = 0
file = "none.stl"
"""


def lines_of(error, call, *arguments):
    """The lines of the error of a call."""
    with pytest.raises(error) as caught:
        call(*arguments)
    return str(caught.value).splitlines()


def assert_told(wanted, said):
    assert [part in line for part, line in zip(wanted, said, strict=True)] == [True] * len(wanted), said


def assert_told_at(wanted, said, folder=None):
    """Each line begins with a place, and holds a pattern."""
    said = [line.removeprefix(f"{folder}/") for line in said]
    assert [line.partition(": ")[0] for line in said] == [place for place, _ in wanted]
    assert all(re.search(part, line) for (_, part), line in zip(wanted, said, strict=True))


SDF = """<sdf version="1.9"><model name="a"><link name="base"/>
<joint name="one" type="revolut"/><joint name="two" type="fixed"><parent>bas</parent></joint></model></sdf>"""


@pytest.mark.parametrize(("name", "text", "wanted"), [
    ("a.urdf", URDF, ("'revolut'", "'bas', which is not a link", "no <parent>", "limit", "mass", "radius")),
    ("a.sdf", SDF, ("'revolut'", "'bas'")),
    ("a.xml", UNLIKE, ("'first' constrains the spatial", "'third' constrains the spatial")),
])  # fmt: skip
def test_a_robot(tmp_path, name, text, wanted):
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert_told(wanted, lines_of(RaffError, raff2urdf.to_raff, tmp_path / name, tmp_path / "a.raff"))


def test_a_scene(text_file):
    path = text_file("a.toml", SCENE)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    wanted = (
        "safety must not be", "up must be", "'spere'", "obstacle 2: point must", "obstacle 2: radius is missing",
        "obstacle 3: radius is missing: is 'radus'", "obstacle 3: length", "obstacle 4: rpy", "obstacle 4: scale",
        "obstacle 4: file", "unknown key 'gaol'",
        "node 'tol' is not a node", "'lnk1' is not a node", "'lnk2' is not a node", "upright must", "line must",
        "'jiont1' is not a joint", "joint2 is wrong", "goal: point must",
        "locked 'a' is not", "locked 'b' is not", "attached 1: node 'tol'", "attached 1: kind 'bux'",
    )  # fmt: skip
    assert_told(wanted, caught.value.lines)
    assert str(caught.value).splitlines() == [*caught.value.lines[:20], f"and {len(wanted) - 20} more"]


@pytest.mark.parametrize(("changed", "wanted"), [
    ("robot = 'no.raff'\nsafety = -1\nnode = 'x'\ngoal = {}", ("safety", "no.raff' does not exist")),
    ("mobile = { radius = 0.1 }\nlocked = ['a']\nnode = 'x'\ngoal = { point = 1 }\n[path]\n[[attached]]",
     ("node 'x'", "path is for robots", "goal: point", "locked 'a'", "attached is for robots")),
    ("robot = 'planar_3r'\n[start.joints]\na = 1\n[goal.joints]\nb = 2\njoint1 = 'x'",
     ("start: joints: 'a'", "goal: joints: 'b'", "goal: joints: joint1")),
])  # fmt: skip
def test_other_scenes(text_file, changed, wanted):
    assert_told(wanted, lines_of(SceneError, load_scene, text_file("a.toml", changed)))


def test_an_mjcf(tmp_path, text_file):
    """MuJoCo itself stops at the first: what it names is left out, and only then it reads on."""
    path = text_file("a.xml", MJCF)
    wanted = (
        (3, "'pox'"), (5, "'revolute' .*: did you mean 'hinge'"), (7, "zero quaternion"),
        (8, "bad format in attribute 'axis'"), (9, "size 1 must be positive"), (14, "element .* 'x:motor'"),
        (14, "target 'fiur'"), (17, "unknown element 'c'"),
    )  # fmt: skip
    said = lines_of(RaffError, raff2urdf.to_raff, path, tmp_path / "a.raff")
    assert_told_at([(f"a.xml:{number}", part) for number, part in wanted], said, tmp_path)


def test_an_mjcf_that_includes_others(tmp_path):
    """Files are included by files that are included; names are those of all files."""
    (tmp_path / "parts").mkdir()
    files = {
        "a.xml": """<mujoco><compiler angle="gradian"/>
            <include file="gone.xml"/>
            <worldbody><body name="a" pox="1"><joint name="one"/><geom size="0.1"/>
                <include file="parts/arm.xml"/></body></worldbody>
            <include file="drives.xml"/>
            <include file="a.xml"/></mujoco>""",
        "parts/arm.xml": """<mujocoinclude><body name="b"><joint name="two" axis="0 0 0"/><geom size="0.1"/>
            <joint name="one"/>
            <include file="hand.xml"/></body></mujocoinclude>""",
        "parts/hand.xml": '<mujocoinclude>\n<geom sizy="1"/></mujocoinclude>',
        "drives.xml": '<mujocoinclude><actuator>\n<motor joint="twi"/></actuator></mujocoinclude>',
    }
    wanted = [
        ("a.xml:1", "'gradian'"), ("a.xml:2", "there is no file 'gone.xml'"), ("a.xml:3", "'pox'"),
        ("a.xml:6", "'a.xml' is already included"),
        ("parts/arm.xml:1", "axis too small"), ("parts/arm.xml:2", "repeated name 'one'"),
        ("drives.xml:2", "'twi' .*: did you mean 'two'"), ("parts/hand.xml:2", "'sizy'"),
    ]  # fmt: skip
    for head, unsaid in (('<include file="gone.xml"/>', "twi"), ("", "gone")):  # 'twi' may be a name of that file
        for name, text in files.items():
            (tmp_path / name).write_text(text.replace('<include file="gone.xml"/>', head), encoding="utf-8")
        said = lines_of(RaffError, raff2urdf.to_raff, tmp_path / "a.xml", tmp_path / "a.raff")
        assert_told_at([(place, part) for place, part in wanted if unsaid not in part], said, tmp_path)


def test_an_mjcf_that_attaches_others(tmp_path):
    """What is wrong in a file that is attached is told of that file; names of it are not missed then."""
    sub = """<mujoco model="s"><worldbody><body name="b"><geom size="0.1" colour="red"/>
        <joint name="j" axis="0 0 0"/>
        <joint name="k" range="1 -1" limited="true"/></body></worldbody></mujoco>"""
    right = '<mujoco model="t"><worldbody><body name="c"><geom size="1"/><joint name="j"/></body></worldbody></mujoco>'
    text = """<mujoco><asset><model file="sub.xml"/><model name="u" file="right.xml"/></asset>
        <worldbody><body name="a"><geom size="0.1"/><joint type="hige"/>
            <attach model="s" body="b" prefix="s-"/>
            <attach model="u" body="d" prefix="t-"/>
        </body></worldbody>
        <actuator><motor joint="t-j"/></actuator></mujoco>"""
    (tmp_path / "right.xml").write_text(right, encoding="utf-8")
    of_all = [("a.xml:2", "'hige' .*: did you mean 'hinge'"), ("a.xml:4", "could not find body 'd'")]
    of_sub = [("sub.xml:1", "'colour'"), ("sub.xml:2", "axis too small"), ("sub.xml:3", "swap them")]
    itself = text.replace("right.xml", "a.xml")
    for content, inner, wanted in (
        (text, sub, [*of_all, *of_sub]), (text, right.replace('"c"', '"b"').replace('"t"', '"s"'), of_all),
        (itself, right, [("a.xml", "a file attaches itself: a.xml names a.xml")]),
    ):  # fmt: skip
        (tmp_path / "a.xml").write_text(content, encoding="utf-8")
        (tmp_path / "sub.xml").write_text(inner, encoding="utf-8")
        said = lines_of(RaffError, raff2urdf.to_raff, tmp_path / "a.xml", tmp_path / "a.raff")
        assert_told_at(wanted, said, tmp_path)


def test_measurements():
    """What can't be read of a line or a column is no reason for another message."""
    text = """pos, joint1 [deg], joint3 [mm], tol.x [mm], tool.y [mm], tool.x [mm], tool.y [mm], tool.rz [deg]
        sigma, , , , 0.05, x, 0.1,
        1, 12.5, 30, 4, 5, 6, 7, 1
        2, 14.0, 35, 4, 5.x, 6, 7, 1
        3, 14.0, 35
        sigma, -1, , , 0, 1, 1, 0.1
        4, 1 parsec, 35, 4, 5, six, 7, 2
        """
    wanted = (
        "line 1: the first column is 'pose'", "line 1, column 3: joint3", "line 1, column 4: 'tol.x'",
        "line 1, column 7: tool.y has two", "line 2, column tool.x: 'x'", "line 3, column tool.rz: no sigma",
        "line 4, column tool.y: '5.x'", "line 5: 3 cells", "line 6, column joint1: a standard deviation",
        "line 6, column tool.y: a standard deviation", "line 7, column joint1: '1 parsec'",
        "line 7, column tool.x: 'six'",
    )  # fmt: skip
    mechanism = cinegen.load("five_bar")
    assert_told(wanted, lines_of(DesignError, Measurements.loads, text, mechanism))
    units = "pose, joint1, tool.x, tool.y\nsigma, , 1, 1\n1, 1rad, 400, 0.1\n2, 1rad, 410, 0.1\n3, 1rad, 410, 300"
    said = lines_of(DesignError, Measurements.loads, units, mechanism)
    assert_told(("line 3, column tool.x", "line 5, column tool.y"), said)  # of each column the first


def test_a_seam(text_file):
    path = text_file("a.csv", "x [mm], y, z, nx, ny, nz\n1,2,3,0,0,1\na,2,b,0,0,1\n1,2,3\n\n4,5,6,0,0,u")
    assert_told((":3: x:", ":3: z:", ":4: 3 values", ":6: nz:"), lines_of(SensorError, read_points, path))
    path.write_text("x, y, z, nx\n1,2,3,0", encoding="utf-8")
    assert_told((":1: no column 'ny';", ":1: no column 'nz';"), lines_of(SensorError, read_points, path))


def test_a_mission(tmp_path):
    path = tmp_path / "a.jsonl"
    arms = {"one": cinegen.load("planar_3r"), "two": cinegen.load("five_bar")}
    with MissionRecorder(path, arms) as recorder:
        for time in range(8):
            recorder.write(float(time), {name: RobotSample(arm.q_home, f"{time}") for name, arm in arms.items()})
    lines = path.read_text().splitlines()
    lines[0] = lines[0].replace("revolute", "revolite")
    lines[2] = lines[2].replace('"one"', '"none"')
    lines[3] = lines[3].replace('"q":[', '"q":[0,')
    lines[4] = '{"t":0,"robots":{},"obstacles":{"box":[0,0,0,0,0,0,1]}}'
    lines[6] = lines[6][:20]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    said = lines_of(MissionError, Recording.load, path)
    wanted = (
        ":3: robot 'none'", ":4: Expected `array` of length 3 - at `$.robots.one.q`", ":4: Expected `array` of length",
        ":5: obstacle 'box'", ":5: Expected a time after", ":7: ",
    )  # fmt: skip
    assert_told(wanted, said)
    path.write_text(lines[0] + "\n", encoding="utf-8")
    assert_told(("'one' was changed", "'two' was changed"), lines_of(MissionError, Player, Recording.load(path)))
    header = json.loads(lines[0])
    header["robots"]["one"] |= {"nq": "3", "index": [0, "x", 2.5], "base": {"placement": [0] * 7, "noed": 1}}
    del header["robots"]["two"]["urdf"], header["created"]
    path.write_text(json.dumps(header) + "\n", encoding="utf-8")
    said = lines_of(MissionError, Recording.load, path)
    wanted = (
        "line 1: Object missing required field `created` - at `$`", "robots.one.index[1]`", "robots.one.index[2]`",
        "got `str` - at `$.robots.one.nq`", "unknown field `noed` - at `$.robots.one.base`", "quaternion of length 1",
        "missing required field `urdf` - at `$.robots.two`",
    )  # fmt: skip
    assert len(said) == len(wanted), said
    assert [sum(part in line for line in said) for part in wanted] == [1] * len(wanted), said


def test_a_task_of_a_synthesis(text_file):
    path = text_file("a.toml", TASK)
    wanted = (
        "parameters: link2.d must be a string", "ties must be", "x is wrong", "y is wrong", "'sigma' is none of",
        "write maximise", "starts must be", "joint_limits must be", "mass must be above 0", "unknown key 'mas'",
        "payload must be above 0", "wrench must be", "unknown key 'nodes'",
    )  # fmt: skip
    said = lines_of(DesignError, load_task, path)
    assert all(line.startswith(str(path)) for line in said)
    assert_told(wanted, said)
