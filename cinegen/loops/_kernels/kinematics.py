"""Frames and screws of all joints, and steps of configurations.

Pinocchio computes frames and screws, called by its address (`cinegen.jit.pinocchio_calls`), and the steps of joints of
kinds that only it knows. What is written out here for the others runs where Pinocchio is not, or can't be called:
translated to C and JavaScript.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import Array, compiled
from cinegen.jit.pinocchio_calls import address_of, call_native
from cinegen.jit.se3 import combine, compose, cross, dot, log, log_derivative, sinc, turn
from cinegen.jit.vectors import copy
from cinegen.loops._kernels.memory import LoopMemory

FIXED, REVOLUTE, PRISMATIC, SPHERICAL, FREE_FLYER, OTHER = range(6)
"""Kinds of joints; others are only Pinocchio's. A quaternion is (x, y, z, w), as in Pinocchio; a free flyer's q is its
position, then that."""


@compiled
def evaluate(memory: LoopMemory, q: Array) -> None:
    """Compute the frames of all joints, and their screws, at q (nq,)."""
    memory.evaluations += 1
    if memory.couplings > 0:
        copy(q, memory.coupled_q, memory.nq)
    if memory.evaluate_address != 0:
        _call_pinocchio(memory, q)
        return
    frames, screws = memory.frames, memory.screws
    for j in range(1, memory.joints):
        frame, at, dof = frames[j], memory.joint_q[j], memory.joint_dof[j]
        compose(frames[memory.joint_parent[j]], memory.joint_offset[j], frame)
        kind = memory.joint_kind[j]
        if kind == REVOLUTE:
            screw = screws[dof]
            axis = screw[3:6]
            combine(memory.joint_axis[j], frame, axis)
            cross(frame[3], axis, screw)
            turn(frame, memory.joint_axis[j], math.sin(q[at]), 1.0 - math.cos(q[at]))
        elif kind == PRISMATIC:
            screw = screws[dof]
            combine(memory.joint_axis[j], frame, screw)
            for i in range(3):
                frame[3, i] += q[at] * screw[i]
                screw[3 + i] = 0.0
        else:
            _evaluate_free(frame, kind == FREE_FLYER, q[at:], memory.vectors)
            if dof >= 0:
                _free_screws(frame, kind == FREE_FLYER, screws[dof:])


@compiled
def _call_pinocchio(memory: LoopMemory, q: Array) -> None:
    """Let Pinocchio compute the frames and screws, at q with its unit vectors normalised."""
    if memory.units > 0:
        unit_q = memory.full_q
        copy(q, unit_q, memory.nq)
        for u in range(memory.units):
            first, size, square = memory.unit[u, 0], memory.unit[u, 1], 0.0
            for i in range(first, first + size):
                square += q[i] * q[i]
            for i in range(first, first + size):
                unit_q[i] /= math.sqrt(square)
        at = _vector(memory, 0, unit_q, memory.nq)
    else:
        at = _vector(memory, 0, q, memory.nq)
    call_native(memory.evaluate_address, (memory.model_address, memory.data_address, at))


@compiled
def _vector(memory: LoopMemory, i: int, values: Array, size: int) -> int:
    """Return the address of an argument of Pinocchio's functions, a vector of these values."""
    vector = memory.vector[i]
    vector[0], vector[1] = address_of(values), size
    return int(address_of(vector))


@compiled
def _evaluate_free(frame: Array, floats: bool, q: Array, vectors: Array) -> None:
    """Move a frame by the numbers of a spherical joint, or of a free flyer."""
    if floats:
        combine(q, frame, vectors[0])
        for i in range(3):
            frame[3, i] += vectors[0, i]
        q = q[3:]
    square = dot(q, q) + q[3] * q[3]
    turn(frame, q, 2.0 * q[3] / square, 2.0 / square)


@compiled
def _free_screws(frame: Array, floats: bool, screws: Array) -> None:
    """Write the screws of a spherical joint, or of a free flyer, about and along its own axes."""
    first = 0
    if floats:
        first = 3
        for k in range(3):
            for i in range(3):
                screws[k, i], screws[k, 3 + i] = frame[k, i], 0.0
    for k in range(3):
        cross(frame[3], frame[k], screws[first + k])
        for i in range(3):
            screws[first + k, 3 + i] = frame[k, i]


@compiled
def integrate(memory: LoopMemory, q: Array, delta: Array, out: Array) -> None:
    """Write the configuration (nq,) that a step delta (n,), m and rad, reaches from q (nq,)."""
    copy(q, out, memory.nq)
    if memory.others > 0:
        _integrate_others(memory, q, delta, out)
    for j in range(1, memory.joints):
        kind, at, dof = memory.joint_kind[j], memory.joint_q[j], memory.joint_dof[j]
        if dof < 0 or (memory.others > 0 and kind == OTHER):
            continue
        if memory.q_index[dof] >= 0:
            out[at] += delta[dof]
            continue
        if kind == FREE_FLYER:
            _float(q[at:], delta[dof:], out[at:], memory.vectors)
            at, dof = at + 3, dof + 3
        if (
            delta[dof] != 0.0 or delta[dof + 1] != 0.0 or delta[dof + 2] != 0.0
        ):  # otherwise it is unchanged, bit for bit
            _multiply(q[at:], delta[dof:], out[at:], kind == FREE_FLYER)


