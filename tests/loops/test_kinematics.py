"""Frames, screws and steps of joints as Pinocchio computes them: every robot, and trees of all kinds of joints.

Kernels call Pinocchio, or compute these themselves, where it is not. Both are tested.
"""

import numpy as np
import pinocchio as pin
import pytest
from elementary import document
from quick_kernels import quick
from repository import EVERY, load
from variants import others_slow

import cinegen
from cinegen.errors import CinegenError
from cinegen.ik import Solver, Status
from cinegen.jit import pinocchio_calls
from cinegen.jit.foreign import frame_of
from cinegen.jit.pinocchio_calls import Native
from cinegen.joints import kinematic_data
from cinegen.loops._kernels import kinematics, residual
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.setup import set_up
from raff2urdf.raff.document import LoopKind

evaluate, integrate, difference, evaluate_loops = map(
    quick, (kinematics.evaluate, kinematics.integrate, kinematics.difference, residual.evaluate_loops)
)
KINDS = ("RX", "PY", "RZ", "PX", "RY", "PZ", "Spherical", "FreeFlyer", "RevoluteUnaligned", "PrismaticUnaligned")


def composite() -> pin.JointModelComposite:
    joint = pin.JointModelComposite()
    joint.addJoint(pin.JointModelRX())
    joint.addJoint(pin.JointModelPY(), pin.SE3.Random())
    return joint


OTHERS = {
    "Planar": pin.JointModelPlanar,
    "Translation": pin.JointModelTranslation,
    "SphericalZYX": pin.JointModelSphericalZYX,
    "RUBX": pin.JointModelRUBX,
    "Universal": lambda: pin.JointModelUniversal(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])),
    "HX": lambda: pin.JointModelHX(0.1),
    "HelicalUnaligned": lambda: pin.JointModelHelicalUnaligned(np.array([0.0, 0.6, 0.8]), 0.1),
    "Ellipsoid": lambda: pin.JointModelEllipsoid(0.1, 0.2, 0.3),
    "Composite": composite,
}
"""Joints that the kernels leave to Pinocchio."""


@pytest.fixture(params=["Pinocchio", "own"])
def both(request, monkeypatch):
    """Kernels call Pinocchio, or compute kinematics themselves."""
    if request.param == "own":
        monkeypatch.setattr(pinocchio_calls, "native", lambda: Native(reason="a test forbids it"))


with_both = pytest.mark.usefixtures("both")


def tree(kinds, rng) -> pin.Model:
    model = pin.Model()
    for kind in kinds:
        axis = rng.normal(size=3)
        make = getattr(pin, f"JointModel{kind}")
        joint = make(axis / np.linalg.norm(axis)) if kind.endswith("Unaligned") else make()
        placement = pin.SE3(pin.exp3(rng.normal(size=3)), 0.3 * rng.normal(size=3))
        model.addJoint(
            int(rng.integers(max(0, model.njoints - 2), model.njoints)), joint, placement, f"j{model.njoints}"
        )
    return model


def memory_of(model: pin.Model, fixed: int = 0) -> LoopMemory:
    return set_up(LoopMemory(), ClosedLoops(model, [], 1.0), (), fixed)


def check(model: pin.Model, q: np.ndarray, step: np.ndarray, fixed: int = 0) -> None:
    """Frames, screws and steps are Pinocchio's; a base of some DoF stays, and has no columns."""
    memory, data = memory_of(model, fixed), model.createData()
    pin.computeJointJacobians(model, data, q)
    evaluate(memory, q)
    assert memory.screws == pytest.approx(np.reshape(data.J, (6, -1)).T[fixed:], abs=1e-12)
    assert memory.frames == pytest.approx(np.array([frame_of(placement) for placement in data.oMi]), abs=1e-12)
    moved, back, whole = np.zeros(model.nq), np.zeros(model.nv - fixed), np.concatenate([np.zeros(fixed), step])
    integrate(memory, q, step, moved)
    assert moved == pytest.approx(pin.integrate(model, q, whole), abs=1e-12)
    assert step.any() or moved.tobytes() == q.tobytes()  # what does not move stays bit by bit
    assert fixed == 0 or moved[:7].tobytes() == q[:7].tobytes()
    difference(memory, q, moved, back)
    assert back == pytest.approx(pin.difference(model, q, moved)[fixed:], abs=1e-11)


@with_both
@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-5, 1e-2, 1.0, 3.0])
def test_trees_of_all_kinds_of_joints(size):
    rng = np.random.default_rng(1)
    for _ in range(20):
        model = tree(rng.permutation(KINDS), rng)
        check(
            model, pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)), size * rng.normal(size=model.nv)
        )


@with_both
@pytest.mark.parametrize("count", [0, 1])
def test_models_of_hardly_any_joint(count):
    model = tree(["RZ"] * count, np.random.default_rng(11))
    check(model, np.full(count, 0.3), np.full(count, 0.2))


