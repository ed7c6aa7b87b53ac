"""The clock: deadlines, skipped ticks, errors and records. No test asks how punctual this machine is."""

import contextlib
import gc
import math
import os
import pickle
import signal
import subprocess
import sys
import threading
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from browsers import becomes
from hypothesis import given
from hypothesis import strategies as st
from troubled import trip, troubled

import cinegen
from cinegen.realtime import Clock, ClockError, Tick, scheduling
from cinegen.realtime.channel import LARGEST, Channel, Mailbox
from cinegen.realtime.timing import WIDTH, RecentTiming, TimingRecord

TIMES = st.floats(1e-9, 99.0)


@pytest.fixture
def scene(monkeypatch):
    """A time that passes only when somebody sleeps or works: `scene.now`, `scene.work(s)`, `scene.oversleep` (s)."""
    made = SimpleNamespace(now=100.0, oversleep=0.0)

    def perf_counter():
        made.now += 1e-9
        return made.now

    def sleep(seconds):
        made.now += seconds + made.oversleep
        made.oversleep = 0.0

    def work(seconds):
        made.now += seconds

    made.work = work
    module = SimpleNamespace(perf_counter=perf_counter, monotonic=perf_counter, sleep=sleep)
    for name in ("clock", "timing"):
        monkeypatch.setattr(f"cinegen.realtime.{name}.time", module)
    return made


# --- deadlines -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("period", "seconds", "count"), [(0.1, 0.3, 3), (0.1, 0.0, 0), (0.1, 0.01, 1), (0.07, 0.2, 3)])
def test_seconds_hold_the_deadlines_within_them(scene, period, seconds, count):
    assert [tick.number for tick in Clock(period, spin=0.0).ticks(seconds)] == list(range(count))


def test_nothing_drifts(scene):
    begin, lateness = scene.now, np.random.default_rng(0).uniform(0.0, 0.009, 1000)
    for tick in Clock(0.01, spin=0.0).ticks(10.0):
        assert scene.now == pytest.approx(begin + 0.01 * tick.number + tick.late, abs=1e-6)
        assert 0.0 <= tick.late < 0.0091
        scene.work(0.0005)
        scene.oversleep = lateness[tick.number]
    assert tick.number == 999


def test_a_tick_that_takes_too_long_costs_ticks_and_no_burst_follows(scene):
    clock, begun = Clock(0.01, spin=0.0), []
    for tick in clock.ticks(0.12):
        begun.append((tick.number, tick.skipped, round(tick.late, 6)))
        scene.work({3: 0.035, 8: 0.013}.get(tick.number, 0.001))
    assert begun == [
        (0, 0, 0.0), (1, 0, 0.0), (2, 0, 0.0), (3, 0, 0.0), (6, 2, 0.005), (7, 0, 0.0), (8, 0, 0.0),
        (9, 0, 0.003), (10, 0, 0.0), (11, 0, 0.0),
    ]  # fmt: skip
    report = clock.report()
    assert (report.ticks, report.skipped, report.overruns) == (10, 2, 2)
    assert report.longest == pytest.approx(0.025, abs=1e-6)
    assert report.work.max == pytest.approx(0.035, abs=1e-6)
    assert report.late.max == pytest.approx(0.025, abs=1e-6)
    assert report.busy == pytest.approx((0.035 + 0.013 + 8 * 0.001) / 0.111, rel=1e-4)


def test_a_period_that_a_tick_changes_counts_from_its_deadline(scene):
    clock, begun, begin = Clock(0.01), [], scene.now
    for tick in clock.ticks(0.06):
        begun.append((tick.number, tick.skipped, round(tick.time, 9), round(scene.now - begin, 6)))
        scene.work(0.002)
        if tick.number == 1:
            tick.clock.period = 0.004
        elif tick.number == 4:
            tick.clock.period = 0.02
            scene.work(0.025)
        assert tick.clock.spin <= 0.2 * tick.clock.period
    assert begun == [
        (0, 0, 0.0, 0.0), (1, 0, 0.01, 0.01), (2, 0, 0.014, 0.014), (3, 0, 0.018, 0.018), (4, 0, 0.022, 0.022),
        (5, 0, 0.042, 0.049),
    ]  # fmt: skip
    report = clock.report()
    assert report.period == 0.02
    assert (report.ticks, report.skipped, report.overruns) == (6, 0, 1)
    assert report.mean == pytest.approx(0.049 / 5, rel=1e-5)
    assert report.error.max == pytest.approx(0.007, abs=1e-6)  # of the period that was asked for then


