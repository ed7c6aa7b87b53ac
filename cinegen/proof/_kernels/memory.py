"""Memory of the kernels of a proof: closures, boxes, and what is evaluated over them."""

from __future__ import annotations

from cinegen.jit.compiled import Array, Table
from cinegen.jit.memory import Memory, array, foreign, parameter

SLIDES, TURNS, TURNS_OFFSET = range(3)
"""Kinds of slots: a translation along z; a rotation about z; a translation that is rotated about z."""

NO_RATES, SLIDE_RATE, TURN_RATES, PLACEMENT = range(4)
"""What a closure yields besides equations, and its rows: nothing; one rate; three; twelve numbers, E."""


class BoxMemory(Memory):
    """The closures of a document, dimensionless but for lengths, and boxes."""

    closures: int = parameter(0)
    slots: int = parameter(0)
    longest: int = parameter(0)  # of slots of a chain
    ends: int = parameter(0)  # longest + 1
    columns: int = parameter(0)
    rows: int = parameter(0)
    parameters: int = parameter(0)
    sums: int = parameter(0)  # parameters + 2
    over: int = parameter(0)  # the first of the parameters: eps
    pairs: int = parameter(0)  # products of eps among the parameters
    length: float = parameter(1.0)
    unsure: float = parameter(1.0 / 3.0)  # part of the radii of third derivatives; 1 if those at the centre have some
    chain: Table = array("closures", 3, dtype=int)  # first slot of both chains, and the end of the second
    linear: Table = array("closures", dtype=int)  # number of constrained translations
    turns: Table = array("closures", dtype=int)  # ... and rotations
    rates: Table = array("closures", dtype=int)  # which
    row: Table = array("closures", dtype=int)  # the first
    kind: Table = array("slots", dtype=int)
    virtual: Table = array("slots", dtype=int)  # whether all of their variables are
    before: Array = array("slots", 2, 4, 4)
    offset: Array = array("slots", 2, 4, 4)
    end: Array = array("closures", 2, 2, 4, 4)  # of both chains
    by_slot: Array = array("slots", "columns")  # the slots' values by the columns

    count: int = parameter(0)  # of boxes
    order: int = parameter(0)  # of derivatives
    q: Array = foreign("count", "slots")  # values of the slots
    along: Array = foreign("count", "slots", "parameters")  # their change by eps
    away: Array = foreign("count", "slots")  # radius about that
    residual: Array = foreign("count", 2, "rows")
    jacobian: Array = foreign("count", 2, "rows", "columns")
    by: Array = foreign("count", "parameters", "rows", "columns")  # G
    bent: Array = foreign("count", "rows", "columns")  # R_1
    apart: Array = foreign("count", "rows", "columns")  # R_2, by the distance from X(eps)
    sharper: Array = foreign("count", "pairs", "rows", "columns")  # T, of the third derivatives

    power: Array = array("longest", 4, 2, 4, 4)  # factors of a chain with their derivatives
    after: Array = array("ends", 2, 4, 4)
    at: Array = array(2, 2, 4, 4)  # both ends
    first: Array = array(2, "longest", 2, 4, 4)
    second: Array = array(2, "longest", "longest", 2, 4, 4)
    axis: Array = array(2, "longest", 2, 3)
    scratch: Array = array(6, 2, 4, 4)
    column: Array = array(2, 2, 4)
    values: Array = array(2, 12)  # of a closure's rows
    part: Array = array("slots", 12, "sums")  # of a slot: rows by parameters, then bent, then apart
