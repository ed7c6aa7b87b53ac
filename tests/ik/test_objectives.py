"""What redundancy does: it serves its objectives, and neither tasks nor loops feel it."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from repository import load
from test_barriers import Objective
from ticking import beside, ticked

import cinegen
from cinegen import Solver, Status
from cinegen.ik import LimitMargin, Manipulability, Posture, State
from cinegen.loops.motions import free_motions

DT = 0.01


def begin(mechanism: cinegen.Mechanism, seed: int = 1, far: float = 0.15) -> np.ndarray:
    """A closed configuration a little way from home, within limits."""
    model, rng = mechanism.model, np.random.default_rng(seed)
    while True:
        q = mechanism.close(mechanism.q_home + far * rng.uniform(-1.0, 1.0, model.nq) * mechanism.scale)
        if (q > model.lowerPositionLimit).all() and (q < model.upperPositionLimit).all():
            return q


def elsewhere(mechanism: cinegen.Mechanism) -> np.ndarray:
    """Another one: a posture to be wished for."""
    return begin(mechanism, seed=7, far=0.25)


def target(home: pin.SE3, length: float, time: float) -> pin.SE3:
    """A smooth path in the plane of x and y, turning about z."""
    turn = pin.exp3(np.array([0.0, 0.0, 0.1 * math.sin(time)]))
    way = 0.03 * length * np.array([math.sin(2.0 * time), math.sin(time), 0.0])
    return pin.SE3(turn @ home.rotation, home.translation + way)


def made(kind: type, mechanism: cinegen.Mechanism):
    if kind is Posture:
        return Posture(elsewhere(mechanism), rate=2.0)
    return LimitMargin(0.45, rate=2.0) if kind is LimitMargin else Manipulability(rate=2.0)


redundant = pytest.mark.parametrize(("name", "translation", "rotation", "kind"), [
    ("arm7", 3, 3, Posture), ("arm7", 3, 3, LimitMargin), ("arm7", 3, 3, Manipulability),
    ("gough", 3, 0, Manipulability), ("delta4", 2, 0, Posture), ("delta4", 2, 0, LimitMargin),
])  # fmt: skip


@redundant
def test_pulls_that_move_do_not_feel_an_objective(name, translation, rotation, kind):
    mechanism = load(name)
    node, q = mechanism.nodes[-1], begin(mechanism)
    errors, ends = [], []
    for objectives in ((), (made(kind, mechanism),)):
        solver = Solver(mechanism, DT, q=q)
        task = solver.add_task(node, translation=translation, rotation=rotation, axes="world")
        solver.objectives = objectives
        home, off = task.target.copy(), []
        for tick in range(200):
            task.target = target(home, mechanism.length, tick * DT)
            step = solver.step()
            metres, radians = step.errors[0]
            off.append(max(metres / mechanism.length, radians))
            assert step.closure <= 1e-10
            assert not step.failed_objectives
        errors.append(np.array(off))
        ends.append(step.q)
    assert (errors[1] - errors[0]).max() < 1e-9  # not further from its targets than without
    assert errors[1].max() < 1e-9  # that is, there
    if kind is not LimitMargin:
        assert np.abs(ends[1] - ends[0]).max() > 1e-3  # something did happen


@redundant
def test_an_objective_gets_better_and_better_until_the_robot_rests(name, translation, rotation, kind):
    mechanism = load(name)
    solver = Solver(mechanism, 0.05, q=begin(mechanism))
    solver.add_task(mechanism.nodes[-1], translation=translation, rotation=rotation)
    objective = made(kind, mechanism)
    solver.objectives = [objective]
    values, speeds = [objective.value(solver.state)], []
    for _ in range(300):
        step = solver.step()
        values.append(objective.value(solver.state))
        speeds.append(float(np.abs(step.v / mechanism.scale).max()))
    assert np.diff(values).max() < 1e-11
    assert values[-1] < values[0] or values[0] == 0.0
    if kind is not Manipulability or name == "gough":  # the measure's maximum may be far and flat
        assert max(speeds[-20:]) < max(1e-2 * max(speeds), 1e-9)
    assert step.status is Status.FOLLOWING


@pytest.mark.parametrize("name", ["arm7", "delta4"])
def test_with_nothing_pulled_a_posture_is_reached_and_loops_stay_closed(name):
    mechanism = load(name)
    posture, solver = elsewhere(mechanism), Solver(mechanism, DT, q=begin(mechanism))
    solver.objectives = [Posture(posture, rate=5.0)]
    for _ in range(500):
        step = solver.step()
        assert step.status is Status.IDLE
        assert step.closure <= 1e-10
    assert step.q == pytest.approx(posture, abs=1e-9 * max(1.0, mechanism.length))
    assert np.abs(step.v / mechanism.scale).max() < 1e-9
    solver.objectives = ()
    before = solver.q
    assert (solver.step().q == before).all()


def test_an_objective_that_overshoots_comes_to_rest():
    """Each tick leads three times as far as the wish: the swing is halved wherever it turns back."""
    arm = load("planar_3r")
    solver, wished = Solver(arm, DT), arm.q_home + 0.02
    solver.objectives = [Objective(lambda state: 3.0 / DT * (wished - state.q))]
    assert ticked(solver, 60).q == pytest.approx(wished, abs=1e-9)


def test_an_arm_that_rests_outstretched_costs_no_other_joint_a_tick(raff):
    """A target further out, no gradient, an elbow at its limit, attempts to escape that fail: a joint beside the arm
    goes back as if alone."""
    arm = raff("""
      robot r { base { }
        link 1 { type 2 pred 0 }
        link 2 { parameters { d 400 } type 2 pred 1 limits { 0 90 } }
        frame 3 { name "tool" parameters { d 300 } pred 2 }
        link 4 { type 2 pred 0 } }""")
    solver = Solver(arm, DT, q=[0.0, 0.0, 0.6])
    task = solver.add_task("tool", weights=[1, 0, 0, 0, 0, 0], axes="world")
    task.target = beside(task.target, (0.5, 0.0, 0.0))
    solver.objectives = [Posture(rate=2.0)]
    for tick in range(1, 13):
        assert solver.step().q == pytest.approx([0.0, 0.0, 0.6 * math.exp(-2.0 * DT * tick)], abs=1e-12)


def test_only_the_joints_that_are_named_go_back():
    arm = load("arm7")
    q = begin(arm)
    solver = Solver(arm, DT, q=q)
    solver.objectives = [Posture(joints={"joint2": 1.0, "joint4": 0.5}, rate=5.0)]
    step = ticked(solver, 600)
    named = [arm.q_index("joint2"), arm.q_index("joint4")]
    others = [i for i in range(arm.model.nq) if i not in named]
    assert step.q[named] == pytest.approx(arm.q_home[named], abs=1e-5)
    assert (step.q[others] == q[others]).all()


def test_a_margin_is_kept_by_loops_too_and_finite_at_a_limit_and_beyond():
    delta = load("delta4")
    margin = LimitMargin(0.1)
    low, high = delta.model.lowerPositionLimit, delta.model.upperPositionLimit
    limited = np.isfinite(low) & np.isfinite(high)
    assert limited.any()
    for beyond in (0.0, 0.5):
        q = np.where(limited, high + beyond, delta.q_home)
        velocity = margin.velocity(State(delta, q, DT))
        assert np.isfinite(velocity).all()
        assert (velocity[limited] < 0.0).all()
        assert (velocity[~limited] == 0.0).all()
    middle = np.where(limited, 0.5 * (low + high), delta.q_home)
    assert not margin.velocity(State(delta, middle, DT)).any()


def test_it_keeps_limits_of_speed_and_acceleration_without_slowing_the_pulls_down():
    arm = load("arm7")
    ends = []
    for objectives in ((), (Posture(elsewhere(arm) + 1.0, rate=50.0),)):
        solver = Solver(arm, DT, q=begin(arm), acceleration=8.0)
        task = solver.add_task("tool", rotation=0)
        solver.objectives = objectives
        home, last = task.target.copy(), np.zeros(arm.model.nv)
        for tick in range(150):
            task.target = target(home, arm.length, tick * DT)
            step = solver.step()
            assert (np.abs(step.v) <= arm.model.upperVelocityLimit * (1.0 + 1e-9)).all()
            assert np.abs(step.v - last).max() <= 8.0 * DT * 1.1
            last = step.v
        ends.append(step.errors[0][0])
    assert ends[1] < max(ends[0], 1e-9)


# --- manipulability ------------------------------------------------------------------------------------------------


def logarithm(mechanism: cinegen.Mechanism, q: np.ndarray, node: str, rows: int) -> float:
    """Of Yoshikawa's measure of the first rows of a node, by numpy alone, at a closed configuration."""
    jacobian = mechanism.jacobian(q, node) * mechanism.scale
    jacobian[:3] /= mechanism.length
    loops = mechanism.structure.system.evaluate(q)[1]
    motions, _ = free_motions(loops, mechanism.loop_rank)
    sigma = np.linalg.svd(jacobian[:rows] @ motions, compute_uv=False)
    return float(np.log(sigma[sigma > 1e-6 * sigma[0]]).sum())


