"""Maps as pictures: singular curves against closed forms, and what stands on the sheet."""

import math
import warnings
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import BoundaryNorm, LogNorm, to_hex
from matplotlib.text import Text
from small_maps import map_of

from cinegen.plotting.comparison import BOTH, FIRST, SECOND, draw_comparison
from cinegen.plotting.loci import TYPE_2
from cinegen.plotting.map import draw_map
from cinegen.plotting.plane import ROBOT
from cinegen.plotting.solid import net
from cinegen.singularities import SingularityType
from cinegen.workspace import MapError
from cinegen.workspace.extent import extent
from cinegen.workspace.loci import loci


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """`made("five_bar", ("x", -1, 1, 20), ..., at={}, quantities=...)`: a map."""
    return partial(map_of, tmp_path_factory.mktemp("maps"), quantities=("sigma_1", "sigma_2"), limits=False)


@pytest.fixture(scope="module")
def five_bar(made):
    """The whole plane of its tool, in cells that are not square."""
    quantities = ("sigma_1", "sigma_2", "condition")
    return made("five_bar", ("x", -0.7, 0.7, 22), ("y", -0.75, 0.75, 26), quantities=quantities)


@pytest.fixture(scope="module")
def wrist(made):
    """planar_3r with its tool along x: an arm of 400 and 300 whose wrist is 200 behind."""
    return made("planar_3r", ("x", -0.75, 1.15, 38), ("y", -0.9, 0.9, 36), at={"rz": 0.0})


def rendered(figure):
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)  # that its layout does not fit
        FigureCanvasAgg(figure).draw()
    return figure


def points_of(curves, kind):
    return np.vstack([np.zeros((0, 2)), *(curve.points for curve in curves if curve.kind is kind)])


def words(figure):
    """All that is written."""
    texts = [text.get_text() for text in figure.findobj(Text)]
    return "\n".join(text for text in texts if text)


# --- singular curves ---------------------------------------------------------------------------------------------


def test_a_joints_limit_is_no_singularity(made, robot):
    """Joint 2 within 5 to 170 degrees either way stops five_bar's arms before they are stretched."""
    curves = loci(made("five_bar", ("x", -0.5, 0.5, 25), ("y", 0.0, 0.7, 20), limits=True))
    assert {(curve.kind, curve.border) for curve in curves} == {(SingularityType.NONE, True)}
    model = robot("five_bar").model
    for curve in curves:
        near = np.minimum(curve.q - model.lowerPositionLimit, model.upperPositionLimit - curve.q).min(axis=1)
        assert (near > -1e-8).all()
        assert (near < 1e-3).all()


def test_beside_what_nobody_has_looked_at_nothing_ends(wrist):
    part = wrist.load().copy(deep=True)
    part["status"][:, 18:] = 0
    part["reachable"][:, 18:] = False
    part["configuration"][:, 18:] = np.nan
    points = points_of(loci(part), SingularityType.TYPE_1)
    assert (points[:, 1] < 0.0).all()
    radii = np.hypot(points[:, 0] - 0.2, points[:, 1])
    assert np.abs(radii[:, None] - [0.7, 0.1]).min(axis=1).max() < 1e-6


# --- two axes ----------------------------------------------------------------------------------------------------


