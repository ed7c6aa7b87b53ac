"""One step of our solver beside pink's and placo's, where differential inverse kinematics has one answer.

Our robot is the round trip's: URDF -> RAFF -> the mechanism that `cinegen.load` makes of it.
"""

import json

import numpy as np
import pinocchio as pin
import pytest
from ask_peers import DT, FAR, KEPT, LEVELS, PROBLEMS, PYTHON, ask, scene

import cinegen
import raff2urdf

ANSWERS = json.loads(KEPT.read_text())
CASES = [(answer, peer) for answer in ANSWERS for peer in ("pink", "placo") if peer in answer]  # pink has no levels
SAME = 1e-3  # of the step: what first and second order differ by, and what a QP's regularisation costs


def ours(answer, folder):
    """The joints' values after our step, and before it, in the order of the problem."""
    problem, urdf = scene(answer["urdf"], answer["node"], answer["rotation"], answer.get("second"))
    (folder / "robot.urdf").write_bytes(urdf)
    conversion = raff2urdf.to_raff(folder / "robot.urdf", folder / "robot.raff")
    mechanism = cinegen.load(folder / "robot.raff")
    names = [joint["name"] for joint in problem["joints"]]
    begin = np.array([joint["home"] for joint in problem["joints"]])
    offsets = np.array([conversion.offsets[conversion.joints[name]] for name in names])
    indices = [mechanism.q_index(conversion.joints[name]) for name in names]
    q = np.zeros(mechanism.model.nq)
    q[indices] = begin + offsets
    solver = cinegen.Solver(mechanism, DT, q=q)
    task = solver.add_task(conversion.nodes[answer["node"]], rotation=answer["rotation"])
    task.target = pin.SE3(np.array(problem["targets"][0]))
    if "second" in problem:
        point = pin.SE3(np.eye(3), np.array(problem["second"]["target"]))
        solver.add_task(conversion.nodes[answer["second"]], point, rotation=0, priority=1)
    solver.step()
    return solver.q[indices] - offsets, begin


def test_every_problem_is_answered():
    assert [(a["urdf"], a["node"], a["rotation"]) for a in ANSWERS if "second" not in a] == list(PROBLEMS)
    assert [(a["urdf"], a["node"], a["second"]) for a in ANSWERS if "second" in a] == list(LEVELS)
    assert all("placo" in a and ("pink" in a or "second" in a) for a in ANSWERS)


@pytest.mark.parametrize(("answer", "peer"), CASES, ids=[f"{answer['urdf']}:{answer['node']}" for answer, _ in CASES])
def test_our_step_is_theirs(answer, peer, tmp_path, recwarn):
    """Of two levels the pose of a hand is exact, and its elbow comes as near to a point as that allows."""
    after, before = ours(answer, tmp_path)
    step, theirs = after - before, np.array(answer[peer]) - before
    assert 0.1 * FAR < np.linalg.norm(theirs) < 1000.0 * FAR
    assert np.linalg.norm(step - theirs) < SAME * np.linalg.norm(theirs)


@pytest.mark.skipif(not PYTHON.exists(), reason="pink and placo live in .venv-bench, which `make bench` makes")
def test_what_is_kept_is_what_they_say():
    answer = ANSWERS[0]
    problem, urdf = scene(answer["urdf"], answer["node"], answer["rotation"])
    for peer in ("pink", "placo"):
        assert np.allclose(ask(peer, problem, urdf), answer[peer], atol=1e-9)
