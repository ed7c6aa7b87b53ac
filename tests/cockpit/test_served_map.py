"""What the page is told of a map that is shown beside a robot."""

import json
import shutil

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from browsers import Browser, becomes, get
from urdf_text import UrdfJoint, urdf_text

import cinegen
from cinegen.cockpit import show_map
from cinegen.cockpit.served_map import MOST, ServedMap
from cinegen.session import SetupError, map_setup
from cinegen.session.setup import MapOverlay
from cinegen.workspace import GridAxis, MapError, MapSpecification, Region, make_map

SLICE = Region((GridAxis("x", -0.4, 0.4, 8), GridAxis("y", 0.1, 0.5, 5)))


@pytest.fixture(scope="module")
def made(robot, tmp_path_factory):
    """`made("delta4", region, "sigma_1")`: a map on disk, and what xarray says is in it."""
    folder, known = tmp_path_factory.mktemp("maps"), {}

    def make(name, region, *quantities):
        key = name, repr(region), quantities
        if key not in known:
            path = folder / f"{len(known)}.zarr"
            known[key] = path, make_map(MapSpecification(robot(name), region, quantities), path, workers=1)
        return known[key]

    return make


@pytest.fixture(scope="module")
def path(made):
    return made("five_bar", SLICE, "sigma_1", "solutions")[0]


@pytest.fixture
def cockpit(cockpit, path):
    return cockpit(setup=map_setup(path, "solutions"))


def read(block):
    """What is said of the map, and all arrays of its cells by name, as the page reads them."""
    behind = 4 + int(np.frombuffer(block, "<u4", 1)[0])
    assert behind % 4 == 0
    about = json.loads(block[4:behind])
    arrays = {
        name: np.frombuffer(block, "<u4" if entry["integer"] else "<f4", entry["count"], behind + entry["at"])
        for name, entry in about["arrays"].items()
    }
    assert len(block) == behind + sum(4 * array.size for array in arrays.values())
    return about, arrays


def test_the_page_gets_all_cells_as_numbers(cockpit, path):
    cells = ServedMap(map_setup(path).map).cells().arrays
    reported = json.loads(get(cockpit.url, "map/about.json")[1])
    status, block = get(cockpit.url, "map/cells.bin")
    assert status == 200
    about, arrays = read(block)
    assert about == reported
    said = [about[name] for name in ("robot", "node", "quantity", "surface")]
    assert said == ["linkage", "tool", "solutions", True]
    assert (about["done"], about["cells"], about["shown"]) == (40, 40, len(cells["numbers"]))
    assert arrays["numbers"].tolist() == cells["numbers"].tolist()
    assert arrays["indices"].reshape(-1, 2).tolist() == cells["indices"].tolist()
    assert arrays["points"].reshape(-1, 3) == pytest.approx(cells["points"], abs=1e-6)
    edges = np.broadcast_to([[0.1, 0.0, 0.0], [0.0, 0.08, 0.0]], (len(cells["points"]), 2, 3))
    assert arrays["edges"].reshape(-1, 2, 3) == pytest.approx(edges, abs=1e-6)
    assert arrays["value sigma_1"].tolist() == cells["value sigma_1"].tolist()
    assert [quantity["unit"] for quantity in about["quantities"]] == ["1", "1"]


def test_of_a_map_that_grows_the_page_gets_what_belongs_together(path, tmp_path):
    where = tmp_path / "growing.zarr"
    shutil.copytree(path, where)
    setup = map_setup(where)
    taken = [file for name in ("status", "reachable") for file in (where / name).glob("c.*")]
    kept = [file.rename(tmp_path / f"{file.parent.name} {file.name}") for file in taken]
    served = ServedMap(setup.map)
    reported = json.loads(served.about())
    assert (reported["done"], reported["shown"]) == (0, 0)
    for file, moved in zip(taken, kept, strict=True):
        moved.rename(file)
    about, arrays = read(served.block())
    assert about == reported
    assert arrays["numbers"].size == 0
    reported = json.loads(served.about())
    about, arrays = read(served.block())
    assert about == reported
    assert about["done"] == 40
    assert arrays["numbers"].tolist() == served.cells().arrays["numbers"].tolist()


def test_a_cell_says_how_it_is_reached_and_the_robot_goes_there(cockpit, path):
    served = ServedMap(map_setup(path).map)
    number = int(served.cells().arrays["numbers"][7])
    to = json.loads(get(cockpit.url, f"map/cell/{number}")[1])
    assert to == json.loads(served.cell(number))
    browser = Browser(cockpit.url)
    assert becomes(lambda: browser.state is not None)
    assert browser.told[0]["map"] == "linkage"
    browser.say("move_to", **to)
    assert becomes(lambda: cockpit.state.robots["linkage"].q.tolist() == to["q"])
    assert cockpit.state.robots["linkage"].closure < 1e-9
    browser.leave()


