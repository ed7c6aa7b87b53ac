"""A seam by its URL: the file, the options, and what is wrong with them, with the line."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cinegen.devices import SensorError, open_sensor
from cinegen.toolpath import Seam
from cinegen.toolpath.seam_file import read_points

WELD = """\
# a weld, from the drawing
x, y, z, nx, ny, nz
0, 0, 0,  0, 0, 1
100, 0, 0,  0, 0, 2  # any length

# ... and on
200,10,0,0,0,1
"""


@pytest.fixture
def weld(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(text: str = WELD, encoding: str = "utf-8") -> str:
        (tmp_path / "weld.csv").write_text(text, encoding=encoding)
        return "seam:weld.csv"

    return write


def test_millimetres_and_degrees(weld):
    url = weld()
    seam = open_sensor(
        f"{url}?distance=10&work=15&travel=-5&speed=25&roll=90&approach=20&turning=60&ramp=0.5&wait=2&again=back"
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
    assert points == pytest.approx(1e-3 * np.array([[1, 2, 3], [4, 5, 6]]))
    assert normals.tolist() == [[0, 0, 1]] * 2
    assert lines == [2, 3]


HEAD = "x,y,z,nx,ny,nz\n"
FIRST = "0,0,0,0,0,1\n"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "weld.csv: is empty; begin it with a line x,y,z,nx,ny,nz"),
        ("# nothing\n", "weld.csv: is empty"),
        (HEAD, "'seam:weld.csv': a seam needs two points at least"),
        (HEAD + FIRST, "two points at least"),
        (HEAD + FIRST + FIRST, "two points at least"),
        ("\nx,y,z,nx,ny\n", "weld.csv:2: no column 'nz'; the first line names the columns"),
        ("x;y;z;nx;ny;nz\n", "weld.csv:1: no column 'x'"),
        ("x,y,z,nx,ny,nz,x\n", "weld.csv:1: two columns 'x'"),
        (HEAD + FIRST + "1,0,0,0,0\n", "weld.csv:3: 5 values, but 6 columns are named"),
        (HEAD + FIRST + "#\n1,0,l,0,0,1\n", "weld.csv:4: z: 'l' is not a number"),
        (HEAD + "0,0,0,0,,1\n", "weld.csv:2: ny: '' is not a number"),
        (HEAD + FIRST + "1,0,nan,0,0,1\n", "weld.csv:3: z: 'nan' is not finite"),
        (HEAD + FIRST + "1,0,0,0,0,1e999\n", "weld.csv:3: nz: '1e999' is not finite"),
        (HEAD + FIRST + "\n\n1,0,0,0,0,0 # no\n", "weld.csv:5: its normal is 0 0 0"),
        (HEAD + FIRST + "# \n1,0,0,1,0,0\n", "weld.csv:4: the seam is parallel to its normal here"),
        (HEAD + FIRST + "1,0,0,0,0,-1\n", "weld.csv:3: its normal is opposite"),
        (HEAD + FIRST + "1e12,0,0,0,0,1\n", r"weld.csv:3: it is more than 1e\+06 m away"),
        (HEAD + "0,0,0,0,0,1\n" * 2 + "0,0,0,0,1,0\n9,0,0,0,1,0\n", "weld.csv:2: it is where its neighbour is"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_with_its_line(weld, text, why):
    with pytest.raises(SensorError, match=why):
        open_sensor(weld(text))


@pytest.mark.parametrize(
    ("query", "why"),
    [
        ("distanec=10", r"'seam:weld.csv\?distanec=10': unknown option 'distanec': did you mean 'distance'\?"),
        ("foo=1", r"unknown option 'foo' \(known: distance, work, .*again\)"),
        ("distance=ten", r"'seam:weld.csv\?distance=ten': distance: 'ten' is not a number"),
        ("distance", "distance: '' is not a number"),
        ("work=nan", "work: 'nan' is not finite"),
        ("work=90", r"'seam:weld.csv\?work=90': work must be between -90 and 90 degrees"),
        ("speed=0", "speed must be more than 0"),
        ("speed=1&speed=2", "speed is given twice"),
        ("again=bck", "unknown value 'bck' of again: did you mean 'back'"),
    ],
)
def test_what_is_wrong_with_a_url(weld, query, why):
    with pytest.raises(SensorError, match=why):
        open_sensor(f"{weld()}?{query}")


def test_files_that_are_none(weld, tmp_path):
    for url, why in (
        ("seam:", r"'seam:': write seam:FILE.csv"),
        ("seam:?speed=2", "write seam:FILE.csv"),
        ("seam:none.csv", "none.csv: can't be read: no such file"),
        (f"seam:{tmp_path}", "can't be read: is a directory"),
    ):
        with pytest.raises(SensorError, match=why):
            open_sensor(url)
    weld()
    (tmp_path / "weld.csv").write_bytes(b"\xff\xfe\x00x")
    with pytest.raises(SensorError, match="is not UTF-8 text"):
        open_sensor("seam:weld.csv")
