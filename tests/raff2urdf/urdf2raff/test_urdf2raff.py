"""URDF -> RAFF: every link stands where it stood, at any joint values; gamma and epsilon only where a link branches."""

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yourdfpy
from by_pinocchio import placements_of
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from urdf_text import joint_text, links, robot

import raff2urdf
from raff2urdf import tree as raff_tree
from raff2urdf.conversion import convert, translate
from raff2urdf.coupling import Coupling, coupling_entry
from raff2urdf.raff.reader import parse as parse_raff
from raff2urdf.readers.urdf import joints
from raff2urdf.readers.urdf_file import parse
from raff2urdf.urdf2raff.cli import main
from raff2urdf.urdf2raff.frames import tidy
from raff2urdf.urdf2raff.robot import import_tree

SPECIAL = st.sampled_from([0.0, 0.0, 0.0, math.pi / 2, -math.pi / 2, math.pi, 1.5708, 1e-7, 2.5e-5, 0.3])
AXES = st.sampled_from(["0 0 1", "0 1 0", "1 0 0", "0 0 -1", "1 1 0", "0.3 -0.2 1", "0 1e-7 1"])


@st.composite
def trees(draw, most=8):
    """URDFs: any tree of joints, with all the special positions of axes that people and CAD programs make."""
    count = draw(st.integers(1, most))
    rows = [links("l0")]
    for i in range(1, count + 1):
        father = draw(st.integers(max(0, i - 3), i - 1))
        kind = draw(st.sampled_from(["revolute", "revolute", "continuous", "prismatic", "fixed"]))
        lengths = st.sampled_from([0.0, 0.0, 0.2, -0.35, 1.0, 0.123456789012345])
        xyz = " ".join(repr(draw(lengths)) for _ in range(3))
        rpy = " ".join(repr(draw(SPECIAL)) for _ in range(3))
        limit = '<limit lower="-1" upper="2" effort="1" velocity="3"/>'
        inside = f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{draw(AXES)}"/>{limit}'
        rows += [links(f"l{i}"), joint_text(f"j{i}", f"l{father}", f"l{i}", inside, kind)]
    return robot(*rows)


def largest_difference(text, imported, spread=3.0):
    """Of placements of all links at random joint values around 0 (m, and entries of rotations)."""
    document, rng, worst = imported.document, np.random.default_rng(0), 0.0
    numbers = {part.node: number for number, part in document.robot().nodes.items()}
    for _ in range(3):
        values = {joint: rng.uniform(-spread, spread) for joint in imported.joints}
        wanted = placements_of(text, values)
        shifted = {theirs: values[joint] + imported.offsets[theirs] for joint, theirs in imported.joints.items()}
        placed = raff_tree.placements(document, document.robot(), shifted)
        differences = (wanted[link] - placed[numbers[node]] for link, node in imported.nodes.items())
        worst = max(worst, *(float(np.abs(difference).max()) for difference in differences))
    return worst


def body(robot, number):
    """What a node is fixed on: a link that moves, or the base."""
    while number and not getattr(robot.nodes[number], "type", 0):
        number = robot.nodes[number].pred
    return number


@settings(max_examples=300)
@given(trees())
def test_every_link_stands_where_it_stood_and_gamma_and_epsilon_are_said_only_where_a_link_branches(text):
    imported = import_tree(parse(text, "x"), "x")
    assert set(imported.nodes) == {f"l{i}" for i in range(text.count("<link"))}
    assert largest_difference(text, imported) < 1e-10
    again = raff2urdf.loads(raff2urdf.dumps(imported.document))  # and so it does in the file
    assert again == imported.document
    robot = imported.document.robot()
    carried = Counter(body(robot, link.pred) for link in robot.links)
    for link in robot.links:
        if link.parameters.gamma or link.parameters.epsilon:
            assert carried[body(robot, link.pred)] > 1


@settings(max_examples=100)
@given(trees(), st.sampled_from(["mm", "m", "um", "cm"]))
def test_to_and_fro_is_a_fixed_point(text, units):
    first = import_tree(parse(text, "x"), "x", units=units)
    made = translate(first.document, first.document.robot(), Path())
    second = import_tree(parse(made.urdf, "y"), "y", made.constraints, units)
    again = translate(second.document, second.document.robot(), Path())
    third = import_tree(parse(again.urdf, "z"), "z", again.constraints, units)
    assert third.document == second.document
    assert again.urdf == translate(third.document, third.document.robot(), Path()).urdf
    assert all(joint == theirs for joint, theirs in second.joints.items())
    assert largest_difference(made.urdf, second, spread=0.0) < 1e-11


