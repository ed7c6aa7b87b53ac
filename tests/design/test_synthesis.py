"""Synthesis against published and elementary optima, and differences of independent evaluations."""

import json
import warnings
from functools import partial

import coal
import numpy as np
import pinocchio as pin
import pytest
from clearings import apart, at
from orthoglide import orthoglide
from small_robots import two_bars
from variants import slow

import cinegen
from cinegen.design import DesignError, Parameters, Tolerances, load_task, synthesize
from cinegen.design.synthesis import SynthesisProblem, search, task_of
from cinegen.dynamics import Payload, forces
from cinegen.model.plausible import ImplausibleError
from raff2urdf.errors import RaffWarning

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


NEAR = {"axes": ["x", "y"], "points": [[0.0, 0.4], [0.05, 0.42]]}


ORTHOGLIDE = {
    "parameters": {"link4.d": "250..800mm", "frame20.d": "-100..100mm"},
    "ties": ["link4.d = link9.d = link15.d", "frame20.r = -1*frame20.d", "frame20.d = frame20.epsilon"],
    "reach": dict.fromkeys("xyz", "-100..100mm"),
    "objective": [{"minimise": "size", "of": ["link4.d"]}],
    "constraints": {"singular_values": "0.5..2"},
    "starts": 1,
}


def test_orthoglide(text_file):
    best = synthesize(text_file("orthoglide.raff", orthoglide()), ORTHOGLIDE)
    # along the diagonal the amplification is 1 / (1 + 2 f) and 1 / (1 - f), f = t / sqrt(L^2 - 2 t^2)
    t = np.array([1.0 / np.sqrt(6.0), -np.sqrt(2.0) / 6.0])
    length = 0.2 / (t[0] - t[1])
    assert length / 0.2 == pytest.approx(1.552914, abs=1e-6)
    np.testing.assert_allclose(best.p[0], length, rtol=1e-6)
    np.testing.assert_allclose(abs(best.p[1]), length * t.sum() / 2.0, rtol=1e-5)
    assert best.check.reached == best.check.points == 512
    assert 0.5 <= best.check.sigma[0] < best.check.sigma[1] <= 2.0


EVERYTHING = {
    "five_bar": changed(
        reach={"x": "-50..50mm", "y": "300..500mm"},
        objective=[
            *({"minimise": name} for name in ("condition", "sigma_max", "torque", "mass", "accuracy")),
            {"minimise": "torque", "over": "mean"}, {"maximise": "sigma_1", "over": "mean"}, {"maximise": "region"},
            {"minimise": "size", "of": ["link*.d"]},
        ],
        constraints={
            "size": {"of": ["link2.d"], "most": "2m"}, "mass": "9kg", "torque": "90Nm", "accuracy": "1mm",
            "clearance": {
                "least": "5mm", "radius": "1mm",
                "obstacle": [{"from": [0.0, 0.1, 0.0], "to": [0.01, 0.1, 0.0], "radius": "9mm"}],
            },
        },
        load={"payload": "2kg", "gravity": [0, -9.81, 0]},
        tolerances={"sigma": {"link*.d": "0.05mm"}, "encoder": {"joint1": "0.01deg"}},
    ),
    "gough": {
        "parameters": {"link1.d": "0.5..1m", "base.r": "-1..1m", "link4.alpha": "40..80deg"},
        "reach": {"poses": [[0.0, 0.0, 0.9, 0, 0, 0], ["10mm", "20mm", 0.95, 5, 3, -4]]},
        "objective": [{"maximise": "sigma_1"}, {"minimise": "torque"}, {"minimise": "accuracy"}],
        "constraints": {"joint_limits": False},
        "tolerances": {"sigma": {"link*.d": "0.05mm"}},
    },
}  # fmt: skip


