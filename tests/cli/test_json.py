"""What `--json` prints has the shape that docs/reference/json.md describes: each table is a JSON schema."""

import json
import re

import jsonschema
import numpy as np
import pytest
from calibration_data import planar_arm

import raff2urdf.cli
import raff2urdf.urdf2raff.cli
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
    lists = [name.removesuffix("s") for name in types.split(" or ") if name not in TYPES]
    choices = [{"type": TYPES[name]} for name in types.split(" or ") if name in TYPES]
    if lists:
        choices.append({"type": "array", "items": {"anyOf": [{"type": TYPES[name]} for name in lists]}})
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
        value_schema = leaf(types) if set(inner) == {""} else schema(inner)
        if name.endswith("[]"):
            value_schema = {"type": ["array", "null"], "items": value_schema}
        name = name.removesuffix("[]")
        if name == "*":
            other = value_schema
            continue
        properties[name] = value_schema
        required += [] if optional else [name]
    return {"type": ["object", "null"], "properties": properties, "required": required, "additionalProperties": other}


def check(root, document, command, number=0):
    """Check a document, or each document of a list, against a table."""
    of = schema(documented(root, command, number))
    for entry in document if isinstance(document, list) else [document]:
        assert entry is not None
        jsonschema.Draft202012Validator(of).validate(entry)


@pytest.fixture
def checked(root, typed, monkeypatch, tmp_path):
    """`checked("info", "four_bar")`: what a command prints as JSON, in an empty folder, once it has the shape of the
    command's table."""
    monkeypatch.chdir(tmp_path)

    def run(command, *words, number=0, code=0):
        document = json.loads(typed(command, *words, "--json", code=code).out, parse_constant=pytest.fail)
        check(root, document, command, number)
        return document

    return run


@pytest.mark.parametrize(
    ("words", "code"),
    [
        ("info four_bar planar_3r scara", 0),
        ("ik five_bar --at x=0.01 --all", 0),
        ("ik five_bar --at x=0.01", 0),
        ("ik planar_3r --at x=9,rz=20 --all", 1),
        ("modes four_bar", 0),
        ("modes gough --values 0.1,2,0.1,2,0.1,2", 1),
        ("singular five_bar", 0),
        ("singular tssm --at rx=0,ry=0,rz=90", 0),
        ("forces four_bar --massless --payload 2kg", 0),
        ("forces planetary_gear --massless --wrench carrier=0,0,0,0,0,1", 0),
        ("tolerance five_bar --sigma link*.d=0.1mm,link2.alpha=0.1deg --samples 100", 0),
        ("plan disc", 0),
        ("sensors five_bar", 0),
    ],
)
def test_a_document_has_the_shape_of_its_table(checked, words, code):
    checked(*words.split(), code=code)


def test_heal(root, checked, tmp_path):
    text = (root / "robots/four_bar.raff").read_text(encoding="utf-8")
    (tmp_path / "tilted").write_text(text.replace("d 120.0 }", "d 120.0 alpha 0.003 }"), encoding="utf-8")
    checked("heal", "tilted", "healed")


def test_forces_along_a_recorded_motion(checked):
    checked("plan", "disc", "-o", "run.jsonl")
    checked("forces", "planar_3r", "--massless", "--payload", "2kg", "--trajectory", "run.jsonl", number=1)


def test_calibrate(checked, tmp_path):
    (tmp_path / "m.csv").write_text(planar_arm(), encoding="utf-8")
    words = "calibrate", "planar_3r", "m.csv", "--vary", "link*.d"
    assert [outlier["pose"] for outlier in checked(*words)["outliers"]] == ["5"]
    checked(*words, "--propose", "3")


def test_synthesize(checked, tmp_path):
    task = tmp_path / "task.toml"
    text = 'starts = 1\nties = ["link2.d = link4.d"]\n[parameters]\n"link2.d" = "200..400mm"\n'
    text += '[reach]\nx = "-50..50mm"\ny = "350..400mm"\n[[objective]]\nminimise = "condition"\n'
    task.write_text(text, encoding="utf-8")
    checked("synthesize", "five_bar", "--task", "task.toml", "-o", "best.raff")
    assert (tmp_path / "best.raff").is_file()
    assert not list(tmp_path.glob("*.json"))
    text = 'starts = 1\n[parameters]\n"link2.d" = "80..160mm"\n"frame4.d" = "300..400mm"\n'
    text += '[function]\ninput = "joint1"\noutput = "joint3"\npairs = [[50, 88.735], [80, 96]]\n'
    task.write_text(text, encoding="utf-8")
    checked("synthesize", "four_bar", "--task", "task.toml", "-o", "linkage.raff", number=1)


def test_singular_of_a_recording(robot, checked, tmp_path):
    mechanism = robot("tssm")
    pose = {"x": 0.0, "y": 0.0, "z": 0.02, "rx": 0.0, "ry": 0.0}
    coordinates = Coordinates(mechanism, (*pose, "rz"))
    with MissionRecorder(tmp_path / "run.jsonl", {"tssm": mechanism}) as recorder:
        for k, angle in enumerate(np.radians([84.0, 88.0, 92.0, 96.0])):
            recorder.write(float(k), {"tssm": RobotSample(coordinates.from_home({**pose, "rz": angle}), "IDLE")})
    checked("singular", "run.jsonl", number=1)


def test_maps(checked, tmp_path):
    region = ("planar_3r", "--over", "x=-0.3..0.3:4", "--at", "y=0.2")
    checked("map", *region, "-o", "a.zarr")
    checked("map", *region, "--vary", "link2.d=0.3..0.5:2", "-o", "sweep", number=1)
    checked("compare", "a.zarr", "a.zarr", "--plot", "both.png")
    assert (tmp_path / "both.png").stat().st_size > 10_000


def test_proofs(checked):
    box = ("--over", "z=0.95..1.3", "--limits", "--boxes", "7")
    checked("prove", "gough", *box, code=1)
    checked("check-proof", "gough-proof.json", code=1)
    box = ("--over", "x=-10..10mm,y=500..510mm", "--sigma", "0.5", "-o", "sigma.json")
    proof = checked("prove", "five_bar", *box, code=1)
    assert {witness["sigma"] for witness in proof["witnesses"]} == {"sigma_1"}
    box = ("--over", "x=-10..10mm,y=500..510mm", "--clearance", "300mm", "-o", "near.json")
    proof = checked("prove", "five_bar", *box, code=1)
    assert {witness["clearance"] for witness in proof["witnesses"]} <= {"base and link2", "base and link4"}


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
