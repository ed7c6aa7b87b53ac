"""The command: what it writes, what it says, and what it leaves alone when something is wrong."""

import cProfile
import json
import os
import pstats
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trimesh
from mechanisms import delta, four_bar, serial, side_by_side, skew_four_bar
from wrong_raff import assert_in_order

import cinegen
import raff2urdf
from raff2urdf import constraints
from raff2urdf.cli import main

ARM = "RAFF arm\nrobot r { base { }\n  link 1 { type 2 pred 0 }\n  link 2 { parameters { d 100 } type 2 pred 1 }\n}\n"
TWO = "RAFF two\nrobot left { base { } link 1 { type 2 pred 0 } }\nrobot right { base { } link 1 { type 1 pred 0 } }\n"


Run = Callable[..., Any]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """`run("arm.raff", code=1)`: what `raff2urdf` prints (`.out`, `.err`) in the test's own folder, with this code."""

    def run(*arguments: str, code: int = 0) -> Any:
        monkeypatch.chdir(tmp_path)
        capsys.readouterr()
        with warnings.catch_warnings(action="always"):
            assert main(arguments) == code
        return capsys.readouterr()

    return run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The folder in which the command runs, with some files."""
    for name, text in (("arm", ARM), ("two", TWO), ("delta4", delta()), ("skew", skew_four_bar())):
        (tmp_path / f"{name}.raff").write_text(text, encoding="utf-8")
    return tmp_path


def files_in(folder: Path) -> dict[str, bytes]:
    """Every file below, hidden ones too, with its bytes."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


# --- what is written ---------------------------------------------------------------------------------------------


def test_it_says_what_it_found_and_where_it_wrote(folder: Path, run: Run) -> None:
    said, err = run("delta4.raff", "-o", "made/")
    assert err == ""
    named = set(re.findall('filename="(.*?)"', (folder / "made/delta4.urdf").read_text()))
    assert set(files_in(folder / "made")) == {"delta4.constraints.json", "delta4.urdf", *named}
    assert all(name.startswith("meshes/delta4/") for name in named)
    for words in ("'r1'", "17 links", "15 joints", "2 loops", "12 rows of rank 12", "mobility 3"):
        assert words in said
    for file in ("delta4.raff", "made/delta4.urdf", "made/delta4.constraints.json"):
        assert file in said


def test_each_robot_of_a_file_becomes_files_of_its_own(folder: Path, run: Run) -> None:
    run("two.raff")
    endings = ("constraints.json", "urdf")
    assert set(files_in(folder / "generated")) == {f"two.{arm}.{end}" for arm in ("left", "right") for end in endings}


@pytest.mark.parametrize(("format", "density"), [("urdf", ()), ("sdf", ("--density", "2700"))])
def test_the_library_writes_what_the_command_does(folder: Path, run: Run, format: str, density) -> None:
    run("delta4.raff", "-o", "command/", "--format", format, *density)
    options = {"density": float(density[1])} if density else {}
    (conversion,) = raff2urdf.convert(folder / "delta4.raff", folder / "library", format=format, **options)
    assert files_in(folder / "command") == files_in(folder / "library")
    assert conversion.file == folder / "library" / f"delta4.{format}"
    assert (conversion.urdf is None, conversion.constraints is None) == 2 * (format != "urdf",)
    assert (conversion.robot, conversion.links, conversion.joints, conversion.loops) == ("r1", 17, 15, 2)


# --- other formats -----------------------------------------------------------------------------------------------


def test_the_json_names_meshes_that_were_converted(folder: Path, run: Run) -> None:
    box = trimesh.creation.box((10.0, 20.0, 30.0))
    box.export(folder / "box.dae")
    box.export(folder / "box.stl")
    (folder / "shown.raff").write_text(ARM.replace("type 2 pred 0", 'type 2 pred 0 filename { "box.dae" "box.stl" }'))
    (report,) = json.loads(run("shown.raff", "--json", "--format", "mjcf").out)
    assert report["files"] == ["generated/shown.xml", "generated/meshes/shown/box.dae.stl"]


EVERY_FORMAT = """
import sys, raff2urdf
for format in ("urdf", "sdf", "mjcf"):
    raff2urdf.convert("delta4.raff", f"made{sys.argv[1]}", format=format)
"""


