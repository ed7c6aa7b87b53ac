"""Exceptions of objectives and barriers: the loop goes on, the step has them, the log has each of them once."""

import gc
import inspect
import logging
import threading
import traceback
import weakref
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from test_barriers import Barrier, Objective
from ticking import pull

import cinegen
from cinegen import CinegenError, FrameTask, Solver, Status
from cinegen.ik import LookAhead, Posture
from cinegen.ik.barrier import Bounds

DT = 0.01


def fails(state):
    raise ValueError("the objective is wrong")


def records(caplog):
    return [record for record in caplog.records if record.name == "cinegen" and record.levelno == logging.ERROR]


def dragged(mechanism, objectives=(), barriers=()):
    """A solver whose last node is led to and fro, and the function that makes a tick of it."""
    solver = Solver(mechanism, DT)
    task = solver.add_task(mechanism.nodes[-1], rotation=0, axes="world")
    solver.objectives, solver.barriers = objectives, barriers
    home, count = task.target.copy(), 0

    def tick():
        nonlocal count
        count += 1
        way = 0.02 * mechanism.length * np.array([np.sin(0.1 * count), 0.0, np.cos(0.1 * count) - 1.0])
        task.target = pin.SE3(home.rotation, home.translation + way)
        step = solver.step()
        assert step.closure <= 1e-10
        return step

    return solver, tick


def test_objectives_that_raise_are_in_each_step_and_once_in_the_log(robot, caplog):
    mechanism = robot("delta4")
    good, expected = dragged(mechanism, [Posture()])
    _, tick = dragged(mechanism, [Objective(fails), Posture(), Objective(fails)])
    for _ in range(10):
        step = tick()
        assert (step.q == expected().q).all()  # as without those objectives
        assert [type(error) for error in step.exceptions] == [ValueError] * 2
        assert all(error.__traceback__ is not None for error in step.exceptions)
        assert step.failed_objectives == (0, 2)
        assert step.status is Status.FOLLOWING
    assert not good.exception_log.messages
    for number, record in zip((0, 2), records(caplog), strict=True):
        text = f"objective {number} (Objective) of {mechanism.name}: ValueError: the objective is wrong"
        assert text in record.getMessage()
    assert caplog.text.count("Traceback (most recent call last)") == 2
    assert 'raise ValueError("the objective is wrong")' in caplog.text
    assert "in velocity" in caplog.text


def test_an_objective_that_raises_sometimes_is_used_in_all_other_ticks(robot, caplog):
    mechanism = robot("arm7")
    count = 0

    def sometimes(state):
        nonlocal count
        count += 1
        if count % 3 == 0:
            raise RuntimeError(f"tick {count}")  # another text each time, the same fault
        return 0.1 * mechanism.scale

    solver, tick = dragged(mechanism, [Objective(sometimes)])
    count = 0
    for i in range(1, 31):
        step = tick()
        assert bool(step.exceptions) == (i % 3 == 0) == bool(step.failed_objectives)
    assert len(records(caplog)) == 1
    solver.objectives[0].answer = lambda state: {}["another"]
    assert [type(error) for error in tick().exceptions] == [KeyError]
    assert [record.exc_info[0] for record in records(caplog)] == [RuntimeError, KeyError]
    assert solver.exception_log.messages[0] == f"objective 0 (Objective) of {mechanism.name}: RuntimeError: tick 3"


@pytest.mark.parametrize(("answer", "text"), [
    (lambda nv: np.zeros(nv - 1), "returned shape ({less},): return ({nv},)"),
    (lambda nv: np.zeros((1, nv)), "returned shape (1, {nv}): return ({nv},)"),
    (lambda nv: None, "returned shape (): return ({nv},)"),
    (lambda nv: "fast", "could not convert string to float"),
    (lambda nv: [0.0, 0.0, np.nan] + [0.0] * (nv - 3), "velocity(state)[2] is nan: return finite rad/s and m/s"),
    (lambda nv: [np.inf] * nv, "velocity(state)[0] is inf"),
    (lambda nv: [-1e300] * nv, "velocity(state)[0] is -1e+300"),
], ids=["a column less", "two dimensions", "nothing", "text", "NaN", "infinite", "too fast"])  # fmt: skip
def test_what_an_objective_returns_that_makes_no_sense_is_an_exception_of_the_step(robot, caplog, answer, text):
    mechanism = robot("delta4")
    nv = mechanism.model.nv
    _, expected = dragged(mechanism, [Objective(lambda state: np.zeros(nv))])
    _, tick = dragged(mechanism, [Objective(lambda state: answer(nv))])
    for _ in range(5):
        step = tick()
        (error,) = step.exceptions
        assert type(error) is ValueError
        assert text.format(nv=nv, less=nv - 1) in str(error)
        assert step.failed_objectives == (0,)
        assert (step.q == expected().q).all()
    assert len(records(caplog)) == 1


