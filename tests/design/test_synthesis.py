"""Synthesis against published and elementary optima, and differences of independent evaluations."""

from __future__ import annotations

import json

import numpy as np
import pytest
from orthoglide import orthoglide

import cinegen
from cinegen.design import DesignError, Parameters, load_task, synthesize
from cinegen.design.synthesis import SynthesisProblem, task_of

FIVE_BAR = {
    "parameters": {"link2.d": "150..500mm", "link5.d": "200..600mm"},
    "ties": ["link2.d = link4.d", "link5.d = tool.d"],
    "reach": {"x": "-150..150mm", "y": "300..500mm"},
    "objective": [{"minimise": "condition"}],
    "constraints": {"joint_limits": False},
    "starts": 2,
}


def changed(**values: object) -> dict[str, object]:
    return {**FIVE_BAR, **values}


@pytest.fixture(scope="module")
def best_orthoglide(tmp_path_factory):
    path = tmp_path_factory.mktemp("glide") / "orthoglide.raff"
    path.write_text(orthoglide(), encoding="utf-8")
    return synthesize(path, ORTHOGLIDE)


ORTHOGLIDE = {
    "parameters": {"link4.d": "250..800mm", "frame20.d": "-100..100mm"},
    "ties": ["link4.d = link9.d = link15.d", "frame20.r = -1*frame20.d", "frame20.d = frame20.epsilon"],
    "reach": dict.fromkeys("xyz", "-100..100mm"),
    "objective": [{"minimise": "size", "of": ["link4.d"]}],
    "constraints": {"singular_values": "0.5..2"},
    "starts": 1,
}


def test_orthoglide(best_orthoglide):
    found = best_orthoglide
    # along the diagonal the amplification is 1 / (1 + 2 f) and 1 / (1 - f), f = t / sqrt(L^2 - 2 t^2)
    t = np.array([1.0 / np.sqrt(6.0), -np.sqrt(2.0) / 6.0])
    length = 0.2 / (t[0] - t[1])
    assert length / 0.2 == pytest.approx(1.552914, abs=1e-6)
    np.testing.assert_allclose(found.p[0], length, rtol=1e-6)
    np.testing.assert_allclose(abs(found.p[1]), length * t.sum() / 2.0, rtol=1e-5)
    assert found.check.reached == found.check.points == 512
    assert 0.5 <= found.check.sigma[0] < found.check.sigma[1] <= 2.0


def test_amplification_of_the_orthoglide_by_its_equations(best_orthoglide, tmp_path):
    path = tmp_path / "best.raff"
    path.write_text(best_orthoglide.raff, encoding="utf-8")
    length, offset = (Parameters(path, [name]).values[0] for name in ("link4.d", "frame20.d"))
    corners = np.array(np.meshgrid(*[[-0.1, 0.1]] * 3)).reshape(3, -1).T
    found = []
    for corner in corners + offset:  # of the platform from where bars are along the slides
        rows = np.diag(np.sqrt(length**2 - (corner @ corner - corner**2)))
        rows = np.where(np.eye(3) > 0, -rows, corner)
        found.append(1.0 / np.linalg.svd(rows / np.diag(rows)[:, None], compute_uv=False))
    assert np.min(found) == pytest.approx(0.5, abs=1e-6)
    assert np.max(found) == pytest.approx(2.0, abs=1e-5)


@pytest.mark.parametrize("robot", ["five_bar", "delta4"])
def test_derivatives_at_wanted_poses(robot):
    values = changed() if robot == "five_bar" else {
        "parameters": {"link2.d": "1..3m", "link4.d": "2.5..4.5m"},
        "ties": ["link2.d = link7.d = link13.d", "link4.d = link9.d = link15.d"],
        "reach": {"x": "-0.3..0.3", "y": "-0.3..0.3", "z": "-2.4..-1.9"},
        "objective": [{"maximise": "sigma_1"}],
    }  # fmt: skip
    problem = SynthesisProblem(robot, task_of({**values, "constraints": {"joint_limits": True}}))
    p = problem.parameters.values
    here = problem.at(p)
    assert here.reached.is_reached.all()
    for k in range(len(p)):
        step = 1e-5 * np.eye(len(p))[k]
        ahead, behind = problem.at(p + step), problem.at(p - step)
        for name, slopes in (("sigma", here.by_p), ("margins", here.margins_by_p)):
            numeric = (getattr(ahead, name) - getattr(behind, name)) / 2e-5
            np.testing.assert_allclose(slopes[..., k], numeric, atol=1e-6 * max(1.0, np.abs(numeric).max()))


