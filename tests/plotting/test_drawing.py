"""Pictures on paper: what a skeleton is, how it is seen, and what stands on the sheet."""

import itertools
import math
from dataclasses import replace
from functools import cache

import coal
import numpy as np
import pinocchio as pin
import pytest
from clearings import apart
from firas import firas
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.legend import Legend
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull
from surfaces import shapes

import cinegen
from cinegen.assembly import assembly_modes
from cinegen.collision import load_scene, scene_for, scene_of
from cinegen.collision.body import Body
from cinegen.model.motion_plane import motion_plane
from cinegen.planning import plan
from cinegen.planning.timed_path import timed_path
from cinegen.plotting import DrawingError, Skeleton, draw_joints, draw_modes, draw_plan, views
from cinegen.plotting.plan import MARGIN, OBSTACLE, edge, outline
from cinegen.plotting.stick import hull

PARALLEL = ("tssm", "delta4", "planar_hybrid")
coordinates = st.floats(-10.0, 10.0).map(lambda value: round(value, 3))


@pytest.fixture(scope="module")
def modes(robot):
    """`modes("tssm")`: all of them, the motors at home."""
    return cache(lambda name: assembly_modes(robot(name)))


@pytest.fixture(scope="module")
def drawn(modes, over_the_wall):
    """`drawn("tssm")`: the figure, rendered; `drawn("wall")`: that of a plan in space."""

    @cache
    def draw(name):
        figure = draw_plan(over_the_wall) if name == "wall" else draw_modes(modes(name))
        FigureCanvasAgg(figure).draw()
        return figure

    return draw


# --- skeletons ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PARALLEL)
def test_parts_are_rigid_in_all_modes_and_the_base_stands_still(robot, modes, name):
    skeleton = Skeleton(robot(name))
    home = skeleton.at(robot(name).q_home)
    for q in modes(name):
        moved = skeleton.at(q)
        for at_home, other in zip(home.parts, moved.parts, strict=True):
            apart = [np.linalg.norm(part.points[:, None] - part.points[None], axis=2) for part in (at_home, other)]
            np.testing.assert_allclose(*apart, atol=1e-9)
            if at_home.is_base:
                np.testing.assert_array_equal(at_home.points, other.points)
        assert np.allclose(moved.end, robot(name).placement(q, robot(name).end).translation)


@pytest.mark.parametrize("name", PARALLEL)
def test_every_joint_is_a_point_of_two_parts_or_of_a_part_and_a_slide(robot, modes, name):
    skeleton = Skeleton(robot(name))
    for q in modes(name):
        pose = skeleton.at(q)
        met = [part.points for part in pose.parts] + [slide.points for slide in pose.slides]
        corners = [(k, point) for k, points in enumerate(met) for point in points]
        for slide in pose.slides:
            for point in slide.points:
                assert sum(np.linalg.norm(point - other) < 1e-9 for _, other in corners) > 1
        for actuated in pose.actuated:
            assert len({k for k, point in corners if np.linalg.norm(actuated - point) < 1e-9}) > 1


def test_a_jack_is_as_long_as_its_motor_says(robot, modes):
    tssm = robot("tssm")
    skeleton = Skeleton(tssm)
    for q in modes("tssm"):
        slides = {slide.joint: slide for slide in skeleton.at(q).slides}
        assert set(slides) == set(tssm.actuated)
        for joint, length in zip(tssm.actuated, modes("tssm").actuated, strict=True):
            assert math.dist(*slides[joint].points) == pytest.approx(length, abs=1e-12)
            assert slides[joint].actuated


# --- views -------------------------------------------------------------------------------------------------------


@given(arrays(float, (6, 3), elements=coordinates))
def test_a_point_is_seen_where_the_ray_from_the_eye_meets_the_picture(points):
    if np.ptp(points, axis=0).max() < 0.1:
        return
    for view in views(points):
        np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(view.axes) > 0.0  # no mirror
        flat, near = view.project(points)
        for point, (x, y), depth in zip(points, flat, near, strict=True):
            right, up, towards = view.axes
            if math.isinf(view.distance):
                ray = towards
            else:
                eye = view.centre + view.distance * towards
                assert depth < 0.5 * view.distance
                ray = eye - point
            part = (view.centre - point) @ towards / (ray @ towards)
            seen = point + part * ray
            np.testing.assert_allclose(seen, view.centre + x * right + y * up, atol=1e-9)


@given(arrays(float, (3, 3), elements=coordinates))
def test_a_front_is_seen_where_its_corners_turn_left(corners):
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    if np.linalg.norm(normal) < 1e-2:
        return
    for view in views(corners):
        (a, b, c), _ = view.project(corners)
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if abs(area) > 1e-6:
            assert view.shows_front(corners.mean(axis=0), normal) == (area > 0.0)


