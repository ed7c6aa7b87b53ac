"""Along a seam: distances and angles measured back from where the tool stands are those that were asked for."""

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from test_curve import flat, wandering

from cinegen import Solver, Status
from cinegen.devices import SensorError, SensorState, Teleoperation, open_sensor
from cinegen.toolpath import Seam
from cinegen.toolpath.curve import PointError
from cinegen.toolpath.seam_file import read_points

UP = np.array([0.0, 0.0, 1.0])
SQUARE = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0], [0, 0, 0]])

tilts = st.floats(-1.2, 1.2)
distances = st.floats(-0.05, 0.2)
seeds = st.integers(0, 10_000)


def angles(tool: pin.SE3, tangent: np.ndarray, normal: np.ndarray) -> tuple[float, float]:
    """Work and travel angle (rad) as AWS A3.0 says, from nothing but the tool's axis, the seam's and the normal."""
    axis = tool.rotation[:, 2]
    travel = 0.5 * math.pi - math.acos(np.clip(axis @ tangent, -1, 1))  # to the perpendicular of the seam
    across = np.cross(tangent, axis)  # perpendicular to the plane of the seam and the axis
    work = 0.5 * math.pi - math.acos(np.clip(normal @ across / np.linalg.norm(across), -1, 1))
    return work, travel


def foot(tool: pin.SE3, distance: float) -> np.ndarray:
    """The point on the tool's axis at a distance in front of it."""
    return tool.translation + distance * tool.rotation[:, 2]


def random_seam(seed: int, bend: float = 29.0) -> tuple[np.ndarray, np.ndarray]:
    """Points (m) and normals: a normal that wanders, and a line that stays more or less across it."""
    random = np.random.default_rng(seed)
    points = wandering(seed, math.radians(bend), 6) * [1, 1, 0.2]
    return points, UP + 0.3 * random.uniform(-1, 1, (6, 3))


# --- where the tool stands -------------------------------------------------------------------------------------------


@given(seeds, distances, tilts, tilts, st.floats(-4, 4))
def test_distance_and_angles_are_what_was_asked_for(seed, distance, work, travel, roll):
    """On a straight seam with a normal that turns about it, where all is known exactly."""
    random = np.random.default_rng(seed)
    way, normal, _ = np.linalg.qr(random.normal(size=(3, 3)))[0].T
    aside = np.cross(way, normal)
    begin, length, turn = random.normal(size=3), random.uniform(0.01, 1), random.uniform(-2.9, 2.9)
    last = math.cos(turn) * normal + math.sin(turn) * aside
    seam = Seam([begin, begin + length * way], [7 * normal, 1e-3 * last], distance, work, travel, roll=roll)
    for tool, part in zip(seam.targets(length / 7), np.linspace(0, 1, 8), strict=True):
        assert foot(tool, distance) == pytest.approx(begin + part * length * way, abs=1e-9)
        turned = math.cos(part * turn) * normal + math.sin(part * turn) * aside
        assert angles(tool, way, turned) == pytest.approx((work, travel), abs=1e-7)
        assert tool.rotation.T @ tool.rotation == pytest.approx(np.eye(3), abs=1e-12)
        assert np.linalg.det(tool.rotation) > 0


@settings(max_examples=20)
@given(seeds, distances, tilts, tilts)
def test_they_are_so_on_any_curve(seed, distance, work, travel):
    """The seam's direction by differences along what the tools point at, the normals as given at its points."""
    points, normals = random_seam(seed)
    steps = np.diff(points, axis=0) / np.linalg.norm(np.diff(points, axis=0), axis=1)[:, None]
    assume((steps[1:] * steps[:-1]).sum(axis=1).min() > math.cos(math.radians(30.0)))  # at a corner there are two
    try:
        seam = Seam(points, normals, distance, work, travel)
    except PointError:
        assume(False)
    tools = [seam.at(s) for s in np.linspace(0, seam.length, 601)]
    feet = np.array([foot(tool, distance) for tool in tools])
    h = 1e-7 * seam.length
    for point, normal in zip(points[1:-1], normals[1:-1] / np.linalg.norm(normals[1:-1], axis=1)[:, None], strict=True):
        nearest = np.argmin(np.linalg.norm(feet - point, axis=1))
        s = seam.length * nearest / 600
        for _ in range(5):  # Newton's steps to the point
            before, behind = foot(seam.at(s - h), distance), foot(seam.at(s + h), distance)
            tangent = (behind - before) / np.linalg.norm(behind - before)
            s += (point - foot(seam.at(s), distance)) @ tangent
        assert foot(seam.at(s), distance) == pytest.approx(point, abs=1e-7)
        across = tangent - (tangent @ normal) * normal
        assert angles(seam.at(s), across / np.linalg.norm(across), normal) == pytest.approx((work, travel), abs=2e-3)


