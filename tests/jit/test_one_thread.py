"""Objects with memory of kernels in several threads: the second is refused, the first goes on as if it were alone."""

import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from elementary import ROBOTS

from cinegen import CinegenError, ForwardKinematics
from cinegen.collision.clearance import Clearance, links_of
from cinegen.design import Design, Parameters
from cinegen.dynamics import InverseDynamics
from cinegen.dynamics.forces import forces_at
from cinegen.ik.batch import BatchEvaluator
from cinegen.ik.local_ik import LocalIK


def _moved(mechanism):
    return {name: float(mechanism.q_home[mechanism.q_index(name)]) + 0.02 for name in mechanism.actuated}


def _home(mechanism, count=1):
    return np.tile(mechanism.q_home, (count, 1))


def _clearance(mechanism):
    bodies, pairs = links_of(mechanism)
    return Clearance(mechanism, bodies, (), pairs)


# name: how it is made, the kernel that it calls, a call that enters the kernel, other calls that use the same memory
OWNERS = {
    "forward": (
        lambda mechanism: ForwardKinematics(mechanism), "_follow_goal",
        lambda fk: fk.move(_moved(fk.mechanism)),
        lambda fk: setattr(fk, "q", fk.mechanism.q_home),
    ),
    "inverse kinematics": (
        lambda mechanism: LocalIK(mechanism), "_solve",
        lambda local: local.solve(local.mechanism.q_home, 1e-10) and local.best,
    ),
    "batch": (
        lambda mechanism: BatchEvaluator(mechanism, mechanism.end), "_measure",
        lambda batch: batch.at(_home(batch.mechanism, 3)).singular_values,
        lambda batch: batch.follow(np.array([list(_moved(batch.mechanism).values())] * 5)),
    ),
    "design": (
        lambda _: Design(Parameters(ROBOTS / "delta4.raff")), "_run",
        lambda design: design.evaluate(q=_home(design.mechanism, 3)).poses,
        lambda design: design.close(design.values),
    ),
    "dynamics": (
        lambda mechanism: InverseDynamics(mechanism, gravity=(0.0, 0.0, -9.81), massless=True), "_find",
        lambda dynamics: dynamics.torques(dynamics.mechanism.q_home),
        lambda dynamics: dynamics.set_loads(),
        lambda dynamics: dynamics.torques_of(_home(dynamics.mechanism, 4)),
        lambda dynamics: dynamics.mass_matrix(dynamics.mechanism.q_home),
        lambda dynamics: forces_at(dynamics, dynamics.mechanism.q_home),
    ),
    "clearance": (
        _clearance, "_approach",
        lambda clearance: clearance.near(clearance.mechanism.q_home, 1.0).rows.copy(),
        lambda clearance: clearance.least(clearance.mechanism.q_home),
        lambda clearance: clearance.nearer(clearance.mechanism.q_home, 0.01),
    ),
}  # fmt: skip


@pytest.mark.parametrize("owner", OWNERS)
def test_a_second_thread_gets_an_error_and_leaves_the_first_unharmed(robot, owner):
    make, kernel, enter, *others = OWNERS[owner]
    used, another, alone = (make(robot("delta4")) for _ in range(3))
    expected = enter(alone)
    run, inside, go = getattr(used, kernel), threading.Event(), threading.Event()

    def wait_inside(*arguments):
        inside.set()
        assert go.wait(60)
        return run(*arguments)

    setattr(used, kernel, wait_inside)
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(enter, used)
        try:
            assert inside.wait(60)
            for use in (enter, *others):
                with pytest.raises(CinegenError, match=f"this {type(used).__name__} is in use: .* one thread at"):
                    use(used)
            np.testing.assert_array_equal(enter(another), expected)  # as the message proposes
        finally:
            go.set()
        np.testing.assert_array_equal(first.result(60), expected)
    enter(used)  # one after the other, in another thread, is no error


def test_the_error_tells_how_to_make_another(robot):
    used = ForwardKinematics(robot("delta4"))
    used._user = threading.get_ident() + 1
    with pytest.raises(CinegenError, match=r"give each thread its own, ForwardKinematics\(mechanism\), or use a lock"):
        used.move({})
