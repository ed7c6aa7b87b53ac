"""The command `cinegen`, as typed, and `cinegen info`."""

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
import sysconfig
import time
import urllib.request
from pathlib import Path

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


@pytest.mark.parametrize("no_color", ["", "1"])
def test_errors_are_red_at_a_terminal(monkeypatch, no_color):
    monkeypatch.setattr(sys, "stderr", stream := io.StringIO())
    monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("NO_COLOR", no_color)
    monkeypatch.setenv("TERM", "xterm")
    assert main(["info", "none.raff"]) == 1
    assert stream.getvalue().startswith("cinegen: " if no_color else "\x1b[1;31mcinegen: \x1b[0mnone.raff: ")


ONE_OF_EACH = (("cinegen", "bash"), ("raff2urdf", "zsh"), ("urdf2raff", "fish"))


@pytest.mark.parametrize(("program", "shell"), ONE_OF_EACH)
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


PANDA = (
    Path(sysconfig.get_path("purelib"))
    / "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
)


def test_all_pairs_are_listed_with_reasons_and_contact_at_home(capsys):
    assert main(["info", str(PANDA), "--collision", "--json"]) == 0
    (report,) = json.loads(capsys.readouterr().out)
    found = {frozenset(pair["links"]): pair for pair in report["collision"]["pairs"]}
    assert found[frozenset(("panda_link1", "panda_link2"))]["reason"].startswith("adjacent")
    contact = found[frozenset(("panda_link5", "panda_hand"))]
    assert contact["reason"] == "checked"
    assert contact["depth_at_home"] > 0.01
    assert "depth_at_home" not in found[frozenset(("panda_link0", "panda_hand"))]
    shapes = {shape["link"]: shape["shape"] for shape in report["collision"]["shapes"]}
    assert "mesh" in shapes["panda_hand"] or "hull" in shapes["panda_hand"]


def test_pairs_are_printed(capsys):
    assert main(["info", "planar_3r", "--collision"]) == 0
    out = capsys.readouterr().out
    assert "link1 - link2: adjacent" in out
    assert "base - link2: checked" in out