def test_what_is_not_there_is_not_found(cockpit):
    wrong = ("cell/40", "cell/999999999999999999", "cell/-1", "cell/x", "")
    assert {get(cockpit.url, f"map/{name}")[0] for name in wrong} == {404}


def test_a_map_that_is_taken_away_meanwhile_ends_nothing(path, robot, tmp_path):
    where = tmp_path / "a.zarr"
    shutil.copytree(path, where)
    shown = show_map(where, port=0)
    number = int(ServedMap(map_setup(where).map).cells().arrays["numbers"][0])
    where.rename(tmp_path / "b.zarr")
    assert get(shown.url, f"map/cell/{number}")[0] == 404
    assert get(shown.url, "map/about.json")[0] == 200  # it was whole
    assert shown.q["linkage"] == pytest.approx(robot("five_bar").q_home)
    shown.close()


def test_a_map_has_no_meshes_shown_that_are_far_from_it(tmp_path, monkeypatch):
    """Its author may be anybody, and states the folder of the meshes."""
    for folder in ("my/maps", "there/arm"):
        (tmp_path / folder).mkdir(parents=True)
    trimesh.creation.box((0.1, 0.1, 0.4)).export(tmp_path / "there/arm/part.stl")
    mesh = '<visual><geometry><mesh filename="part.stl"/></geometry></visual>'
    urdf = tmp_path / "there/arm/arm.urdf"
    urdf.write_text(urdf_text([UrdfJoint("j", "a", "b", kind="continuous")], {"a": mesh}))
    region = Region((GridAxis("j", -1.0, 1.0, 2),))
    made = tmp_path / "my/maps/arm.zarr"
    make_map(MapSpecification(cinegen.load(urdf), region, ("sigma_1",)), made, workers=1)
    drawn = map_setup(made).robots["arm"]
    with pytest.warns(cinegen.CinegenWarning, match=r"leads out of .*RAFF2URDF_MESH_PATH=.*sticks are drawn instead"):
        assert not any("part.stl" in shape.meshPath for shape in drawn.visual.geometryObjects)
    monkeypatch.setenv("RAFF2URDF_MESH_PATH", str(urdf.parent))
    (shape,) = map_setup(made).robots["arm"].visual.geometryObjects
    assert shape.meshPath == str(urdf.parent / "part.stl")


# --- map cells --------------------------------------------------------------------------------------------------------
# Cells of maps, as they are shown beside a robot.


BOX = GridAxis("x", -1.3, 1.3, 6), GridAxis("y", -1.2, 1.2, 5), GridAxis("z", -2.7, -1.2, 6)


def serve(path, most=MOST):
    """The cells of a map, as they are served beside its robot."""
    return ServedMap(MapOverlay(str(path), "robot", "platform"), most)


def where(mechanism, dataset, numbers):
    """(n, 3) the end in the configurations of cells, by Pinocchio."""
    q = dataset["configuration"].values.reshape(-1, mechanism.model.nq)[numbers]
    return np.array([mechanism.placement(row, mechanism.end).translation for row in q])


