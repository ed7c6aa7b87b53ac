"""Extents of maps: closed forms lie within the bound, which shrinks as cells do."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import cinegen.workspace.extent as module
from cinegen.workspace import CellStatus, GridAxis, MapError, MapSpecification, Region, make_map
from cinegen.workspace.extent import Extent, bounds, extent, extent_of


def measured(region, inside):
    """Extent of where a function of all middles holds."""
    middles = np.meshgrid(*(axis.middles() for axis in region.axes), indexing="ij")
    cells = inside(*middles)
    return extent_of(region, "m^2", cells, *bounds(region.periodic, cells, np.zeros_like(cells)))


def square(half, count, names="xy", shift=0.0):
    return Region(tuple(GridAxis(name, -half + shift, half + shift, count) for name in names))


@pytest.fixture(scope="module")
def wrist(robot, tmp_path_factory):
    """planar_3r whose tool looks along x: its wrist, 200 behind, is that of an arm of 400 and 300."""
    region = Region((GridAxis("x", -0.75, 1.15, 76), GridAxis("y", -0.9, 0.9, 60)), {"rz": 0.0})
    spec = MapSpecification(robot("planar_3r"), region, ("manipulability",), limits=False)
    return make_map(spec, tmp_path_factory.mktemp("wrist") / "a.zarr", workers=1)


# --- closed forms ------------------------------------------------------------------------------------------------


@given(st.floats(0.2, 1.0), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.integers(20, 60), st.integers(20, 60))
@settings(max_examples=200)
def test_a_disc_is_always_within_the_bound(radius, x, y, rows, columns):
    region = Region((GridAxis("x", -1.4, 1.4, rows), GridAxis("y", -1.4, 1.4, columns)))
    assume(radius > 1.5 * max(axis.width for axis in region.axes))
    found = measured(region, lambda u, v: np.hypot(u - x, v - y) <= radius)
    assert found.low <= math.pi * radius**2 <= found.high
    ring = math.hypot(*(axis.width for axis in region.axes))  # nothing is further from the border
    assert found.high - found.low <= 2.0 * math.pi * radius * 4.0 * ring


def test_the_bound_shrinks_with_the_cells():
    errors = [measured(square(1.0, n), lambda u, v: np.hypot(u, v) <= 0.77).error for n in (16, 32, 64, 128, 256)]
    assert all(0.35 < finer / coarser < 0.65 for coarser, finer in pairwise(errors))


def test_a_full_region_is_exact():
    found = measured(square(1.0, 7), lambda u, v: u < 9.0)
    assert (found.value, found.error) == (pytest.approx(4.0), 0.0)
    assert str(found) == "4 m^2"


# --- how it is counted -------------------------------------------------------------------------------------------


@given(st.integers(1, 29))
def test_where_a_whole_turn_begins_makes_no_difference(turn):
    axes = GridAxis("azimuth", -math.pi, math.pi, 30), GridAxis("elevation", -1.5, 1.5, 15)
    region = Region(axes, {"radius": 1.0})
    middles = np.meshgrid(*(axis.middles() for axis in axes), indexing="ij")
    cells = np.hypot(middles[0] - 0.3, middles[1]) < 1.0
    rolled = np.roll(cells, turn, axis=0)
    one, other = (
        extent_of(region, "m^2", these, *bounds(region.periodic, these, np.zeros_like(these)))
        for these in (cells, rolled)
    )
    for name in ("value", "low", "high"):
        assert getattr(one, name) == pytest.approx(getattr(other, name))


@pytest.mark.parametrize("at_once", [1, 100, 700])
@pytest.mark.parametrize("names", [("x", "y"), ("azimuth", "elevation")])
def test_slabs_count_as_the_whole_does(monkeypatch, names, at_once):
    region = Region((GridAxis(names[0], -math.pi, math.pi, 23), GridAxis(names[1], -1.5, 1.5, 31)),
                    {"radius": 1.0} if names[0] == "azimuth" else {})  # fmt: skip
    rng = np.random.default_rng(3)
    u, v = np.meshgrid(*(axis.middles() for axis in region.axes), indexing="ij")
    cells, unknown = (np.abs(u) > 2.0) & (np.abs(v) < 1.0), rng.random(region.shape) < 0.02
    whole = extent_of(region, "m^2", cells & ~unknown, *bounds(region.periodic, cells, unknown))
    monkeypatch.setattr(module, "_AT_ONCE", at_once)
    slabs = module._in_slabs(region, "m^2", lambda rows: (cells[rows], unknown[rows]))
    assert (slabs.value, slabs.low, slabs.high, slabs.cells) == pytest.approx(
        (whole.value, whole.low, whole.high, whole.cells)
    )


def test_what_nobody_has_looked_at_may_be_there(wrist):
    part = wrist.load().copy(deep=True)
    gone = np.zeros(part.status.shape, dtype=bool)
    gone[30:40, 20:40] = True
    part["status"] = part.status.where(~gone, CellStatus.NOT_EVALUATED).astype("uint8")
    part["reachable"] = part.reachable & ~gone
    found, all_of_it = extent(part), extent(wrist)
    assert found.value < all_of_it.value
    assert found.low < math.pi * (0.7**2 - 0.1**2) < found.high
    assert found.high >= all_of_it.value


@pytest.mark.parametrize(
    ("value", "error", "says"),
    [(2.5446, 0.183, "2.54 ± 0.18 m"), (1234.5, 21.0, "1234 ± 21 m"), (0.0, 0.5, "0.00 ± 0.50 m"),
     (3e-9, 1e-10, "3e-09 ± 1e-10 m"), (0.2, 0.0, "0.2 m")],
)  # fmt: skip
def test_as_many_digits_are_said_as_are_worth_it(value, error, says):
    assert str(Extent(value, value - error, value + error, "m", 1)) == says


# --- what makes no sense -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda m: extent(m, m.manipulability), r"true or false, not float32: write .* dataset.sigma_1 > 0.1"),
        (lambda m: extent(m, m.reachable.isel(x=0)), "a condition over y: make it of this map's own cells, over x, y"),
        (lambda m: extent(m.isel(x=slice(3))), "a part of a map, 3 x 60 of its 76 x 60 cells"),
        (lambda m: extent(m.drop_attrs()), "this dataset is not a map"),
    ],
)
def test_what_makes_no_sense_is_refused(wrist, ask, says):
    with pytest.raises(MapError, match=says):
        ask(wrist)
