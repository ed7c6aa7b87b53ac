"""The command `cinegen`, as typed, and `cinegen info`."""

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

import pytest
import typer

from cinegen.cli import app, main, served_page


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


@pytest.mark.usefixtures("session_in_a_thread")
def test_several_robots_follow_a_shape_for_as_long_as_said(root, tmp_path, here):
    files = [root / "robots/two_arms.raff", root / "robots/four_bar.raff"]
    code, said, _ = here("drive", *files, "--follow", "figure8", "--seconds", "0.5", "--no-browser")
    assert code == 0
    for name in ("two_arms.left", "two_arms.right", "four_bar"):
        assert f"{name}: tool follows a" in said
    assert re.search(r"loops closed to \de-1[3-9]", said)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("session_in_a_thread")
def test_where_nobody_can_press_ctrl_c_it_moves_for_a_while_and_leaves_a_page(root, tmp_path, here, monkeypatch):
    monkeypatch.setattr(served_page, "_UNATTENDED", 0.2)
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    code, said, _ = here("drive", root / "robots/four_bar.raff")
    assert code == 0
    assert "page: http://127.0.0.1:" in said
    assert str(tmp_path / "four_bar.html") in said
    assert "MeshCat.Viewer" in (tmp_path / "four_bar.html").read_text()


def test_at_a_terminal_it_moves_until_ctrl_c_and_ends_well(root, tmp_path):
    master, slave = pty.openpty()
    robot = str(root / "robots/rx90.raff")
    command = [sys.executable, "-m", "cinegen", "drive", robot, "--no-browser"]
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


def test_completion_and_colours_of_a_shell(root):
    def printed(*arguments, **variables):
        command = [sys.executable, "-c", "import sys; from cinegen.cli import main; sys.exit(main())", *arguments]
        environment = os.environ | {"PYTHONPATH": str(root)} | variables
        return subprocess.run(command, text=True, capture_output=True, env=environment, timeout=60, check=False).stdout

    assert "--version" in printed(_CINEGEN_COMPLETE="complete_bash", COMP_WORDS="cinegen --vers", COMP_CWORD="1")
    assert "\x1b[1;36m" in printed("--help", FORCE_COLOR="1")


@pytest.mark.parametrize("no_color", ["", "1"])
def test_errors_are_red_at_a_terminal(monkeypatch, no_color):
    monkeypatch.setattr(sys, "stderr", stream := io.StringIO())
    monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("NO_COLOR", no_color)
    monkeypatch.setenv("TERM", "xterm")
    assert main(["info", "none.raff"]) == 1
    assert stream.getvalue().startswith("cinegen: " if no_color else "\x1b[1;31mcinegen: \x1b[0mnone.raff: ")


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


def test_pairs_are_printed(capsys):
    assert main(["info", "planar_3r", "--collision"]) == 0
    out = capsys.readouterr().out
    assert "link1 - link2: adjacent" in out
    assert "base - link2: checked" in out
