"""Masses survive every format: judged by the joint-space inertia of Pinocchio's and MuJoCo's own readers."""

import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
import pinocchio as pin
from by_pinocchio import configuration
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import cinegen
import raff2urdf
from raff2urdf.inertia import Inertia
from raff2urdf.raff import document as raff
from raff2urdf.raff.writer import dumps
from raff2urdf.writers.mjcf import add_inertial

Array = NDArray[np.float64]

EXACT = 1e-12  # of the largest element


@st.composite
def inertias(draw: st.DrawFn) -> Inertia:
    """A body of any shape: second moments of mass without negative eigenvalues, from a point cloud."""
    numbers = st.integers(-5000, 5000).map(lambda number: number / 1e4)
    cloud = np.array(draw(st.lists(st.tuples(numbers, numbers, numbers), min_size=4, max_size=6)))
    mass, second = draw(st.floats(0.01, 50.0)), cloud.T @ cloud / len(cloud) + 1e-4 * np.eye(3)
    return Inertia.from_second(mass, np.array(draw(st.tuples(numbers, numbers, numbers))), mass * second)


def inertial(body: Inertia) -> raff.RaffInertial:
    """The body in mm and kg mm2."""
    xx, xy, xz, yy, yz, zz = (1e6 * body.matrix[np.triu_indices(3)]).tolist()
    x, y, z = (1e3 * body.centre).tolist()
    return raff.RaffInertial(body.mass, (x, y, z), (xx, yy, zz), (xy, xz, yz))


@st.composite
def robots(draw: st.DrawFn) -> raff.Document:
    """A tree of revolute, prismatic and fixed links and frames, each with a mass. MuJoCo takes offsets below 1e-6 for
    0: lengths are whole tenths of a millimetre."""
    lengths, angles = (st.integers(-n, n).map(lambda number: number / 10.0) for n in (4000, 1700))
    written = st.builds(raff.RaffParameters, angles, lengths, lengths, angles, angles, lengths)
    parts: list[raff.RaffLink | raff.RaffFrame] = []
    for number in range(1, draw(st.integers(2, 6))):
        parameters, pred = draw(written), draw(st.integers(0, number - 1))
        mass = inertial(draw(inertias()))
        if number > 1 and draw(st.integers(0, 3)) == 0:
            parts.append(raff.RaffFrame(number, parameters, pred, inertial=mass))
        else:
            kind = raff.JointType.REVOLUTE if number == 1 else draw(st.sampled_from(raff.JointType))
            parts.append(raff.RaffLink(number, parameters, kind, pred, inertial=mass))
    base = raff.RaffBase(inertial=inertial(draw(inertias())))
    return raff.Document("Random", (raff.RaffRobot("robot", base, tuple(parts)),))


def crba(model: pin.Model, q: Array) -> Array:
    upper = np.triu(pin.crba(model, model.createData(), q))
    return np.asarray(upper + np.triu(upper, 1).T)


def assert_near(computed: Array, expected: Array, exact: float = EXACT) -> None:
    np.testing.assert_allclose(computed, expected, atol=exact * np.abs(expected).max(), rtol=0.0)


