"""`cinegen drive`, `replay` and `export` as people call them."""

import os
import re
import socket

import pytest

from cinegen.cli.served_page import PageOptions
from cinegen.mission import Recording


@pytest.mark.filterwarnings("always::cinegen.CinegenWarning")
def test_a_port_that_is_not_there_is_a_warning_with_what_to_do(run):
    code, _, err = run("drive", "delta4", "--snapshot", "page.html")
    assert code == 0
    assert "warning: sensor 1, '/dev/ttyd2': there is no such port here (/dev/ttyd2 is a name from IRIX)" in err
    assert "--sensor 1=/dev/ttyUSB0 names another" in err
    assert err.count("warning") == 1


def test_the_name_of_a_file_need_not_be_utf8(run, root, tmp_path):
    """A robot is called as its file; bytes that are not UTF-8 can't be sent to a page."""
    name = os.fsdecode(b"ar\xffm")
    (tmp_path / f"{name}.raff").write_bytes((root / "robots/planar_3r.raff").read_bytes())
    code, out, _ = run("drive", f"{name}.raff", "--snapshot", "page.html")
    assert (code, out.startswith("ar?m: 3 joints")) == (0, True)
    (tmp_path / f"{name}.toml").write_text("robot = 'planar_3r'\n[goal]\npoint = [0.5, 0]")
    code, _, err = run("plan", f"{name}.toml")
    assert code in (0, 1)
    assert "Traceback" not in err


@pytest.mark.usefixtures("session_in_a_thread")
def test_a_mission_in_a_scene_is_recorded_replayed_and_exported(run, root, tmp_path):
    scene = ("drive", "--scene", root / "robots/scenes/generic.toml", "--no-browser", "--record", "run.jsonl")
    code, out, err = run(*scene, "--seconds", "1", "--snapshot", "page.html")
    assert (code, err) == (0, "")
    assert "keeps 0.05 m clear of 6 obstacles" in out
    assert "<title>mobile</title>" in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert tuple(Recording.load("run.jsonl").obstacles) == ("triangle", "rod", "angle", "block", "hexagon", "post")
    code, out, _ = run("replay", "run.jsonl", "--no-browser", "--seconds", "0.2")
    assert code == 0
    assert "page: http://127.0.0.1:" in out
    for form, name in (("csv", "run.csv"), ("npz", "run.npz"), ("ros2", "run.yaml")):
        code, out, err = run("export", "run.jsonl", "--to", form)
        assert (code, err) == (0, "")
        assert name in out
    rows = (tmp_path / "run.csv").read_text().splitlines()
    assert rows[0] == "time,x,y"
    assert len(rows) > 100 * Recording.load("run.jsonl").seconds
    assert run(*scene, "--seconds", "0.2", "--force")[0] == 0
    assert Recording.load("run.jsonl").seconds < 1.0


def test_the_token_can_come_from_the_environment(run, monkeypatch):
    """On the command line other users of the machine see it."""
    tokens = []
    monkeypatch.setattr(PageOptions, "show", lambda self, *_: tokens.append(self.token) or 0)
    monkeypatch.setenv("CINEGEN_TOKEN", "secret")
    assert run("drive", "planar_3r")[0] == run("drive", "planar_3r", "--token", "mine")[0] == 0
    assert tokens == ["secret", "mine"]


@pytest.mark.usefixtures("session_in_a_thread")
def test_a_page_needs_a_token_unless_asked_otherwise(run):
    page = "drive", "planar_3r", "--no-browser", "--seconds", "0.2"
    assert re.search(r"page: http://127\.0\.0\.1:\d+/\?token=\S{16,} ", run(*page)[1])
    assert re.search(r"page: http://127\.0\.0\.1:\d+/ - ", run(*page, "--no-token")[1])
    elsewhere = run(*page, "--host", "0.0.0.0")[1]
    assert re.search(rf"page: http://{re.escape(socket.gethostname())}:\d+/\?token=\S{{16,}} ", elsewhere)
    assert "not encrypted" in elsewhere
    code, _, err = run(*page, "--no-token", "--host", "0.0.0.0")
    assert code == 1
    assert "needs a token; leave out --no-token" in err
    code, _, err = run(*page, "--no-token", "--token", "mine")
    assert code == 2
    assert "exclude each other" in err
