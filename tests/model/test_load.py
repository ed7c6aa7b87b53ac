"""Loading: RAFF and its conversion are one mechanism; what can't be one is refused, with the way out."""

import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from small_robots import four_bar
from urdf_text import joint_at, joint_text, limit, links, robot

import cinegen
from cinegen.errors import CinegenWarning, LoadError, UnknownNameError
from raff2urdf import RaffError
from raff2urdf.coupling import Coupling
from raff2urdf.shipped import reference_robots


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("limit", ["", '<limit effort="1" velocity="3"/>'])
def test_a_joint_whose_limits_are_left_out_has_none_and_one_warning_says_so(kind, limit):
    text = URDF.replace('<limit lower="-1" upper="2" velocity="3" effort="4"/>', limit).replace("revolute", kind)
    with pytest.warns(cinegen.CinegenWarning, match="'j': no lower and upper limit") as seen:
        mechanism = cinegen.load(text)
    assert len(seen) == 1
    assert mechanism.model.lowerPositionLimit[0] == -np.inf
    assert mechanism.model.upperPositionLimit[0] == np.inf
    assert mechanism.is_prismatic("j") == (kind == "prismatic")


def test_a_warning_of_a_home_outside_the_limits_is_of_the_line_that_loads(tmp_path):
    path = tmp_path / "stuck.raff"
    held = "limits { 170 171 }", "", "limits { 94 96 }"  # while the other one stays
    path.write_text(four_bar((70, -60, 95), (100, 200, 250, 180), words=held))
    with pytest.warns(cinegen.CinegenWarning, match="home is outside those of joint1") as caught:
        cinegen.load(path)
    assert {warning.filename for warning in caught} == {__file__}


