"""`AvoidingSolver`: never too near while it is pulled about, and round what is in the way."""

import numpy as np
import pinocchio as pin
import pytest
from clearings import measured
from repository import load

from cinegen.collision import clearance_of, scene_of
from cinegen.errors import CinegenError
from cinegen.ik import AxisAlong, Range, Solver, Status
from cinegen.planning import AvoidingSolver

SAFETY = 0.01
EXACT = 3e-6  # m: as exact as coal's distances to hulls and cylinders are


def scene(name, *obstacles, **more):
    mechanism = load(name)
    listed = [{"name": f"o{i}", **one} for i, one in enumerate(obstacles)]
    document = {"safety": SAFETY, "start": {}, "goal": {"point": [0.0, 0.0, 0.0]}, "obstacle": listed, **more}
    return scene_of(document, mechanism=mechanism)


def hand(scene_, dt=1e-3, acceleration=None):
    clearance = clearance_of(scene_)
    return AvoidingSolver(clearance, dt, scene_.safety, q=scene_.start, acceleration=acceleration), clearance


def pole(x, y):
    return {"kind": "cylinder", "radius": 0.03, "length": 1.2, "point": [x, y, 0.4]}


def moved(task, translation):
    task.target = pin.SE3(task.target.rotation, np.asarray(translation, dtype=float))


def balls_about(name, node, rng):
    """Four balls near a node at home, none of them too near."""
    mechanism, found = load(name), []
    home = mechanism.placement(mechanism.q_home, node).translation
    while len(found) < 4:
        away = rng.normal(size=3) * (1.0, 1.0, 0.0 if name == "planar_3r" else 1.0)
        place = home + rng.uniform(0.13, 0.45) * mechanism.length * away / np.linalg.norm(away)
        ball = {"kind": "sphere", "radius": 0.08 * mechanism.length, "point": place.tolist()}
        if clearance_of(scene(name, ball)).least(mechanism.q_home) > 1.5 * SAFETY:
            found.append(ball)
    return found