def test_conventions():
    """North, with the surface below: what is right, ahead and down."""
    points, normals = [[0, 0, 0], [0, 1, 0]], [UP, UP]
    plain = Seam(points, normals, 0.1).at(0.0)
    assert plain.translation == pytest.approx([0, 0, 0.1])
    assert plain.rotation == pytest.approx(np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]))  # x ahead, y right, z down
    leaning = Seam(points, normals, 0.1, work=0.3).at(0.0)
    assert leaning.translation == pytest.approx([0.1 * math.sin(0.3), 0, 0.1 * math.cos(0.3)])  # to the right
    pushing = Seam(points, normals, 0.1, travel=0.3).at(0.0)
    assert pushing.translation == pytest.approx([0, -0.1 * math.sin(0.3), 0.1 * math.cos(0.3)])  # points ahead
    assert pushing.rotation[1, 0] > 0.9
    rolled = Seam(points, normals, 0.1, 0.3, 0.2, roll=0.5 * math.pi).at(0.5)
    other = Seam(points, normals, 0.1, 0.3, 0.2).at(0.5)
    assert rolled.translation == pytest.approx(other.translation)
    assert rolled.rotation[:, 0] == pytest.approx(other.rotation[:, 1])


# --- how it moves ----------------------------------------------------------------------------------------------------


@settings(max_examples=30)
@given(seeds, st.floats(0.005, 0.2), distances, tilts, tilts)
def test_its_speed_along_the_seam_is_constant(seed, speed, distance, work, travel):
    points, normals = random_seam(seed)
    points[:, 2] = 0.0  # one smooth curve
    try:
        seam = Seam(points, normals, distance, work, travel, speed)
    except PointError:
        assume(False)
    assume(seam.duration == pytest.approx(seam.length / speed + 0.25) and seam.length > 0.3 * speed)
    dt = 1e-5
    for time in np.linspace(1.25, 1.0 + seam.duration - 0.25 - dt, 50):
        step = foot(seam.target(time + dt), distance) - foot(seam.target(time), distance)
        assert np.linalg.norm(step) == pytest.approx(speed * dt, rel=1e-5)
    rests = (0.0, 1.0, 1.0 + seam.duration, 1e6)
    for time in rests:
        step = foot(seam.target(time + dt), distance) - foot(seam.target(time), distance)
        assert np.linalg.norm(step) < 1e-3 * speed * dt


@settings(max_examples=10)
@given(seeds, st.sampled_from(["stay", "back", "loop"]), tilts, tilts, st.sampled_from([0.0, 0.03]))
def test_no_target_jumps(seed, again, work, travel, approach):
    """Corners, edges, approach and return: in a fourth of the time it moves a fourth as far."""
    random = np.random.default_rng(seed)
    turns = np.cumsum(random.uniform(-2, 2, 5))
    points = np.cumsum(0.05 * np.stack([np.cos(turns), np.sin(turns), random.uniform(-0.2, 0.2, 5)], axis=1), axis=0)
    normals = UP + 0.3 * random.uniform(-1, 1, (5, 3))
    points, normals = np.insert(points, 3, points[3], axis=0), np.insert(normals, 3, [0.5, 0, 1], axis=0)
    seam = Seam(points, normals, 0.02, work, travel, 0.1, approach=approach, again=again, wait=0.0)

    def largest(count: int) -> float:
        places = [seam.target(time) for time in np.linspace(0, 2.2 * seam.duration, count)]
        return max(np.linalg.norm(b.homogeneous - a.homogeneous) for a, b in pairwise(places))

    count = 50 * math.ceil(seam.duration)
    assert largest(4 * count) < 0.3 * largest(count)


