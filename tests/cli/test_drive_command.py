"""`cinegen drive`, `replay` and `export` as people call them."""

import json
import os
import re
import socket
import subprocess
import sys
import time

import pytest

from cinegen.cli import main
from cinegen.cli.served_page import PageOptions
from cinegen.mission import Recording


@pytest.fixture
def run(capsys, root, monkeypatch, tmp_path):
    """Runs a command in an empty folder; what it returns, prints and warns of. `robots/` is the repository's."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        words = [str(root / word) if str(word).startswith("robots/") else str(word) for word in arguments]
        code = main(words)
        said = capsys.readouterr()
        return code, said.out, said.err

    return call


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["robots/delta4.raff", "--sensor", "7=/dev/ttyUSB0"], "no node of these files may follow a sensor 7"),
        (["robots/delta4.raff", "--sensor", "platfrom=spnav:"], "no node 'platfrom': did you mean 'platform'"),
        (["robots/delta4.raff", "--base", "delta4"], "write NAME=ROBOT.NODE"),
        (["robots/delta4.raff", "--base", "delta4=delta4.platform"], "carry each other"),
        (["robots/delta4.raff", "--host", "no such host"], "no such host"),
        (["robots/delta4.raff", "--record", "folder/../"], "can't be written"),
    ],
)
@pytest.mark.usefixtures("session_in_a_thread")
@pytest.mark.filterwarnings("ignore::cinegen.CinegenWarning")
def test_what_makes_no_sense_is_told_and_nothing_is_served(run, tmp_path, arguments, says):
    code, out, err = run("drive", *arguments, "--no-browser")
    assert code == 1
    assert says in err.splitlines()[-1]
    assert "page:" not in out
    assert not [path for path in tmp_path.iterdir() if path.suffix]


@pytest.mark.filterwarnings("always::cinegen.CinegenWarning")
def test_a_port_that_is_not_there_is_a_warning_with_what_to_do(run):
    code, _, err = run("drive", "robots/delta4.raff", "--snapshot", "page.html")
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
    (tmp_path / f"{name}.toml").write_bytes(
        f"robot = '{root}/robots/planar_3r.raff'\n[goal]\npoint = [0.5, 0]".encode()
    )
    code, _, err = run("plan", f"{name}.toml")
    assert code in (0, 1)
    assert "Traceback" not in err


@pytest.mark.usefixtures("session_in_a_thread")
def test_a_mission_is_recorded_replayed_and_exported(run, tmp_path):
    code, out, _ = run("drive", "robots/five_bar.raff", "--no-browser", "--seconds", "1", "--record", "run.jsonl")
    assert code == 0
    code, out, _ = run("replay", "run.jsonl", "--no-browser", "--seconds", "0.2")
    assert code == 0
    assert "page: http://127.0.0.1:" in out
    for form, name in (("csv", "run.csv"), ("npz", "run.npz"), ("ros2", "run.yaml")):
        code, out, err = run("export", "run.jsonl", "--to", form)
        assert (code, err) == (0, "")
        assert name in out
    rows = (tmp_path / "run.csv").read_text().splitlines()
    assert rows[0] == "time,joint1,joint3"
    assert len(rows) > 100 * Recording.load("run.jsonl").seconds
    again = ("--record", "run.jsonl", "--no-browser", "--seconds", "0.2")
    assert run("drive", "robots/five_bar.raff", *again, "--force")[0] == 0
    assert Recording.load("run.jsonl").seconds < 1.0


@pytest.mark.usefixtures("session_in_a_thread")
def test_a_scene_is_driven_recorded_and_shown_again(run, tmp_path):
    scene = "robots/scenes/generic.toml"
    options = ["--no-browser", "--seconds", "1", "--record", "run.jsonl", "--snapshot", "page.html"]
    code, out, err = run("drive", "--scene", scene, *options)
    assert (code, err) == (0, "")
    assert "mobile: 2 joints, 0 loops, mobility 2" in out
    assert "keeps 0.05 m clear of 6 obstacles" in out
    assert "<title>mobile</title>" in (tmp_path / "page.html").read_text(encoding="utf-8")
    code, out, _ = run("replay", "run.jsonl", "--no-browser", "--seconds", "0.3")
    assert code == 0
    recording = Recording.load("run.jsonl")
    assert recording.robots == ("mobile",)
    assert tuple(recording.obstacles) == ("triangle", "rod", "angle", "block", "hexagon", "post")
    assert recording.q["mobile"][-1] == pytest.approx([0.5, 0.8])


def test_a_session_that_is_killed_leaves_its_recording_whole(root, tmp_path):
    command = [sys.executable, "-m", "cinegen", "drive", str(root / "robots/five_bar.raff"), "--no-browser"]
    process = subprocess.Popen(
        [*command, "--record", "run.jsonl", "--seconds", "60"], cwd=tmp_path, stdout=subprocess.PIPE
    )
    assert process.stdout is not None
    while b"page:" not in process.stdout.readline():
        pass
    while (tmp_path / "run.jsonl").read_bytes().count(b"\n") < 100:
        assert process.poll() is None
        time.sleep(0.02)
    process.kill()
    process.communicate()  # until its children, who hold the stream, have ended
    assert Recording.load(tmp_path / "run.jsonl").seconds > 0.5
    lines = (tmp_path / "run.jsonl").read_bytes().split(b"\n")
    assert all(isinstance(json.loads(line), dict) for line in lines[:-1])


def test_the_token_can_come_from_the_environment(root, monkeypatch):
    """On the command line other users of the machine see it."""
    found = []
    monkeypatch.setattr(PageOptions, "show", lambda self, *_: found.append(self.token) or 0)
    monkeypatch.setenv("CINEGEN_TOKEN", "secret")
    assert main(["drive", str(root / "robots/planar_3r.raff")]) == 0
    assert main(["drive", str(root / "robots/planar_3r.raff"), "--token", "mine"]) == 0
    assert found == ["secret", "mine"]


@pytest.mark.usefixtures("session_in_a_thread")
def test_a_page_needs_a_token_unless_asked_otherwise(run):
    page = "drive", "robots/planar_3r.raff", "--no-browser", "--seconds", "0.2"
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
