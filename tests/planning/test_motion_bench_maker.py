"""Problems in the format of MotionBenchMaker, a bookshelf, and the benchmark that reads and judges them."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
import yaml
from lxml import etree
from repository import module_of

from cinegen.planning import PlanStatus, plan

READY = (0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785)
TURNED = pin.Quaternion(pin.utils.rotate("z", 0.9)).coeffs().tolist()
UPRIGHT = [0.0, 0.0, 0.0, 1.0]
BOOKSHELF = [  # shape, its dimensions, position and orientation: boards above and below the hand, and a can
    *(("box", [0.4, 0.6, 0.02], [0.46, 0.58, height], TURNED) for height in (0.55, 0.85)),
    ("box", [0.02, 0.6, 0.32], [0.59, 0.74, 0.7], TURNED),
    ("cylinder", [0.2, 0.04], [0.55, 0.3, 0.66], UPRIGHT),
]
GOAL = 0.9, 0.0, 0.0, -1.9, 0.0, 3.47, 0.785


@pytest.fixture(scope="module")
def benchmark(root):
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(root / "benchmarks")  # benchmarks import their neighbours
        return module_of("benchmarks/motion_bench_maker.py")


@pytest.fixture
def files(benchmark, tmp_path):
    """A request and its scene, as MoveIt writes them; links may touch as the SRDF of the panda allows."""
    names = [f"panda_joint{i}" for i in range(1, 8)]
    state = {"name": [*names, "panda_finger_joint1", "panda_finger_joint2"], "position": [*READY, 0.065, 0.065]}
    constraints = [{"joint_name": name, "position": value} for name, value in zip(names, GOAL, strict=True)]
    asked = {"start_state": {"joint_state": state}, "goal_constraints": [{"joint_constraints": constraints}]}
    srdf = etree.parse(benchmark.DESCRIPTION / "srdf/panda.srdf")
    allowed = {frozenset((entry.get("link1"), entry.get("link2"))) for entry in srdf.iter("disable_collisions")}
    links = sorted(set().union(*allowed))
    things = [
        {
            "id": f"thing{i}",
            "primitives": [{"type": kind, "dimensions": size}],
            "primitive_poses": [{"position": position, "orientation": orientation}],
        }
        for i, (kind, size, position, orientation) in enumerate(BOOKSHELF)
    ]
    values = [[frozenset((link, other)) in allowed for other in links] for link in links]
    matrix = {"entry_names": links, "entry_values": values}
    world = {"allowed_collision_matrix": matrix, "world": {"collision_objects": things}}
    paths = tmp_path / "request0001.yaml", tmp_path / "scene0001.yaml"
    for path, content in zip(paths, (asked, world), strict=True):
        path.write_text(yaml.safe_dump(content))
    return paths


def test_problems_are_solved_without_contact_of_meshes(benchmark, files):
    scene, judge = benchmark.read(*files, 1e-3), benchmark.Judge(files[1])
    fixed = [geom for geom in judge._geometry.geometryObjects if geom.parentJoint == 0 and "link0" not in geom.name]
    bodies = list(itertools.chain.from_iterable(obstacle.bodies for obstacle in scene.obstacles))
    for geom, body in zip(fixed, bodies, strict=True):
        assert geom.placement.isApprox(body.placement, 1e-9)
        assert geom.geometry.computeVolume() == pytest.approx(body.shape.computeVolume())
    planned = plan(scene, seconds=60.0)
    assert planned.status is PlanStatus.REACHED
    assert planned.clearance >= scene.safety
    end, goal = (scene.mechanism.values(q) for q in (planned.path[-1], scene.goal_configuration))
    off = [end[name] - goal[name] for name in scene.goal_joints]
    assert off == pytest.approx([0.0] * len(off), abs=1e-9)
    assert judge.is_free(planned.path)
    straight = np.array([scene.start, scene.goal_configuration])
    assert not judge.is_free(straight)  # the judge sees contact where there is some
