"""Kernels as Python functions: the same numbers as machine code, on every robot."""

import importlib
import math
import sys

import numpy as np
import pinocchio as pin
import pytest
from variants import FEWER

from cinegen.ik import LimitMargin, Solver
from cinegen.ik._kernels.tick import tick
from cinegen.jit.interpreted import interpreted
from cinegen.loops._kernels.closure import close_from_trial

pytestmark = pytest.mark.filterwarnings("ignore::cinegen.CinegenWarning")


def in_python(solver: Solver) -> Solver:
    """Let a solver compute in Python."""
    python = interpreted(tick)

    def call(handle: int) -> int:
        assert handle == solver._memory.handle
        with np.errstate(all="ignore"):
            return python(solver._memory)

    solver._tick = call
    return solver


def drive(solver: Solver, ticks: int = 40, size: float = 0.2) -> np.ndarray:
    """Configurations on a large motion of the end, which also meets limits and singularities."""
    task = solver.add_task(solver.mechanism.end)
    home, length = task.target.copy(), solver.mechanism.length
    records = []
    for k in range(ticks):
        shift = size * length * np.array([math.sin(0.1 * k), math.cos(0.07 * k) - 1.0, math.sin(0.15 * k)])
        task.target = home * pin.SE3(pin.exp3(0.3 * np.array([math.sin(0.05 * k), 0.0, 0.02 * k])), shift)
        step = solver.step()
        records.append([*step.q, *step.v, list(type(step.status)).index(step.status), step.closure])
    return np.array(records)


@pytest.mark.parametrize("name", sorted(FEWER))
def test_a_tick_in_python_computes_what_machine_code_does(robot, name):
    mechanism = robot(name)
    compiled = drive(Solver(mechanism, dt=1 / 60))
    python = drive(in_python(Solver(mechanism, dt=1 / 60)))
    assert np.ptp(compiled, axis=0).max() > 0.01
    np.testing.assert_allclose(python, compiled, rtol=0.0, atol=1e-10)


def test_limits_objectives_and_accelerations_are_the_same_in_python(robot):
    arm7 = robot("arm7")

    def solver() -> Solver:
        made = Solver(arm7, dt=1 / 60, acceleration=2.0)
        made.objectives = (LimitMargin(),)
        return made

    np.testing.assert_allclose(drive(in_python(solver())), drive(solver()), rtol=0.0, atol=1e-9)


def test_loops_are_closed_in_python_as_in_machine_code(robot):
    mechanism = robot("gough")
    rng = np.random.default_rng(3)
    close = interpreted(close_from_trial)
    for _ in range(5):
        q = mechanism.q_home + 0.1 * rng.normal(size=mechanism.model.nq)
        expected = mechanism.close(q)
        closer = mechanism.structure.closer
        closer._close = lambda handle, closer=closer: close(closer._memory)
        closed = mechanism.close(q)
        del mechanism.structure._scratch.closer
        np.testing.assert_allclose(closed, expected, atol=1e-11)


def test_division_by_zero_and_roots_of_negative_numbers_do_not_raise_in_python(tmp_path, monkeypatch):
    (tmp_path / "odd_kernels.py").write_text(
        "import math\n"
        "from cinegen.jit.compiled import compiled\n"
        "@compiled\n"
        "def divide(x, y):\n"
        "    return 1.0 / (float(x) - y)\n"
        "@compiled\n"
        "def root(x):\n"
        "    return 2.0 * math.sqrt(x)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    odd_kernels = importlib.import_module("odd_kernels")

    with np.errstate(all="ignore"):
        assert interpreted(odd_kernels.divide)(1.0, 1.0) == math.inf == odd_kernels.divide(1.0, 1.0)
        assert math.isnan(interpreted(odd_kernels.root)(-1.0))
    del sys.modules["odd_kernels"]
