"""Generated files that somebody changed are kept, in every writer; those that nobody changed are replaced."""

import json
import re
import shutil
from pathlib import Path

import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from urdf_text import UrdfJoint, urdf_text

import raff2urdf
from cinegen import load
from cinegen.cli import main as cinegen
from cinegen.mission.formats import FORMATS
from raff2urdf.cli import main as convert
from raff2urdf.files import GENERATED, MARK, check_new, signed, write_all
from raff2urdf.urdf2raff.cli import main as urdf2raff

CHANGED = r"was changed by hand since cinegen generated it: name another file, or replace it with --force"
EXISTS = r"exists already: name another file, or replace it with --force"

# files that may be made again: what writes them, and the files
REMADE = {
    "urdf": ("raff2urdf delta4.raff -o ./", "delta4.urdf delta4.constraints.json meshes/delta4/delta_base.nff.1.stl"),
    "mjcf": ("raff2urdf four_bar.raff -o ./ --format mjcf", "four_bar.xml"),
    "dialect": ("raff2urdf four_bar.raff -o ./ --loops robot.yaml", "four_bar.yaml"),
    "c": ("cinegen generate four_bar.raff --to c --functions fk", "four_bar.c"),
    "page": ("cinegen page four_bar.raff -o page.html", "page.html"),
    "scan": (
        "cinegen singular planar_3r.raff --over joint2,joint3 --grid 8 -o scan.json --plot scan.png",
        "scan.json scan.png",
    ),
    "proof": ("cinegen prove five_bar.raff --over x=-10..10mm,y=450..460mm -o proof.json", "proof.json"),
    "png": ("cinegen modes four_bar.raff --plot modes.png", "modes.png"),
    "pdf": ("cinegen modes four_bar.raff --plot modes.pdf", "modes.pdf"),
}

NAMED_ANEW = ("page",)
"""Files in which meshcat's objects have random names."""

MAINS = {"raff2urdf": convert, "cinegen": cinegen, "urdf2raff": urdf2raff}


@pytest.fixture
def run(root, tmp_path, monkeypatch, capsys):
    """`run("raff2urdf delta4.raff -o ./")` in a folder with the robots; returns the exit code and standard error."""
    for name in ("four_bar", "delta4", "planar_3r", "five_bar"):
        shutil.copy(root / "robots" / f"{name}.raff", tmp_path)
    shutil.copytree(root / "robots/graphics", tmp_path / "graphics")
    monkeypatch.chdir(tmp_path)

    def call(line: str):
        program, *arguments = line.split()
        code = MAINS[program](arguments)
        return code, capsys.readouterr().err

    return call


