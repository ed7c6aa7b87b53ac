"""Kernels call Pinocchio's compiled functions: they do, what they get, and what happens where they can't."""

import ctypes
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from variants import FEWER, slow

import cinegen
from cinegen.devices import fit_path
from cinegen.errors import CinegenError, CinegenWarning
from cinegen.ik._kernels.tick import tick
from cinegen.ik.batch import BatchEvaluator
from cinegen.jit import foreign, pinocchio_calls
from cinegen.jit.interpreted import interpreted
from cinegen.jit.pinocchio_calls import Native
from cinegen.loops._kernels import kinematics
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.loops.closed_loops import ClosedLoops
from cinegen.loops.setup import set_up

ROOT = Path(__file__).resolve().parents[2]
ROBOTS = [path if path.stem in FEWER else slow(path)[0] for path in sorted((ROOT / "robots").glob("*.raff"))]
every_robot = pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
JACOBIANS = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_int64] * 3)


@pytest.fixture
def own(monkeypatch):
    """Kernels compute kinematics themselves."""
    monkeypatch.setattr(pinocchio_calls, "native", lambda: Native(reason="a test forbids it"))


@pytest.fixture
def unchecked(monkeypatch):
    """The build of Pinocchio has not been looked at."""
    monkeypatch.setattr(pinocchio_calls, "_warned", [])
    pinocchio_calls._checked.cache_clear()
    yield
    pinocchio_calls._checked.cache_clear()


def test_the_pinned_pinocchio_is_called():
    (pinned,) = re.findall(r"^pin==(\S+)", (ROOT / "requirements/core.txt").read_text(), re.MULTILINE)
    assert pin.__version__ == pinned
    assert pinocchio_calls.native().reason == ""


def driven(mechanism: cinegen.Mechanism) -> cinegen.Solver:
    solver = cinegen.Solver(mechanism, 1 / 240)
    solver.add_task(mechanism.end)
    return solver


def drive(mechanism: cinegen.Mechanism, ticks: int) -> np.ndarray:
    """Configurations on the demonstration path, which avoids singularities: these amplify rounding."""
    path, solver = fit_path(mechanism, mechanism.end), driven(mechanism)
    (task,) = solver.tasks
    trajectory = []
    for k in range(ticks):
        task.target = path.target(k / 240)
        trajectory.append(solver.step().q)
    return np.array(trajectory)


@pytest.mark.parametrize("name", ["arm7", "delta4", "gough"])
@pytest.mark.parametrize("is_compiled", [True, False])
def test_each_evaluation_of_a_tick_is_a_call_of_pinocchio(robot, name, is_compiled):
    solver = driven(robot(name))
    memory, python = solver._memory, interpreted(tick)
    if not is_compiled:
        solver._tick = lambda _handle: python(memory)
    function, calls = JACOBIANS(memory.evaluate_address), []

    def count(*words):
        calls.append(words[:2])
        return function(*words)

    counter = JACOBIANS(count)
    memory.evaluate_address = ctypes.cast(counter, ctypes.c_void_p).value
    task = solver.tasks[0]
    for _ in range(5):
        task.target = task.target * pin.SE3(np.eye(3), np.full(3, 1e-3))
        calls.clear()
        step = solver.step()
        assert len(calls) == step.evaluations >= 1
        assert set(calls) == {(memory.model_address, memory.data_address)}


@every_robot
def test_two_thousand_ticks_are_those_of_the_kernels_own_kinematics(path, monkeypatch):
    mechanism = cinegen.load(path)
    trajectory = drive(mechanism, 2000)
    monkeypatch.setattr(pinocchio_calls, "native", lambda: Native(reason="a test forbids it"))
    assert driven(mechanism)._memory.evaluate_address == 0
    differences = np.abs(drive(mechanism, 2000) - trajectory)
    assert np.ptp(trajectory, axis=0).max() > 0.01
    assert (differences / np.maximum(np.abs(trajectory), 1.0)).max() <= 1e-14