def test_every_format_has_the_same_bytes_every_time(folder: Path) -> None:
    for seed in "12":
        environment = os.environ | {"PYTHONHASHSEED": seed}
        subprocess.run([sys.executable, "-c", EVERY_FORMAT, seed], cwd=folder, env=environment, check=True)
    written = {name for name in files_in(folder / "made1") if not name.startswith("meshes/")}
    assert written == {"delta4.urdf", "delta4.constraints.json", "delta4.sdf", "delta4.xml"}
    assert files_in(folder / "made1") == files_in(folder / "made2")


@pytest.mark.parametrize(("call", "words"), [
    ("two.raff --robot rigth", "two.raff: there is no robot 'rigth': did you mean 'right'?"),
    ("arm.raff --format sdf --density -1", "the density is -1 kg/m3: it must be a number above 0"),
    ("skew.raff --loop frame5-frame7=ball", "no loop 'frame5-frame7': did you mean 'frame5-frame6'?"),
    ("skew.raff --loop frame5-frame6=bal", "'bal' is not a kind of loop: did you mean 'ball'?"),
    ("skew.raff --loop frame5-frame6", "write NAME=KIND"),
])  # fmt: skip
def test_what_is_asked_for_wrongly_is_an_error_that_writes_nothing(folder: Path, run: Run, call: str, words: str):
    assert words in run(*call.split(), code=1).err
    assert not (folder / "generated").exists()


@pytest.mark.parametrize("options", [("--format", "mjcf"), ("--check",)])
def test_a_home_outside_the_limits_is_told(folder: Path, run: Run, options: tuple[str, ...]) -> None:
    text = skew_four_bar().replace("link 1 {", "link 1 { limits { 170 171 } ", 1)
    (folder / "stuck.raff").write_text(text)
    said = run("stuck.raff", *options, "--loop", "frame5-frame6=ball").err
    assert "home is outside those of joint1 (-87.43 deg, limit 170)" in said


# --- options -----------------------------------------------------------------------------------------------------


def test_errors_are_in_the_json_and_on_stderr(folder: Path, run: Run) -> None:
    (folder / "bad.raff").write_text("RAFF bad\nunits inch\nrobo r { }\n")
    out, err = run("bad.raff", "arm.raff", "--json", code=1)
    bad, arm = json.loads(out)
    assert bad["file"] == "bad.raff"
    assert [error.split("\n")[0] for error in bad["errors"]] == [
        "bad.raff:2:7: unknown unit 'inch' (known: um, mm, cm, m)",
        "bad.raff:3:1: unknown word 'robo' in the file: did you mean 'robot'?",
    ]
    assert all(error in err for error in bad["errors"])
    assert arm["mobility"] == 2


def test_a_check_writes_nothing(folder: Path, run: Run) -> None:
    out, err = run("--check", "arm.raff", "two.raff", "delta4.raff")
    assert err == ""
    lines = out.splitlines()
    assert len(lines) == 4  # one for each robot
    assert lines[0].endswith(": 2 links, 2 joints, 0 loops, mobility 2: syntax and structure are valid")
    assert re.fullmatch(r".*, mobility 3: syntax and structure are valid, loops close to \de-1\d at home", lines[-1])
    assert not (folder / "generated").exists()


def test_a_loop_may_be_closed_by_another_kind(folder: Path, run: Run) -> None:
    """The error names the option that helps: the library's `loops={...}` is of no use to one who typed a command."""
    refused = run("skew.raff", code=1).err
    assert refused.startswith("skew.raff: ")
    assert "--loop frame5-frame6=ball" in refused
    assert run("skew.raff", "--loop", "frame5-frame6=ball").err == ""
    assert constraints.load(folder / "generated" / "skew.constraints.json")["loops"][0]["kind"] == "ball"


def test_a_warning_is_a_line_on_stderr_and_no_failure(folder: Path, run: Run) -> None:
    (folder / "odd.raff").write_text(ARM.replace("pred 1", 'pred 1 limits { 10 20 } filename { "a.stl" }'))
    first, second = (line for line in run("odd.raff").err.splitlines() if not line.startswith(" "))
    assert first.startswith("warning: odd.raff:4:")
    assert "home 0 of link 2 is outside its limits 10 to 20" in first
    assert "link2: a.stl (not found)" in second


# --- wrong input -------------------------------------------------------------------------------------------------