LIFT = '<origin xyz="0 0 0.4"/><axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="1" velocity="3"/>'
CHAIN = robot(
    links("base_link", "shoulder", "elbow", "tool"),
    joint_text("lift", "base_link", "shoulder", LIFT, "revolute"),
    joint_text("bend", "shoulder", "elbow", '<origin xyz="0.3 0 0"/><axis xyz="0 1 0"/>'),
    joint_text("flange", "elbow", "tool", '<origin xyz="0.2 0 0"/>', "fixed"),
)


def test_a_chain_reads_as_the_textbook_has_it():
    imported = import_tree(parse(CHAIN, "x"), "x")
    links = {link.number: link for link in imported.document.robot().links}
    assert links[1].parameters.alpha in (90, -90)
    assert (links[2].parameters.d, links[2].parameters.alpha, links[2].parameters.r) == (300, 0, 0)
    assert links[2].limits is None
    low, high = (math.degrees(x + imported.offsets["joint1"]) for x in (-1, 2))
    assert links[1].limits == pytest.approx((low, high), abs=1e-8)
    assert links[1].velocity == pytest.approx(math.degrees(3), abs=1e-8)
    assert (links[1].effort, links[2].effort) == (1.0, None)
    assert imported.nodes == {"base_link": "base_link", "shoulder": "shoulder", "elbow": "elbow", "tool": "tool"}
    assert imported.joints == {"lift": "joint1", "bend": "joint2"}
    assert largest_difference(CHAIN, imported) < 1e-12


def test_a_robot_that_floats_has_a_base_that_moves():
    text = CHAIN.replace('name="lift" type="revolute"', 'name="lift" type="floating"')
    imported = import_tree(parse(text, "x"), "x")
    robot = imported.document.robot()
    assert robot.movable
    assert imported.nodes["shoulder"] == "shoulder"
    assert robot.base.parameters.r == 400
    made = translate(imported.document, robot, Path())
    assert made.constraints["floating"] == "joint0"
    assert import_tree(parse(made.urdf, "y"), "y", made.constraints).document.robot().movable


def test_names_that_raff_cant_say_are_changed_and_told():
    text = CHAIN.replace('"tool"', '"base"').replace('"elbow"', '"left elbow#2"')
    imported = import_tree(parse(text, "x"), "x")
    assert imported.nodes["base"] == "base_2"
    assert imported.nodes["left elbow#2"] == "left_elbow_2"
    raff2urdf.check(imported.document)


def test_axes_that_are_nearly_parallel_are_said_with_numbers_near_the_robot():
    """Their common perpendicular is a thousand kilometres away: a frame stands in between."""
    text = CHAIN.replace('<origin xyz="0.3 0 0"/>', '<origin xyz="0.3 0 0" rpy="3e-7 0 0"/>')
    imported = import_tree(parse(text, "x"), "x")
    written = [part.parameters for part in imported.document.robot().parts]
    assert max(abs(x) for p in written for x in (p.r, p.d, p.epsilon)) < 3000.0  # mm
    assert largest_difference(text, imported) < 1e-12


def test_a_urdf_of_raff_gives_its_file_back(root):
    """Numbers, names, limits, motors, loops and sensors: what `robots/planar_hybrid.raff` says."""
    document = raff2urdf.load(root / "robots" / "planar_hybrid.raff")
    made = translate(document, document.robot(), root / "robots")
    imported = import_tree(parse(made.urdf, "x"), "x", made.constraints, document.units)
    robot = imported.document.robot()
    assert [link.number for link in robot.links] == [link.number for link in document.robot().links]
    assert [link.parameters for link in robot.links] == [link.parameters for link in document.robot().links]
    assert set(imported.offsets.values()) == {0.0}
    again = translate(imported.document, robot, root / "robots")
    assert (again.urdf, again.constraints) == (made.urdf, made.constraints)


COUPLED = """RAFF Coupled
units {units}
robot coupled {{
  base {{ }}
  link 1 {{ parameters {{ theta 10 }} type 2 pred 0 }}
  link 2 {{ parameters {{ alpha 30 d 1 r 0.5 theta 20 }} type 2 pred 1 }}
  link 3 {{ parameters {{ alpha 90 d 1 r 0.25 theta 40 }} type 1 pred 2 }}
  link 4 {{ parameters {{ d 0.5 }} type 1 pred 3 }}
  link 5 {{ parameters {{ d 0.3 alpha 45 }} type 2 pred 4 }}
  {couplings}
}}"""


