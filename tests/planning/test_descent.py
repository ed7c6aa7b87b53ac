"""Down a potential: its gradient, that it ends in minima where the paper says so, and that nothing is ever hit."""

from __future__ import annotations

import itertools
import math
from functools import cache
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cinegen.collision import PlanningError, clearance_of, load_scene, scene_of
from cinegen.collision.body import Body
from cinegen.collision.links import link_bodies
from cinegen.ik import Posture
from cinegen.planning import PlanStatus, plan
from cinegen.planning.attempt import attempt
from cinegen.planning.descent import GAINS, AvoidanceField, Gains, GoalPotential, Potential
from cinegen.planning.enclosures import Enclosure
from cinegen.planning.potential_fields import Elliptical, Firas, Spherical

ROBOTS = Path(__file__).resolve().parents[2] / "robots"
REPULSIVE = (AvoidanceField.FIRAS, AvoidanceField.SPHERICAL, AvoidanceField.ELLIPTICAL)
Z = np.array([0.0, 0.0, 1.0])


@cache
def figure(name):
    return load_scene(ROBOTS / "scenes" / f"{name}.toml")


def point(obstacles, radius=0.0, start=(0.0, 0.0), goal=(4.0, 0.0), **more):
    """A mobile robot."""
    document = {"name": "point", "mobile": {"radius": radius}, "safety": 0.02, "influence": 0.6, **more}
    document |= {"start": {"point": list(start)}, "goal": {"point": list(goal)}, "obstacle": obstacles}
    return scene_of(document)


def bodies(scene):
    return link_bodies(scene.mechanism) if scene.bodies is None else scene.bodies


def potential(scene, field, reach, **more):
    return Potential(scene, bodies(scene), field, reach, **more)


def moved(scene, q, step):
    """q moved by a step without unit."""
    return pin.integrate(scene.mechanism.model, q, np.asarray(step) * scene.mechanism.scale)


def slopes(scene, value, q, step):
    """Central differences by rad and lengths."""
    ways = step * np.eye(scene.mechanism.model.nv)
    return np.array([value(moved(scene, q, e)) - value(moved(scene, q, -e)) for e in ways]) / (2.0 * step)


# --- the gradient ----------------------------------------------------------------------------------------------------


def apart(scene, q, obstacle):
    """By joint, how far its bodies are from an obstacle, as coal says it of each two."""
    mechanism = scene.mechanism
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    found = {}
    for body in bodies(scene):
        if body.joint:
            at = data.oMi[body.joint] * body.placement
            places = [coal.Transform3s(each.rotation, each.translation) for each in (at, obstacle.placement)]
            request, result = coal.DistanceRequest(), coal.DistanceResult()
            d = coal.distance(body.shape, places[0], obstacle.shape, places[1], request, result)
            found[body.joint] = min(d, found.get(body.joint, math.inf))
    return np.array(list(found.values()))


def attraction(scene, q):
    """Of goals that are points of the plane."""
    way = scene.mechanism.placement(q, scene.node).translation - scene.goal.translation
    return 0.5 * float(way[:2] @ way[:2]) / scene.mechanism.length**2


def firas(scene, q, reach, task):
    """The total potential far from the goal, by its formula: at half its range it pushes with task / length."""
    k = task / scene.mechanism.length * (reach / 2.0) ** 2 / (2.0 / reach - 1.0 / reach)
    distances = np.concatenate([apart(scene, q, body) for each in scene.obstacles for body in each.bodies])
    return attraction(scene, q) + float(0.5 * k * (np.maximum(1.0 / distances - 1.0 / reach, 0.0) ** 2).sum())


def circle_around(box):
    """A rectangle in the plane, as a disc: all of its height, which is only drawn, is left out."""
    return Body("", 0, box.placement, coal.Capsule(float(np.linalg.norm(box.shape.halfSide[:2])), 9.0))


def spherical(scene, q, reach, task):
    """The same of the circles around rectangles."""
    total = attraction(scene, q)
    for each in scene.obstacles:
        k = task / scene.mechanism.length * (reach / 2.0) ** 3 / 2.0
        total += float((k / apart(scene, q, circle_around(each.bodies[0])) ** 2).sum())
    return total


