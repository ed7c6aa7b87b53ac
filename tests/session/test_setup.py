"""What a session is made of: sensors by file, stands, robots side by side, and where robots start."""

import re
import warnings

import numpy as np
import pinocchio as pin
import pytest
from example_robots import SHARE, UR5

import cinegen
from cinegen import load
from cinegen.devices import fit_path
from cinegen.errors import UnknownNameError
from cinegen.mission import BasePose
from cinegen.session import Session, Setup, SetupError, arrange
from cinegen.session.arrangement import parse_base_pose
from cinegen.session.regular_start import _singular_values, regular_start


@pytest.mark.parametrize(
    ("text", "name", "stand"),
    [
        ("arm=delta4.platform", "arm", ("delta4", "platform", [0, 0, 0], [0, 0, 0])),
        ("arm=two.left.tool", "arm", ("two.left", "tool", [0, 0, 0], [0, 0, 0])),
        ("arm=1,-2,0.5", "arm", (None, None, [1, -2, 0.5], [0, 0, 0])),
        ("arm=1,2,3,0,0,90", "arm", (None, None, [1, 2, 3], [0, 0, np.pi / 2])),
        ("arm=delta4.platform@0,0,-0.1,180,0,0", "arm", ("delta4", "platform", [0, 0, -0.1], [np.pi, 0, 0])),
    ],
)
def test_a_stand_is_read(text, name, stand):
    robot, node, place, turn = stand
    robot_name, said = parse_base_pose(text)
    assert (robot_name, said.robot, said.node) == (name, robot, node)
    assert said.placement.isApprox(pin.SE3(pin.rpy.rpyToMatrix(*map(float, turn)), np.array(place, dtype=float)))


@pytest.mark.parametrize("text", ["", "arm", "arm=", "=1,2,3", "arm=1,2", "arm=delta4", "arm=a.b@", "arm=.b"])
def test_what_is_no_stand_is_told(text):
    with pytest.raises(SetupError, match="write NAME="):
        parse_base_pose(text)


def test_numbers_of_a_base_pose_may_have_units(robot):
    assert parse_base_pose("arm=1000mm,0,0.5m,0.5rad,0,0")[1].placement.translation.tolist() == [1.0, 0.0, 0.5]
    for text, why in (
        ("arm=1,2,nan", "'nan' is not a length"),
        ("arm=1,2,3deg", "'3deg' is an angle: a length is wanted"),
        ("arm=1,2,500mm", "can be read two ways"),
        ("arm=1,2,3,4m,5,6", "'4m' is a length: an angle is wanted"),
    ):
        with pytest.raises(SetupError, match=why):
            parse_base_pose(text)
    with pytest.raises(SetupError, match=r"--base arm: 1000 m is far beyond the reach .* did you mean 1000 mm"):
        arrange({"arm": robot("planar_3r")}, bases=["arm=1000,0,0"])


def test_robots_on_each_other_come_behind_those_that_carry_them(robot):
    robots = {name: robot("planar_3r") for name in "abc"}
    end = robots["a"].end
    setup = Setup(robots, {"a": BasePose("c", end), "c": BasePose("b", end)})
    assert setup.order() == ("b", "c", "a")
    with pytest.raises(SetupError, match="a, b carry each other"):
        Setup({name: robots[name] for name in "ab"}, {"a": BasePose("b", end), "b": BasePose("a", end)})
    with pytest.raises(UnknownNameError, match="no robot 'd'"):
        Setup(robots, {"a": BasePose("d", end)})
    with pytest.raises(UnknownNameError, match="no node 'nose'"):
        Setup(robots, {"a": BasePose("b", "nose")})


def test_robots_of_several_files_stand_side_by_side_and_those_of_one_as_it_says(robot):
    robots = {"delta": robot("delta4"), "arm": robot("rx90"), "bars": robot("four_bar")}
    files = {"delta": "one", "arm": "two", "bars": "two"}
    assert arrange(robots).bases == {}
    setup = arrange(robots, files)
    assert "delta" not in setup.bases
    assert setup.bases["arm"].placement == setup.bases["bars"].placement
    ends = {}
    for name, mechanism in robots.items():
        shift = setup.base(name).placement.translation[0]
        x = [mechanism.placement(mechanism.q_home, node).translation[0] + shift for node in mechanism.nodes]
        ends[name] = min(x), max(x)
    assert ends["delta"][1] < min(ends["arm"][0], ends["bars"][0])
    moved = arrange(robots, files, bases=["arm=0,1,0"])
    assert moved.bases["arm"].placement.translation.tolist() == [0, 1, 0]


def test_a_files_sensors_are_its_own(robot):
    robots = {"a": robot("delta4"), "b": robot("delta4")}
    setup = arrange(robots)
    assert [device.name for device in setup.devices] == ["1", "gamepad"]
    assert [switch.choices for switch in setup.switches] == [(None, "1", "gamepad")] * 2
    two = arrange(robots, {"a": "a.raff", "b": "b.raff"})
    assert [device.name for device in two.devices] == ["a.raff 1", "b.raff 1", "gamepad"]