@pytest.mark.parametrize("most", [MOST, 60, 3])
def test_reached_cells_are_shown_where_the_robot_is_in_them_and_of_a_large_map_some(made, robot, most):
    path, dataset = made("delta4", Region(BOX), "sigma_1", "margin")
    shown = serve(path, most)
    cloud, reached = shown.cells(), dataset["reachable"].values.ravel()
    numbers, points = cloud.arrays["numbers"], cloud.arrays["points"]
    assert 0 < len(numbers) <= min(most, cloud.description.cells - 1)
    assert cloud.description.cells == cloud.description.done == 6 * 5 * 6
    assert reached[numbers].all()
    assert (len(numbers) == reached.sum()) == (most == MOST)
    assert (max(axis.every for axis in cloud.description.axes) == 1) == (most == MOST)
    assert points == pytest.approx(where(robot("delta4"), dataset, numbers), abs=1e-8)
    assert "edges" not in cloud.arrays
    for axis, index in zip(cloud.description.axes, cloud.arrays["indices"].T, strict=True):
        assert index.max() < axis.count
        assert axis.low + axis.step * index == pytest.approx(points[:, "xyz".index(axis.name)])
    for quantity in cloud.description.quantities:
        values = dataset[quantity.name].values.ravel()[numbers]
        assert cloud.arrays[f"value {quantity.name}"].tolist() == values.tolist()
        assert quantity.text == dataset[quantity.name].attrs["long_name"]
        if most == MOST:
            assert cloud.description.size == pytest.approx(0.25)  # to the next cell, along z
            assert quantity.least == values.min() <= quantity.low < quantity.high <= values.max() == quantity.most
    some = int(numbers[len(numbers) // 2])
    assert json.loads(shown.cell(some))["q"] == dataset["configuration"].values.reshape(-1, 15)[some].tolist()
    assert shown.cell(int(np.flatnonzero(~reached)[0])) is None
    assert shown.cell(cloud.description.cells) is None


def test_all_of_a_sphere_is_shown_with_every_second_cell(made):
    """The chord of an angle a on a circle of radius r is 2 r sin(a / 2)."""
    region = Region(
        (GridAxis("azimuth", -np.pi, np.pi, 8), GridAxis("elevation", -0.5 * np.pi, 0.5 * np.pi, 8)),
        {"radius": 0.1}, centre=(0.0, 0.0, -1.8),
    )  # fmt: skip
    cloud = serve(made("delta4", region)[0], 32).cells()
    assert len(cloud.arrays["points"]) == 32
    assert np.linalg.norm(cloud.arrays["points"] - [0.0, 0.0, -1.8], axis=1) == pytest.approx(0.1)
    around, up = np.linalg.norm(cloud.arrays["edges"], axis=2).T
    every = [axis.every for axis in cloud.description.axes]
    elevation = cloud.description.axes[1].low + cloud.description.axes[1].step * cloud.arrays["indices"][:, 1]
    assert around == pytest.approx(0.2 * np.cos(elevation) * np.sin(every[0] * np.pi / 8.0))
    assert up == pytest.approx(0.2 * np.sin(every[1] * np.pi / 16.0))
    assert np.einsum("ni,ni->n", *np.moveaxis(cloud.arrays["edges"], 1, 0)) == pytest.approx(0.0, abs=1e-9)


def test_cells_of_motors_are_where_these_lead_the_end(made, robot):
    path, dataset = made("delta4", Region((GridAxis("joint1", -0.6, 0.6, 4), GridAxis("joint6", -0.6, 0.6, 3))))
    cloud = serve(path).cells()
    assert cloud.arrays["points"] == pytest.approx(where(robot("delta4"), dataset, cloud.arrays["numbers"]), abs=1e-8)
    assert all(axis.unit == "rad" and axis.translates for axis in cloud.description.axes)
    assert cloud.description.quantities == ()


def test_turns_in_one_place_are_shown_on_a_ball_about_it(made, robot):
    gough = robot("gough")
    path, dataset = made("gough", Region((GridAxis("rx", -0.3, 0.3, 4), GridAxis("ry", -0.3, 0.3, 3))))
    cloud = serve(path).cells()
    home = gough.placement(gough.q_home, gough.end).translation
    for point, number in zip(cloud.arrays["points"], cloud.arrays["numbers"], strict=True):
        q = dataset["configuration"].values.reshape(-1, gough.model.nq)[number]
        upwards = gough.placement(q, gough.end).rotation[:, 2]
        assert (point - home) / np.linalg.norm(point - home) == pytest.approx(upwards)
    assert not any(axis.translates for axis in cloud.description.axes)


def test_what_makes_no_sense_is_refused(made, robot, tmp_path):
    path, _ = made("delta4", Region(BOX), "sigma_1", "margin")
    assert map_setup(path, "margin", robot("delta4")).robots == {"r1": robot("delta4")}
    with pytest.raises(SetupError, match=r"no quantity 'sigma_2'.*it has sigma_1, margin"):
        map_setup(path, "sigma_2")
    with pytest.raises(SetupError, match="of another robot"):
        map_setup(path, None, robot("gough"))
    with pytest.raises(MapError):
        map_setup(tmp_path / "nothing.zarr")
    shutil.copytree(path, tmp_path / "file.zarr")
    (tmp_path / "file.zarr" / "zarr.json").write_text("no map")
    with pytest.raises(MapError):
        serve(tmp_path / "file.zarr")


def test_a_map_in_a_scene_has_its_obstacles_beside_it(robot, tmp_path):
    pole = {"name": "pole", "kind": "capsule", "radius": 0.03, "length": 1.0, "point": [0.45, 0.25, 0.5]}
    scene = {"robot": "arm7.raff", "goal": {"point": [0.3, 0.3, 0.3]}, "obstacle": [pole]}
    region = Region((GridAxis("x", 0.2, 0.4, 2), GridAxis("y", 0.2, 0.4, 2)))
    make_map(MapSpecification(robot("arm7"), region, ("clearance",), scene=scene), tmp_path / "a.zarr", workers=1)
    setup = map_setup(tmp_path / "a.zarr")
    assert set(setup.robots) == {setup.map.robot}
    assert setup.avoidance.robot == setup.map.robot
    assert setup.obstacles["pole"].placement.isApprox(pin.SE3(np.eye(3), np.array([0.45, 0.25, 0.5])))
