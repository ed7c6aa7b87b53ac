"""One solver in several threads: the second is refused, the first goes on as if it were alone."""

from __future__ import annotations

import inspect
import threading
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pinocchio as pin
import pytest

from cinegen import CinegenError, FrameTask, Solver
from cinegen.ik import LookAhead
from cinegen.ik.barrier import Bounds

DT = 1.0 / 240.0


class Meeting:
    """Barrier without bounds, in which a tick waits until another thread has tried to use the solver."""

    def __init__(self):
        self.inside, self.go = threading.Event(), threading.Event()

    def bounds(self, state):
        self.inside.set()
        assert self.go.wait(60)
        return Bounds(np.zeros((0, state.mechanism.model.nv)), np.zeros(0))

    def clear(self, state, q):
        return 1.0


def _pulled(mechanism):
    solver = Solver(mechanism, DT)
    task = solver.add_task(mechanism.end, rotation=0)
    task.target = pin.SE3(task.target.rotation, task.target.translation + np.array([0.0, 0.01, -0.01]))
    return solver


VALUES = {
    "q": lambda solver: solver.mechanism.q_home, "objectives": lambda _: (), "barriers": lambda _: (),
    "position_limits": lambda _: None, "dt": lambda _: 2.0 * DT, "keep_branch": lambda _: True,
    "keeps_linearisation": lambda _: True,
}  # fmt: skip
"""What is set; 0.1 unless named."""
PROPERTIES = [name for name, value in inspect.getmembers(Solver) if getattr(value, "fset", None)]


@pytest.mark.parametrize(
    "use",
    [
        *(
            partial(lambda name, one: setattr(one, name, VALUES.get(name, lambda _: 0.1)(one)), name)
            for name in PROPERTIES
        ),
        lambda solver: solver.step(),
        lambda solver: solver.lift_limits(position=True),
        lambda solver: solver.copy_state(Solver(solver.mechanism, DT)),
        lambda solver: LookAhead(solver.mechanism, DT).copy(solver),
        lambda solver: solver.add_task(solver.mechanism.end),
        lambda solver: solver.remove_task(solver.tasks[0]),
        lambda solver: solver.blend(solver.tasks[0], weight=0.0),
    ],
    ids=[*PROPERTIES, "step", "limits", "copy_to", "copy_from", "add", "remove", "blend"],
)
def test_a_second_thread_gets_an_error_and_leaves_the_first_unharmed(robot, use):
    mechanism, meeting = robot("delta4"), Meeting()
    solver, alone = _pulled(mechanism), _pulled(mechanism)
    solver.barriers = (meeting,)
    expected = [alone.step().q for _ in range(5)]
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(solver.step)
        assert meeting.inside.wait(60)
        try:
            with pytest.raises(CinegenError, match="one thread at a time"):
                use(solver)
        finally:
            meeting.go.set()
        np.testing.assert_array_equal(first.result(60).q, expected[0])
    for q in expected[1:]:  # one after the other, in another thread, is no error
        np.testing.assert_array_equal(solver.step().q, q)


def _set(task, name):
    values = {
        "target": pin.SE3(task.target.rotation, task.target.translation - 0.02), "node": "link1", "axes": "world",
        "offset": np.array([0.0, 0.0, 0.01]), "twist": np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]), "translation": 1,
        "rotation": 3, "weights": [1.0, 0.5, 0.5, 0.0, 0.0, 0.1], "weight": 0.3, "priority": 1,
    }  # fmt: skip
    setattr(task, name, values[name])


@pytest.mark.parametrize(
    "name", [name for name, value in inspect.getmembers(FrameTask) if getattr(value, "fset", None)]
)
def test_what_another_thread_sets_of_a_task_is_whole_in_the_next_tick(robot, name):
    mechanism, meeting = robot("delta4"), Meeting()
    both = []
    for _ in range(2):
        solver = _pulled(mechanism)
        solver.add_task(mechanism.end, translation=1, rotation=0, weight=2.0)
        solver.step()
        both.append(solver)
    solver, alone = both
    expected = [alone.step().q]
    _set(alone.tasks[0], name)
    expected += [alone.step().q for _ in range(3)]
    solver.barriers = (meeting,)
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(solver.step)
        assert meeting.inside.wait(60)
        try:
            _set(solver.tasks[0], name)
        finally:
            meeting.go.set()
        np.testing.assert_array_equal(first.result(60).q, expected[0])
    for q in expected[1:]:
        np.testing.assert_array_equal(solver.step().q, q)


def test_threads_at_once_end_in_errors_not_in_a_crash(robot):
    solver = _pulled(robot("delta4"))
    while not solver.is_compiled:
        solver.step()
    together = threading.Barrier(4)

    def run() -> int:
        together.wait(60)
        refused = 0
        for _ in range(3000):
            try:
                solver.step()
            except CinegenError:
                refused += 1
        return refused

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: run(), range(4)))
    assert solver.mechanism.closure(solver.q) < 1e-10
    assert solver.step().errors[0][0] < 1e-9
