"""Weights of joints in the length of paths."""

import json
import math
from itertools import pairwise

import coal
import numpy as np
import pinocchio as pin
import pytest
from clearings import apart, at
from paths import along
from ticking import of_pinocchio

import cinegen
from cinegen.collision import PlanningError, clearance_of, scene_of
from cinegen.collision.mesh_check import MeshCheck
from cinegen.ik.barrier import Range
from cinegen.ik.state import State
from cinegen.ik.tasks.kinds import AxisAlong, PointInPlane
from cinegen.planning import PlanStatus, plan
from cinegen.planning.goal_configurations import goal_poses


@pytest.fixture(scope="module")
def arm():
    return cinegen.load("arm7")


START = {"joint1": -0.6, "joint2": 0.5, "joint4": -1.2, "joint6": 0.7}
POST = {"name": "post", "kind": "cylinder", "radius": 0.04, "length": 1.2, "point": [0.42, 0.0, 0.2]}


def scene(arm, *obstacles, **more):
    values = {"start": {"joints": START}, "goal": {"point": [0.5, 0.35, 0.3]}, "obstacle": list(obstacles)}
    return scene_of(values | more, mechanism=arm)


@pytest.mark.parametrize("planner", ["auto", "rrtconnect"])
def test_a_heavy_joint_moves_less(planner):
    robot, moved = cinegen.load("planar_3r"), []
    for weights in ({"joint1": 50.0}, {"joint3": 50.0}):
        values = {"goal": {"point": [0.3, 0.35]}, "start": {"joints": {"joint2": 0.9}}, "weights": weights}
        planned = plan(scene_of(values, mechanism=robot), planner=planner, seconds=20.0)
        assert planned
        steps = np.diff(planned.path, axis=0)
        moved.append(np.abs(steps).sum(axis=0))
        factors = np.array([weights.get(name, 1.0) for name in robot.joints])
        assert planned.weighted_motion == pytest.approx(np.linalg.norm(steps * factors, axis=1).sum())
        assert planned.motion == pytest.approx(np.linalg.norm(steps, axis=1).sum())
    assert moved[0][0] < moved[1][0]
    assert moved[1][2] < moved[0][2]


def test_fields_refuse_weights_and_are_left_out_without_being_asked(arm):
    wall = {"kind": "box", "size": [0.7, 0.04, 0.45], "point": [0.55, 0.0, 0.225]}
    heavy = scene(arm, wall, weights={"joint1": 5.0}, start={"joints": {"joint1": -0.6}})
    with pytest.raises(PlanningError, match="weights of joints need RRT-Connect, not a field"):
        plan(heavy, planner="vortex")
    strategies = {attempt.strategy for attempt in plan(heavy, seconds=20.0).attempts}
    assert strategies <= {"RRT-Connect", "LBKPIECE", "all joints straight to the goal"}
    plan(scene(arm, weights={"joint1": 1.0}), planner="vortex", steps=3)  # changes nothing


def test_weights_are_written_and_read_again_and_wrong_ones_reported(arm):
    made = scene(arm, weights={"joint2": 3.0})
    assert scene_of(made.document(), mechanism=arm).weights == {"joint2": 3.0}
    assert made.metric[arm.v_index("joint2")] == pytest.approx(arm.scale[arm.v_index("joint2")] / 3.0)


# --- path constraints -------------------------------------------------------------------------------------------------
# Goals that are regions, and constraints of the node all along a path; judged by Pinocchio's placements.


def placements(problem, path):
    """Poses of the node on a path, joints straight between two configurations."""
    return [of_pinocchio(problem.mechanism, q, problem.node) for q in along(problem.mechanism, path, 0.01)]


def start_pose(arm):
    return arm.placement(arm.configuration(START), arm.end)


# --- regions ------------------------------------------------------------------------------------------------------


def test_a_goal_region_is_reached_at_any_of_its_points_and_orientations(arm):
    goal = {"point": [0.35, 0.35, 0.4], "tolerance": [0.05, 0.0, 0.1], "rpy": [math.pi, 0.0, 0.0], "cone": 0.3}
    problem = scene(arm, POST, goal=goal)
    planned = plan(problem)
    assert planned.status is PlanStatus.REACHED
    end = placements(problem, planned.path)[-1]
    beyond = np.abs(end.translation - goal["point"]) - goal["tolerance"]
    assert beyond.max() < 1e-4
    assert math.acos(-end.rotation[2, 2]) < 0.3 + 1e-4
    first = next(goal_poses(problem))
    assert math.acos(-first.rotation[2, 2]) == pytest.approx(0.3), "the nearest orientation to the start comes first"
    again = scene_of(problem.document(), mechanism=arm)
    assert again.tolerance.tolist() == goal["tolerance"]
    assert again.cone == pytest.approx(0.3)


# --- constraints along the path -----------------------------------------------------------------------------------


