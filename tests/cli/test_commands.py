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

from cinegen.cli import app, main, progress, served_page
from cinegen.cli.files import write_figure
from cinegen.cli.progress import Progress
from cinegen.plotting import sheet
from raff2urdf import shipped
from raff2urdf.cli import main as main_of_raff2urdf


def test_info_agrees_with_the_mechanism_also_as_json(root, robot, run):
    _, said, _ = run("info", root / "robots/two_arms.raff", root / "robots/delta4.raff", "--json")
    reports = json.loads(said)
    assert [report["name"] for report in reports] == ["two_arms.left", "two_arms.right", "delta4"]
    delta = robot("delta4")
    assert reports[2]["mobility"] == 3
    assert reports[2]["actuated"] == list(delta.actuated)
    assert reports[2]["closure_at_home"] <= 1e-12
    homes = [delta.q_home[delta.q_index(joint)] for joint in delta.joints]
    assert [joint["home"] for joint in reports[2]["joints"]] == homes
    _, said, _ = run("info", root / "robots/delta4.raff")
    for words in ("mobility 3, 15 joints (3 actuated)", "12 rows of rank 12", "link5-link17: rigid", "at home"):
        assert words in said
    assert re.search(r"joint6 +revolute +\S+ +-85 +80 .*actuated", said)


@pytest.mark.usefixtures("session_in_a_thread")
def test_several_robots_follow_a_shape_for_as_long_as_said(root, tmp_path, run):
    files = [root / "robots/two_arms.raff", root / "robots/four_bar.raff"]
    code, said, _ = run("drive", *files, "--follow", "figure8", "--seconds", "0.5", "--no-browser")
    assert code == 0
    for name in ("two_arms.left", "two_arms.right", "four_bar"):
        assert f"{name}: tool follows a" in said
    assert re.search(r"loops closed to \de-1[3-9]", said)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("session_in_a_thread")
def test_where_nobody_can_press_ctrl_c_it_moves_for_a_while_and_leaves_a_page(root, tmp_path, run, monkeypatch):
    monkeypatch.setattr(served_page, "_UNATTENDED", 0.2)
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    code, said, _ = run("drive", root / "robots/four_bar.raff")
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
        assert b"viewer.js" in urllib.request.urlopen(url, timeout=60).read()
        said = _until(master, said, "closure")
        process.send_signal(signal.SIGINT)
        said = _until(master, said, "stopped")
        assert process.wait(20) == 0
    finally:
        process.kill()
        os.close(master)
    assert "Traceback" not in said


def _until(master, said, words):
    deadline = time.monotonic() + 300
    while words not in said:
        assert time.monotonic() < deadline, said
        if select.select([master], [], [], 1.0)[0]:
            said += os.read(master, 4096).decode()
    return said


def test_completion_and_colours_of_a_shell(root):
    def printed(*arguments, **variables):
        command = [sys.executable, "-c", "import sys; from cinegen.cli import main; sys.exit(main())", *arguments]
        environment = os.environ | {"PYTHONPATH": str(root)} | variables
        return subprocess.run(command, text=True, capture_output=True, env=environment, timeout=300, check=False).stdout

    assert "--version" in printed(_CINEGEN_COMPLETE="complete_bash", COMP_WORDS="cinegen --vers", COMP_CWORD="1")
    assert "\x1b[1;36m" in printed("--help", FORCE_COLOR="1")


@pytest.mark.parametrize("no_color", ["", "1"])
def test_errors_are_red_at_a_terminal(monkeypatch, terminal, no_color):
    screen = terminal()
    monkeypatch.setenv("NO_COLOR", no_color)
    assert main(["info", "none.raff"]) == 1
    assert screen.getvalue().startswith("cinegen: " if no_color else "\x1b[1;31mcinegen: \x1b[0mnone.raff: ")


def test_help_shows_all_that_is_said_about_every_option(typed, monkeypatch):
    """Brackets are not taken for colours."""
    monkeypatch.setenv("COLUMNS", "2000")  # no text is broken
    for name, command in typer.main.get_command(app).commands.items():
        text = typed(name, "--help").out
        assert f"Usage: cinegen {name}" in text
        for paragraph in command.help.split("\n\n"):
            assert paragraph in text
        for parameter in command.params:
            assert parameter.help
            assert parameter.help in text


# --- demo command -----------------------------------------------------------------------------------------------------
# `cinegen demo`, and the names of shipped robots and scenes in other commands, from a folder without any file.


