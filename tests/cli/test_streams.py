"""Every command where its standard streams are closed, broken or full: no traceback, and a conventional exit code."""

import contextlib
import io
import json
import os
import shlex
import signal
import stat
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

from cinegen.cli import main
from raff2urdf.command.output import DEFECT, NO_READER, TERMINATED, TRACEBACK, OutputLostError, run, write_at_once

FULL = "standard output can't be written: No space left on device"


def _entry(module):
    """As the installed command starts it."""
    return ["-c", f"import sys; from {module} import main; sys.exit(main())"]


COMMANDS = {
    "cinegen --help": [*_entry("cinegen.cli"), "--help"],
    "raff2urdf": [*_entry("raff2urdf.cli"), "ROBOTS/four_bar.raff"],
}


@pytest.fixture
def start(root, tmp_path):
    """`start("cinegen info", stdout=...)`: the process that has ended."""

    def start(name, closing="", robots=root / "robots", **streams):
        arguments = [word.replace("ROBOTS", str(robots)) for word in COMMANDS[name]]
        command = ["/bin/sh", "-c", f'exec "$@" {closing}', "sh", sys.executable, *arguments]
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams
        environment = os.environ | {"PYTHONPATH": str(root)}
        return subprocess.run(command, cwd=tmp_path, env=environment, text=True, timeout=120, **streams)

    return start


@pytest.fixture
def no_reader():
    """A pipe that nobody reads any more."""
    reading, writing = os.pipe()
    os.close(reading)
    yield writing
    os.close(writing)


def test_a_reader_that_has_gone(start, no_reader):
    done = start("cinegen --help", stdout=no_reader)
    assert (done.returncode, done.stderr) == (NO_READER, "")


def test_standard_output_that_is_full(start, device):
    full = device("full")
    with full.open("wb") as out:
        done = start("raff2urdf", stdout=out)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.endswith(f"{FULL}\n")
    assert stat.S_ISCHR(full.lstat().st_mode)


def test_standard_output_that_is_closed(start):
    done = start("cinegen --help", ">&-")
    assert (done.returncode, done.stderr) == (0, "")


def test_standard_error_that_is_lost_changes_nothing(start, device):
    done = start("raff2urdf", "2>&-")
    assert done.returncode == 0
    assert "four_bar" in done.stdout
    with device("full").open("wb") as full:
        failed = start("raff2urdf", robots="/nowhere", stderr=full)
    assert (failed.returncode, failed.stdout) == (1, "")


# --- a filter --------------------------------------------------------------------------------------------------------


@pytest.fixture
def close(root, monkeypatch, capsys):
    """`close(step, ...)`: exit code, answers and messages of `cinegen close`. Each step is called for what it reads."""

    def run_with(*steps):
        reads = iter(steps)
        stdin = SimpleNamespace(buffer=SimpleNamespace(read1=lambda _: next(reads)()))
        monkeypatch.setattr(sys, "stdin", stdin if steps else None)
        code = main(["close", str(root / "robots/planar_3r.raff")])
        return code, *capsys.readouterr()

    return run_with


def test_closed_standard_input_is_empty(close):
    assert close() == (0, "", "")


def test_what_only_streams_ends_with_its_reader(close, monkeypatch):
    """Though more might be asked: standard input stays open."""

    def leave():
        monkeypatch.setattr(sys.stdout._stream, "write", lambda _: (_ for _ in ()).throw(BrokenPipeError(32, "gone")))
        return b"{}\n"

    code, out, err = close(lambda: b"{}\n", leave)
    assert (code, err) == (NO_READER, "")
    assert json.loads(out)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, TERMINATED), (signal.SIGINT, 0)])
def test_signals_end_a_filter_in_order(close, number, code):
    """While it waits for its second line."""
    exit_code, out, err = close(lambda: b"{}\n", lambda: signal.raise_signal(number))
    assert (exit_code, err) == (code, "")
    assert json.loads(out)


