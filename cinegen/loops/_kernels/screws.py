"""The screw matrix of a mechanism's loops, compiled; plain form: `cinegen.loops.screws`."""

from __future__ import annotations

from cinegen.jit.compiled import compiled
from cinegen.jit.se3 import compose
from cinegen.loops._kernels.memory import LoopMemory
from cinegen.loops._kernels.residual import BALL, PRISMATIC, REVOLUTE


@compiled
def find_screws(memory: LoopMemory) -> None:
    """Compute `screw_matrix` from the joints' frames; rows of couplings are those of `jacobian`, mixed for the columns
    of the passive joints."""
    matrix, first = memory.screw_matrix, memory.rows - memory.couplings
    for i in range(memory.screw_rows):
        for k in range(memory.screw_columns):
            matrix[i, k] = 0.0
    for i in range(memory.couplings):
        for j in range(memory.couplings):
            mix = memory.coupling_mix[i, j]
            for k in range(memory.n):
                matrix[6 * memory.loops + i, k] += mix * memory.jacobian[first + j, k]
    _find_centres(memory)
    for loop in range(memory.loops):
        centre = memory.screw_centre[memory.screw_cluster[loop]]
        for step in range(memory.loop_steps[loop, 0], memory.loop_steps[loop, 1]):
            k, s = memory.step_dof[step], memory.step_size[step]
            v, w = memory.screws[k], memory.screws[k, 3:6]
            _add(
                memory, loop, k, s,
                v[0] + w[1] * centre[2] - w[2] * centre[1],
                v[1] + w[2] * centre[0] - w[0] * centre[2],
                v[2] + w[0] * centre[1] - w[1] * centre[0],
                w[0], w[1], w[2],
            )  # fmt: skip
        kind, column, end = memory.loop_kind[loop], memory.n + memory.loop_cut[loop], memory.ends[0]
        compose(memory.frames[memory.loop_joints[loop, 0]], memory.loop_offsets[loop, 0], end)
        if kind == PRISMATIC:
            _add(memory, loop, column, -memory.length, end[2, 0], end[2, 1], end[2, 2], 0.0, 0.0, 0.0)
        elif kind == REVOLUTE:
            _add_rotation(memory, loop, column, end[2, 0], end[2, 1], end[2, 2])
        elif kind == BALL:
            _add_rotation(memory, loop, column, 1.0, 0.0, 0.0)
            _add_rotation(memory, loop, column + 1, 0.0, 1.0, 0.0)
            _add_rotation(memory, loop, column + 2, 0.0, 0.0, 1.0)


@compiled
def _find_centres(memory: LoopMemory) -> None:
    """Compute the centre of each cluster of screws: the mean of points of its axes, weighted by their shares."""
    for c in range(memory.screw_clusters):
        for i in range(3):
            memory.screw_centre[c, i] = 0.0
    for a in range(memory.axis_points):
        frame, point = memory.frames[memory.axis_joint[a]], memory.axis_point[a]
        centre = memory.screw_centre[memory.axis_cluster[a]]
        for i in range(3):
            moved = frame[3, i] + frame[0, i] * point[0] + frame[1, i] * point[1] + frame[2, i] * point[2]
            centre[i] += memory.axis_share[a] * moved


@compiled
def _add_rotation(memory: LoopMemory, loop: int, column: int, u: float, v: float, w: float) -> None:
    """Add the rotation of a cut joint about an axis u, v, w through its first end, the first of `ends`."""
    p, centre = memory.ends[0, 3], memory.screw_centre[memory.screw_cluster[loop]]
    x, y, z = centre[0] - p[0], centre[1] - p[1], centre[2] - p[2]
    _add(memory, loop, column, -1.0, v * z - w * y, w * x - u * z, u * y - v * x, u, v, w)


@compiled
def _add(
    memory: LoopMemory, loop: int, column: int, size: float, x: float, y: float, z: float, u: float, v: float, w: float
) -> None:
    """Add a twist, linear x, y, z and angular u, v, w, of a velocity that takes part in a loop."""
    matrix, length = memory.screw_matrix, memory.screw_length[memory.screw_cluster[loop]]
    for other in range(memory.loops):
        s = memory.screw_mix[other, loop] * size
        if s != 0.0:
            row = 6 * other
            matrix[row, column] += s / length * x
            matrix[row + 1, column] += s / length * y
            matrix[row + 2, column] += s / length * z
            matrix[row + 3, column] += s * u
            matrix[row + 4, column] += s * v
            matrix[row + 5, column] += s * w
