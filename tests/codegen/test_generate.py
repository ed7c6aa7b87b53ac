"""Generated C and JavaScript, compiled and run: what they compute is what Python computes."""

import json
import re

import numpy as np
import pytest
from generated_code import CHECKED, NODE, compiled, largest, needs_gcc, needs_node, run, run_script, written
from hostile_names import KEYS, urdf
from small_robots import rssr
from variants import slow

import cinegen
from cinegen.codegen import Function, GenerationError, Language, generate
from cinegen.codegen.heap import Heap
from cinegen.codegen.kernels import RobotMemory
from cinegen.codegen.translation import KernelTranslation
from cinegen.codegen.values import Memories, Number, TranslationError
from cinegen.model import ForwardKinematics


@needs_gcc
@pytest.mark.parametrize("name", ["delta4", *slow("arm7", "hybrid", "differential_wrist")])
def test_c_agrees_with_python(robot, tmp_path, name):
    written(tmp_path, robot(name), Language.C)
    said = run(tmp_path, compiled(tmp_path, *CHECKED))
    assert largest(said) < 1e-12
    assert said.count("\n") == 5


@needs_node
@pytest.mark.parametrize("name", ["scara", *slow("gough", "sr400")])
def test_javascript_agrees_with_python(robot, tmp_path, name):
    written(tmp_path, robot(name), Language.JAVASCRIPT)
    assert largest(run(tmp_path, NODE, "robot_test.mjs")) < 1e-12


RANDOM = """
import create from "./robot.mjs";
import { readFileSync } from "node:fs";
const robot = create();
console.log(JSON.stringify(JSON.parse(readFileSync("values.json", "utf8")).map((values) => {
  const reached = robot.forward(values);
  return [reached, [...robot.q], [...robot.place()], [...robot.sigma()]];
})));
"""


@needs_node
@pytest.mark.parametrize(("name", "count"), [("delta4", 200), *slow(("hybrid", 2000))])
def test_frames_and_singular_values_at_random_configurations(robot, tmp_path, name, count):
    """Judged by Pinocchio's placements, and by the singular values of Python's evaluation."""
    mechanism, rng = robot(name), np.random.default_rng(1)
    written(tmp_path, mechanism, Language.JAVASCRIPT, functions=[Function.FORWARD, Function.SIGMA])
    home = np.array([mechanism.q_home[mechanism.q_index(joint)] for joint in mechanism.actuated])
    sizes = np.array([mechanism.scale[mechanism.v_index(joint)] for joint in mechanism.actuated])
    samples = home + 0.2 * sizes * rng.uniform(-1.0, 1.0, (count, len(home)))
    (tmp_path / "values.json").write_text(json.dumps(samples.tolist()))
    computed = json.loads(run_script(tmp_path, RANDOM))
    wanted, motion, unreached = cinegen.evaluate(mechanism, mechanism.end, samples), ForwardKinematics(mechanism), 0
    compared = 0
    for i, (reached, q, frames, sigma) in enumerate(computed):
        assert mechanism.closure(np.array(q)) < 1e-12
        values = dict(zip(mechanism.actuated, samples[i].tolist(), strict=True))
        if not reached:
            unreached += 1
            with pytest.raises(cinegen.ClosureError):
                motion.move(values)
            continue
        moved = motion.move(values)
        assert q == pytest.approx(moved, abs=1e-12)
        if np.allclose(wanted.q[i], moved, rtol=0.0, atol=1e-8):  # it closes loops to 1e-9, and goes on otherwise later
            compared += 1
            assert sigma == pytest.approx(wanted.singular_values[i][: len(sigma)], abs=1e-7)
        for frame, node in zip(np.reshape(frames, (-1, 4, 3)), mechanism.nodes, strict=True):
            placement = mechanism.placement(np.array(q), node)
            assert pytest.approx(placement.rotation, abs=1e-12) == frame[:3].T
            assert frame[3] == pytest.approx(placement.translation, abs=1e-12)
    assert unreached < 0.5 * count
    assert compared > 0.2 * count


