"""What `--json` prints has the shape that docs/reference/json.md describes: each table is a JSON schema."""

import json
import re

import jsonschema
import numpy as np
import pytest

import raff2urdf.cli
import raff2urdf.urdf2raff.cli
from cinegen.cli import main
from cinegen.mission import MissionRecorder, RobotSample
from cinegen.singularities.slice import Coordinates

KEY = re.compile(r"`([^`]+)`")


TYPES = {"string": "string", "boolean": "boolean", "integer": "integer", "number": "number", "null": "null"}


def documented(root, command, number=0):
    """Keys and their types, of one of the tables of a command."""
    page = (root / "docs/reference/json.md").read_text(encoding="utf-8")
    section = re.search(rf"^## {command}\n(.*?)(?=^## |\Z)", page, flags=re.MULTILINE | re.DOTALL)[1]
    table = re.findall(r"^\| key \| type \| value \|\n\|[-| ]+\|\n((?:\|.*\n)+)", section, flags=re.MULTILINE)[number]
    rows = [row.split("|")[1:3] for row in table.splitlines()]
    return {key: types.strip() for keys, types in rows for key in KEY.findall(keys)}


def leaf(types):
    """The schema of a type as it is written: `string`, `number or null`, `numbers`."""
    lists = [one.removesuffix("s") for one in types.split(" or ") if one not in TYPES]
    choices = [{"type": TYPES[one]} for one in types.split(" or ") if one in TYPES]
    if lists:
        choices.append({"type": "array", "items": {"anyOf": [{"type": TYPES[one]} for one in lists]}})
    return {"anyOf": choices}


def schema(rows):
    """The schema of an object with these keys; those below an object or a list that is null are absent with it."""
    groups = {}
    for key, types in rows.items():
        first, _, rest = key.partition(".")
        groups.setdefault(first, {})[rest] = types
    properties, required, other = {}, [], False
    for name, inner in groups.items():
        optional = all(types.endswith(", optional") for types in inner.values())
        types = next(iter(inner.values())).removesuffix(", optional")
        found = leaf(types) if set(inner) == {""} else schema(inner)
        if name.endswith("[]"):
            found = {"type": ["array", "null"], "items": found}
        name = name.removesuffix("[]")
        if name == "*":
            other = found
            continue
        properties[name] = found
        required += [] if optional else [name]
    return {"type": ["object", "null"], "properties": properties, "required": required, "additionalProperties": other}


def check(root, document, command, number=0):
    """Check a document, or each document of a list, against a table."""
    of = schema(documented(root, command, number))
    for one in document if isinstance(document, list) else [document]:
        assert one is not None
        jsonschema.Draft202012Validator(of).validate(one)


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
    check(root, printed("info", "four_bar.raff", "planar_3r.raff", "scara.raff"), "info")


def test_ik(root, printed):
    check(root, printed("ik", "five_bar.raff", "--at", "x=0.01", "--all"), "ik")
    check(root, printed("ik", "five_bar.raff", "--at", "x=0.01"), "ik")
    check(root, printed("ik", "planar_3r.raff", "--at", "x=9,rz=20", "--all", code=1), "ik")


def test_heal(root, printed, tmp_path):
    text = (root / "robots/four_bar.raff").read_text(encoding="utf-8")
    (tmp_path / "tilted").write_text(text.replace("d 120.0 }", "d 120.0 alpha 0.003 }"), encoding="utf-8")
    check(root, printed("heal", "tilted", "healed"), "heal")


def test_modes(root, printed):
    check(root, printed("modes", "four_bar.raff"), "modes")
    check(root, printed("modes", "gough.raff", "--values", "0.1,2,0.1,2,0.1,2", code=1), "modes")


def test_singular(root, printed):
    check(root, printed("singular", "five_bar.raff"), "singular")
    check(root, printed("singular", "tssm.raff", "--at", "rx=0,ry=0,rz=90"), "singular")


def test_forces(root, printed):
    check(root, printed("forces", "four_bar.raff", "--massless", "--payload", "2kg"), "forces")
    check(root, printed("forces", "planetary_gear.raff", "--massless", "--wrench", "carrier=0,0,0,0,0,1"), "forces")
    printed("plan", str(root / "robots/scenes/disc.toml"), "-o", "run.jsonl")
    along = printed("forces", "planar_3r.raff", "--massless", "--payload", "2kg", "--trajectory", "run.jsonl")
    check(root, along, "forces", 1)


