"""SDF: names, limits and joints are those that its specification asks for; tests/peers has how it moves."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from exported import ALL, Exported, exported
from lxml import etree
from numpy.typing import NDArray

from raff2urdf import convert
from raff2urdf.writers import WriteOptions, files
from raff2urdf.writers.sdf import NAMESPACE
from raff2urdf.writers.tree_at_home import TreeAtHome

Matrix = NDArray[np.float64]
RAFF = {"raff": NAMESPACE}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("sdf")


@pytest.fixture(params=ALL)
def robot(request: pytest.FixtureRequest, folder: Path) -> Exported:
    return exported(request.param, folder)


class Model:
    """An SDF model by the book: sdformat.org, "Pose frame semantics", version 1.7."""

    def __init__(self, text: str) -> None:
        self.root = etree.fromstring(text.encode())
        self.element = self.root.find("model")
        self.links = {link.get("name"): link for link in self.element.findall("link")}
        self.joints = {joint.get("name"): joint for joint in self.element.findall("joint")}
        self.own = {own.get("name"): own for own in self.element.iterfind("raff:robot/*", RAFF)}

    def is_loop(self, name: str) -> bool:
        return name in self.own and etree.QName(self.own[name]).localname == "loop"


# --- what the specification asks for -----------------------------------------------------------------------------


def test_names_differ_and_joints_join_links_of_which_each_hangs_on_one(robot: Exported) -> None:
    """But for loops, and a base that moves hangs on none."""
    model = Model(robot.text("sdf"))
    names = [element.get("name") for tag in ("link", "frame", "joint") for element in model.element.findall(tag)]
    assert len(names) == len({*names, "world"}) - 1
    for link in model.links.values():
        shapes = [shape.get("name") for shape in link.findall("visual")]
        assert len(shapes) == len(set(shapes))
    for joint in model.joints.values():
        assert joint.findtext("parent") in {*model.links, "world"} - {joint.findtext("child")}
    held = [joint.findtext("child") for name, joint in model.joints.items() if not model.is_loop(name)]
    free = ["base"] if robot.made.robot.movable else []
    assert sorted(held + free) == sorted(model.links)


def test_limits_are_shifted_by_home(robot: Exported) -> None:
    model = Model(robot.text("sdf"))
    for entry in TreeAtHome(robot.made).entries.values():
        limit, own = model.joints[entry["name"]].find("axis/limit"), model.own[entry["name"]]
        ends = [float(limit.findtext(word)) for word in ("lower", "upper")]
        home = float(own.get("home"))
        assert home == robot.home[entry["name"]]
        if entry["limits"] is None:
            assert ends == [-1e16, 1e16]
        else:
            np.testing.assert_allclose(np.add(ends, home), entry["limits"], atol=1e-12)
        assert own.get("actuated") == str(entry["actuated"]).lower()
        assert limit.findtext("velocity") == (
            None if entry["velocity"] is None else f"{entry['velocity']!r}".removesuffix(".0")
        )


# --- what is written ---------------------------------------------------------------------------------------------


def test_names_that_meet_are_parted_and_told(tmp_path: Path) -> None:
    """RAFF may call a link as its joint; SDF may not."""
    raff = tmp_path / "arm.raff"
    raff.write_text('RAFF t\nrobot arm { link 1 { name "joint1" parameters { theta 90 } type 2 pred 0 } }')
    (conversion,) = convert(raff, tmp_path / "out", format="sdf")
    model = Model(conversion.file.read_text())
    assert set(model.joints) == {"joint0", "joint1#2"}
    assert model.own["joint1#2"].get("raff_name") == "joint1"
    assert float(model.own["joint1#2"].get("home")) == math.pi / 2


def test_a_loop_on_the_world_or_on_a_base_that_moves_is_seen_from_its_other_end(folder: Path) -> None:
    """A joint's child needs another parent than the loop."""
    rover = exported("loose", folder)
    constraints = dict(rover.made.constraints)
    (loop,) = constraints["loops"]
    end = {"node": "base", "placement": np.eye(4).tolist()}
    constraints["loops"] = [{**loop, "kind": "ball", "second": end}]
    made = dataclasses.replace(rover.made, constraints=constraints)
    model = Model(files("sdf", made, "robot", WriteOptions())["robot.sdf"].decode())
    assert model.joints[loop["name"]].findtext("parent") == "base"
    assert model.joints[loop["name"]].findtext("child") == "link2"
