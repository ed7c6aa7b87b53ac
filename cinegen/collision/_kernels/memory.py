"""Memory of the kernels of distances."""

from __future__ import annotations

from cinegen.jit.compiled import Array, Table
from cinegen.jit.foreign import RESULT_WIDTH
from cinegen.jit.memory import Memory, array, foreign, parameter


class ClearanceMemory(Memory):
    """A mechanism's links among obstacles. Frames are (4, 3): see `cinegen.jit.se3`."""

    nv: int = parameter(0)
    columns: int = parameter(0)  # nv + 1
    joints: int = parameter(0)
    bodies: int = parameter(0)
    pairs: int = parameter(0)
    corners: int = parameter(0)
    most: int = parameter(0)  # rows, if all pairs are near

    pair: Table = array("pairs", 2, dtype=int)  # indices of bodies
    joint: Table = array("bodies", dtype=int)  # joint that a body moves with
    ends: Array = array("bodies", 2, 3)  # centres of a capsule's ends, relative to its joint
    radius: Array = array("bodies")  # of capsules, m; below 0 for others
    box: Array = array("bodies", 5, 3)  # axes, centre and half of the size of a bounding box, relative to the joint
    ball: Array = array("bodies")  # radius of a bounding sphere about the same centre, m
    corner: Array = array(
        "corners", 3
    )  # of all bodies, in their boxes: their hull, grown by `rounding`, contains a body
    hull: Table = array("bodies", 2, dtype=int)  # a body's first corner, and that behind its last; none of a half-space
    rounding: Array = array("bodies")  # m
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
    motion: Array = array("nv")  # largest motion of each column, rad and m
    straight: Array = array("nv")  # the part of it that is straight, to both sides, rad and m; 0 of others
    before: Array = array("pairs")  # distances, m
    bounds: Array = array("pairs")  # of the change along the motion, m

    asked: Table = array("pairs", dtype=int)  # pairs that kernels are asked about; those that remain
    needed: Array = array("pairs")  # distances that `advance` is asked about, m
    lower: Array = array("pairs")  # lower bounds of the distances of those that remain, m

    # last measurements
    known: Array = array("pairs")  # distance, or a lower bound of it, m
    seen: Array = array("pairs", 4, 3)  # box of the smaller body in that of the other, when that was measured
    normal: Array = array("pairs", 3)  # unit normal from the first to the second, in the box of the first; or 0

    placed: Array = array("bodies", 4, 3)  # axes and centres of the boxes in the world
    swept: Array = array("bodies")  # bounds of the motion of bodies along `motion`, m
    tilts: Array = array("columns", 4)  # scratch: how `motion` moves points along a normal
    vectors: Array = array(4, 3)  # scratch