@with_both
def test_rounding_does_not_grow_along_a_chain():
    rng = np.random.default_rng(2)
    check(tree(["RZ"] * 200, rng), rng.uniform(-3.0, 3.0, 200), rng.normal(size=200))


def test_data_of_large_models_lack_nothing_that_kinematics_needs():
    rng = np.random.default_rng(7)
    model = tree([*KINDS * 8, "Planar", "Translation", "SphericalZYX", "RUBX"], rng)
    for joint in range(1, model.njoints):
        model.addFrame(pin.Frame(f"f{joint}", joint, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    small, whole = kinematic_data(model), model.createData()
    assert len(small.oYcrb) == 0  # it is not Pinocchio's
    assert model.nv > 100
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    for data in (small, whole):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
    assert np.array_equal(small.J, whole.J)
    for frame in range(model.nframes):
        assert small.oMf[frame] == whole.oMf[frame]
        for axes in (pin.LOCAL, pin.WORLD, pin.LOCAL_WORLD_ALIGNED):
            assert np.array_equal(*(pin.getFrameJacobian(model, data, frame, axes) for data in (small, whole)))
        assert np.array_equal(*(pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL) for data in (small, whole)))
    for joint in range(1, model.njoints):
        assert small.liMi[joint] == whole.liMi[joint]
        assert np.array_equal(*(pin.getJointJacobian(model, data, joint, pin.LOCAL) for data in (small, whole)))
        assert np.array_equal(*(pin.computeJointJacobian(model, data, q, joint) for data in (small, whole)))


UNIT_VECTORS = {"Spherical": 4, "FreeFlyer": 4, "Planar": 2, "RUBX": 2, "RUBY": 2, "RUBZ": 2}
"""Numbers that are a unit vector, at the end of a joint's q."""


def check_other_lengths(kinds) -> None:
    rng = np.random.default_rng(9)
    model = tree(kinds, rng)
    q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
    memory, data, longer = memory_of(model), model.createData(), q.copy()
    pin.computeJointJacobians(model, data, q)
    for kind, joint in zip(kinds, model.joints[1:], strict=True):
        end = joint.idx_q + joint.nq
        longer[end - UNIT_VECTORS.get(kind, 0) : end] *= rng.uniform(0.5, 2.0)
    argument = longer.copy()
    evaluate(memory, argument)
    assert memory.screws == pytest.approx(data.J.T, abs=1e-12)
    assert np.array_equal(argument, longer)


@with_both
def test_unit_vectors_of_other_lengths_are_normalised():
    check_other_lengths(KINDS)


@pytest.mark.parametrize("kind", ["Planar", "RUBX", "RUBY", "RUBZ"])
def test_cosine_and_sine_of_other_lengths_are_normalised(kind):
    check_other_lengths(["RZ", kind])


@with_both
def test_a_base_that_stays_has_no_columns():
    rng = np.random.default_rng(4)
    model = tree(["FreeFlyer", "RZ", "PX", "RY"], rng)
    check(model, pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)), rng.normal(size=3), fixed=6)


def test_a_base_that_stays_before_other_joints():
    rng = np.random.default_rng(6)
    model = tree(["FreeFlyer", "RZ", "Planar"], rng)
    check(model, pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)), rng.normal(size=4), fixed=6)


def test_models_with_other_kinds_of_joints():
    rng = np.random.default_rng(5)
    for make in OTHERS.values():
        model = tree(["RZ", "FreeFlyer", "PX"], rng)
        model.addJoint(2, make(), pin.SE3.Random(), "other")
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        for size in (0.0, 0.5):
            check(model, q, size * rng.normal(size=model.nv))
    assert memory_of(tree(KINDS, rng)).others == 0