def test_a_base_that_a_sensor_may_move_is_free_and_adds_six(raff):
    text = """
      sensor 1 { port "/dev/null" translation 3 rotation 3 }
      robot r { base { parameters { d 100 alpha 90 } } link 1 { type 2 pred 0 }
        frame 2 { parameters { d 50 } pred 1 name "tool" }
        constraint { base sensor ( 0 1 ) } }"""
    mechanism = raff(text)
    assert mechanism.floating
    assert mechanism.mobility == 7
    assert (mechanism.model.nq, mechanism.model.nv) == (8, 7)
    assert mechanism.joints == ("joint1",)
    home = mechanism.placement(mechanism.q_home, "base")
    assert np.allclose(home.translation, [0.1, 0.0, 0.0], atol=1e-15)
    assert np.allclose(home.rotation @ [0.0, 0.0, 1.0], [0.0, -1.0, 0.0], atol=1e-15)
    moved = pin.integrate(mechanism.model, mechanism.q_home, np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
    assert np.allclose(mechanism.placement(moved, "base").translation, [0.1, -1.0, 0.0])
    assert mechanism.sensor_constraints == (("base", (0, 1)),)


def test_what_no_motion_depends_on_may_be_wrong():
    """Pinocchio refuses a robot without a name, and a material that is said twice."""
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    shape = '<visual><geometry><sphere radius="1"/></geometry><material name="red"/></visual>'
    mass = '<inertial><mass value="1"/></inertial>'
    parts = f'{red}{red}<link name="a">{mass}</link><link name="b">{shape}</link>'
    with pytest.warns(cinegen.CinegenWarning, match="<inertial> of link 'a' has no inertia: its mass is left out"):
        mechanism = cinegen.load(f"<robot>{parts}{joint_text('j', 'a', 'b', limit(-1, 0), 'revolute')}</robot>")
    assert mechanism.name == "robot"
    (ball,) = mechanism.visual.geometryObjects
    assert ball.meshColor.tolist() == [1.0, 0.0, 0.0, 1.0]


def test_a_thousand_joints_load_without_pinocchios_tensors_of_second_derivatives():
    turns = [joint_at(f"j{i}", f"l{i - 1}", f"l{i}", "0.1 0 0") for i in range(1, 1001)]
    text = robot(links(*(f"l{i}" for i in range(1001))), *turns)
    mechanism = cinegen.load(text)
    assert mechanism.mobility == 1000
    jacobian = mechanism.jacobian(mechanism.q_home, "l1000")  # all joints turn about z, on a line along x
    assert jacobian[1] == pytest.approx(0.1 * np.arange(999, -1, -1), abs=1e-11)
    assert cinegen.load(text.replace("continuous", "fixed")).mobility == 0
    assert len(mechanism.visual.geometryObjects) == 1000  # a stick figure, by Jacobians


# --- load text --------------------------------------------------------------------------------------------------------
# `cinegen.load` takes the text of a RAFF file, URDF, SDF or MJCF: the mechanism is that of the file.


RAFF = four_bar((60, -60, 60), (300, 400, 400, 300)).replace("pred 2 }", 'pred 2 filename { "box.stl" } }')
URDF = """
 <robot name="arm"><link name="a"/><link name="b"><collision><geometry><mesh filename="box.stl"/></geometry>
  </collision></link><joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="2" velocity="3" effort="4"/></joint></robot>"""
SDF = """<?xml version="1.0"?><sdf version="1.9"><model name="arm"><link name="a"/><link name="b"/>
  <joint name="j" type="revolute"><parent>a</parent><child>b</child><axis><xyz>0 0 1</xyz></axis></joint>
  </model></sdf>"""
MJCF = """<mujoco model="arm"><asset><mesh name="box" file="box.stl"/></asset><worldbody><body name="a">
  <joint name="j"/><geom type="mesh" mesh="box"/></body><include file="part.xml"/></worldbody></mujoco>"""

PART = """<mujoco><body name="p"><joint name="k"/><geom size="1"/></body></mujoco>"""
TEXTS = {".raff": RAFF, ".urdf": URDF, ".sdf": SDF, ".xml": MJCF}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with a mesh and a part of an MJCF."""
    work = tmp_path / "work"
    work.mkdir()
    trimesh.creation.box((0.1, 0.2, 0.3)).export(work / "box.stl")
    (work / "part.xml").write_text(PART)
    monkeypatch.chdir(work)
    return work


@pytest.mark.parametrize("ending", TEXTS)
def test_the_mechanism_is_that_of_the_file(folder, monkeypatch, ending):
    (folder / f"arm{ending}").write_text(TEXTS[ending])
    file, text = cinegen.load(folder / f"arm{ending}"), cinegen.load(TEXTS[ending])
    monkeypatch.chdir("/")
    assert (text.name, text.nodes, text.joints, text.mobility) == (file.name, file.nodes, file.joints, file.mobility)
    np.testing.assert_array_equal(text.q_home, file.q_home)
    for body, other in zip(text.model.inertias, file.model.inertias, strict=True):
        np.testing.assert_array_equal(body.toDynamicParameters(), other.toDynamicParameters())
    if ending != ".sdf":
        boxes = [[Path(shape.meshPath).name for shape in robot.collision.geometryObjects] for robot in (text, file)]
        assert boxes[0] == boxes[1]
        assert any("box" in name for name in boxes[0])


def test_a_path_is_a_path_and_a_name_a_name(folder):
    assert cinegen.load("delta4").mobility == 3
    (folder / "arm.urdf").write_text(URDF)
    assert cinegen.load("arm.urdf").joints == ("j",)
    for wrong in (Path(URDF), Path(RAFF), "RAFF t robot r { }"):
        with pytest.raises(RaffError, match=r"can't be read|there is no such file"):
            cinegen.load(wrong)


def test_a_file_that_a_text_names_is_missing(folder):
    arm = cinegen.load(URDF.replace("box", "bax"))
    missing = f"there is no file {folder}/bax.stl: a text names files from the folder that"
    with pytest.warns(cinegen.CinegenWarning, match=missing):
        _ = arm.collision
    with pytest.raises(LoadError, match=r"<text>:2: MuJoCo can't read it: .* 'parts.xml': did you mean '.*part.xml'"):
        cinegen.load(MJCF.replace("part", "parts"))
    (folder.parent.parent / "outside.xml").write_text(PART)
    with pytest.raises(LoadError, match=r"<text>:2: the file '\.\./\.\./outside.xml' leads out"):
        cinegen.load(MJCF.replace("part", "../../outside"))


def test_a_name_that_is_not_there_is_refused_also_where_all_loops_are_left_out(root):
    with pytest.raises(RaffError, match="--ignore nope: the file declares no loop or coupling of that name"):
        cinegen.load(root / "robots/four_bar.raff", ignore_loops=True, ignore=["nope"])


# --- load pinocchio ---------------------------------------------------------------------------------------------------
# `cinegen.load` takes a `pinocchio.Model`, with loops and couplings: what moves is what Pinocchio moves.


def along_x(distance: float) -> pin.SE3:
    return pin.SE3(np.eye(3), np.array([distance, 0.0, 0.0]))


def planar(*lengths: float) -> pin.Model:
    """A chain of hinges about z in the plane."""
    model, parent, at = pin.Model(), 0, 0.0
    model.name = "chain"
    for i, length in enumerate(lengths):
        parent = model.addJoint(parent, pin.JointModelRZ(), along_x(at), f"hinge{i + 1}")
        at = length
    model.addBodyFrame("tip", parent, along_x(at), 0)
    return model


def closed(model: pin.Model, kind: pin.ContactType, length: float) -> pin.RigidConstraintModel:
    """A loop from the end of a chain to the base."""
    return pin.RigidConstraintModel(kind, model, model.njoints - 1, along_x(length), 0, along_x(1.0))


@pytest.mark.parametrize("root", [None, pin.JointModelFreeFlyer()], ids=["fixed", "floating"])
@pytest.mark.parametrize("name", ["ur5_robot", "solo12", "hyq"])
def test_frames_jacobians_and_masses_are_the_models(name, root):
    path = str(next(path for known, path in reference_robots().items() if known.startswith(name)))
    model = pin.buildModelFromUrdf(path) if root is None else pin.buildModelFromUrdf(path, root)
    mechanism = cinegen.load(model)
    assert list(mechanism.model.names) == list(model.names)
    bodies = {frame.name for frame in model.frames if frame.type == pin.FrameType.BODY} - {"universe"}
    assert bodies <= {*mechanism.nodes}
    q = pin.integrate(model, pin.neutral(model), np.random.default_rng(1).normal(size=model.nv))
    data, other = model.createData(), mechanism.model.createData()
    pin.framesForwardKinematics(model, data, q)
    pin.framesForwardKinematics(mechanism.model, other, q)
    jacobians = [pin.computeJointJacobians(*pair, q) for pair in ((model, data), (mechanism.model, other))]
    np.testing.assert_allclose(jacobians[1], jacobians[0], atol=1e-14)
    np.testing.assert_allclose(pin.crba(mechanism.model, other, q), pin.crba(model, data, q), atol=1e-13)
    for body in bodies:
        placed = data.oMf[model.getFrameId(body, pin.FrameType.BODY)]
        np.testing.assert_allclose(other.oMf[mechanism.frame_id(body)].homogeneous, placed.homogeneous, atol=1e-14)


@pytest.mark.parametrize("kind", [pin.ContactType.CONTACT_6D, pin.ContactType.CONTACT_3D])
def test_loops_are_pinocchios(kind):
    model = planar(0.4, 0.9, 0.7, 0.0) if kind == pin.ContactType.CONTACT_6D else planar(0.4, 0.9, 0.7)
    loop = closed(model, kind, 0.0 if kind == pin.ContactType.CONTACT_6D else 0.7)
    mechanism = cinegen.load(model, loops=[loop], actuated=["hinge1"])
    assert (mechanism.mobility, mechanism.actuated) == (1, ("hinge1",))
    copy, solver = pickle.loads(pickle.dumps(mechanism)), cinegen.Solver(mechanism, 0.01)
    assert np.array_equal(copy.q_home, mechanism.q_home)
    solver.add_task("hinge1_body").target *= pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.3])), np.zeros(3))
    for _ in range(50):
        step = solver.step()
    assert max(step.errors[0]) < 1e-9
    data, residual = model.createData(), loop.createData()
    pin.computeJointJacobians(model, data, step.q)
    jacobian = pin.getConstraintJacobian(model, data, loop, residual)
    assert np.linalg.matrix_rank(jacobian, 1e-9) == model.nv - 1
    first, second = data.oMi[loop.joint1_id] * loop.joint1_placement, data.oMi[loop.joint2_id] * loop.joint2_placement
    relative = first.actInv(second)
    error = pin.log6(relative).vector if kind == pin.ContactType.CONTACT_6D else relative.translation
    assert np.abs(error).max() < 1e-11


def test_couplings_are_equations_between_its_joints():
    mechanism = cinegen.load(planar(1.0, 1.0), couplings=[Coupling("gear", {"hinge2": (1.0,), "hinge1": (2.0,)})])
    assert mechanism.mobility == 1
    q = mechanism.close(np.array([0.3, 0.0]))
    assert q[1] == pytest.approx(-2.0 * q[0], abs=1e-12)


def test_joints_in_another_order_are_announced():
    model = pin.Model()
    for name in ("b", "a"):
        model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), name)
    with pytest.warns(CinegenWarning, match="mechanism.q_index finds each"):
        mechanism = cinegen.load(model)
    assert (mechanism.q_index("a"), mechanism.q_index("b")) == (0, 1)


def test_limits_of_one_side_frames_and_ball_joints_are_taken():
    model = planar(1.0, 1.0)
    model.addFrame(pin.Frame("camera", 1, 0, along_x(0.5), pin.FrameType.OP_FRAME))
    lower, upper = np.full(2, -np.inf), np.array([2.0, np.inf])
    lower[1] = -1.0
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    mechanism = cinegen.load(model)
    assert (mechanism.limits["hinge1"].upper, mechanism.limits["hinge2"].lower) == (2.0, -1.0)
    assert min(-mechanism.limits["hinge1"].lower, mechanism.limits["hinge2"].upper) >= 1e9
    assert mechanism.placement(mechanism.q_home, "camera").translation == pytest.approx([0.5, 0.0, 0.0])
    model = planar(0.4, 0.9)
    model.addJoint(2, pin.JointModelSpherical(), along_x(0.7), "ball")
    loop = closed(model, pin.ContactType.CONTACT_6D, 0.0)
    mechanism = cinegen.load(model, loops=[loop], actuated=[])
    assert (mechanism.balls, mechanism.mobility) == (("ball",), 0)


def test_names_that_the_model_lacks_are_errors():
    gear = Coupling("c", {"hinge9": (1.0,)})
    for options in ({"actuated": ["hinge9"]}, {"couplings": [gear]}):
        with pytest.raises(UnknownNameError, match="hinge9"):
            cinegen.load(planar(1.0), **options)
    with pytest.raises(UnknownNameError, match="hinge9"):
        cinegen.load("five_bar", actuated=["hinge9"])


@pytest.mark.parametrize("closes", [False, True])
def test_torques_have_the_models_gravity_friction_and_armature(closes):
    model, rng = planar(0.4, 0.9, 0.7), np.random.default_rng(4)
    for j in range(1, model.njoints):
        model.inertias[j] = pin.Inertia.FromSphere(*rng.uniform(0.1, 1.0, 2))
    model.gravity.linear = np.array([1.0, -3.0, 0.5])
    model.armature, model.damping, dry = rng.uniform(0.1, 1.0, (3, model.nv))
    model.upperDryFrictionLimit, model.lowerDryFrictionLimit = dry, -dry
    loops = [closed(model, pin.ContactType.CONTACT_3D, 0.7)] if closes else []
    mechanism = cinegen.load(model, loops=loops)
    assert mechanism.gravity.tolist() == [1.0, -3.0, 0.5]
    again = pickle.loads(pickle.dumps(mechanism))
    for made in (mechanism.model, again.model):
        for field in ("armature", "damping", "upperDryFrictionLimit", "lowerDryFrictionLimit"):
            assert getattr(made, field).tolist() == getattr(model, field).tolist()
    if not closes:
        q, v, a = rng.normal(size=(3, model.nv))
        expected = pin.rnea(model, model.createData(), q, v, a) + model.damping * v + dry * np.sign(v)
        assert cinegen.InverseDynamics(mechanism).torques(q, v, a) == pytest.approx(expected)


def test_home_of_a_tree_with_armatures_is_that_of_one_without():
    model = planar(0.4, 0.9)
    model.lowerPositionLimit, model.upperPositionLimit = np.array([1.0, -1.0]), np.array([2.0, 1.0])
    before = cinegen.load(model).q_home
    model.armature = np.array([0.0, 0.3])
    assert cinegen.load(model).q_home.tolist() == before.tolist() == [1.5, 0.0]


def test_friction_of_a_ball_and_of_a_floating_base_is_told():
    model = pin.Model()
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root_joint")
    ball = model.addJoint(base, pin.JointModelSpherical(), along_x(1.0), "ball")
    model.addJoint(ball, pin.JointModelRZ(), along_x(1.0), "hinge")
    model.damping, model.armature = np.ones(model.nv), np.eye(model.nv)[7] + np.eye(model.nv)[-1]
    mechanism = cinegen.load(model)
    assert mechanism.source.notes == ("forces leave out the damping of root_joint, ball, the armature of ball",)
    column = mechanism.v_index("hinge")
    assert (mechanism.model.damping[column], mechanism.model.armature[column]) == (1.0, 1.0)