@pytest.mark.parametrize(("name", "rows"), [("arm7", 6), ("hybrid", 3), ("delta4", 3)])
@pytest.mark.parametrize("pulled", [True, False])
def test_its_gradient_is_that_of_finite_differences_over_closed_configurations(name, rows, pulled):
    mechanism = load(name)
    node, rotation = mechanism.nodes[-1], 3 * (rows == 6)
    for seed in range(2):
        q = begin(mechanism, seed)
        solver = Solver(mechanism, DT, q=q)
        if pulled:
            solver.add_task(node, rotation=rotation)
        objective = Manipulability(None if pulled else node, rotation=rotation)
        gradient = objective.gradient(solver.state)
        assert -objective.value(solver.state) == pytest.approx(logarithm(mechanism, q, node, rows), abs=1e-9)
        loops = mechanism.structure.system.evaluate(q)[1]
        motions, _ = free_motions(loops, mechanism.loop_rank)
        if pulled:
            jacobian = (mechanism.jacobian(q, node) * mechanism.scale)[:rows]
            jacobian[:3] /= mechanism.length
            _, sigma, wt = np.linalg.svd(jacobian @ motions)
            motions = motions @ wt[int((sigma > 1e-6 * sigma[0]).sum()) :].T
        assert np.linalg.norm(gradient - motions @ (motions.T @ gradient)) < 1e-8 * (1.0 + np.linalg.norm(gradient))
        for way in motions.T:
            step = 1e-4 * way * mechanism.scale
            ahead, behind = (mechanism.close(mechanism.integrate(q, by)) for by in (step, -step))
            slope = (logarithm(mechanism, ahead, node, rows) - logarithm(mechanism, behind, node, rows)) / 2e-4
            assert gradient @ way == pytest.approx(slope, abs=1e-5 * (1.0 + abs(slope)))