# --- barriers ------------------------------------------------------------------------------------------------------


NAN, ONE = np.nan, np.array([1.0])
WRONG_BOUNDS = {
    "raises": (lambda nv: fails(None), "the objective is wrong"),
    "nothing": (lambda nv: None, ""),
    "nan in a row": (lambda nv: Bounds(np.full((1, nv), NAN), ONE), ""),
    "a row without end": (lambda nv: Bounds(np.full((1, nv), np.inf), ONE), ""),
    "nan for a bound": (lambda nv: Bounds(np.ones((1, nv)), np.array([NAN])), ""),
    "one column": (lambda nv: Bounds(np.ones((2, 1)), np.ones(2)), "rows (2, 1) and most (2,)"),
    "too few bounds": (lambda nv: Bounds(np.ones((3, nv)), np.ones(2)), ""),
    "a number for bounds": (lambda nv: Bounds(np.ones((1, nv)), 1.0), "most ()"),
    "bounds as a column": (lambda nv: Bounds(np.ones((3, nv)), np.ones((3, 1))), ""),
    "words": (lambda nv: Bounds([["a"] * nv], ["b"]), ""),
}
WRONG_PARTS = {
    "raises": (lambda: fails(None), "the objective is wrong"),
    "nan": (lambda: NAN, "returned nan: return a number from 0 to 1"),
    "negative": (lambda: -0.5, "returned -0.5"),
    "nothing": (lambda: None, ""),
    "several": (lambda: np.zeros(3), ""),
}


@pytest.mark.parametrize("method", ["bounds", "clear"])
def test_a_barrier_that_fails_stops_the_motion_and_is_reported_once(robot, caplog, method):
    mechanism = robot("delta4")
    nv = mechanism.model.nv
    for answer, text in (WRONG_BOUNDS if method == "bounds" else WRONG_PARTS).values():
        caplog.clear()
        answers = {"bounds": lambda state, a=answer: a(nv), "clear": lambda state, q, a=answer: a()}
        bad = Barrier(**{method: answers[method]})
        for barriers in ([Barrier(), bad], [bad, Barrier()]):
            solver, tick = dragged(mechanism, barriers=barriers)
            for _ in range(3):
                step = tick()
                (error,) = step.exceptions
                assert text in str(error)
                assert (step.q == mechanism.q_home).all()
                assert step.status is Status.BARRED
        barred_first, barred_second = records(caplog)[::-1]
        assert f"barrier 1 (Barrier) of {mechanism.name}: " in barred_second.getMessage()
        assert f"barrier 0 (Barrier) of {mechanism.name}: " in barred_first.getMessage()
    solver.barriers = []
    step = tick()
    assert step.exceptions == ()
    assert np.abs(step.v).max() > 1e-3


# --- where it would do harm ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("same", [True, False], ids=["one object", "new objects"])
def test_exceptions_of_past_ticks_take_no_memory(robot, same):
    """Neither are they kept, nor does the traceback of an object that is raised again grow with every tick."""

    class FaultyError(Exception):
        """Can be referred to weakly."""

    alive, fault = weakref.WeakSet(), FaultyError("again")

    def answer(state):
        error = fault if same else FaultyError("anew")
        alive.add(error)
        raise error

    objective = Objective(fails)
    _, tick = dragged(robot("arm7"), [objective], [Barrier()])
    objective.answer = answer
    tick()
    for _ in range(100):
        step = tick()
    gc.collect()
    assert len(alive) <= 2  # the last one, and the one that pytest's log records keep
    frames = [frame.name for frame in traceback.extract_tb(step.exceptions[0].__traceback__)]
    assert frames == ["_evaluate_objectives", "velocity", "answer"]


def test_neither_a_log_handler_that_raises_nor_an_exception_without_text_ends_the_loop(robot):
    class UnprintableError(Exception):
        """Can't be printed."""

        def __str__(self):
            raise RuntimeError("no text")

    class Broken(logging.Handler):
        def emit(self, record):
            raise OSError("the disk is full")

    def answer(state):
        raise UnprintableError

    solver, tick = dragged(robot("arm7"))
    logger, handler = logging.getLogger("cinegen"), Broken()
    logger.addHandler(handler)
    try:
        solver.objectives = [Objective(answer)]
        for _ in range(3):
            assert type(tick().exceptions[0]) is UnprintableError
    finally:
        logger.removeHandler(handler)
    assert len(solver.exception_log.messages) == 1