@pytest.mark.parametrize("robot", ["five_bar", "gough"])
def test_derivatives_of_all_quantities(robot):
    problem = SynthesisProblem(robot, task_of(EVERYTHING[robot]))
    x = problem.written + 1e-3

    def every(at: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        scores = problem.at(at)
        assert scores.reached.is_reached.all()
        constraints = problem.scoring.constraints(scores)
        return constraints | {term.text: problem.scoring.objective(term, scores) for term in problem.task.objectives}

    quantities = every(x)
    for k, name in enumerate(problem.names):
        step = 1e-5 * np.eye(len(x))[k]
        near, far = ((every(x + size * step), every(x - size * step)) for size in (1.0, 2.0))
        for what, rows in quantities.items():
            small, large = (ahead[what].values - behind[what].values for ahead, behind in (near, far))
            numeric = (8.0 * small - large) / 12e-5  # Richardson's extrapolation
            size = max(1.0, np.abs(numeric).max(initial=0.0))
            np.testing.assert_allclose(rows.slopes[..., k], numeric, atol=1e-7 * size, err_msg=f"{what} by {name}")


def test_state_continues(tmp_path):
    state = tmp_path / "state.json"
    task = changed(reach=NEAR)
    first = synthesize("five_bar", task, state=state)
    values = json.loads(state.read_text(encoding="utf-8"))
    values["starts"] = values["starts"][:1]
    state.write_text(json.dumps(values), encoding="utf-8")
    reported: list[int] = []
    again = synthesize("five_bar", task, state=state, report=lambda text, done, total: reported.append(done))
    assert reported == [1]
    np.testing.assert_array_equal(first.p, again.p)
    assert len(again.starts) == 2
    with pytest.raises(DesignError, match="belongs to another task"):
        synthesize("five_bar", changed(reach=NEAR, starts=3), state=state)


@pytest.mark.slow
def test_front(tmp_path):
    values = changed(
        objective=[{"minimise": "condition"}, {"minimise": "size", "of": ["link*.d"]}],
        front=5, starts=1,
    )  # fmt: skip
    state = tmp_path / "state.json"
    result = synthesize("five_bar", values, state=state)
    front = np.array([design.values for design in result.front])
    assert len(front) >= 4
    order = np.argsort(front[:, 0])
    assert (np.diff(front[order, 1]) < 0.0).all()  # better in one only by being worse in the other
    ends = [synthesize("five_bar", changed(objective=[term], starts=1)).values[0] for term in values["objective"]]
    np.testing.assert_allclose(front.min(axis=0), ends, rtol=1e-4)
    assert any(np.array_equal(result.p, design.p) for design in result.front)
    assert f"Pareto front, {len(front)} designs" in result.text
    assert result.text.count("<- written") == 1
    kept = json.loads(state.read_text(encoding="utf-8"))
    assert len(kept["front"]) == 5
    kept["front"] = kept["front"][:-1]
    state.write_text(json.dumps(kept), encoding="utf-8")
    reported: list[tuple[str, int]] = []
    again = synthesize("five_bar", values, state=state, report=lambda text, done, total: reported.append((text, done)))
    assert reported == [("Pareto front", 4)]
    np.testing.assert_allclose([design.values for design in again.front], front, rtol=1e-9)


ERRORS = {"sigma": {"link*.d": "0.05mm"}, "encoder": {"joint1": "0.02deg", "joint3": "0.02deg"}}
DOWN = (0.0, -9.81, 0.0)
LOAD = [Payload("tool", 3.0)]
LARGEST = {
    "mass": lambda robot, path, q: sum(inertia.mass for inertia in robot.model.inertias),
    "torque": lambda robot, path, q: np.abs(
        [forces(robot, row, payloads=LOAD, gravity=DOWN).torques for row in q]
    ).max(),
    "accuracy": lambda robot, path, q: max(Tolerances(path, **ERRORS).at(row).position for row in q),
}
"""What the loaded robot has at most in configurations."""


def loaded(result, task, folder, count):
    """The file of a result, and what its robot, loaded anew, does where it should reach."""
    path = folder / "best.raff"
    path.write_text(result.raff, encoding="utf-8")
    problem = SynthesisProblem(path, task_of({**task, "parameters": dict.fromkeys(result.parameters.names, "-9..9m")}))
    return path, problem.scores_from_home(problem.parameters.values, problem.reach.grid(count))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "more"),
    [
        ("mass", {}),
        ("torque", {"load": {"payload": "3kg", "gravity": list(DOWN)},
                    "constraints": {"joint_limits": False, "singular_values": "0.2..5"}}),
        ("accuracy", {"tolerances": ERRORS}),
    ],
)  # fmt: skip
def test_objectives_are_those_of_the_loaded_robot(tmp_path, what, more):
    values = changed(objective=[{"minimise": what}], **more)
    result = synthesize("five_bar", values)
    assert result.values[0] < result.before[0]
    path, scores = loaded(result, values, tmp_path, 9)
    assert LARGEST[what](cinegen.load(path), path, scores.reached.q) == pytest.approx(result.values[0], rel=1e-3)


