"""Memory of the kernels that close a mechanism's loops.

Everything is dimensionless: lengths are divided by the characteristic length, and so are the steps of prismatic joints.
DoF means degrees of freedom here. Frames are (4, 3): see `cinegen.jit.se3`.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar

from cinegen.jit.compiled import Array, Table
from cinegen.jit.memory import Memory, array, parameter, state, view
from cinegen.jit.pinocchio_calls import VECTOR


class ClusterMemory(Memory):
    """Loops and couplings that share joints (`cinegen.loops.clusters`), and the factors of their Jacobian."""

    n: int = parameter(0)  # DoF that change them
    rows: int = parameter(0)
    rank: int = parameter(0)  # of these rows: generic
    mobility: int = parameter(0)  # n - rank
    dof: Table = array("n", dtype=int)  # of the mechanism
    row: Table = array("rows", dtype=int)  # of the mechanism's equations

    factors: Array = array("rows", "n")
    row_order: Table = array("rows", dtype=int)
    row_left: Array = array("rows")
    tau: Array = array("rows")
    reflectors: Array = array("rows", "n")
    left_vectors: Array = array("rows", "rows")
    right_vectors: Array = array("rows", "n")
    squared_sigma: Array = array("rows")
    is_singular: int = state(0)  # the factors are singular vectors
    factored_rank: int = state(0)
    sigma: float = state(1.0)  # the smallest singular value, or 1 where it is not small
    null_space: Array = array("basis", "n")  # a basis of motions that keep the loops closed
    basis: int = parameter(0)  # mobility, or 0 for a large cluster

    # the joints that were cut: together with their motions the basis is orthonormal
    cut_first: int = parameter(0)  # first column of `cut_rates`
    cut: int = parameter(0)  # columns from there on; those of other clusters are 0. None for a large cluster
    cut_motions: Array = array("basis", "cut")  # scratch
    metric: Array = array("basis", "basis")  # Cholesky factor by which an orthonormal basis was divided

    # a large cluster is factored block by block (`cinegen.jit.banded`); reflections stand for its null space
    blocks: int = parameter(0)  # loops and couplings, or 0 for a small cluster
    block_ends: int = parameter(0)  # blocks + 1, or 0
    kept: int = parameter(0)  # rank, or 0
    block_row: Table = array("block_ends", dtype=int)
    block_end: Table = array("blocks", dtype=int)
    row_first: Table = array("rows", dtype=int)  # first column that a row reaches
    row_size: Array = array("rows")
    row_applied: Table = array("rows", dtype=int)
    row_filled: Table = array("rows", 2, dtype=int)  # columns of the factors that may not be zero
    reach: Table = array("rows", dtype=int)
    kept_tau: Array = array("kept")
    kept_reflectors: Array = array("kept", "n")
    kept_reach: Table = array("kept", dtype=int)

    # closing
    is_open: int = state(0)
    gap: float = state(0.0)  # largest residual
    squared: float = state(0.0)  # c^T c of the residual c
    mu: float = state(1.0)  # damping, as a multiple of it
    right: Array = array("rows")  # scratch
    part: Array = array("n")  # scratch

    # following the actuated joints
    jacobian_at_q: Array = array("rows", "n")
    determinant: Array = array("rows", "rows")  # scratch
    side: float = state(0.0)  # sign of a determinant at q

    # proving that its steps stay on their branch
    proved: int = parameter(0)  # n, or 0 where that is not asked for
    proof_width: int = parameter(0)  # n + rows, or 0
    passive: int = state(0)
    passive_dof: Table = array("proved", dtype=int)
    inverse: Array = array("proved", "rows")  # of the passive joints' columns, at q or near it
    normal: Array = array("proved", "proof_width")  # scratch
    error: float = state(math.inf)  # |1 - P J_p| of this inverse P at q; infinite if there is none
    error_at_end: float = state(0.0)
    tilt: float = state(0.0)  # |P J v| of the tangent v
    bend: float = state(0.0)  # bound of how the passive joints' velocities differ from the tangent in a proved step


cluster_at = view(ClusterMemory)


class LoopMemory(Memory):
    """A mechanism: its joints and loops, and the data for closing them.

    Attributes:
        has_pinocchio: its kernels run where Pinocchio is: they are not translated.
    """

    has_pinocchio: ClassVar[bool] = True

    # sizes
    nq: int = parameter(0)
    n: int = parameter(0)  # DoF that may move
    fixed: int = parameter(0)  # DoF of a fixed base: they come first in v, and do not count in n
    nv: int = parameter(0)  # fixed + n
    joints: int = parameter(0)
    loops: int = parameter(0)
    couplings: int = parameter(0)
    coupling_terms: int = parameter(0)  # of all couplings
    coupling_degree: int = parameter(0)  # highest power of a joint variable
    steps: int = parameter(0)  # of all loops
    coupled: int = parameter(0)  # nq if there are couplings, else 0
    rows: int = parameter(0)  # of all loops, and then of all couplings
    rank: int = parameter(0)  # of these rows: generic
    cut: int = parameter(0)  # DoF of the joints that were cut
    clusters: int = parameter(0)
    idle: int = parameter(0)  # DoF in no cluster
    actuated: int = parameter(0)
    length: float = parameter(1.0)  # characteristic length, m

    # joints; joint 0 is the world
    tree: Any = None  # keeps Pinocchio's model and data, which have the offsets, frames and screws: see `NativeTree`
    evaluate_address: int = parameter(0)  # of Pinocchio's function, or 0: kernels compute frames and screws themselves
    integrate_address: int = parameter(0)
    difference_address: int = parameter(0)
    model_address: int = parameter(0)
    data_address: int = parameter(0)
    vector: Table = array(3, VECTOR, dtype=int)  # arguments of these functions
    units: int = parameter(0)  # parts of q that are unit vectors
    unit: Table = array("units", 2, dtype=int)  # first number and size of each: 4 for a quaternion
    others: int = parameter(0)  # joints of kinds that only Pinocchio knows
    other: Table = array("others", 4, dtype=int)  # first number and size of each in q, and in the DoF
    full_q: Array = array("nq")  # scratch
    full_v: Array = array("nv")
    joint_kind: Table = array("joints", dtype=int)
    joint_parent: Table = array("joints", dtype=int)
    joint_q: Table = array("joints", dtype=int)  # its first number in q
    joint_dof: Table = array("joints", dtype=int)  # its first DoF; below 0 if it is fixed
    joint_axis: Array = array("joints", 3)
    joint_offset: Array = array("joints", 4, 3)  # its frame at zero, relative to its parent
    scale: Array = array("n")  # size of one dimensionless step, m or rad
    q_index: Table = array("n", dtype=int)  # index of a DoF in q; -1 if it is not one number of q

    # configurations
    q: Array = array("nq")  # closed
    trial: Array = array("nq")  # may become q
    candidate: Array = array("nq")  # may become the trial
    frames: Array = array("joints", 4, 3)  # of all joints in the world, at the last evaluation
    screws: Array = array("n", 6)  # of all DoF: velocity of the point at the world's origin, then angular velocity
    evaluations: int = state(0)

    # loops: the joints that were cut
    loop_kind: Table = array("loops", dtype=int)
    loop_joints: Table = array("loops", 2, dtype=int)  # the joints that carry its ends
    loop_offsets: Array = array("loops", 2, 4, 3)  # its ends, relative to these joints
    loop_row: Table = array("loops", dtype=int)  # its first row
    row_loop: Table = array("rows", dtype=int)  # the loop of each row, -1 of couplings
    loop_cut: Table = array("loops", dtype=int)  # its first column of `cut_rates`
    loop_steps: Table = array("loops", 2, dtype=int)  # range of its entries in the two lists below
    step_dof: Table = array("steps", dtype=int)  # DoF that move its ends relative to each other
    step_size: Array = array("steps")  # `scale` of a DoF that moves the second end, -`scale` if it moves the first
    # couplings: equations between joints
    term_coupling: Table = array("coupling_terms", dtype=int)
    term_dof: Table = array("coupling_terms", dtype=int)
    term_coefficients: Array = array("coupling_terms", "coupling_degree")  # of the first power, the second, ...
    coupling_constant: Array = array("couplings")
    coupled_q: Array = array("coupled")  # configuration of the last evaluation

    residual: Array = array("rows")
    jacobian: Array = array("rows", "n")
    cut_rates: Array = array("n", "cut")  # velocities of the joints that were cut, by each DoF, dimensionless

    # their screw matrix (`cinegen.loops.screws`), where it is needed
    screwed: int = parameter(0)  # loops, or 0 where it is not needed
    mixed: int = parameter(0)  # couplings, or 0 likewise
    screw_rows: int = parameter(0)
    screw_columns: int = parameter(0)  # n + cut
    screw_clusters: int = parameter(0)
    axis_points: int = parameter(0)
    screw_mix: Array = array("screwed", "screwed")
    coupling_mix: Array = array("mixed", "mixed")
    screw_cluster: Table = array("screwed", dtype=int)
    screw_length: Array = array("screw_clusters")
    screw_centre: Array = array("screw_clusters", 3)
    axis_joint: Table = array("axis_points", dtype=int)
    axis_cluster: Table = array("axis_points", dtype=int)
    axis_point: Array = array("axis_points", 3)
    axis_share: Array = array("axis_points")
    screw_matrix: Array = array("screw_rows", "screw_columns")

    # ball joints that are modelled as three revolute joints each, where they count as one
    balls: int = parameter(0)
    ball_dof: Table = array("balls", 3, dtype=int)

    # clusters of them, and their factors
    cluster_memories: Any = ()  # keeps what `cluster_handles` are the handles of
    cluster_handles: Table = array("clusters", dtype=int)
    idle_dof: Table = array("idle", dtype=int)
    locked: Array = array("n")  # not 0 for DoF that do not move while loops are closed
    is_singular: int = state(0)  # the factors of a cluster are singular vectors
    factored_at: int = state(0)  # configuration at which the loops are factored: see below
    factors_gap: float = state(math.inf)  # largest residual there
    sigma: float = state(1.0)  # the smallest singular value of the loops, or 1 where it is not small

    # closing them
    gap: float = state(0.0)  # largest residual
    closure: float = state(0.0)  # largest residual at q
    corrections: int = state(0)
    correction: Array = array("n")
    delta: Array = array("n")  # m and rad

    # following the actuated joints
    actuated_dof: Table = array("actuated", dtype=int)
    goal: Array = array("actuated")  # m and rad
    tolerance: float = parameter(0.0)  # loops are closed to this
    longest_stride: float = parameter(0.0)
    most_added: float = parameter(0.0)  # largest correction, as a fraction of the step
    proves: int = parameter(0)  # whether steps are to be proved to stay on their branch
    is_proved: int = state(0)  # all steps since q was set are
    limited: int = parameter(0)  # n where limits of passive joints are kept on the way, else 0
    lowest: Array = array("limited")  # limits, m and rad
    highest: Array = array("limited")
    beyond: int = state(0)  # 1 + DoF of the joint whose limit ends the motion, or 0
    halvings: int = state(0)
    part: float = state(0.0)  # present step, as a fraction of the remaining path
    tangent: Array = array("n")  # the remaining path, to first order
    alike: int = state(0)  # number of preceding equal whole steps, up to 2
    actuated_step: Array = array("actuated")  # in the last whole step
    curvature: Array = array("n")  # second-order term of this step, and of the two before
    curvature_1: Array = array("n")
    curvature_2: Array = array("n")

    # scratch
    ends: Array = array(2, 4, 3)
    vectors: Array = array(12, 3)


NOWHERE, AT_Q, AT_TRIAL = range(3)
"""Configuration at which the loops are factored: none, q or near it, the trial."""
