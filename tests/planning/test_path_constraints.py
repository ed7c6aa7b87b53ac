"""Goals that are regions, and constraints of the node all along a path; judged by Pinocchio's placements."""

import math

import numpy as np
import pinocchio as pin
import pytest
from paths import along

import cinegen
from cinegen.collision import PlanningError, SceneError, clearance_of, scene_of
from cinegen.planning import PlanStatus, plan

START = {"joint1": -0.6, "joint2": 0.5, "joint4": -1.2, "joint6": 0.7}
POST = {"name": "post", "kind": "cylinder", "radius": 0.04, "length": 1.2, "point": [0.42, 0.0, 0.2]}


@pytest.fixture(scope="module")
def arm():
    return cinegen.load("arm7")


def scene(arm, goal, obstacles=(), **more):
    values = {"start": {"joints": START}, "goal": goal, "obstacle": list(obstacles), **more}
    return scene_of(values, mechanism=arm)


def placements(scene, path, step=0.01):
    """Poses of the node on a path, joints straight between two configurations."""
    model, found = scene.mechanism.model, []
    data, frame = model.createData(), scene.mechanism.frame_id(scene.node)
    for q in along(scene.mechanism, path, step):
        pin.framesForwardKinematics(model, data, q)
        found.append(data.oMf[frame].copy())
    return found


def here(arm):
    return arm.placement(arm.configuration(START), arm.end)


# --- regions ------------------------------------------------------------------------------------------------------


def test_a_goal_region_is_reached_at_any_of_its_points_and_orientations(arm):
    goal = {"point": [0.35, 0.35, 0.4], "tolerance": [0.05, 0.0, 0.1], "rpy": [math.pi, 0.0, 0.0], "cone": 0.3}
    given = scene(arm, goal, [POST])
    found = plan(given)
    assert found.status is PlanStatus.REACHED
    end = placements(given, found.path)[-1]
    beyond = np.abs(end.translation - goal["point"]) - goal["tolerance"]
    assert beyond.max() < 1e-4
    assert math.acos(-end.rotation[2, 2]) < 0.3 + 1e-4
    again = scene_of(given.document(), mechanism=arm)
    assert again.tolerance.tolist() == goal["tolerance"]
    assert again.cone == pytest.approx(0.3)


# --- constraints along the path -----------------------------------------------------------------------------------


def test_an_upright_node_only_rotates_about_the_vertical_around_a_post(arm):
    start = here(arm).rotation
    goal = here(arm).translation * [1.0, -1.0, 1.0]
    free, upright = (scene(arm, {"point": goal.tolist()}, [POST], path={"upright": flag}) for flag in (False, True))
    tilts = []
    for given in (free, upright):
        found = plan(given, seconds=60.0)
        assert found.status is PlanStatus.REACHED
        assert found.clearance >= given.safety
        assert np.linalg.norm(found.trace[-1] - goal) < 1e-4
        turns = [one.rotation @ start.T for one in placements(given, found.path)]
        tilts.append(max(math.atan2(math.hypot(turn[0, 2], turn[1, 2]), turn[2, 2]) for turn in turns))
    assert tilts[0] > 0.05  # without the constraint the node tilts
    assert tilts[1] < 2e-3
    clearance = clearance_of(upright)
    assert min(clearance.least(q) for q in found.path) >= upright.safety


@pytest.mark.parametrize(
    ("path", "offset"),
    [({"line": [0.0, 1.0, 0.0]}, [0.0, 0.3, 0.0]), ({"plane": [0.0, 0.0, 2.0]}, [-0.1, 0.35, 0.0])],
    ids=["line", "plane"],
)
def test_a_node_stays_on_a_line_and_in_a_plane(arm, path, offset):
    start = here(arm).translation
    given = scene(arm, {"point": (start + offset).tolist()}, path=path)
    found = plan(given, seconds=60.0)
    assert found.status is PlanStatus.REACHED
    moved = np.array([one.translation for one in placements(given, found.path)]) - start
    off = moved[:, [0, 2]] if "line" in path else moved[:, [2]]
    assert np.abs(off).max() < 1e-3
    assert np.linalg.norm(moved[-1] - offset) < 1e-4
    again = scene_of(given.document(), mechanism=arm).path_constraints
    ((key, direction),) = path.items()
    assert getattr(again, key) == pytest.approx(np.array(direction) / np.linalg.norm(direction))


def test_fields_refuse_constraints_along_a_path(arm):
    with pytest.raises(PlanningError, match="need RRT-Connect"):
        plan(scene(arm, {"point": [0.4, 0.3, 0.4]}, path={"upright": True}), planner="vortex")


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"path": {"line": [0, 0, 1], "plane": [0, 0, 1]}}, "cannot be combined"),
        ({"path": {"lien": [0, 0, 1]}}, "did you mean 'line'"),
        ({"goal": {"point": [0.4, 0, 0.4], "tolerance": [0.1, -0.1, 0]}}, "tolerance must not be below 0"),
        ({"goal": {"point": [0.4, 0, 0.4], "cone": 0.1}}, "cone needs rpy"),
        ({"goal": {"point": [0.4, 0, 0.4], "rpy": [0, 0, 0], "cone": 4.0}}, "0 to 180 deg"),
    ],
)
def test_what_makes_no_sense_is_refused(arm, values, reason):
    with pytest.raises(SceneError, match=reason):
        scene_of({"goal": {"point": [0.4, 0.3, 0.4]}, **values}, mechanism=arm)
