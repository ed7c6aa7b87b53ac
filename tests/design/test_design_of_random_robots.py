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

RSSR = """RAFF Rssr
units mm
robot rssr {
  link 1 { parameters { theta 70 alpha 10 epsilon 20 } type 2 pred 0 actuated 1 }
  link 2 { parameters { gamma 5 theta -40 alpha 15 d 120 epsilon 10 r 30 } joint ball pred 1 }
  frame 4 { parameters { d 360 r 20 theta 12 } pred 2 }
  link 3 { parameters { theta 89 d 400 alpha 20 r 60 } type 2 pred 0 }
  frame 5 { parameters { d 240 alpha 30 } pred 3 }
  constraint { frame 4 frame 5 type 3 }
}
"""


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


def test_a_linkage_with_a_ball_joint(tmp_path):
    (tmp_path / "rssr.raff").write_text(RSSR)
    parameters = Parameters(tmp_path / "rssr.raff")
    design, mechanism = Design(parameters), parameters.mechanism
    assert mechanism.balls == ("joint2",)
    here, end = design.evaluate(), pin.SE3(mechanism.placement(mechanism.q_home, "frame5"))
    assert here.opening == ()
    for k, name in enumerate(design.names):
        step, poses = 1e-4, []
        for sign in (1.0, -1.0):
            changed = parameters.mechanism_with(parameters.values + sign * step * np.eye(len(design.names))[k])
            q = changed.close(mechanism.q_home, mechanism.actuated)
            there = design.evaluate(parameters.values + sign * step * np.eye(len(design.names))[k])
            np.testing.assert_allclose(
                there.placements("frame5")[0], changed.placement(q, "frame5").homogeneous, atol=1e-10, err_msg=name
            )
            poses.append(pin.log6(end.actInv(changed.placement(q, "frame5"))).vector)
        numeric = (poses[0] - poses[1]) / (2.0 * step)
        np.testing.assert_allclose(here.pose_derivative("frame5")[0, :, k], numeric, atol=1e-6, err_msg=name)