def test_condition_of_a_five_bar_is_that_of_the_loaded_robot(tmp_path):
    found = synthesize("five_bar", FIVE_BAR)
    assert found.values[0] < 0.9 * found.before[0]
    path = tmp_path / "best.raff"
    path.write_text(found.raff, encoding="utf-8")
    robot = cinegen.load(path)
    targets = np.array([[x, y] for x in (-0.15, 0.0, 0.15) for y in (0.3, 0.4, 0.5)])
    q, worst = robot.q_home, []
    for target in targets:
        actuated = [robot.v_index(name) for name in robot.actuated]
        begin = robot.placement(q, "tool").translation[:2]
        for part in np.linspace(0.0, 1.0, 60):
            for _ in range(4):
                missing = begin + part * (target - begin) - robot.placement(q, "tool").translation[:2]
                loops, node = robot.loop_jacobian(q), robot.jacobian(q, "tool")
                rotation = robot.placement(q, "tool").rotation
                rows = np.vstack([loops, (rotation @ node[:3])[:2]])
                q = robot.close(robot.integrate(q, np.linalg.pinv(rows) @ np.append(np.zeros(len(loops)), missing)))
        follow = np.zeros((robot.model.nv, 2))
        follow[actuated] = np.eye(2)
        passive = np.setdiff1d(np.arange(robot.model.nv), actuated)
        follow[passive] = -np.linalg.pinv(loops[:, passive], rcond=1e-9) @ loops[:, actuated]
        worst.append(np.linalg.cond((node[:3] @ follow)[:2]))
        assert np.abs(missing).max() < 1e-9
    assert max(worst) <= found.values[0] * (1.0 + 1e-5)
    assert found.check.condition <= found.values[0] * (1.0 + 1e-3)


def test_state_continues(tmp_path):
    state = tmp_path / "state.json"
    first = synthesize("five_bar", FIVE_BAR, state=state)
    values = json.loads(state.read_text(encoding="utf-8"))
    values["starts"] = values["starts"][:1]
    state.write_text(json.dumps(values), encoding="utf-8")
    told: list[int] = []
    again = synthesize("five_bar", FIVE_BAR, state=state, report=lambda text, done, total: told.append(done))
    assert told == [1]
    np.testing.assert_array_equal(first.p, again.p)
    with pytest.raises(DesignError, match="belongs to another task"):
        synthesize("five_bar", changed(starts=3), state=state)


def test_front():
    values = changed(objective=[{"minimise": "condition"}, {"minimise": "size", "of": ["link*.d"]}], front=5, starts=1)
    found = synthesize("five_bar", values)
    front = np.array([one for one, _ in found.front])
    assert len(front) >= 4
    order = np.argsort(front[:, 0])
    assert (np.diff(front[order, 1]) < 0.0).all()  # better in one only by being worse in the other


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (changed(reach={"x": "-150..150mm", "y": "3..5m"}), r"y [35]000 mm is still [\d.e+]+ mm away"),
        (changed(reach={"x": "-150..150mm"}), "which is 1 coordinates, but 2 actuated joints move it"),
        (changed(parameters={"link2.d": "150..500mm", "base.d": "-1..1m", "link1.theta": "0..200deg"}), "link1.theta"),
        (changed(parameters={"link2.d": "150..500mm", "link5.theta": "-170..-10deg"}), "is the variable of joint5"),
        (changed(parameters={"link2.alpha": "-5..5deg"}, ties=[]), "link2.alpha: a change opens the loops"),
        (changed(parameters={"link2.d": "150..500mm", "link5.r": "-1..1mm"}, ties=[]), "link5.r"),
        (changed(ties=["link2.d = link4.d", "link4.d = 2*link2.d"]), "link"),
        (changed(objectiv=[]), "unknown key 'objectiv': did you mean 'objective'"),
        (changed(objective=[{"minimise": "conditon"}]), "did you mean 'condition'"),
        (changed(objective=[{"maximise": "condition"}]), "better the other way: write minimise"),
        (changed(constraints={"singular_values": "0..2"}), "must begin above 0"),
        (changed(parameters={"link2.d": "300..500mm"}), "outside its bounds"),
    ],
)  # fmt: skip
def test_bad_tasks(values, message):
    with pytest.raises(DesignError, match=message):
        synthesize("five_bar", values)


def test_task_file(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text('starts = 1\n[parameters]\n"link2.d" = "1..2m"\n[reach]\nx = 0.5\ny = "1..2m"\n[[objective]]\n'
                    'maximise = "sigma_1"\nover = "mean"\n', encoding="utf-8")  # fmt: skip
    task = load_task(path)
    assert task.reach.axes == ("x", "y")
    assert task.reach.low.tolist() == [0.5, 1.0]
    assert len(task.reach.grid(3)) == 3
    path.write_text("x = = 2", encoding="utf-8")
    with pytest.raises(DesignError, match=r"task.toml: invalid TOML"):
        load_task(path)