@settings(max_examples=50)
@given(arrays(float, st.tuples(st.integers(3, 12), st.just(2)), elements=coordinates))
def test_an_outline_is_the_convex_hull(points):
    centred = points - points.mean(axis=0)
    if np.linalg.svd(centred)[1][1] < 1e-2:
        return
    corners = hull(points)
    expected = ConvexHull(points)
    area = 0.5 * sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True))
    assert area == pytest.approx(expected.volume, rel=1e-9)
    assert {tuple(corner) for corner in corners} <= {tuple(point) for point in points}


# --- sheets ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "seen"), [("tssm", 3), ("five_bar", 1)])
def test_a_sheet_has_a_panel_for_each_mode_and_view(modes, drawn, name, seen):
    figure = drawn(name)
    count = len(modes(name))
    assert len(figure.axes) == count * seen
    numbers = [axes.get_label().split()[1] for axes in figure.axes]
    assert numbers == [str(k + 1) for k in range(count) for _ in range(seen)]
    written = [text.get_text() for text in figure.texts]
    assert [word for word in written if word.isdecimal()] == [str(k + 1) for k in range(count)]
    assert f"{count} assembly modes" in written[0]


@pytest.mark.parametrize("name", ["tssm", "five_bar"])
def test_all_panels_have_one_scale_and_hide_nothing(robot, modes, drawn, name):
    figure = drawn(name)
    skeleton = Skeleton(robot(name))
    poses = [skeleton.at(q) for q in modes(name)]
    seen = views(np.vstack([pose.points for pose in poses]), motion_plane(robot(name)))
    scales = []
    for panel, axes in enumerate(figure.axes):
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        box = axes.get_position()
        scales.append(box.width * figure.get_figwidth() / (right - left))
        scales.append(box.height * figure.get_figheight() / (high - low))
        flat, _ = seen[panel % len(seen)].project(poses[panel // len(seen)].points)
        assert flat[:, 0].min() > left
        assert flat[:, 0].max() < right
        assert flat[:, 1].min() > low
        assert flat[:, 1].max() < high
    assert scales == pytest.approx([scales[0]] * len(scales))


@pytest.mark.parametrize("name", ["tssm", "five_bar", "wall"])
def test_every_panel_shows_something_and_stands_for_itself(drawn, name):
    figure = drawn(name)
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3]
    taken = np.zeros(pixels.shape[:2], dtype=int)
    for axes in figure.axes:
        box = axes.get_window_extent()
        rows = slice(round(pixels.shape[0] - box.y1), round(pixels.shape[0] - box.y0))
        columns = slice(round(box.x0), round(box.x1))
        assert (pixels[rows, columns] < 200).any(axis=2).mean() > (0.01 if name == "wall" else 0.005)
        taken[rows, columns] += 1
    assert (taken > 1).sum() <= 2 * sum(pixels.shape[:2]) * len(figure.axes)  # a pixel at their edges


@pytest.mark.parametrize("name", ["tssm", "five_bar", "wall"])
def test_words_are_on_the_sheet_and_not_on_each_other(drawn, name):
    figure = drawn(name)
    boxes = [text.get_window_extent() for text in (*figure.texts, *figure.findobj(Legend))]
    for k, box in enumerate(boxes):
        assert figure.bbox.count_contains(box.corners()) == 4
        assert box.count_overlaps(boxes[:k]) == 0


def test_nothing_can_be_drawn_of_no_mode(modes):
    none = replace(modes("five_bar"), configurations=(), coincident=())
    with pytest.raises(DrawingError, match="no assembly mode"):
        draw_modes(none)


# --- joints drawing ---------------------------------------------------------------------------------------------------
# Pictures of joints over time.


@pytest.mark.parametrize(("robot", "rows"), [("arm7", 2), ("scara", 3)])
def test_each_joint_that_moves_is_drawn_from_start_to_goal_within_limits(robot, rows):
    mechanism = cinegen.load(robot)
    middle = {name: np.mean(np.clip(mechanism.limits[name][:2], -1.0, 1.0)) for name in mechanism.actuated}
    home = mechanism.values(mechanism.q_home)
    goal = {name: 0.5 * (home[name] + value) + 0.01 for name, value in middle.items()}
    pairs = itertools.combinations(mechanism.nodes, 2)  # links that are drawn in each other
    planned = plan(scene_for(mechanism, goal, allowed_collisions=[list(pair) for pair in pairs]), seconds=600.0)
    assert planned
    motion, figure = timed_path(planned), draw_joints(planned)
    FigureCanvasAgg(figure).draw()
    assert len(figure.axes) == rows
    drawn = {line.get_label(): line for axes in figure.axes[:-1] for line in axes.lines}
    assert set(drawn) == set(mechanism.joints)  # passive ones, too
    for name, line in drawn.items():
        scale = 1.0 if mechanism.is_prismatic(name) else 180.0 / np.pi
        x, y = line.get_data()
        assert x[-1] == pytest.approx(motion.times[-1])
        assert y[[0, -1]] == pytest.approx(scale * planned.path[[0, -1], mechanism.q_index(name)], abs=1e-6)
    rates = np.concatenate([line.get_ydata() for line in figure.axes[-1].lines[:-2]])
    assert 0.05 < np.abs(rates).max() < 1.0 + 1e-6
    assert f"{motion.times[-1]:.2f} s" in figure.get_suptitle()


def test_a_path_without_motion_is_not_drawn():
    mechanism = cinegen.load("planar_3r")
    with pytest.raises(DrawingError, match="no joint moves"):
        draw_joints(plan(mechanism, {"joint1": mechanism.values(mechanism.q_home)["joint1"]}))


# --- plan drawing -----------------------------------------------------------------------------------------------------
# Pictures of ways: outlines of what is drawn, and what stands in them.


# --- outlines ----------------------------------------------------------------------------------------------------


@settings(max_examples=60)
@given(shapes, st.integers(0, 2**32 - 1))
def test_an_outline_reaches_as_far_as_the_body_in_every_direction(shape, seed):
    """A half-space that stands against the body, square to the picture, touches the outline too."""
    rng = np.random.default_rng(seed)
    rotation = pin.Quaternion(rng.normal(size=4)).normalized().matrix()
    body = Body("body", 0, pin.SE3(rotation, rng.uniform(-1.0, 1.0, 3)), shape)
    view = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
    corners = outline(body, pin.SE3.Identity(), view)
    for angle in rng.uniform(0.0, 2.0 * np.pi, 5):
        way = np.array([np.cos(angle), np.sin(angle)])
        behind = coal.Halfspace(-(view.T @ way), -50.0)  # way.p >= 50
        far = apart(body.shape, body.placement, behind, pin.SE3.Identity())
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
def plan_of(root):
    """`plan_of("rod", firas)`: what became of a scene of the repository."""
    scenes = root / "robots/scenes"
    return cache(lambda name, field="vortex": plan(load_scene(scenes / f"{name}.toml"), field=field, seconds=600.0))


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
    return next(curve for curve in axes.lines if curve.get_label() == label).get_xydata()


def patches(axes, colour):
    """Corners of what is filled so."""
    shapes = [poly for poly in axes.patches if isinstance(poly, Polygon) and poly.get_facecolor()[:3] == to_rgb(colour)]
    return [poly.get_xy()[:-1] for poly in shapes if np.isfinite(poly.get_xy()).all()]


def area(corners):
    x, y = corners.T
    return 0.5 * abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))