def test_at_a_corner_it_stops_and_turns_no_faster_than_it_may():
    seam = Seam(SQUARE, flat(SQUARE), 0.02, 0.4, -0.3, speed=0.05, turning=0.6)
    dt = 0.01
    places = [seam.target(time) for time in np.arange(0, 1.0 + seam.duration, dt)]
    moving = 0
    for a, b in pairwise(places):
        turn = np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)) / dt
        step = np.linalg.norm(foot(b, 0.02) - foot(a, 0.02)) / dt
        assert turn <= 0.6 * (1 + 1e-9)
        assert step <= 0.05 * (1 + 1e-6)
        moving += turn > 1e-9 and step > 1e-9
        assert abs(foot(b, 0.02)[2]) < 1e-12
    assert moving <= 6  # of all ticks, those in which it begins or ends to turn
    corner = 0.5 * math.pi / 0.6 + 0.25
    assert seam.duration == pytest.approx(4 * (0.1 / 0.05 + 0.25) + 3 * corner)


def test_the_approach_is_along_the_tools_axis():
    seam = Seam([[0, 0, 0], [0.1, 0, 0]], [UP, UP], 0.01, 0.3, 0.2, 0.05, approach=0.04, wait=0.5, ramp=0.1)
    for time, along in ((0.0, 0.0), (0.4, 0.0), (0.5 + seam.duration, 0.1), (1e9, 0.1)):
        tool, close = seam.target(time), seam.at(along)
        assert tool.rotation == pytest.approx(close.rotation)
        assert tool.translation == pytest.approx(close.translation - 0.04 * close.rotation[:, 2])
    assert seam.duration == pytest.approx(2 * (0.04 / 0.05 + 0.1) + 0.1 / 0.05 + 0.1)
    assert seam.target(0.5 + 0.04 / 0.05 + 0.1).isApprox(seam.at(0.0))


# --- as a sensor -----------------------------------------------------------------------------------------------------


@pytest.fixture
def clock(monkeypatch):
    """`clock[0]`: what time it is, s."""
    now = [100.0]
    monkeypatch.setattr("cinegen.sensor.time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


def test_a_seam_is_a_sensor(clock):
    seam = Seam([[0, 0, 0], [0.35, 0, 0]], [UP, UP], speed=0.1, approach=0.01, url="seam:weld.csv")
    assert seam.status.state is SensorState.CLOSED
    assert seam.status.message == "seam:weld.csv is not started"
    assert seam.read() is None
    seam.start()
    clock[0] += 0.5
    seam.start()  # is started already
    first = seam.read()
    assert (first.time, first.twist, first.target) == (100.5, None, seam.target(0.0))
    assert seam.status == (SensorState.LIVE, "seam:weld.csv: 0.000 of 0.350 m", 1, 0)
    clock[0] = 100.0 + 1.0 + 2 * 0.25 + 0.125 + 1.2  # an approach that is all ramps, a ramp, 120 mm
    assert seam.read().target.translation == pytest.approx([0.12, 0, 0])
    assert seam.status.message == "seam:weld.csv: 0.120 of 0.350 m"
    clock[0] += 100.0
    assert seam.read().target.translation == pytest.approx([0.35, 0, 0.01])  # it says its end, and no more
    assert seam.read() is None
    assert seam.status == (SensorState.CLOSED, "seam:weld.csv is at its end", 3, 0)
    seam.close()
    seam.start()
    assert seam.read().target == first.target
    assert repr(seam) == "<Seam seam:weld.csv, 0.35 m in 4.8 s>"


def follow(mechanism, node, seam, clock, dt=0.002):
    """How far (m, rad) the node was off its target at each tick after the wait, and where it was."""
    solver = Solver(mechanism, dt)
    hold = Teleoperation(seam, solver.add_task(node))
    seam.start()
    errors, places = [], []
    while hold.status.state is SensorState.LIVE:
        hold.advance(dt)
        clock[0] += dt
        step = solver.step()
        if clock[0] > 101.0:
            assert step.status is Status.FOLLOWING
            errors.append(step.errors[0])
            places.append(mechanism.placement(step.q, node))
    return np.array(errors), places


def test_an_arm_follows_a_seam(robot, clock):
    """Over a corner, on a plate that is tilted, to a micrometre; distance and angles from where its tool was."""
    plate = pin.SE3(pin.utils.rotate("y", -0.5), np.array([0.6, 0.05, 0.2]))
    points = np.array([[0, -0.1, 0], [0.01, -0.05, 0], [0, 0, 0], [0.05, 0, 0]])
    normal = plate.rotation[:, 2]
    seam = Seam([plate.act(point) for point in points], [normal] * 4, 0.012, 0.2, 0.3, 0.15, approach=0.02)
    errors, places = follow(robot("rx90"), "tool", seam, clock)
    assert errors[:, 0].max() < 1e-6
    assert np.abs(errors[:, 1]).max() < 2e-6
    near = [plate.actInv(place) for place in places if abs(plate.actInv(foot(place, 0.012))[2]) < 2e-6]
    assert len(near) > 0.7 * len(places)
    assert all(place.rotation[2, 2] == pytest.approx(-math.cos(0.2) * math.cos(0.3), abs=1e-5) for place in near)


# --- what is no seam -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"speed": 0.0}, "speed must be more than 0"),
        ({"approach": -0.1}, "approach must be 0 or more"),
        ({"again": "bakc"}, "unknown value 'bakc' of again: did you mean 'back'"),
        ({"points": [[0, 0], [1, 0]]}, "as many normals as points"),
        ({"points": [[0, math.nan, 0], [1, 0, 0]]}, "point 1: its numbers must be finite"),
        ({"points": np.zeros((100_001, 3)), "normals": np.zeros((100_001, 3))}, "more than 100000 points"),
    ],
)
def test_what_is_no_seam(options, why):
    values = {"points": [[0, 0, 0], [1, 0, 0]], "normals": [UP, UP], **options}
    with pytest.raises(SensorError, match=why):
        Seam(**values)