@pytest.mark.parametrize("units", ["mm", "m"])
@pytest.mark.parametrize("coupling", [
    "link 5 link 1 ratio -2.123456789012345", "link 2 link 1 ratio 0.3333333333333333 offset 12.5",
    "link 4 link 2 lead 20 offset 10", "link 4 link 2 radius 12.3", "link 2 link 3 lead -0.017",
    "link 3 link 4 ratio 1", "link 5 link 3 polynomial ( 1.5 0.02 ) offset -3",
    "link 4 link 1 polynomial ( 0 1.5 0.02 -0.001 )",
    'name "wrist" link 5 link 1 ratio 0.5 link 2 ratio -0.5 link 3 radius 3',
])  # fmt: skip
def test_a_coupling_of_raff_comes_back_as_it_was_written(coupling, units):
    document = parse_raff(COUPLED.format(units=units, couplings=f"coupling {{ {coupling} }}"))
    made = translate(document, document.robot(), Path())
    imported = import_tree(parse(made.urdf, "x"), "x", made.constraints, units)
    (written,) = document.robot().couplings
    (back,) = imported.document.robot().couplings
    assert (back.follower, back.name) == (written.follower, written.name)
    assert [(drive.link, drive.kind) for drive in back.drives] == [(drive.link, drive.kind) for drive in written.drives]
    for drive, other in zip(back.drives, written.drives, strict=True):
        assert drive.numbers == pytest.approx(other.numbers, rel=1e-13)
    assert back.offset == pytest.approx(written.offset, abs=1e-11)


@settings(max_examples=60)
@given(trees(5), st.data())
def test_a_coupling_means_the_same_at_any_joint_values(text, data):
    tree = parse(text, "x")
    moving = [joint.get("name") for joint in joints(tree) if joint.get("type") != "fixed"]
    if len(moving) < 2:
        return
    number = st.floats(0.1, 3.0) | st.floats(-3.0, -0.1)
    chosen = data.draw(st.permutations(moving))[: data.draw(st.integers(2, len(moving)))]
    terms = {joint: tuple(data.draw(st.lists(number, min_size=1, max_size=3))) for joint in chosen}
    terms[data.draw(st.sampled_from(chosen))] = (data.draw(number),)
    coupling = Coupling("c", terms, data.draw(number))
    entry = coupling_entry(coupling.name, coupling.terms, coupling.constant)
    imported = import_tree(tree, "x", {"couplings": [entry]}, "m")
    robot = imported.document.robot()
    raff2urdf.check(imported.document)
    again = raff_tree.coupling_of(imported.document, robot, 0)
    values = {joint: data.draw(st.floats(-1.0, 1.0)) for joint in moving}
    q = {imported.joints[joint]: value + imported.offsets[imported.joints[joint]] for joint, value in values.items()}
    ((factor,), *_) = [terms[joint] for joint in chosen if imported.joints[joint] == again.follower]
    assert again.evaluate(q)[0] * factor == pytest.approx(coupling.evaluate(values)[0], abs=1e-9)


@pytest.mark.parametrize(("terms", "says"), [
    ({"lift": [1.0]}, "since it names one joint only: leave it out with --ignore c"),
    ({"lift": [1.0, 2.0], "bend": [0.0, 1.0]}, "has no notation in RAFF, since no joint is linear in it"),
    ({"lift": [1.0], "lost": [1.0]}, "names 'lost', which is not a joint that moves"),
])  # fmt: skip
def test_a_coupling_without_notation_is_an_error(terms, says):
    with pytest.raises(raff2urdf.RaffError, match=says):
        import_tree(parse(CHAIN, "x"), "x", {"couplings": [coupling_entry("c", terms)]})


