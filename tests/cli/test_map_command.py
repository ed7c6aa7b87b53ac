"""The commands `cinegen map` and `cinegen compare`: maps made, gone on with, told, drawn, varied, and refused."""

from __future__ import annotations

import hashlib
import importlib
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
import typer
from matplotlib.figure import Figure
from variants import slow

from cinegen.cli import app, main
from cinegen.cli.region import region
from cinegen.workspace import open_map


@pytest.fixture
def typed(root, capsys, monkeypatch, tmp_path):
    """`typed("map", "planar_3r", ...)`: what the command prints, in an empty folder; its errors where `err=True`."""
    monkeypatch.chdir(tmp_path)

    def command(name, *options, code=0, err=False):
        given = [root / f"robots/{options[0]}.raff", *options[1:]] if name == "map" else options
        assert main([name, *map(str, given)]) == code
        said = capsys.readouterr()
        return said.err if err else said.out

    return command


def told(text):
    """The numbers of the lines, by their first word."""
    return {words[0]: words[1:] for words in (line.split() for line in text.splitlines() if line.startswith("  "))}


def test_a_map_is_written_told_and_drawn(typed, tmp_path):
    said = typed("map", "planar_3r", "--over", "xy", "--grid", 24, "-o", "arm.zarr", "--plot", "arm.png")
    found = open_map("arm.zarr")
    assert found.sizes["x"] == found.sizes["y"] == 24
    numbers = told(said)
    cell = found.x.attrs["cell_width"] * found.y.attrs["cell_width"]
    assert float(numbers["reachable"][0]) == pytest.approx(int(found.reachable.sum()) * cell, rel=1e-3)
    assert "m^2," in numbers["reachable"]
    assert float(numbers["sigma_1"][1].rstrip(",")) == pytest.approx(float(found.sigma_1.min()), rel=0.01)
    assert (tmp_path / "arm.png").stat().st_size > 10_000


def test_the_same_command_again_computes_nothing_and_says_the_same(typed, tmp_path):
    options = ("map", "five_bar", "--over", "x=-0.3..0.3:20,y=0.1..0.6:20", "-o", "a.zarr")
    first = typed(*options)
    digest = _digest(tmp_path / "a.zarr")
    assert typed(*options) == first
    assert _digest(tmp_path / "a.zarr") == digest


def _digest(folder):
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return [(path.name, path.stat().st_mtime_ns, hashlib.sha256(path.read_bytes()).hexdigest()) for path in files]


def test_the_answer_as_json_has_all_numbers_in_si(typed):
    found = json.loads(typed("map", "delta4", "--over", "x=-500..500mm:8,y=-0.5..0.5:8", "--at", "z=-1800mm", "--json"))
    assert found["over"]["x"] == [-0.5, 0.5, 8]
    assert found["at"]["z"] == pytest.approx(-1.8)
    assert found["reachable"] == found["cells"] == 64
    assert found["extent"] == {"value": pytest.approx(1.0), "error": pytest.approx(0.0), "unit": "m^2"}
    assert set(found["quantities"]) == {"sigma_1", "sigma_2"}
    assert sum(found["status"].values()) == 64


def test_a_line_a_sphere_motors_and_a_scene(typed, root):
    on_line = json.loads(typed("map", "planar_3r", "--line", "0,0,0..1.2,0,0:30", "--json", "-o", "1.zarr"))
    assert on_line["extent"]["unit"] == "m"
    around = json.loads(
        typed("map", "delta4", "--over", "azimuth:6,elevation:4", "--at", "radius=0.2", "--centre=0,0,-1.8", "--json",
              "-o", "2.zarr")
    )  # fmt: skip
    assert around["extent"]["value"] == pytest.approx(4.0 * math.pi * 0.04)
    by_motors = json.loads(typed("map", "five_bar", "--over", "joint1:9,joint3=0..90deg:9", "--json", "-o", "3.zarr"))
    assert by_motors["over"]["joint3"][1] == pytest.approx(math.pi / 2)
    scene = root / "robots/scenes/rod.toml"
    kept = json.loads(
        typed("map", "planar_3r", "--over", "xy", "--grid", 6, "--scene", scene, "--json", "-o", "4.zarr")
    )
    assert "clearance" in kept["quantities"]


