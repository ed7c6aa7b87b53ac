"""The commands `cinegen map` and `cinegen compare`: maps made, told, drawn, varied, and refused."""

import json
from pathlib import Path

import pytest
import typer
from urdf_text import UrdfJoint, urdf_text

from cinegen.cli import app
from cinegen.workspace import open_map


def test_the_answer_as_json_has_all_numbers_in_si_and_the_text_the_same(printed, tmp_path):
    options = "--over", "x=-500..500mm:8,y=-0.5..0.5:8", "--at", "z=-1800mm", "--json"
    report = json.loads(printed("map", "delta4", *options))
    assert report["over"]["x"] == [-0.5, 0.5, 8]
    assert report["at"]["z"] == pytest.approx(-1.8)
    assert report["reachable"] == report["cells"] == 64
    assert report["extent"] == {"value": pytest.approx(1.0), "error": pytest.approx(0.0), "unit": "m^2"}
    assert set(report["quantities"]) == {"sigma_1", "sigma_2"}
    assert sum(report["status"].values()) == 64
    sigma = report["quantities"]["sigma_1"]
    assert sigma["min"] == float(open_map("delta4-map.zarr").sigma_1.min())
    said = printed("map", "delta4", *options[:-1], "--plot", "delta.png")
    assert "  reachable       1 m^2, 100 % of the region" in said
    assert "min {min:.3g}, median {median:.3g}, max {max:.3g}".format(**sigma) in said
    assert (tmp_path / "delta.png").stat().st_size > 10_000


@pytest.mark.parametrize(("allowed", "least"), [([], (-1.0, 1.0)), (["base", "link2", "link3"], (5.0, 20.0))])
def test_collisions_that_a_scene_allows_do_not_count_as_clearance(printed, root, tmp_path, allowed, least):
    """A box 10 m away; nearer are only the arm's own links."""
    pairs = [[node, other] for i, node in enumerate(allowed) for other in allowed[i + 1 :]]
    pairs += [["link1", "link3"]] * bool(pairs)
    goal = {"point": [1, 0], "angle": 0.0}
    box = {"kind": "box", "size": [0.1, 0.1], "point": [10.0, 0.0]}
    values = {"robot": str(root / "robots/planar_3r.raff"), "goal": goal, "obstacle": [box]}
    values["allowed_collisions"] = pairs
    (tmp_path / "scene.json").write_text(json.dumps(values))
    printed("map", "planar_3r", "--over", "joint2:5,joint3:5", "--scene", tmp_path / "scene.json", "-o", "map.zarr")
    clearance = float(open_map("map.zarr").clearance.min())
    assert least[0] <= clearance <= least[1]


@pytest.mark.parametrize("value", ["-0.5,0,-1.8..0.5,0,-1.8:20", "-.5,1"])
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
    apart, together = (parser.make_context(command, [*before, *form]).params for form in ([option, value], joined))
    assert apart == together
    assert any(parsed in (value, [value], Path(value)) for parsed in apart.values())


def test_variants_get_a_table_and_files(printed, tmp_path):
    said = printed("map", "planar_3r", "--over", "xy", "--grid", 12, "--vary", "link2.d=0.3..0.5:2", "--box",
                 "x=0.2..0.4,y=0..0.2", "-o", "all", "--plot", "all.png")  # fmt: skip
    assert "link2.d" in said
    assert (tmp_path / "all/link2.d=300/robot.raff").is_file()
    assert (tmp_path / "all/table.csv").is_file()
    assert (tmp_path / "all.png").stat().st_size > 10_000


def test_what_is_without_bound_is_said(printed):
    """Along z a planar linkage bears any force."""
    options = ("five_bar", "--over", "x=-0.2..0.2:6,y=0.3..0.5:6", "-q", "force")
    assert " N, along 1, 0, 0" in printed("map", *options, "-o", "x.zarr")
    options += ("--along", "0,0,1")
    said = "min unbounded, median unbounded, max unbounded N, along 0, 0, 1"
    assert said in printed("map", *options, "-o", "a.zarr")
    report = json.loads(printed("map", *options, "-o", "a.zarr", "--json"))
    lost = {"unit": "N", "min": None, "median": None, "max": None, "undetermined": []}
    assert report["quantities"]["force"] == lost
    assert "there is no cell that both maps reach and where it is finite" in printed("compare", "a.zarr", "a.zarr")


