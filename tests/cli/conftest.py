"""What tests of several commands share."""

import io
import shutil
import sys
from functools import partial

import pytest
from calibration_data import planar_arm

import cinegen.cockpit
import raff2urdf.cli
from cinegen.cli import main, progress


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    """`run("info", path)` in an empty folder: the exit code, and what is printed on both streams."""
    monkeypatch.chdir(tmp_path)
    return lambda *words, command=main: (command([*map(str, words)]), *capsys.readouterr())


@pytest.fixture
def printed(typed, monkeypatch, tmp_path):
    """`printed("ik", "rx90", "--all")` in an empty folder: what a command prints, or its errors."""
    monkeypatch.chdir(tmp_path)

    def command(*words, code=0):
        said = typed(*words, code=code)
        return said.err if code and said.err else said.out

    return command


@pytest.fixture
def session_in_a_thread(monkeypatch):
    """Pages of this test run their sessions in a thread; a process of its own takes two seconds of CPU to start."""
    in_a_thread = partial(cinegen.cockpit.Cockpit, own_process=False)
    monkeypatch.setattr(cinegen.cockpit, "Cockpit", in_a_thread)


@pytest.fixture
def terminal(monkeypatch):
    """`terminal()`, called in the test itself: standard error as a terminal, where progress is shown at once."""

    def open_terminal() -> io.StringIO:
        monkeypatch.setattr(sys, "stderr", screen := io.StringIO())
        monkeypatch.setattr(screen, "isatty", lambda: True, raising=False)
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setattr(progress, "_PATIENCE", 0.0)
        return screen

    return open_terminal


TASK = """
starts = 1
parameters = { "link2.d" = "150..500mm" }
reach = { points = [[0.5, 0.3]], axes = ["x", "y"], orientation = "home" }
objective = [{ minimise = "size", of = ["link*.d"] }]
"""


@pytest.fixture(scope="module")
def inputs(root, tmp_path_factory):
    """A folder with a file of each kind."""
    folder = tmp_path_factory.mktemp("inputs")
    for name in ("four_bar", "five_bar", "planar_3r"):
        shutil.copy(root / "robots" / f"{name}.raff", folder)
    tilted = (folder / "four_bar.raff").read_text(encoding="utf-8").replace("d 120.0 }", "d 120.0 alpha 0.003 }")
    (folder / "tilted.raff").write_text(tilted, encoding="utf-8")
    for name, content in {"empty": b"", "binary": bytes(range(256)), "text.toml": b"hello = 1\n"}.items():
        (folder / name).write_bytes(content)
    (folder / "folder").mkdir()
    (folder / "unreachable.toml").write_text("robot = 'planar_3r.raff'\ngoal = { point = [0.9, 0.9] }\n")
    (folder / "task.toml").write_text(TASK)
    (folder / "measurements.csv").write_text(planar_arm(), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for made in (
            "plan disc -o run.jsonl",
            "map planar_3r.raff --over x,y --grid 3 --workers 1 -o map.zarr",
            "prove five_bar.raff --over x=-10..10mm,y=0.45..0.46 -o proof.json",
        ):
            assert main(made.split()) == 0
        assert raff2urdf.cli.main(["planar_3r.raff", "-o", "arm.urdf"]) == 0
    return folder