ROVER = """
RAFF Rover
robot rover {
  base { }
  link 1 { parameters { d 200 alpha 90 } type 2 pred 0 }
  frame 2 { name "gripper" parameters { d 300 } pred 1 }
  constraint { base sensor ( 0 1 ) }
  constraint { frame 2 sensor ( 0 1 ) }
}
sensor 1 { port "/dev/ttyS0" }
"""
NUMBERS = {
    "rssr": ["joint1", "joint2.x", "joint2.y", "joint2.z", "joint2.w", "joint3"],
    "rover": ["base.x", "base.y", "base.z", "base.qx", "base.qy", "base.qz", "base.qw", "joint1"],
}  # fmt: skip


@needs_gcc
@needs_node
@pytest.mark.parametrize(
    ("text", "name", "language"),
    [(ROVER, "rover", Language.JAVASCRIPT), *slow((ROVER, "rover", Language.C), (rssr(), "rssr", Language.JAVASCRIPT))],
)
def test_ball_joints_and_floating_bases(tmp_path, text, name, language):
    """The rod of an RSSR rotates about itself, which no actuated joint determines: that must agree, too."""
    mechanism = cinegen.load(text)
    written(tmp_path, mechanism, language, functions=[Function.FORWARD, Function.TICK])
    command = [compiled(tmp_path, *CHECKED)] if language is Language.C else [NODE, "robot_test.mjs"]
    assert largest(run(tmp_path, *command)) < 1e-12
    if language is Language.C:
        return
    names = re.search(r"names = (.*);", (tmp_path / "robot.mjs").read_text())[1]
    assert json.loads(names)["q"] == NUMBERS[name]


CAM = """
RAFF Cam
units mm
robot cam {
  link 1 { parameters { theta 20 r 50 } type 2 pred 0 limits { -150 150 } }
  link 2 { parameters { gamma 90 epsilon 60 alpha 90 r 100 } type 1 pred 0 limits { 20 220 } }
  link 3 { parameters { alpha -90 d 70 theta 3 } type 2 pred 2 }
  frame 4 { parameters { d 80 r -10 } pred 3 }
  coupling { link 2 link 1 polynomial ( 0.4 0.003 -0.00002 ) offset 90.96 }
  coupling { link 3 link 2 polynomial ( 0.3 -0.001 ) offset -17 }
}
"""


@needs_node
def test_rounding_may_change_the_number_of_iterations(tmp_path):
    """Of a robot with one degree of freedom, whose task has six rows: it ends in the same configuration."""
    written(tmp_path, cinegen.load(CAM), Language.JAVASCRIPT, functions=[Function.IK])
    assert largest(run(tmp_path, NODE, "robot_test.mjs")) < 1e-9


INVALID = """
import create from "./robot.mjs";
const robot = create(), before = [...robot.q];
const found = [NaN, Infinity, 1e9].map((value) => robot.forward(robot.q.slice().fill(value).subarray(0, COUNT)));
found.push(robot.q.every((value, k) => value === before[k]));
found.push(robot.close(robot.q.slice().fill(NaN)));
for (const call of [robot.forward, robot.close, robot.set]) {
  try {
    call([...robot.q, 0]);
  } catch (error) {
    found.push(error.message);
  }
}
console.log(JSON.stringify(found));
"""


@needs_node
def test_values_that_are_not_finite_or_far_away_or_too_many_move_nothing(robot, tmp_path):
    mechanism = robot("delta4")
    written(tmp_path, mechanism, Language.JAVASCRIPT, functions=[Function.FORWARD, Function.CLOSE, Function.TICK])
    printed = run_script(tmp_path, INVALID.replace("COUNT", str(len(mechanism.actuated))))
    nq, actuated = len(mechanism.q_home), len(mechanism.actuated)
    refused = [f"{count} numbers are needed, not {nq + 1}" for count in (actuated, nq, nq)]
    assert json.loads(printed) == [False, False, False, True, None, *refused]  # JSON has no NaN


