"""Memory of the kernels that see what is near."""

from __future__ import annotations

from cinegen.jit.compiled import Array, Table
from cinegen.jit.foreign import RESULT_WIDTH
from cinegen.jit.memory import Memory, array, foreign, parameter


class ClearanceMemory(Memory):
    """A mechanism's links among obstacles. Frames are (4, 3): see `cinegen.jit.se3`."""

    nv: int = parameter(0)
    joints: int = parameter(0)
    bodies: int = parameter(0)
    pairs: int = parameter(0)
    most: int = parameter(0)  # rows, if all pairs are near

    pair: Table = array("pairs", 2, dtype=int)  # numbers of bodies
    joint: Table = array("bodies", dtype=int)  # that a body moves with
    ends: Array = array("bodies", 2, 3)  # centres of a capsule's ends, seen from its joint
    radius: Array = array("bodies")  # of capsules, m; below 0 for others
    ball: Array = array("bodies", 4)  # centre, seen from the joint, and radius of a ball that holds a body
    moved_by: Array = array("joints", "nv")  # 1 where a column moves a joint

    results: Array = foreign("pairs", RESULT_WIDTH)  # Coal's
    frames: Array = foreign("joints", 4, 3)  # of the joints, Pinocchio's
    screws: Array = foreign("nv", 6)  # Jacobian of all joints, Pinocchio's

    # what is near
    which: Table = array("most", dtype=int)  # the pair of each row; rows of a pair follow each other
    room: Array = array("most")  # distance of each row, m
    rows: Array = array("most", "nv")  # by how much each column shortens it

    # all along a motion
    motion: Array = array("nv")  # rad and m
    before: Array = array("pairs")  # distances, m
    bounds: Array = array("pairs")  # of how much a motion can shorten them, m

    vectors: Array = array(3, 3)  # scratch
