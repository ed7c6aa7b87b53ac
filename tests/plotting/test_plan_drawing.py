"""Pictures of ways: outlines of what is drawn, and what stands in them."""

from functools import cache

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.patches import Polygon

from cinegen.collision import load_scene, scene_of
from cinegen.collision.body import Body
from cinegen.collision.convex_hull import hull
from cinegen.planning import plan
from cinegen.plotting import draw_plan
from cinegen.plotting.plan import MARGIN, OBSTACLE, edge, outline

sizes = st.floats(0.02, 1.0)
seeds = st.integers(0, 2**32 - 1)


# --- outlines ----------------------------------------------------------------------------------------------------


@st.composite
def bodies(draw):
    """Any shape, standing anywhere."""
    rng = np.random.default_rng(draw(seeds))
    a, b, c = draw(sizes), draw(sizes), draw(sizes)
    solids = [coal.Sphere(a), coal.Capsule(a, b), coal.Cylinder(a, b), coal.Box(a, b, c)]
    shape = draw(st.sampled_from([*solids, hull(rng.normal(size=(12, 3))).shape]))
    rotation = pin.Quaternion(rng.normal(size=4)).normalized().matrix()
    return Body("body", 0, pin.SE3(rotation, rng.uniform(-1.0, 1.0, 3)), shape), rng


def view_of(rng):
    """A picture turned anyhow: (2, 3), and its normal."""
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return axes[:2], axes[2]


def distance(body, shape, place):
    transforms = [coal.Transform3s(at.rotation, at.translation) for at in (body.placement, place)]
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    return coal.distance(body.shape, transforms[0], shape, transforms[1], request, coal.DistanceResult())


@settings(max_examples=60)
@given(bodies())
def test_an_outline_reaches_as_far_as_the_body_in_every_direction(made):
    """A half-space that stands against the body, square to the picture, touches the outline too."""
    body, rng = made
    view, _ = view_of(rng)
    corners = outline(body, pin.SE3.Identity(), view)
    for angle in rng.uniform(0.0, 2.0 * np.pi, 5):
        way = np.array([np.cos(angle), np.sin(angle)])
        far = distance(body, coal.Halfspace(-(view.T @ way), -50.0), pin.SE3.Identity())  # behind it: way.p >= 50
        reach = float((corners @ way).max())
        assert reach <= 50.0 - far + 1e-5
        assert reach >= 50.0 - far - 2e-4  # what is round has corners, two degrees apart


@given(st.floats(-3.0, 3.0), st.floats(-np.pi, np.pi), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_a_half_space_is_seen_on_its_edge_only(offset, turn, x, y):
    shape = coal.Halfspace(np.array([0.0, 1.0, 0.0]), offset)
    place = pin.SE3(pin.utils.rotate("z", turn), np.array([x, y, 0.3]))
    body = Body("floor", 0, place, shape)
    normal, behind = edge(body, np.eye(3)[:2])
    on = place.act(np.array([0.7, offset, -2.0]))
    assert normal @ on[:2] == pytest.approx(behind, abs=1e-12)
    below = place.act(np.array([0.7, offset - 1.0, -2.0]))
    assert normal @ below[:2] == pytest.approx(behind - 1.0)
    assert edge(body, np.array([[0.0, 0.0, 1.0], place.rotation[:, 0]])) is None


# --- pictures ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found(root):
    """`found("rod", "firas")`: what became of a scene of the repository."""
    return cache(
        lambda name, field="vortex": plan(load_scene(root / f"robots/scenes/{name}.toml"), field=field, seconds=600.0)
    )


WALL = {
    "name": "wall",
    "robot": "robots/arm7.raff",
    "safety": 0.02,
    "start": {"joints": {"joint1": -0.6}},
    "goal": {"point": [0.5, 0.35, 0.3]},
    "obstacle": [
        {"name": "wall", "kind": "box", "size": [0.7, 0.04, 0.45], "point": [0.55, 0.0, 0.225]},
        {"name": "floor", "kind": "half_space", "normal": [0, 0, 1], "point": [0, 0, -0.05]},
    ],
}


@pytest.fixture(scope="module")
def over_the_wall(root):
    return plan(scene_of(WALL, root), seconds=600.0)


def line(axes, label):
    return next(one for one in axes.lines if one.get_label() == label).get_xydata()


def labels(axes):
    return [one.get_label() for one in axes.lines]


def patches(axes, colour):
    """Corners of what is filled so."""
    shapes = [one for one in axes.patches if isinstance(one, Polygon) and one.get_facecolor()[:3] == to_rgb(colour)]
    return [one.get_xy()[:-1] for one in shapes if np.isfinite(one.get_xy()).all()]


def area(corners):
    x, y = corners.T
    return 0.5 * abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))


