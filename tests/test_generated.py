"""`generated/` holds what the converter makes of `robots/` today (`make generated` renews it)."""

from __future__ import annotations

import pytest

import raff2urdf
from raff2urdf.cli import main


def test_generated_is_what_the_converter_makes_today(root, tmp_path):
    assert main([*map(str, sorted((root / "robots").glob("*.raff"))), "--out", str(tmp_path)]) == 0
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    kept = {path.name: path.read_bytes() for path in (root / "generated").iterdir()}
    stale = [name for name in made if kept.get(name) != made[name]]
    assert not stale, "run `make generated`"
    assert set(kept) == set(made), "generated/ holds what no robot makes"


def test_every_robot_ends_in_a_tool_or_a_platform_last_in_its_file(root):
    for path in sorted((root / "robots").glob("*.raff")):
        for robot in raff2urdf.load(path).robots:
            assert robot.parts[-1].name in ("tool", "platform"), path


@pytest.mark.parametrize("options", [[], ["--check"]])
def test_no_robot_of_ours_is_warned_of(root, options, tmp_path, capsys):
    files = map(str, sorted((root / "robots").glob("*.raff")))
    assert main([*files, "--out", str(tmp_path), *options]) == 0
    assert "warning" not in capsys.readouterr().err
