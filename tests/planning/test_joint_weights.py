"""Weights of joints in the length of paths."""

import numpy as np
import pytest

import cinegen
from cinegen.collision import PlanningError, SceneError, scene_of
from cinegen.planning import plan


@pytest.fixture(scope="module")
def arm():
    return cinegen.load("arm7")


def scene(arm, **more):
    values = {"start": {"joints": {"joint1": -0.6, "joint2": 0.9}}, "goal": {"point": [0.5, 0.35, 0.3]}}
    return scene_of(values | more, mechanism=arm)


@pytest.mark.parametrize("planner", ["auto", "rrtconnect"])
def test_a_heavy_joint_moves_less(planner):
    robot, moved = cinegen.load("planar_3r"), []
    for weights in ({"joint1": 50.0}, {"joint3": 50.0}):
        values = {"goal": {"point": [0.3, 0.35]}, "start": {"joints": {"joint2": 0.9}}, "weights": weights}
        found = plan(scene_of(values, mechanism=robot), planner=planner, seconds=20.0)
        assert found
        steps = np.diff(found.path, axis=0)
        moved.append(np.abs(steps).sum(axis=0))
        factors = np.array([weights.get(name, 1.0) for name in robot.joints])
        assert found.weighted_motion == pytest.approx(np.linalg.norm(steps * factors, axis=1).sum())
        assert found.motion == pytest.approx(np.linalg.norm(steps, axis=1).sum())
    assert moved[0][0] < moved[1][0]
    assert moved[1][2] < moved[0][2]


def test_fields_refuse_weights_and_are_left_out_without_being_asked(arm):
    wall = {"kind": "box", "size": [0.7, 0.04, 0.45], "point": [0.55, 0.0, 0.225]}
    heavy = scene(arm, weights={"joint1": 5.0}, obstacle=[wall], start={"joints": {"joint1": -0.6}})
    with pytest.raises(PlanningError, match="weights of joints need RRT-Connect, not a field"):
        plan(heavy, planner="vortex")
    strategies = {one.strategy for one in plan(heavy, seconds=20.0).attempts}
    assert strategies <= {"RRT-Connect", "LBKPIECE", "all joints straight to the goal"}
    plan(scene(arm, weights={"joint1": 1.0}), planner="vortex", steps=3)  # changes nothing


def test_weights_are_written_and_read_again_and_wrong_ones_reported(arm):
    made = scene(arm, weights={"joint2": 3.0})
    assert scene_of(made.document(), mechanism=arm).weights == {"joint2": 3.0}
    assert made.metric[arm.v_index("joint2")] == pytest.approx(arm.scale[arm.v_index("joint2")] / 3.0)
    for weights, message in [
        ({"elbow": 1.0}, "weights: 'elbow' is not a joint of"),
        ({"joint2": 0.0}, "weights: joint2 must be a weight from 0.01 to 100, not 0"),
        ({"joint2": "heavy"}, "joint2 must be a number"),
    ]:
        with pytest.raises(SceneError, match=message):
            scene(arm, weights=weights)