@pytest.mark.parametrize(("name", "field"), [("rod", "vortex"), ("rod", "firas")])
def test_a_way_is_drawn_from_the_start_to_where_it_ends(found, name, field):
    way = found(name, field)
    chart, strip = draw_plan(way).axes
    drawn = line(chart, f"path of {way.scene.node}")
    places = [way.scene.mechanism.placement(q, way.scene.node).translation[:2] for q in way.path]
    assert drawn[0] == pytest.approx(places[0])
    assert drawn[-1] == pytest.approx(places[-1])
    assert line(chart, "start S")[0] == pytest.approx(places[0])
    assert line(chart, "goal G")[0] == pytest.approx(way.scene.goal.translation[:2])
    assert ("stuck" in labels(chart)) == (not way)
    if not way:
        assert line(chart, "stuck")[0] == pytest.approx(places[-1])
    (left, right), (low, high) = chart.get_xlim(), chart.get_ylim()
    assert ((drawn >= [left, low]) & (drawn <= [right, high])).all()
    assert strip.get_ylabel() == "clearance (m)"


def test_obstacles_are_drawn_as_large_as_they_are_and_as_much_larger_as_is_kept_clear(found):
    way = found("discs")
    chart = draw_plan(way).axes[0]
    radii = sorted(one.written["radius"] for one in way.scene.obstacles)
    for colour, grown in ((OBSTACLE, 0.0), (MARGIN, way.scene.safety)):
        areas = sorted(map(area, patches(chart, colour)))
        assert areas == pytest.approx([np.pi * (radius + grown) ** 2 for radius in radii], rel=1e-3)
    (rod,) = patches(draw_plan(found("rod")).axes[0], OBSTACLE)
    assert area(rod) == pytest.approx(0.24 * 0.01, rel=1e-9)
    assert not patches(draw_plan(way, margin=False).axes[0], MARGIN)


def test_no_drawn_body_of_the_robot_is_in_a_drawn_obstacle(found):
    """In the plane that would be a collision: each link's corners keep the distance from the rod's box."""
    way = found("rod")
    chart = draw_plan(way).axes[0]
    links = [one.get_xy() for one in chart.patches if isinstance(one, Polygon) and 2.0 <= one.get_zorder() < 3.0]
    assert len(links) > 15 * 3
    for corners in links:
        out = np.maximum(np.abs(corners - [0.62, 0.0]) - [0.12, 0.005], 0.0)
        assert np.linalg.norm(out, axis=1).min() >= way.scene.safety - 1e-9


def test_what_moves_in_space_is_seen_from_three_sides(over_the_wall):
    way = over_the_wall
    assert way
    *charts, strip = draw_plan(way).axes
    assert [chart.get_title() for chart in charts] == ["top", "front", "right"]
    sides = [(0, 1), (0, 2), (1, 2)]
    for chart, side in zip(charts, sides, strict=True):
        assert (chart.get_xlabel(), chart.get_ylabel()) == tuple(f"{'xyz'[i]} (m)" for i in side)
        drawn = line(chart, "path of tool")
        assert drawn[-1] == pytest.approx(way.trace[-1][list(side)])
        walls = patches(chart, OBSTACLE)
        size = np.array([0.7, 0.04, 0.45])[list(side)]
        assert any(area(one) == pytest.approx(size.prod(), rel=1e-9) for one in walls)
        assert len(walls) == (1 if side == (0, 1) else 2)  # the floor is no edge from the top
    assert strip.get_xlabel() == "fraction of the motion (%)"


@pytest.mark.parametrize(
    ("values", "title"),
    [
        ({"goal": {"point": [1, 0]}, "obstacle": [{"kind": "disc", "radius": 0.1}]}, "start in collision"),
        ({"goal": {"point": [0, 0]}, "safety": 0}, "reached"),
        ({"goal": {"point": [1, 0]}, "mobile": {"radius": 0}}, "reached"),
    ],
)
def test_there_is_a_picture_of_every_plan(values, title):
    way = plan(scene_of({"mobile": {"radius": 0.1}} | values))
    figure = draw_plan(way)
    assert title in figure.get_suptitle()
    FigureCanvasAgg(figure).draw()


def test_nothing_is_cut_off_and_something_is_seen(over_the_wall):
    figure = draw_plan(over_the_wall)
    FigureCanvasAgg(figure).draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    for axes in figure.axes:
        left, bottom, width, height = (round(v) for v in axes.get_window_extent().bounds)
        part = pixels[len(pixels) - bottom - height : len(pixels) - bottom, left : left + width]
        assert (part.min(axis=2) < 200).mean() > 0.01
    for text in figure.findobj(lambda artist: hasattr(artist, "get_legend_handler_map")):
        box = text.get_window_extent()
        assert box.x0 >= 0.0
        assert box.x1 <= pixels.shape[1]
