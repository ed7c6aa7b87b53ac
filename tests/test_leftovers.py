"""A test that leaves something behind is found."""

import subprocess
import sys
import threading

import pytest
from leftovers import SHARED, Snapshot, left_since


@pytest.fixture
def thread():
    """`thread(name)`: one that ends with the test."""
    over, made = threading.Event(), []

    def start(name):
        made.append(threading.Thread(target=over.wait, name=name, daemon=True))
        made[-1].start()

    yield start
    over.set()
    for started in made:
        started.join()


def test_a_thread_is_left_unless_it_ends_or_serves_all_tests(thread):
    before = Snapshot.take()
    thread(f"{SHARED}: a loop")
    threading.Thread(target=lambda: None).start()
    assert left_since(before) == []
    thread("loop")
    assert left_since(before, 0.0) == ["thread 'loop'"]


def test_a_process_is_left_unless_it_ends():
    before = Snapshot.take()
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as process:
        (leftover,) = left_since(before, 0.0)
        assert leftover.startswith(f"process {process.pid}: ")
        process.stdin.close()
        assert left_since(before) == []


def test_settings_are_put_back():
    before = Snapshot.take()
    sys.setswitchinterval(0.001)
    assert left_since(before) == [f"a switch interval of 0.001 s instead of {before.switch_interval} s"]
    assert Snapshot.take() == before
