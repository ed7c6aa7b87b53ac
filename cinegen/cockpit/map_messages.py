"""Messages about a map that the page shows."""

from __future__ import annotations

from msgspec import Struct


class AxisShown(Struct, frozen=True):
    """A coordinate of the map, as it is drawn.

    Attributes:
        name: name of the coordinate.
        unit: m or rad.
        low: center of the first cell, m or rad.
        step: distance of two cells, m or rad.
        count: number of cells.
        every: cells of the map per cell that is drawn.
        translates: whether the coordinate moves the node; otherwise it rotates it.
    """

    name: str
    unit: str
    low: float
    step: float
    count: int
    every: int
    translates: bool


class QuantityShown(Struct, frozen=True):
    """A quantity of the map.

    Attributes:
        name: name of the quantity.
        unit: unit; "1" if it is dimensionless.
        text: description for people.
        low: value at the start of the colours; there may be smaller ones.
        high: value at their end.
        least: smallest value that is drawn; None if no cell has a value.
        most: largest value that is drawn.
    """

    name: str
    unit: str
    text: str
    low: float
    high: float
    least: float | None
    most: float | None


class ArrayDescription(Struct, frozen=True):
    """An array of a map.

    Attributes:
        at: offset in the arrays, bytes.
        count: number of its elements, of four bytes each, the lowest first.
        integer: whether they are unsigned integers; otherwise they are floats.
    """

    at: int
    count: int
    integer: bool


class MapDescription(Struct, frozen=True):
    """A map that is drawn with its robot.

    Attributes:
        robot: robot in whose world the map is.
        node: node whose poses it covers.
        axes: its coordinates.
        quantities: its quantities.
        quantity: quantity that colours the cells initially, or null.
        size: distance of two cells (m).
        surface: whether cells are tiles of a surface; otherwise they are balls.
        shown: number of cells that are drawn.
        done: number of cells that are evaluated.
        cells: number of cells.
        arrays: arrays by name.
    """

    robot: str
    node: str
    axes: tuple[AxisShown, ...]
    quantities: tuple[QuantityShown, ...]
    quantity: str | None
    size: float
    surface: bool
    shown: int
    done: int
    cells: int
    arrays: dict[str, ArrayDescription]


class MapCell(Struct, frozen=True):
    """A cell of a map, as `move_to` takes it.

    Attributes:
        robot: robot of the map.
        node: node of the map.
        q: (nq,) configuration, rad and m.
    """

    robot: str
    node: str
    q: list[float]