@pytest.mark.parametrize("period", [0.0, -1.0, math.nan, math.inf, 1e-4])
def test_a_period_that_makes_no_sense_is_refused_while_the_loop_runs(scene, period):
    for tick in Clock(0.01, spin=0.001).ticks(0.01):
        with pytest.raises(ClockError, match=r"a clock's (period|spin) must be"):
            tick.clock.period = period
        assert tick.clock.period == 0.01


def test_a_spin_ends_on_the_deadline(scene):
    for tick in Clock(0.01, spin=2e-4).ticks(0.1):
        scene.oversleep = 1.5e-4 if tick.number % 2 else 0.0
        assert tick.late < 1e-7


# --- records ---------------------------------------------------------------------------------------------------------


def _close_above(bound, true):
    """Whether a percentile is reported as promised: not too small, and too large by a bin at most."""
    return true * (1.0 - 1e-12) <= bound <= max(1e-7, true * WIDTH) * (1.0 + 1e-12)


@given(st.lists(st.tuples(TIMES, TIMES), min_size=2, max_size=50), st.floats(1e-4, 1.0))
def test_a_report_is_what_numpy_makes_of_the_list(pairs, period):
    works, rests = np.array(pairs).T
    starts = 1000.0 + np.concatenate([[0.0], np.cumsum(works + rests)[:-1]])
    dues = starts + period
    record = TimingRecord(period)
    for start, work, rest, due in zip(starts, works, rests, dues, strict=True):
        record.begun(start, rest, 0)
        record.ended(start + work, due)
    report = record.report("as it is")
    periods = np.diff(starts)
    errors = np.abs(periods - period)
    works = starts + works - starts  # as rounded
    assert report.ticks == len(pairs)
    assert report.mean == pytest.approx(periods.mean(), rel=1e-9, abs=1e-9)
    assert report.jitter == pytest.approx(periods.std(), rel=1e-6, abs=1e-9)
    assert report.seconds == starts[-1] - starts[0]
    assert report.busy == pytest.approx(works.sum() / max(period, starts[-1] + works[-1] - starts[0]), rel=1e-9)
    for spread, values in ((report.error, errors), (report.late, rests), (report.work, works)):
        assert spread.max == values.max()
        for bound, part in ((spread.p50, 0.5), (spread.p99, 0.99)):
            assert _close_above(bound, float(np.quantile(values, part, method="inverted_cdf"))) or bound == spread.max
    beyond = starts + works - dues
    assert report.overruns == (beyond > 0.0).sum()
    assert report.scheduling == "as it is"


# --- threads ---------------------------------------------------------------------------------------------------------


def test_a_loop_in_the_calling_thread_ends_from_inside_or_is_left():
    clock = Clock(0.001)
    for tick in clock:
        assert tick.clock is clock
        assert clock.running
        if tick.number >= 5:
            clock.stop()
    assert clock.report().ticks >= 2
    for _ in clock:
        break
    assert not clock.running
    assert clock.report().ticks == 1


def test_a_thread_of_its_own_begins_at_once_and_ends_when_told():
    seen = []
    clock = Clock(0.001)
    assert repr(clock) == "<Clock of 1 ms, stopped>"
    with clock:
        assert clock.start(lambda tick: seen.append((tick.number, threading.current_thread().name))) is clock
        assert repr(clock) == "<Clock of 1 ms, running>"
        assert becomes(lambda: len(seen) > 9)
    assert not clock.running
    count = len(seen)
    assert clock.report().ticks == count
    assert {name for _, name in seen} == {"cinegen clock"}
    clock.stop()  # once more does no harm


def test_a_thread_whose_tick_does_not_end_is_told_of():
    begun, go = threading.Event(), threading.Event()
    clock = Clock(0.001).start(lambda tick: begun.set() or go.wait(30.0))
    assert begun.wait(30.0)
    with pytest.raises(ClockError, match=r"longer than 0\.05 s: its thread still runs"):
        clock.stop(timeout=0.05)
    go.set()
    clock.stop()