@pytest.mark.parametrize(("name", "field"), [("rod", "vortex"), ("rod", firas)])
def test_a_way_is_drawn_from_the_start_to_where_it_ends(plan_of, name, field):
    way = plan_of(name, field)
    chart, strip = draw_plan(way).axes
    drawn = line(chart, f"path of {way.scene.node}")
    places = [way.scene.mechanism.placement(q, way.scene.node).translation[:2] for q in way.path]
    assert drawn[0] == pytest.approx(places[0])
    assert drawn[-1] == pytest.approx(places[-1])
    assert line(chart, "start S")[0] == pytest.approx(places[0])
    assert line(chart, "goal G")[0] == pytest.approx(way.scene.goal.translation[:2])
    assert ("stuck" in [curve.get_label() for curve in chart.lines]) == (not way)
    if not way:
        assert line(chart, "stuck")[0] == pytest.approx(places[-1])
    (left, right), (low, high) = chart.get_xlim(), chart.get_ylim()
    assert ((drawn >= [left, low]) & (drawn <= [right, high])).all()
    assert strip.get_ylabel() == "clearance (m)"


def test_obstacles_are_drawn_as_large_as_they_are_and_as_much_larger_as_is_kept_clear(plan_of):
    way = plan_of("discs")
    chart = draw_plan(way).axes[0]
    radii = sorted(obstacle.written["radius"] for obstacle in way.scene.obstacles)
    for colour, grown in ((OBSTACLE, 0.0), (MARGIN, way.scene.safety)):
        areas = sorted(map(area, patches(chart, colour)))
        assert areas == pytest.approx([np.pi * (radius + grown) ** 2 for radius in radii], rel=1e-3)
    (rod,) = patches(draw_plan(plan_of("rod")).axes[0], OBSTACLE)
    assert area(rod) == pytest.approx(0.24 * 0.01, rel=1e-9)
    assert not patches(draw_plan(way, margin=False).axes[0], MARGIN)


def test_no_drawn_body_of_the_robot_is_in_a_drawn_obstacle(plan_of):
    """In the plane that would be a collision: each link's corners keep the distance from the rod's box."""
    way = plan_of("rod")
    chart = draw_plan(way).axes[0]
    links = [poly.get_xy() for poly in chart.patches if isinstance(poly, Polygon) and 2.0 <= poly.get_zorder() < 3.0]
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
        assert any(area(wall) == pytest.approx(size.prod(), rel=1e-9) for wall in walls)
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
