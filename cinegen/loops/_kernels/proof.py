"""Proof that a step of the actuated joints stays on its branch: a tube around the predicted path, in which the loops
have exactly one solution for each point of the path.

Let x be the dimensionless positions of a cluster's joints, F its equations, q the closed start of a step, v the step
along the tangent of the path, z the passive joints' distance from it, and P an inverse of F's derivative J_p by the
passive joints, found at q or before. For each t in [0, 1] consider

    f_t(z) = P F(q + t v + z).

If |1 - P J_p| <= k <= 1/2 within a distance r of the line q + t v, and |f_t(0)| <= (1 - k) r, then z - f_t(z) maps the
ball |z| <= r into itself and contracts it. By Banach's theorem f_t, and with it F, has at most one zero there, and f_t
has one, which depends continuously on t; J_p is regular along it (the argument is that of Newton's method by
L. V. Kantorovich; for tracking paths see C. Beltran and A. Leykin, "Robust certified numerical homotopy tracking",
2013). A closed end within the ball at t = 1 therefore is on the branch of q, without a singularity in between.

The bounds: placements are products of rotations and translations. With w_i the rotation of joint i by a dimensionless
step (of a prismatic joint: its translation, in characteristic lengths), D the largest distance of a loop's end from the
axes of its joints, in characteristic lengths, or 1 if that is more, and S = sum of w_i |v_i| over a loop,

    |F''[v, v]| <= h S^2,  |F''[v] e_j| <= h S w_j,  |F'''[v, v] e_j| <= h S^2 w_j,  |F'''[v, v, v]| <= h S^3,

with h = sqrt(D^2 + 1), and h = D for balls. (F measures rotations by entries of the matrix between a loop's ends, which
are zero where its residual is.) With b the norm of P's columns of the loop, W^2 = sum of w_j^2 over its passive joints,
and sums over loops,

    k <= max(|1 - P J_p| at both ends) + sum b h W (S^2 / 8 + W (|z_1| + r)),
    |f_t(0)| <= (1 + k) |z_1| + |P J v| / 4 + sum b h S^3 / 40,

where z_1 is the distance of the closed end from q + v: P J_p along the line is interpolated between its ends, and F by
the polynomial of second degree with its values at both ends and its slope at q. D is measured at the end and divided by
1 - S - W (|z_1| + r), which bounds it in the whole tube. Rounding is not bounded.

Limits of the passive joints: since F(q + t v + z(t)) = 0, z' = -(P J_p)^-1 P J v, with J at q + t v + z, so

    |z'| <= R = (|P J(q) v| + sum b h S (S + W r)) / (1 - k).

A joint i therefore moves by at least v_i - R, and by at most v_i + R, as t increases by 1: if both have one sign, its
extremes are those at the ends of the step; otherwise lines of these slopes through both ends bound them.
"""

from __future__ import annotations

import math

from cinegen.jit.compiled import compiled
from cinegen.jit.factor import eliminate
from cinegen.jit.se3 import compose, velocity_at
from cinegen.loops._kernels.memory import ClusterMemory, LoopMemory, cluster_at
from cinegen.loops._kernels.residual import BALL
from cinegen.loops.thresholds import AT_LIMIT, CLOSURE

PROVED, TOO_LONG, NO_PROOF = range(3)
"""Status of a step: on its branch; not proved, but shorter ones may be; the tube is not defined at its start."""

_CONTRACTION = 0.5
_SLACK = 0.1  # W (|z_1| + r): rotation, beyond that of the line, by which levers may differ in the tube
_STALE = 0.1  # |1 - P J_p| at which P is computed again
_ROTATED = 0.6  # derivative by a rotation vector, relative to that at 0, is 1 to within so many times its length
_SPHERICAL = 1.1  # factor of the bounds where rotation vectors are among the positions


@compiled
def prepare(memory: LoopMemory, again: bool) -> None:
    """Prepare the proof of a step from q, at which `jacobian` is, along `tangent`.

    Args:
        memory: of the mechanism.
        again: compute inverses even if they are still good.
    """
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        if again or not cluster.error <= _STALE:
            _invert(memory, cluster)
        cluster.tilt = 0.0
        if cluster.error <= _CONTRACTION:
            cluster.tilt = _tilt(memory, cluster)


@compiled
def prove(memory: LoopMemory) -> int:
    """Return the status of the step from q by `part` of `tangent` to the closed `trial`.

    Args:
        memory: with frames and `jacobian` at the trial; `delta` is its difference from q, m and rad.
    """
    status = PROVED
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        if not cluster.error <= _CONTRACTION:
            return NO_PROOF
        cluster.error_at_end = _error(memory, cluster)
        if not _is_in_tube(memory, cluster):
            status = TOO_LONG
    return status