def test_one_loop_at_a_time():
    with Clock(0.001).start(lambda tick: None) as clock:
        for begin in (clock.ticks, lambda: clock.run(print), lambda: clock.start(print), lambda: clock.spawn(print)):
            with pytest.raises(ClockError, match="running already"):
                begin()
    assert list(clock.ticks(0.0)) == []


@pytest.mark.parametrize(
    "wrong",
    [{"period": 0.0}, {"period": math.nan}, {"spin": -1e-4}, {"spin": 0.002}, {"priority": 100}, {"priority": -1}],
)
def test_what_makes_no_sense_is_refused(wrong):
    with pytest.raises(ClockError, match=next(iter(wrong))):
        Clock(**wrong)
    with pytest.raises(ClockError, match="seconds must be finite"):
        Clock().ticks(-1.0)
    assert issubclass(ClockError, cinegen.CinegenError)


# --- errors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "ask",
    [
        lambda clock: clock.stop(),
        lambda clock: clock.join(),
        lambda clock: clock.state,
        lambda clock: setattr(clock, "command", 1),
        lambda clock: clock.__exit__(None, None, None),
        lambda clock: clock.run(print, 0.0),
    ],
    ids=["stop", "join", "state", "command", "with", "next"],
)
def test_an_error_in_the_thread_is_raised_by_whatever_asks_first_and_once(ask):
    clock = Clock(0.001).start(trip)
    assert becomes(lambda: not clock.running)
    with pytest.raises(RuntimeError, match="tripped") as caught:
        ask(clock)
    assert any(entry.name == "trip" for entry in caught.traceback)
    clock.stop()
    assert clock.join()
    assert clock.report().ticks >= 2


def test_an_error_of_the_block_is_not_covered_by_the_loops(caplog):
    def block():
        with Clock(0.001).start(trip) as clock:
            assert becomes(lambda: not clock.running)
            raise ValueError("in the block")

    with pytest.raises(ValueError, match="in the block") as caught:
        block()
    assert "tripped" in caught.value.__notes__[0]
    (record,) = caplog.records  # with the traceback, which the note has not
    assert record.name == "cinegen"
    assert record.levelname == "ERROR"
    assert "in trip" in caplog.text


UNASKED = """
import time
from cinegen.realtime import Clock

def trip(tick):
    raise RuntimeError("tripped")

clock = Clock(0.001).start(trip)
while clock.running:
    time.sleep(0.01)
"""


def test_an_error_that_nobody_asked_for_is_printed_in_the_end():
    done = subprocess.run([sys.executable, "-c", UNASKED], capture_output=True, text=True, timeout=60, check=True)
    assert "RuntimeError: tripped" in done.stderr
    assert "was not raised before" in done.stderr


# --- what is borrowed is given back ----------------------------------------------------------------------------------


def _borrowed():
    scheduling = (os.sched_getscheduler(0), os.sched_getaffinity(0)) if hasattr(os, "sched_getscheduler") else ()
    return sys.getswitchinterval(), gc.get_freeze_count(), scheduling


def test_what_is_borrowed_is_given_back_however_the_loop_ends():
    before = _borrowed()
    clock = Clock(0.001)
    for _ in clock:
        assert sys.getswitchinterval() < 0.005
        break
    assert _borrowed() == before
    with pytest.raises(RuntimeError):
        clock.run(trip)
    assert _borrowed() == before
    with clock.start(lambda tick: None):
        for _ in Clock(0.001).ticks(0.02):
            pass
        assert sys.getswitchinterval() < 0.005  # the other one still needs it
        assert gc.get_freeze_count() > 0
    assert _borrowed() == before


@pytest.mark.skipif(not hasattr(os, "sched_setscheduler"), reason="this system has no such scheduling")
def test_the_report_says_how_the_loop_was_scheduled(monkeypatch):
    assert Clock().run(lambda tick: None, 0.001).scheduling == "ordinary scheduling"  # unless it is asked for
    asked = []
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1})
    monkeypatch.setattr("cinegen.realtime.scheduling._RESERVED", f"\0cinegen test {os.getpid()} ")
    monkeypatch.setattr(os, "sched_setscheduler", lambda *arguments: asked.append(arguments))
    assert Clock(priority=7).run(lambda tick: None, 0.001).scheduling == "SCHED_FIFO 7"
    thread, policy, _ = asked[0]
    assert (thread, policy & os.SCHED_FIFO) == (0, os.SCHED_FIFO)  # 0 is the calling thread

    def refuse(*arguments):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    scheduling = Clock(priority=7).run(lambda tick: None, 0.001).scheduling
    assert scheduling == "ordinary scheduling (no real time: operation not permitted)"
    monkeypatch.delattr(os, "sched_setscheduler")
    assert "offers no real-time" in Clock(priority=7).run(lambda tick: None, 0.001).scheduling


