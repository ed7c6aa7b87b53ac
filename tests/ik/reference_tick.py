"""The linear algebra of one tick in plain numpy, lexicographic: loops exactly, joint limits exactly, tasks as well as
possible. Everything is dimensionless. The compiled kernels are tested against it."""

import numpy as np
from scipy.optimize import nnls

from cinegen.ik.thresholds import FULL, REST, RESTING, SPARE_SPEED
from cinegen.loops.motions import free_motions, orthonormal
from cinegen.tolerances import NEAR_SINGULAR

_TOUCH = 1e-12  # rad: a step that ends this little beyond a bound ends on it


def relative_weights(tasks):
    """Return the weights (k,) of the rows of tasks, as fractions of the heaviest task's, which may have no rows."""
    weights = np.concatenate([np.zeros(0), *(task.row_weights for task in tasks)])
    return np.asarray(weights / max((task.memory.weight for task in tasks), default=1.0))


def damping(sigma, error):
    """Return what is added to each squared singular value, (k,): exactly 0 from near = `NEAR_SINGULAR` on.

    (1 - (sigma / near)^2)^2 (near^2 / 4 + error) below: only singular directions that are about to be lost are damped
    (A. A. Maciejewski and C. A. Klein, "Numerical filtering for the operation of robotic manipulators through
    kinematically singular configurations", Journal of Robotic Systems 5, 1988). The term in the error's size keeps a
    robot at rest that is stretched towards a target out of its reach: there the step is proportional to the small
    singular value and the error to its square, and undamped the two oscillate (T. Sugihara, "Solvability-unconcerned
    inverse kinematics by the Levenberg-Marquardt method", IEEE Trans. Robotics 27, 2011).

    Args:
        sigma: (k,) singular values.
        error: size of the desired motion, dimensionless.
    """
    part = np.maximum(0.0, 1.0 - (sigma / NEAR_SINGULAR) ** 2) ** 2
    return np.asarray(part * (0.25 * NEAR_SINGULAR * NEAR_SINGULAR + error))


def resolve(loops, rank, levels, low, high, longest, cut_rates=None, barriers=None):
    """Return the step (nv,) by levels of tasks, while every loop stays closed and every joint within its bounds.

    In the coordinates y of the free motions V, with the SVD A = rows V = U S W^T, the step of a level minimises

        |A y - error|^2 + sum_i damping_i (w_i . y)^2    subject to    low <= V y <= high,

    without damping where singular values are large, and with `RESTING` for motions that no task constrains. With
    x_i = h_i (w_i . y), h_i^2 = s_i^2 + damping_i, that is the point x of a polyhedron that is nearest to
    b_i = (s_i / h_i) u_i . error. Each level is resolved so in the motions Z that those before leave, whatever the
    bounds leave of them, and its directions are removed from Z. None where it is anyone's choice, since a direction is
    lost, or where `_nearest` fails.

    Args:
        loops: (rows, nv) Jacobian of the loops.
        rank: its generic rank.
        cut_rates: (., nv) velocities of the joints that were cut: together with them, V is orthonormal.
        levels: of each its rows (k, nv), the desired motion (k,), the weights of both (k,), and its generic rank in the
            freedom that is left.
        low: (nv,) lowest step of each joint by its position, at most 0.
        high: (nv,) highest, at least 0.
        longest: (nv,) by its velocity. The first level is scaled to it, for the others it is a bound.
        barriers: rows (m, nv) of which the first level's step is to be at most such numbers (m,).
    """
    motions = free_motions(loops, rank)[0]
    if cut_rates is not None:
        motions = orthonormal(motions, cut_rates)
    left, step, carry = np.eye(motions.shape[1]), np.zeros(len(low)), 0.0
    for k, (rows, error, weights, own_rank) in enumerate(levels):
        width = left.shape[1]
        if width == 0 or (k and own_rank == 0):
            continue
        u, sigma, wt = np.linalg.svd(rows @ motions @ left, full_matrices=True)
        is_lost = bool(own_rank) and sigma[own_rank - 1] < 1e-9
        if (k == 0 and own_rank == 0) or (is_lost and len(levels) > 1):
            return None
        sigmas, along, used = np.zeros(width), np.zeros(width), min(len(sigma), width)
        residual = error - rows @ step
        sigmas[:used], along[:used] = sigma[:used], (u.T @ residual)[:used]
        size, true_size = float(np.linalg.norm(residual)), float(np.linalg.norm(residual / weights))
        emphases = np.ones(width)
        # singular values s_i count for the damping as s_i / |W u_i|: those of light tasks are not small for being light
        emphases[:used] = np.linalg.norm(weights[:, None] * u, axis=0)[:used]
        squared = sigmas**2 + emphases**2 * damping(sigmas / emphases, true_size)
        squared[own_rank:] = RESTING
        scale = np.sqrt(squared + carry)
        wanted, joints = sigmas / scale * along, motions @ left @ wt.T / scale
        if k == 0:
            pace = min(1.0, FULL / float((np.abs(joints @ wanted) / longest).max(initial=1e-9)))
            lower, upper, wanted = np.maximum(low, -longest), np.minimum(high, longest), pace * wanted
        else:
            fastest = np.maximum(SPARE_SPEED * longest, np.abs(step))
            lower, upper = np.maximum(low, -fastest) - step, np.minimum(high, fastest) - step
            lower, upper = np.minimum(lower, 0.0), np.maximum(upper, 0.0)
        sides = joints, lower, upper
        if barriers is not None and k == 0:
            rows_of_barriers, most = barriers
            sides = (
                np.vstack([joints, rows_of_barriers @ joints]),
                np.concatenate([lower, np.full(len(most), -np.inf)]),
                np.concatenate([upper, most]),
            )
        part = joints @ (nearest := _nearest(wanted, *sides))
        if is_lost and nearest is not wanted:
            return None
        if (part > upper + 1e-9).any() or (part < lower - 1e-9).any():  # nnls is not exact
            return None
        won = float(residual @ rows @ part)
        if k == 0 or won > REST * size or won >= 0.5 * size * size:  # else the level is at rest
            step = step + part
        left = left @ wt.T[:, own_rank:]
        damped = np.maximum(0.0, 1.0 - (sigma[:own_rank] / emphases[:own_rank] / NEAR_SINGULAR) ** 2) ** 2
        carry = max(carry, 100.0 * true_size * float(damped.max(initial=0.0)))
    return step


def _nearest(wanted, joints, low, high):
    """Return the point x nearest to `wanted` with low <= joints x <= high.

    Least distance programming by non-negative least squares (C. L. Lawson and R. J. Hanson, "Solving least squares
    problems", 1974, chapter 23).
    """
    step = joints @ wanted
    if (step <= high + _TOUCH).all() and (step >= low - _TOUCH).all():
        return wanted
    size = np.linalg.norm(joints, axis=1)
    moves = size > 1e-12 * size.max(initial=0.0)  # others are moved by rounding
    upper, lower = np.flatnonzero(np.isfinite(high) & moves), np.flatnonzero(np.isfinite(low) & moves)
    sides = np.concatenate([-joints[upper], joints[lower]])  # sides (x - wanted) >= least
    least = np.concatenate([step[upper] - high[upper], low[lower] - step[lower]])
    target = np.zeros(len(wanted) + 1)
    target[-1] = 1.0
    multipliers, _ = nnls(np.vstack([sides.T, least]), target)
    active = np.flatnonzero(multipliers > 0.0)
    # the same point again, from its active bounds: to rounding
    move = np.linalg.lstsq(sides[active], least[active], rcond=1e-10)[0]
    return wanted + move
