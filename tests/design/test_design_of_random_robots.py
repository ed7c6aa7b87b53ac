"""Parameters of random trees with joints of all kinds, and of linkages with ball joints, against edited documents."""

import numpy as np
import pinocchio as pin
from hypothesis import given, settings
from hypothesis import strategies as st

from cinegen.design import Design, Parameters
from raff2urdf.raff.compound import VARIABLES
from raff2urdf.raff.document import (
    CompoundKind,
    Document,
    JointType,
    RaffBase,
    RaffFrame,
    RaffLink,
    RaffParameters,
    RaffRobot,
    RaffVariable,
)


def random_robot(rng: np.random.Generator, size: int) -> Document:
    """Return a document of a tree whose links have joints of all kinds."""

    def written() -> RaffParameters:
        numbers = rng.uniform(-1.0, 1.0, 6) * rng.integers(0, 2, 6)
        theta, alpha, gamma = (150.0 * numbers[:3]).tolist()
        r, d, epsilon = (400.0 * numbers[3:]).tolist()
        return RaffParameters(theta, r, d, alpha, gamma, epsilon)

    parts: list[RaffLink | RaffFrame] = []
    for number in range(1, size + 1):
        pred, kind = int(rng.integers(0, number)), rng.integers(0, 5)
        if kind == 0:
            parts.append(RaffFrame(number, written(), pred))
        elif kind < 3:
            parts.append(RaffLink(number, written(), JointType(int(rng.integers(0, 3))), pred))
        else:
            compound = list(CompoundKind)[rng.integers(0, 4)]
            variables = tuple(
                RaffVariable(name, float(rng.uniform(-40.0, 40.0)))
                for name, own in VARIABLES[compound].items()
                if own is None
            )
            parts.append(RaffLink(number, written(), JointType.FIXED, pred, compound=compound, variables=variables))
    return Document("random", (RaffRobot("random", RaffBase(written()), tuple(parts)),))


@settings(max_examples=60)
@given(st.integers(0, 10**6), st.integers(1, 6))
def test_random_trees(seed: int, size: int):
    rng = np.random.default_rng(seed)
    parameters = Parameters(random_robot(rng, size))
    design, mechanism = Design(parameters), parameters.mechanism
    q = mechanism.structure.system.integrate(mechanism.q_home, rng.normal(size=mechanism.model.nv))
    p = parameters.values + rng.uniform(-0.3, 0.3, len(parameters))
    here, changed = design.evaluate(p, q), parameters.mechanism_with(p)
    for node in mechanism.nodes:
        np.testing.assert_allclose(here.placements(node)[0], changed.placement(q, node).homogeneous, atol=1e-12)
    k, node, step = int(rng.integers(len(p))), mechanism.nodes[int(rng.integers(len(mechanism.nodes)))], 1e-4
    ahead, behind = (design.evaluate(p + sign * step * np.eye(len(p))[k], q) for sign in (1.0, -1.0))
    seen = pin.SE3(here.placements(node)[0])
    moved = [pin.log6(seen.actInv(pin.SE3(one.placements(node)[0]))).vector for one in (ahead, behind)]
    np.testing.assert_allclose(here.pose_derivative(node)[0, :, k], (moved[0] - moved[1]) / (2.0 * step), atol=1e-7)
    by_p = (ahead.amplification(node)[0] - behind.amplification(node)[0]) / (2.0 * step)
    np.testing.assert_allclose(here.amplification_derivative(node)[0, ..., k], by_p, atol=1e-6)


@settings(max_examples=40)
@given(st.integers(0, 10**6))
def test_own_variables_are_offsets_of_encoders(seed: int):
    """A joint whose encoder is off by some value is where it would be with that much more in its reading."""
    rng = np.random.default_rng(seed)
    document = random_robot(rng, 5)
    own = [one for one in Parameters(document).all if one.joint]
    if not own:
        return
    one = own[int(rng.integers(len(own)))]
    parameters = Parameters(document, one.name)
    design, mechanism = Design(parameters), parameters.mechanism
    q = mechanism.q_home.copy()
    q[mechanism.q_index(one.joint)] += 0.1
    off = design.evaluate(parameters.values + 0.1)
    for node in mechanism.nodes:
        np.testing.assert_allclose(off.placements(node)[0], mechanism.placement(q, node).homogeneous, atol=1e-12)
    node = mechanism.end
    np.testing.assert_allclose(
        design.evaluate().pose_derivative(node)[0, :, 0],
        mechanism.jacobian(mechanism.q_home, node)[:, mechanism.v_index(one.joint)],
        atol=1e-12,
    )