def test_ctrl_c_is_no_traceback(printed, monkeypatch):
    def stopped(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("cinegen.workspace.make_map", stopped)
    assert "finished cells are kept; the same command continues" in printed("map", "five_bar", code=130)


def test_more_is_reached_without_limits(printed):
    for name, more in (("a", ()), ("b", ("--no-limits",))):
        printed("map", "five_bar", "--over", "x=-0.4..0.4:8,y=-0.7..0.7:8", "-o", f"{name}.zarr", *more)
    extents = json.loads(printed("compare", "a.zarr", "b.zarr", "--json"))["extents"]
    assert extents["only_first"]["value"] == 0.0 < extents["only_second"]["value"]
    assert "only b" in printed("compare", "a.zarr", "b.zarr")


def test_a_folder_of_something_else_stays_as_it_is(printed, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/file").write_text("mine")
    printed("map", "planar_3r", "--grid", 5, "-o", "mine")
    assert sorted(path.name for path in (tmp_path / "mine").iterdir()) == ["file", "planar_3r-map.zarr"]
    assert (tmp_path / "mine/file").read_text() == "mine"
    printed("map", "planar_3r", "--grid", 5, "-o", "arm.zarr")
    assert "another map" in printed("map", "planar_3r", "--grid", 6, "-o", "arm.zarr", code=1)
    assert "not a map" in printed("compare", "arm.zarr", "mine", code=1)


def test_loads_and_springs(printed):
    """Two bars hang their weight on a four-bar's pins; what statics leaves open is said."""
    four_bar = ("map", "four_bar", "--grid", "6", "--gravity", "0,0,0", "--wrench", "frame5=-1000,0,0")
    out = printed(*four_bar, "--reaction", "joint2")
    assert "N, in joint2, without z, which statics does not determine" in " ".join(out.split())
    assert "reaction_moment" in out
    springs = ("map", "delta4", "--over", "x=0..0.1:2", "--at", "y=0,z=-1.8", "--payload", "2kg")
    out = printed(*springs, "-q", "frequency,stiffness", "--stiffness", "*=1e6,joint1=900kNm/rad", "-o", "delta")
    numbers = {words[0]: words[1:] for words in map(str.split, out.splitlines()) if words}
    assert numbers["frequency"][-1] == "Hz"
    assert float(numbers["stiffness"][1].strip(",")) > 1e5
    err = printed(*springs, "-q", "stiffness", "--stiffness", "joint1=4N/m", "-o", "x", code=2)
    assert "joint1: '4N/m' is a stiffness: an angular stiffness is wanted (Nm/rad, kNm/rad)" in err


def test_torques_of_a_map_are_of_rest_and_say_what_they_leave_out(printed):
    inertia = '<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/>'
    rod = f'<inertial><origin xyz="0.5 0 0"/><mass value="1"/>{inertia}</inertial>'
    losses = '<dynamics damping="2" friction="0.4" spring_stiffness="5"/>'
    pin = UrdfJoint("pin", "base", "rod", axis="0 1 0", effort=9.0, more=losses)
    Path("arm.urdf").write_text(urdf_text([pin], {"rod": rod}))
    wanted = ["forces leave out the springs of pin", "forces leave out the Coulomb friction at rest of pin"]
    for quantity, notes in (("torque", wanted), ("sigma_1", [])):
        command = "map", "arm.urdf", "--over", "pin", "--grid", 8, "-q", quantity, "-o", f"{quantity}.zarr"
        assert json.loads(printed(*command, "--json"))["notes"] == notes
        lines = printed(*command).splitlines()
        assert [line for line in lines if "note:" in line] == [f"  note: {note}" for note in notes]