def test_an_upright_node_only_rotates_about_the_vertical_around_a_post(arm):
    start = start_pose(arm).rotation
    goal = start_pose(arm).translation * [1.0, -1.0, 1.0]
    free, upright = (scene(arm, POST, goal={"point": goal.tolist()}, path={"upright": flag}) for flag in (False, True))
    tilts = []
    for problem in (free, upright):
        planned = plan(problem, seconds=60.0)
        assert planned.status is PlanStatus.REACHED
        assert planned.clearance >= problem.safety
        assert np.linalg.norm(planned.trace[-1] - goal) < 1e-4
        turns = [pose.rotation @ start.T for pose in placements(problem, planned.path)]
        tilts.append(max(math.atan2(math.hypot(turn[0, 2], turn[1, 2]), turn[2, 2]) for turn in turns))
    assert tilts[0] > 0.05  # without the constraint the node tilts
    assert tilts[1] < 2e-3
    clearance = clearance_of(upright)
    assert min(clearance.least(q) for q in planned.path) >= upright.safety


@pytest.mark.parametrize(
    ("path", "offset"),
    [({"line": [0.0, 1.0, 0.0]}, [0.0, 0.3, 0.0]), ({"plane": [0.0, 0.0, 2.0]}, [-0.1, 0.35, 0.0])],
    ids=["line", "plane"],
)
def test_a_node_stays_on_a_line_and_in_a_plane(arm, path, offset):
    start = start_pose(arm).translation
    problem = scene(arm, goal={"point": (start + offset).tolist()}, path=path)
    planned = plan(problem, seconds=60.0)
    assert planned.status is PlanStatus.REACHED
    moved = np.array([pose.translation for pose in placements(problem, planned.path)]) - start
    off = moved[:, [0, 2]] if "line" in path else moved[:, [2]]
    assert np.abs(off).max() < 1e-3
    assert np.linalg.norm(moved[-1] - offset) < 1e-4
    again = scene_of(problem.document(), mechanism=arm).path_constraints
    ((key, direction),) = path.items()
    assert getattr(again, key) == pytest.approx(np.array(direction) / np.linalg.norm(direction))


# --- attached objects -------------------------------------------------------------------------------------------------
# Objects that a robot holds: their clearance, by coal and Pinocchio alone, and their scenes.


SIDES, ALONG = [0.04, 0.04, 0.3], [0.0, 0.0, 0.2]
BAR = {"name": "bar", "kind": "box", "size": SIDES, "point": ALONG}
WALL = {"name": "wall", "kind": "box", "size": [0.5, 0.04, 0.45], "point": [0.55, 0.0, 0.225]}


def carrying(arm, *attached, goal=None, obstacles=(), **more):
    values = {"goal": goal or {"point": [0.5, 0.3, 0.5]}, "obstacle": list(obstacles), "attached": list(attached)}
    return scene_of(values | more, mechanism=arm)


def held_to_wall(arm, q):
    """The distance of the bar from the wall, m."""
    pose = arm.placement(q, arm.end) * at(*ALONG)
    return apart(coal.Box(*SIDES), pose, coal.Box(*WALL["size"]), at(*WALL["point"]))


def test_a_held_object_that_stands_on_a_table_is_lifted_if_they_may_touch(arm):
    """The lower end of the bar is 1 mm inside of the board under it, which the arm itself may not touch."""
    under = start_pose(arm) * at(0.0, 0.0, 0.359)
    board = {"name": "board", "kind": "box", "size": [0.05, 0.05, 0.02], "point": under.translation.tolist()}
    board["rpy"] = pin.rpy.matrixToRpy(under.rotation).tolist()
    goal, start = {"joints": {"joint1": 0.2}}, {"joints": START}
    asked = {"goal": goal, "obstacles": [board, WALL], "start": start, "safety": 0.005}
    refused = plan(carrying(arm, BAR, **asked))
    assert refused.status is PlanStatus.START_IN_COLLISION
    assert "if they may touch, add 'board' to touches of 'bar'" in refused.reason
    allowed = carrying(arm, BAR | {"touches": ["board"]}, **asked)
    planned = plan(allowed, seconds=60.0)
    assert planned
    assert min(held_to_wall(arm, q) for q in along(arm, planned.path, 0.02)) >= 0.005 - 1e-6
    names = {frozenset(clearance_of(allowed).names(pair)) for pair in clearance_of(allowed).every_pair}
    assert frozenset(("bar", "board")) not in names
    assert {frozenset(("bar", "wall")), frozenset((arm.end, "wall"))} & names
    assert any("board" in pair for pair in names)
    assert json.loads(json.dumps(allowed.document()))["attached"][0]["touches"] == ["board"]