def test_a_picture_has_colours_levels_curves_and_the_robot(five_bar, robot):
    axes = rendered(draw_map(five_bar)).axes[0]
    out, shades = [mesh for mesh in axes.collections if type(mesh).__name__ == "QuadMesh"]
    reached = five_bar.reachable.values
    np.testing.assert_allclose(np.ma.compressed(shades.get_array()), five_bar.sigma_1.values.T[reached.T], rtol=1e-6)
    assert np.ma.count(out.get_array()) == (~reached).sum()
    assert to_hex(out.get_cmap()(1.0)) == "#e9ebee"
    assert any(type(lines).__name__ == "QuadContourSet" and len(lines.levels) for lines in axes.collections)
    assert axes.get_aspect() == 1.0
    second = np.vstack([np.column_stack(line.get_data()) for line in axes.lines if line.get_color() == TYPE_2])
    off = np.abs([np.hypot(second[:, 0], second[:, 1] - y) - 0.4 for y in (-0.2, 0.2)]).min(axis=0)
    assert off.max() < 1e-6  # its curves are where they should be, in m
    tool = robot("five_bar").placement(robot("five_bar").q_home, "tool").translation[:2]
    ends = [np.column_stack(artist.get_data()) for artist in axes.lines if artist.get_gid() == ROBOT]
    assert min(np.abs(points - tool).max(axis=1).min() for points in ends) < 1e-9
    bare = draw_map(five_bar, curves=False, robot=False).axes[0]
    assert not [line for line in bare.lines if len(line.get_xdata())]
    assert not [artist for artist in bare.get_children() if artist.get_gid() == ROBOT]


def test_each_quantity_has_its_scale(made, five_bar):
    condition = draw_map(five_bar, "condition", curves=False)
    shades = [mesh for mesh in condition.axes[0].collections if type(mesh).__name__ == "QuadMesh"][-1]
    assert isinstance(shades.norm, LogNorm)
    modes = made("planar_3r", ("x", 0.0, 0.9, 12), ("y", -0.2, 0.2, 4), at={"rz": 0.0}, quantities=("solutions",))
    solutions = rendered(draw_map(modes, "solutions", curves=False))
    meshes = [mesh for mesh in solutions.axes[0].collections if type(mesh).__name__ == "QuadMesh"]
    assert isinstance(meshes[-1].norm, BoundaryNorm)
    assert [tick.get_text() for tick in solutions.axes[1].get_yticklabels()] == ["2"]
    reachable = draw_map(modes, "reachable", curves=False)
    assert len(reachable.axes) == 1  # one colour needs no bar
    settled = draw_map(modes, None, curves=False)
    assert {"reachable", "reachable\n(by search)"} <= {tick.get_text() for tick in settled.axes[1].get_yticklabels()}
    with pytest.raises(MapError, match="this map has no quantity 'sigma_3': did you mean 'sigma_1' or 'sigma_2'"):
        draw_map(five_bar, "sigma_3")


# --- other numbers of axes ---------------------------------------------------------------------------------------


def test_over_a_line_it_is_a_curve(made):
    line = made("planar_3r", ("x", -1.2, 1.2, 48), at={"y": 0.0, "rz": 0.0}, quantities=("manipulability",))
    figure = rendered(draw_map(line, "manipulability"))
    axes = figure.axes[0]
    (curve,) = axes.lines
    x, m = curve.get_data()
    np.testing.assert_allclose(x, line.x.values)
    np.testing.assert_array_equal(np.isfinite(m), line.reachable.values)
    grey = [patch.get_bbox().intervalx for patch in axes.patches]
    np.testing.assert_allclose(sorted(map(tuple, grey)), [(-1.2, -0.5), (0.1, 0.3), (0.9, 1.2)], atol=0.025)
    assert axes.get_xlabel() == "x (m)"


