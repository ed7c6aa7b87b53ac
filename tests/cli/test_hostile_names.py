"""Names of robots are text, not commands: at the terminal, and in the files that commands write."""

import json
import re
import shlex
import shutil
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from hostile_names import CONTROL, CONTROLS, JOINTS, LINKS, urdf

from cinegen.cli import main
from cinegen.errors import CinegenError
from cinegen.mission import MissionRecorder
from raff2urdf.command import output


def test_a_certificate_adds_no_line_to_what_is_said_of_it(root, tmp_path, typed, capsys):
    path = str(tmp_path / "proof.json")
    assert main(["prove", str(root / "robots/five_bar.raff"), "--over", "x=-10..10mm,y=450..460mm", "-o", path]) == 0
    certificate = json.loads(Path(path).read_text(encoding="utf-8"))
    for variable in certificate["variables"]:
        variable["name"] += CONTROLS
    Path(path).write_text(json.dumps(certificate | {"robot": CONTROLS}), encoding="utf-8")
    capsys.readouterr()
    lines = typed("check-proof", path).out.splitlines()
    assert len(lines) == 2  # the result and the region
    assert all(line.isprintable() for line in lines)


def test_an_error_quotes_the_ends_of_a_very_long_text(typed):
    said = typed("info", "planar_3r", "--robot", f"begin{'x' * 1_000_000}end", code=1).err
    assert len(said) < 5000
    assert re.search("beginx+ [.]{3} x+end", said)


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


def test_the_name_of_a_file_is_text_in_a_picture(root, tmp_path, typed):
    """Comments of an SVG quote titles."""
    path = tmp_path / f"\x1b{CONTROLS}--><script>.raff"
    shutil.copy(root / "robots/four_bar.raff", path)
    picture = str(tmp_path / "a.svg")
    said = typed("tolerance", path, "--sigma", "link*.d=1mm", "--samples", "0", "--plot", picture)
    assert not CONTROL.search(said.out + said.err)
    tags = {element.tag.rpartition("}")[2] for element in ElementTree.parse(picture).iter()}
    assert "script" not in tags


def test_two_names_that_are_shown_alike_are_refused(robot, tmp_path, typed):
    arm = robot("planar_3r")
    with MissionRecorder(tmp_path / "run.jsonl", {name: arm for name in ("a\nb", "a\\nb")}) as recorder:
        recorder.write(0.0, {})
    said = typed("export", tmp_path / "run.jsonl", "--to", "csv", code=1)
    assert "two names differ only in characters that can't be printed" in said.err


def test_code_of_a_robot_with_such_a_name_stays_in_its_folder(tmp_path):
    path = tmp_path / "in" / "x.urdf"
    path.parent.mkdir()
    path.write_text(urdf("../../owned", LINKS[:2], JOINTS[:2]), encoding="utf-8")
    before = {entry for entry in tmp_path.rglob("*")}
    assert main(["generate", str(path), "--to", "c", "-o", str(tmp_path / "out"), "--functions", "fk"]) == 0
    assert {entry.parent.name for entry in {*tmp_path.rglob("*")} - before} == {tmp_path.name, "out"}


@pytest.mark.filterwarnings("default::raff2urdf.errors.RaffWarning")
def test_commands_that_messages_propose_are_one_word(tmp_path, typed):
    path = tmp_path / "a; touch owned.urdf"
    path.write_text(urdf("x", ("a", "b"), ("j", "k")), encoding="utf-8")
    sidecar = tmp_path / "a; touch owned.constraints.json"
    sidecar.mkdir()
    proposed = shlex.split(typed("info", path, code=1).err.partition("leave it out with ")[2])
    assert proposed == ["--ignore", sidecar.name]
    assert main(["info", str(path), *proposed]) == 0