def test_actuated_joints_are_declared_only_where_the_file_does():
    coupling = coupling_entry("c", {"lift": [1.0], "bend": [2.0]})

    def declared(*entries):
        imported = import_tree(parse(CHAIN, "x"), "x", {"couplings": [coupling], "joints": list(entries)})
        return [link.actuated for link in imported.document.robot().links]

    lift, bend = {"name": "lift", "home": 0.0}, {"name": "bend", "home": 0.0}
    assert declared(lift, bend) == [None, None]
    assert declared(lift | {"actuated": None}, bend | {"actuated": None}) == [None, None]
    assert declared(lift | {"actuated": True}, bend | {"actuated": False}) == [True, None]
    assert declared(lift | {"actuated": False}, bend | {"actuated": None}) == [False, None]
    assert declared(lift | {"actuated": False}, bend | {"actuated": False}) == [False, False]
    assert declared(lift | {"actuated": True}, bend | {"actuated": True}) == [True, True]


@given(st.floats(-1e4, 1e4), st.integers(0, 6))
def test_a_tidy_number_is_short_and_stays_as_it_is(value, decimals):
    near = tidy(value, 1e-9)
    assert abs(near - value) <= 1e-9
    assert tidy(near, 1e-9) == near
    short = round(value, decimals)
    assert tidy(short + 1e-10, 1e-9) == short


def chain(count):
    place = '<origin xyz="0.1 0 0" rpy="0 {} 0.1"/><axis xyz="0 0 1"/>'
    turns = [joint_text(f"j{i}", f"l{i - 1}", f"l{i}", place.format(0.3 * (i % 2))) for i in range(1, count)]
    return robot(links(*(f"l{i}" for i in range(count))), *turns)


def test_a_chain_of_more_links_than_python_recurses_is_turned():
    """Bodies were counted by a function that called itself, as deep as the chain is long."""
    assert len(import_tree(parse(chain(1100), "x"), "x").document.robot().links) == 1099


def test_a_joint_may_be_called_as_raff2urdf_calls_the_one_that_places_the_base():
    imported = import_tree(parse(chain(3).replace('"j1"', '"joint0"'), "x"), "x")
    assert imported.joints == {"joint0": "joint1", "j2": "joint2"}
    held = chain(3).replace('"j2" type="continuous"', '"joint0" type="fixed"')
    assert set(import_tree(parse(held, "x"), "x").nodes) == {"l0", "l1", "l2"}


# --- urdf2raff graphics -----------------------------------------------------------------------------------------------
# What a URDF shows is shown by the RAFF file that becomes of it.


URDF = robot(
    '<material name="blue"><color rgba="0 0 1 1"/></material>',
    '<link name="base_link">{base}</link>\n<link name="upper">{upper}</link>',
    joint_text("turn", "base_link", "upper", LIFT.replace("0.4", "0.5"), "revolute"),
)

BOX = """<visual><origin xyz="0.1 0 0" rpy="0 0 0.5"/><geometry><box size="0.2 0.1 0.05"/></geometry>
  <material name="blue"/></visual>"""
MESH = '<visual><geometry><mesh filename="{0}"{1}/></geometry>{2}</visual>'
RED = '<material name="r"><color rgba="1 0 0 0.5"/></material>'


@pytest.fixture
def mesh_folder(tmp_path):
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box(extents=(0.3, 0.2, 0.1)).export(tmp_path / "meshes/part.stl")
    trimesh.creation.icosphere(subdivisions=1, radius=0.1).export(tmp_path / "ball.stl")
    return tmp_path


def write(folder, base="", upper=""):
    path = folder / "arm.urdf"
    path.write_text(URDF.format(base=base, upper=upper))
    return path


def shown(urdf: Path):
    """Of each link: area, centre and colour of every surface it shows, in its own frame, m."""
    model, surfaces = yourdfpy.URDF.load(str(urdf), build_scene_graph=False, load_meshes=False).robot, {}
    colours = {material.name: material.color for material in model.materials}
    for link in model.links:
        for visual in link.visuals:
            shape, material = visual.geometry, visual.material
            if shape.mesh is None:
                surface = trimesh.creation.box(extents=shape.box.size)
            else:
                surface = trimesh.load(urdf.parent / shape.mesh.filename.removeprefix("file://"), force="mesh")
                surface.apply_scale(1.0 if shape.mesh.scale is None else shape.mesh.scale)
            surface.apply_transform(np.eye(4) if visual.origin is None else visual.origin)
            colour = None if material is None else material.color or colours[material.name]
            colour = None if colour is None else tuple(round(255 * value) for value in colour.rgba)
            surfaces.setdefault(link.name, []).append((surface.area, tuple(surface.centroid), colour))
    return surfaces


