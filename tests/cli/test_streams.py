"""Every command where its standard streams are closed, broken or full: no traceback, and a conventional exit code."""

from __future__ import annotations

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

import pytest
from variants import slow

import raff2urdf.cli
from raff2urdf.output import DEFECT, NO_READER, TERMINATED, TRACEBACK, OutputLostError, run, write_at_once

FULL = "standard output can't be written: No space left on device"


def _entry(module):
    """As the installed command starts it."""
    return ["-c", f"import sys; from {module} import main; sys.exit(main())"]


COMMANDS = {
    "cinegen info": [*_entry("cinegen.cli"), "info", "ROBOTS/four_bar.raff"],
    "cinegen --help": [*_entry("cinegen.cli"), "--help"],
    "python -m cinegen": ["-m", "cinegen", "--version"],
    "cinegen close": [*_entry("cinegen.cli"), "close", "ROBOTS/planar_3r.raff"],
    "raff2urdf": [*_entry("raff2urdf.cli"), "ROBOTS/four_bar.raff"],
    "raff2urdf --help": [*_entry("raff2urdf.cli"), "--help"],
    "python -m raff2urdf": ["-m", "raff2urdf", "ROBOTS/four_bar.raff", "--check", "--json"],
    "urdf2raff": [*_entry("raff2urdf.urdf2raff.cli"), "arm.urdf", "-o", "arm.raff"],
    "python -m raff2urdf.urdf2raff": ["-m", "raff2urdf.urdf2raff", "--help"],
}


ONE_OF_EACH = ("cinegen --help", "cinegen close", "raff2urdf")
every_command = pytest.mark.parametrize(
    "name", [*ONE_OF_EACH, *slow(*(name for name in COMMANDS if name not in ONE_OF_EACH))]
)


@pytest.fixture
def start(root, robot, tmp_path):
    """`start("cinegen info", stdout=...)`: the process that has ended."""

    def start(name, closing="", robots=root / "robots", **streams):
        (tmp_path / "arm.urdf").write_text(robot("planar_3r").source.urdf)
        arguments = [word.replace("ROBOTS", str(robots)) for word in COMMANDS[name]]
        command = ["/bin/sh", "-c", f'exec "$@" {closing}', "sh", sys.executable, *arguments]
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams
        given = {} if "stdin" in streams else {"input": '{"joint1": 0.1}\n'}
        environment = os.environ | {"PYTHONPATH": str(root)}
        return subprocess.run(command, cwd=tmp_path, env=environment, text=True, timeout=120, **given, **streams)

    return start


@pytest.fixture
def no_reader():
    """A pipe that nobody reads any more."""
    reading, writing = os.pipe()
    os.close(reading)
    yield writing
    os.close(writing)


@every_command
def test_a_reader_that_has_gone(start, no_reader, name):
    done = start(name, stdout=no_reader)
    assert (done.returncode, done.stderr) == (NO_READER, "")


@every_command
def test_standard_output_that_is_full(start, device, name):
    full = device("full")
    with full.open("wb") as out:
        done = start(name, stdout=out)
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.endswith(f"{FULL}\n")
    assert stat.S_ISCHR(full.lstat().st_mode)


@every_command
def test_standard_output_that_is_closed(start, name):
    done = start(name, ">&-")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("name", ["cinegen --help", "urdf2raff"])
def test_all_streams_closed(start, name):
    assert start(name, "<&- >&- 2>&-").returncode == 0


@pytest.mark.parametrize(
    ("name", "how"), [("cinegen info", "closed"), ("raff2urdf", "full"), *slow(("raff2urdf", "no reader"))]
)
def test_standard_error_that_is_lost_changes_nothing(start, device, no_reader, name, how):
    closing = "2>&-" if how == "closed" else ""
    with device("full").open("wb") as full:
        streams = {"closed": {}, "full": {"stderr": full}, "no reader": {"stderr": no_reader}}[how]
        done = start(name, closing, **streams)
        assert done.returncode == 0
        assert "four_bar" in done.stdout
        failed = start(name, closing, robots="/nowhere", **streams)
        assert (failed.returncode, failed.stdout) == (1, "")


def test_closed_standard_input_is_empty(start):
    done = start("cinegen close", "<&-")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_files_are_written_though_nobody_reads_what_is_said(root, no_reader, tmp_path):
    for name in "abc":
        (tmp_path / f"{name}.raff").write_text((root / "robots/four_bar.raff").read_text())
    command = [sys.executable, "-u", "-m", "raff2urdf", *(f"{name}.raff" for name in "abc"), "-o", "out/"]
    environment = os.environ | {"PYTHONPATH": str(root)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, stdout=no_reader, stderr=subprocess.PIPE, timeout=120)
    assert (done.returncode, done.stderr) == (NO_READER, b"")
    assert sorted(path.name for path in (tmp_path / "out").glob("*.urdf")) == [f"{name}.urdf" for name in "abc"]


@pytest.mark.slow
def test_a_recording_is_written_though_nobody_reads_what_is_said(root, no_reader, tmp_path):
    command = [sys.executable, "-m", "cinegen", "plan", str(root / "robots/scenes/disc.toml"), "-o", "way.jsonl"]
    environment = os.environ | {"PYTHONPATH": str(root)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, stdout=no_reader, stderr=subprocess.PIPE, timeout=120)
    assert (done.returncode, done.stderr) == (NO_READER, b"")
    assert len((tmp_path / "way.jsonl").read_text().splitlines()) > 10


