"""Closing loops quickly is closing loops: `Mechanism.close` beside `raff2urdf.closure.close`, which it stands for."""

import pickle
import threading

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_robots import FLOATING, four_bar, rssr

import cinegen
from raff2urdf import closure

CLOSED = ("delta4", "hybrid")
seeds = st.integers(0, 2**32 - 1)


def by_numpy(mechanism: cinegen.Mechanism, q: np.ndarray, locked: tuple[str, ...]) -> closure.Closing:
    free = np.ones(mechanism.model.nv, dtype=bool)
    for joint in locked:
        free[mechanism.v_index(joint)] = False
    return closure.close(mechanism.structure.system, q, free)


def some_locked(mechanism: cinegen.Mechanism, rng: np.random.Generator) -> tuple[str, ...]:
    """None, all motors, some of them, or any joints."""
    actuated, count = list(mechanism.actuated), int(rng.integers(1, mechanism.mobility + 1))
    choices = [[], actuated, actuated, rng.choice(actuated, min(count, len(actuated)), replace=False)]
    return tuple(map(str, [*choices, rng.choice(mechanism.joints, count, replace=False)][rng.integers(5)]))


@pytest.mark.parametrize("name", CLOSED)
@settings(max_examples=25)
@given(seed=seeds, away=st.sampled_from((1e-6, 1e-3, 0.03, 0.2, 0.6)))
def test_it_is_the_configuration_that_gauss_newton_reaches(robot, name, seed, away):
    mechanism, rng = robot(name), np.random.default_rng(seed)
    locked = some_locked(mechanism, rng)
    for q in mechanism.random_closed(2, seed=seed % 1000):
        start = pin.integrate(mechanism.model, q, away * rng.normal(size=mechanism.model.nv) * mechanism.scale)
        assert_closed_as_by_numpy(mechanism, start, locked)


def assert_closed_as_by_numpy(mechanism, start, locked=("joint1",), within=1e-9):
    expected = by_numpy(mechanism, start, locked)
    if not expected.closed:
        with pytest.raises(cinegen.ClosureError):
            mechanism.close(start, locked)
        return
    before = start.copy()
    closed = mechanism.close(start, locked)
    assert np.array_equal(start, before)
    assert mechanism.closure(closed) <= 1e-12
    assert closed == pytest.approx(expected.q, abs=within)
    held = [mechanism.q_index(joint) for joint in locked]
    assert closed[held].tobytes() == start[held].tobytes()


@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-3])
def test_where_loops_lose_a_rank_too(off):
    """A parallelogram that lies flat."""
    mechanism = cinegen.load(four_bar((20, -20, 20), (200, 500, 500, 200)))
    rng = np.random.default_rng(0)
    for locked in ((), ("joint1",), ("joint1", "joint3")):
        for _ in range(10):
            start = mechanism.configuration({"joint1": off, "joint2": -off, "joint3": off}) + 1e-4 * rng.normal(size=3)
            assert_closed_as_by_numpy(mechanism, start, locked)


def test_the_same_call_gives_the_same_result_whatever_was_called_before(robot):
    """From near, where compiled steps suffice, and from far, where they do not."""
    fresh, rng = pickle.loads(pickle.dumps(robot("hybrid"))), np.random.default_rng(8)
    locked = fresh.actuated

    def ends(start, mechanism=fresh):
        try:
            return mechanism.close(start, locked).tobytes()
        except cinegen.ClosureError as error:
            return str(error)

    starts = [fresh.q_home + size * fresh.scale * rng.normal(size=fresh.model.nv) for size in (1e-3, 0.03, 0.3, 1.0)]
    first = [ends(start) for start in starts]
    for _ in range(3):
        fresh.close(fresh.random_closed(1, seed=4)[0])
        assert [ends(start) for start in reversed(starts)] == first[::-1]
    another = pickle.loads(pickle.dumps(robot("hybrid")))
    assert [ends(start, another) for start in starts[::-1]] == first[::-1]


