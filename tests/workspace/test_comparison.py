"""Two maps compared: what one of both reaches, and by how much they differ."""

import math
from functools import partial

import numpy as np
import pytest
from small_maps import map_of

from cinegen.workspace import MapError
from cinegen.workspace.comparison import compare

LENS = 2.0 * 0.7**2 * math.acos(0.2 / 0.7) - 0.2 * math.sqrt(4.0 * 0.7**2 - 0.4**2)
"""Of two discs of 700 whose middles are 400 apart: r^2 2 acos(d / 2r) - d/2 sqrt(4r^2 - d^2)."""


PLANE = ("x", -1.0, 1.0, 50), ("y", -1.0, 1.0, 50)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """`made(("x", -1, 1, 50), ..., at={"rz": 0})`: what planar_3r reaches where its tool looks that way."""
    folder = tmp_path_factory.mktemp("compare")
    return partial(map_of, folder, "planar_3r", quantities=("manipulability",), limits=False)


@pytest.fixture(scope="module")
def both(made):
    """Tools that look along x, and against it: rings of 100 to 700 about 200 and -200 of x."""
    return [made(*PLANE, at={"rz": rz}) for rz in (0.0, math.pi)]


def test_rings_that_overlap(both):
    compared = compare(*both)
    ring = math.pi * (0.7**2 - 0.1**2)
    lens = LENS - 2.0 * math.pi * 0.1**2  # both holes are in it
    for extent, exact in ((compared.first, ring), (compared.second, ring), (compared.both, lens),
                          (compared.only_first, ring - lens), (compared.only_second, ring - lens)):  # fmt: skip
        assert extent.low < exact < extent.high
        assert extent.value == pytest.approx(exact, rel=0.04)
    assert compared.first.value == pytest.approx(compared.both.value + compared.only_first.value)
    assert compared.second.value == pytest.approx(compared.both.value + compared.only_second.value)
    assert compared.remarks == ("rz: 0 and 3.14159",)


def test_quantities_differ_as_the_closed_form_says(both, robot):
    """l1 l2 |sin q2| by the wrist's distance from the base, here and there."""
    compared = compare(*both)
    x, y = np.meshgrid(*(axis.middles() for axis in compared.region.axes), indexing="ij")
    scale = robot("planar_3r").length ** 2

    def manipulability(middle):
        cos = (np.hypot(x - middle, y) ** 2 - 0.4**2 - 0.3**2) / (2.0 * 0.4 * 0.3)
        return 0.4 * 0.3 * np.sqrt(1.0 - np.where(np.abs(cos) < 1.0, cos, np.nan) ** 2) / scale

    difference = compared.differences["manipulability"]
    np.testing.assert_allclose(difference.values, manipulability(-0.2) - manipulability(0.2), atol=1e-6)
    least, median, most = difference.range
    assert least == pytest.approx(-most, abs=1e-6)  # mirrored
    assert median == pytest.approx(0.0, abs=1e-6)


def test_grids_that_overlap_are_compared_where_they_do(made, both):
    """The same robot, cut finer and elsewhere: on the coarser cells both say the same, but for cells on the border."""
    fine = made(("x", -0.3, 1.5, 90), ("y", -1.5, 1.5, 150), at={"rz": 0.0})
    compared = compare(both[0], fine)
    assert [(a.low, a.high, a.count) for a in compared.region.axes] == [
        (-0.3, pytest.approx(0.98), 32),
        (-1.0, pytest.approx(1.0), 50),
    ]
    right = compared.region.axes[0].middles()  # of the ring, what is beyond x = -0.3: less a piece of its outer circle
    piece = 0.7**2 * math.acos(0.5 / 0.7) - 0.5 * math.sqrt(0.7**2 - 0.5**2)
    exact = math.pi * (0.7**2 - 0.1**2) - piece
    assert right[0] > -0.3
    for extent in (compared.first, compared.second):
        assert extent.low < exact < extent.high
        assert extent.value == pytest.approx(exact, rel=0.05)
    assert compared.only_first.value + compared.only_second.value < 0.1 * compared.both.value


def test_maps_that_cannot_be_compared(both, robot, tmp_path):
    small = partial(map_of, tmp_path)
    turns = small("planar_3r", ("joint1", 0.0, 1.0, 2), ("joint2", 0.0, 1.0, 2))
    with pytest.raises(MapError, match="a map over x, y can't be compared with one over joint1, joint2"):
        compare(both[0], turns)
    far = small("planar_3r", ("x", 2.0, 3.0, 4), ("y", -1.0, 1.0, 4))
    says = "x goes from -1 to 1 in one map and from 2 to 3 in the other: they have no cell"
    with pytest.raises(MapError, match=says):
        compare(both[0], far)
    angles = ("azimuth", -1.0, 1.0, 2), ("elevation", -1.0, 1.0, 2)
    around = [small("planar_3r", *angles, at={"radius": radius}) for radius in (0.5, 0.6)]
    with pytest.raises(MapError, match=r"spheres of radius 0.5 and 0.6 m"):
        compare(*around)
    slide = next(name for name in robot("delta4_linear").actuated if name in robot("planar_3r").actuated)
    in_rad, other = (small(name, (slide, 0.0, 0.1, 2)) for name in ("planar_3r", "delta4_linear"))
    with pytest.raises(MapError, match="measured in rad, the other's in m: they can't be compared"):
        compare(in_rad, other)
