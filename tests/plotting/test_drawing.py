"""Pictures on paper: what a skeleton is, how it is seen, and what stands on the sheet."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.backends.backend_agg import FigureCanvasAgg
from scipy.spatial import ConvexHull

from cinegen.assembly import assembly_modes
from cinegen.model.motion_plane import motion_plane
from cinegen.plotting import DrawingError, Skeleton, draw_modes, views
from cinegen.plotting.stick import hull

PARALLEL = ("tssm", "delta4", "planar_hybrid")
coordinates = st.floats(-10.0, 10.0).map(lambda value: round(value, 3))


@pytest.fixture(scope="module")
def modes(robot):
    """`modes("tssm")`: all of them, the motors at home."""
    return cache(lambda name: assembly_modes(robot(name)))


@pytest.fixture(scope="module")
def drawn(modes):
    """`drawn("tssm")`: the figure, and how it is rendered."""

    @cache
    def draw(name):
        figure = draw_modes(modes(name))
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        return figure, canvas

    return draw


# --- skeletons ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", PARALLEL)
def test_parts_are_rigid_in_all_modes_and_the_base_stands_still(robot, modes, name):
    skeleton = Skeleton(robot(name))
    home = skeleton.at(robot(name).q_home)
    for q in modes(name):
        there = skeleton.at(q)
        for one, other in zip(home.parts, there.parts, strict=True):
            apart = [np.linalg.norm(part.points[:, None] - part.points[None], axis=2) for part in (one, other)]
            np.testing.assert_allclose(*apart, atol=1e-9)
            if one.is_base:
                np.testing.assert_array_equal(one.points, other.points)
        assert np.allclose(there.end, robot(name).placement(q, robot(name).end).translation)


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
    name = "tssm"
    skeleton = Skeleton(robot(name))
    for q in modes(name):
        slides = {slide.joint: slide for slide in skeleton.at(q).slides}
        assert set(slides) == set(robot(name).actuated)
        for joint, length in zip(robot(name).actuated, modes(name).actuated, strict=True):
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
            there = point + part * ray
            np.testing.assert_allclose(there, view.centre + x * right + y * up, atol=1e-9)


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
    found = hull(points)
    expected = ConvexHull(points)
    area = 0.5 * sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(found, np.roll(found, -1, axis=0), strict=True))
    assert area == pytest.approx(expected.volume, rel=1e-9)
    assert {tuple(corner) for corner in found} <= {tuple(point) for point in points}


# --- sheets ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "seen"), [("tssm", 3), ("five_bar", 1)])
def test_a_sheet_has_a_panel_for_each_mode_and_view(modes, drawn, name, seen):
    figure, _ = drawn(name)
    count = len(modes(name))
    assert len(figure.axes) == count * seen
    numbers = [axes.get_label().split()[1] for axes in figure.axes]
    assert numbers == [str(k + 1) for k in range(count) for _ in range(seen)]
    written = [text.get_text() for text in figure.texts]
    assert [word for word in written if word.isdecimal()] == [str(k + 1) for k in range(count)]
    assert f"{count} assembly modes" in written[0]


@pytest.mark.parametrize("name", ["tssm", "five_bar"])
def test_all_panels_have_one_scale_and_hide_nothing(robot, modes, drawn, name):
    figure, _ = drawn(name)
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


@pytest.mark.parametrize("name", ["tssm", "five_bar"])
def test_every_panel_shows_something_and_stands_for_itself(drawn, name):
    figure, canvas = drawn(name)
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    taken = np.zeros(pixels.shape[:2], dtype=int)
    for axes in figure.axes:
        box = axes.get_window_extent()
        rows = slice(round(pixels.shape[0] - box.y1), round(pixels.shape[0] - box.y0))
        columns = slice(round(box.x0), round(box.x1))
        assert (pixels[rows, columns] < 200).any(axis=2).mean() > 0.005
        taken[rows, columns] += 1
    assert (taken > 1).sum() <= 2 * sum(pixels.shape[:2]) * len(figure.axes)  # a pixel at their edges


def _overlap(one, other):
    return one.x0 < other.x1 and other.x0 < one.x1 and one.y0 < other.y1 and other.y0 < one.y1


@pytest.mark.parametrize("name", ["tssm", "five_bar"])
def test_words_are_on_the_sheet_and_not_on_each_other(drawn, name):
    figure, _ = drawn(name)
    boxes = [text.get_window_extent() for text in figure.texts if text.get_text()]
    sheet = figure.bbox
    for k, box in enumerate(boxes):
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= sheet.width
        assert box.y1 <= sheet.height
        assert not any(_overlap(box, other) for other in boxes[:k])


def test_nothing_can_be_drawn_of_no_mode(modes):
    none = replace(modes("five_bar"), configurations=(), coincident=())
    with pytest.raises(DrawingError, match="no assembly mode"):
        draw_modes(none)


# --- limits ------------------------------------------------------------------------------------------------------