def test_loops():
    closed = Seam(SQUARE * 0.3, flat(SQUARE), 0.02, turning=3.0, again="loop")
    plain = Seam(SQUARE * 0.3, flat(SQUARE), 0.02, turning=3.0)
    home = 0.5 * math.pi / 3.0 + 0.25  # it only has to turn by a corner
    for time in np.linspace(0, plain.duration, 40):
        assert closed.target(1.0 + time) == plain.target(1.0 + time)
        again = closed.target(1.0 + plain.duration + home + time)
        assert again.isApprox(plain.target(1.0 + time), 1e-6)
    line = Seam([[0, 0, 0], [0.1, 0, 0]], [UP, UP], 0.02, speed=0.1, approach=0.05, again="loop")
    halfway = line.target(1.0 + line.duration + 0.5 * (1.0 + 0.25))  # on its way through the air
    assert halfway.translation == pytest.approx([0.05, 0, 0.07], abs=1e-9)


# --- seam file --------------------------------------------------------------------------------------------------------
# A seam by its URL: the file, the options, and what is wrong with them, with the line.


WELD = """\
# a weld, from the drawing
x [mm], y, z, nx, ny, nz
0, 0, 0,  0, 0, 1
100, 0, 0,  0, 0, 2  # any length

# ... and on
200,0.01,0m,0,0,1
"""