@pytest.mark.slow
def test_a_recording_whose_reader_has_gone_ends_as_if_by_the_signal(root, no_reader, tmp_path):
    command = [sys.executable, "-m", "cinegen", "plan", str(root / "robots/scenes/disc.toml"), "-o", "-"]
    environment = os.environ | {"PYTHONPATH": str(root)}
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, stdout=no_reader, stderr=subprocess.PIPE, text=True, timeout=120
    )
    assert done.returncode == NO_READER
    assert "can't be written" not in done.stderr


@pytest.mark.slow
def test_what_only_streams_ends_with_its_reader(root, tmp_path):
    """Though more might be asked: standard input stays open."""
    command = [sys.executable, "-m", "cinegen", "close", str(root / "robots/planar_3r.raff")]
    environment = os.environ | {"PYTHONPATH": str(root)}
    with subprocess.Popen(
        command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        process.stdin.write("{}\n")
        process.stdin.flush()
        assert json.loads(process.stdout.readline())
        process.stdout.close()
        process.stdin.write("{}\n")
        process.stdin.flush()
        assert process.wait(30) == NO_READER
        assert process.stderr.read() == ""


def test_the_exit_code_of_a_command_that_fails_is_its_own(root, no_reader, tmp_path):
    command = [sys.executable, "-m", "raff2urdf", str(root / "robots/four_bar.raff"), "none.raff", "--json"]
    environment = os.environ | {"PYTHONPATH": str(root)}
    done = subprocess.run(command, cwd=tmp_path, env=environment, stdout=no_reader, stderr=subprocess.PIPE, timeout=120)
    assert done.returncode == 1
    assert b"none.raff: can't be read" in done.stderr
    assert b"Traceback" not in done.stderr


def test_a_wrong_call_ends_with_2(capsys):
    assert raff2urdf.cli.main(["--nonsense"]) == 2
    assert capsys.readouterr().err == "raff2urdf: unknown option '--nonsense'\nTry 'raff2urdf --help'.\n"


@pytest.fixture
def waiting(root):
    """`waiting(signal)`: exit code and messages of a command that gets a signal while it waits for input."""

    def end(number):
        command = [sys.executable, "-m", "cinegen", "close", str(root / "robots/planar_3r.raff")]
        environment = os.environ | {"PYTHONPATH": str(root)}
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        with subprocess.Popen(command, env=environment, text=True, **pipes) as process:
            process.stdin.write("{}\n")
            process.stdin.flush()
            assert json.loads(process.stdout.readline())
            process.send_signal(number)
            return process.wait(30), process.stderr.read()

    return end


def test_sigterm_ends_a_command_in_order(waiting):
    assert waiting(signal.SIGTERM) == (TERMINATED, "")


@pytest.mark.slow
def test_ctrl_c_ends_a_filter(waiting):
    assert waiting(signal.SIGINT) == (0, "")


@pytest.mark.parametrize("seconds", [0.15, 0.8, *slow(0.4, 1.4)])
def test_ctrl_c_while_a_command_starts_is_no_traceback(root, seconds):
    command = [sys.executable, "-c", "from raff2urdf.entry import cinegen; print(flush=True); cinegen()"]
    environment = os.environ | {"PYTHONPATH": str(root)}
    with subprocess.Popen(
        [*command, "close", str(root / "robots/planar_3r.raff")],
        env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        process.stdout.readline()
        time.sleep(seconds)
        process.send_signal(signal.SIGINT)
        assert process.wait(30) in (-signal.SIGINT, 130, 0)
        assert "Traceback" not in process.stderr.read()


def test_a_command_handles_ctrl_c_after_few_imports(root):
    """Before, Python prints a traceback: when it starts, and imports what every program does."""
    program = "import sys; sys.path.insert(0, sys.argv[1]); import raff2urdf.entry; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", program, str(root)], capture_output=True, text=True, check=True
    )
    assert not {"ast", "inspect", "pathlib", "tempfile", "tokenize", "typer"} & set(done.stdout.split())


@pytest.mark.parametrize(("when", "code"), [("while it is imported", -signal.SIGINT), ("before it handles it", 130)])
def test_ctrl_c_at_the_beginning_of_a_command_is_no_traceback(root, tmp_path, when, code):
    interrupt = "signal.raise_signal(signal.SIGINT)"
    (tmp_path / "some_command.py").write_text(
        f"import signal\ndef main():\n {interrupt}\n{interrupt if code < 0 else ''}\n", encoding="utf-8"
    )
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
    entry = "import sys; from {} import main; sys.exit(main())"
    names = "raff2urdf.cli", "cinegen.cli"
    convert, report = (shlex.join([sys.executable, "-c", entry.format(name)]) for name in names)
    pipe = f"cat planar_3r.raff | {convert} - -o - | {report} info - --json"
    environment = os.environ | {"PYTHONPATH": str(root)}
    done = subprocess.run(
        ["/bin/sh", "-c", pipe], cwd=root / "robots", env=environment, capture_output=True, text=True, timeout=120
    )
    assert "robot 'arm': 3 links" in done.stderr  # what is said of a file on standard output
    (found,) = json.loads(done.stdout)
    assert (found["name"], found["robot"], len(found["joints"])) == ("stdin", "arm", 3)


def test_ctrl_c_is_no_traceback(capsys):
    def stopped():
        raise KeyboardInterrupt

    assert run("thing", stopped) == 130
    assert capsys.readouterr().err == "thing: stopped\n"


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
        *slow(("-f 0", "drive robots/planar_3r.raff --seconds 0.2 --no-browser", "cinegen: File too large")),
        ("-f 0", "map robots/planar_3r.raff --over x,y --grid 3 --workers 1 -o m", "can't be written: File too large"),
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