def elliptical(scene, q, field):
    """The same of a potential around a rectangle, at the worst of many points of each link's axis."""
    mechanism = scene.mechanism
    data = mechanism.model.createData()
    pin.forwardKinematics(mechanism.model, data, q)
    worst = {}
    for body in bodies(scene):
        if body.joint:
            at = data.oMi[body.joint] * body.placement
            half = getattr(body.shape, "halfLength", 0.0)
            axis = at.translation + np.linspace(-half, half, 401)[:, None] * at.rotation[:, 2]
            local = (axis - field.centre) @ field.axes
            off = local - np.clip(local, -field.half, field.half)
            surface = axis - body.shape.radius * (off / np.linalg.norm(off, axis=1)[:, None]) @ field.axes.T
            worst[body.joint] = max(worst.get(body.joint, 0.0), float(field.value(surface).max()))
    return attraction(scene, q) + sum(worst.values())


around_start = st.lists(st.floats(-0.25, 0.25), min_size=3, max_size=3)


@settings(max_examples=25)
@given(around_start, st.floats(0.1, 0.5))
def test_firas_has_the_gradient_of_its_total_potential_for_an_arm(step, reach):
    scene = figure("rod")
    q = moved(scene, scene.start, step)
    found = potential(scene, AvoidanceField.FIRAS, reach)
    task = GAINS[AvoidanceField.FIRAS].strength
    assert found.value(q) == pytest.approx(firas(scene, q, reach, task), rel=1e-6)
    wanted = slopes(scene, lambda q: firas(scene, q, reach, task), q, 1e-5)
    assert found.gradient(q) == pytest.approx(wanted, abs=2e-4 * (1.0 + np.abs(wanted).max()))


@settings(max_examples=25)
@given(around_start, st.floats(0.1, 0.5))
def test_spherical_has_the_gradient_of_its_total_potential_for_an_arm(step, reach):
    scene = figure("rod")
    q = moved(scene, scene.start, step)
    assume(min(apart(scene, q, circle_around(scene.obstacles[0].bodies[0]))) > 0.02)
    found = potential(scene, AvoidanceField.SPHERICAL, reach)
    task = GAINS[AvoidanceField.SPHERICAL].strength
    assert isinstance(found.fields[0], Spherical)
    assert found.value(q) == pytest.approx(spherical(scene, q, reach, task), rel=1e-3)  # its ball is nearly the least
    wanted = slopes(scene, found.value, q, 1e-5)
    assert found.gradient(q) == pytest.approx(wanted, abs=2e-4 * (1.0 + np.abs(wanted).max()))
    by_formula = slopes(scene, lambda q: spherical(scene, q, reach, task), q, 1e-5)
    assert found.gradient(q) == pytest.approx(by_formula, abs=5e-3 * (1.0 + np.abs(wanted).max()))


@settings(max_examples=8, deadline=None)
@given(around_start)
def test_elliptical_has_the_gradient_of_its_total_potential_for_an_arm(step):
    scene = figure("rod")
    q = moved(scene, scene.start, step)
    found = potential(scene, AvoidanceField.ELLIPTICAL, 0.2)
    (field,) = found.fields
    assert isinstance(field, Elliptical)
    assert found.value(q) == pytest.approx(elliptical(scene, q, field), rel=1e-3)
    wanted = slopes(scene, lambda q: elliptical(scene, q, field), q, 1e-4)
    assert found.gradient(q) == pytest.approx(wanted, abs=0.02 * (1.0 + np.abs(wanted).max()))


@pytest.mark.parametrize("field", REPULSIVE)
@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
@settings(max_examples=10, deadline=None)
def test_where_repulsion_fades_it_is_still_the_gradient(field, x, y):
    scene = point([{"kind": "disc", "radius": 0.3, "point": [4.0, 0.7]}])
    found = potential(scene, field, 0.6, fading=0.5)
    q = np.array([4.0 + x, y])
    wanted = slopes(scene, found.value, q, 1e-5)
    assert found.gradient(q) == pytest.approx(wanted, abs=1e-3 * (1.0 + np.abs(wanted).max()))