# --- mailboxes -------------------------------------------------------------------------------------------------------


def test_a_mailbox_holds_the_newest_value_that_is_whole():
    memory = memoryview(bytearray(Mailbox.SIZE))
    mailbox = Mailbox(memory)
    assert mailbox.read() is None
    mailbox.write("first", "value")
    assert mailbox.read() == "first"
    mailbox.write("second", "value")
    slot = bytes(memory).index(b"second")
    memory[slot] ^= 1
    assert mailbox.read() == "first"
    memory[slot] ^= 1
    assert mailbox.read() == "second"
    assert mailbox.read() is mailbox.read()


@pytest.mark.parametrize(
    "array",
    [
        np.zeros(0), np.zeros((0, 3)), np.array(3.0), np.asfortranarray(np.eye(3, 4)), np.eye(4)[::2, ::-1],
        np.array([True, False]), np.arange(3, dtype=">i4"), np.array([1j]), np.array(["a", "bc"]), np.array([None]),
    ],
    ids=lambda array: f"{array.dtype}-{array.shape}",
)  # fmt: skip
def test_arrays_arrive_as_they_were(array):
    channel = Channel.shared(0.001)
    channel.state.write({"array": array}, "state")
    received = channel.state.read()["array"]
    np.testing.assert_array_equal(received, array)
    assert (received.dtype, received.flags.writeable) == (array.dtype, True)


def test_what_arrives_costs_no_memory():
    """Pinocchio's objects are made of arrays again: eigenpy never frees the type of an array that has its own."""
    channel, placement, used = Channel.shared(0.001), pin.SE3.Random(), []
    tracemalloc.start()
    try:
        for i in range(4100):
            channel.state.write(placement, "state")
            received = channel.state.read()
            if i in (100, 4099):
                gc.collect()
                used.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert received == placement
    assert used[1] < used[0] + 40_000  # 516,000 bytes if each message costs the type of its arrays


def test_what_cant_be_sent_is_said():
    channel = Channel.shared(0.001)
    with pytest.raises(ClockError, match=rf"a state has \d+ bytes when pickled: at most {LARGEST} can be sent"):
        channel.state.write(np.zeros(LARGEST), "state")
    with pytest.raises(ClockError, match="a command for another process must be picklable, function is not"):
        channel.command.write(lambda: None, "command")
    assert channel.state.read() is None
    half = LARGEST // 2
    largest = bytes(LARGEST + half - len(pickle.dumps(bytes(half), pickle.HIGHEST_PROTOCOL)))
    channel.state.write(largest, "state")
    assert channel.state.read() == largest


# --- processes -------------------------------------------------------------------------------------------------------


def follower(mechanism, period):
    """Made in the clock's process: a robot whose end follows the command, an offset from home in m."""
    solver = cinegen.Solver(mechanism, period)
    hand = solver.add_task(mechanism.end, rotation=0)
    home = hand.target.copy()
    solver.step()  # what is made at first use is made before the clock runs

    def step(tick: Tick):
        if tick.command is not None:
            hand.target = pin.SE3(home.rotation, home.translation + tick.command)
        step = solver.step()
        return {"process": os.getpid(), "q": step.q, "closure": step.closure, "number": tick.number}

    return step


def test_a_robot_moves_in_a_process_of_its_own_which_ignores_the_interrupt_that_its_parent_gets_too(robot):
    delta = robot("delta4")
    home = delta.placement(delta.q_home, delta.end).translation
    offset = np.array([0.02, -0.01, 0.03])
    with Clock(0.002).spawn(follower, delta, 0.002) as clock:
        assert becomes(lambda: clock.state is not None)
        assert clock.state["process"] != os.getpid()
        before = clock.state["number"]
        clock.command = offset

        def left():
            return np.linalg.norm(delta.placement(clock.state["q"], delta.end).translation - home - offset)

        assert becomes(lambda: left() < 1e-6)
        state = clock.state
        assert state["number"] > before
        assert state["closure"] <= 1e-10
        assert delta.closure(state["q"]) <= 1e-10
        assert clock.report().ticks > 0
        os.kill(state["process"], signal.SIGINT)  # Ctrl-C reaches all processes of a terminal; the parent decides
        assert becomes(lambda: clock.state["number"] > state["number"] + 50)
        assert clock.running
    assert not clock.running
    report = clock.report()
    assert report.ticks + report.skipped > state["number"]
    assert report.scheduling
    assert clock.state["number"] >= state["number"]  # the last one stays