def test_threads_evaluate_batches_at_the_same_time(robot):
    mechanism = robot("delta4")
    home = mechanism.q_home[[mechanism.q_index(name) for name in mechanism.actuated]]
    values = home + 0.2 * np.sin(np.arange(300)[:, None] / np.array([20.0, 30.0, 40.0]))

    def evaluate(_: int) -> np.ndarray:
        return BatchEvaluator(mechanism, mechanism.end).follow(values).jacobians

    expected = evaluate(0)
    assert np.isfinite(expected).all()
    with ThreadPoolExecutor(4) as threads:
        for jacobians in threads.map(evaluate, range(8)):
            assert np.array_equal(jacobians, expected)


def test_who_changes_a_model_does_not_change_what_kernels_evaluate():
    model = pin.buildSampleModelManipulator()
    q = pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))
    memory = set_up(LoopMemory(), ClosedLoops(model, [], 1.0), ())
    kinematics.evaluate(memory, q)
    expected = memory.frames.copy()
    model.jointPlacements[1] = pin.SE3.Random()
    model.addJoint(1, pin.JointModelRX(), pin.SE3.Identity(), "late")  # q would be too short for it
    kinematics.evaluate(memory, q)
    assert np.array_equal(memory.frames, expected)


# --- where kernels can't call it --------------------------------------------------------------------------------------


def test_only_objects_of_a_type_have_an_address_as_such():
    model = pin.buildSampleModelManipulator()
    data = model.createData()
    assert pinocchio_calls._address_of(model, pinocchio_calls._MODEL)
    assert pinocchio_calls._address_of(data, pinocchio_calls._DATA)
    for other in (data, pin.SE3.Identity(), "model", None):
        assert pinocchio_calls._address_of(other, pinocchio_calls._MODEL) == 0
    assert pinocchio_calls._address_of(model, b"N9pinocchio7UnknownE") == 0


@pytest.mark.usefixtures("unchecked")
def test_a_build_without_a_function_warns_once_with_its_name(monkeypatch, robot):
    monkeypatch.setattr(pinocchio_calls, "_INTEGRATE", "absent")
    with pytest.warns(CinegenWarning, match="can't call this build of Pinocchio.*undefined symbol: absent"):
        solver = driven(robot("arm7"))
    driven(robot("arm7"))  # a warning would be an error
    assert solver._memory.evaluate_address == 0
    assert solver.step().evaluations > 0


@pytest.mark.usefixtures("unchecked")
@pytest.mark.filterwarnings("ignore::cinegen.CinegenWarning")
@pytest.mark.parametrize(("module", "name", "value", "reason"), [
    (pinocchio_calls, "_DATA", b"N9pinocchio8DataTplIE", "does not know"),
    (pinocchio_calls, "_DATA", pinocchio_calls._MODEL, "does not know"),
    (foreign, "numbers_at", lambda begin, shape: np.zeros(shape), "results differ"),
    (pin, "integrate", lambda model, q, step: q, "results differ"),
    (pin, "difference", lambda model, q, end: q, "results differ"),
])  # fmt: skip
def test_a_build_in_which_anything_differs_is_not_called(monkeypatch, module, name, value, reason):
    monkeypatch.setattr(module, name, value)
    native = pinocchio_calls.native()
    assert reason in native.reason
    assert native.evaluate == native.integrate == native.difference == 0


@pytest.mark.usefixtures("unchecked")
@pytest.mark.filterwarnings("ignore::cinegen.CinegenWarning")
def test_a_build_whose_placements_lie_elsewhere_is_not_called(monkeypatch):
    odd = iter(range(10**6))
    monkeypatch.setattr(foreign, "address", lambda array, of=foreign.address: of(array) + 8 * next(odd))
    assert "read in place" in pinocchio_calls.native().reason


@pytest.mark.usefixtures("own")
def test_a_joint_that_only_pinocchio_knows_is_refused_without_it():
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "first")
    model.addJoint(1, pin.JointModelPlanar(), pin.SE3.Identity(), "table")
    with pytest.raises(CinegenError, match=r"joint 'table' is of the kind Planar, which.*: a test forbids it"):
        set_up(LoopMemory(), ClosedLoops(model, [], 1.0), ())