@pytest.mark.parametrize(("allowed", "least"), [([], (-1.0, 1.0)), (["base", "link2", "link3"], (5.0, 20.0))])
def test_collisions_that_a_scene_allows_do_not_count_as_clearance(typed, root, tmp_path, allowed, least):
    """A box 10 m away; nearer are only the arm's own links."""
    pairs = [[one, other] for i, one in enumerate(allowed) for other in allowed[i + 1 :]]
    pairs += [["link1", "link3"]] * bool(pairs)
    goal = {"point": [1, 0], "angle": 0.0}
    box = {"kind": "box", "size": [0.1, 0.1], "point": [10.0, 0.0]}
    values = {"robot": str(root / "robots/planar_3r.raff"), "goal": goal, "obstacle": [box]}
    values["allowed_collisions"] = pairs
    (tmp_path / "scene.json").write_text(json.dumps(values))
    typed("map", "planar_3r", "--over", "joint2:5,joint3:5", "--scene", tmp_path / "scene.json", "-o", "map.zarr")
    found = float(open_map("map.zarr").clearance.min())
    assert least[0] <= found <= least[1]


@pytest.mark.parametrize(("error", "says"), [(0.0, ""), (8.9e-16, ""), (0.002, " ± 0.002")])
def test_an_error_that_is_only_rounding_is_not_told(typed, monkeypatch, error, says):
    """All of a sphere within reach has no border, but sums of its cells may differ in their last bits."""
    area = 4.0 * math.pi * 0.2**2
    module = importlib.import_module("cinegen.workspace.extent")
    monkeypatch.setattr(module, "extent", lambda found: module.Extent(area, area - error, area, "m^2", 24))
    sphere = ("--over", "azimuth:6,elevation:4", "--at", "radius=0.2", "--centre", "0,0,-1.8")
    assert f"reachable       {area:.4g}{says} m^2, 100 %" in typed("map", "delta4", *sphere)


@pytest.mark.parametrize("value", ["-0.5,0,-1.8..0.5,0,-1.8:20", "-.5,1", *slow("-900mm", "-1e-3", "-3")])
@pytest.mark.parametrize(
    "words",
    [
        *(f"map F --{name}" for name in ("line", "centre", "along", "at", "over", "quantity", "output")),
        "map F --vary link2.d=1..2:3 --box", "map F -q", "modes F --values", "modes F --at", "singular F --at",
        "plan F --plot", "drive F --base",
        "sensors F --sensor", "forces F --gravity",
    ],
)  # fmt: skip
def test_what_begins_with_a_negative_number_is_a_value(words, value):
    command, *before, option = words.split()
    joined = [f"{option}={value}"] if option.startswith("--") else [f"{option}{value}"]
    parser = typer.main.get_command(app).commands[command]
    apart, together = (parser.make_context(command, [*before, *given]).params for given in ([option, value], joined))
    assert apart == together
    assert any(given in (value, [value], Path(value)) for given in apart.values())


def test_flags_take_no_numbers(typed):
    assert "unknown option '-0'" in typed("map", "planar_3r", "--json", "-0.5,0", code=2, err=True)


def test_a_line_begins_where_it_is_said_to(typed):
    on_line = json.loads(typed("map", "planar_3r", "--line", "-.3,0,0..0.3,0,0:6", "--json"))
    assert on_line["over"]["distance"] == [0.0, pytest.approx(0.6), 6]


