"""What all tests share: the robots of the repository, each loaded once; and how many examples laws are tried on.

`CINEGEN_EXAMPLES=3 pytest ...` tries three times as many as a test says, for a night; a quarter as many are tried where
nobody says, so that all tests together stay within minutes.
"""

import contextlib
import gc
import os
import signal
import stat
import sys
import threading
from pathlib import Path

import pytest
from hypothesis import HealthCheck, is_hypothesis_test, settings
from leftovers import Snapshot, left_since
from repository import load as load_robot

import cinegen
from cinegen.cli import main

ROOT = Path(__file__).resolve().parent.parent

# On a busy machine making examples may take long: that is no failure.
settings.register_profile("cinegen", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("cinegen")

# Tests that a shell starts in the background ignore Ctrl-C, and so would the commands that they interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Each of the hundreds of commands that tests start would compile all sources again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

EXAMPLES = float(os.environ.get("CINEGEN_EXAMPLES", "0.25"))


def pytest_configure(config):
    """Give each of several workers, and the commands that it starts, one thread of BLAS: there is a core for each."""
    if config.getoption("numprocesses", None):
        for library in ("OPENBLAS", "OMP"):
            os.environ.setdefault(f"{library}_NUM_THREADS", "1")


def pytest_collection_finish():
    """Leave modules and tests out of later collections of garbage, and collect less often: that took a tenth of all."""
    gc.set_threshold(100_000, 20, 100)
    gc.collect()
    gc.freeze()


NO_PORT = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")
"""Robots of the repository name a port for their sensor, which is not there."""


def pytest_collection_modifyitems(items):
    for item in items:
        if item.path.parent.name in ("browser", "cockpit", "devices", "session"):
            item.add_marker(NO_PORT, append=False)  # what a test says of its own comes later, and wins
    for function in {item.obj.__func__ if hasattr(item.obj, "__func__") else item.obj for item in _laws(items)}:
        current = getattr(function, "_hypothesis_internal_use_settings", None) or settings.default
        count = max(3, round(EXAMPLES * current.max_examples))
        function._hypothesis_internal_use_settings = settings(current, max_examples=count)


def _laws(items):
    return [item for item in items if is_hypothesis_test(getattr(item, "obj", None))]


TIDY = ("cli", "cockpit", "devices", "realtime", "session")
"""Folders whose tests leave nothing behind."""


@pytest.fixture(autouse=True)
def nothing_is_left(request):
    """Fail a test that leaves threads, processes or changed settings; a module's fixtures may keep theirs."""
    if request.path.parent.name not in TIDY:
        yield
        return
    before = Snapshot.take()
    yield
    left = left_since(before)
    assert not left, f"left behind: {'; '.join(left)}"


@pytest.fixture
def typed(capsys):
    """`typed("info", path, code=1)`: what `cinegen` prints (`.out`, `.err`), with this exit code."""

    def command(*words, code=0):
        capsys.readouterr()
        assert main([*map(str, words)]) == code
        return capsys.readouterr()

    return command


@pytest.fixture
def closing():
    """`closing(session)`: the session, which is closed when the test ends."""
    with contextlib.ExitStack() as ends:
        yield lambda session: ends.enter_context(contextlib.closing(session))


@pytest.fixture(scope="session")
def robot():
    """`robot("delta4")`: a mechanism of the repository."""
    return load_robot


@pytest.fixture
def cockpit(robot, closing):
    """`cockpit("delta4", token="")`: the session of robots, or of a setup, served on a free port. It runs in a thread;
    a process of its own takes two seconds of CPU to start."""
    from cinegen.cockpit import Cockpit
    from cinegen.session import arrange

    def open_cockpit(*names, setup=None, **options):
        names_of_own = ("host", "port", "token", "https", "files", "own_process")
        of_cockpit = {name: options.pop(name) for name in names_of_own if name in options}
        setup = setup or arrange({name: robot(name) for name in names}, **options)
        return closing(Cockpit(setup, **{"port": 0, "own_process": False, **of_cockpit}))

    return open_cockpit


@pytest.fixture(scope="session")
def root() -> Path:
    """The repository."""
    return ROOT


@pytest.fixture
def raff(tmp_path):
    """`raff(text)`: the mechanism of a RAFF text without its first line, which is put in front."""

    def load(body: str, name: str = "mechanism", **options) -> cinegen.Mechanism:
        path = tmp_path / f"{name}.raff"
        path.write_text(f"RAFF {name}\n{body}", encoding="utf-8")
        return cinegen.load(path, **options)

    return load


@pytest.fixture
def text_file(tmp_path):
    """`text_file("arm.urdf", text)`: the path of a file with this text."""

    def write(name: str, text: str) -> Path:
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
        return path

    return write


DEVICES = {"null": (1, 3), "full": (1, 7)}


@pytest.fixture
def device(tmp_path):
    """`device("full")`: a node of its own of a character device. What replaces a node would break the machine's."""

    def make(name: str) -> Path:
        path = tmp_path / f"device {name}"
        try:
            os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(*DEVICES[name]))
            path.open("wb").close()
        except PermissionError:
            pytest.skip("only root may make a device node here")
        return path

    return make


@pytest.fixture
def fifo(tmp_path):
    """`path, read = fifo()`: a FIFO with a reader; `read()` is what came through, when the writer has closed it."""

    def make():
        path, got = tmp_path / "fifo", []
        os.mkfifo(path)
        thread = threading.Thread(target=lambda: got.append(path.read_bytes()), daemon=True)
        thread.start()

        def read() -> bytes:
            thread.join(20)
            return b"".join(got)

        return path, read

    return make
