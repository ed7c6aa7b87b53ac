"""Out of reach and back, out of singularities, and away from limits: a robot never stays where it could go on."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from elementary import within_limits
from repository import load, one_of_each_kind
from test_dragging import what_could_be_won

import cinegen
from cinegen import PersistentSolver, Solver
from cinegen.tolerances import NEAR_SINGULAR

DT = 1 / 60
OUT, BACK = 60, 3000

DEAD_ENDS = {"hybrid": 4, "arm7": 3}
"""So many excursions may end where limits pulled the robot into a dead end: there no motion brings it nearer to first
order."""


@cache
def starts(mechanism: cinegen.Mechanism) -> list[np.ndarray]:
    """Inside the limits, away from singularities of the whole pose."""
    node = mechanism.nodes[-1]
    samples = [mechanism.q_home]
    for seed in range(6):
        for q in mechanism.random_closed(20, seed):
            solver = Solver(mechanism, DT, q=q)
            solver.add_task(node)
            sigma = solver.step().singular_values
            if within_limits(mechanism, q) and sigma.min(initial=1.0) > NEAR_SINGULAR:
                samples.append(q)
    return samples[:20]


def is_back(mechanism: cinegen.Mechanism, step: cinegen.Step) -> bool:
    metres, angle = step.errors[0]
    return metres < 5e-5 * mechanism.length and angle < 5e-5


def out_and_back(solver: Solver, rng: np.random.Generator) -> cinegen.Step:
    """The last step, where it is back, or at rest."""
    mechanism = solver.mechanism
    node, way = mechanism.nodes[-1], rng.normal(size=3)
    home = mechanism.placement(solver.q, node)
    far = mechanism.length * 10.0 ** rng.uniform(0.5, 2.0)
    task = solver.add_task(node, rotation=int(rng.choice([0, 3])))
    task.target = pin.SE3(home.rotation, home.translation + far * way / np.linalg.norm(way))
    rests = 0
    for tick in range(OUT + BACK):
        if tick == OUT:
            task.target = home
        step = solver.step()
        assert step.closure <= 1e-10
        assert within_limits(mechanism, step.q)
        assert (np.abs(step.v) <= mechanism.model.upperVelocityLimit * (1.0 + 1e-9)).all()
        rests = rests + 1 if np.abs(step.v / mechanism.scale).max() * DT < 1e-7 else 0
        if tick > OUT + 5 and (rests > 4 or is_back(mechanism, step)):
            break
    return step


@one_of_each_kind
@pytest.mark.parametrize("kind", [Solver, PersistentSolver])
def test_out_of_reach_and_back(name, which, kind):
    """A persistent solver always comes back."""
    mechanism, rng, dead_ends = load(name, which), np.random.default_rng(0), 0
    begin = starts(mechanism)
    for excursion in range(4):
        solver = kind(mechanism, DT, q=begin[excursion % len(begin)])
        step = out_and_back(solver, rng)
        if not is_back(mechanism, step):
            won, error = what_could_be_won(mechanism, solver.q, solver.tasks[0])
            assert won < 1e-3 * 0.05 * error, (excursion, step, step.saturated)
            dead_ends += 1
    assert dead_ends <= (DEAD_ENDS.get(name, 0) if kind is Solver else 0)


# --- out of singularities ----------------------------------------------------------------------------------------


def chain(*lengths: float) -> str:
    """A planar arm of equal joints, all at 0: stretched."""
    links = [f"link {i} {{ parameters {{ d {d} }} type 2 pred {i - 1} }}" for i, d in enumerate((0, *lengths[:-1]), 1)]
    end = f'frame 20 {{ parameters {{ d {lengths[-1]} }} pred {len(lengths)} name "tool" }}'
    return f"robot r {{ {' '.join([*links, end])} }}"


@pytest.mark.parametrize("lengths", [(400, 300), (400, 300, 200), (200,) * 5])
@pytest.mark.parametrize("aside", [1e-3, -0.5])
def test_a_stretched_arm_is_drawn_in_by_a_pull_that_is_not_quite_straight(raff, lengths, aside):
    arm = raff(chain(*lengths))
    solver = Solver(arm, DT)
    begin = arm.placement(solver.q, "tool").translation
    inwards = -begin / np.linalg.norm(begin)
    goal = begin + 0.4 * arm.length * (inwards + aside * np.cross([0.0, 0.0, 1.0], inwards))
    first = solver.q
    solver.add_task("tool", pin.SE3(np.eye(3), goal), rotation=0)
    assert not np.array_equal(solver.step().q, first)  # at once
    for _ in range(1500):
        step = solver.step()
    assert step.errors[0][0] < 1e-6 * arm.length
