"""Typical mistakes on the command line: each is answered by place, cause and remedy in three lines, no traceback.

Streams that are closed, broken or full, and signals, are in test_streams.py; devices, FIFOs and links as outputs are in
test_outputs.py.
"""

import errno
import io
import math
import os
import shlex
import shutil
import sys
from pathlib import Path

import pytest

import cinegen.cli
import raff2urdf.cli
import raff2urdf.urdf2raff.cli

PROGRAMS = {"cinegen": cinegen.cli.main, "raff2urdf": raff2urdf.cli.main, "urdf2raff": raff2urdf.urdf2raff.cli.main}

# what is typed, its exit code, and what the answer must contain, beside the file or option
MISTAKES: list[tuple[str, int, str]] = [
    # commands, options, choices
    ("cinegen four_bar.raff", 2, "(did you mean 'info four_bar.raff'?)"),
    ("cinegen modes five_bar.raff --method monodrom", 2, "(did you mean 'monodromy'?)"),
    ("cinegen map five_bar.raff --orientation up", 2, "'free', 'axis', 'fixed', 'home'"),
    ("cinegen export run.jsonl", 2, "missing option '--to'"),
    ("urdf2raff page.urdf --units km", 2, "is not one of 'um', 'mm', 'cm', 'm'"),
    # files that are read
    ("cinegen info four_bra.raff", 1, "can't be read: No such file or directory: did you mean 'four_bar.raff'?"),
    ("cinegen info five_bra", 1, "no robot of this name is shipped: did you mean 'five_bar.raff'?"),
    ("cinegen plan five_bra", 1, "no scene of this name is shipped (known:"),
    ("cinegen demo delt4", 1, "no robot, scene or example 'delt4': did you mean 'delta4'?"),
    ("cinegen info folder", 1, "folder: can't be read: Is a directory"),
    ("cinegen info secret.raff", 1, "secret.raff: can't be read: Permission denied"),
    ("cinegen info binary.raff", 1, "this is a binary file"),
    ("cinegen info urdf.raff", 1, "a URDF, SDF or MJCF is read by its ending"),
    ("cinegen info page.urdf", 1, "this is not a robot (known: <robot>, <sdf>, <mujoco>)"),
    ("cinegen info -", 1, "-:1:1: the file ends too early"),
    ("cinegen plan empty.toml", 1, "empty.toml: goal is missing: write the goal of the robot"),
    ("cinegen plan dsic", 1, "did you mean 'disc'?"),
    ("cinegen replay runn.jsonl", 1, "runn.jsonl: can't be read: No such file or directory: did you mean 'run.jsonl'?"),
    ("cinegen replay /dev/zero", 1, "/dev/zero: can't be read: this is a device, not a file"),
    ("cinegen export mine.csv --to csv", 1, "mine.csv: not a mission: record one with"),
    ("cinegen export '' --to csv", 1, "can't be read: Is a directory"),
    ("cinegen close four_bar.raff --start mine.txt", 1, "--start mine.txt: invalid JSON"),
    ("cinegen drive", 2, "nothing to drive: name a file of a robot, or a scene"),
    ("cinegen drive four_bar.raff --scene scene.toml", 2, "--scene names its robot: leave FILE out"),
    # robots, nodes, joints, loops, quantities
    ("cinegen drive four_bar.raff --node tol", 1, "no node 'tol': did you mean 'tool'?"),
    ("cinegen drive five_bar.raff --sensor 7=/dev/ttyUSB0", 1, "no node of these files may follow a sensor 7"),
    ("cinegen drive five_bar.raff --sensor tol=spnav:", 1, "no node 'tol': did you mean 'tool'"),
    ("cinegen drive five_bar.raff --base five_bar", 1, "write NAME=ROBOT.NODE"),
    ("cinegen drive five_bar.raff --no-browser --record folder/../", 1, "can't be written"),
    ("cinegen info four_bar.raff --loop frame4-frame6=ball", 1, "no loop 'frame4-frame6': did you mean 'frame4-fr"),
    ("cinegen info five_bar.raff --actuated=,", 2, "--actuated: name joints, such as joint1,joint2"),
    ("cinegen info four_bar.raff --loop frame4-frame5=bal", 1, "did you mean 'ball'?"),
    # numbers and regions
    ("cinegen modes gough --at 0,0,900", 1, "far beyond the reach of hexapod, at most 3 m: did you mean 900 mm?"),
    ("cinegen modes five_bar.raff --values 125rad,50", 1, "did you mean 125 degrees, which are 2.182 rad?"),
    ("cinegen drive four_bar.raff --seconds 5m", 2, "'5m' is a length: a time is wanted (s, ms, us, min)"),
    ("cinegen forces five_bar.raff --massless --payload=-2kg", 1, "the payload on 'tool' has a negative mass"),
    ("cinegen forces five_bar.raff --massless --wrench tool=1,2", 2, "write NODE=FX,FY,FZ or NODE=FX,FY,FZ,MX,MY,MZ"),
    ("cinegen forces planar_3r.raff", 1, "these links have no mass: 'link1'"),
    ("cinegen forces five_bar.raff --massless --at joint1=9 --trajectory run.jsonl", 2, "exclude each other"),
    ("cinegen plan mm.toml", 1, "mm.toml: goal: point: 600 m is far beyond the reach of arm, at most 0.9 m: did you"),
    ("cinegen plan unit.toml", 1, "unit.toml: safety is wrong: '10 deg' is an angle: a length is wanted"),
    ("cinegen map planar_3r.raff --over x,y --grid 9999", 1, "Add --yes to start it, or use a coarser --grid"),
    ("cinegen map planar_3r.raff --over x,y --workers 99999999999", 1, "workers (99999999999) must be 1 to "),
    ("cinegen map planar_3r.raff --over x=2..3:5,y=2..3:5", 1, "no cell of this region is reached"),
    ("cinegen map planar_3r.raff --over joint1=-60..60rad", 1, "joint1: -3438 deg is far beyond its limits"),
    ("cinegen map planar_3r.raff --over xq", 1, "did you mean 'x'"),
    ("cinegen map planar_3r.raff --over x,joint1", 1, "can't be mixed"),
    ("cinegen map planar_3r.raff -q clearance", 1, "--scene"),
    ("cinegen map planar_3r.raff --vary link2.d+link2.alpha=1..2:3", 1, "must be all lengths or all angles"),
    ("cinegen map planar_3r.raff --over x=0..1:none", 2, "is not a number of cells"),
    ("cinegen map planar_3r.raff --at rz", 2, "write NAME=VALUE"),
    ("cinegen map planar_3r.raff --at rz=1deg,rz=2deg", 2, "rz is given twice"),
    ("cinegen map planar_3r.raff --line 0,0,0", 2, "write X,Y,Z..X,Y,Z"),
    ("cinegen map planar_3r.raff --centre 0,0", 2, "a point is x,y,z"),
    ("cinegen map planar_3r.raff --json --view", 2, "leave one out"),
    ("cinegen map planar_3r.raff --json -0.5,0", 2, "unknown option '-0'"),
    ("cinegen modes five_bar --values 1 2 3", 1, "joint1 (125.000 deg at home), joint3 (50.000 deg at home)"),
    ("cinegen modes five_bar --values joint2=1", 1, "no actuated joint 'joint2'"),
    ("cinegen modes tssm --values joint3=21.7", 1, "did you mean 21.7 mm?"),
    ("cinegen modes five_bar --at 1,2", 1, "not 2 numbers"),
    ("cinegen modes five_bar --at x=0.1,u=2", 1, "no coordinate 'u'"),
    ("cinegen modes five_bar --at 0,1.5,0", 1, f"misses it by {1.5 - math.sqrt(0.65**2 - 0.15**2):.4g} m"),
    ("cinegen modes rx90", 1, "has no loops"),
    # options without effect
    ("cinegen plan disc --modes any --planner rrtconnect", 2, "--planner has no effect with --modes: leave one out"),
    ("cinegen check-proof p.json --workers 2 --scheduler tcp://x:1", 2, "--workers has no effect with --scheduler"),
    ("cinegen demo --list --port 7001", 2, "--port has no effect with --list: leave it out"),
    ("cinegen demo clock --port 7001", 2, "--port has no effect on an example"),
    ("cinegen singular run.jsonl --at x=1", 2, "--at has no effect on a recording (run.jsonl): leave it out"),
    ("cinegen singular run.jsonl five_bar.raff", 2, "name only one kind of file"),
    ("cinegen singular five_bar.raff --over x,y --json", 2, "--json has no effect with --over: the scan is JSON, in a"),
    ("cinegen drive four_bar.raff --snapshot x.html --record r.jsonl", 2, "--record has no effect with --snapshot al"),
    ("cinegen drive --scene scene.toml --exact", 2, "--relax has no effect with --scene, which names its robot"),
    ("cinegen sensors four_bar.raff --monitor tcp://x", 2, "FILE has no effect with --monitor"),
    ("cinegen export run.jsonl --to csv -o run.npz", 2, "--output run.npz: .npz is another format's ending, --output "
     "writes .csv: name run.csv"),
    ("cinegen map planar_3r.raff -o map.png", 2, "--output writes .zarr: name map.zarr, or write --plot map.png"),
    # files that are written
    ("cinegen drive four_bar.raff --snapshot four_bar.raff/x.html", 1, "/x.html: can't be written: Not a directory"),
    ("cinegen drive four_bar.raff --snapshot locked/x.html", 1, "locked/x.html: can't be written: Permission denied"),
    ("cinegen drive four_bar.raff --snapshot /dev/full", 1, "/dev/full: can't be written: No space left on device"),
    ("cinegen map planar_3r.raff -o mine.txt", 1, "is a file, not a map: maps are folders"),
    ("cinegen map planar_3r.raff -o -", 2, "a map is a folder"),
    ("cinegen modes five_bar.raff --plot - --json", 2, "only one output can go to standard output"),
    ("raff2urdf four_bar.raff -o out", 2, "write 'out/' for a folder"),
    ("raff2urdf four_bar.raff -o mine.txt", 2, "'mine.txt' is neither a .urdf file nor a folder"),
]  # fmt: skip

