"""RAFF -> URDF in every dialect of loops -> `cinegen.load`: the same mechanism, bit for bit, wherever the URDF is."""

import re
import shutil
import warnings
from contextlib import nullcontext
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from coupled_robots import CLOSED_TEXTS, random_text, seeds
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

import cinegen
import raff2urdf
from raff2urdf.conversion import convert
from raff2urdf.writers import DIALECTS

ROBOTS = Path(__file__).resolve().parents[2] / "robots"
FEW = ("delta4:r1", "two_arms:right")


@pytest.fixture(params=[*FEW, *CLOSED_TEXTS], scope="module")
def original(request, tmp_path_factory):
    """The RAFF file, and the mechanism of one of its robots."""
    if request.param in CLOSED_TEXTS:
        path = tmp_path_factory.mktemp("raff") / f"{request.param}.raff"
        path.write_text(CLOSED_TEXTS[request.param])
        return path, cinegen.load(path)
    stem, _, name = request.param.partition(":")
    return ROBOTS / f"{stem}.raff", cinegen.load(ROBOTS / f"{stem}.raff", name)


def converted(path, robot, out, dialect):
    """The URDF of a robot, and the loops and couplings for which the dialect has no notation."""
    with warnings.catch_warnings(record=True, action="always") as seen:
        made = [result for result in convert(path, out, dialect=dialect) if result.robot == robot]
    lost = [str(warning.message) for warning in seen if "only cinegen reads them" in str(warning.message)]
    lost = [message for message in lost if f"robot '{robot}'" in message]
    return made[0].file, re.findall("(?:loop|coupling) '[^']*'", lost[0]) if lost else []


def assert_same(back, source):
    assert np.array_equal(back.q_home, source.q_home)
    assert (back.mobility, back.loop_rank) == (source.mobility, source.loop_rank)
    assert (back.joints, back.actuated, back.nodes) == (source.joints, source.actuated, source.nodes)
    loops = [[(loop.name, loop.kind, loop.first, loop.second) for loop in made.loops] for made in (back, source)]
    assert loops[0] == loops[1]
    assert list(map(str, back.couplings)) == list(map(str, source.couplings))
    assert [coupling.name for coupling in back.couplings] == [coupling.name for coupling in source.couplings]
    assert (back.sensors, back.sensor_constraints) == (source.sensors, source.sensor_constraints)
    for word in ("lowerPositionLimit", "upperPositionLimit", "upperVelocityLimit", "upperEffortLimit"):
        assert np.array_equal(getattr(back.model, word), getattr(source.model, word))


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_dialect_comes_back_bit_for_bit(original, dialect, tmp_path):
    path, source = original
    urdf, lost = converted(path, source.name, tmp_path / "made", dialect)
    assert_same(cinegen.load(urdf), source)
    if dialect != "json":
        (tmp_path / "moved").mkdir()
        assert_same(cinegen.load(shutil.copy(urdf, tmp_path / "moved")), source)
        for file in urdf.parent.glob("*.constraints.json"):
            file.unlink()
        assert_declared(urdf, source, lost)


def assert_declared(urdf, source, lost):
    """Without what is only for cinegen, home is another one, but loops and couplings are those that are not lost."""
    root = etree.fromstring(urdf.read_bytes())
    root.remove(root.find("{urn:raff2urdf}robot"))
    note = root.find("link").getprevious()
    assert "raff2urdf constraints:" in note.text
    root.remove(note)
    urdf.write_bytes(etree.tostring(root))
    if lost:
        return
    try:
        back = cinegen.load(urdf)
    except cinegen.ClosureError:
        return  # from all joints at 0
    assert back.mobility == source.mobility
    assert len(back.couplings) == len(source.couplings)
    assert back.closure(back.configuration(source.values(source.q_home))) < 1e-11


@pytest.mark.parametrize("dialect", ["json", "urdf+"])
def test_a_urdf_becomes_a_raff_of_the_same_mechanism(original, dialect, tmp_path):
    path, source = original
    urdf, _ = converted(path, source.name, tmp_path, dialect)
    made = raff2urdf.to_raff(urdf, tmp_path / "again.raff", graphics=False)
    back = cinegen.load(tmp_path / "again.raff")
    assert (back.mobility, back.actuated) == (source.mobility, source.actuated)
    assert [coupling.name for coupling in back.couplings] == [coupling.name for coupling in source.couplings]
    for q in [source.q_home, *source.random_closed(3)]:
        values = {made.joints[joint]: value for joint, value in source.values(q).items()}
        moved = {joint: value + made.offsets[joint] for joint, value in values.items()}
        assert back.closure(back.configuration(moved)) < 1e-9


