"""The command `cinegen`, as typed."""

from __future__ import annotations

import io
import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
import urllib.request
from itertools import product

import pytest
import typer
from variants import slow

import cinegen
from cinegen.cli import app, main


def _cinegen(*arguments, cwd, **options):
    command = [sys.executable, "-m", "cinegen", *map(str, arguments)]
    return subprocess.run(
        command, cwd=cwd, capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=120, **options
    )


@pytest.fixture
def here(tmp_path, monkeypatch, capsys):
    """`here("info", ...)`: exit code, standard output and standard error, without a process of its own."""
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: (main(list(map(str, arguments))), *capsys.readouterr())


def test_info_says_what_a_mechanism_is(root, here):
    code, said, _ = here("info", root / "robots/delta4.raff")
    assert code == 0
    for words in (
        "mobility 3",
        "15 joints (3 actuated)",
        "12 rows of rank 12",
        "link5-link17: rigid",
        "platform at home",
    ):
        assert words in said
    assert re.search(r"joint6 +revolute +\S+ +-85 +80 .*actuated", said)


def test_info_as_json_agrees_with_the_mechanism(root, robot, here):
    _, said, _ = here("info", root / "robots/two_arms.raff", root / "robots/delta4.raff", "--json")
    reports = json.loads(said)
    assert [report["name"] for report in reports] == ["two_arms.left", "two_arms.right", "delta4"]
    delta = robot("delta4")
    assert reports[2]["mobility"] == 3
    assert reports[2]["actuated"] == list(delta.actuated)
    assert reports[2]["closure_at_home"] <= 1e-12
    assert [joint["home"] for joint in reports[2]["joints"]] == [
        delta.q_home[delta.q_index(joint)] for joint in delta.joints
    ]


def test_a_snapshot_is_written_at_once_without_a_server(root, tmp_path, here):
    code, said, _ = here("drive", root / "robots/gough.raff", "--snapshot", "out/gough.html")
    assert code == 0
    assert str(tmp_path / "out/gough.html") in said
    assert "http:" not in said
    assert "MeshCat.Viewer" in (tmp_path / "out/gough.html").read_text()


@pytest.mark.slow
def test_where_nobody_can_press_ctrl_c_it_moves_ten_seconds_and_leaves_a_page(root, tmp_path):
    began = time.monotonic()
    said = _cinegen("drive", root / "robots/delta4.raff", "--port", "7500", cwd=tmp_path)
    assert said.returncode == 0
    assert time.monotonic() - began > 10.0
    assert "page: http://127.0.0.1:" in said.stdout
    assert str(tmp_path / "delta4.html") in said.stdout
    assert (tmp_path / "delta4.html").exists()


@pytest.mark.parametrize("shape", slow("figure8", "line"))
def test_several_robots_follow_a_shape_for_as_long_as_said(root, tmp_path, shape):
    files = [root / "robots/two_arms.raff", root / "robots/four_bar.raff"]
    said = _cinegen("drive", *files, "--follow", shape, "--seconds", "1", "--port", "7600", cwd=tmp_path)
    assert said.returncode == 0
    for name in ("two_arms.left", "two_arms.right", "four_bar"):
        assert f"{name}: tool follows a" in said.stdout
    assert re.search(r"loops closed to \de-1[3-9]", said.stdout)
    assert not list(tmp_path.iterdir())


def test_at_a_terminal_it_moves_until_ctrl_c_and_ends_well(root, tmp_path):
    master, slave = pty.openpty()
    command = [
        sys.executable,
        "-m",
        "cinegen",
        "drive",
        str(root / "robots/rx90.raff"),
        "--port",
        "7700",
        "--no-browser",
    ]
    process = subprocess.Popen(command, cwd=tmp_path, stdin=slave, stdout=slave, stderr=slave, start_new_session=True)
    os.close(slave)
    said = ""
    try:
        said = _until(master, said, "Ctrl-C ends")
        url = re.search(r"http://\S+", said).group()
        assert b"viewer.js" in urllib.request.urlopen(url, timeout=10).read()
        said = _until(master, said, "closure")
        process.send_signal(signal.SIGINT)
        said = _until(master, said, "stopped")
        assert process.wait(20) == 0
    finally:
        process.kill()
        os.close(master)
    assert "Traceback" not in said


def _until(master, said, words):
    deadline = time.monotonic() + 60
    while words not in said:
        assert time.monotonic() < deadline, said
        if select.select([master], [], [], 1.0)[0]:
            said += os.read(master, 4096).decode()
    return said


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["info", "none.raff"], "none.raff: can't be read"),
        (["drive", "none.urdf"], "none.urdf: can't be read"),
        (["info", "bad.raff"], "bad.raff:2:17: the number 1 is defined twice"),
        (["drive", "good.raff", "--node", "nose"], "no node 'nose'"),
        (["info", "good.raff", "--robot", "b"], "no robot 'b'"),
        (["info", "good.raff", "--loop", "ball"], "write NAME=KIND"),
        (["drive", "good.raff", "--snapshot", "good.raff/x.html"], "can't be written"),
    ],
)
def test_what_is_wrong_is_one_clear_error_and_exit_code_1(arguments, says, tmp_path, here):
    (tmp_path / "good.raff").write_text("RAFF good\nrobot a { base { } link 1 { type 2 pred 0 } }\n")
    (tmp_path / "bad.raff").write_text(
        "RAFF bad\nrobot a { link 1 { type 2 pred 0 } link 1 { type 2 pred 0 } base { } }\n".replace(
            "link 1 {", "link 1{"
        )
    )
    code, _, said = here(*arguments)
    assert code == 1
    assert says.split(":2:")[0] in said
    assert says.split(": ")[-1] in said
    assert "Traceback" not in said