@pytest.mark.parametrize(
    ("name", "node", "dt", "acceleration"),
    [("arm7", "tool", 0.01, None), ("delta4", "platform", 0.01, None), ("planar_3r", "tool", 0.05, np.inf)],
)
def test_however_it_is_pulled_it_stays_clear_all_along(name, node, dt, acceleration):
    """Dragged into one ball after another, no step comes nearer than the safety distance, anywhere on it, by distances
    of coal itself; loops stay closed. Something is held off each time: no drag is harmless."""
    mechanism = load(name)
    rng = np.random.default_rng(0)
    balls = balls_about(name, node, rng)
    solver, clearance = hand(scene(name, *balls), dt, acceleration)
    task = solver.add_task(node, translation=3, rotation=0, axes="world")
    before, barred = solver.q, 0
    for tick in range(90):
        if tick % 30 == 0:
            moved(task, balls[tick // 30]["point"] + rng.uniform(-0.05, 0.05, 3) * mechanism.length)
        step = solver.step()
        for part in (0.5, 1.0):
            between = pin.interpolate(mechanism.model, before, step.q, part)
            assert measured(clearance, between).min() >= SAFETY - EXACT
        assert mechanism.closure(step.q) <= 1e-9
        barred += bool(step.active_barriers)
        before = step.q
    assert barred


def test_a_range_is_refused_and_its_task_taken():
    solver, _ = hand(scene("arm7"), 0.01, None)
    upright = AxisAlong("tool")
    with pytest.raises(CinegenError, match="add the range's task itself"):
        solver.add_task(Range(upright, radius=0.1))
    assert solver.add_task(upright) is upright


def test_it_goes_round_a_pole_where_a_damper_alone_is_held():
    """A rod across the way of a planar arm, the paper's figures 5 and 6, in the hand."""
    rod = {"kind": "box", "size": [0.24, 0.01], "point": [0.62, 0.0]}
    start = {"joints": {"joint1": -1.18, "joint2": 0.99, "joint3": 0.88}}
    goal = [0.6, 0.3, 0.0]

    def pulled(solver, ticks=1500):
        task = solver.add_task("tool", translation=2, rotation=0, axes="world")
        moved(task, goal)
        seen = set()
        for _ in range(ticks):
            step = solver.step()
            seen.add(step.status)
            if step.errors[0][0] < 1e-3:
                break
        return step, seen

    avoiding, clearance = hand(scene("planar_3r", rod, start=start), dt=4e-3)
    step, seen = pulled(avoiding)
    assert step.errors[0][0] < 1e-3
    assert Status.DETOUR in seen
    alone = Solver(avoiding.mechanism, 4e-3, scene("planar_3r", rod, start=start).start)
    alone.barriers = avoiding.barriers
    step, seen = pulled(alone, 400)
    assert step.errors[0][0] > 0.1
    assert step.status is Status.BARRED
    assert clearance.least(step.q) >= SAFETY


def test_tasks_are_suspended_after_a_tenth_of_a_second_at_rest_and_not_while_it_moves():
    """Straight into the middle of a wall: the approach takes longer than that, and is not interrupted."""
    wall = {"name": "wall", "kind": "box", "point": [0.5, 0.0], "size": [0.1, 0.6]}
    solver, _ = hand(
        scene_of(
            {"mobile": {"radius": 0.05}, "safety": SAFETY, "start": {"point": [0.0, 0.0]},
             "goal": {"point": [2.0, 0.0]}, "obstacle": [wall]}
        )
    )  # fmt: skip
    moved(solver.add_task("mobile", translation=2, rotation=0, axes="world"), [1.0, 0.0, 0.0])
    moving = resting = 0
    while (step := solver.step()).status is not Status.DETOUR:
        slow = float(np.abs(step.v / solver.mechanism.scale).max()) < 2e-3
        moving, resting = moving + (not slow), resting + slow
        assert resting <= 101
    assert moving > 110
    assert resting == pytest.approx(100, abs=1)  # ticks of 1 ms


def test_a_pull_that_makes_no_sense_beside_one_that_is_held_off():
    """Neither raises, nor moves what it must not."""
    solver, clearance = hand(scene("arm7", pole(0.45, 0.0)))
    tool = solver.add_task("tool", translation=3, rotation=0)
    other = solver.add_task("link4", translation=3, rotation=0)
    x, y, z = tool.target.translation
    for wrong in ("nowhere", None, pin.SE3(np.eye(3), np.full(3, np.nan))):
        other.target = wrong
        moved(tool, [x, -y - 0.6, z])
        for _ in range(150):
            step = solver.step()
            assert step.status is Status.BAD_TARGET
        assert clearance.least(step.q) >= SAFETY


def test_a_fault_of_its_own_is_reported_and_it_stays_clear(monkeypatch, caplog):
    """What goes wrong in looking for a path is no secret: it is in the step, and in the log once."""
    solver, clearance = hand(scene("arm7", pole(0.45, 0.0)), acceleration=np.inf)  # from too near: away at once
    task = solver.add_task("tool", rotation=0)
    x, y, z = task.target.translation
    moved(task, [x, -y - 0.6, z])
    assert solver.step().exceptions == ()

    def broken(*_):
        raise ZeroDivisionError("of the package's own")

    monkeypatch.setattr(solver.vortices, "deflect", broken)
    for _ in range(100):
        step = solver.step()
        assert [type(error) for error in step.exceptions] == [ZeroDivisionError]
        assert step.closure <= 1e-10
        assert clearance.least(step.q) >= SAFETY
    found = [record for record in caplog.records if record.name == "cinegen"]
    assert len(found) == 1
    assert "around obstacles of arm: ZeroDivisionError: of the package's own" in found[0].getMessage()
    assert "in broken" in caplog.text
    monkeypatch.undo()
    assert solver.step().exceptions == ()


@pytest.mark.filterwarnings("error")
def test_a_target_may_be_as_far_away_as_numbers_go():
    solver, _ = hand(scene("planar_3r", pole(0.6, 0.3)))
    task = solver.add_task("tool", rotation=0)
    for far in (1e192, -1e300, 1.0):
        moved(task, [far, far, 0.0])
        step = solver.step()
        assert not step.exceptions
        assert np.isfinite(step.q).all()