@compiled
def find_beyond(memory: LoopMemory) -> int:
    """Return 1 + DoF of a passive joint that is beyond a limit at the trial, and further than at q; 0 if none is."""
    for k in range(memory.limited):
        i = memory.q_index[k]
        if i < 0 or memory.locked[k] != 0.0:
            continue
        if not _bottom(memory, k) <= memory.q[i] + memory.delta[k] <= _top(memory, k):
            return k + 1
    return 0


@compiled
def keeps_limits(memory: LoopMemory) -> bool:
    """Return whether the passive joints are proved to keep their limits, to twice `AT_LIMIT`, on a proved step to a
    trial that keeps them.

    By this module's bound, a joint's slope is within v - R and v + R for t in [0, 1], so it is below the lines
    q + (v + R) t and q + delta - (v - R) (1 - t) through its ends. They meet at t = (1 + (delta - v) / R) / 2, where
    they are highest; the lines below it meet at 1 - t. All are in m or rad.
    """
    for c in range(memory.clusters if memory.limited > 0 else 0):
        cluster = cluster_at(memory.cluster_handles[c])
        for p in range(cluster.passive):
            k = cluster.passive_dof[p]
            i = memory.q_index[k]
            if i < 0:
                continue
            v, r = memory.scale[k] * memory.part * memory.tangent[k], memory.scale[k] * cluster.bend
            if abs(v) >= r:  # it does not reverse
                continue
            t = 0.5 + 0.5 * (memory.delta[k] - v) / r
            if memory.q[i] + (v + r) * t > _top(memory, k) + AT_LIMIT:
                return False
            if memory.q[i] + (v - r) * (1.0 - t) < _bottom(memory, k) - AT_LIMIT:
                return False
    return True


@compiled
def _bottom(memory: LoopMemory, k: int) -> float:
    """Return the least value that a DoF may have after a step from q."""
    return float(min(memory.lowest[k] - AT_LIMIT, memory.q[memory.q_index[k]] - CLOSURE))


@compiled
def _top(memory: LoopMemory, k: int) -> float:
    """Return the greatest value that a DoF may have after a step from q."""
    return float(max(memory.highest[k] + AT_LIMIT, memory.q[memory.q_index[k]] + CLOSURE))


@compiled
def keep(memory: LoopMemory) -> None:
    """The trial has become q."""
    for c in range(memory.clusters):
        cluster = cluster_at(memory.cluster_handles[c])
        cluster.error = cluster.error_at_end


@compiled
def _invert(memory: LoopMemory, cluster: ClusterMemory) -> None:
    """Compute the inverse (J_p^T J_p)^-1 J_p^T of a cluster's Jacobian by its passive joints at q; `error` is infinite
    if there is none, or second derivatives of couplings are not bounded."""
    cluster.error, cluster.passive = math.inf, 0
    for k in range(cluster.n):
        if memory.locked[cluster.dof[k]] == 0.0:
            cluster.passive_dof[cluster.passive] = cluster.dof[k]
            cluster.passive += 1
    n, a, inverse = cluster.passive, cluster.normal, cluster.inverse
    if n > cluster.rank or memory.coupling_degree > 1:
        return
    _find_normal_equations(memory, cluster)
    if n > 0 and eliminate(a, n, n + cluster.rows) == 0.0:
        return
    for i in range(n - 1, -1, -1):
        for r in range(cluster.rows):
            s = a[i, n + r]
            for j in range(i + 1, n):
                s -= a[i, j] * inverse[j, r]
            inverse[i, r] = s / a[i, i]
    cluster.error = _error(memory, cluster)


@compiled
def _find_normal_equations(memory: LoopMemory, cluster: ClusterMemory) -> None:
    """Set `normal` to J_p^T [J_p 1]."""
    n, a, jacobian, row, dof = cluster.passive, cluster.normal, memory.jacobian, cluster.row, cluster.passive_dof
    for i in range(n):
        for j in range(n):
            a[i, j] = 0.0
            for r in range(cluster.rows):
                a[i, j] += jacobian[row[r], dof[i]] * jacobian[row[r], dof[j]]
        for r in range(cluster.rows):
            a[i, n + r] = jacobian[row[r], dof[i]]