def test_tolerance(root, printed):
    sigma = ("--sigma", "link*.d=0.1mm, link2.alpha=0.1deg")
    check(root, printed("tolerance", "five_bar.raff", *sigma, "--samples", "100"), "tolerance")


def test_calibrate(root, printed, tmp_path):
    lines = ["pose,joint1 [deg],joint2 [deg],joint3 [deg],tool.x [mm],tool.y [mm]", "sigma,,,,1,1"]
    for i, (a, b, c) in enumerate(np.random.default_rng(0).uniform(-90.0, 90.0, (12, 3))):
        arms = zip((405.0, 300.0, 200.0), np.radians(np.cumsum([a, b, c])), strict=True)
        x, y = np.sum([(r * np.cos(t), r * np.sin(t)) for r, t in arms], axis=0)
        lines.append(f"{i},{a},{b},{c},{x},{y + 30.0 * (i == 5)}")
    (tmp_path / "m.csv").write_text("\n".join(lines), encoding="utf-8")
    words = "calibrate", "planar_3r.raff", str(tmp_path / "m.csv"), "--vary", "link*.d"
    found = printed(*words)
    check(root, found, "calibrate")
    assert [one["pose"] for one in found["outliers"]] == ["5"]
    check(root, printed(*words, "--propose", "3"), "calibrate")


def test_synthesize(root, printed, tmp_path):
    task = tmp_path / "task.toml"
    text = 'starts = 1\nties = ["link2.d = link4.d"]\n[parameters]\n"link2.d" = "200..400mm"\n'
    text += '[reach]\nx = "-50..50mm"\ny = "350..400mm"\n[[objective]]\nminimise = "condition"\n'
    task.write_text(text, encoding="utf-8")
    out = str(tmp_path / "best.raff")
    check(root, printed("synthesize", "five_bar.raff", "--task", str(task), "-o", out), "synthesize")
    assert (tmp_path / "best.raff").is_file()
    assert not list(tmp_path.glob("*.json"))
    text = 'starts = 1\n[parameters]\n"link2.d" = "80..160mm"\n"frame4.d" = "300..400mm"\n'
    text += '[function]\ninput = "joint1"\noutput = "joint3"\npairs = [[50, 88.735], [80, 96]]\n'
    task.write_text(text, encoding="utf-8")
    out = str(tmp_path / "linkage.raff")
    found = printed("synthesize", "four_bar.raff", "--task", str(task), "-o", out)
    check(root, found, "synthesize", 1)


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
    check(root, printed("map", *region, "--vary", "link2.d=0.3..0.5:2", "-o", "sweep"), "map", 1)
    check(root, printed("compare", "a.zarr", "a.zarr"), "compare")


def test_proofs(root, printed):
    box = ("--over", "z=0.95..1.3", "--limits", "--boxes", "7")
    check(root, printed("prove", "gough.raff", *box, code=1), "prove")
    check(root, printed("check-proof", "gough-proof.json", code=1), "check-proof")
    box = ("--over", "x=-10..10mm,y=500..510mm", "--sigma", "0.5", "-o", "sigma.json")
    found = printed("prove", "five_bar.raff", *box, code=1)
    check(root, found, "prove")
    assert {witness["sigma"] for witness in found["witnesses"]} == {"sigma_1"}
    box = ("--over", "x=-10..10mm,y=500..510mm", "--clearance", "300mm", "-o", "near.json")
    found = printed("prove", "five_bar.raff", *box, code=1)
    check(root, found, "prove")
    assert {witness["clearance"] for witness in found["witnesses"]} <= {"base and link2", "base and link4"}


def test_plan(root, printed):
    check(root, printed("plan", "scenes/disc.toml"), "plan")


def test_raff2urdf(root, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    four_bar = str(root / "robots/four_bar.raff")
    for words, code in (([], 0), (["--format", "sdf"], 0), (["--check"], 0), (["none.raff"], 1)):
        assert raff2urdf.cli.main([four_bar, *words, "--json"]) == code
        check(root, json.loads(capsys.readouterr().out), "raff2urdf")


def test_urdf2raff(root, robot, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(robot("planar_3r").source.urdf)
    assert raff2urdf.urdf2raff.cli.main(["arm.urdf", "--json"]) == 0
    check(root, json.loads(capsys.readouterr().out), "urdf2raff")


def test_sensors(root, printed, monkeypatch):
    check(root, printed("sensors", "five_bar.raff"), "sensors")
