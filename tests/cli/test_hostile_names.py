"""Names of robots are text, not commands: at the terminal, and in the files that commands write."""

import json
import shlex
import sys

import pytest
from hostile_names import JOINTS, LINKS, urdf

from cinegen.cli import main
from cinegen.errors import CinegenError
from cinegen.mission import MissionRecorder, RobotSample
from raff2urdf import output


def test_whatever_reaches_a_stream_of_a_command_is_text(capsys):
    def command():
        print("out\x1b[2J\x9b2J\u202e")
        print("error\x1b[2J\r\u202e\tx", file=sys.stderr)
        raise CinegenError("a\x1b[2J")

    assert output.run("thing", command) == output.DEFECT
    said = capsys.readouterr()
    assert said.out == "out\\u001b[2J\\u009b2J\\u202e\n"
    assert said.err.startswith("error\\u001b[2J\\u000d\\u202e\tx\n".replace("\\u000d", "\\r"))
    assert "\x1b" not in said.err


def test_two_names_that_are_shown_alike_are_refused(robot, tmp_path, capsys):
    recording, arm = tmp_path / "run.jsonl", robot("planar_3r")
    with MissionRecorder(recording, {"arm": arm}) as recorder:
        recorder.write(0.0, {"arm": RobotSample(arm.q_home, "IDLE")})
    first, *moments = recording.read_text().splitlines()
    header = json.loads(first)
    ((_, robot),) = header["robots"].items()
    header["robots"] = {"a\nb": robot, "a\\nb": robot}
    recording.write_text("\n".join([json.dumps(header), *moments, ""]))
    assert main(["export", str(recording), "--to", "csv"]) == 1
    assert "two names differ only in characters that can't be printed" in capsys.readouterr().err


def test_code_of_a_robot_with_such_a_name_stays_in_its_folder(tmp_path):
    path = tmp_path / "in" / "x.urdf"
    path.parent.mkdir()
    path.write_text(urdf("../../owned", LINKS[:2], JOINTS[:2]), encoding="utf-8")
    before = {one for one in tmp_path.rglob("*")}
    assert main(["generate", str(path), "--to", "c", "-o", str(tmp_path / "out"), "--functions", "fk"]) == 0
    assert {one.parent.name for one in {*tmp_path.rglob("*")} - before} == {tmp_path.name, "out"}


@pytest.mark.filterwarnings("default::raff2urdf.errors.RaffWarning")
def test_commands_that_messages_propose_are_one_word(tmp_path, capsys):
    path = tmp_path / "a; touch owned.urdf"
    path.write_text(urdf("x", ("a", "b"), ("j", "k")), encoding="utf-8")
    sidecar = tmp_path / "a; touch owned.constraints.json"
    sidecar.mkdir()
    assert main(["info", str(path)]) == 1
    proposed = shlex.split(capsys.readouterr().err.partition("leave it out with ")[2])
    assert proposed == ["--ignore", sidecar.name]
    assert main(["info", str(path), *proposed]) == 0