@pytest.mark.parametrize(("more", "g"), [({}, 1.62), ({"gravity": [0.0, -9.81, 0.0]}, 9.81)])
def test_gravity_is_that_of_the_file_unless_the_task_gives_it(tmp_path, more, g):
    words = ("inertial { mass 0 }",) * 2
    (tmp_path / "arm.raff").write_text(f"{two_bars(words=words)}gravity {{ 0 -1.62 0 }}\n", encoding="utf-8")
    task = {
        "parameters": {"tool.d": "200..400mm"},
        "reach": {"points": [[0.5, 0.3]], "axes": ["x", "y"]},
        "objective": [{"minimise": "torque"}],
        "load": {"payload": "2kg", **more},
        "starts": 1,
    }
    best = synthesize(tmp_path / "arm.raff", task)
    assert best.values[0] == pytest.approx(2.0 * g * 0.5, rel=1e-9)  # at the shoulder


@pytest.mark.slow
def test_clearance_is_that_of_capsules_in_coal(tmp_path):
    obstacle = {"from": [0.0, 0.12, 0.0], "radius": "30mm"}
    values = changed(
        parameters={"link2.d": "150..500mm", "link5.d": "200..600mm", "link1.d": "-300..-50mm"},
        ties=["link2.d = link4.d", "link5.d = tool.d", "link3.d = -1*link1.d"],
        constraints={"joint_limits": False, "clearance": {"least": "90mm", "radius": "10mm", "obstacle": [obstacle]}},
    )  # fmt: skip
    free = synthesize("five_bar", {**values, "constraints": {"joint_limits": False}})
    cleared = synthesize("five_bar", values)
    for result in (free, cleared):
        path, scores = loaded(result, values, tmp_path, 9)
        robot, ball = cinegen.load(path), coal.Sphere(0.03)
        gaps = []
        for q in scores.reached.q:
            place = {node: robot.placement(q, node).translation for node in robot.nodes}
            bars = [("base", "link1"), ("base", "link3"), ("link1", "link2"), ("link3", "link4"), ("link2", "tool"),
                    ("link4", "link5")]  # fmt: skip
            arms = {pair: capsule(place[pair[0]], place[pair[1]], 0.01) for pair in bars}
            gaps += [apart(*arms[pair], ball, at(0.0, 0.12, 0.0)) for pair in bars[2:]]
            pairs = [(0, 3), (0, 5), (1, 2), (1, 4), (2, 3), (2, 5), (3, 4)]
            gaps += [apart(*arms[bars[a]], *arms[bars[b]]) for a, b in pairs]
        if result is cleared:
            assert min(gaps) == pytest.approx(0.09, abs=1e-4)  # what is asked, and no more: it costs condition
            assert result.check.margins["clearance"] > -1e-3
        else:
            assert min(gaps) < 0.085
    assert cleared.values[0] > free.values[0]


def capsule(a: np.ndarray, b: np.ndarray, radius: float) -> tuple[coal.Capsule, pin.SE3]:
    rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), b - a).matrix()
    return coal.Capsule(radius, float(np.linalg.norm(b - a))), pin.SE3(rotation, (a + b) / 2.0)


def test_poses_of_a_gough_platform(tmp_path):
    poses = [[0.0, 0.0, 0.9, 0, 0, 0], ["50mm", "-50mm", 0.95, 5, 3, -40], ["-50mm", "50mm", 1.0, -5, 2, 20]]
    task = {
        "parameters": {"link1.d": "0.5..1.2m", "link7.d": "0.5..1.2m"}, "reach": {"poses": poses}, "starts": 1,
        "objective": [{"minimise": "condition"}], "constraints": {"joint_limits": False},
    }  # fmt: skip
    result = synthesize("gough", task)
    assert result.values[0] < result.before[0] * 0.98
    path, scores = loaded(result, task, tmp_path, 3)
    robot = cinegen.load(path)
    for q, wanted in zip(scores.reached.q, [(0.0, 0.0, 0.9, 0, 0, 0), (0.05, -0.05, 0.95, 5, 3, -40)], strict=False):
        pose = robot.placement(q, robot.end)
        np.testing.assert_allclose(pose.translation, wanted[:3], atol=1e-8)
        np.testing.assert_allclose(pose.rotation, pin.rpy.rpyToMatrix(*np.radians(wanted[3:])), atol=1e-8)