def test_variants_get_a_table_and_files(typed, tmp_path):
    said = typed("map", "planar_3r", "--over", "xy", "--grid", 12, "--vary", "link2.d=0.3..0.5:2", "--box",
                 "x=0.2..0.4,y=0..0.2", "-o", "all", "--plot", "all.png")  # fmt: skip
    assert "link2.d" in said
    assert (tmp_path / "all/link2.d=300/robot.raff").is_file()
    assert (tmp_path / "all/table.csv").is_file()
    assert (tmp_path / "all.png").stat().st_size > 10_000
    found = json.loads(typed("map", "planar_3r", "--over", "xy", "--grid", 12, "--vary", "link2.d=0.3..0.5:2", "--box",
                             "x=0.2..0.4,y=0..0.2", "-o", "all", "--json"))  # fmt: skip
    assert [row["link2.d"] for row in found["rows"]] == [0.3, 0.5]
    assert found["units"] == {"link2.d": "m"}


def test_variants_of_which_there_is_no_picture_are_not_begun(typed, tmp_path):
    three = (part for k in (2, 3, 4) for part in ("--vary", f"link{k}.d=300..500mm:2"))
    said = typed("map", "planar_3r", "--grid", 4, *three, "-o", "all", "--plot", "all.png", code=1, err=True)
    assert "here 3 do" in said
    assert not (tmp_path / "all").exists()


def test_what_is_without_bound_is_said(typed):
    """Along z a planar linkage bears any force."""
    options = ("five_bar", "--over", "x=-0.2..0.2:6,y=0.3..0.5:6", "-q", "force")
    assert " N, along 1, 0, 0" in typed("map", *options, "-o", "x.zarr")
    options += ("--along", "0,0,1")
    said = "min unbounded, median unbounded, max unbounded N, along 0, 0, 1"
    assert said in typed("map", *options, "-o", "a.zarr")
    found = json.loads(typed("map", *options, "-o", "a.zarr", "--json"))
    lost = {"unit": "N", "min": None, "median": None, "max": None, "undetermined": []}
    assert found["quantities"]["force"] == lost
    assert "there is no cell that both maps reach and where it is finite" in typed("compare", "a.zarr", "a.zarr")


def test_all_is_all_but_what_takes_long_unless_that_is_named(typed):
    said = told(typed("map", "five_bar", "--over", "x=-0.1..0.1:3,y=0.4..0.5:3", "-q", "all,solutions"))
    assert {"solutions", "sigma_1", "sigma_2", "condition", "margin", "velocity", "force"} <= set(said)
    assert "solid_angle" not in said


