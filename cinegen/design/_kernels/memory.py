"""Memory of the kernel that evaluates a mechanism at other values of its parameters."""

from __future__ import annotations

from cinegen.jit.compiled import Array, Table
from cinegen.jit.memory import array, foreign, parameter
from cinegen.loops._kernels.memory import LoopMemory


class DesignMemory(LoopMemory):
    """A mechanism whose joints, ends of loops and nodes are placed by chains of elementary motions.

    A chain is a sequence of constant frames, and of rotations about and translations along an axis of the frame that
    the sequence has reached. Targets are all joints but the world, both ends of each loop, then the nodes.
    """

    motions: int = parameter(0)  # elementary motions whose values may change
    steps_of_chains: int = parameter(0)
    targets: int = parameter(0)
    target_ends: int = parameter(1)  # targets + 1
    constants: int = parameter(0)
    outputs: int = parameter(0)  # nodes whose poses are returned

    chain_first: Table = array("target_ends", dtype=int)
    step_kind: Table = array("steps_of_chains", dtype=int)
    step_index: Table = array("steps_of_chains", dtype=int)  # of a motion, or of a constant frame
    step_records: Table = array("steps_of_chains", dtype=int)  # 1: the first occurrence of a motion
    constant: Array = array("constants", 4, 3)
    target_frame: Array = array("targets", 4, 3)  # relative to the joint that carries it
    node_joint: Table = array("outputs", dtype=int)
    motion_joint: Table = array("motions", dtype=int)  # that carries its axis
    motion_slides: Table = array("motions", dtype=int)
    motion_axis: Array = array("motions", 3)  # on that joint
    motion_origin: Array = array("motions", 3)

    # input
    count: int = parameter(0)
    detailed: int = parameter(0)  # count if derivatives are wanted, else 0
    is_exact: int = parameter(1)  # see `cinegen.loops._kernels.closure.factor_loops`
    most: int = parameter(100)  # corrections
    values: Array = foreign("count", "motions")
    starts: Array = foreign("count", "nq")

    # results
    result_q: Array = foreign("count", "nq")
    gaps: Array = foreign("count")
    poses: Array = foreign("count", "outputs", 4, 3)
    all_screws: Array = foreign("detailed", "n", 6)
    all_frames: Array = foreign("detailed", "joints", 4, 3)
    motion_screws: Array = foreign("detailed", "motions", 6)
    jacobians: Array = foreign("detailed", "rows", "n")
    maps: Array = foreign("detailed", "rows", 6)  # from a relative twist of a loop's ends in the world to its rows

    # scratch
    moved: Array = array(4, 3)
