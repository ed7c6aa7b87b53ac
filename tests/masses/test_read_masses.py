"""Masses of SDF and MJCF: MuJoCo itself judges those of MJCF, SDF's specification those of SDF."""

import math
import re
import warnings
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from numpy.typing import NDArray
from urdf_text import joint_at
from urdf_text import link as link_text
from urdf_text import robot as urdf

import cinegen
from cinegen.model.build import build
from raff2urdf import RaffError, RaffWarning
from raff2urdf.raff.document import RaffInertial
from raff2urdf.raff.reader import loads
from raff2urdf.raff.writer import dumps

MJCF = """<mujoco><compiler meshdir="meshes" {}/>
<asset><mesh name="box" file="box.stl"/><mesh file="ball.stl" scale="1 2 1"/></asset>
<default><default class="light"><geom density="70"/></default></default>
<worldbody><body name="a"><joint name="ja"/>
  <geom type="mesh" mesh="box" pos=".1 0 0" euler="10 20 30"/><geom type="capsule" size=".02" fromto="0 0 0 .2 .1 0"/>
  <geom type="mesh" mesh="ball" density="0"/>
<body name="b" pos=".3 0 0"><joint name="jb" type="ball"/>
  <geom type="mesh" mesh="ball" mass="2"/><geom group="3" size=".1" class="light"/>
<body name="c" pos=".3 0 0"><joint name="jc" axis="0 1 0" pos="0 .1 0"/>
  <inertial pos=".1 .2 .3" quat="1 2 3 4" mass="1.5" diaginertia="1 2 2.5"/><geom type="mesh" mesh="ball"/>
<body name="d"><geom type="ellipsoid" size=".1 .2 .3"/></body>
</body></body></body></worldbody>
<actuator><motor joint="ja"/></actuator></mujoco>"""

SETTINGS = [
    "", 'inertiafromgeom="true" inertiagrouprange="0 2"', 'settotalmass="7"', 'boundmass="3" boundinertia="0.9"',
]  # fmt: skip


def mjcf(tmp_path: Path, settings: str = "") -> Path:
    (tmp_path / "meshes").mkdir(exist_ok=True)
    shift = trimesh.transformations.translation_matrix((0.05, 0.0, 0.02))
    trimesh.creation.box((0.1, 0.2, 0.3), transform=shift).export(tmp_path / "meshes" / "box.stl")
    trimesh.creation.icosphere(subdivisions=1, radius=0.1).export(tmp_path / "meshes" / "ball.stl")
    path = tmp_path / "m.xml"
    path.write_text(MJCF.format(settings))
    return path


def by_mujoco(path: Path) -> tuple[mujoco.MjModel, NDArray[np.float64]]:
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)  # of settotalmass; it would be written to a file
    model = mujoco.MjModel.from_xml_path(str(path))
    mujoco.set_mju_user_warning(before)
    data, dense = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, dense)
    return model, dense


@pytest.mark.parametrize("settings", SETTINGS)
def test_masses_are_those_that_mujoco_computes(tmp_path: Path, settings: str) -> None:
    path = mjcf(tmp_path, settings)
    model, expected = by_mujoco(path)
    mechanism = cinegen.load(path)
    assert mechanism.massless == ()
    assert not [note for note in mechanism.source.notes if "inertia" in note]
    ball = mechanism.v_index("jb")
    order = [mechanism.v_index("ja"), ball, ball + 1, ball + 2, mechanism.v_index("jc")]
    upper = np.triu(pin.crba(mechanism.model, mechanism.model.createData(), mechanism.q_home))
    computed = (upper + np.triu(upper, 1).T)[np.ix_(order, order)]
    np.testing.assert_allclose(computed, expected, atol=1e-12 * expected.max(), rtol=0.0)
    assert sum(link.mass for link in mechanism.model.inertias) == pytest.approx(float(model.body_mass.sum()), rel=1e-14)


@pytest.mark.parametrize(("settings", "content", "massless", "why"), [
    ("", None, ("b",), "inertia of body 'b': mesh 'meshes/ball.stl' is not found"),
    ("", b"no mesh", ("a", "b"), "inertia of body 'b': MuJoCo can't read its meshes"),
    ('settotalmass="7"', None, ("a", "b", "c"), "inertia of body 'd': settotalmass needs the masses of all bodies"),
])  # fmt: skip
def test_masses_that_need_a_missing_mesh_are_unknown(tmp_path: Path, settings: str, content, massless, why) -> None:
    path = mjcf(tmp_path, settings)
    ball = tmp_path / "meshes" / "ball.stl"
    ball.unlink()
    if content is not None:
        ball.write_bytes(content)
    mechanism = cinegen.load(path)
    assert mechanism.massless == massless
    assert any(why in note for note in mechanism.source.notes)