def test_files_that_are_bad_or_cannot_be_read_do_not_stop_the_others(folder: Path, run: Run) -> None:
    (folder / "folder.raff").mkdir()
    (folder / "bad.raff").write_text("RAFF bad\nrobot r { link 1 { type 2 pred 5 } }")
    said = run("arm.raff", "bad.raff", "missing.raff", "folder.raff", "two.raff", code=1).err
    lines = [line for line in said.splitlines() if ": " in line]
    assert [line.split(":")[0] for line in lines] == ["bad.raff", "missing.raff", "folder.raff"]
    assert all("can't be read: " in line for line in lines[1:])
    assert {path.name.split(".")[0] for path in (folder / "generated").glob("*.urdf")} == {"arm", "two"}


ONE = "link 1 { type 2 pred 0 }"

WRONG = {
    "a number used twice": (f"RAFF bad\nrobot r {{\n  {ONE}\n  {ONE}\n}}", "bad.raff:4:8: number 1 twice first line 3"),
    "binary": ("\x7fELF\2\1\1\0\0", "bad.raff: line 1 binary"),
    "a line of 10 MB": (f"RAFF bad\n{10_000_000 * 'x'}", "bad.raff:2:1: line 2 10000000 characters"),
    "a file of 300 MB": (None, "bad.raff: larger than 256 MiB"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_refused_with_its_place_and_cause_and_nothing_is_touched(folder: Path, run: Run, name: str):
    """What an earlier run wrote stays."""
    content, words = WRONG[name]
    (folder / "bad.raff").write_text(content or "")
    if content is None:
        os.truncate(folder / "bad.raff", 300 * 2**20)  # a hole: takes no room on the disk
    (folder / "generated").mkdir()
    for file in ("bad.urdf", "bad.constraints.json"):
        (folder / "generated" / file).write_text(f"an older {file}")
    before = files_in(folder / "generated")
    out, err = run("bad.raff", code=1)
    assert out == ""
    assert len(err) < 2000
    assert_in_order(words, err)
    assert files_in(folder / "generated") == before


def test_one_bad_robot_keeps_the_whole_file_from_being_written(folder: Path, run: Run) -> None:
    bad = skew_four_bar().split("\n", 1)[1]
    (folder / "both.raff").write_text(f"RAFF both\nrobot good {{ base {{ }} {ONE} }}\n{bad}")
    run("both.raff", code=1)
    assert not (folder / "generated").exists()


# --- size --------------------------------------------------------------------------------------------------------


def test_a_file_of_more_links_than_python_recurses_converts(folder: Path, run: Run) -> None:
    (folder / "long.raff").write_text(serial(1100))
    (report,) = json.loads(run("long.raff", "--json").out)
    assert (report["links"], report["mobility"]) == (1100, 1100)


@pytest.mark.parametrize("text_of", [serial, lambda count: side_by_side(*[four_bar()] * count)], ids=["arm", "loops"])
def test_twice_the_robot_takes_twice_the_work(tmp_path: Path, text_of: Callable[[int], str]) -> None:
    """Counted in calls, which no other process disturbs."""
    sizes = (50, 100, 200) if text_of is serial else (5, 10, 20)
    calls = []
    for size in (sizes[0], *sizes):  # the first run also pays for imports
        path = tmp_path / f"{size}.raff"
        path.write_text(text_of(size))
        profile = cProfile.Profile()
        profile.runcall(raff2urdf.convert, path, tmp_path)
        calls.append(pstats.Stats(profile).total_calls)
    _, single, two, four = calls
    assert four - two <= 2.2 * (two - single)


# --- in the same process -----------------------------------------------------------------------------------------


def test_main_leaves_the_callers_warnings_alone(folder: Path) -> None:
    before = warnings.showwarning
    main([str(folder / "arm.raff"), "--check"])
    assert warnings.showwarning is before


@pytest.mark.parametrize("dialect", ["json", "mimic"])
@pytest.mark.parametrize(("stem", "name"), [(b"c\xff", "c"), (b"d\x01--", "d"), (b"e", "a]]>b"), (b"f", "a\ufffeb")])
def test_names_that_xml_has_no_characters_for(folder: Path, stem: bytes, name: str, dialect: str) -> None:
    path = folder / f"{os.fsdecode(stem)}.raff"
    path.write_text(ARM.replace("RAFF arm", f'RAFF "{name}"', 1), encoding="utf-8")
    assert name in path.read_text(encoding="utf-8")
    (conversion,) = raff2urdf.convert(path, folder / "made", dialect=dialect)
    if dialect == "mimic":
        assert conversion.constraints is not None
        conversion.constraints.unlink()
    assert cinegen.load(conversion.file).mobility == 2
