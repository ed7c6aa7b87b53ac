"""Toggles of the actuated joints: reported by the step that passes one, and not passed if the branch is kept."""

import numpy as np
import pinocchio as pin
import pytest

import cinegen
from cinegen import PersistentSolver, Solver, Status
from cinegen.ik.branch import passes_toggle

DT = 1.0 / 240.0


def side(mechanism, q):
    """On which side of the line between its elbows the tool of the five-bar linkage is, by Pinocchio's kinematics: the
    sign changes at a type 2 singularity."""
    data, model = mechanism.model.createData(), mechanism.model
    pin.forwardKinematics(model, data, q)
    passive = [model.getJointId(joint) for joint in mechanism.joints if joint not in mechanism.actuated]
    legs = [j for j in passive if model.names[model.parents[j]] in mechanism.actuated]  # at the elbows
    left, right = (data.oMi[j].translation for j in legs)
    tool = mechanism.placement(q, mechanism.end).translation
    return float(np.sign(np.cross(left - tool, right - tool)[2]))


@pytest.fixture
def five_bar(robot):
    return robot("five_bar")


def dragged_through(mechanism, solver):
    """Drag the tool through the line between the elbows to where it is in the other assembly mode."""
    goal = max(cinegen.assembly_modes(mechanism), key=lambda q: mechanism.distance(q, mechanism.q_home))
    solver.position_limits = dict.fromkeys(mechanism.joints, (-np.inf, np.inf))
    task = next(iter(solver.tasks), None) or solver.add_task(mechanism.end, rotation=0)
    start, end = (mechanism.placement(q, mechanism.end).translation for q in (mechanism.q_home, goal))
    steps = []
    for part in np.linspace(0.0, 1.0, 300):
        task.target = pin.SE3(task.target.rotation, start + part * (end - start))
        steps.append(solver.step())
    return steps


def test_the_step_that_passes_a_toggle_says_so_and_no_other(five_bar):
    solver = Solver(five_bar, DT)
    q, changed, turned = solver.q, 0, 0
    for step in dragged_through(five_bar, solver):
        passed = side(five_bar, q) != side(five_bar, step.q)
        assert step.branch_changed == passed
        changed, turned, q = changed + step.branch_changed, turned + passed, step.q
    assert changed == turned == 1


@pytest.mark.parametrize("kind", [Solver, PersistentSolver])
def test_a_branch_that_is_kept_is_not_left(five_bar, kind):
    solver = kind(five_bar, DT, keep_branch=True)
    before = side(five_bar, solver.q)
    steps = dragged_through(five_bar, solver)
    assert all(side(five_bar, step.q) == before for step in steps)
    assert not any(step.branch_changed for step in steps)
    assert any(step.status is Status.BARRED for step in steps)
    assert max(step.closure for step in steps) < 1e-10
    task = solver.tasks[0]
    task.target = five_bar.placement(five_bar.q_home, five_bar.end)
    for _ in range(600):
        step = solver.step()
    assert step.errors[0][0] < 1e-6  # it goes back
    solver.keep_branch = False
    assert any(step.branch_changed for step in dragged_through(five_bar, solver))


@pytest.mark.parametrize("name", ["gough", "sr400", "arm7", "delta4"])
def test_where_no_toggle_is_near_a_kept_branch_changes_nothing(robot, name):
    mechanism = robot(name)
    solver, other = Solver(mechanism, DT, keep_branch=True), Solver(mechanism, DT)
    for one in (solver, other):
        task = one.add_task(mechanism.end, rotation=0)
        task.target = pin.SE3(task.target.rotation, task.target.translation + 0.03 * mechanism.length)
    for _ in range(20):
        step = solver.step()
        assert (step.q == other.step().q).all()
        assert not step.branch_changed


@pytest.mark.parametrize("name", ["gough", "delta4", "five_bar", "planar_hybrid"])
def test_the_sign_is_that_of_the_determinant_where_the_jacobian_is_square(robot, name):
    """Of independent rows, which Gaussian elimination chooses at the first configuration."""
    mechanism = robot(name)
    rng, q = np.random.default_rng(4), mechanism.q_home
    columns = mechanism.structure.passive_columns
    kept = None
    for _ in range(60):
        step = rng.normal(size=mechanism.model.nv)
        jacobian = mechanism.loop_jacobian(q)
        motion = step - np.linalg.pinv(jacobian, rcond=1e-9) @ (jacobian @ step)
        there = mechanism.close(mechanism.integrate(q, 0.05 * motion / np.abs(motion).max() * mechanism.scale))
        here, after = (mechanism.loop_jacobian(x)[:, columns] for x in (q, there))
        if kept is None:
            kept = np.array(independent(here))
            assert len(kept) == len(columns)
        signs = np.linalg.slogdet(here[kept])[0] * np.linalg.slogdet(after[kept])[0]
        assert passes_toggle(mechanism, q, there) == (signs < 0.0)
        q = there


def independent(matrix):
    """Rows of a matrix that are a basis of all, by pivoting."""
    from scipy.linalg import qr

    _, r, order = qr(matrix.T, pivoting=True)
    diagonal = np.abs(np.diag(r))
    return sorted(order[: np.count_nonzero(diagonal > 1e-9 * diagonal[0])])
