"""One meaning for each tolerance: what one part of the package returns as closed, every other part accepts."""

import json

import numpy as np
import pytest

import cinegen
from cinegen.devices.lines import start_from
from cinegen.mission.branch import Branch
from cinegen.model import ForwardKinematics
from cinegen.planning.clear_motion import _is_valid
from cinegen.session.motion import LineMotion
from cinegen.tolerances import CLOSED, CLOSURE

CLOSED_ROBOTS = ("delta4", "five_bar", "gough")


def barely_closed(mechanism: cinegen.Mechanism) -> np.ndarray:
    """As open as a solver may leave its loops: just below `CLOSURE`, and above `CLOSED`."""
    q = mechanism.random_closed(1, seed=3)[0]
    _, sigma, vt = np.linalg.svd(mechanism.structure.system.evaluate(q)[1])
    step = 0.5 * CLOSURE * vt[0] * mechanism.scale / sigma[0]
    while mechanism.closure(mechanism.integrate(q, step)) < 0.8 * CLOSURE:
        step *= 1.1
    return mechanism.integrate(q, step)


@pytest.mark.parametrize("name", CLOSED_ROBOTS)
def test_a_configuration_as_open_as_the_solver_may_leave_it_is_accepted_everywhere(robot, name):
    mechanism = robot(name)
    q = barely_closed(mechanism)
    assert CLOSED < mechanism.closure(q) <= CLOSURE
    motion = ForwardKinematics(mechanism, q)
    joint = mechanism.actuated[0]
    assert mechanism.closure(motion.move({joint: q[mechanism.q_index(joint)]})) <= CLOSED
    assert mechanism.closure(cinegen.Solver(mechanism, 0.01, q=q).step().q) <= CLOSURE
    cinegen.singularity(mechanism, q)
    LineMotion(mechanism, mechanism.q_home, q, mechanism.end, 0.01)
    Branch(mechanism).closed(q)
    values = {name: float(q[mechanism.q_index(name)]) for name in mechanism.joints}
    start_from(mechanism, json.dumps(values))
    limits = mechanism.limits
    assert _is_valid(mechanism, np.clip(q, limits.lower, limits.upper)) == limits.within(q)