def of_mujoco(path: Path, mechanism: cinegen.Mechanism, values: dict[str, float]) -> tuple[Array, Array]:
    """MuJoCo's joint-space inertia in the mechanism's order, at joint values, and its bodies' total mass."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    order = [mechanism.v_index(model.joint(j).name) for j in range(model.njnt)]
    for name, value in values.items():
        data.joint(name).qpos[0] = value
    mujoco.mj_forward(model, data)
    dense = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, dense)
    ordered = np.zeros_like(dense)
    ordered[np.ix_(order, order)] = dense
    return ordered, np.asarray(model.body_mass)


@given(robots(), st.integers(0, 2**32 - 1))
@settings(max_examples=32)
def test_a_tree_has_the_same_inertia_in_every_format(document: raff.Document, seed: int) -> None:
    with TemporaryDirectory() as name, warnings.catch_warnings(action="error"):
        folder = Path(name)
        raff = folder / "random.raff"
        raff.write_text(dumps(document))
        mechanism = cinegen.load(raff)
        q = mechanism.q_home + np.random.default_rng(seed).normal(size=mechanism.model.nq)
        values = {joint: float(q[mechanism.q_index(joint)]) for joint in mechanism.joints}
        expected = crba(mechanism.model, q)
        paths = {f: raff2urdf.convert(raff, folder / "out", format=f)[0].file for f in ("urdf", "sdf", "mjcf")}

        # Pinocchio's own reader of the URDF, with fixed joints merged as it merges them
        model = pin.buildModelFromUrdf(str(paths["urdf"]))
        assert_near(crba(model, configuration(model, values)), expected)

        dense, masses = of_mujoco(paths["mjcf"], mechanism, values)
        assert_near(dense, expected)
        nodes = document.robots[0].nodes.values()
        stated = [node.inertial.mass for node in nodes if node.inertial is not None]
        np.testing.assert_array_equal(np.sort(masses[masses > 0.0]), np.sort(np.array(stated, dtype=float)))

        raff2urdf.to_raff(paths["urdf"], folder / "back.raff", graphics=False)
        back = cinegen.load(folder / "back.raff")
        for other in (cinegen.load(paths["sdf"]), cinegen.load(paths["mjcf"])):
            assert other.massless == ()
            shifted = other.configuration(values)
            order = [other.v_index(joint) for joint in mechanism.joints]
            mine = [mechanism.v_index(joint) for joint in mechanism.joints]
            assert_near(crba(other.model, shifted)[np.ix_(order, order)], expected[np.ix_(mine, mine)], 1e-11)
        assert back.massless == ()
        masses = np.array([inertia.mass for inertia in back.model.inertias])
        total = [inertia.mass for inertia in mechanism.model.inertias]
        np.testing.assert_allclose(np.sort(masses), np.sort(total), rtol=1e-13, atol=1e-15)


@given(inertias(), inertias())
@settings(max_examples=40)
def test_sums_of_bodies_are_pinocchios(body: Inertia, other: Inertia) -> None:
    both = pin.Inertia(body.mass, body.centre, body.matrix) + pin.Inertia(other.mass, other.centre, other.matrix)
    total = body + other
    assert total.mass == both.mass
    assert_near(total.centre, both.lever)
    assert_near(total.matrix, both.inertia)
    assert total.why_unphysical() is None
    assert_near(Inertia.from_second(body.mass, body.centre, body.second).matrix, body.matrix)


@given(st.integers(0, 2**32 - 1), st.floats(0.1, 10.0), st.floats(0.1, 10.0))
@settings(max_examples=200)
def test_mujoco_accepts_plates_in_any_orientation(seed: int, moment: float, other: float) -> None:
    """Without a margin it refuses a third of them: rounding violates the triangle inequality of their moments."""
    rotation = Rotation.random(random_state=seed).as_matrix()
    plate = Inertia(1.0, np.zeros(3), rotation @ np.diag([moment, other, moment + other]) @ rotation.T)
    root = etree.fromstring("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>")
    add_inertial(root[0][0], plate)
    model = mujoco.MjModel.from_xml_string(etree.tostring(root, encoding="unicode"))
    np.testing.assert_allclose(np.sort(model.body_inertia[1]), np.sort([moment, other, moment + other]), rtol=1e-10)


def test_simulators_get_estimates_only_of_what_is_not_stated(tmp_path: Path) -> None:
    path = tmp_path / "half.raff"
    path.write_text(
        "RAFF half\nrobot r {\n  base { filename { } }\n"
        "  link 1 { type 2 pred 0 inertial { mass 2 moments { 9 9 9 } } }\n"
        "  frame 2 { pred 1 parameters { d 100 } }\n  link 3 { type 2 pred 2 }\n}\n"
    )
    for format in ("sdf", "mjcf"):
        text = raff2urdf.convert(path, tmp_path, format=format)[0].file.read_text()
        assert "Masses are the robot's own, but those of link3 are estimated from the graphics, as solid" in text
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "half.xml"))
    assert (model.body("link1").mass, model.body("frame2").mass) == (2.0, 0.0)
    assert model.body("link3").mass > 0.0