def mechanism_of(model: pin.Model, nodes: int) -> cinegen.Mechanism:
    """A serial mechanism, without limits."""
    for j in range(model.njoints):
        model.addFrame(pin.Frame(f"n{j}", j, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    model.lowerPositionLimit, model.upperPositionLimit = np.full((2, model.nq), -np.inf) * [[1.0], [-1.0]]
    model.lowerVelocityLimit, model.upperVelocityLimit = np.full((2, model.nv), -np.inf) * [[1.0], [-1.0]]
    joints = tuple(name for name, joint in zip(model.names[1:], model.joints[1:], strict=True) if joint.nq == 1)
    return cinegen.Mechanism(
        name="by hand", model=model, nodes=tuple(f"n{j}" for j in range(nodes)), joints=joints, actuated=joints,
        loops=(), length=0.5, floating=False, q_home=np.array(pin.neutral(model)), cluster_ranks=(), gap_as_written=0.0,
        sensors={}, sensor_constraints=(), source=None,
    )  # fmt: skip


@pytest.mark.parametrize("kind", OTHERS)
def test_a_solver_moves_other_kinds_of_joints(kind):
    model, rng = pin.Model(), np.random.default_rng(7)
    makes = [pin.JointModelRZ, OTHERS[kind], pin.JointModelRY, pin.JointModelRX, pin.JointModelPZ]
    for j, make in enumerate(makes):
        model.addJoint(j, make(), pin.SE3(pin.exp3(rng.normal(size=3)), 0.2 * rng.normal(size=3)), f"j{j}")
    mechanism = mechanism_of(model, 6)
    goal = pin.integrate(model, mechanism.q_home, 0.3 * rng.normal(size=model.nv))
    solver = Solver(mechanism, 0.01)
    task = solver.add_task("n5", mechanism.placement(goal, "n5"), rotation=0)
    for _ in range(60):
        step = solver.step()
    assert step.status is Status.FOLLOWING
    assert np.linalg.norm(mechanism.placement(step.q, "n5").translation - task.target.translation) <= 1e-9
    assert step.q == pytest.approx(pin.normalize(model, step.q), abs=1e-12)


def test_mimic_joints_are_refused():
    model = tree(["RZ", "RY", "RX", "RZ"], np.random.default_rng(8))
    with pytest.raises(CinegenError, match=r"joint 'j3' of by hand is a mimic joint.*independent joint"):
        mechanism_of(pin.transformJointIntoMimic(model, 1, 3, 2.0, 0.1), 4)


# --- constraint jacobians ---------------------------------------------------------------------------------------------
# Jacobians of loops that the kernels form, against Pinocchio's own constraint Jacobians: every robot, every kind.


WITH_LOOPS = [param for param in EVERY if document(param.values[0]).robot(param.values[1]).loops]

KEPT = {
    LoopKind.RIGID: [0, 1, 2, 3, 4, 5],
    LoopKind.PRISMATIC: [0, 1, 3, 4, 5],
    LoopKind.REVOLUTE: [0, 1, 2, 3, 4],
    LoopKind.BALL: [0, 1, 2],
}
"""Rows of Pinocchio's constraint of six rows, by the kind of a loop, in the axes of its first end."""


def pinocchio_rows(system: ClosedLoops, q: np.ndarray) -> list[np.ndarray]:
    """Six rows for each loop, by all joints: the twist of its first end relative to the second, in the first's axes."""
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for first, on_first, second, on_second in system.anchors:
        ends = (first, on_first, second, on_second)
        models.append(pin.RigidConstraintModel(pin.ContactType.CONTACT_6D, system.model, *ends, pin.LOCAL))
        datas.append(models[-1].createData())
    data = system.model.createData()
    pin.computeJointJacobians(system.model, data, q)
    for model, its_data in zip(models, datas, strict=True):
        model.calc(system.model, data, its_data)
    return np.split(pin.getConstraintsJacobian(system.model, data, models, datas), len(system.loops))


def check_constraints(system: ClosedLoops, ranks: tuple[int, ...], q: np.ndarray) -> None:
    memory = set_up(LoopMemory(), system, ranks)
    evaluate(memory, q)
    assert evaluate_loops(memory, True) <= 1e-11
    for i, (kind, rows) in enumerate(zip(system.kinds, pinocchio_rows(system, q), strict=True)):
        rows = -rows * system.scale / np.repeat([system.length, 1.0], 3)[:, None]  # of the second end, dimensionless
        if kind is LoopKind.BALL:  # the angular velocity is in the world's axes
            first, on_first = system.anchors[i][:2]
            system.evaluate(q)
            rows[3:] = (system.data.oMi[first] * on_first).rotation @ rows[3:]
        free = [row for row in range(6) if row not in KEPT[kind]]
        at, cut = memory.loop_row[i], memory.loop_cut[i]
        assert memory.jacobian[at : at + len(KEPT[kind])] == pytest.approx(rows[KEPT[kind]], abs=1e-13)
        assert pytest.approx(rows[free], abs=1e-13) == memory.cut_rates[:, cut : cut + len(free)].T


@pytest.mark.parametrize(("name", "which"), others_slow(WITH_LOOPS))
def test_every_robot(name, which):
    mechanism = load(name, which)
    for q in mechanism.random_closed(4, seed=1):
        check_constraints(mechanism.structure.system, mechanism.cluster_ranks, q)


@pytest.mark.parametrize("kind", LoopKind)
def test_every_kind_of_loop(robot, kind):
    """Where rigid loops are closed, those of any kind are."""
    mechanism = robot("delta4")
    system = mechanism.structure.system.with_kinds([kind] * len(mechanism.loops))
    for q in mechanism.random_closed(4, seed=1):
        check_constraints(system, mechanism.cluster_ranks, q)