@pytest.mark.parametrize("low", [0.0, 37.0])
def test_wherever_azimuths_begin_the_sphere_is_whole_and_its_numbers_are_right(made, low):
    azimuths = ("azimuth", math.radians(low), math.radians(low + 360.0), 12)
    sphere = made("rx90", azimuths, ("elevation", -math.pi / 2, math.pi / 2, 6), at={"radius": 0.6},
                  centre=(0.2, 0.2, 0.0))  # fmt: skip
    axes = rendered(draw_map(sphere, curves=False)).axes[0]
    (mesh,) = [mesh for mesh in axes.collections if type(mesh).__name__ == "QuadMesh" and mesh.get_array().count() > 1]
    borders = mesh.get_coordinates()[0, :, 0]
    np.testing.assert_allclose(borders[[0, -1]], [-math.pi, math.pi])
    shown = [float(label.get_text()[:-1].replace("−", "-")) for label in axes.get_xticklabels()]
    assert len(shown) >= 5
    for place, degrees in zip(axes.get_xticks(), shown, strict=True):
        turned = math.radians(degrees) - place - math.radians(low) - math.pi
        assert math.remainder(turned, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_over_three_axes_there_are_slices_and_a_solid(made):
    box = made("planar_3r", ("x", -1.0, 1.0, 10), ("y", -1.0, 1.0, 9), ("rz", -3.0, 3.0, 7), quantities=("sigma_1",))
    figure = rendered(draw_map(box, curves=False))
    (solid,) = [axes for axes in figure.axes if axes.name == "3d"]
    assert len(solid.collections[0].get_facecolors()) > 50
    slices = [axes for axes in figure.axes if axes.get_title().startswith("rz ")]
    assert len(slices) == 6
    for axes in slices:
        value = math.radians(float(axes.get_title()[3:-1].replace("−", "-")))
        cells = box.sel(rz=value, method="nearest")
        (shades,) = axes.collections[-1:]
        assert np.ma.count(shades.get_array()) == int(cells.reachable.sum())
    assert str(extent(box)).replace("m^2", "m²") in words(figure)


# --- solids ------------------------------------------------------------------------------------------------------


@given(arrays(bool, st.tuples(*[st.integers(1, 5)] * 3)))
@settings(max_examples=120)
def test_a_solids_surface_is_closed_and_looks_outwards(cells):
    """Each edge is gone along once in both directions; before it is smoothed it holds just its cells."""
    plain = net(cells, rounds=0)
    edges = np.concatenate([np.roll(plain.quads, -k, axis=1)[:, :2] for k in range(4)])
    forth, back = (sorted(map(tuple, pairs)) for pairs in (edges, edges[:, ::-1]))
    assert forth == back
    assert volume(plain) == pytest.approx(cells.sum())
    assert all(cells[tuple(cell)] for cell in plain.inside)
    smooth = net(cells)
    assert np.abs(smooth.points - plain.points).max(initial=0.0) <= 0.5 + 1e-12


def volume(surface):
    """By the divergence theorem, of triangles that make up the quads."""
    total = 0.0
    for a, b, c in ((0, 1, 2), (0, 2, 3)):
        corners = surface.points[surface.quads]
        total += np.einsum("ni,ni->", corners[:, a], np.cross(corners[:, b], corners[:, c])) / 6.0
    return total


# --- two maps ----------------------------------------------------------------------------------------------------


def test_two_maps_show_what_each_reaches_alone(made, wrist):
    """Rings about x = 200 and -200: alone on the right, alone on the left."""
    other = made("planar_3r", ("x", -0.75, 1.15, 38), ("y", -0.9, 0.9, 36), at={"rz": math.pi})
    figure = rendered(draw_comparison(wrist, other))
    parts, difference = figure.axes[:2]
    cells = {to_hex(mesh.get_cmap()(1.0)): ~np.ma.getmaskarray(mesh.get_array()) for mesh in parts.collections}
    a, b = wrist.reachable.values.T, other.reachable.values.T
    np.testing.assert_array_equal(cells[FIRST].reshape(a.shape), a & ~b)
    np.testing.assert_array_equal(cells[SECOND].reshape(a.shape), b & ~a)
    np.testing.assert_array_equal(cells[BOTH].reshape(a.shape), a & b)
    shades = [mesh for mesh in difference.collections if type(mesh).__name__ == "QuadMesh"][-1]
    expected = (other.sigma_1 - wrist.sigma_1).values.T[a & b]
    np.testing.assert_allclose(np.ma.compressed(shades.get_array()), expected, atol=1e-6)
    assert shades.norm.vmin == -shades.norm.vmax
    said = words(figure)
    assert "both" in said
    assert "only" in said
    with pytest.raises(MapError, match="the maps don't both have 'force'"):
        draw_comparison(wrist, other, "force")
