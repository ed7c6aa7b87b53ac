"""MJCF: MuJoCo places every node where RAFF says it is, and begins and stays with all loops closed; Pinocchio reads it
too."""

import math
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from exported import ALL, Exported, exported
from mechanisms import KNOWN

from raff2urdf import RaffWarning, convert, loads
from raff2urdf.conversion import translate
from raff2urdf.writers.mjcf import quaternion
from raff2urdf.writers.tree_at_home import TreeAtHome

EXACT = 1e-9  # m and rad
STAY = 1e-3  # of the characteristic length: how far loops may open in a simulation


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mjcf")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo writes a log where it runs."""
    monkeypatch.chdir(tmp_path)


@pytest.fixture(params=ALL)
def robot(request: pytest.FixtureRequest, folder: Path) -> Exported:
    return exported(request.param, folder)


def read(robot: Exported) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """As MuJoCo reads it, at the keyframe."""
    model = mujoco.MjModel.from_xml_path(str(robot.write("mjcf", robot.folder)))
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    mujoco.mj_forward(model, data)
    return model, data


def opening(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """The largest residual of a loop: rad or m."""
    rows = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    return float(np.abs(data.efc_pos[: data.nefc][rows]).max(initial=0.0))


def random_values(robot: Exported, seed: int) -> dict[str, float]:
    rng = np.random.default_rng(seed)
    return {name: value + rng.uniform(-2.0, 2.0) for name, value in robot.home.items()}


# --- MuJoCo ------------------------------------------------------------------------------------------------------


def test_every_node_is_where_raff_says(robot: Exported) -> None:
    """Joint values are RAFF's own: theta and r."""
    model, data = read(robot)
    for seed in range(3):
        q = random_values(robot, seed)
        for name, value in q.items():
            data.joint(name).qpos[0] = value
        mujoco.mj_kinematics(model, data)
        for node, expected in robot.placed(q).items():
            body = data.body(node)
            np.testing.assert_allclose(body.xpos, expected[:3, 3], atol=EXACT)
            np.testing.assert_allclose(body.xmat.reshape(3, 3), expected[:3, :3], atol=EXACT)


def test_it_begins_at_home_with_loops_closed_with_and_without_the_keyframe_and_has_its_limits(robot: Exported) -> None:
    model, data = read(robot)
    for name, value in robot.home.items():
        assert data.joint(name).qpos[0] == value
    assert opening(model, data) < EXACT
    mujoco.mj_resetData(model, data)
    mujoco.mj_forward(model, data)
    assert opening(model, data) < EXACT
    for entry in TreeAtHome(robot.made).entries.values():
        joint = model.joint(entry["name"])
        if entry["limits"] is None:
            assert not joint.limited[0]
        else:
            assert joint.limited[0]
            np.testing.assert_allclose(joint.range, entry["limits"], atol=1e-8)
        if entry["velocity"] is not None:
            assert model.numeric(f"velocity:{entry['name']}").data[0] == entry["velocity"]


def test_its_loops_leave_the_mobility_that_raff_counts(folder: Path) -> None:
    for name in ("delta4", "gough", "five_bar", "slider-crank, cut at the slide", "planar 3-RRR", "loose"):
        robot = exported(name, folder)
        model, data = read(robot)
        jacobian = np.zeros((data.nefc, model.nv))
        if mujoco.mj_isSparse(model):
            mujoco.mju_sparse2dense(jacobian, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
        else:
            jacobian[:] = data.efc_J[: data.nefc * model.nv].reshape(data.nefc, model.nv)
        rank = np.linalg.matrix_rank(jacobian[: data.ne], tol=1e-6)
        assert model.nv - rank == robot.made.analysis.mobility, name


def test_after_half_a_second_of_simulation_loops_are_closed(robot: Exported) -> None:
    """Under its own weight aslant, so also across the plane of planar robots; servos hold it at home."""
    model, data = read(robot)
    motors = [model.actuator(i).name for i in range(model.nu)]
    assert motors == [entry["name"] for entry in robot.made.constraints["joints"] if entry["actuated"]]
    model.opt.gravity[:] = (5.0, 5.0, -6.79)
    worst = 0.0
    for _ in range(round(0.5 / model.opt.timestep) if model.opt.timestep > 1e-4 else 2000):
        mujoco.mj_step(model, data)
        worst = max(worst, opening(model, data) / robot.length)
    assert np.isfinite(data.qpos).all()
    assert not any(warning.number for warning in data.warning)
    assert worst < STAY


def test_motors_move_it_and_loops_stay_closed(folder: Path) -> None:
    """A tenth of a radian or of its length is asked of every motor at once, and reached where it can be."""
    for name in ("delta4", "sr400", "planar_hybrid", "hybrid", "slider-crank, cut at the slide"):
        robot = exported(name, folder)
        model, data = read(robot)
        asked = data.ctrl.copy()
        asked[0] += 0.05
        worst = 0.0
        for _ in range(round(1.5 / model.opt.timestep)):
            data.ctrl += np.clip(asked - data.ctrl, -0.1 * model.opt.timestep, 0.1 * model.opt.timestep)
            mujoco.mj_step(model, data)
            worst = max(worst, opening(model, data) / robot.length)
        moved = data.joint(model.actuator(0).name).qpos[0] - robot.home[model.actuator(0).name]
        assert moved == pytest.approx(0.05, abs=0.01), name
        assert 0.0 < worst < STAY, name


def test_a_prismatic_loop_takes_its_mass_from_the_body_it_is_welded_to(folder: Path) -> None:
    """Cut at the slide, frame 5 is on the base, which cannot move; turned round, the piston is sawn in half."""
    text = KNOWN["slider-crank, cut at the slide"][0].replace("frame 4 frame 5", "frame 5 frame 4")
    document = loads(text)
    turned = Exported(document, translate(document, document.robot(), folder, folder), folder)
    model, data = read(turned)
    whole = sum(body.mass for body in turned.inertias.links.values())
    assert model.body_mass.sum() == pytest.approx(whole)
    piston = turned.inertias.links["link3"].mass
    assert model.body("link3").mass[0] == pytest.approx(piston / 2)
    assert model.body("frame5-frame4").mass[0] == pytest.approx(piston / 2)
    assert opening(model, data) < EXACT


# --- Pinocchio ---------------------------------------------------------------------------------------------------


def test_pinocchio_reads_the_same_robot(robot: Exported) -> None:
    path = robot.write("mjcf", robot.folder)
    model, points, frames = pin.buildModelAndConstraintsFromMJCF(str(path))
    kinds = [loop["kind"] for loop in robot.made.constraints["loops"]]
    assert model.njoints - 1 == len(robot.home) + kinds.count("prismatic") + bool(robot.made.constraints["floating"])
    assert len(points) == kinds.count("ball") + 2 * kinds.count("revolute")
    assert len(frames) == kinds.count("rigid") + kinds.count("prismatic")
    q = model.referenceConfigurations["home"].copy()
    for name, value in random_values(robot, 7).items():
        q[model.joints[model.getJointId(name)].idx_q] = value
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    expected = robot.placed(random_values(robot, 7))
    actual = {node: data.oMf[model.getFrameId(node, pin.FrameType.BODY)].homogeneous for node in expected}
    # Pinocchio 4.1 misplaces a floating body that is written turned: what stands on it counts.
    start = [np.linalg.inv(placed["base"]) if robot.made.robot.movable else np.eye(4) for placed in (actual, expected)]
    for node in expected:
        np.testing.assert_allclose(start[0] @ actual[node], start[1] @ expected[node], atol=EXACT)


# --- what is written ---------------------------------------------------------------------------------------------
def test_a_free_robot_falls_and_its_loops_stay_closed(folder: Path) -> None:
    robot = exported("loose", folder)
    model, data = read(robot)
    height = data.body("base").xpos[2]
    for _ in range(round(0.5 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    assert data.body("base").xpos[2] - height == pytest.approx(-0.5 * 9.81 * 0.25, rel=0.01)
    assert opening(model, data) / robot.length < STAY


@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 6, 9, 13, 19])
def test_quaternions_turn_as_their_matrices_do(seed: int) -> None:
    vector = np.random.default_rng(seed).normal(size=3)
    vector *= math.pi / np.linalg.norm(vector) * (1.0 if seed < 3 else 1e-9 if seed < 6 else 0.1 * seed / 2)
    turned = pin.exp3(vector)
    w, x, y, z = quaternion(turned)
    np.testing.assert_allclose(pin.Quaternion(w, x, y, z).toRotationMatrix(), turned, atol=1e-15)


# --- meshes ------------------------------------------------------------------------------------------------------


@pytest.fixture
def workshop(tmp_path: Path) -> Path:
    """Boxes of 100 x 50 x 20 in files of several kinds."""
    (tmp_path / "parts").mkdir()
    bar = trimesh.creation.box((100.0, 50.0, 20.0))
    for name in ("bar.stl", "bar.obj", "bar.dae"):
        bar.export(tmp_path / "parts" / name)
    bar.export(tmp_path / "parts" / "letters.stl", file_type="stl_ascii")
    triangle = trimesh.Trimesh([[0, 0, 0], [100, 0, 0], [0, 100, 0]], [[0, 1, 2]])
    triangle.export(tmp_path / "parts" / "triangle.stl")
    return tmp_path


def with_mesh(workshop: Path, *names: str) -> Path:
    files = " ".join(f'"{name}"' for name in names)
    raff = workshop / "arm.raff"
    raff.write_text(f'RAFF t\nrobot arm {{ path "parts" link 1 {{ type 2 pred 0 filename {{ {files} }} }} }}')
    (conversion,) = convert(raff, workshop / "out", format="mjcf")
    return conversion.file


@pytest.mark.parametrize("name", ["bar.stl", "letters.stl", "bar.obj", "bar.dae"])
def test_meshes_are_shown_in_their_size(workshop: Path, name: str) -> None:
    """STL in letters and DAE are none that MuJoCo reads: they are converted."""
    model = mujoco.MjModel.from_xml_path(str(with_mesh(workshop, name)))
    (geom,) = [i for i in range(model.ngeom) if model.geom_bodyid[i] == model.body("link1").id]
    vertices = model.mesh_vert[: model.mesh_vertnum[0]]
    np.testing.assert_allclose(np.sort(np.ptp(vertices, axis=0)), [0.02, 0.05, 0.1], atol=1e-6)
    assert model.body("link1").mass[0] == pytest.approx(0.1 * 0.05 * 0.02 * 1000.0, rel=1e-5)
    assert model.geom_contype[geom] == 0


def test_a_mesh_that_mujoco_cannot_have_is_left_out_with_a_warning(workshop: Path) -> None:
    with pytest.warns(RaffWarning, match=r"triangle\.stl") as caught:
        path = with_mesh(workshop, "triangle.stl", "bar.stl")
    assert len(caught) == 1
    assert mujoco.MjModel.from_xml_path(str(path)).nmesh == 1