def test_a_mesh_elsewhere_is_not_read_for_its_mass(tmp_path: Path) -> None:
    inner = tmp_path / "one" / "two"
    inner.mkdir(parents=True)
    path = mjcf(inner)
    path.write_text(path.read_text().replace('file="ball.stl"', 'file="../../../ball.stl" name="ball"'))
    (inner / "meshes" / "ball.stl").rename(tmp_path / "ball.stl")
    mechanism = cinegen.load(path)
    assert mechanism.massless == ("b",)
    assert any("leads out of" in note for note in mechanism.source.notes)


def test_bodies_without_geoms_have_no_mass() -> None:
    mechanism = cinegen.load(
        '<mujoco><compiler inertiafromgeom="false"/><worldbody><body name="a"><joint/><geom size=".1"/>'
        '<body name="b"><joint/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></body></worldbody></mujoco>'
    )
    assert mechanism.massless == ("a",)
    assert [inertia.mass for inertia in mechanism.model.inertias] == [0.0, 0.0, 2.0]


SDF = """<sdf version="1.9"><model name="m"><link name="base"/>
<link name="a"><pose>0.1 0 0 0 0 0.5</pose><inertial>{}</inertial></link>
<joint name="j" type="revolute"><parent>base</parent><child>a</child><axis><xyz>0 0 1</xyz></axis></joint>
</model></sdf>"""


def test_an_inertial_of_an_sdf_is_in_its_own_axes_and_what_it_leaves_out_is_1() -> None:
    moments = "<ixx>1</ixx><ixy>0.1</ixy><ixz>0.2</ixz><iyy>2</iyy><iyz>-0.3</iyz><izz>2.5</izz>"
    text = f"<mass>3</mass><pose>0.1 0.2 0.3 0.4 -0.5 0.6</pose><inertia>{moments}</inertia>"
    (_, link) = cinegen.load(SDF.format(text)).model.inertias
    rotation = pin.rpy.rpyToMatrix(0.4, -0.5, 0.6)
    matrix = np.array([[1.0, 0.1, 0.2], [0.1, 2.0, -0.3], [0.2, -0.3, 2.5]])
    assert link.mass == 3.0
    np.testing.assert_allclose(link.lever, [0.1, 0.2, 0.3], rtol=1e-14)
    np.testing.assert_allclose(link.inertia, rotation @ matrix @ rotation.T, atol=1e-14)
    (_, link) = cinegen.load(SDF.format("<inertia><ixx>1.5</ixx></inertia>")).model.inertias
    assert link.mass == 1.0
    np.testing.assert_array_equal(link.inertia, np.diag([1.5, 1.0, 1.0]))


def test_an_inertial_that_simulators_compute_is_unknown() -> None:
    text = SDF.format("<density>2000</density>").replace("<inertial>", '<inertial auto="true">')
    mechanism = cinegen.load(text)
    assert mechanism.massless == ("a",)
    assert mechanism.source.notes == ("not read: inertial of link 'a' (line 2), which auto=\"true\" leaves open",)


@pytest.mark.parametrize(("text", "why"), [
    ("<mass>-1</mass>", "<text>:2: the mass of link 'a' is -1 kg: it must not be negative"),
    ("<inertia><ixy>9e12</ixy><iyy>9e12</iyy></inertia><pose>0 0 0 0 0 0.7</pose>", "<text>:2: the inertia of link"),
    ("<inertia><iyz>1 2</iyz></inertia>", "<text>:2: the iyz of link 'a' must be a number, not '1 2'"),
])  # fmt: skip
def test_wrong_masses_of_an_sdf_are_refused_with_their_line(text: str, why: str) -> None:
    with pytest.raises(cinegen.CinegenError, match=why):
        cinegen.load(SDF.format(text))


# --- massless ---------------------------------------------------------------------------------------------------------
# The mechanism tells which bodies have no mass, and which masses are no body's.


UNIT = '<inertia ixx="{}" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'


def inertial(mass: float, ixx: float = 1.0) -> str:
    return f'<inertial><mass value="{mass}"/>{UNIT.format(ixx)}</inertial>'


def chain(links: dict[str, str], kinds: list[str]) -> str:
    """A URDF of links one behind another, with joints of the kinds between them."""
    bodies = [link_text(name, inner) for name, inner in links.items()]
    ends = zip(pairwise(links), kinds, strict=True)
    return urdf(*bodies, *(joint_at(f"to_{child}", parent, child, kind=kind) for (parent, child), kind in ends))


