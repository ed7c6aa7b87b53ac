"""Derivatives by parameters, against central differences of documents that are edited and loaded again."""

from dataclasses import replace
from functools import cache

import numpy as np
import pinocchio as pin
import pytest

from cinegen.design import Design, Parameters, holding_torques
from cinegen.dynamics import InverseDynamics, Payload
from cinegen.model import Mechanism
from cinegen.model.masses import stated

FEW = ["arm7", "delta4", "sr400", "differential_wrist"]
STEPS = np.array([1.0, -1.0, 2.0, -2.0, 3.0, -3.0])
WEIGHTS = np.array([45.0, -45.0, -9.0, 9.0, 1.0, -1.0]) / 60.0  # of a sixth-order difference
SAMPLED = 6  # parameters of each robot


@cache
def design(name: str) -> Design:
    return Design(Parameters(name))


def edited(parameters: Parameters, k: int, step: float) -> Mechanism:
    """Return the mechanism of the edited document, measured by the length of the one as written."""
    p = parameters.values.copy()
    p[k] += step
    return replace(parameters.mechanism_with(p), length=parameters.mechanism.length)


def difference(values: list[np.ndarray], step: float) -> np.ndarray:
    return np.tensordot(WEIGHTS, np.array(values), 1) / step


def jacobian_by_fixed(design: Design, mechanism: Mechanism, q: np.ndarray, node: str) -> np.ndarray:
    """Return the Jacobian of a node by the fixed joints, by the loops of a mechanism as Pinocchio places them."""
    jacobian, loops = mechanism.jacobian(q, node), mechanism.structure.system.evaluate(q)[1] / mechanism.scale
    fixed, moving = [mechanism.v_index(name) for name in design.fixed], design.moving
    follow = np.zeros((mechanism.model.nv, len(fixed)))
    if len(loops):
        scaled = loops * mechanism.scale
        follow[moving] = -np.linalg.pinv(scaled[:, moving], rcond=1e-9) @ loops[:, fixed]
        follow *= mechanism.scale[:, None]
    return jacobian[:, fixed] + jacobian @ follow


@pytest.mark.parametrize("name", FEW)
def test_edited_documents(name: str) -> None:
    one = design(name)
    parameters, mechanism = one.parameters, one.mechanism
    q = [mechanism.q_home, *mechanism.random_closed(1, 5)][-1]
    here, node, length = one.evaluate(q=q), mechanism.end, mechanism.length
    assert here.gap[0] < 1e-12
    nominal, opening = mechanism.placement(here.q[0], node), set(here.opening)
    scale = np.repeat([1.0 / length, 1.0], 3)
    amplified = here.amplification(node)[0]
    np.testing.assert_allclose(
        amplified, jacobian_by_fixed(one, mechanism, here.q[0], node), atol=1e-9 * max(1.0, length)
    )
    by_p = here.amplification_derivative(node)[0]
    chosen = np.random.default_rng(3).permutation(len(one.names))[:SAMPLED]
    for k in (k for k in chosen if one.names[k] not in opening):
        unit = length if parameters.all[parameters.find(one.names[k])].unit == "m" else 1.0
        step = 1e-3 * unit
        changed = [edited(parameters, k, s * step) for s in STEPS]
        open_poses = [pin.log6(nominal.actInv(m.placement(here.q[0], node))).vector * scale for m in changed]
        moved = here.node_parameters(node)[0, :, k] * scale
        np.testing.assert_allclose(unit * moved, unit * difference(open_poses, step), atol=1e-8)
        residuals = [m.structure.system.evaluate(here.q[0])[0] for m in changed]
        np.testing.assert_allclose(unit * here.loop_parameters[0, :, k], unit * difference(residuals, step), atol=1e-8)
        closed = [m.close(here.q[0], mechanism.actuated) for m in changed]
        poses = [
            pin.log6(nominal.actInv(m.placement(c, node))).vector * scale for m, c in zip(changed, closed, strict=True)
        ]
        moved = here.pose_derivative(node)[0, :, k] * scale
        np.testing.assert_allclose(unit * moved, unit * difference(poses, step), atol=1e-8)
        jacobians = [jacobian_by_fixed(one, m, c, node) for m, c in zip(changed, closed, strict=True)]
        numeric = difference(jacobians, step) * scale[:, None] * unit
        np.testing.assert_allclose(
            by_p[..., k] * scale[:, None] * unit, numeric, atol=1e-8 * max(1.0, np.abs(numeric).max())
        )


WRENCH = np.array([3.0, -2.0, 5.0, 0.3, 0.7, -0.4])


@pytest.mark.parametrize("name", FEW)
def test_torques_that_hold(name: str) -> None:
    """Against the inverse dynamics of edited documents; masses that follow from dimensions stay those of the file."""
    one = design(name)
    parameters, mechanism = one.parameters, one.mechanism
    loads = [Payload(mechanism.end, wrench=tuple(WRENCH))]
    here = one.evaluate(q=[mechanism.q_home, *mechanism.random_closed(1, 5)][-1])
    torques, by_p = holding_torques(here, {mechanism.end: WRENCH}, massless=True)
    expected = InverseDynamics(mechanism, loads, massless=True).torques(here.q[0])
    size = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(torques[0], expected, atol=1e-9 * size)
    opening = set(here.opening)
    fixed = [i for i, k in enumerate(one.names) if k not in opening]
    chosen = np.random.default_rng(7).permutation(fixed)[:4]
    torques, by_p = holding_torques(here, {mechanism.end: WRENCH}, gravity=(0.0, 0.0, 0.0))
    weights, by_weight = holding_torques(here, massless=True)
    for k in chosen:
        unit = mechanism.length if parameters.all[parameters.find(one.names[k])].unit == "m" else 1.0
        step = 1e-3 * unit
        changed = [edited(parameters, k, s * step) for s in STEPS]
        closed = [m.close(here.q[0], mechanism.actuated) for m in changed]
        pairs = list(zip(changed, closed, strict=True))
        held = [InverseDynamics(m, loads, (0.0, 0.0, 0.0), True).torques(c) for m, c in pairs]
        size = max(1.0, float(np.abs(torques).max()))
        np.testing.assert_allclose(unit * by_p[0, :, k], unit * difference(held, step), atol=1e-8 * size)
        if same_masses(changed[0], mechanism):
            held = [InverseDynamics(m, massless=True).torques(c) for m, c in pairs]
            size = max(1.0, float(np.abs(weights).max()))
            np.testing.assert_allclose(unit * by_weight[0, :, k], unit * difference(held, step), atol=1e-8 * size)


def same_masses(one: Mechanism, other: Mechanism) -> bool:
    masses = [{link: (body.mass, *body.centre) for link, body in stated(m).items()} for m in (one, other)]
    same = masses[0].keys() == masses[1].keys()
    return same and all(np.allclose(masses[0][link], masses[1][link], 1e-12, 1e-12) for link in masses[0])