def test_interrupts_are_not_caught(robot):
    def interrupted(state):
        raise KeyboardInterrupt

    solver, tick = dragged(robot("arm7"))
    objective = Objective(lambda state: np.zeros(7))
    solver.objectives = [objective]
    objective.answer = interrupted
    with pytest.raises(KeyboardInterrupt):
        tick()


def test_a_forecast_reports_nothing_twice(robot, caplog):
    solver, tick = dragged(robot("arm7"), [Objective(fails)])
    tick()
    cinegen.forecast_motion(solver, 0.1)
    assert len(records(caplog)) == 1


def test_an_exception_of_the_package_is_refused_as_before(robot, caplog):
    def unfit(state):
        raise cinegen.CinegenError("does not fit")

    with pytest.raises(cinegen.CinegenError, match="does not fit"):
        dragged(robot("arm7"), [Objective(unfit)])
    assert not records(caplog)


# --- threads ----------------------------------------------------------------------------------------------------------
# One solver in several threads: the second is refused, the first goes on as if it were alone.


TICK = 1.0 / 240.0


class Meeting(Barrier):
    """Barrier without bounds, in which a tick waits until another thread has tried to use the solver."""

    def __init__(self):
        super().__init__()
        self.inside, self.go = threading.Event(), threading.Event()

    def bounds(self, state):
        self.inside.set()
        assert self.go.wait(60)
        return super().bounds(state)


def _pulled(mechanism):
    solver = Solver(mechanism, TICK)
    pull(solver, mechanism.end, [0.0, 0.01, -0.01], rotation=0)
    return solver


@contextmanager
def during_a_step(solver, expected):
    """While another thread is in a tick of the solver, which ends as expected."""
    meeting = Meeting()
    solver.barriers = (meeting,)
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(solver.step)
        assert meeting.inside.wait(60)
        try:
            yield
        finally:
            meeting.go.set()
        np.testing.assert_array_equal(first.result(60).q, expected)


VALUES = {
    "q": lambda solver: solver.mechanism.q_home, "objectives": lambda _: (), "barriers": lambda _: (),
    "position_limits": lambda _: None, "dt": lambda _: 2.0 * TICK, "keep_branch": lambda _: True,
    "keeps_linearisation": lambda _: True,
}  # fmt: skip
"""What is set; 0.1 unless named."""
PROPERTIES = [name for name, value in inspect.getmembers(Solver) if getattr(value, "fset", None)]


@pytest.mark.parametrize("use", [
    *(
        partial(lambda name, solver: setattr(solver, name, VALUES.get(name, lambda _: 0.1)(solver)), name)
        for name in PROPERTIES
    ),
    lambda solver: solver.step(),
    lambda solver: solver.lift_limits(position=True),
    lambda solver: solver.copy_state(Solver(solver.mechanism, TICK)),
    lambda solver: LookAhead(solver.mechanism, TICK).copy(solver),
    lambda solver: solver.add_task(solver.mechanism.end),
    lambda solver: solver.remove_task(solver.tasks[0]),
    lambda solver: solver.blend(solver.tasks[0], weight=0.0),
], ids=[*PROPERTIES, "step", "limits", "copy_to", "copy_from", "add", "remove", "blend"])  # fmt: skip
def test_a_second_thread_gets_an_error_and_leaves_the_first_unharmed(robot, use):
    mechanism = robot("delta4")
    solver, alone = _pulled(mechanism), _pulled(mechanism)
    expected = [alone.step().q for _ in range(5)]
    with during_a_step(solver, expected[0]), pytest.raises(CinegenError, match="one thread at a time"):
        use(solver)
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
    mechanism, both = robot("delta4"), []
    for _ in range(2):
        solver = _pulled(mechanism)
        solver.add_task(mechanism.end, translation=1, rotation=0, weight=2.0)
        solver.step()
        both.append(solver)
    solver, alone = both
    expected = [alone.step().q]
    _set(alone.tasks[0], name)
    expected += [alone.step().q for _ in range(3)]
    with during_a_step(solver, expected[0]):
        _set(solver.tasks[0], name)
    for q in expected[1:]:
        np.testing.assert_array_equal(solver.step().q, q)