# --- laws ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dt", [0.001, 0.05, 1.0])
def test_distances_decay_exponentially_however_long_a_tick_is(dt):
    arm = load("arm7")
    q = begin(arm)
    moved = dt * Posture(rate=2.0).velocity(State(arm, q, dt))
    assert moved == pytest.approx((1.0 - math.exp(-2.0 * dt)) * (arm.q_home - q), abs=1e-12)


@settings(max_examples=40)
@given(
    st.sampled_from(["arm7", "planar_hybrid", "delta4", "hybrid"]),
    st.integers(0, 2**32 - 1),
    st.lists(st.sampled_from(["posture", "margin", "manipulability", "random"]), min_size=1, max_size=3),
)
def test_whatever_is_wished_for_the_tool_stands_and_no_loop_opens(name, seed, wishes):
    mechanism, rng = load(name), np.random.default_rng(seed)

    def random(state):
        return rng.normal(size=mechanism.model.nv) * mechanism.scale * 10.0 ** rng.integers(-9, 9)

    kinds = {
        "posture": Posture(mechanism.q_home + rng.normal(size=mechanism.model.nq) * mechanism.scale),
        "margin": LimitMargin(0.5),
        "manipulability": Manipulability(),
        "random": Objective(random),
    }
    solver = Solver(mechanism, DT, q=begin(mechanism, seed % 5))
    solver.add_task(mechanism.nodes[-1], translation=2, rotation=0, axes="world")
    solver.objectives = [kinds[wish] for wish in wishes]
    for _ in range(30):
        step = solver.step()
        assert step.errors[0][0] / mechanism.length < 1e-9
        assert step.closure <= 1e-10
        assert mechanism.limits.within(step.q, 0.0)
        assert (np.abs(step.v) <= mechanism.limits.velocity * (1.0 + 1e-9)).all()


# --- objectives that make no sense ---------------------------------------------------------------------------------


def test_wrong_objectives_are_refused_when_they_are_set():
    solver = Solver(load("arm7"), DT)
    for wrong in ([1.0], [None], [Posture(joints=["jont1"])], [Posture([0.0, 0.0])], [Manipulability("tol")]):
        with pytest.raises(cinegen.CinegenError):
            solver.objectives = wrong
        assert solver.objectives == ()


def test_objectives_move_a_floating_base_only_as_its_tasks_need_it(raff):
    """They want nothing of the base: it moves as far as the tool stays where it is."""
    free = raff("""
      sensor 1 { port "x" translation 3 rotation 3 }
      robot r { base { }
        link 1 { parameters { theta 20 d 100 } type 2 pred 0 }
        link 2 { parameters { theta 30 d 200 } type 2 pred 1 }
        link 3 { parameters { theta 30 d 200 } type 2 pred 2 }
        frame 4 { name "tool" parameters { d 200 } pred 3 }
        constraint { base sensor ( 0 1 ) } }""")
    assert free.floating
    solver = Solver(free, DT)
    solver.add_task("tool", rotation=0)
    solver.objectives = [Manipulability(), Posture(rate=0.1), LimitMargin()]
    step = ticked(solver, 50)
    assert not step.failed_objectives
    assert np.abs(step.q[7:] - free.q_home[7:]).max() > 1e-3
    assert step.errors[0][0] < 1e-9
    assert np.abs(step.q[:7] - free.q_home[:7]).max() > 1e-3
    alone = Solver(free, DT)
    alone.objectives = [Posture(np.r_[free.q_home[:7], free.q_home[7:] + 0.3])]
    step = ticked(alone, 50)
    assert (step.q[:7] == free.q_home[:7]).all()
    assert np.abs(step.q[7:] - free.q_home[7:]).min() > 1e-3
