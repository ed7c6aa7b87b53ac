"""A seam by its URL: the file, the options, and what is wrong with them, with the line."""

import math

import numpy as np
import pytest

from cinegen.devices import SensorError, open_sensor
from cinegen.toolpath import Seam
from cinegen.toolpath.seam_file import read_points

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
    url = weld()
    seam = open_sensor(
        f"{url}?distance=10mm&work=15&travel=-5deg&speed=25mm/s&roll=90&approach=0.02&turning=60&ramp=500ms&wait=2&again=back"
    )
    points = [[0, 0, 0], [0.1, 0, 0], [0.2, 0.01, 0]]
    same = Seam(
        points, [[0, 0, 1]] * 3, 0.01, math.radians(15), math.radians(-5), 0.025,
        roll=math.pi / 2, approach=0.02, turning=math.radians(60), ramp=0.5, wait=2.0, again="back",
    )  # fmt: skip
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
        ("\nx,y,z,nx,ny\n", "weld.csv:2: no column 'nz'; the first line names the columns"),
        ("x;y;z;nx;ny;nz\n", "weld.csv:1: no column 'x'"),
        ("x [deg],y,z,nx,ny,nz\n", "weld.csv:1: column 'x': 'deg' is not a unit of length"),
        ("x,y,z,nx,ny,nz,x\n", "weld.csv:1: two columns 'x'"),
        (HEAD + FIRST + "1,0,0,0,0\n", "weld.csv:3: 5 values, but 6 columns are named"),
        (HEAD + FIRST + "#\n1,0,l,0,0,1\n", "weld.csv:4: z: 'l' is not a length"),
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
        ("speed=25", "speed: 25 m/s, for a seam of 0.2006 m: did you mean speed=25mm/s"),
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