def test_another_port_is_chosen_from_the_beginning(robot):
    setup = arrange({"delta": robot("delta4")}, sensors=["1=spnav:", "link5=tcp://127.0.0.1:0"], follow="circle")
    assert {switch.node: switch.first for switch in setup.switches} == {"platform": "1", "link5": "link5"}
    assert {device.name: device.url for device in setup.devices} == {
        "1": "spnav:", "link5": "tcp://127.0.0.1:0", "path": "path:circle", "gamepad": "gamepad:",
    }  # fmt: skip
    assert [device.name for device in setup.devices if device.token] == ["link5"]


ITS_SENSOR = """robot r { base { } link 1 { parameters { d 100 } type 2 pred 0 } frame 2 { parameters { d 100 } pred 1 }
  constraint { frame 2 sensor ( 0 1 ) } } sensor 1 { port "%s" }"""


@pytest.mark.parametrize("host", ["0.0.0.0", "[::]", "robot.example"])
def test_a_file_can_not_open_a_port_to_other_machines_but_the_command_line_can(raff, host):
    url = f"tcp://{host}:7070"
    with pytest.raises(SetupError, match="would let other machines drive the robot"):
        arrange({"r": raff(ITS_SENSOR % url)})
    with pytest.warns(cinegen.CinegenWarning, match="every machine that reaches this port can drive the robot"):
        asked = arrange({"r": raff(ITS_SENSOR % url)}, sensors=[f"1={url}"])
    assert [device.url for device in asked.devices if device.name == "1"] == [url]
    for loopback in ("tcp://127.0.0.1:7070", "tcp://[::1]:7070", "tcp://localhost:7070", "tcp://:7070"):
        assert arrange({"r": raff(ITS_SENSOR % loopback)}).devices


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("tcp://127.0.0.1:7070?no-token", "would choose which programs can drive the robot"),
        ("tcp://127.0.0.1:7070?token=known", "would choose which programs can drive the robot"),
        ("spy:///dev/ttyUSB0?file=/tmp/written", "would open a file"),
        ("SPY://loop://?file=/tmp/written", "would open a file"),
        ("replay:/etc/passwd", "would open a file"),
        ("socket://10.0.0.1:22", "would connect to a server"),
        ("rfc2217://127.0.0.1:22", "would connect to a server"),
        ("spnav:/var/run/docker.sock", "would connect to a server"),
        ("/etc/passwd", "is not the name of a serial port"),
        ("/dev/tty/../../etc/passwd", "is not the name of a serial port"),
        ("/dev/watchdog", "is not the name of a serial port"),
        ("notes.txt", "is not the name of a serial port"),
        ("a://x", "is not the name of a serial port"),
    ],
)
def test_a_file_opens_no_other_file_or_connection_unless_the_command_line_allows_it(raff, url, why):
    robots = {"r": raff(ITS_SENSOR % url)}
    with pytest.raises(SetupError, match=rf"the file's sensor 1, '{re.escape(url)}', {why}\. If that is wanted, give"):
        arrange(robots)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert arrange(robots, sensors=[f"1={url}"]).devices


@pytest.mark.filterwarnings("ignore::cinegen.CinegenWarning")
@pytest.mark.parametrize(
    "url",
    ["/dev/ttyUSB0", "/dev/ttyd2", "/dev/serial/by-id/usb-3Dconnexion_SpaceMouse-if00", "/dev/cu.usbserial-1", "COM3",
     r"\\.\COM12", "hwgrep://3Dconnexion", "spnav:", "path:circle", "gamepad:"],
)  # fmt: skip
def test_a_file_opens_the_usual_sensors(raff, url):
    assert [device.url for device in arrange({"r": raff(ITS_SENSOR % url)}).devices if device.name == "1"] == [url]


# --- where robots start ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ur5():
    return load(SHARE / UR5)


@pytest.mark.parametrize("name", ["rx90", "arm7", "delta4"])
def test_robots_that_are_regular_at_home_or_have_loops_start_there(robot, name):
    mechanism = robot(name)
    assert regular_start(mechanism) is mechanism.q_home


def test_a_stretched_arm_starts_bent_and_follows_a_large_circle(ur5):
    assert _singular_values(ur5, ur5.q_home)[-1] < 0.01
    q = regular_start(ur5)
    assert _singular_values(ur5, q)[-1] > 0.2
    assert ((ur5.limits.lower <= q) & (q <= ur5.limits.upper)).all()
    assert fit_path(ur5, ur5.end, q=q).size > 5.0 * fit_path(ur5, ur5.end).size
    assert fit_path(ur5, ur5.end, q=q).size > 0.1  # m


def test_a_session_begins_there_and_home_is_there(ur5, closing):
    setup = arrange({"ur5": ur5}, follow="circle")
    session = closing(Session(setup))
    np.testing.assert_array_equal(session.robots["ur5"].q, setup.start("ur5"))
    assert not np.array_equal(setup.start("ur5"), ur5.q_home)