def test_a_loop_that_cant_be_closed_says_what_to_type(tmp_path, here):
    (tmp_path / "bent.raff").write_text(
        "RAFF bent\nrobot r { base { } link 1 { type 2 pred 0 } link 2 { parameters { d 200 alpha 30 theta 60 } type 2"
        " pred 1 } link 3 { parameters { d 301 alpha 50 theta 70 } type 2 pred 2 } link 4 { parameters { d 200 alpha 30"
        " theta 50 } type 2 pred 3 } frame 5 { parameters { d 303 alpha 58 } pred 4 } constraint { base frame 5 } }\n"
    )
    code, _, said = here("info", "bent.raff")
    assert code == 1
    assert '"base-frame5": "ball"' in said
    assert here("info", "bent.raff", "--loop", "base-frame5=ball")[0] == 0


def test_the_public_face_is_short():
    assert set(cinegen.__all__) >= {"load", "Mechanism", "Solver", "inverse_kinematics"}
    assert len(cinegen.__all__) <= 24


def _in_a_shell(root, *arguments, **environment):
    """What `cinegen` prints, where a shell sets variables."""
    return subprocess.run(
        [sys.executable, "-c", "import sys; from cinegen.cli import main; sys.exit(main())", *arguments], text=True,
        capture_output=True, env=os.environ | {"PYTHONPATH": str(root)} | environment, timeout=60, check=False,
    ).stdout  # fmt: skip


def test_colours_are_for_those_who_want_them(root):
    assert "\x1b[1;36m" in _in_a_shell(root, "--help", FORCE_COLOR="1")
    assert "\x1b[1;36m" not in _in_a_shell(root, "--help", FORCE_COLOR="1", NO_COLOR="1")
    assert "\x1b" not in _in_a_shell(root, "--help")


@pytest.mark.parametrize(
    ("typed", "completed"),
    [("cinegen mo", ["modes"]), ("cinegen plan --fie", ["--field"]), ("cinegen plan --field v", ["vortex"])],
)
def test_a_shell_completes_commands_options_and_choices(root, typed, completed):
    words = {"COMP_WORDS": typed, "COMP_CWORD": str(typed.count(" "))}
    assert _in_a_shell(root, _CINEGEN_COMPLETE="complete_bash", **words).split() == completed


@pytest.mark.parametrize("no_color", ["", "1"])
def test_errors_are_red_at_a_terminal(monkeypatch, no_color):
    monkeypatch.setattr(sys, "stderr", stream := io.StringIO())
    monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("NO_COLOR", no_color)
    monkeypatch.setenv("TERM", "xterm")
    assert main(["info", "none.raff"]) == 1
    assert stream.getvalue().startswith("cinegen: " if no_color else "\x1b[1;31mcinegen: \x1b[0mnone.raff: ")


ONE_OF_EACH = (("cinegen", "bash"), ("raff2urdf", "zsh"), ("urdf2raff", "fish"))
OTHERS = [pair for pair in product(*zip(*ONE_OF_EACH, strict=True)) if pair not in ONE_OF_EACH]


@pytest.mark.parametrize(("program", "shell"), [*ONE_OF_EACH, *slow(*OTHERS)])
def test_each_shell_gets_its_completion(root, program, shell):
    module = {"cinegen": "cinegen.cli", "raff2urdf": "raff2urdf.cli", "urdf2raff": "raff2urdf.urdf2raff.cli"}[program]
    variable = f"_{program.upper()}_COMPLETE"
    code = f"import sys; from {module} import main; sys.exit(main())"

    def printed(**variables):
        environment = os.environ | {"PYTHONPATH": str(root)} | variables
        return subprocess.run([sys.executable, "-c", code], text=True, capture_output=True, env=environment).stdout

    assert variable in printed(**{variable: f"source_{shell}"})
    typed = f"{program} --vers"
    words = {"COMP_WORDS": typed, "COMP_CWORD": "1", "_TYPER_COMPLETE_ARGS": typed}
    words["_TYPER_COMPLETE_FISH_ACTION"] = "get-args"
    assert "--version" in printed(**{variable: f"complete_{shell}"}, **words)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["modse"], "cinegen: unknown command 'modse' (did you mean 'modes'?)\nTry 'cinegen --help'.\n"),
        (["map", "a.raff", "--ovre", "x"], "cinegen map: unknown option '--ovre' (did you mean '--over'?)\n"),
        (["info"], "cinegen info: missing argument 'FILE'"),
        (["export", "a.jsonl"], "cinegen export: missing option '--to'"),
    ],
)
def test_a_wrong_call_is_exit_code_2_with_what_was_probably_meant(capsys, arguments, says):
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert (out, err[: len(says)]) == ("", says)


def test_help_shows_all_that_is_said_about_every_option(capsys, monkeypatch):
    """Brackets are not taken for colours."""
    monkeypatch.setenv("COLUMNS", "2000")  # no text is broken
    for name, command in typer.main.get_command(app).commands.items():
        assert main([name, "--help"]) == 0
        text = capsys.readouterr().out
        assert f"Usage: cinegen {name}" in text
        for paragraph in command.help.split("\n\n"):
            assert paragraph in text
        for parameter in command.params:
            assert parameter.help
            assert parameter.help in text