@compiled
def _error(memory: LoopMemory, cluster: ClusterMemory) -> float:
    """Return |1 - P J_p| for `jacobian`, in Frobenius' norm."""
    total, jacobian, row, inverse = 0.0, memory.jacobian, cluster.row, cluster.inverse
    for i in range(cluster.passive):
        for j in range(cluster.passive):
            s = 1.0 if i == j else 0.0
            for r in range(cluster.rows):
                s -= inverse[i, r] * jacobian[row[r], cluster.passive_dof[j]]
            total += s * s
    return math.sqrt(total)


@compiled
def _tilt(memory: LoopMemory, cluster: ClusterMemory) -> float:
    """Return |P J v| for the remaining path v: 0 if it was an exact tangent."""
    total, jacobian, row, inverse, right = 0.0, memory.jacobian, cluster.row, cluster.inverse, cluster.right
    for r in range(cluster.rows):
        right[r] = 0.0
        for k in range(cluster.n):
            right[r] += jacobian[row[r], cluster.dof[k]] * memory.tangent[cluster.dof[k]]
    for i in range(cluster.passive):
        s = 0.0
        for r in range(cluster.rows):
            s += inverse[i, r] * right[r]
        total += s * s
    return math.sqrt(total)


@compiled
def _is_in_tube(memory: LoopMemory, cluster: ClusterMemory) -> bool:
    """Return whether a cluster's trial is proved to be on the branch of q."""
    squared, part, tangent, longest = 0.0, memory.part, memory.tangent, 0.0
    for i in range(cluster.passive):
        k = cluster.passive_dof[i]
        squared += (memory.delta[k] / memory.scale[k] - part * tangent[k]) ** 2
        longest = max(longest, abs(part * tangent[k]))
    z = math.sqrt(squared)
    interpolated, by_distance, bent, swept, pulled, widest = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for r in range(cluster.rows):
        loop = memory.row_loop[cluster.row[r]]
        if loop < 0 or memory.loop_row[loop] != cluster.row[r]:  # a coupling, which is linear, or another row of a loop
            continue
        travelled, lever, width = _measure(memory, loop)
        if travelled + _SLACK >= 1.0:
            return False
        lever /= 1.0 - travelled - _SLACK  # anywhere in the tube, if it is not wider
        widest = max(widest, width)
        h = lever if memory.loop_kind[loop] == BALL else math.sqrt(lever * lever + 1.0)
        h *= _norm_of_inverse(memory, cluster, loop) * (_SPHERICAL if memory.units > 0 else 1.0)
        interpolated += h * math.sqrt(width) * travelled**2 / 8.0
        by_distance += h * width
        bent += h * travelled**3 / 40.0
        swept += h * travelled**2
        pulled += h * travelled * math.sqrt(width)
    distance = (1.0 + _CONTRACTION) * z + part * cluster.tilt / 4.0 + bent
    radius = distance / (1.0 - _CONTRACTION)
    contraction = max(cluster.error, cluster.error_at_end) + interpolated + by_distance * (z + radius)
    if memory.units > 0:
        contraction += _ROTATED * (longest + z)
    cluster.bend = (part * cluster.tilt + swept + pulled * radius) / (1.0 - _CONTRACTION)
    return contraction <= _CONTRACTION and math.sqrt(widest) * (z + radius) <= _SLACK


@compiled
def _measure(memory: LoopMemory, loop: int) -> tuple[float, float, float]:
    """Return S, D and W^2 of a loop, from frames and screws."""
    compose(memory.frames[memory.loop_joints[loop, 1]], memory.loop_offsets[loop, 1], memory.ends[1])
    travelled, lever, width = 0.0, 1.0, 0.0
    for step in range(memory.loop_steps[loop, 0], memory.loop_steps[loop, 1]):
        k, size = memory.step_dof[step], abs(memory.step_size[step])
        screw = memory.screws[k]
        x, y, z = velocity_at(screw, memory.ends[1, 3])
        speed = math.sqrt(x * x + y * y + z * z) / memory.length
        turned = math.sqrt(screw[3] ** 2 + screw[4] ** 2 + screw[5] ** 2)
        if turned > 0.0:
            lever = max(lever, speed / turned)
        w = size * (turned if turned > 0.0 else speed)
        travelled += w * abs(memory.part * memory.tangent[k])
        if memory.locked[k] == 0.0:
            width += w * w
    return travelled, lever, width


@compiled
def _norm_of_inverse(memory: LoopMemory, cluster: ClusterMemory, loop: int) -> float:
    """Return the norm of the columns of P that belong to a loop, Frobenius'."""
    total = 0.0
    for r in range(cluster.rows):
        if memory.row_loop[cluster.row[r]] == loop:
            for i in range(cluster.passive):
                total += cluster.inverse[i, r] ** 2
    return math.sqrt(total)
