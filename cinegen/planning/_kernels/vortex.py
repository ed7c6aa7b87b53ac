"""The vortex field of links among obstacles, compiled; `examples/papers/vortex_field.py` is its plain form."""

from __future__ import annotations

import math

from cinegen.collision._kernels.memory import ClearanceMemory
from cinegen.jit.compiled import Array, compiled, entry
from cinegen.jit.foreign import DISTANCE, FIRST_POINT, NORMAL, SECOND_POINT
from cinegen.jit.se3 import cross, dot
from cinegen.jit.vectors import add_multiple, copy, inner
from cinegen.planning._kernels.memory import VortexMemory

ACTIVE, AXIS = 0, 1
"""State of a vortex: whether it is active, and its axis (3)."""

_LEAST = 1e-4  # damping, relative to the mean square by which free motions move a point: bounds the joint motion where
# the point can hardly move


@compiled
def _point_velocity(clearance: ClearanceMemory, pair: int, j: int, out: Array) -> None:
    """Write the velocity (3,) by column j of a pair's nearest point on the first body relative to the second."""
    screw = clearance.screws[j]
    out[:3] = 0.0
    for side in range(2):
        if clearance.moved_by[clearance.joint[clearance.pair[pair, side]], j] == 0.0:
            continue
        first = SECOND_POINT if side else FIRST_POINT
        at, sign = clearance.results[pair, first : first + 3], -1.0 if side else 1.0
        out[0] += sign * (screw[0] + screw[4] * at[2] - screw[5] * at[1])
        out[1] += sign * (screw[1] + screw[5] * at[0] - screw[3] * at[2])
        out[2] += sign * (screw[2] + screw[3] * at[1] - screw[4] * at[0])


@compiled
def _free_jacobian(memory: VortexMemory, clearance: ClearanceMemory, pair: int) -> float:
    """Write the Jacobian J N of the relative velocity of a pair's nearest points (`_point_velocity`) by dimensionless
    free motions, (3, free), m. Rows of N are those that keep the loops closed; without loops each joint is one.

    Returns:
        the mean square of its three rows, trace(J N N^T J^T) / 3, m^2: that of the motion in one direction.
    """
    by, velocity, count = memory.jacobian, memory.vectors[2], memory.free if memory.free > 0 else memory.nv
    for i in range(3):
        by[i, :count] = 0.0
    for j in range(memory.nv):
        _point_velocity(clearance, pair, j, velocity)
        for i in range(3):
            if memory.free == 0:
                by[i, j] = memory.scale[j] * velocity[i]
            else:
                for f in range(memory.free):
                    by[i, f] += memory.null_space[f, j] * memory.scale[j] * velocity[i]
    square = 0.0
    for i in range(3):
        square += inner(by[i], by[i], count)
    return square / 3.0


@compiled
def _along(by: Array, f: int, t: Array) -> float:
    return float(by[0, f] * t[0] + by[1, f] * t[1] + by[2, f] * t[2])


@entry
def deflect(memory: VortexMemory, clearance: ClearanceMemory) -> None:
    """Add the vortices to a motion (De Medio and Oriolo, equation 6).

    For each pair nearer than `reach`, a is how the motion moves the nearest point L of the first body relative to the
    second, and n the outward normal of the second. Where n . a < 0 the link moves toward the obstacle: the vortex of
    axis w then moves L along w x n by strength |a| (-n . a / |a|) m(d), with m 1 at the stop distance and 0 at the
    reach. The joints make the smallest motion that does so (damped).

    Args:
        memory: `deflected` becomes the motion with all vortices; `candidates` -1, or the nearest pair that moves toward
            the obstacle of an inactive vortex; a vortex that no link moves toward is deactivated.
        clearance: distances and Jacobians where the mechanism is.
    """
    a, t, velocity, states = memory.vectors[0], memory.vectors[1], memory.vectors[2], memory.states
    for g in range(memory.vortices):
        memory.candidates[g] = -1
    copy(memory.motion, memory.deflected, memory.nv)
    for p in range(memory.pairs):
        d = clearance.results[p, DISTANCE]
        if not d < memory.reach:
            continue
        normal = clearance.results[p, NORMAL : NORMAL + 3]  # from the first to the second: -n
        a[0] = a[1] = a[2] = 0.0
        for j in range(memory.nv):
            if memory.motion[j] != 0.0:
                _point_velocity(clearance, p, j, velocity)
                add_multiple(memory.motion[j], velocity, a, 3)
        size, into = math.sqrt(dot(a, a)), dot(a, normal)
        if not into > 1e-9 * size or size < 1e-12:
            continue
        g = memory.vortex[p]
        if states[g, ACTIVE] == 0.0:
            if memory.candidates[g] < 0 or d < clearance.results[memory.candidates[g], DISTANCE]:
                memory.candidates[g] = p
            continue
        states[g, ACTIVE] = 2.0  # still needed
        cross(normal, states[g, AXIS:], t)
        length = math.sqrt(dot(t, t))
        if length < 1e-6:
            continue
        near = max(d, memory.stop)
        modulus = (1.0 / near - 1.0 / memory.reach) / (1.0 / memory.stop - 1.0 / memory.reach)
        target = memory.strength * into * modulus
        along = _LEAST * _free_jacobian(memory, clearance, p)
        count = memory.free if memory.free > 0 else memory.nv
        for f in range(count):
            s = _along(memory.jacobian, f, t) / length
            along += s * s
        if not along > 0.0:
            continue
        for f in range(count):
            s = _along(memory.jacobian, f, t) / length * target / along
            if memory.free == 0:
                memory.deflected[f] += s * memory.scale[f]
            else:
                for j in range(memory.nv):
                    memory.deflected[j] += s * memory.null_space[f, j] * memory.scale[j]
    for g in range(memory.vortices):  # what was not needed is deactivated
        states[g, ACTIVE] = 1.0 if states[g, ACTIVE] == 2.0 else 0.0
