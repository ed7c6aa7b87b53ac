"""`cinegen.load` takes a `pinocchio.Model`, with loops and couplings: what moves is what Pinocchio moves."""

import pickle

import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen.errors import CinegenWarning, UnknownNameError
from raff2urdf.coupling import Coupling
from raff2urdf.shipped import reference_robots


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
    one, other = model.createData(), mechanism.model.createData()
    pin.framesForwardKinematics(model, one, q)
    pin.framesForwardKinematics(mechanism.model, other, q)
    jacobians = [pin.computeJointJacobians(*pair, q) for pair in ((model, one), (mechanism.model, other))]
    np.testing.assert_allclose(jacobians[1], jacobians[0], atol=1e-14)
    np.testing.assert_allclose(pin.crba(mechanism.model, other, q), pin.crba(model, one, q), atol=1e-13)
    for body in bodies:
        there = one.oMf[model.getFrameId(body, pin.FrameType.BODY)]
        np.testing.assert_allclose(other.oMf[mechanism.frame_id(body)].homogeneous, there.homogeneous, atol=1e-14)


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


def test_the_actuated_joints_of_a_file_are_replaced(tmp_path):
    for robot in ("five_bar", "delta4"):
        mechanism = cinegen.load(f"robots/{robot}.raff")
        passive = [joint for joint in mechanism.joints if joint not in mechanism.actuated]
        chosen = [passive[0], *mechanism.actuated[1:]]
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(tmp_path)
            assert {*cinegen.load(robot, actuated=chosen).actuated} == {*chosen}


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
    model, gear = planar(1.0), Coupling("c", {"hinge9": (1.0,)})
    for word, call in (
        ("hinge9", lambda: cinegen.load(model, actuated=["hinge9"])),
        ("hinge9", lambda: cinegen.load(model, couplings=[gear])),
        ("joint99", lambda: cinegen.load("five_bar", actuated=["joint99"])),
    ):
        with pytest.raises(UnknownNameError, match=word):
            call()


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