@pytest.mark.parametrize("field", REPULSIVE)
@pytest.mark.parametrize("part", [0.1, 0.5, 0.9, 1.0, 2.0])
def test_repulsion_fades_by_the_square_of_the_error_from_where_fading_starts(field, part):
    """Its weight is 1 - (1 - u)^2 with u the square of the error relative to that distance, and 1 from there on."""
    scene = point([{"kind": "disc", "radius": 0.3, "point": [4.0, 0.7]}])
    q, fading = np.array([3.8, 0.1]), math.sqrt(2.0 * GoalPotential(scene).value([3.8, 0.1])) / part
    full, faded = (potential(scene, field, 0.6, fading=start) for start in (1e-9, fading))
    repulsion = full.value(q) - full.goal.value(q)
    assert repulsion > 1e-3
    weight = 1.0 - (1.0 - min(part, 1.0) ** 2) ** 2
    assert faded.value(q) - faded.goal.value(q) == pytest.approx(weight * repulsion, rel=1e-9)


@pytest.mark.parametrize("field", REPULSIVE)
def test_at_the_goal_nothing_is_left_but_the_goal(field):
    found = potential(point([{"kind": "disc", "radius": 0.3, "point": [4.0, 0.5]}]), field, 0.6)
    at_goal = np.array([4.0, 0.0])
    assert found.value(at_goal) == 0.0
    assert found.gradient(at_goal) == pytest.approx([0.0, 0.0])


def test_the_attraction_counts_rotation_too():
    document = {"name": "turn", "robot": str(ROBOTS / "arm7.raff"), "safety": 0.01, "obstacle": []}
    start = scene_of({**document, "goal": {"point": [0.1, 0.1, 0.5]}})
    target = start.mechanism.placement(start.start + 0.3, start.node)
    turn = pin.rpy.matrixToRpy(target.rotation).tolist()
    scene = scene_of({**document, "node": start.node, "goal": {"point": target.translation.tolist(), "rpy": turn}})
    goal, q = GoalPotential(scene), scene.start
    here = scene.mechanism.placement(q, scene.node)
    way = (target.translation - here.translation) / scene.mechanism.length
    turned = Rotation.from_matrix(target.rotation @ here.rotation.T).magnitude()
    assert turned > 0.1
    assert goal.value(q) == pytest.approx(0.5 * (way @ way + turned**2), rel=1e-9)
    assert goal.gradient(q) == pytest.approx(slopes(scene, goal.value, q, 1e-5), abs=1e-6)


# --- minima ----------------------------------------------------------------------------------------------------------


def is_lowest(scene, found, q, away):
    """Whether nothing around q is lower."""
    rng = np.random.default_rng(1)
    ways = rng.normal(size=(200, scene.mechanism.model.nv))
    here = found.value(q)
    return all(found.value(moved(scene, q, away * way / np.linalg.norm(way))) >= here - 1e-9 for way in ways)


def test_what_blocks_an_attempt_is_what_is_near_at_its_end():
    """Straight ahead from beside one obstacle until another is in the way."""
    beside, across = {"kind": "disc", "radius": 0.3, "point": [0.0, 0.43]}, {"kind": "box", "size": [0.1, 3.0]}
    scene = point([{**beside, "name": "beside"}, {**across, "point": [2.0, 0.0], "name": "across"}], radius=0.1)
    goal = np.array([4.0, 0.0])
    made = attempt(
        clearance_of(scene), np.zeros(2), Posture(goal, rate=0.1), lambda q: float(np.linalg.norm(q - goal)),
        lambda q: bool(np.abs(q - goal).max() < 1e-3), scene.safety, 500, "straight",
    )  # fmt: skip
    assert made.status is PlanStatus.STUCK
    assert [set(pair) for pair in made.blocked_by] == [{"mobile", "across"}]
    assert made.path[-1] == pytest.approx([1.95 - 0.1 - 0.02, 0.0], abs=0.02)


@pytest.mark.parametrize("task", [0.03, 0.1, 1.0])
@pytest.mark.parametrize("which", ["rod", "disc"])
def test_firas_stops_in_a_minimum_of_the_field_in_figures_5_and_7(which, task, monkeypatch):
    monkeypatch.setitem(GAINS, AvoidanceField.FIRAS, Gains(task))
    scene = figure("rod") if which == "rod" else figure("disc")
    found = plan(scene, field="firas")
    assert found.status is PlanStatus.STUCK
    assert found.field == "firas"
    assert len(found.attempts) == 1
    end = found.path[-1]
    total = potential(scene, AvoidanceField.FIRAS, 0.5 * scene.mechanism.length)
    assert np.abs(total.gradient(end)).max() < 2e-3
    assert np.linalg.norm(total.goal.gradient(end)) > 0.1  # attraction and repulsion are in balance
    assert is_lowest(scene, total, end, 0.01)
    assert not found.attempts[0].blocked_by  # it is not the barrier that stops it
    assert found.clearances[-1] > 3.0 * scene.safety


