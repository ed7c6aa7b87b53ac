"""Inverse kinematics of generated code, beside the same search in Python; Pinocchio judges what it finds."""

import json

import numpy as np
import pytest
from generated_code import needs_node, run_script, written
from variants import slow

from cinegen.codegen import Function, Language
from cinegen.codegen.inverse import ITERATIONS, TOLERANCE, InverseKinematics
from cinegen.ik import FrameTask
from cinegen.ik.local_ik import LocalIK
from cinegen.jit.foreign import frame_of
from cinegen.tolerances import AT_LIMIT

SOLVE = """
import create, { names } from "./robot.mjs";
import { readFileSync } from "node:fs";
const robot = create();
console.log(JSON.stringify(JSON.parse(readFileSync("targets.json", "utf8")).map((target) => {
  robot.init();
  robot.targets[0].set(target);
  const status = robot.ik(TOLERANCE), values = robot.actuated();
  const by = Object.fromEntries(names.actuated.map((name, k) => [name, values[k]]));
  return [status, robot.ikIterations(), [...robot.q], by];
})));
""".replace("TOLERANCE", repr(TOLERANCE))

pytestmark = needs_node


def solved(folder, mechanism, targets, task):
    written(folder, mechanism, Language.JAVASCRIPT, functions=[Function.IK], tasks=[task])
    (folder / "targets.json").write_text(json.dumps([frame_of(target).ravel().tolist() for target in targets]))
    return json.loads(run_script(folder, SOLVE))


@pytest.mark.parametrize(
    ("name", "kind", "count"),
    [
        ("delta4", "position", 100),
        *slow(("arm7", "pose", 300), ("hybrid", "pose", 300)),
    ],
)  # fmt: skip
def test_poses_that_configurations_have_are_found(robot, tmp_path, name, kind, count):
    mechanism, rng = robot(name), np.random.default_rng(5)
    task = FrameTask(mechanism.end, mechanism.placement(mechanism.q_home, mechanism.end), rotation=3)
    if kind == "position":
        task = FrameTask(mechanism.end, task.target, rotation=0)
    targets = [mechanism.placement(q, mechanism.end) for q in LocalIK(mechanism).samples(count, rng)]
    python, successes, direct, apart = InverseKinematics(mechanism, [task]), 0, 0, list[float]()
    for target, (status, iterations, q, actuated) in zip(
        targets, solved(tmp_path, mechanism, targets, f"{mechanism.end}:{kind}"), strict=True
    ):
        solution, wanted = np.array(q), python.find([target], mechanism.q_home, TOLERANCE)
        assert (status == "FOUND") == (wanted[0] is not None)
        assert mechanism.closure(solution) < 1e-10
        assert actuated == {joint: q[mechanism.q_index(joint)] for joint in mechanism.actuated}
        if status != "FOUND":
            assert solution == pytest.approx(mechanism.q_home, abs=0.0)
            continue
        successes += 1
        reached = mechanism.placement(solution, mechanism.end)
        assert np.linalg.norm(reached.translation - target.translation) <= TOLERANCE
        if kind == "pose":
            assert np.abs(reached.rotation - target.rotation).max() <= TOLERANCE
        assert (solution >= mechanism.limits.lower - AT_LIMIT).all()
        assert (solution <= mechanism.limits.upper + AT_LIMIT).all()
        if wanted[1] <= ITERATIONS:
            direct += 1
        if iterations == wanted[1]:
            apart.append(np.abs(solution - wanted[0]).max())
    assert successes >= 0.97 * count
    # From start to start a search may branch by rounding; and at singularities, or for a robot with more DoF than the
    # task, rounding moves the configuration where the target does not.
    assert len(apart) >= 0.97 * direct
    assert direct > 0.5 * count
    assert np.quantile(apart, 0.95) < 1e-12
    assert max(apart) < 1e-9


def test_targets_that_cannot_be_reached_move_nothing(robot, tmp_path):
    written(tmp_path, robot("delta4"), Language.JAVASCRIPT, functions=[Function.IK, Function.TICK])
    script = """
import create from "./robot.mjs";
const robot = create();
robot.targets[0][9] += 0.05;
const found = [robot.ik()], before = [...robot.q];
robot.targets[0][9] = NaN;
found.push(robot.ik());
robot.targets[0][9] = 1e6;
found.push(robot.ik(), robot.q.every((value, k) => value === before[k]), robot.ikIterations() <= 9 * 61);
robot.init();
robot.targets[0][9] += 0.05;
for (let i = 0; i < 1000; i += 1) robot.tick();
console.log(JSON.stringify([...found, Math.max(...before.map((value, k) => Math.abs(value - robot.q[k])))]));
"""
    *answers, apart = json.loads(run_script(tmp_path, script))
    assert answers == ["FOUND", "BAD_TARGET", "NOT_FOUND", True, True]
    assert apart < 1e-9  # ticks towards the same target end in the same configuration