def test_the_list_has_a_line_for_everything(run, root):
    _, out, _ = run("demo", "--list")
    listed = [line.split(maxsplit=1) for line in out.splitlines() if line.startswith("  ")]
    examples = [path.stem[3:] for path in sorted((root / "examples").glob("*.py"))]
    assert [name for name, _ in listed] == [*shipped.robots(), *shipped.scenes(), *examples]
    assert all(20 < len(text) < 125 for _, text in listed)


@pytest.mark.usefixtures("session_in_a_thread")
def test_a_scene_is_driven(run):
    code, out, err = run("demo", "disc", "--seconds", "0.2", "--no-browser")
    assert code == 0
    assert "clear of 1 obstacle" in out
    assert "page: http://127.0.0.1:" in out
    assert "warning" not in err


def test_an_example_is_run(run):
    code, out, _ = run("demo", "kleinfinger")
    assert code == 0
    assert out.strip()


def test_commands_take_the_names_of_robots_and_scenes(run, tmp_path):
    assert run("info", "four_bar")[1].startswith("four_bar: robot 'linkage', mobility 1")
    assert run("plan", "disc", "--json")[0] == 0
    assert run("four_bar", command=main_of_raff2urdf)[0] == 0
    assert (tmp_path / "generated" / "four_bar.urdf").is_file()
    assert run("--check", "delta4", command=main_of_raff2urdf)[1].startswith("delta4: robot 'r1': 17 links")


def test_a_file_comes_before_a_shipped_robot_of_its_name(run, root, tmp_path):
    (tmp_path / "delta4").write_bytes((root / "robots/four_bar.raff").read_bytes())
    assert run("info", "delta4")[1].startswith("delta4: robot 'linkage'")


# --- progress ---------------------------------------------------------------------------------------------------------
# Progress of long computations: for people at a terminal who wait, and gone in the end.


def shown(screen):
    """The text on the terminal, without control sequences."""
    return re.sub(r"\x1b\[[\d;?]*[a-zA-Z]", "", screen.getvalue())


def test_text_fractions_and_cells_are_shown(terminal):
    screen = terminal()
    with Progress() as bar:
        bar.text("trying")
    with Progress() as bar:
        bar.fraction(0.25)
    with Progress() as bar:
        bar.cells(1000, 4000)
        bar.cells(3000, 4000)
    assert "trying" in shown(screen)
    assert "25%" in shown(screen)
    assert "75%" in shown(screen)
    assert re.search(r"3,000 of 4,000 cells, [\d,]+/s", shown(screen))


@pytest.mark.parametrize("error", [None, KeyboardInterrupt])
def test_nothing_of_it_stays(terminal, error):
    screen = terminal()
    try:
        with Progress() as bar:
            bar.text("trying")
            if error:
                raise error
    except KeyboardInterrupt:
        pass
    assert screen.getvalue().endswith("\r\x1b[1A\x1b[2K")  # the line above is empty again
    assert "\x1b[?25h" in screen.getvalue()  # the cursor is visible again


def test_nobody_else_is_bothered(terminal, monkeypatch, capsys):
    screen = terminal()
    with monkeypatch.context() as patient:
        patient.setattr(progress, "_PATIENCE", 60.0)
        with Progress() as bar:
            bar.fraction(0.5)
    assert screen.getvalue() == ""
    monkeypatch.undo()
    with Progress() as bar:
        bar.fraction(0.5)
    assert capsys.readouterr().err == ""


# --- pictures ---------------------------------------------------------------------------------------------------------
# Pictures of all commands with --plot: PNG, SVG and PDF, which name the robot as its file does, the same each time.


def figure():
    drawn, body = sheet.sheet(4.0, 2.0, "arm: a picture", "of a line")
    body.add_subplot().plot([0.0, 1.0], [0.0, 1.0], label="a line")
    sheet.finish(drawn)
    return drawn


def test_each_format_is_written(tmp_path):
    for suffix, begin in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")):
        write_figure(tmp_path / f"p.{suffix}", figure(), quiet=True)
        first = (tmp_path / f"p.{suffix}").read_bytes()
        assert first.startswith(begin)
        write_figure(tmp_path / f"p.{suffix}", figure(), quiet=True)
        assert (tmp_path / f"p.{suffix}").read_bytes() == first
    assert b"/TrueType" in first or b"/CIDFontType2" in first
    assert b"/Type3" not in first
