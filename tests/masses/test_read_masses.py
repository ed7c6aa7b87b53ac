"""Masses of SDF and MJCF: MuJoCo itself judges those of MJCF, SDF's specification those of SDF."""

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from numpy.typing import NDArray

import cinegen

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
    found = (upper + np.triu(upper, 1).T)[np.ix_(order, order)]
    np.testing.assert_allclose(found, expected, atol=1e-12 * expected.max(), rtol=0.0)
    assert sum(one.mass for one in mechanism.model.inertias) == pytest.approx(float(model.body_mass.sum()), rel=1e-14)


@pytest.mark.parametrize(("settings", "content", "massless", "why"), [
    ("", None, ("b",), "inertia of body 'b': mesh 'meshes/ball.stl' is not found"),
    ("", b"no mesh", ("a", "b"), "inertia of body 'b': MuJoCo can't read its meshes"),
    ('settotalmass="7"', None, ("a", "b", "c"), "inertia of body 'd': settotalmass needs the masses of all bodies"),
])  # fmt: skip
def test_masses_that_need_a_missing_mesh_are_unknown(
    tmp_path: Path, settings: str, content: bytes | None, massless: tuple[str, ...], why: str
) -> None:
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


def test_bodies_without_geoms_have_no_mass(tmp_path: Path) -> None:
    path = tmp_path / "bare.xml"
    path.write_text(
        '<mujoco><compiler inertiafromgeom="false"/><worldbody><body name="a"><joint/><geom size=".1"/>'
        '<body name="b"><joint/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></body></worldbody></mujoco>'
    )
    mechanism = cinegen.load(path)
    assert mechanism.massless == ("a",)
    assert [inertia.mass for inertia in mechanism.model.inertias] == [0.0, 0.0, 2.0]


def test_an_inertia_beyond_all_numbers_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "big.xml"
    own = '<inertial pos="0 0 0" mass="1" diaginertia="1e20 1e20 1e20"/>'
    path.write_text(f'<mujoco><worldbody><body name="a"><joint/>{own}</body></worldbody></mujoco>')
    with pytest.raises(
        cinegen.CinegenError, match=r"big.xml: the inertia of body 'a' is beyond 1e\+13: check its unit"
    ):
        cinegen.load(path)


SDF = """<sdf version="1.9"><model name="m"><link name="base"/>
<link name="a"><pose>0.1 0 0 0 0 0.5</pose><inertial>{}</inertial></link>
<joint name="j" type="revolute"><parent>base</parent><child>a</child><axis><xyz>0 0 1</xyz></axis></joint>
</model></sdf>"""


def sdf(tmp_path: Path, text: str, outer: str = "") -> Path:
    path = tmp_path / "m.sdf"
    path.write_text(SDF.format(text).replace("<inertial>", f"<inertial{outer}>"))
    return path


def test_an_inertial_of_an_sdf_is_in_its_own_axes(tmp_path: Path) -> None:
    moments = "<ixx>1</ixx><ixy>0.1</ixy><ixz>0.2</ixz><iyy>2</iyy><iyz>-0.3</iyz><izz>2.5</izz>"
    text = f"<mass>3</mass><pose>0.1 0.2 0.3 0.4 -0.5 0.6</pose><inertia>{moments}</inertia>"
    (_, found) = cinegen.load(sdf(tmp_path, text)).model.inertias
    rotation = pin.rpy.rpyToMatrix(0.4, -0.5, 0.6)
    matrix = np.array([[1.0, 0.1, 0.2], [0.1, 2.0, -0.3], [0.2, -0.3, 2.5]])
    assert found.mass == 3.0
    np.testing.assert_allclose(found.lever, [0.1, 0.2, 0.3], rtol=1e-14)
    np.testing.assert_allclose(found.inertia, rotation @ matrix @ rotation.T, atol=1e-14)


def test_what_an_inertial_of_an_sdf_leaves_out_is_1(tmp_path: Path) -> None:
    (_, found) = cinegen.load(sdf(tmp_path, "<inertia><ixx>1.5</ixx></inertia>")).model.inertias
    assert found.mass == 1.0
    np.testing.assert_array_equal(found.inertia, np.diag([1.5, 1.0, 1.0]))


def test_an_inertial_that_simulators_compute_is_unknown(tmp_path: Path) -> None:
    mechanism = cinegen.load(sdf(tmp_path, "<density>2000</density>", ' auto="true"'))
    assert mechanism.massless == ("a",)
    assert mechanism.source.notes == ("not read: inertial of link 'a' (line 2), which auto=\"true\" leaves open",)


@pytest.mark.parametrize(("text", "why"), [
    ("<mass>-1</mass>", "m.sdf:2: the mass of link 'a' is -1 kg: it must not be negative"),
    ("<inertia><ixy>9e12</ixy><iyy>9e12</iyy></inertia><pose>0 0 0 0 0 0.7</pose>", "m.sdf:2: the inertia of link"),
    ("<inertia><iyz>1 2</iyz></inertia>", "m.sdf:2: <iyz> of link 'a' must be a number, not '1 2'"),
])  # fmt: skip
def test_wrong_masses_of_an_sdf_are_refused_with_their_line(tmp_path: Path, text: str, why: str) -> None:
    with pytest.raises(cinegen.CinegenError, match=why):
        cinegen.load(sdf(tmp_path, text))