def test_errors_are_the_same_however_often_it_was_asked(robot):
    bar = robot("four_bar")
    for _ in range(4):
        assert bar.closure(bar.close(bar.q_home, locked="joint1")) <= 1e-12
        assert np.array_equal(bar.close(bar.q_home, bar.joints), bar.q_home)
        assert bar.closure(bar.close(bar.q_home, locked=(joint for joint in ["joint1"]))) <= 1e-12
        with pytest.raises(cinegen.CinegenError, match="no joint 'joint11': did you mean 'joint1'"):
            bar.close(bar.q_home, locked=["joint11"])
        for wrong in (np.full(3, np.nan), np.array([0.0, np.inf, 0.0]), np.zeros(4), np.zeros((1, 3)), 0.5):
            with pytest.raises(cinegen.CinegenError, match="a configuration of"):
                bar.close(wrong, locked=["joint1"])
        says = f"with 3 joints locked: these loops remain open: '{bar.loops[0].name}' by"
        with pytest.raises(cinegen.ClosureError, match=says):
            bar.close(bar.q_home + 0.3, locked=bar.joints)


def test_a_joint_outside_all_loops_that_is_no_number_is_refused(robot):
    hybrid = robot("hybrid")
    moves_loops = hybrid.loop_jacobian(hybrid.q_home).any(axis=0)
    hand = next(joint for joint in reversed(hybrid.joints) if not moves_loops[hybrid.v_index(joint)])
    with pytest.raises(cinegen.CinegenError, match="not finite"):
        hybrid.close(hybrid.configuration({hand: 0.0}) + np.eye(len(hybrid.q_home))[hybrid.q_index(hand)] * np.nan)


def test_a_base_that_can_move_stays_where_it_is():
    mechanism = cinegen.load(four_bar(more=FLOATING[0], after=FLOATING[1]))
    rng = np.random.default_rng(3)
    for _ in range(10):
        away = np.concatenate([rng.normal(size=6), np.zeros(3)])
        q = pin.integrate(mechanism.model, mechanism.q_home, away)
        q[-3:] += rng.uniform(-0.05, 0.05, 3)
        assert np.array_equal(mechanism.close(q, ("joint1",))[:7], q[:7])
        assert_closed_as_by_numpy(mechanism, q, within=1e-12)


def test_threads_and_copies_have_scratch_of_their_own(robot):
    gough = pickle.loads(pickle.dumps(robot("gough")))
    rng = np.random.default_rng(5)
    starts = [q + 1e-3 * rng.normal(size=len(q)) * gough.scale for q in gough.random_closed(4, seed=3)]
    expected = [by_numpy(gough, start, gough.actuated).q for start in starts]
    placed = [gough.placement(start, "platform").homogeneous for start in starts]
    wrong = []

    def work():
        for _ in range(100):
            for start, q, place in zip(starts, expected, placed, strict=True):
                if not np.allclose(gough.close(start, gough.actuated), q, rtol=0.0, atol=1e-9):
                    wrong.append(start)
                if not np.array_equal(gough.placement(start, "platform").homogeneous, place):
                    wrong.append(start)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_many_ways_of_locking_are_forgotten_again(robot):
    delta = robot("delta4")
    for i in range(2**8):
        locked = [joint for k, joint in enumerate(delta.joints[:8]) if i >> k & 1]
        assert delta.closure(delta.close(delta.q_home, locked)) <= 1e-12
    assert len(delta.structure._masks) <= 64


def test_ball_joints_are_closed_as_well():
    mechanism = cinegen.load(rssr())
    rng = np.random.default_rng(0)
    assert (mechanism.model.nq, mechanism.model.nv, mechanism.loop_rank) == (6, 5, 3)
    for _ in range(20):
        start = pin.integrate(mechanism.model, mechanism.q_home, 0.05 * rng.normal(size=5))
        assert_closed_as_by_numpy(mechanism, start)
