"""Problems of MotionBenchMaker, and the benchmark that reads and judges them."""

from __future__ import annotations

import importlib.util
import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from variants import slow

from cinegen.planning import PlanStatus, plan

FOLDER = Path(__file__).parent / "motion_bench_maker"
PROBLEMS = sorted(FOLDER.glob("*/request*.yaml"))


@pytest.fixture(scope="module")
def benchmark():
    path = Path(__file__).parents[2] / "benchmarks/motion_bench_maker.py"
    spec = importlib.util.spec_from_file_location("motion_bench_maker", path)
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(path.parent)  # benchmarks import their neighbours
        spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("problem", [PROBLEMS[0], *slow(*PROBLEMS[1:])], ids=lambda path: path.parent.name)
def test_problems_are_solved_without_contact_of_meshes(benchmark, problem):
    file = problem.with_name(problem.name.replace("request", "scene"))
    scene, judge = benchmark.read(problem, file, 1e-3), benchmark.Judge(file)
    found = plan(scene, seconds=60.0)
    assert found.status is PlanStatus.REACHED
    assert found.clearance >= scene.safety
    values = scene.mechanism.values(found.path[-1])
    assert [values[name] for name in scene.goal_joints] == pytest.approx(
        [scene.mechanism.values(scene.goal_configuration)[name] for name in scene.goal_joints], abs=1e-9
    )
    assert judge.is_free(found.path)
    straight = np.array([scene.start, scene.goal_configuration])
    assert not judge.is_free(straight)  # the judge sees contact where there is some


def test_the_judge_and_the_scene_have_the_same_obstacles(benchmark):
    file = FOLDER / "table_pick_panda/scene0001.yaml"
    scene, judge = benchmark.read(file.with_name("request0001.yaml"), file, 1e-3), benchmark.Judge(file)
    fixed = [one for one in judge._geometry.geometryObjects if one.parentJoint == 0 and "link0" not in one.name]
    bodies = list(itertools.chain.from_iterable(one.bodies for one in scene.obstacles))
    assert len(fixed) == len(bodies) > 3
    for one, body in zip(fixed, bodies, strict=True):
        assert one.placement.isApprox(body.placement, 1e-9)
        assert one.geometry.computeVolume() == pytest.approx(body.shape.computeVolume())