def test_vortices_get_round_where_firas_stops():
    assert plan(figure("rod"))
    assert plan(figure("disc"))


@pytest.mark.parametrize("field", REPULSIVE)
def test_descent_only_goes_down(field):
    scene = figure("rod")
    total = potential(scene, field, 0.5 * scene.mechanism.length)
    values = [total.value(q) for q in plan(scene, field=field, steps=15).path]
    assert values[0] - values[-1] > 0.1
    assert np.diff(values).max() < 1e-9


def test_no_step_is_longer_than_allowed():
    scene = figure("rod")
    steps = np.diff(plan(scene, field="firas").path, axis=0)
    assert 0.05 < np.abs(steps).max() <= 0.06 + 1e-12


@pytest.mark.parametrize("field", [AvoidanceField.FIRAS, AvoidanceField.SPHERICAL])
@pytest.mark.parametrize("radius", [0.0, 0.15])
def test_a_disc_beside_the_way_stops_no_mobile_robot(field, radius):
    scene = point([{"kind": "disc", "radius": 0.4, "point": [2.0, 0.05]}], radius)
    found = plan(scene, field=field)
    assert found
    assert found.clearance >= scene.safety
    assert found.length > 4.05  # it was in the way


def test_with_a_disc_straight_ahead_repulsion_stops_and_a_vortex_does_not():
    scene = point([{"kind": "disc", "radius": 0.4, "point": [2.0, 0.0]}])
    for field in REPULSIVE:
        found = plan(scene, field=field)
        assert found.status is PlanStatus.STUCK, field
        assert found.path[-1][1] == pytest.approx(0.0, abs=1e-6)
    assert plan(scene)


@pytest.mark.parametrize("field", [AvoidanceField.FIRAS, AvoidanceField.SPHERICAL])
@pytest.mark.parametrize("name", ["rod", "disc", "discs", "generic"])
def test_nothing_comes_nearer_than_the_safety_distance_whatever_leads(name, field):
    scene = figure(name)
    found = plan(scene, field=field)
    assert len(found.path) > 10
    assert found.clearance >= scene.safety


def test_loops_stay_closed_on_the_way_down():
    document = {"name": "delta", "robot": str(ROBOTS / "delta4.raff"), "safety": 0.005, "obstacle": []}
    home = scene_of({**document, "goal": {"point": [0.0, 0.0, 0.0]}})
    here = home.mechanism.placement(home.start, home.node).translation
    goal = here + 0.15 * home.mechanism.length * np.array([1.0, 0.5, 0.0])
    scene = scene_of({**document, "node": home.node, "goal": {"point": goal.tolist()}})
    found = plan(scene, field="firas")
    assert found
    assert max(scene.mechanism.closure(q) for q in found.path) < 1e-8
    total = potential(scene, AvoidanceField.FIRAS, 0.1)
    assert np.diff([total.value(q) for q in found.path]).max() < 1e-9


def test_there_is_no_other_field():
    with pytest.raises(PlanningError, match="unknown field 'magnetic'; use one of vortex, firas"):
        plan(figure("rod"), field="magnetic")


# --- what stands for obstacles ---------------------------------------------------------------------------------------

turns = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(lambda rpy: pin.rpy.rpyToMatrix(*rpy))
sizes = st.floats(0.05, 2.0)
shapes = st.one_of(
    st.builds(coal.Sphere, sizes),
    st.builds(coal.Capsule, sizes, sizes),
    st.builds(coal.Cylinder, sizes, sizes),
    st.builds(coal.Box, sizes, sizes, sizes),
)


def sampled(body):
    """Points of its surface: the furthest along many directions."""
    rng = np.random.default_rng(0)
    shape, found = body.shape, []
    for way in rng.normal(size=(300, 3)):
        way = way / np.linalg.norm(way)
        match shape:
            case coal.Sphere():
                at = shape.radius * way
            case coal.Capsule():
                at = shape.radius * way + [0.0, 0.0, math.copysign(shape.halfLength, way[2])]
            case coal.Cylinder():
                side = np.append(way[:2] / np.linalg.norm(way[:2]) * shape.radius, 0.0)
                at = side + math.copysign(shape.halfLength, way[2]) * Z
            case coal.Box():
                at = np.copysign(np.array(shape.halfSide), way)
        found.append(body.placement.act(np.asarray(at)))
    return np.array(found)