def test_a_held_object_is_as_far_from_a_wall_as_coal_measures(arm):
    clearance = clearance_of(carrying(arm, BAR, obstacles=[WALL]), is_exact=True)
    names = [clearance.names(pair) for pair in clearance.every_pair]
    pair, rng = names.index(("bar", "wall")), np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(arm.model.lowerPositionLimit, arm.model.upperPositionLimit)
        truth = held_to_wall(arm, q)
        distance = clearance.distances(q)[pair]
        assert distance == pytest.approx(truth, abs=1e-5) if truth > 0.0 else distance <= 1e-9


def test_what_is_attached_is_written_and_read_again(arm):
    ball = {"name": "ball", "kind": "sphere", "radius": 0.05, "node": arm.nodes[-2], "touches": [arm.end]}
    before = carrying(arm, BAR, ball, {"kind": "sphere", "radius": 0.01, "point": [0, 0, 1]})
    after = scene_of(json.loads(json.dumps(before.document())), mechanism=arm)
    assert after.document() == before.document()
    assert [held.name for held in after.attached] == ["bar", "ball", "attached 3"]
    assert [held.node for held in after.attached] == [arm.end, arm.nodes[-2], arm.end]
    assert clearance_of(after).least(arm.q_home) == clearance_of(before).least(arm.q_home)


def test_a_held_object_collides_with_other_links_except_those_that_touch_it(arm):
    rod = BAR | {"size": [0.02, 0.02, 1.0], "point": [0, 0, 0]}  # through the links behind the hand
    refused = plan(carrying(arm, rod))
    assert refused.status is PlanStatus.START_IN_COLLISION
    assert "touches of 'bar'" in refused.reason
    assert MeshCheck(carrying(arm, rod)).contact(arm.q_home).count("bar") == 1
    free = carrying(arm, rod | {"touches": list(arm.nodes)})
    assert not MeshCheck(free).contact(arm.q_home)
    assert clearance_of(free).least(arm.q_home) >= clearance_of(carrying(arm)).least(arm.q_home) - 1e-9


# --- kept tasks -------------------------------------------------------------------------------------------------------
# Plans that keep tasks of any kind, and ranges, all along the path.


CONE = np.radians(10.0)


def turned(pose: pin.SE3, angle: float) -> pin.SE3:
    """A pose that is rotated about the world's z axis, as a tool is that goes round the robot."""
    return pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3)) * pose


def errors(mechanism, task, path):
    """The largest error on a path, and half way between its configurations."""
    between = [mechanism.interpolate(*ends, 0.5) for ends in pairwise(path)]
    return [max(np.linalg.norm(task.error(State(mechanism, q, 1.0))) for q in some) for some in (path, between)]


def test_a_tool_that_goes_round_a_box_stays_within_a_cone(robot):
    arm = robot("arm7")
    home = arm.placement(arm.q_home, "tool")
    box = {"name": "box", "kind": "box", "size": [0.25, 0.25, 0.4], "point": turned(home, 0.6).translation.tolist()}
    task, largest = AxisAlong("tool", (0.0, 0.0, 1.0), home.rotation.T[:, 2]), []
    for tasks in ([Range(task, radius=CONE)], []):
        planned = plan(arm, turned(home, 1.2), obstacles=[box], tasks=tasks, seconds=60.0)
        assert planned.status is PlanStatus.REACHED
        largest.append(errors(arm, task, planned.path))
    assert largest[0][0] <= CONE + 1e-6
    assert largest[0][1] < CONE + 1e-3
    assert largest[1][0] > CONE  # it is no accident


def test_a_platform_stays_in_a_plane(robot):
    """Loops and a task together."""
    gough = robot("gough")
    home = gough.placement(gough.q_home, gough.end)
    task = PointInPlane(gough.end, home.translation, (0.0, 0.6, 0.8))
    goal = home * pin.SE3(pin.exp3(np.array([0.05, -0.1, 0.1])), np.zeros(3))
    goal.translation = home.translation + 0.04 * gough.length * np.array([1.0, 0.8, -0.6])
    planned = plan(gough, goal, tasks=[task])
    assert planned.status is PlanStatus.REACHED
    assert max(gough.closure(q) for q in planned.path) <= 1e-11
    along, between = errors(gough, task, planned.path)
    assert along < 1e-6
    assert between < 1e-4


def test_what_can_t_be_kept_is_refused(robot):
    arm = robot("arm7")
    goal = turned(arm.placement(arm.q_home, "tool"), 0.5)
    planned = plan(arm, goal, tasks=[AxisAlong("tool", (1.0, 0.0, 0.0))])
    assert planned.status is PlanStatus.OUT_OF_REACH
    assert "not satisfied at the start" in planned.reason
    with pytest.raises(PlanningError, match=r"error\(state\) and jacobian\(state\)"):
        plan(arm, goal, tasks=["upright"])
    with pytest.raises(PlanningError, match="constraints along a path need RRT-Connect"):
        plan(arm, goal, tasks=[AxisAlong("tool")], planner="vortex")
