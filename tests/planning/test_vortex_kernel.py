"""The kernel that turns links around what is in their way, against the fields of the paper in plain numpy."""

import numpy as np
import pinocchio as pin
import pytest
from clearings import among, around, measured
from firas import closeness
from hypothesis import given, settings
from hypothesis import strategies as st
from repository import load
from scipy.linalg import null_space
from vortex_field import Vortex, facing

from cinegen.planning.vortices import Vortices

seeds = st.integers(0, 2**32 - 1)
LEAST = 1e-4


def jacobian_of(clearance, q, pair):
    """(3, nv) how joints move a pair's first nearest point, seen from the second body, without unit of motion: by
    Pinocchio."""
    model, data = clearance.mechanism.model, clearance.mechanism.model.createData()
    first, other, _ = clearance.nearest_points(pair)
    pin.computeJointJacobians(model, data, q)
    jacobian = np.zeros((3, model.nv))
    for body, at, sign in zip(clearance.pairs[pair], (first, other), (1.0, -1.0), strict=True):
        if joint := clearance.bodies[int(body)].joint:
            turning = pin.getJointJacobian(model, data, joint, pin.LOCAL_WORLD_ALIGNED)
            jacobian += sign * (turning[:3] - pin.skew(at - data.oMi[joint].translation) @ turning[3:])
    return jacobian * clearance.mechanism.scale


def turned(clearance, q, motion, around_, states, reach, stop, strength):
    """Equation 6 as it reads: each link's nearest point L, led by a = J motion, is turned by the vortex of the
    obstacle, strong by |a|, weighed by how it faces it; the joints do the least that moves L so (damped). Last, whether
    it is sure who is led in."""
    total, states, asks = motion.copy(), states.copy(), np.full(len(states), -1)
    distances = clearance.distances(q)
    needed, sure, mechanism, scale = set(), True, clearance.mechanism, clearance.mechanism.scale
    free = null_space(mechanism.loop_jacobian(q) * scale, rcond=1e-6) if mechanism.loops else np.eye(len(scale))
    for pair in np.argsort(distances, kind="stable"):
        if not distances[pair] < reach:
            continue
        normal = -clearance.nearest_points(int(pair))[2]
        columns = jacobian_of(clearance, q, int(pair))
        a = columns @ (motion / scale)
        weight = float(facing([a], [normal])[0])
        sure = sure and abs(normal @ a) > 1e-6 * np.linalg.norm(a)
        if weight <= 1e-9:
            continue
        g = around_[pair]
        if not states[g, 0]:
            asks[g] = pair if asks[g] < 0 else asks[g]
            continue
        needed.add(int(g))
        field = Vortex(1.0, reach).velocity([max(distances[pair], stop)], [normal], states[g, 1:])[0]
        if np.linalg.norm(field) < 1e-9:
            continue
        way = field / np.linalg.norm(field)
        near = closeness(max(distances[pair], stop), reach) / closeness(stop, reach)
        size = strength * np.linalg.norm(a) * weight * near
        columns = columns @ free  # by motions that keep loops closed
        along = columns.T @ way
        total += scale * (free @ along) * size / (along @ along + LEAST * (columns**2).sum() / 3.0)
    for g in range(len(states)):
        states[g, 0] = float(g in needed)
    return total, asks, states, sure


def deflected(clearance, q, motion, groups, states, reach, stop, strength):
    """By the kernel, for any groups and states."""
    vortices = Vortices(clearance, reach, 0.0)
    vortices._memory.resize(vortices=len(states))
    vortices._memory.vortex[:], vortices.states = groups, vortices._memory.states
    vortices.states[:], vortices.reach, vortices.stop, vortices.strength = states, reach, stop, strength
    result = vortices._deflected(q, motion)
    states[:] = vortices.states
    return result


@pytest.mark.parametrize("name", ["arm7", "planar_3r", "two_arms", "five_bar"])
@settings(max_examples=40)
@given(seed=seeds)
def test_the_kernel_is_the_paper_in_numpy(name, seed):
    rng, mechanism = np.random.default_rng(seed), load(name)
    clearance = among(name, around(name, seed % 5))
    q = mechanism.close(mechanism.q_home + rng.uniform(-0.4, 0.4, mechanism.model.nq))
    if np.abs(measured(clearance, q)).min() < 1e-3:
        return
    which = rng.integers(0, 6, len(clearance.pairs))
    states = np.column_stack([rng.integers(0, 2, 6), rng.normal(size=(6, 3))]).astype(float)
    states[:, 1:] /= np.linalg.norm(states[:, 1:], axis=1)[:, None]
    if name in ("planar_3r", "five_bar"):
        states[:, 1:] = [0.0, 0.0, 1.0]
    motion = rng.normal(size=mechanism.model.nv)
    stop, strength = 0.03 * mechanism.length, rng.uniform(0.2, 3.0)
    reach = rng.uniform(0.3, 2.0) * mechanism.length
    want, asks, after, sure = turned(clearance, q, motion, which, states, reach, stop, strength)
    new_motion, asked = deflected(clearance, q, motion, which, states, reach, stop, strength)
    assert new_motion == pytest.approx(want, abs=1e-5 * np.abs(want).max())
    if not sure:  # as good as along a surface: differences can't tell on which side
        return
    assert (asked == asks).all()
    assert (states == after).all()