def test_a_body_has_the_mass_of_any_link_on_it_and_a_stated_mass_of_0_is_known() -> None:
    links = {"base": "", "arm": "", "flange": inertial(2.0), "hand": "", "finger": ""}
    mechanism = cinegen.load(chain(links, ["continuous", "fixed", "continuous", "fixed"]))
    assert mechanism.massless == ("hand",)
    assert mechanism.model.inertias[mechanism.model.getJointId("to_arm")].mass == 2.0
    cross = inertial(0.0).replace('"1', '"0').replace('"1.0', '"0')
    links = {"base": "", "cross": cross, "hand": inertial(1.0)}
    assert cinegen.load(chain(links, ["continuous"] * 2)).massless == ()


def test_a_body_that_a_rigid_loop_cut_has_the_mass_of_either_half() -> None:
    """The platform of a delta robot is link 5, and the last bodies of the two other arms."""
    delta = cinegen.load("delta4")
    urdf = re.sub("<inertial>.*?</inertial>", "", delta.source.urdf, flags=re.DOTALL)
    before = build(urdf, delta.source.constraints)
    text = urdf.replace('<link name="link5">', f'<link name="link5">{inertial(1.5)}')
    assert text != urdf
    mechanism = build(text, before.source.constraints)
    assert set(before.massless) - set(mechanism.massless) >= {"link5", "link10", "link16"}


@pytest.mark.parametrize(("mass", "ixx", "why"), [
    (1.0, -0.1, "a principal moment of inertia is negative, -0.1 kg m2"),
    (1.0, 2.1, "a principal moment of inertia, 2.1 kg m2, exceeds the sum of the others, 1 and 1"),
    (0.0, 1.0, "it has moments of inertia, up to 1 kg m2, but no mass: state its mass"),
])  # fmt: skip
def test_an_inertia_that_no_body_has_is_named_with_the_reason(mass: float, ixx: float, why: str) -> None:
    with pytest.warns(cinegen.CinegenWarning, match="link 'arm'.*no body can have"):
        mechanism = cinegen.load(chain({"base": "", "arm": inertial(mass, ixx)}, ["continuous"]))
    assert mechanism.unphysical == {"arm": why}


# --- raff inertial ----------------------------------------------------------------------------------------------------
# Masses in RAFF: stated in the file's units, or of a density; wrong ones are refused with their place.


def robot(inertial: str, more: str = "", head: str = "") -> str:
    return f"RAFF a\n{head}\nrobot r {{\n  link 1 {{ type 2 pred 0 {inertial} }}\n  {more}\n}}\n"


def loaded(tmp_path: Path, text: str) -> cinegen.Mechanism:
    path = tmp_path / "a.raff"
    path.write_text(text)
    return cinegen.load(path)


def body(mechanism: cinegen.Mechanism, joint: str = "joint1") -> pin.Inertia:
    return mechanism.model.inertias[mechanism.model.getJointId(joint)]


IN_MM = "inertial { mass 2 centre { 10 20 30 } moments { 4000 5000 6000 } products { 100 -200 300 } }"
IN_M = "inertial { mass 2 centre { 0.01 0.02 0.03 } moments { 4e-3 5e-3 6e-3 } products { 1e-4 -2e-4 3e-4 } }"


@pytest.mark.parametrize(("text", "head"), [(IN_MM, ""), (IN_M, "units m")])
def test_moments_are_in_kg_and_the_files_unit_of_length(text: str, head: str) -> None:
    link = body(cinegen.load(robot(text, head=head)))
    assert link.mass == 2.0
    np.testing.assert_allclose(link.lever, [0.01, 0.02, 0.03], rtol=1e-15)
    expected = [[4e-3, 1e-4, -2e-4], [1e-4, 5e-3, 3e-4], [-2e-4, 3e-4, 6e-3]]
    np.testing.assert_allclose(link.inertia, expected, rtol=1e-14)


@pytest.mark.parametrize("text", [IN_MM, "inertial { mass 0 }", "inertial { density 2700 radius 5 }"])
def test_inertials_are_written_as_they_were_read(text: str) -> None:
    frame = f'frame 2 {{ pred 1 parameters {{ d 100 }} {text} }} base {{ filename {{ "a.stl" }} {text} }}'
    document = loads(robot(text, frame))
    assert loads(dumps(document)) == document
    assert all(isinstance(node.inertial, RaffInertial) for node in document.robots[0].nodes.values())