def test_a_process_ends_from_inside_or_after_its_time():
    clock = Clock(0.001).spawn(troubled, "stop")
    assert clock.join(60.0)
    assert clock.state >= 10
    clock.spawn(troubled, "none", seconds=0.05)
    assert clock.join(60.0)
    report = clock.report()
    assert report.ticks + report.skipped == 50
    assert clock.state == 49


@pytest.mark.parametrize(
    ("kind", "error", "words"),
    [
        ("raise", RuntimeError, "tripped"),
        ("unsendable", ClockError, "UnsendableError in a clock's process: one"),
        ("exit", ClockError, "exit code 3"),
    ],
)
def test_whatever_ends_a_process_is_raised_with_its_traceback(kind, error, words):
    clock = Clock(0.001).spawn(troubled, kind)
    with pytest.raises(error, match=words) as caught:
        clock.join(60.0)
    assert kind != "raise" or "in trip" in caught.value.__notes__[0]
    assert not clock.running


def test_what_the_factory_raises_is_raised_at_once():
    clock = Clock()
    with pytest.raises(RuntimeError, match="not made"):
        clock.spawn(troubled, "factory")
    assert not clock.running
    with pytest.raises(ClockError, match="function at the top level"):
        clock.spawn(lambda: print)
    assert not clock.running


def test_a_process_that_does_not_end_is_ended(tmp_path):
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    clock = Clock(0.001).spawn(troubled, "hang", str(fifo))
    fifo.read_text()  # until the tick has begun: stopped before that, the loop would end by itself
    with pytest.raises(ClockError, match="ended by force"):
        clock.stop(timeout=0.2)
    assert not clock.running
    clock.stop()


# --- at rest ----------------------------------------------------------------------------------------------------------


def test_deadlines_at_rest_are_neither_late_nor_skipped(scene):
    clock, times, resting = Clock(0.01, spin=0.0), [], []

    def wait():
        scene.work(0.2)
        resting.append(clock.report())

    for tick in clock.ticks(1.0):
        times.append(tick.time)
        if len(times) == 5:
            clock.rest(wait)
        if len(times) == 10:
            clock.stop()
    report = clock.report()
    assert times[5] - times[4] == pytest.approx(0.2, abs=0.011)
    assert (report.ticks, report.skipped, report.overruns) == (10, 0, 0)
    assert (resting[0].resting, resting[0].pending) == (True, 0)


def test_a_present_stall_is_seen_while_it_lasts(scene):
    clock, recent = Clock(0.001, spin=0.0), RecentTiming()
    for tick in clock.ticks(0.05):
        if tick.number == 20:
            recent.add(clock.report())
            scene.work(1.2)
            report = clock.report()
            rate, missed = recent.add(report)
            assert report.pending == pytest.approx(1199, abs=1)
            assert missed == pytest.approx(999, abs=1)  # of the last second
            assert rate < 100.0
            scene.work(1.1)
            assert recent.add(clock.report())[0] == 0.0  # not the mean since the start


@pytest.mark.skipif(sys.platform != "linux", reason="real-time loops are counted on Linux")
def test_a_core_remains_for_other_programs(monkeypatch):
    """Of three loops on three cores, two are in real time; one on its only core is not."""
    monkeypatch.setattr(os, "sched_setscheduler", lambda *_: None)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2})
    monkeypatch.setattr(scheduling, "_RESERVED", f"\0cinegen test {os.getpid()} ")
    with contextlib.ExitStack() as loops:
        policies = [loops.enter_context(scheduling.scheduled(7)) for _ in range(3)]
    none = "ordinary scheduling (no real time: one of {} cores must remain for other programs)"
    assert policies == ["SCHED_FIFO 7", "SCHED_FIFO 7", none.format(3)]
    with scheduling.scheduled(7) as again:
        assert again == "SCHED_FIFO 7"
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0})
    with scheduling.scheduled(7) as only:
        assert only == none.format(1)
