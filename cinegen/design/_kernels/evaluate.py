"""Evaluate a mechanism at many values of its parameters: place joints and ends of loops, close the loops, and write
poses, screws and the rows of the loops."""

from __future__ import annotations

import math

from cinegen.design._kernels.memory import DesignMemory
from cinegen.jit import se3
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.se3 import combine, compose, cross, dot
from cinegen.jit.vectors import copy
from cinegen.loops._kernels.closure import close
from cinegen.loops._kernels.memory import NOWHERE
from cinegen.loops._kernels.residual import BALL, PRISMATIC, REVOLUTE, evaluate_loops

RX, RY, RZ, PX, PY, PZ, CONSTANT = range(7)
"""Kinds of steps of a chain."""


@entry
def evaluate_designs(memory: DesignMemory) -> None:
    """Evaluate all rows of `values`, each from its configuration of `starts`, in which locked joints stay."""
    for i in range(memory.count):
        _place(memory, memory.values[i])
        copy(memory.starts[i], memory.trial, memory.nq)
        memory.factored_at = NOWHERE
        close(memory, memory.tolerance, memory.most, memory.is_exact != 0)
        copy(memory.trial, memory.result_q[i], memory.nq)
        memory.gaps[i] = memory.gap
        first = memory.targets - memory.outputs
        for o in range(memory.outputs):
            compose(memory.frames[memory.node_joint[o]], memory.target_frame[first + o], memory.poses[i, o])
        if memory.detailed > 0:
            _write_derivatives(memory, i)


@compiled
def _place(memory: DesignMemory, values: Array) -> None:
    """Compute the frames of all targets, and the axes of all motions, on the joints that carry them."""
    for t in range(memory.targets):
        frame = memory.target_frame[t]
        for c in range(4):
            for i in range(3):
                frame[c, i] = 1.0 if c == i else 0.0
        for s in range(memory.chain_first[t], memory.chain_first[t + 1]):
            kind, index = memory.step_kind[s], memory.step_index[s]
            if kind == CONSTANT:
                compose(frame, memory.constant[index], memory.moved)
                for c in range(4):
                    copy(memory.moved[c], frame[c], 3)
                continue
            a = kind % 3
            if memory.step_records[s] != 0:
                copy(frame[a], memory.motion_axis[index], 3)
                copy(frame[3], memory.motion_origin[index], 3)
            if kind >= PX:
                for i in range(3):
                    frame[3, i] += values[index] * frame[a, i]
            else:
                b, c, sine, cosine = (a + 1) % 3, (a + 2) % 3, math.sin(values[index]), math.cos(values[index])
                for i in range(3):
                    x, y = frame[b, i], frame[c, i]
                    frame[b, i], frame[c, i] = cosine * x + sine * y, cosine * y - sine * x
    for j in range(1, memory.joints):
        for c in range(4):
            copy(memory.target_frame[j - 1, c], memory.joint_offset[j, c], 3)
    t = memory.joints - 1
    for loop in range(memory.loops):
        for side in range(2):
            for c in range(4):
                copy(memory.target_frame[t, c], memory.loop_offsets[loop, side, c], 3)
            t += 1


@compiled
def _write_derivatives(memory: DesignMemory, i: int) -> None:
    evaluate_loops(memory, True)
    for j in range(memory.joints):
        for c in range(4):
            copy(memory.frames[j, c], memory.all_frames[i, j, c], 3)
    for k in range(memory.n):
        copy(memory.screws[k], memory.all_screws[i, k], 6)
    for r in range(memory.rows):
        copy(memory.jacobian[r], memory.jacobians[i, r], memory.n)
        memory.maps[i, r, :] = 0.0
    axis, origin = memory.vectors[0], memory.vectors[1]
    for k in range(memory.motions):
        frame, screw = memory.frames[memory.motion_joint[k]], memory.motion_screws[i, k]
        combine(memory.motion_axis[k], frame, axis)
        if memory.motion_slides[k] != 0:
            for a in range(3):
                screw[a], screw[3 + a] = axis[a], 0.0
            continue
        combine(memory.motion_origin[k], frame, origin)
        for a in range(3):
            origin[a] += frame[3, a]
            screw[3 + a] = axis[a]
        cross(origin, axis, screw)
    for loop in range(memory.loops):
        _write_map(memory, loop, memory.maps[i])


@compiled
def _write_map(memory: DesignMemory, loop: int, maps: Array) -> None:
    """Write the rows of a loop, dimensionless, by the twist of its second end relative to the first, in the world."""
    ends, w = memory.ends, memory.vectors
    first, second, seen, by, turned, moment = ends[0], ends[1], w[1:4], w[4:7], w[7], w[8]
    for side in range(2):
        compose(memory.frames[memory.loop_joints[loop, side]], memory.loop_offsets[loop, side], ends[side])
    kind, row = memory.loop_kind[loop], memory.loop_row[loop]
    linear, angular = 3, 0
    if kind == PRISMATIC:
        linear = 2
    for i in range(linear):
        cross(second[3], first[i], moment)
        for a in range(3):
            maps[row + i, a], maps[row + i, 3 + a] = first[i, a] / memory.length, moment[a] / memory.length
    if kind == REVOLUTE:
        angular = 2
        se3.swing(dot(first[0], second[2]), dot(first[1], second[2]), dot(first[2], second[2]), turned, by)
    elif kind != BALL:
        angular = 3
        se3.relative(first, second, seen)
        se3.log(seen, turned)
        se3.log_derivative(turned, by)
    for i in range(angular):
        combine(by[i], first, maps[row + linear + i, 3:6])