@pytest.mark.parametrize("units", ["m", "mm"])
def test_every_link_shows_what_it_showed(mesh_folder, units):
    upper = BOX + MESH.format("meshes/part.stl", ' scale="2 2 -2"', RED)
    path = write(mesh_folder, base=MESH.format("file://" + str(mesh_folder / "ball.stl"), "", ""), upper=upper)
    raff2urdf.to_raff(path, mesh_folder / "out/arm.raff", units=units)
    (made,) = convert(mesh_folder / "out/arm.raff", mesh_folder / "again")
    before, after = shown(path), shown(made.urdf)
    assert set(after) == {"base_link", "upper"}
    for link, surfaces in before.items():
        assert len(surfaces) == len(after[link])
        pairs = zip(sorted(surfaces), sorted(after[link]), strict=True)
        for (area, centre, colour), (area_there, centre_there, colour_there) in pairs:
            assert area_there == pytest.approx(area, rel=1e-5)
            assert centre_there == pytest.approx(centre, abs=1e-5)
            assert colour_there == colour or colour is None


def test_what_raff2urdf_draws_itself_is_drawn_again(root, tmp_path):
    """A skeleton needs no files."""
    convert(root / "robots/four_bar.raff", tmp_path)
    imported = raff2urdf.to_raff(tmp_path / "four_bar.urdf", tmp_path / "four_bar.raff")
    assert all(part.filenames is None for part in imported.document.robot().nodes.values())
    assert not (tmp_path / "four_bar_graphics").exists()
    (made,) = convert(tmp_path / "four_bar.raff", tmp_path / "again")
    assert made.urdf.read_bytes() == (tmp_path / "four_bar.urdf").read_bytes()


def test_a_shape_that_is_wrong_is_told_by_its_line(mesh_folder, capsys):
    path = write(mesh_folder, base='<visual><geometry><torus radius="1"/></geometry></visual>', upper=BOX)
    before = set(mesh_folder.rglob("*"))
    assert main([str(path), "-o", str(mesh_folder / "out/arm.raff")]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert "arm.urdf:3: the shape <torus> is not in URDF" in err
    assert set(mesh_folder.rglob("*")) == before
    raff2urdf.to_raff(path, mesh_folder / "out/arm.raff", graphics=False)  # what can be read is not lost


@pytest.mark.parametrize(("name", "says"), [
    ("lost.stl", "is not found"), ("file:///etc/passwd", "leads out of"),
    ("cut.stl", "can't be read: .*: export it again"),
])  # fmt: skip
def test_a_link_whose_mesh_cannot_be_had_is_drawn_as_a_skeleton(mesh_folder, name, says):
    (mesh_folder / "cut.stl").write_bytes((mesh_folder / "meshes/part.stl").read_bytes()[:200])
    path = write(mesh_folder, base=MESH.format(name, "", ""), upper=BOX + MESH.format(name, ' scale="2 2 2"', ""))
    warned = f"arm.urdf:3: .*mesh '.*{name}'.*{says}.*left out; .*skeleton"
    with pytest.warns(raff2urdf.RaffWarning, match=warned) as seen:
        imported = raff2urdf.to_raff(path, mesh_folder / "arm.raff")
    assert len(seen) == 1
    files = {part.node: part.filenames for part in imported.document.robot().nodes.values()}
    assert (files["base_link"], files["upper"]) == (None, ("arm_graphics/upper.glb",))
    (made,) = convert(mesh_folder / "arm.raff", mesh_folder / "again")
    drawn = {link.get("name"): link.findall("visual/geometry/*") for link in etree.parse(made.urdf).iter("link")}
    assert {shape.tag for shape in drawn["base"]} >= {"mesh", "cylinder"}  # the tube to the joint, and its hinge
    assert [shape.tag for shape in drawn["upper"]] == ["mesh"]


def test_a_mesh_that_the_raff_file_may_not_name_is_copied(mesh_folder):
    """So that the file can be read where it is written."""
    path = write(mesh_folder, base=MESH.format("meshes/part.stl", "", ""))
    imported = raff2urdf.to_raff(path, mesh_folder / "far/away/arm.raff")
    files = [part.filenames for part in imported.document.robot().nodes.values()]
    assert ("arm_graphics/base_link.glb",) in files
    (made,) = convert(mesh_folder / "far/away/arm.raff", mesh_folder / "again")
    assert shown(made.urdf)["base_link"][0][0] == pytest.approx(shown(path)["base_link"][0][0], rel=1e-5)