@compiled
def _integrate_others(memory: LoopMemory, q: Array, delta: Array, out: Array) -> None:
    """Let Pinocchio move the joints of kinds that only it knows; those at rest remain unchanged, bit for bit."""
    step, moved = memory.full_v, memory.full_q
    step[: memory.fixed] = 0.0
    copy(delta, step[memory.fixed :], memory.n)
    first, by = _vector(memory, 0, q, memory.nq), _vector(memory, 1, step, memory.nv)
    call_native(memory.integrate_address, (memory.model_address, first, by, _vector(memory, 2, moved, memory.nq)))
    for o in range(memory.others):
        at, dof, moves = memory.other[o, 0], memory.other[o, 2], False
        for k in range(dof, dof + memory.other[o, 3]):
            moves = moves or delta[k] != 0.0
        if moves:
            copy(moved[at:], out[at:], memory.other[o, 1])


@compiled
def _multiply(q: Array, v: Array, out: Array, nearer: bool) -> None:
    """Write the quaternion q times exp(v); with `nearer`, the nearer one of it and its negative."""
    s, c = sinc(0.25 * dot(v, v))
    w, s = 1.0 - 0.25 * dot(v, v) * c, 0.5 * s
    if w < 0.0 and nearer:
        w, s = -w, -s
    x, y, z = s * v[0], s * v[1], s * v[2]
    a, b, c, d = q[0], q[1], q[2], q[3]
    out[0] = d * x + w * a + b * z - c * y
    out[1] = d * y + w * b + c * x - a * z
    out[2] = d * z + w * c + a * y - b * x
    out[3] = d * w - a * x - b * y - c * z
    size = 1.0 / math.sqrt(dot(out, out) + out[3] * out[3])
    for i in range(4):
        out[i] *= size


@compiled
def _float(q: Array, delta: Array, out: Array, vectors: Array) -> None:
    """Write the position (3,) of a free flyer after a twist (6,) in its own axes: the exponential of SE(3)."""
    frame, moved, v = vectors[0:3], vectors[4], delta[3:]
    _axes_of(q[3:], frame)
    square = dot(v, v)
    s, c = sinc(square)
    more = (1.0 - s) / square if square > 1e-8 else 1.0 / 6.0 - square / 120.0
    cross(v, delta, vectors[3])
    along = more * dot(v, delta)
    for i in range(3):  # (1 - cos) / t^2 v x u + (1 - sin / t) / t^2 v (v . u) + sin / t u
        moved[i] = s * delta[i] + c * vectors[3, i] + along * v[i]
    combine(moved, frame, vectors[3])
    for i in range(3):
        out[i] = q[i] + vectors[3, i]


@compiled
def _axes_of(q: Array, axes: Array) -> None:
    """Write the axes (3, 3) of a quaternion."""
    for k in range(3):
        for i in range(3):
            axes[k, i] = 1.0 if i == k else 0.0
    square = dot(q, q) + q[3] * q[3]
    turn(axes, q, 2.0 * q[3] / square, 2.0 / square)


@compiled
def difference(memory: LoopMemory, q: Array, to: Array, out: Array) -> None:
    """Write the step (n,), m and rad, from q to another configuration (nq,)."""
    if memory.others > 0:
        _differ_others(memory, q, to, out)
    vectors = memory.vectors
    for j in range(1, memory.joints):
        kind, at, dof = memory.joint_kind[j], memory.joint_q[j], memory.joint_dof[j]
        if dof < 0 or (memory.others > 0 and kind == OTHER):
            continue
        if memory.q_index[dof] >= 0:
            out[dof] = to[at] - q[at]
            continue
        turned = at + 3 if kind == FREE_FLYER else at
        begin, end, seen, by = vectors[0:3], vectors[3:6], vectors[6:9], vectors[9:12]
        _axes_of(q[turned:], begin)
        _axes_of(to[turned:], end)
        for i in range(3):
            for k in range(3):
                seen[i, k] = dot(begin[i], end[k])
        log(seen, out[dof + turned - at :])
        if kind == FREE_FLYER:
            log_derivative(out[dof + 3 :], by)
            for i in range(3):
                seen[0, i] = to[at + i] - q[at + i]
            for i in range(3):
                seen[1, i] = dot(begin[i], seen[0])
            for i in range(3):
                out[dof + i] = dot(by[i], seen[1])


@compiled
def _differ_others(memory: LoopMemory, q: Array, to: Array, out: Array) -> None:
    """Write the steps of the joints of kinds that only Pinocchio knows."""
    step = memory.full_v
    first, second = _vector(memory, 0, q, memory.nq), _vector(memory, 1, to, memory.nq)
    call_native(memory.difference_address, (memory.model_address, first, second, _vector(memory, 2, step, memory.nv)))
    for o in range(memory.others):
        dof = memory.other[o, 2]
        copy(step[memory.fixed + dof :], out[dof:], memory.other[o, 3])
