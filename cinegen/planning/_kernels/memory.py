"""Memory of the compiled vortex field."""

from __future__ import annotations

from cinegen.jit.compiled import Array, Table
from cinegen.jit.memory import Memory, array, parameter


class VortexMemory(Memory):
    """The vortices around what a mechanism's links may meet."""

    nv: int = parameter(0)
    pairs: int = parameter(0)
    vortices: int = parameter(0)
    free: int = parameter(0)  # motions that keep loops closed; none where there are no loops
    reach: float = parameter(0.0)  # distance at which vortices start to act, m
    stop: float = parameter(0.0)  # distance at which links are stopped, m
    strength: float = parameter(0.0)  # relative to the attraction at the same point

    vortex: Table = array("pairs", dtype=int)  # of each pair
    states: Array = array("vortices", 4)  # whether each is active, and its axis
    scale: Array = array("nv")  # rad or m of a dimensionless unit of motion
    null_space: Array = array("free", "nv")  # orthonormal dimensionless motions that keep loops closed
    motion: Array = array("nv")  # undeflected, rad and m

    deflected: Array = array("nv")  # the motion with all vortices
    candidates: Table = array("vortices", dtype=int)  # nearest pair that moves toward what an inactive one surrounds
    jacobian: Array = array(3, "nv")  # scratch
    vectors: Array = array(3, 3)  # scratch
