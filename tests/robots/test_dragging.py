"""Dragged about at random no robot tears, crosses a limit, jumps, or raises."""

import numpy as np
import pinocchio as pin
import pytest
from hand import DT, Hand, check
from repository import load, one_of_each_kind
from scipy.optimize import linprog

import cinegen
from cinegen import Status

TICKS = 1000


@one_of_each_kind
def test_a_wild_hand_neither_tears_a_robot_nor_drives_it_over_a_limit(name, which):
    mechanism = load(name, which)
    solver = cinegen.Solver(mechanism, DT)
    hand = Hand(mechanism, solver, seed=0)
    hand.grasp()
    moving = 0
    for _ in range(TICKS):
        hand.act()
        before = solver.q.copy()
        step = solver.step()
        check(mechanism, before, step)
        assert np.array_equal(step.q, solver.q)
        assert len(step.errors) == len(solver.tasks)
        assert (step.status is Status.IDLE) == (not solver.tasks)
        moving += not np.array_equal(before, step.q)
    assert moving > TICKS / 10  # it did follow the hand


# --- against its limits ------------------------------------------------------------------------------------------

HARD = [  # seeds at which it trembles if steps are only halved or an active set lets no joint go, or rests too early
    *(("arm7", 1002), ("delta4_linear", 1007), ("five_bar", 1027), ("gough", 1017)),
    *(("hybrid", 1012), ("serial_5dof", 1010), ("sr400", 1004), ("tssm", 1002)),
]


@pytest.mark.parametrize(("name", "seed"), [*HARD, ("planar_3r", 1000), ("differential_wrist", 1000)])
def test_pulled_for_long_to_one_place_it_comes_to_rest_as_near_as_its_limits_allow(name, seed):
    """No joint swings to and fro between two ticks; and where it rests no small motion would bring it nearer."""
    mechanism = load(name)
    solver = cinegen.Solver(mechanism, DT)
    hand = Hand(mechanism, solver, seed)
    hand.grasp()
    for _ in range(150):  # somewhere
        hand.act()
        solver.step()
    for task in solver.tasks:
        solver.remove_task(task)
    end = mechanism.nodes[-1]
    task = solver.add_task(end, hand.target(end), 3, int(hand.rng.choice([0, 3])))
    for _ in range(600):
        step = solver.step()
    begin, way = solver.q.copy(), np.zeros(mechanism.model.nv)
    for _ in range(20):
        before = solver.q.copy()
        step = solver.step()
        way += np.abs(pin.difference(mechanism.model, before, solver.q) / mechanism.scale)
    straight = np.abs(pin.difference(mechanism.model, begin, solver.q) / mechanism.scale)
    assert (way - straight).max() <= 0.02, f"it trembles at {step.saturated}"
    for _ in range(900):
        step = solver.step()
        if np.abs(step.v / mechanism.scale).max() * DT < 1e-7:
            break
    resting = np.abs(step.v / mechanism.scale).max() * DT < 1e-7
    if resting and max(step.errors[0][0] / mechanism.length, step.errors[0][1]) > 1e-6:
        won, error = what_could_be_won(mechanism, step.q, task)
        assert won <= 0.05 * 0.05 * error, f"it rests too early, held by {step.saturated}"


def what_could_be_won(mechanism: cinegen.Mechanism, q: np.ndarray, task: cinegen.FrameTask) -> tuple[float, float]:
    """The most that a motion of 0.05 (rad, lengths) can win to first order, loops closed and limits kept, by linear
    programming: of the product of error and way, and the error itself; without unit."""
    low, high = mechanism.model.lowerPositionLimit - q, mechanism.model.upperPositionLimit - q
    low, high = np.maximum(low / mechanism.scale, -0.05), np.minimum(high / mechanism.scale, 0.05)
    error, rows = task.equations(mechanism.placement(q, task.node), mechanism.jacobian(q, task.node) * mechanism.scale)
    unit = np.array([mechanism.length] * 3 + [1.0] * task.rotation)
    parts = np.split(error / unit, [3])
    error = np.concatenate([part * min(1.0, 0.2 / max(float(np.linalg.norm(part)), 1e-9)) for part in parts])
    gradient = (rows / unit[:, None]).T @ error
    motions = np.eye(mechanism.model.nv)
    if mechanism.is_constrained:
        motions = np.linalg.svd(mechanism.structure.system.evaluate(q)[1])[2][mechanism.loop_rank :].T
    bounds = np.concatenate([np.maximum(high, 0.0), np.maximum(-low, 0.0)])
    best = linprog(-motions.T @ gradient, np.vstack([motions, -motions]), bounds, bounds=(None, None))
    return (0.0 if best.fun is None else -best.fun), float(np.linalg.norm(error))