@given(shapes, turns, st.sampled_from([None, "plane"]))
def test_ball_and_box_hold_what_they_stand_for(shape, turn, where):
    plane = None if where is None else turn[:, 1]  # any plane
    body = Body("thing", 0, pin.SE3(turn, np.array([0.3, -0.2, 0.5])), shape)
    enclosure, points = Enclosure(body, plane), sampled(body)
    middle, half, axes = enclosure.box
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert (np.abs((points - middle) @ axes) <= half + 1e-9).all()
    centre, radius = enclosure.ball.placement.translation, enclosure.ball.shape.radius
    off = points - centre
    if plane is not None:
        off = off - np.outer(off @ plane, plane)
        assert half[2] == math.inf
        assert abs(axes[:, 2] @ plane) == pytest.approx(1.0)
    away = np.linalg.norm(off, axis=1)
    assert (away <= radius + 1e-9).all()


@given(st.integers(3, 9), sizes, st.floats(0.0, 6.0))
def test_the_circle_around_a_regular_polygon_is_its_circumcircle(corners, size, turn):
    angles = turn + 2.0 * np.pi * np.arange(corners) / corners
    points = size * np.column_stack([np.cos(angles), np.sin(angles)])
    scene = point([{"kind": "polygon", "points": points.tolist(), "point": [9.0, 9.0]}], goal=(1.0, 0.0))
    ring = Enclosure(scene.obstacles[0].bodies[0], Z).ball
    assert ring.shape.radius == pytest.approx(size, rel=0.01)
    assert ring.placement.translation[:2] == pytest.approx([9.0, 9.0], abs=0.01 * size)


@given(sizes, sizes, st.floats(-3.0, 3.0))
def test_the_rectangle_around_a_rectangle_is_itself(width, depth, angle):
    corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [width / 2, depth / 2]
    obstacle = {"kind": "polygon", "points": corners.tolist(), "point": [9.0, 9.0], "angle": angle}
    box = Enclosure(point([obstacle]).obstacles[0].bodies[0], Z).box
    assert sorted(box.half[:2]) == pytest.approx(sorted([width / 2, depth / 2]))
    assert box.middle[:2] == pytest.approx([9.0, 9.0])


def test_firas_stands_in_where_ball_or_box_would_forbid_too_much():
    wall = {"kind": "half_space", "normal": [0.0, 1.0], "point": [0.0, -1.0]}
    beam = {"kind": "box", "size": [3.0, 0.1], "point": [2.0, 0.5]}  # its circle holds the way, its box does not
    away = {"kind": "disc", "radius": 0.2, "point": [2.0, 3.0]}
    scene = point([wall, beam, away], start=(0.8, 0.0), goal=(3.2, 0.0))
    kinds = {field: [type(one) for one in potential(scene, field, 0.5).fields] for field in REPULSIVE}
    assert kinds[AvoidanceField.FIRAS] == [Firas, Firas, Firas]
    assert kinds[AvoidanceField.SPHERICAL] == [Firas, Firas, Spherical]
    assert kinds[AvoidanceField.ELLIPTICAL] == [Firas, Elliptical, Elliptical]


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
def test_gains_say_how_hard_an_obstacle_pushes_in_the_middle_of_its_range(exponent):
    gains, reach, length = Gains(0.7, exponent), 0.4, 2.0
    wanted = [[0.0, -0.7 / length, 0.0]]
    assert gains.firas(reach, length).gradient([0.5 * reach], [[0.0, 1.0, 0.0]]) == pytest.approx(np.array(wanted))
    assert gains.spherical(reach, length).gradient([0.5 * reach], [[0.0, 1.0, 0.0]]) == pytest.approx(np.array(wanted))
    for size, k in itertools.product([0.2, 1.0], [1.0, 3.0]):
        cube = Enclosure(Body("cube", 0, pin.SE3.Identity(), coal.Box(size, size / k, size / k)), None).box
        along = np.array([[size / 2 + 0.5 * reach, 0.0, 0.0]])
        push = gains.elliptical(cube, reach, length).gradient(along)
        assert 0.2 < np.linalg.norm(push) / (0.7 / length) < 2.0  # contours are not as far everywhere
        assert push[0, 0] < 0.0
