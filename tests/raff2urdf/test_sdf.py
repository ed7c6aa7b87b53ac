"""SDF: resolved by the rules of its specification, links and frames stand and move as RAFF says, and loops are closed
where the file begins."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from exported import ALL, Exported, exported
from lxml import etree
from numpy.typing import NDArray

from raff2urdf import convert
from raff2urdf.residual import loop_residual
from raff2urdf.writers import WriteOptions, files
from raff2urdf.writers.sdf import NAMESPACE
from raff2urdf.writers.tree_at_home import TreeAtHome

Matrix = NDArray[np.float64]
EXACT = 1e-9  # m and rad
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
        self.frames = {frame.get("name"): frame for frame in self.element.findall("frame")}
        self.joints = {joint.get("name"): joint for joint in self.element.findall("joint")}
        self.own = {own.get("name"): own for own in self.element.iterfind("raff:robot/*", RAFF)}

    def place(self, name: str) -> Matrix:
        """Where a link, frame or joint stands in the model to begin with."""
        if name in self.links:
            element, by_default = self.links[name], None
        elif name in self.frames:
            element, by_default = self.frames[name], self.frames[name].get("attached_to")
        else:
            element, by_default = self.joints[name], self.joints[name].findtext("child")
        local, seen_from = pose(element)
        seen_from = seen_from or by_default
        return local if seen_from is None else self.place(seen_from) @ local

    def bearer(self, name: str) -> str:
        """The link that a link or frame belongs to."""
        while name in self.frames:
            name = self.frames[name].get("attached_to")
        return name

    def moved(self, values: Mapping[str, float]) -> dict[str, Matrix]:
        """Where links and frames are, with joints moved so far from where the model begins."""
        found: dict[str, Matrix] = {}
        waiting = [(name, joint) for name, joint in self.joints.items() if not self.is_loop(name)]
        held = {joint.findtext("child") for _, joint in waiting}
        for name in self.links:
            if name not in held:  # a base that moves
                found[name] = self.place(name)
        while waiting:
            name, joint = waiting.pop(0)
            parent, child = joint.findtext("parent"), joint.findtext("child")
            if parent != "world" and parent not in found:
                waiting.append((name, joint))
                continue
            start = np.eye(4) if parent == "world" else found[parent] @ np.linalg.inv(self.place(parent))
            at = self.place(name)
            found[child] = start @ at @ motion(joint, values.get(name, 0.0)) @ np.linalg.inv(at) @ self.place(child)
        for name in self.frames:
            bearer = self.bearer(name)
            found[name] = found[bearer] @ np.linalg.inv(self.place(bearer)) @ self.place(name)
        return found

    def is_loop(self, name: str) -> bool:
        return name in self.own and etree.QName(self.own[name]).localname == "loop"


def pose(element: Any) -> tuple[Matrix, str | None]:
    given = element.find("pose")
    if given is None:
        return np.eye(4), None
    x, y, z, roll, pitch, yaw = map(float, given.text.split())
    return pin.SE3(pin.rpy.rpyToMatrix(roll, pitch, yaw), np.array([x, y, z])).homogeneous, given.get("relative_to")


def motion(joint: Any, value: float) -> Matrix:
    if joint.get("type") == "fixed":
        return np.eye(4)
    axis = np.array(list(map(float, joint.findtext("axis/xyz").split())))
    if joint.get("type") == "prismatic":
        return pin.SE3(np.eye(3), value * axis).homogeneous
    return pin.SE3(pin.exp3(value * axis), np.zeros(3)).homogeneous


# --- where things are --------------------------------------------------------------------------------------------


def test_every_node_is_a_link_or_a_frame_and_moves_as_raff_says(robot: Exported) -> None:
    """Joint values count from home, which `raff:joint` tells."""
    model = Model(robot.text("sdf"))
    rng = np.random.default_rng(0)
    for size in (0.0, 2.0, 2.0, 2.0):
        values = {name: rng.uniform(-size, size) for name in robot.home}
        found = model.moved(values)
        own = {name: value + float(model.own[name].get("home")) for name, value in values.items()}
        for node, expected in robot.placed(own).items():
            np.testing.assert_allclose(found[node], expected, atol=EXACT)


def test_loops_are_joints_between_two_links_and_closed_where_it_begins(robot: Exported) -> None:
    model = Model(robot.text("sdf"))
    loops = {loop["name"]: loop for loop in robot.made.constraints["loops"]}
    words = {"rigid": "fixed", "prismatic": "prismatic", "revolute": "revolute", "ball": "ball"}
    assert [name for name in model.joints if model.is_loop(name)] == list(loops)
    for kind, (name, loop) in zip(robot.made.analysis.kinds, loops.items(), strict=True):
        joint, own = model.joints[name], model.own[name]
        assert joint.get("type") == words[loop["kind"]] == words[own.get("kind")]
        assert {own.get("first"), own.get("second")} == {loop["first"]["node"], loop["second"]["node"]}
        ends = [model.place(own.get(which)) for which in ("first", "second")]
        np.testing.assert_allclose(model.place(name), ends[1], atol=EXACT)
        residual, _ = loop_residual(kind, np.linalg.inv(ends[0]) @ model.place(name), robot.length)
        assert np.abs(residual).max() < EXACT
        assert joint.findtext("parent") == model.bearer(own.get("first"))
        assert joint.findtext("child") == model.bearer(own.get("second"))
        if kind.name in ("PRISMATIC", "REVOLUTE"):
            assert joint.findtext("axis/xyz") == "0 0 1"
            assert float(joint.findtext("axis/limit/lower")) == -1e16


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


def test_shapes_are_all_there_and_in_place(folder: Path) -> None:
    robot = exported("four_bar", folder)
    model = Model(robot.text("sdf"))
    placed = robot.placed(robot.home)
    for link in robot.made.model.robot.links:
        for number, visual in enumerate(link.visuals, 1):
            bearer = model.bearer(link.name)
            (shown,) = model.links[bearer].findall(f"visual[@name='{link.name}_visual{number}']")
            where = model.place(bearer) @ pose(shown)[0]
            np.testing.assert_allclose(where, placed[link.name] @ visual.origin, atol=EXACT)
            assert len(shown.find("geometry")) == 1


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