@pytest.mark.slow
def test_the_written_robot_is_in_the_assembly_mode_that_was_optimised():
    """With upper arms of 3 m and forearms of 3.3 m the file's home is out of reach, and closing it anywhere near ends
    in another mode."""
    task = {
        "parameters": {"link2.d": "1..3m", "link4.d": "2.5..4.5m"}, "starts": 1,
        "ties": ["link2.d = link7.d = link13.d", "link4.d = link9.d = link15.d"],
        "reach": {"x": "-0.3..0.3", "y": "-0.3..0.3", "z": "-2.4..-1.9"}, "objective": [{"maximise": "sigma_1"}],
    }  # fmt: skip
    result = synthesize("delta4", task)
    assert result.check.reached == result.check.points == 512
    with pytest.warns(RaffWarning, match="graphics that can't be shown"):
        robot = cinegen.load(result.raff)
    goal = pin.SE3(robot.placement(robot.q_home, robot.end).rotation, np.array([0.2, -0.2, -2.3]))
    assert cinegen.inverse_kinematics(robot, {robot.end: goal}).found


def test_a_region_is_proved_with_the_result_or_the_task_is_not_done(monkeypatch):
    region = {"x": "-100..100mm", "y": "350..450mm"}
    task = changed(constraints={"joint_limits": False, "proved": True}, reach=region, starts=1)
    result = synthesize("five_bar", task)
    assert result.holds
    assert "proved 100 % of the region" in result.text
    assert cinegen.prove(cinegen.load(result.raff), {"x": (-0.1, 0.1), "y": (0.35, 0.45)})
    monkeypatch.setattr(search, "prove", partial(cinegen.prove, boxes=1))
    result = synthesize("five_bar", task)
    assert result.check.holds
    assert not result.holds
    assert "the region is not proved: the result does not do the whole task" in result.text


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (changed(constraints={"proved": True}, reach=NEAR), "needs a region with an extent"),
        (changed(reach=NEAR | {"points": [[0.0, 3.0], [0.0, 5.0]]}, starts=1), r"y [35]000 mm is still [\d.e+]+ mm"),
        (changed(reach={"axes": ["x", "y"], "points": [[0, 400], [0, 450]]}), "did you mean 450 mm"),
        (changed(reach={"x": "-150..150mm"}), "which is 1 coordinates, but 2 actuated joints move it"),
        (changed(parameters={"link2.d": "150..500mm", "link5.theta": "-170..-10deg"}), "is the variable of joint5"),
        (changed(parameters={"link2.alpha": "-5..5deg"}, ties=[]), "link2.alpha: a change opens the loops"),
        (changed(parameters={"link2.d": "150..500mm", "base.r": "-1..1m"}, ties=[]), "base.r: without any effect"),
        (changed(objective=[{"minimise": "accuracy"}]), "tolerances is missing"),
        (changed(tolerances={"sigma": {"link*.d": "0.05mm"}}), "of no use without accuracy"),
        (changed(objective=[{"maximise": "region"}], reach={"axes": "xy", "points": [[0, 0.4]]}), "axes must be"),
        (changed(objective=[{"maximise": "region"}], reach={"axes": ["x", "y"], "points": [[0, 0.4]]}), "not single"),
        (changed(constraints={"mass": "1g"}, reach=NEAR, starts=1), "violate mass by"),
        (changed(objectiv=[]), "unknown key 'objectiv': did you mean 'objective'"),
        (changed(objective=[{"maximise": "condition"}]), "better in the opposite direction: write minimise"),
        (changed(constraints={"singular_values": "0..2"}), "must begin above 0"),
    ],
)  # fmt: skip
def test_bad_tasks(values, message):
    with pytest.raises((DesignError, ImplausibleError), match=message):
        synthesize("five_bar", values)