@pytest.fixture
def weld(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(text: str = WELD, encoding: str = "utf-8") -> str:
        (tmp_path / "weld.csv").write_text(text, encoding=encoding)
        return "seam:weld.csv"

    return write


def test_metres_and_degrees_or_other_units(weld):
    url, turned = weld(), "work=15&travel=-5deg&roll=90&turning=60"
    seam = open_sensor(f"{url}?distance=10mm&speed=25mm/s&{turned}&approach=0.02&ramp=500ms&wait=2&again=back")
    points = [[0, 0, 0], [0.1, 0, 0], [0.2, 0.01, 0]]
    leaning = dict(zip(("work", "travel", "roll", "turning"), np.radians([15, -5, 90, 60]), strict=True))
    same = Seam(points, [UP] * 3, 0.01, speed=0.025, approach=0.02, ramp=0.5, wait=2.0, again="back", **leaning)
    assert isinstance(seam, Seam)
    assert seam.url == "seam:weld.csv"
    assert seam.duration == pytest.approx(same.duration)
    for time in np.linspace(0, 40, 30):
        assert seam.target(time).isApprox(same.target(time), 1e-9)
    plain = open_sensor(url)
    assert plain.duration == pytest.approx(Seam(points, [[0, 0, 1]] * 3).duration)


def test_files_as_spreadsheets_write_them(weld):
    weld('Name,NZ,ny,nx,"z",y,X\r\nfirst,1,0,0,3,2,1\r\n"second, last",1,0,0,6,5,4\r\n', "utf-8-sig")
    points, normals, lines = read_points("weld.csv")
    assert points == pytest.approx(np.array([[1, 2, 3], [4, 5, 6]]))
    assert normals.tolist() == [[0, 0, 1]] * 2
    assert lines == [2, 3]


HEAD = "x,y,z,nx,ny,nz\n"
FIRST = "0,0,0,0,0,1\n"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "weld.csv: is empty; begin it with a line x,y,z,nx,ny,nz"),
        (HEAD + FIRST, "two points at least"),
        ("x;y;z;nx;ny;nz\n", "weld.csv:1: no column 'x'"),
        ("x [deg],y,z,nx,ny,nz\n", "weld.csv:1: column 'x': 'deg' is not a unit of length"),
        ("x,y,z,nx,ny,nz,x\n", "weld.csv:1: two columns 'x'"),
        (HEAD + FIRST + "1,0,0,0,0,1e999\n", "weld.csv:3: nz: '1e999' is not a number"),
        (HEAD + FIRST + "\n\n1,0,0,0,0,0 # no\n", "weld.csv:5: its normal is 0 0 0"),
        (HEAD + FIRST + "# \n1,0,0,1,0,0\n", "weld.csv:4: the seam is parallel to its normal here"),
        (HEAD + FIRST + "1e12,0,0,0,0,1\n", r"weld.csv:3: it is more than 1e\+06 m away"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_with_its_line(weld, text, why):
    with pytest.raises(SensorError, match=why):
        open_sensor(weld(text))


@pytest.mark.parametrize(
    ("query", "why"),
    [
        ("distanec=10", r"'seam:weld.csv\?distanec=10': unknown option 'distanec': did you mean 'distance'\?"),
        ("distance=ten", r"'seam:weld.csv\?distance=ten': distance: 'ten' is not a length"),
        ("work=90", r"'seam:weld.csv\?work=90': work must be between -90 and 90 degrees"),
        ("distance=10", "distance: 10 m, for a seam of 0.2006 m: did you mean distance=10mm"),
        ("speed=1&speed=2", "speed is given twice"),
    ],
)
def test_what_is_wrong_with_a_url(weld, query, why):
    with pytest.raises(SensorError, match=why):
        open_sensor(f"{weld()}?{query}")


def test_points_in_millimetres_without_a_unit_are_refused_where_the_robot_is_known(weld, robot):
    weld(HEAD + "500,-100,200,0,0,1\n550,0,200,0,0,1\n")
    with pytest.raises(SensorError, match=r"weld.csv: 550 m is far beyond the reach of arm.*did you mean 550 mm"):
        open_sensor("seam:weld.csv", mechanism=robot("rx90"))
    weld(HEAD.replace("x,y,z", "x [mm],y [mm],z (mm)") + "500,-100,200,0,0,1\n550,0,200,0,0,1\n")
    assert open_sensor("seam:weld.csv", mechanism=robot("rx90")).length == pytest.approx(0.1118, abs=1e-4)


def test_files_that_are_none(weld, tmp_path):
    for url, why in (
        ("seam:", r"'seam:': write seam:FILE.csv"),
        ("seam:none.csv", "none.csv: can't be read: No such file"),
        (f"seam:{tmp_path}", "can't be read: Is a directory"),
    ):
        with pytest.raises(SensorError, match=why):
            open_sensor(url)
    weld()
    (tmp_path / "weld.csv").write_bytes(b"\xff\xfe\x00x")
    with pytest.raises(SensorError, match="is not UTF-8 text"):
        open_sensor("seam:weld.csv")