def test_a_command_handles_ctrl_c_after_few_imports(root):
    """Before, Python prints a traceback: when it starts, and imports what every program does."""
    program = "import sys; sys.path.insert(0, sys.argv[1]); import raff2urdf.entry; print(*sys.modules)"
    command = [sys.executable, "-I", "-S", "-c", program, str(root)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert not {"ast", "inspect", "pathlib", "tempfile", "tokenize", "typer"} & set(done.stdout.split())


@pytest.mark.parametrize(("when", "code"), [("while it is imported", -signal.SIGINT), ("before it handles it", 130)])
def test_ctrl_c_at_the_beginning_of_a_command_is_no_traceback(root, tmp_path, when, code):
    interrupt = "signal.raise_signal(signal.SIGINT)"
    text = f"import signal\ndef main():\n {interrupt}\n{interrupt if code < 0 else ''}\n"
    (tmp_path / "some_command.py").write_text(text, encoding="utf-8")
    program = "from raff2urdf import entry; entry._run('some_command')"
    environment = os.environ | {"PYTHONPATH": f"{root}:{tmp_path}"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, "")


def test_an_exception_that_a_library_swallows_is_raised_again(capsys):
    def command():
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        time.sleep(10)

    assert run("thing", command) == 130
    assert capsys.readouterr().err == "thing: stopped\n"


def test_a_file_is_read_from_standard_input_and_written_to_standard_output(root, tmp_path):
    """As it is typed: one command's file is the other's."""
    convert, report = (shlex.join([sys.executable, *_entry(name)]) for name in ("raff2urdf.cli", "cinegen.cli"))
    pipe = f"cat planar_3r.raff | {convert} - -o - | {report} info - --json"
    environment = os.environ | {"PYTHONPATH": str(root)}
    done = subprocess.run(
        ["/bin/sh", "-c", pipe], cwd=root / "robots", env=environment, capture_output=True, text=True, timeout=120
    )
    assert "robot 'arm': 3 links" in done.stderr  # what is said of a file on standard output
    (answer,) = json.loads(done.stdout)
    assert (answer["name"], answer["robot"], len(answer["joints"])) == ("stdin", "arm", 3)


# --- the streams -----------------------------------------------------------------------------------------------------


def test_characters_that_an_encoding_lacks_are_escaped(monkeypatch):
    """The terminal's, or bytes of a file's name that are no UTF-8."""
    for encoding, shown in (("ascii", b"4 \\xb1 1 \\udcff\n"), ("utf-8", b"4 \xc2\xb1 1 \\udcff\n")):
        out = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
        monkeypatch.setattr(sys, "stdout", out)
        assert run("thing", lambda: print("4 ± 1 \udcff") or 0) == 0
        assert out.buffer.getvalue() == shown


def test_a_stream_that_fails_is_left_alone_after_that(monkeypatch):
    class Full(io.StringIO):
        tried = 0

        def write(self, text):
            Full.tried += 1
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(sys, "stdout", Full())
    said = io.StringIO()
    monkeypatch.setattr(sys, "stderr", said)

    def command():
        print("one")
        print("two")
        with pytest.raises(OutputLostError):
            write_at_once("three")
        return 0

    assert run("thing", command) == 1
    assert Full.tried == 1
    assert said.getvalue() == f"thing: {FULL}\n"


def test_other_errors_are_not_taken_for_those_of_the_streams(capsys):
    def command():
        raise BrokenPipeError(32, "of something else")

    assert run("thing", command) == 1
    assert capsys.readouterr().err == "thing: of something else\n"


# --- errors that no command reports itself ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (MemoryError(), 1, "thing: out of memory: "),
        (OSError(24, "Too many open files"), 1, "thing: Too many open files"),
        (OSError(28, "No space left on device", "a/b"), 1, "thing: a/b: No space left on device"),
        (ValueError("jont1\n2"), DEFECT, "thing: internal error, please report it: ValueError: jont1 2 (output.py:"),
    ],
)
def test_an_unexpected_error_is_one_line(capsys, monkeypatch, error, code, says):
    def command():
        raise error

    monkeypatch.delenv(TRACEBACK, raising=False)
    assert run("thing", command) == code
    said = capsys.readouterr().err
    assert said.startswith(says)
    assert said.count("\n") == 1
    monkeypatch.setenv(TRACEBACK, "1")
    with pytest.raises(type(error)):
        run("thing", command)


@pytest.mark.parametrize(
    ("limit", "words", "says"),
    [
        ("-f 0", "drive robots/four_bar.raff --snapshot page.html", "can't be written: File too large"),
        ("-v 500000", "info robots/planar_3r.raff", "cinegen: out of memory"),
    ],
)
def test_limits_of_the_system_are_reported_in_a_line(root, tmp_path, limit, words, says):
    words = words.replace("robots/", f"{root}/robots/")
    done = subprocess.run(
        ["/bin/sh", "-c", f"ulimit {limit}; exec {sys.executable} -m cinegen {words}"],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(root)}, stdin=subprocess.DEVNULL, capture_output=True,
        text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 1
    assert says in done.stderr.splitlines()[-1]
    assert "Traceback" not in done.stderr
