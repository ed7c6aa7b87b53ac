"""Memory of the kernels of distances."""

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

    pair: Table = array("pairs", 2, dtype=int)  # indices of bodies
    joint: Table = array("bodies", dtype=int)  # joint that a body moves with
    ends: Array = array("bodies", 2, 3)  # centres of a capsule's ends, relative to its joint
    radius: Array = array("bodies")  # of capsules, m; below 0 for others
    ball: Array = array("bodies", 4)  # centre, relative to the joint, and radius of a bounding sphere
    box: Array = array("bodies", 5, 3)  # axes, centre and half of the size of a bounding box, relative to the joint
    moved_by: Array = array("joints", "nv")  # 1 for columns that move a joint

    results: Array = foreign("pairs", RESULT_WIDTH)  # Coal's
    excess: Array = array("pairs")  # of the distances over those of the convex bodies, m
    frames: Array = foreign("joints", 4, 3)  # of the joints, Pinocchio's
    screws: Array = foreign("nv", 6)  # Jacobian of all joints, Pinocchio's

    # near pairs
    which: Table = array("most", dtype=int)  # the pair of each row; rows of a pair follow each other
    room: Array = array("most")  # distance of each row, m
    rows: Array = array("most", "nv")  # rate at which each column shortens it

    # along a motion
    motion: Array = array("nv")  # rad and m
    before: Array = array("pairs")  # distances, m
    bounds: Array = array("pairs")  # of the change along the motion, m

    asked: Table = array("pairs", dtype=int)  # pairs that `advance` is asked about; those that remain

    vectors: Array = array(3, 3)  # scratch
