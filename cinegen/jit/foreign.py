"""Memory of other libraries, read in place: only this module depends on its layout.

Documented access is used where there is any: Pinocchio's matrices are numpy arrays over its own memory. Every layout is
checked before it is used, with the installed builds of Pinocchio and Coal; if the check fails, numbers are copied.

    target of a task    the numbers of a copied SE3 are at a fixed distance from its Python object: `SE3_DISTANCE`
    joint placements    `data.oMi` and `model.jointPlacements` are contiguous: `frames_in_place`
    distances           `GeometryData.distanceResults` is contiguous: `DistanceResults`
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pinocchio as pin
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from cinegen.arrays import Array
from cinegen.jit.memory import array_at


def frame_of(placement: pin.SE3) -> Array:
    """Return a placement as a frame (4, 3): three axes, then the origin."""
    return np.vstack([placement.rotation.T, placement.translation])


def address(array: Array) -> int:
    """Return the address of an array's first number."""
    return int(array.__array_interface__["data"][0])


@intrinsic  # type: ignore[untyped-decorator]
def frame_at(_typing: Any, _address: Any) -> Any:
    """For kernels: the frame (4, 3) at an address."""
    kind = types.Array(types.float64, 2, "C")

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return array_at(context, builder, kind, arguments[0], [ir.Constant(ir.IntType(64), size) for size in (4, 3)])

    return kind(types.int64), generate


frame_at.in_python = lambda begin: numbers_at(begin, (4, 3))


# --- SE3 --------------------------------------------------------------------------------------------------------------


def _distance() -> int | None:
    """Return the distance in bytes of a copied SE3's numbers from its Python object; None unless it is the same for
    every copy, and the 12 numbers there are those of the frame."""
    placement = pin.SE3.Random()
    copies = [placement.copy() for _ in range(8)]
    distances = {address(copied.rotation) - id(copied) for copied in copies}
    if len(distances) != 1:
        return None
    distance = distances.pop()
    numbers = [(ctypes.c_double * 12).from_address(id(copied) + distance) for copied in copies]
    same = all(np.array_equal(np.reshape(each, (4, 3)), frame_of(placement)) for each in numbers)
    return distance if same and 0 < distance < 1024 else None


SE3_DISTANCE = _distance()
"""Bytes from the Python object that `SE3.copy` returns to its frame; None if unknown."""


# --- Pinocchio's data -------------------------------------------------------------------------------------------------


def frames_in_place(placements: Any) -> Array | None:
    """Return the frames (count, 4, 3) of Pinocchio's list of placements, its own memory; None if it is laid out
    differently."""
    begin, last = address(placements[0].rotation), len(placements) - 1
    is_known = all(
        address(placements[j].rotation) == begin + 96 * j
        and address(placements[j].translation) == begin + 96 * j + 72
        and placements[j].rotation.strides == (8, 24)
        for j in (0, last)
    )
    return numbers_at(begin, (last + 1, 4, 3)) if is_known else None


class JointKinematics:
    """Frames and screws of all joints, in place in Pinocchio's data or copied.

    Args:
        data: of a model.

    Attributes:
        frames: (joints, 4, 3); up to date after `read`.
        screws: (nv, 6) the columns of `data.J`; up to date after `read`.
        frames_in_place: the frames are Pinocchio's own memory.
        screws_in_place: the screws are.
    """

    def __init__(self, data: pin.Data) -> None:
        self._data, self._placements = data, data.oMi
        frames = frames_in_place(self._placements)
        self.frames_in_place = frames is not None
        self.frames = np.zeros((len(self._placements), 4, 3)) if frames is None else frames
        screws, again = self._read_screws(), self._read_screws()  # a copy would be another one each time
        self.screws_in_place = not screws.size or (address(screws) == address(again) and screws.flags.c_contiguous)
        self.screws = screws if self.screws_in_place else np.array(screws, order="C")

    def _read_screws(self) -> Array:
        jacobian = np.asarray(self._data.J)
        return jacobian.reshape(6, jacobian.size // 6).T  # one column has one dimension

    def read(self) -> None:
        """Copy what Pinocchio has computed, if it can't be read in place."""
        if not self.frames_in_place:
            self.frames[:] = [frame_of(placement) for placement in self._placements]
        if not self.screws_in_place:
            self.screws[:] = self._read_screws()


def numbers_at(begin: int, shape: tuple[int, ...]) -> Array:
    """Return an array over memory that begins at an address."""
    return np.ctypeslib.as_array(ctypes.cast(begin, ctypes.POINTER(ctypes.c_double)), shape)


# --- Coal's results ---------------------------------------------------------------------------------------------------

DISTANCE, NORMAL, FIRST_POINT, SECOND_POINT, RESULT_WIDTH = 0, 1, 4, 7, 20
"""Offsets of a pair's result in Coal's memory, in doubles from its distance; and the offset of the next pair."""


class DistanceResults:
    """Coal's results as one array.

    Args:
        shapes: Pinocchio's data of a geometry model.

    Attributes:
        shapes: as given.
        table: (pairs, RESULT_WIDTH); up to date after `read`.
        is_in_place: it is Coal's own memory; checked with the first results.
    """

    def __init__(self, shapes: pin.GeometryData) -> None:
        self.shapes, self._results = shapes, shapes.distanceResults
        self.is_in_place = self._is_known = False
        self.table = np.zeros((len(self._results), RESULT_WIDTH))

    def read(self) -> None:
        """Copy what Coal has computed, if it can't be read in place."""
        if self.is_in_place:
            return
        for row, result in zip(self.table, self._results, strict=True):
            row[DISTANCE], row[NORMAL : NORMAL + 3] = result.min_distance, result.normal
            row[FIRST_POINT : FIRST_POINT + 3] = result.getNearestPoint1()
            row[SECOND_POINT : SECOND_POINT + 3] = result.getNearestPoint2()
        if not self._is_known and len(self.table):
            self._is_known = True
            self._look()

    def _look(self) -> None:
        """Read in place from now on, if memory has the numbers that were copied."""
        begin = [address(result.normal) - 8 * NORMAL for result in self._results]
        if begin == list(range(begin[0], begin[0] + 8 * RESULT_WIDTH * len(begin), 8 * RESULT_WIDTH)):
            table, used = numbers_at(begin[0], self.table.shape), SECOND_POINT + 3
            if np.array_equal(table[:, :used], self.table[:, :used]):
                self.table, self.is_in_place = table, True