def test_task_file(tmp_path):
    path = tmp_path / "task.toml"
    path.write_text('starts = 1\n[parameters]\n"link2.d" = "1..2m"\n[reach]\nx = 0.5\ny = "1..2m"\n[[objective]]\n'
                    'maximise = "sigma_1"\nover = "mean"\n', encoding="utf-8")  # fmt: skip
    task = load_task(path)
    assert task.reach.axes == ("x", "y")
    assert task.reach.low.tolist() == [0.5, 1.0]
    assert len(task.reach.grid(3)) == 3
    assert task.starts == 1
    path.write_text('[parameters]\n"link2.d" = "1..2m"\n[reach]\nx = 0\ny = "1m"\nradius = "100mm"\n'
                    '[[objective]]\nmaximise = "region"\n', encoding="utf-8")  # fmt: skip
    task = load_task(path)
    samples = task.reach.samples(512, 0) - [0.0, 1.0]
    assert np.linalg.norm(samples, axis=1).max() <= 0.1 + 1e-12
    np.testing.assert_allclose(np.linalg.norm(samples[:256], axis=1), 0.1)  # half of them on the boundary
    np.testing.assert_allclose(np.linalg.norm(task.reach.grid(3)[1:] - [0.0, 1.0], axis=1), 0.1)
    path.write_text("x = = 2", encoding="utf-8")
    with pytest.raises(DesignError, match=r"task.toml: invalid TOML"):
        load_task(path)


# --- linkages ---------------------------------------------------------------------------------------------------------
# Precision points of a four-bar, judged by circles that intersect.


RANGES = {
    "link1.gamma": "-180..180", "link1.d": "0..3m", "link3.gamma": "-180..180", "link3.d": "0..3m",
    "link2.d": "0.1..3m", "frame4.d": "0.1..4m", "frame5.d": "0.1..4m",
    "frame20.gamma": "-180..180", "frame20.d": "0..3m",
}  # fmt: skip
NINE = [[0.25, 0.0], [0.52, 0.10], [0.80, 0.70], [1.20, 1.00], [1.40, 1.30], [1.10, 1.48], [0.70, 1.40], [0.20, 1.00],
        [0.02, 0.40]]  # fmt: skip
"""Problem 3 of Wampler, Morgan and Sommese, "Complete solution of the nine-point path synthesis problem", 1992."""


def joints_of_crank(p: dict[str, float], target: np.ndarray) -> np.ndarray:
    """Return what the rocker lacks (2,) where the coupler point is at a target, for both places of the crank's end."""
    pivot, other = (p[f"{k}.d"] * np.exp(1j * p[f"{k}.gamma"]) for k in ("link1", "link3"))
    wanted, crank, arm = complex(*target), p["link2.d"], p["frame20.d"]
    apart = wanted - pivot
    along = (crank**2 - arm**2 + abs(apart) ** 2) / (2.0 * abs(apart))
    across = np.sqrt(crank**2 - along**2 + 0j).real
    ends = pivot + apart / abs(apart) * (along + np.array([1j, -1j]) * across)
    coupler = np.exp(1j * (np.angle(wanted - ends) - p["frame20.gamma"]))
    return np.abs(ends + p["frame4.d"] * coupler - other) - p["frame5.d"]


def values_of(linkage) -> dict[str, float]:
    return dict(zip(linkage.parameters.names, linkage.p, strict=True))


@pytest.mark.parametrize(("points", "starts"), [(NINE[:8:2], 2), *slow((NINE, 24))], ids=["four", "nine"])
def test_path(points, starts):
    linkage = synthesize("four_bar", {"parameters": RANGES, "path": {"points": points}, "starts": starts})
    assert linkage.error.max() < 1e-9
    assert linkage.one_circuit
    assert linkage.in_order
    values = values_of(linkage)
    lack = [np.abs(joints_of_crank(values, np.array(point))).min() for point in points]
    assert max(lack) < 1e-9
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cinegen.CinegenWarning)  # home is outside of the limits of joint3
        robot = cinegen.load(linkage.raff)
    np.testing.assert_allclose(robot.placement(robot.q_home, "tool").translation[:2], points[0], atol=1e-7)


def test_guidance():
    poses = [[0.2, 0.4, 10.0], [0.3, 0.45, 30.0], [0.35, 0.42, 55.0]]
    linkage = synthesize("four_bar", {"parameters": RANGES, "guidance": {"poses": poses}, "starts": 2})
    assert linkage.error.max() < 1e-9
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", cinegen.CinegenWarning)  # home is outside of the limits of joint3
        robot = linkage.parameters.mechanism_with(linkage.p)
    for q, (x, y, angle) in zip(linkage.q, poses, strict=True):
        place = robot.placement(robot.close(q), "tool")
        np.testing.assert_allclose(place.translation[:2], [x, y], atol=1e-6)
        turned = np.degrees(np.arctan2(place.rotation[1, 0], place.rotation[0, 0]))
        assert (turned - angle + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-4)