def edit(path: Path) -> bytes:
    """Change a byte of a file; return its content."""
    content = bytearray(path.read_bytes())
    content[2 * len(content) // 3] ^= 1
    path.write_bytes(content)
    return bytes(content)


@pytest.mark.parametrize("writer", REMADE)
def test_a_changed_file_is_only_replaced_with_force(run, writer):
    line, names = REMADE[writer]
    paths = [Path(name) for name in names.split()]
    assert run(line)[0] == 0
    made = {path: path.read_bytes() for path in paths}
    for content in made.values():
        assert MARK.encode() in content
        assert GENERATED.encode() not in content, "its digest is blank"
    assert run(line) == (0, "")
    if writer not in NAMED_ANEW:
        assert {path: path.read_bytes() for path in paths} == made, "the same input, the same bytes"
    edited = {path: edit(path) for path in paths}
    code, err = run(line)
    assert code == 1
    for path in paths:  # one answer names all
        assert re.search(f"{re.escape(str(path))}: {CHANGED}", err)
    assert {path: path.read_bytes() for path in paths} == edited
    assert run(f"{line} --force")[0] == 0
    assert all(path.read_bytes() != content for path, content in edited.items())


def test_what_carries_a_digest_is_still_a_file_of_its_format(run):
    for writer in ("urdf", "png", "scan"):
        assert run(REMADE[writer][0])[0] == 0
    with Image.open("modes.png") as picture:
        picture.verify()  # the checksum of each chunk
        assert picture.info["Software"].startswith(MARK)
    mesh = trimesh.load("meshes/delta4/delta_base.nff.1.stl")
    assert len(mesh.faces)
    assert json.loads(Path("scan.json").read_text())["origin"].startswith(MARK)
    assert load("delta4.urdf").mobility == 3


def test_line_endings_are_no_change(run):
    assert run("raff2urdf four_bar.raff -o ./")[0] == 0
    for name in ("four_bar.urdf", "four_bar.constraints.json"):
        made = Path(name).read_bytes()
        Path(name).write_bytes(made.replace(b"\n", b"\r\n"))  # as git does on Windows
        assert run("raff2urdf four_bar.raff -o ./") == (0, "")
        assert Path(name).read_bytes() == made


def test_another_name_keeps_a_changed_file(run):
    assert run("raff2urdf four_bar.raff -o ./")[0] == 0
    edited = edit(Path("four_bar.constraints.json"))
    assert run("raff2urdf four_bar.raff -o other.urdf")[0] == 0
    assert Path("four_bar.constraints.json").read_bytes() == edited


def test_files_of_older_versions_have_no_digest_and_are_replaced(run):
    assert run("raff2urdf four_bar.raff -o ./")[0] == 0
    urdf, constraints = Path("four_bar.urdf"), Path("four_bar.constraints.json")
    made = urdf.read_bytes()
    urdf.write_bytes(re.sub(rb", digest \w+", b"", made))
    constraints.write_bytes(re.sub(rb',\s+"generated": "[^"]*"', b"", constraints.read_bytes()))
    assert run("raff2urdf four_bar.raff -o ./") == (0, "")
    assert urdf.read_bytes() == made


def test_without_its_mark_a_file_is_somebodys(run):
    assert run("raff2urdf four_bar.raff -o ./")[0] == 0
    constraints = Path("four_bar.constraints.json")
    constraints.write_bytes(re.sub(rb',\s+"generated": "[^"]*"', b"", constraints.read_bytes()))
    code, err = run("raff2urdf four_bar.raff -o ./")
    assert code == 1
    assert re.search(f"four_bar.constraints.json: {EXISTS}", err)


def test_a_healed_urdf_is_kept_if_it_is_changed(run):
    assert run("raff2urdf four_bar.raff -o ./")[0] == 0
    text = Path("four_bar.urdf").read_text(encoding="utf-8")
    tilted = text.replace('xyz="0.12 0.0 0.0" rpy="0.0 0.0 0.0"', 'xyz="0.12 0.0 0.0" rpy="5e-05 0.0 0.0"')
    Path("tilted.urdf").write_text(tilted, encoding="utf-8")
    shutil.copy("four_bar.constraints.json", "tilted.constraints.json")
    assert run("cinegen heal tilted.urdf healed.urdf")[0] == 0
    constraints = Path("healed.constraints.json")
    edited = edit(constraints)
    code, err = run("cinegen heal tilted.urdf healed.urdf")
    assert code == 1
    assert re.search(f"{constraints}: {CHANGED}", err)
    assert constraints.read_bytes() == edited


def test_graphics_next_to_a_raff_are_kept(run, tmp_path):
    trimesh.creation.box((0.1, 0.2, 0.3)).export("box.stl")
    visual = '<visual><origin xyz="0 0 1"/><geometry><mesh filename="box.stl"/></geometry></visual>'
    Path("arm.urdf").write_text(urdf_text([UrdfJoint("j", "base", "hand")], {"base": visual}))
    line = "urdf2raff arm.urdf -o arm.raff"
    assert run(line)[0] == 0
    (graphic,) = tmp_path.glob("arm_graphics/*.glb")
    made = graphic.read_bytes()
    Path("arm.raff").unlink()
    assert run(line)[0] == 0, "the same graphic is no obstacle"
    Path("arm.raff").unlink()
    edited = edit(graphic)
    code, err = run(line)
    assert code == 1
    assert re.search(f"{graphic.name}: {EXISTS}", err)
    assert graphic.read_bytes() == edited
    assert not Path("arm.raff").exists()
    assert run(f"{line} --force")[0] == 0
    assert graphic.read_bytes() == made


@given(st.binary(max_size=300), st.binary(max_size=6000))
def test_a_digest_is_of_all_bytes_but_its_own(before, after):
    content = signed(before + GENERATED.encode() + after)
    assert len(content) == len(before + GENERATED.encode() + after)
    assert signed(content) == content
    assert signed(content + b"x") != content + b"x"
    assert signed(b"x" + content) != b"x" + content


def test_a_blank_digest_of_a_text_that_a_program_wrote_is_none(text_file):
    path = text_file("own.c", f"/* {GENERATED} */")
    check_new(path)
    write_all({path: path.read_bytes()})
    check_new(path)
    path.write_bytes(path.read_bytes() + b"int edited;")
    with pytest.raises(raff2urdf.RaffError, match=CHANGED):
        check_new(path)


def test_exported_motions_and_recordings_are_always_kept(run):
    for line, out in (
        *((f"cinegen export run.jsonl --to {to} -o m{form.suffix}", f"m{form.suffix}") for to, form in FORMATS.items()),
        ("cinegen drive four_bar.raff --record run.jsonl", "run.jsonl"),
    ):
        write_all({Path(out): GENERATED.encode()})
        kept = Path(out).read_bytes()
        code, err = run(line)
        assert code == 1
        assert re.search(f"{out}: {EXISTS}", err)
        assert Path(out).read_bytes() == kept
