"""What the page is told of a map that is shown beside a robot."""

import json
import shutil

import numpy as np
import pytest
import trimesh
from browsers import Browser, becomes, get

import cinegen
from cinegen.cockpit import Cockpit, show_map
from cinegen.cockpit.served_map import ServedMap
from cinegen.session import map_setup
from cinegen.workspace import GridAxis, MapSpecification, Region, make_map

pytestmark = pytest.mark.filterwarnings("ignore:.*no such port:cinegen.CinegenWarning")

SLICE = Region((GridAxis("x", -0.4, 0.4, 8), GridAxis("y", 0.1, 0.5, 5)))


@pytest.fixture(scope="module")
def path(robot, tmp_path_factory):
    where = tmp_path_factory.mktemp("maps") / "five_bar.zarr"
    make_map(MapSpecification(robot("five_bar"), SLICE, ("sigma_1", "solutions")), where, workers=1)
    return where


@pytest.fixture
def cockpit(path):
    with Cockpit(map_setup(path, "solutions"), port=0, own_process=False) as one:
        yield one


def read(block):
    """What is said of the map, and all arrays of its cells by name, as the page reads them."""
    behind = 4 + int(np.frombuffer(block, "<u4", 1)[0])
    assert behind % 4 == 0
    about = json.loads(block[4:behind])
    arrays = {
        name: np.frombuffer(block, "<u4" if one["integer"] else "<f4", one["count"], behind + one["at"])
        for name, one in about["arrays"].items()
    }
    assert len(block) == behind + sum(4 * one.size for one in arrays.values())
    return about, arrays


def test_the_page_gets_all_cells_as_numbers(cockpit, path):
    cells = ServedMap(map_setup(path).map).cells().arrays
    told = json.loads(get(cockpit.url, "map/about.json")[1])
    status, block = get(cockpit.url, "map/cells.bin")
    assert status == 200
    about, found = read(block)
    assert about == told
    said = [about[name] for name in ("robot", "node", "quantity", "surface")]
    assert said == ["linkage", "tool", "solutions", True]
    assert (about["done"], about["cells"], about["shown"]) == (40, 40, len(cells["numbers"]))
    assert found["numbers"].tolist() == cells["numbers"].tolist()
    assert found["indices"].reshape(-1, 2).tolist() == cells["indices"].tolist()
    assert found["points"].reshape(-1, 3) == pytest.approx(cells["points"], abs=1e-6)
    assert found["edges"].reshape(-1, 2, 3) == pytest.approx(
        np.broadcast_to([[0.1, 0.0, 0.0], [0.0, 0.08, 0.0]], (len(cells["points"]), 2, 3)), abs=1e-6
    )
    assert found["value sigma_1"].tolist() == cells["value sigma_1"].tolist()
    assert [one["unit"] for one in about["quantities"]] == ["1", "1"]


def test_of_a_map_that_grows_the_page_gets_what_belongs_together(path, tmp_path):
    where = tmp_path / "growing.zarr"
    shutil.copytree(path, where)
    setup = map_setup(where)
    taken = [file for name in ("status", "reachable") for file in (where / name).glob("c.*")]
    kept = [file.rename(tmp_path / f"{file.parent.name} {file.name}") for file in taken]
    served = ServedMap(setup.map)
    told = json.loads(served.about())
    assert (told["done"], told["shown"]) == (0, 0)
    for file, there in zip(taken, kept, strict=True):
        there.rename(file)
    about, found = read(served.block())
    assert about == told
    assert found["numbers"].size == 0
    told = json.loads(served.about())
    about, found = read(served.block())
    assert about == told
    assert about["done"] == 40
    assert found["numbers"].tolist() == served.cells().arrays["numbers"].tolist()


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


def test_a_map_is_kept_from_who_has_no_token(path):
    with Cockpit(map_setup(path), port=0, own_process=False, host="0.0.0.0", token="secret") as one:
        address = f"http://127.0.0.1:{one.server.port}/"
        for name in ("about.json", "cells.bin", "cell/7"):
            assert get(address, f"map/{name}")[0] == 403
        assert get(f"{address}?token=secret", "map/about.json")[0] == 200


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
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>'
    urdf = tmp_path / "there/arm/arm.urdf"
    urdf.write_text(f'<robot name="arm"><link name="a">{mesh}</link><link name="b"/>{joint}</robot>')
    region = Region((GridAxis("j", -1.0, 1.0, 2),))
    made = tmp_path / "my/maps/arm.zarr"
    make_map(MapSpecification(cinegen.load(urdf), region, ("sigma_1",)), made, workers=1)
    drawn = map_setup(made).robots["arm"]
    with pytest.warns(cinegen.CinegenWarning, match=r"leads out of .*RAFF2URDF_MESH_PATH=.*sticks are drawn instead"):
        assert not any("part.stl" in shape.meshPath for shape in drawn.visual.geometryObjects)
    monkeypatch.setenv("RAFF2URDF_MESH_PATH", str(urdf.parent))
    (shape,) = map_setup(made).robots["arm"].visual.geometryObjects
    assert shape.meshPath == str(urdf.parent / "part.stl")