@needs_node
def test_several_tasks_and_positions(robot, tmp_path):
    tasks = ["tool:position", "link4:position"]
    written(tmp_path, robot("arm7"), Language.JAVASCRIPT, functions=[Function.TICK], tasks=tasks)
    assert largest(run(tmp_path, NODE, "robot_test.mjs")) < 1e-12


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"name": "7up"}, "'7up' is no name in C"),
        ({"name": "tick"}, "'tick' begins names of the kernels in C: give another one"),
        ({"tasks": ["tool:orientation"]}, "NODE:position"),
        ({"tasks": ["hand"]}, "hand"),
        ({"tasks": ["tool"] * 7}, "7 tasks: code can be generated for 6"),
        ({"dt": 0.0}, "dt"),
    ],
)
def test_what_cannot_be_generated_is_named(robot, settings, message):
    with pytest.raises(cinegen.CinegenError, match=message):
        generate(robot("arm7"), Language.C, **settings)
    with pytest.raises(GenerationError, match=r"no actuated joints, .*; --actuated JOINTS .* names some"):
        generate(cinegen.load(urdf(links=("a", "b"), joints=("c",)), actuated=[]), Language.C)
    assert issubclass(GenerationError, cinegen.CinegenError)


def test_names_are_identifiers_and_those_of_nodes_differ():
    names = ("a-b", "a_b", "a b", *KEYS)
    mechanism = cinegen.load(urdf("3r-\xfc", names, tuple(map(str, range(len(names))))))
    header = generate(mechanism, Language.C, functions=())["_3r__.h"]
    assert len(set(re.findall(r"(_3r___NODE_\w+) = \d+", header, re.ASCII))) == 1 + len(names)


def comprehends(memory):
    return [i for i in range(memory.nq)]


def reads_after_a_loop(memory):
    for i in range(memory.nq):
        memory.q[i] = 0.0
    return i


@pytest.mark.parametrize(
    ("kernel", "message"),
    [(comprehends, r"comprehends: no counterpart of '\[i for i"), (reads_after_a_loop, "'i' is read after its loop")],
)
def test_a_kernel_that_cannot_be_translated_is_named(kernel, message):
    memory = RobotMemory(nq=3)
    arguments = [Memories((memory,), Number("int", "0", value=0))]
    with pytest.raises(TranslationError, match=message):
        KernelTranslation(Language.C, Heap()).function(kernel, arguments)


def test_the_command(typed, root, tmp_path):
    made = tmp_path / "made"
    call = ["generate", str(root / "robots/four_bar.raff"), "--to", "c", "-o", str(made), "--functions", "fk"]
    assert typed(*call).out.split() == [str(made / f"four_bar{end}") for end in (".h", ".c", "_test.c")]
    assert "there is no 'jump'; use fk, close, tick, sigma, ik" in typed(*call[:-1], "fk,jump", code=2).err


# --- steps of a delta -------------------------------------------------------------------------------------------------
# The steps of example 27 beside a delta's closed form: each actuator's angle is a two-link arm's in its plane.


UPPER, LOWER, OUT, IN = 2.0, 3.5, 1.5, 0.50654  # m: arms; shoulder and the platform's joint from their centres
HEIGHT = -LOWER * np.sin(np.radians(31.21))
STEPS = 16000 / np.pi  # per radian


@needs_gcc
def test_every_step_is_made_where_the_actuator_is(robot, root, tmp_path):
    text = (root / "examples/27_steps_of_a_delta.py").read_text()
    planner = re.search(r'PLANNER = r"""(.*?)"""', text, re.DOTALL)[1]
    files = generate(robot("delta4"), Language.C, functions=[Function.TICK], dt=1e-3, name="delta4")
    for name, content in {**files, "planner.c": planner}.items():
        (tmp_path / name).write_text(content)
    program = compiled(tmp_path, "-O2", "-Wno-error", files=["delta4.c", "planner.c"])
    steps = np.loadtxt(run(tmp_path, program).splitlines())
    times = np.linspace(0.0, 1.0, 20_001)
    along = 0.6 * (times - np.sin(2 * np.pi * times) / (2 * np.pi))
    for i in range(3):
        place = along * np.exp(-2j * np.pi * i / 3)  # of the platform, in the arm's axes
        a = place.real + IN - OUT
        cosine = (a**2 + place.imag**2 + HEIGHT**2 + UPPER**2 - LOWER**2) / (2.0 * UPPER * np.hypot(a, HEIGHT))
        exact = STEPS * (np.arctan2(HEIGHT, a) + np.arccos(cosine))
        _, directions, due = steps[steps[:, 0] == i].T
        made = np.concatenate([[0.0], directions.cumsum()])[np.searchsorted(due, times)]
        assert np.abs(made - exact).max() < 0.55
        assert len(directions) > 1000
