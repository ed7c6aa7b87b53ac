"""`generated/` holds what the converter makes of `robots/` today (`make generated` renews it)."""

import zlib
from pathlib import Path

import raff2urdf
from raff2urdf.cli import main


def files_in(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_generated_is_what_the_converter_makes_today(root, tmp_path):
    assert main([*map(str, sorted((root / "robots").glob("*.raff"))), "--output", str(tmp_path)]) == 0
    made, kept = files_in(tmp_path), files_in(root / "generated")
    assert any(name.startswith("meshes/") for name in made)
    stale = [name for name in made if kept.get(name) != made[name]]
    assert not stale, "run `make generated`"
    assert set(kept) == set(made), "generated/ holds what no robot makes"


def test_meshes_are_small(root):
    """They are binary, and every version of them stays in the history: once for each content, compressed."""
    contents = {path.read_bytes() for path in (root / "generated" / "meshes").rglob("*.stl")}
    assert sum(len(zlib.compress(content)) for content in contents) < 150_000


def test_every_robot_ends_in_a_tool_or_a_platform_last_in_its_file(root):
    for path in sorted((root / "robots").glob("*.raff")):
        for robot in raff2urdf.load(path).robots:
            assert robot.parts[-1].name in ("tool", "platform"), path


def test_no_robot_of_ours_is_warned_of(root, tmp_path, capsys):
    files = [str(path) for path in sorted((root / "robots").glob("*.raff"))]
    for options in (["--output", str(tmp_path)], ["--check"]):
        assert main([*files, *options]) == 0
        assert "warning" not in capsys.readouterr().err