def test_function():
    ranges = {name: RANGES[name] for name in ("link2.d", "frame4.d", "frame5.d")} | {"link2.d": "50mm..0.8m"}
    pairs = [[40.0, 95.0], [65.0, 103.0], [90.0, 115.0]]
    task = {"parameters": ranges, "function": {"input": "joint1", "output": "joint3", "pairs": pairs}, "starts": 1}
    linkage = synthesize("four_bar", task)
    assert linkage.error.max() < 1e-9
    p, fixed = values_of(linkage), Parameters("four_bar").values[Parameters("four_bar").index("link3.d")]
    for crank, rocker in np.radians(pairs):  # Freudenstein: the coupler's length at each pair
        ends = p["link2.d"] * np.exp(1j * crank), fixed + p["frame5.d"] * np.exp(1j * rocker)
        assert abs(ends[0] - ends[1]) == pytest.approx(p["frame4.d"], abs=1e-9)


@pytest.mark.parametrize(
    ("robot", "values", "message"),
    [
        ("five_bar", {"parameters": {"link2.d": "0.1..1m"}, "path": {"points": NINE}}, "has mobility 2"),
        ("four_bar", {"parameters": RANGES, "path": {"points": NINE[:1]}}, "must be two or more"),
        ("four_bar", {"parameters": RANGES, "path": {"points": [[100, 50], [120, 60]]}}, "did you mean 120 mm"),
        ("four_bar", {"parameters": RANGES, "path": {"points": [[1, 2, 3]]}}, "rows of 2 numbers"),
        ("four_bar", {"parameters": RANGES, "path": {"points": NINE}, "guidance": {"poses": []}}, "cannot be combined"),
        (
            "four_bar",
            {"parameters": RANGES, "function": {"input": "joint1", "output": "joint1", "pairs": NINE}},
            "output must be another joint than the input",
        ),
        ("four_bar", {"parameters": {"link2.alpha": "-1..1"}, "path": {"points": NINE}}, "opens the loops"),
        (
            "four_bar",
            {"parameters": {**RANGES, "frame20.theta": "-9..9"}, "path": {"points": NINE}},
            "^frame20.theta: without any effect on the precision points",
        ),
        (
            "four_bar",
            {"parameters": {"link3.theta": "0..180"}, "path": {"points": NINE}},
            "link3.theta is the variable",
        ),
    ],
)
def test_bad_precision_points(robot, values, message):
    with pytest.raises((DesignError, ImplausibleError), match=message):
        synthesize(robot, values)


# --- five bar circle --------------------------------------------------------------------------------------------------
# A five-bar against an elementary optimum.
#
# With coincident base joints, at a distance r from them and with the half angle b between the outer bars, the singular
# values are r / sqrt(2) and r tan(b) / sqrt(2). So the condition number depends on r alone. By the law of cosines its
# largest value over r0..r1 is least for inner bars of (r0 + r1) / 2 and outer bars of sqrt(inner^2 + r0 r1): there it
# is (r0 + r1) / 2 / sqrt(r0 r1) at r0, r1 and sqrt(r0 r1).


WIDE = changed(parameters={"link2.d": "150..500mm", "link5.d": "200..700mm"}, starts=1)
RECTANGLE = np.stack(np.meshgrid(np.linspace(-0.15, 0.15, 61), np.linspace(0.3, 0.5, 41)), -1).reshape(-1, 2)


def test_five_bar_with_coincident_base_joints(tmp_path):
    path = tmp_path / "coincident.raff"
    path.write_text(Parameters("five_bar", "link3.d", "link1.d = -1*link3.d").with_values([0.0]), encoding="utf-8")
    assert np.linalg.norm(cinegen.load(path).placement(cinegen.load(path).q_home, "link1").translation) < 1e-12
    result = synthesize(path, WIDE)
    nearest, farthest = np.linalg.norm(RECTANGLE, axis=1).min(), np.linalg.norm(RECTANGLE, axis=1).max()
    inner = (nearest + farthest) / 2.0
    outer, worst = np.sqrt(inner**2 + nearest * farthest), inner / np.sqrt(nearest * farthest)
    np.testing.assert_allclose(result.p, [inner, outer], rtol=1e-5)  # the grid has no point at sqrt(r0 r1)
    assert worst * (1.0 - 1e-5) < result.values[0] <= worst  # of fewer points
    assert result.check.condition <= worst * (1.0 + 1e-5)
