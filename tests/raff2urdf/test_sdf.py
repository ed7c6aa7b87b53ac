"""SDF: without what is for cinegen alone, links and frames stand and move as RAFF says, and loops are closed where the
file begins.

The judge is the reader, whose poses and axes are those of the specification (tests/model/test_load_sdf.py).
"""

import dataclasses
import math
import re
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from exported import ALL, Exported, exported
from lxml import etree

import cinegen
from raff2urdf import convert
from raff2urdf.writers import WriteOptions, files
from raff2urdf.writers.tree_at_home import TreeAtHome

EXACT = 1e-9  # m and rad
OF_CINEGEN = re.compile("<raff:robot.*</raff:robot>", re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("sdf")


@pytest.fixture(params=ALL)
def robot(request: pytest.FixtureRequest, folder: Path) -> Exported:
    return exported(request.param, folder)


def loaded(text: str) -> cinegen.Mechanism:
    with warnings.catch_warnings(action="ignore"):
        return cinegen.load(text)


@pytest.fixture
def plain(robot: Exported) -> cinegen.Mechanism:
    """What other programs read: joints are at 0 where the file begins, and a base that moves has no pose."""
    return loaded(OF_CINEGEN.sub("", robot.text("sdf")))


# --- where things are --------------------------------------------------------------------------------------------


def test_every_node_is_a_link_or_a_frame_and_moves_as_raff_says(robot: Exported, plain: cinegen.Mechanism) -> None:
    """Joint values count from home."""
    rng = np.random.default_rng(0)
    for size in (0.0, 2.0, 2.0, 2.0):
        values = {name: rng.uniform(-size, size) for name in robot.home}
        q = plain.configuration(values)
        placed = robot.placed({name: robot.home[name] + value for name, value in values.items()})
        start = np.linalg.inv(placed["base"]) if robot.made.robot.movable else np.eye(4)
        for node, expected in placed.items():
            np.testing.assert_allclose(plain.placement(q, node).homogeneous, start @ expected, atol=EXACT)


def test_loops_are_joints_between_two_links_and_closed_where_it_begins_and_limits_are_shifted_by_home(robot, plain):
    loops = [(loop["name"], loop["kind"]) for loop in robot.made.constraints["loops"]]
    assert [(loop.name, loop.kind.name.lower()) for loop in plain.loops] == loops
    assert plain.gap_as_written < EXACT
    for name, entry in TreeAtHome(robot.made).entries.items():
        limits, bounds = plain.limits[name], entry["limits"] or (-math.inf, math.inf)
        np.testing.assert_allclose(np.add([limits.lower, limits.upper], robot.home[name]), bounds, atol=1e-12)
        assert limits.velocity == (entry["velocity"] or math.inf)


def test_cinegen_reads_home_actuated_joints_and_the_ends_of_loops(robot: Exported) -> None:
    mechanism, made = loaded(robot.text("sdf")), robot.made
    home = mechanism.values(mechanism.q_home)
    assert {joint: home[joint] for joint in robot.home} == pytest.approx(robot.home, abs=1e-12)
    assert mechanism.actuated == made.analysis.actuated
    assert mechanism.floating == bool(made.constraints["floating"])
    ends = [(loop["first"]["node"], loop["second"]["node"]) for loop in made.constraints["loops"]]
    assert [(loop.first, loop.second) for loop in mechanism.loops] == ends


# --- what the specification asks for -----------------------------------------------------------------------------


def test_names_differ(robot: Exported) -> None:
    model = etree.fromstring(robot.text("sdf").encode()).find("model")
    names = [element.get("name") for tag in ("link", "frame", "joint") for element in model.findall(tag)]
    assert len(names) == len({*names, "world"}) - 1
    for link in model.findall("link"):
        shapes = [shape.get("name") for shape in link.findall("visual")]
        assert len(shapes) == len(set(shapes))


def test_shapes_are_all_there_and_in_place(folder: Path) -> None:
    robot = exported("four_bar", folder)
    placed, mechanism = robot.placed(robot.home), cinegen.load(robot.write("sdf", folder))
    data, shapes = mechanism.model.createData(), mechanism.visual.createData()
    pin.updateGeometryPlacements(mechanism.model, data, mechanism.visual, shapes, mechanism.q_home)
    by_name = dict(zip((shape.name for shape in mechanism.visual.geometryObjects), shapes.oMg, strict=True))
    for link in robot.made.model.robot.links:
        for number, visual in enumerate(link.visuals):
            where = by_name.pop(f"{link.name}_{number}").homogeneous
            np.testing.assert_allclose(where, placed[link.name] @ visual.origin, atol=EXACT)
    assert by_name == {}


# --- what is written ---------------------------------------------------------------------------------------------


def test_names_that_meet_are_parted_and_told(tmp_path: Path, text_file: Callable[[str, str], Path]) -> None:
    """RAFF may call a link as its joint; SDF may not."""
    raff = text_file("arm.raff", 'RAFF t\nrobot arm { link 1 { name "joint1" parameters { theta 90 } type 2 pred 0 } }')
    (conversion,) = convert(raff, tmp_path / "out", format="sdf")
    text = conversion.file.read_text()
    assert set(re.findall(r'<joint name="(\S+)"', text)) == {"joint0", "joint1#2"}
    assert '<raff:joint name="joint1#2" raff_name="joint1" home="1.5707963267948966" actuated="true"/>' in text


def test_a_loop_on_the_world_or_on_a_base_that_moves_is_seen_from_its_other_end(folder: Path) -> None:
    """A joint's child needs another parent than the loop."""
    rover = exported("loose", folder)
    constraints = dict(rover.made.constraints)
    (loop,) = constraints["loops"]
    end = {"node": "base", "placement": np.eye(4).tolist()}
    constraints["loops"] = [{**loop, "kind": "ball", "second": end}]
    made = dataclasses.replace(rover.made, constraints=constraints)
    model = etree.fromstring(files("sdf", made, "robot", WriteOptions())["robot.sdf"]).find("model")
    (joint,) = model.findall(f"joint[@name='{loop['name']}']")
    assert (joint.findtext("parent"), joint.findtext("child")) == ("base", "link2")