@pytest.mark.parametrize("robot", ["five_bar", "scara"])
def test_other_programs_ignore_what_they_do_not_know(robot, tmp_path):
    path, whole = ROBOTS / f"{robot}.raff", None
    for dialect in DIALECTS:
        urdf, _ = converted(path, raff2urdf.load(path).robot().name, tmp_path / dialect, dialect)
        tree = pin.buildModelFromUrdf(str(urdf))
        whole = whole or tree
        assert list(tree.names) == list(whole.names)
        assert all(map(pin.SE3.isApprox, tree.jointPlacements, whole.jointPlacements))
        assert yourdfpy.URDF.load(str(urdf), load_meshes=False, build_scene_graph=False).robot.joints


@settings(max_examples=16)
@given(seeds, st.sampled_from(DIALECTS))
def test_random_couplings_come_back_in_every_dialect(tmp_path_factory, seed, dialect):
    folder = tmp_path_factory.mktemp("any")
    path = folder / "any.raff"
    path.write_text(random_text(np.random.default_rng(seed))[0])
    source = cinegen.load(path)
    urdf, _ = converted(path, "any", folder, dialect)
    if dialect != "json":
        (folder / "any.constraints.json").unlink()
    assert_same(cinegen.load(urdf), source)


@settings(max_examples=28)
@given(seeds)
def test_mujoco_finds_random_couplings_fulfilled(tmp_path_factory, seed):
    folder = tmp_path_factory.mktemp("any")
    path = folder / "any.raff"
    path.write_text(random_text(np.random.default_rng(seed))[0])
    source = cinegen.load(path)
    curved = [sum(len(c) > 1 for c in coupling.terms.values()) for coupling in source.couplings]
    if max(curved) > 1:
        with pytest.raises(raff2urdf.RaffError, match="MJCF has no notation for a coupling with curves of several"):
            convert(path, folder, format="mjcf")
        return
    with warnings.catch_warnings(action="ignore"):
        made = convert(path, folder, format="mjcf")[0].file
    model = mujoco.MjModel.from_xml_path(str(made))
    data = mujoco.MjData(model)
    ranks = []
    for q in [source.q_home, *source.random_closed(4)]:
        for joint in source.joints:
            data.joint(joint).qpos[:] = q[source.q_index(joint)]
        mujoco.mj_forward(model, data)
        rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
        assert rows.sum() == len(source.couplings)
        sizes = [max(1.0, *(abs(x) for x in row)) for row in data.efc_J.reshape(-1, model.nv)[: data.nefc][rows]]
        assert (np.abs(data.efc_pos[: data.nefc][rows]) / sizes).max() < 1e-9
        ranks.append(np.linalg.matrix_rank(data.efc_J.reshape(-1, model.nv)[: data.nefc][rows], tol=1e-9))
    assert source.mobility == model.nv - max(ranks)
    back = cinegen.load(made)
    assert (back.mobility, len(back.couplings)) == (source.mobility, len(source.couplings))


def test_each_dialect_names_what_it_lacks(tmp_path, text_file):
    path = text_file("coupled.raff", CLOSED_TEXTS["coupled"])
    expected = {
        "constraint": [],
        "urdf+": ["coupling 'cam'"],
        "closing-frames": ["coupling 'cam'"],
        "mimic": ["loop 'frame5-frame6'", "coupling 'cam'"],
        "robot.yaml": ["coupling 'cam'"],
    }
    for dialect, lost in expected.items():
        assert converted(path, "coupled", tmp_path / dialect, dialect)[1] == lost
    path = text_file("slide.raff", CLOSED_TEXTS["slide_loop"])
    for dialect in ("closing-frames", "robot.yaml", "mimic"):
        assert converted(path, "slide", tmp_path / dialect, dialect)[1] == ["loop 'frame4-frame5'"]
    for dialect in ("constraint", "urdf+"):
        assert converted(path, "slide", tmp_path / dialect, dialect)[1] == []


@pytest.mark.parametrize("dialect", ["constraint", "urdf+", "closing-frames"])
def test_an_edited_loop_contradicts_what_is_kept_for_cinegen(dialect, tmp_path):
    urdf, _ = converted(ROBOTS / "four_bar.raff", "linkage", tmp_path, dialect)
    (tmp_path / "four_bar.constraints.json").unlink()
    root = etree.fromstring(urdf.read_bytes())
    path = {
        "constraint": "constraint/parent_origin",
        "urdf+": "loop/predecessor/origin",
        "closing-frames": "joint[starts-with(@name, 'closing_')]/origin",
    }
    root.xpath(path[dialect])[0].set("xyz", "0.1 0.2 0")
    urdf.write_bytes(etree.tostring(root))
    edits_joint = dialect == "closing-frames"  # which the hash covers, as it does all joints
    warned = pytest.warns(raff2urdf.RaffWarning, match="links or joints") if edits_joint else nullcontext()
    with warned, pytest.raises(cinegen.CinegenError, match="contradicts"):
        cinegen.load(urdf)