def test_ctrl_c_is_no_traceback(typed, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("cinegen.workspace.make_map", stopped)
    assert "finished cells are kept; the same command continues" in typed("map", "five_bar", code=130, err=True)


def test_two_maps_are_compared(typed, tmp_path):
    for name, more in (("a", ()), ("b", ("--no-limits",))):
        typed("map", "five_bar", "--over", "x=-0.4..0.4:16,y=-0.7..0.7:16", "-o", f"{name}.zarr", *more)
    found = json.loads(typed("compare", "a.zarr", "b.zarr", "--json"))
    assert found["extents"]["only_second"]["value"] > 0.0
    said = typed("compare", "a.zarr", "b.zarr", "--plot", "both.png")
    assert "only b" in said
    assert (tmp_path / "both.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("planar_3r", "--over", "x=2..3:5,y=2..3:5"), "no cell of this region is reached"),
        (("planar_3r", "--over", "xy", "--at", "z=-0.9"), "can't move along z"),
        (("planar_3r", "--over", "x=-600..600,y=0..600"), "--over x: -600 m is far beyond the reach of arm, at most "
         "0.9 m: did you mean -600 mm?"),
        (("planar_3r", "--over", "rz=-60..60rad"), "-3438 deg to 3438 deg is more than one revolution: did you mean "
         "-60..60deg?"),
        (("planar_3r", "--over", "joint1=-60..60rad"), "joint1: -3438 deg is far beyond its limits"),
        (("planar_3r", "--line", "0,0,0..600,0,0"), "did you mean 600 mm?"),
        (("planar_3r", "--over", "xq"), "did you mean 'x'"),
        (("planar_3r", "--over", "x,joint1"), "can't be mixed"),
        (("planar_3r", "-q", "sigma"), "unknown quantity 'sigma'"),
        (("planar_3r", "-q", "clearance"), "--scene"),
        (("planar_3r", "-q", "all,nonsense"), "unknown quantity 'nonsense'"),
        (("planar_3r", "-q", "solutions"), "infinitely many"),
        (("planar_3r", "--vary", "link2.q=1..2:3"), "no parameter 'q'"),
        (("planar_3r", "--vary", "link2.d=300..500:3"), "did you mean 500 mm?"),
        (("planar_3r", "--vary", "link2.d=1..2deg:3"), "'2deg' is an angle: a length is wanted"),
        (("planar_3r", "--vary", "link2.d=1...2:3"), "3 dots"),
        (("planar_3r", "--vary", "link2.d+link2.alpha=1..2:3"), "must be all lengths or all angles"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused_in_words(typed, options, says):
    assert says in typed("map", *options, code=1, err=True)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--over", "x=1..0"), "lower end first"),
        (("--over", "x=0...1"), "'0...1' has 3 dots"),
        (("--over", "x=-500mm..500"), "can be read two ways"),
        (("--over", "x=0..5deg"), "'5deg' is an angle: a length is wanted"),
        (("--over", "rz=0..1m"), "'1m' is a length: an angle is wanted"),
        (("--over", "x=0..1:none"), "is not a number of cells"),
        (("--over", "x=0"), "write LOW..HIGH"),
        (("--at", "rz"), "write NAME=VALUE"),
        (("--at", "rz=1furlong"), "unknown unit 'furlong'"),
        (("--at", "rz=1deg,rz=2deg"), "rz is given twice"),
        (("--line", "0,0,0"), "write X,Y,Z..X,Y,Z"),
        (("--line", "0,0,-1...5,0,-1"), "write X,Y,Z..X,Y,Z with two dots"),
        (("--line", "0,0,-1..500,0,-1000mm"), "can be read two ways"),
        (("--line", "0,0,-1..0.5,0,-1:x"), "is not a number of cells"),
        (("--centre", "0,0"), "a point is x,y,z"),
        (("--centre", "0,0,1s"), "'1s' is a time"),
        (("--along", "0,0,1m"), "a number without a unit is wanted"),
    ],
)
def test_a_number_that_is_none_is_a_wrong_call(typed, options, says):
    assert says in typed("map", "planar_3r", *options, code=2, err=True)


def test_json_and_the_page_exclude_each_other(typed):
    assert "leave one out" in typed("map", "planar_3r", "--json", "--view", code=2, err=True)


def test_a_map_that_would_take_years_is_not_begun_by_accident(typed, tmp_path, monkeypatch):
    monkeypatch.setattr(sys.stdin, "isatty", lambda: False, raising=False)
    said = typed("map", "delta4", "--over", "xyz", "--grid", 100_000, "-o", "all.zarr", code=1, err=True)
    assert "1e+15 cells" in said
    assert "years" in said
    assert "PiB" in said
    assert "--yes" in said
    assert not (tmp_path / "all.zarr").exists()


def test_an_empty_map_leaves_no_folder(typed, tmp_path):
    typed("map", "planar_3r", "--over", "x=2..3:5,y=2..3:5", code=1, err=True)
    assert not list(tmp_path.iterdir())


def test_the_first_quantity_asked_for_is_shown(typed, monkeypatch):
    drawn = []
    monkeypatch.setattr("cinegen.plotting.map.draw_map", lambda found, show, name: drawn.append(show) or Figure())
    region = "--over", "x=-0.3..0.3:4", "--at", "y=0.2"
    typed("map", "planar_3r", *region, "-q", "condition,sigma_1", "--plot", "p.png")
    typed("map", "planar_3r", *region, "-q", "condition,sigma_1", "--show", "sigma_1", "--plot", "p.png")
    assert drawn == ["condition", "sigma_1"]


def test_a_folder_of_something_else_stays_as_it_is(typed, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/file").write_text("mine")
    typed("map", "planar_3r", "--grid", 5, "-o", "mine")
    assert sorted(path.name for path in (tmp_path / "mine").iterdir()) == ["file", "planar_3r-map.zarr"]
    assert (tmp_path / "mine/file").read_text() == "mine"
    typed("map", "planar_3r", "--grid", 5, "-o", "arm.zarr")
    assert "another map" in typed("map", "planar_3r", "--grid", 6, "-o", "arm.zarr", code=1, err=True)
    assert "not a map" in typed("compare", "arm.zarr", "mine", code=1, err=True)


@pytest.mark.parametrize(
    ("option", "low", "high"),
    [
        ("x=-0.3..0.3", -0.3, 0.3),
        ("x=-300..300mm", -0.3, 0.3),
        ("rz=-60..60", -math.pi / 3, math.pi / 3),
        ("rz=-1..1rad", -1.0, 1.0),
        ("joint1=0..90", 0.0, math.pi / 2),
        ("joint1=0..90°", 0.0, math.pi / 2),
    ],
)
def test_numbers_are_in_m_and_degrees_unless_a_unit_stands_behind(robot, option, low, high):
    (axis,) = region(robot("planar_3r"), option, "", None, "free", 4).axes
    assert (axis.low, axis.high) == pytest.approx((low, high), abs=1e-15)


@pytest.mark.parametrize("centre", [None, "-3,0,0", "0,4,0"])
def test_a_radius_goes_as_far_from_its_centre_as_the_node(robot, centre):
    """Stretched out away from the centre, the arm is as far from it as the centre and all its links are long."""
    arm = robot("planar_3r")
    q = np.zeros(arm.model.nq)
    links = np.linalg.norm(arm.placement(q, arm.end).translation)
    away = 0.0 if centre is None else np.linalg.norm([float(x) for x in centre.split(",")])
    radius = region(arm, "azimuth,elevation,radius", "", None, "free", 4, centre).axes[2]
    assert radius.low == 0.0
    assert radius.high >= away + links - 1e-9


def test_where_nobody_says_what_a_map_is_over_it_is_all_that_the_node_can_reach(robot):
    flat = region(robot("planar_3r"), "", "", None, "free", None)
    assert flat.names == ("x", "y")
    assert flat.shape == (80, 80)
    solid = region(robot("delta4"), "", "z=-1.8", None, "free", 10)
    assert solid.names == ("x", "y")
    assert solid.shape == (10, 10)


def test_loads_and_springs(typed):
    """Two bars hang their weight on a four-bar's pins; what statics leaves open is said."""
    four_bar = ("map", "four_bar", "--grid", "6", "--gravity", "0,0,0", "--wrench", "frame5=-1000,0,0")
    out = typed(*four_bar, "--reaction", "joint2")
    assert "N, in joint2, without z, which statics does not determine" in " ".join(out.split())
    assert "reaction_moment" in out
    springs = ("map", "delta4", "--over", "x=0..0.1:2", "--at", "y=0,z=-1.8", "--payload", "2kg")
    out = typed(*springs, "-q", "frequency,stiffness", "--stiffness", "*=1e6,joint1=900kNm/rad", "-o", "delta")
    found = told(out)
    assert found["frequency"][-1] == "Hz"
    assert float(found["stiffness"][1].strip(",")) > 1e5
    err = typed(*springs, "-q", "frequency", "-o", "x", code=1, err=True)
    assert "--stiffness" in err
    err = typed(*springs, "-q", "stiffness", "--stiffness", "joint1=4N/m", "-o", "x", code=2, err=True)
    assert "joint1: '4N/m' is a stiffness: an angular stiffness is wanted (Nm/rad, kNm/rad)" in err
    err = typed(*springs, "-q", "stiffness", "--stiffness", "joint_1=4", "-o", "x", code=1, err=True)
    assert "did you mean 'joint1'" in err