@pytest.mark.parametrize("kind", ["ball", "universal", "cylindrical", "planar"])
def test_a_joint_of_several_variables_moves_the_mass_by_all_of_them(kind: str) -> None:
    more = f"link 2 {{ joint {kind} pred 1 parameters {{ d 100 }} inertial {{ mass 5 centre {{ 7 8 9 }} }} }}"
    mechanism = cinegen.load(robot("inertial { mass 2 }", more))
    assert mechanism.massless == ()
    node = mechanism.model.frames[mechanism.frame_id("link2")].parentJoint
    assert [inertia.mass for inertia in mechanism.model.inertias if inertia.mass > 0.0] == [2.0, 5.0]
    assert mechanism.model.inertias[node].mass == 5.0


# --- densities -----------------------------------------------------------------------------------------------------


def test_bars_run_along_epsilon_d_and_r_of_the_children() -> None:
    more = "link 2 { type 2 pred 1 parameters { epsilon 30 d 200 r 100 alpha 90 } }"
    link = body(cinegen.load(robot("inertial { density 7850 radius 6 }", more)))
    per_length = 7850.0 * math.pi * 0.006**2
    lengths = np.array([0.03, 0.2, 0.1])
    middles = np.array([[0.0, 0.0, 0.015], [0.1, 0.0, 0.03], [0.2, -0.05, 0.03]])
    assert link.mass == pytest.approx(per_length * 0.33, rel=1e-8)
    np.testing.assert_allclose(link.lever, lengths @ middles / 0.33, atol=1e-9)
    corners = [(0, 0, 0), (0, 0, 0.03), (0.2, 0, 0.03), (0.2, -0.1, 0.03)]
    bars = [trimesh.creation.cylinder(0.006, segment=s, sections=400) for s in pairwise(corners)]
    whole = trimesh.util.concatenate(bars)
    whole.density = 7850.0
    np.testing.assert_allclose(link.inertia, whole.moment_inertia, rtol=2e-3, atol=1e-8)


@pytest.mark.parametrize("ending", ["stl", "obj", "glb", "ply"])
def test_a_density_counts_for_the_volume_of_the_graphics(tmp_path: Path, ending: str) -> None:
    box = trimesh.creation.box((100.0, 60.0, 20.0), transform=trimesh.transformations.translation_matrix((50, 0, 0)))
    box.export(tmp_path / f"box.{ending}")
    link = body(loaded(tmp_path, robot(f'inertial {{ density 2700 }} filename {{ "box.{ending}" }}')))
    mass = 2700.0 * 0.1 * 0.06 * 0.02
    assert link.mass == pytest.approx(mass, rel=1e-6)
    np.testing.assert_allclose(link.lever, [0.05, 0.0, 0.0], atol=1e-9)
    expected = mass / 12.0 * np.array([0.06**2 + 0.02**2, 0.1**2 + 0.02**2, 0.1**2 + 0.06**2])
    np.testing.assert_allclose(link.inertia, np.diag(expected), rtol=1e-6, atol=1e-12)


def test_of_an_open_surface_the_hull_counts_and_a_warning_names_the_file(tmp_path: Path) -> None:
    box = trimesh.creation.box((100.0, 60.0, 20.0))
    trimesh.Trimesh(box.vertices, box.faces[2:]).export(tmp_path / "open.stl")
    with pytest.warns(RaffWarning, match=r"a.raff:4:45: the graphics 'open.stl' of link 1 enclose no volume: .* hull"):
        link = body(loaded(tmp_path, robot('inertial { density 1000 } filename { "open.stl" }')))
    assert link.mass == pytest.approx(0.12, rel=1e-6)


def test_a_density_without_a_volume_is_refused(tmp_path: Path) -> None:
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    flat.export(tmp_path / "flat.stl")
    refused = pytest.raises(RaffError, match=r"a.raff:4:.*but graphics that enclose no volume: give its 'mass'")
    with warnings.catch_warnings(action="ignore"), refused:  # of graphics that can't be shown
        loaded(tmp_path, robot('inertial { density 3 } filename { "flat.stl" }'))


# --- wrong ones ----------------------------------------------------------------------------------------------------


def test_an_inertia_that_no_body_has_is_a_warning_and_is_kept() -> None:
    text = robot("inertial { mass 1 moments { 1 1 3 } }")
    with pytest.warns(RaffWarning, match=r"<text>:4:54: no body can have the inertia of link 1: .* exceeds the sum"):
        mechanism = cinegen.load(text)
    assert list(mechanism.unphysical) == ["link1"]
    assert body(mechanism).inertia[2, 2] == pytest.approx(3e-6)
