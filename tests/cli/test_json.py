"""What `--json` prints has the keys that docs/commands.md lists, no more and no fewer."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from cinegen.cli import main
from cinegen.mission import MissionRecorder, RobotSample
from cinegen.singularities.slice import Coordinates

KEY = re.compile(r"`([^`]+)`")


def documented(root, command, number=0):
    """Patterns of keys, of one of the tables of a command."""
    page = (root / "docs/commands.md").read_text(encoding="utf-8")
    section = re.search(rf"^### {command}\n(.*?)(?=^### |\Z)", page, flags=re.MULTILINE | re.DOTALL)[1]
    table = re.findall(r"^\| key \| value \|\n\|[-| ]+\|\n((?:\|.*\n)+)", section, flags=re.MULTILINE)[number]
    return {key for row in table.splitlines() for key in KEY.findall(row.split("|")[1])}


def keys(value, path=""):
    """The paths of all values."""
    if isinstance(value, dict):
        return {found for key, one in value.items() for found in keys(one, f"{path}.{key}" if path else key)}
    if isinstance(value, list) and value and isinstance(value[0], (dict, list)):
        return {found for one in value for found in keys(one, f"{path}[]")}
    return {path}


def check(root, document, command, number=0, absent=()):
    found = keys({"": document})
    found = {key.removeprefix(".").removeprefix("[].").removeprefix("[]") for key in found}
    patterns = documented(root, command, number)
    forms = {pattern: re.compile(re.escape(pattern).replace(r"\*", r".+")) for pattern in patterns}
    unknown = {key for key in found if not any(form.fullmatch(key) for form in forms.values())}
    empty = {key for key in unknown if any(pattern.startswith((f"{key}.", f"{key}[]")) for pattern in patterns)}
    assert unknown - empty == set()  # null, or an empty list, stands for all below it
    missing = {pattern for pattern, form in forms.items() if not any(map(form.fullmatch, found))}
    assert {one for one in missing if not any(one.startswith((f"{key}.", f"{key}[]")) for key in empty)} == set(absent)


@pytest.fixture
def printed(root, capsys, monkeypatch, tmp_path):
    """`printed("info", "four_bar.raff")`: the document that a command prints, in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def call(*words, code=0):
        files = [str(root / "robots" / word) if word.endswith((".raff", ".toml")) else word for word in words]
        assert main([*files, "--json"]) == code
        return json.loads(capsys.readouterr().out, parse_constant=pytest.fail)

    return call


def test_info(root, printed):
    check(root, printed("info", "four_bar.raff", "planar_3r.raff"), "info")


def test_modes(root, printed):
    check(root, printed("modes", "four_bar.raff"), "modes")
    check(root, printed("modes", "gough.raff", "--lengths", "100,2000,100,2000,100,2000", code=1), "modes")


def test_singular(root, printed):
    check(root, printed("singular", "five_bar.raff"), "singular")


def test_singular_of_a_recording(root, robot, printed, tmp_path):
    mechanism = robot("tssm")
    pose = {"x": 0.0, "y": 0.0, "z": 0.02, "rx": 0.0, "ry": 0.0}
    coordinates = Coordinates(mechanism, (*pose, "rz"))
    with MissionRecorder(tmp_path / "run.jsonl", {"tssm": mechanism}) as recorder:
        for k, angle in enumerate(np.radians([84.0, 88.0, 92.0, 96.0])):
            recorder.write(float(k), {"tssm": RobotSample(coordinates.from_home({**pose, "rz": angle}), "IDLE")})
    check(root, printed("singular", "run.jsonl"), "singular", 1)


def test_maps(root, printed):
    region = ("planar_3r.raff", "--over", "x=-0.3..0.3:4", "--at", "y=0.2")
    check(root, printed("map", *region, "-o", "a.zarr"), "map")
    check(root, printed("map", *region, "--vary", "link2.d=300..500:2", "-o", "sweep"), "map", 1)
    check(root, printed("compare", "a.zarr", "a.zarr"), "compare")


def test_plan(root, printed):
    check(root, printed("plan", "scenes/disc.toml"), "plan", absent={"base[]"})


def test_sensors(root, printed, monkeypatch):
    check(root, printed("sensors", "five_bar.raff"), "sensors")