FILES = {
    "empty.toml": "",
    "binary.raff": "RAFF a\n\0\1\2",
    "urdf.raff": '<robot name="x"/>',
    "page.urdf": "<html></html>",
    "mm.toml": "robot = 'planar_3r.raff'\ngoal = { point = [600, 300] }\n",
    "unit.toml": "robot = 'planar_3r.raff'\nsafety = '10 deg'\ngoal = { point = [0.6, 0.3] }\n",
    "secret.raff": "RAFF a",
    "five_bar.zip": "",
} | dict.fromkeys(("mine.txt", "mine.csv", "run.jsonl"), "mine")


@pytest.fixture(scope="module")
def folder(root: Path, tmp_path_factory) -> Path:
    """The files that are named."""
    folder = tmp_path_factory.mktemp("mistakes")
    for name in ("four_bar", "five_bar", "planar_3r"):
        shutil.copy(root / "robots" / f"{name}.raff", folder)
    for name, text in FILES.items():
        (folder / name).write_text(text)
    (folder / "folder").mkdir()
    (folder / "secret.raff").chmod(0)
    (folder / "locked").mkdir(mode=0o500)
    return folder


@pytest.mark.usefixtures("session_in_a_thread")
@pytest.mark.parametrize(("typed", "code", "says"), MISTAKES, ids=[mistake[0] for mistake in MISTAKES])
def test_a_mistake_is_answered_in_three_lines(folder, monkeypatch, capsys, typed, code, says):
    if "Permission" in says and os.geteuid() == 0:
        pytest.skip("root may read and write everything")
    if "/dev/full" in typed and not Path("/dev/full").exists():
        pytest.skip("no /dev/full here")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO()))
    before, paths = {path: path.read_bytes() for path in folder.glob("[!s]*.*")}, {*folder.rglob("*")}
    program, *words = shlex.split(typed)
    assert PROGRAMS[program](words) == code
    out, said = capsys.readouterr()
    assert "page:" not in out
    assert says in said
    assert len(said.splitlines()) <= 3
    assert "Traceback" not in said
    assert code == 1 or f"Try '{program}" in said
    assert all(path.read_bytes() == content for path, content in before.items())
    assert {*folder.rglob("*")} == paths


def test_a_full_disk_for_kernels_is_told_with_a_remedy(monkeypatch, capsys):
    def compile_kernels():
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("cinegen.kernels.compile_kernels", compile_kernels)
    assert cinegen.cli.main(["compile"]) == 1
    assert "can't be written: No space left on device: free some space, or name" in capsys.readouterr().err
