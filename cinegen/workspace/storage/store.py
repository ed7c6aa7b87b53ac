"""`Store`: a map on disk, written piece by piece: a zarr group that xarray opens as a `Dataset`.

Of a piece `settled` is written last: where its chunk is there, all of the piece is. Each chunk is a file of its own,
whole or not there at all (`chunk`); what is not whole yet stands in a folder beside the map, and is swept away.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import product
from operator import lt, mul
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cinegen.workspace.errors import MapError
from cinegen.workspace.region import piece
from cinegen.workspace.specification import MapSpecification
from cinegen.workspace.storage.chunk import is_sound, packed, put
from cinegen.workspace.storage.layout import KIND, LAST, Layout, coordinates, file_name, index_of, lay_out, layouts
from cinegen.workspace.storage.lock import locked

Values = np.ndarray[Any, np.dtype[Any]]
Index = tuple[int, ...]


class Store:
    """A map's folder.

    Attributes:
        path: where it is.
        specification: what it shows.
        text: of the specification.
        chunks: cells along each axis of a piece.

    Raises:
        MapError: there is something else, or it can't be read.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        attributes = _attributes(self.path)
        try:
            self.text = str(attributes["specification"])
            self.spec = MapSpecification.of_attributes(attributes)
            self.chunks = tuple(int(width) for width in attributes["chunks"])
        except MapError as error:
            raise MapError(f"{self.path}: {error}") from None
        except (KeyError, ValueError, TypeError, RecursionError) as error:
            raise MapError(f"{self.path} is damaged: its description can't be read ({error}). {_ELSE}") from None
        self._check()

    def _check(self) -> None:
        """Whether all arrays are there."""
        region = self.spec.region
        if len(self.chunks) != len(region.shape) or min(self.chunks) < 1:
            raise MapError(f"{self.path} is damaged: pieces of {self.chunks} cells. {_ELSE}")
        forms: list[tuple[Layout, tuple[str, ...], Index, Index]] = [
            (array, region.names, region.shape, self.chunks) for array in self.layouts
        ]
        for array, axis in zip(coordinates(self.spec), region.axes, strict=True):
            forms.append((array, (axis.name,), (axis.count,), (axis.count,)))
        for array, names, shape, chunks in forms:
            document = _document(self.path / array.name)
            try:
                right = array.fits(document, names, shape, chunks)
            except (KeyError, TypeError, AttributeError, IndexError):
                right = False
            if not right:
                raise MapError(f"{self.path} is damaged: {array.name} is not there, or is something else. {_ELSE}")
        for axis in region.axes:
            if not is_sound(_read(self.path / axis.name / file_name((0,)))):
                raise MapError(f"{self.path} is damaged: values of {axis.name} are not there, or broken. {_ELSE}")

    @cached_property
    def layouts(self) -> tuple[Layout, ...]:
        """Of what is written of each piece, in this order."""
        return layouts(self.spec)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the specification's text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def beside(self) -> Path:
        """Where files stand that are not whole yet."""
        return beside(self.path)

    @property
    def pieces(self) -> int:
        """How many there are."""
        return math.prod(self._counts)

    @property
    def _counts(self) -> tuple[int, ...]:
        return tuple(-(-n // width) for n, width in zip(self.spec.region.shape, self.chunks, strict=True))

    def look(self) -> Iterator[tuple[Index, bool]]:
        """All pieces, the last axis fastest, and whether each is written; one after the other, for there may be many.
        The folder is listed: that is quicker than to ask for each file."""
        written = iter(self._written())
        number = next(written, -1)
        for k, index in enumerate(product(*map(range, self._counts))):
            there = k == number
            yield index, there
            if there:
                number = next(written, -1)

    def _written(self) -> NDArray[np.int64]:
        """Numbers of the pieces that are written, in order."""
        counts = self._counts
        strides = [math.prod(counts[axis + 1 :]) for axis in range(len(counts))]
        found = (index_of(name) or () for name in os.listdir(self.path / LAST))
        ours = (index for index in found if len(index) == len(counts) and all(map(lt, index, counts)))
        return np.sort(np.fromiter((sum(map(mul, index, strides)) for index in ours), np.int64))

    @property
    def done(self) -> int:
        """Cells of all pieces that are written."""
        return sum(self.size(index) for index, written in self.look() if written)

    def is_done(self, index: Index) -> bool:
        """Whether a piece is written."""
        return self._file(self.layouts[-1], index).exists()

    def is_sound(self, index: Index) -> bool:
        """Whether all files of a piece are there, and as they were written."""
        return all(is_sound(_read(self._file(array, index))) for array in self.layouts)

    def forget(self, index: Index) -> None:
        """Has a piece made again.

        Raises:
            MapError: the map can't be written.
        """
        try:
            self._file(self.layouts[-1], index).unlink(missing_ok=True)
        except OSError as error:
            raise unwritten(self.path, error) from None

    def cells(self, index: Index) -> tuple[slice, ...]:
        """Of a piece."""
        return piece(index, self.spec.region.shape, self.chunks)

    def size(self, index: Index) -> int:
        """Cells of a piece."""
        return math.prod(part.stop - part.start for part in self.cells(index))

    def write(self, index: Index, values: Mapping[str, Values]) -> None:
        """Writes a piece: for each name (n, ...) of its cells, the last axis fastest.

        Raises:
            MapError: it can't be written: what is there already stays.
        """
        shape = [part.stop - part.start for part in self.cells(index)]
        try:
            for array in self.layouts:
                found = np.asarray(values[array.name], dtype=array.dtype).reshape(*shape, *array.more)
                data = packed(found, (*self.chunks, *array.more), array.fill)
                put(self._file(array, index), data, self.beside)
        except OSError as error:
            raise unwritten(self.path, error) from None

    def _file(self, array: Layout, index: Index) -> Path:
        return self.path / array.name / file_name((*index, *(0 for _ in array.more)))


def begin(path: Path, spec: MapSpecification, chunks: Sequence[int]) -> Store:
    """The map at a path; a new one, with nothing in it yet, where there is none: it appears all at once.

    Raises:
        MapError: there is something else, or it can't be written.
    """
    try:
        if not os.path.lexists(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            with locked(path.parent, wait=True):  # two that begin at once begin one map
                if not os.path.lexists(path):
                    sweep(path)
                    lay_out(beside(path), spec, chunks)
                    beside(path).rename(path)
    except OSError as error:
        sweep(path)
        raise unwritten(path, error) from None
    return Store(path)


def sweep(path: Path) -> None:
    """Removes what processes that were killed have left beside a map."""
    shutil.rmtree(beside(path), ignore_errors=True)


def beside(path: Path) -> Path:
    """Where what is not whole yet of a map stands."""
    whole = path.resolve()  # of a link what it leads to: both must be on one file system
    return whole.with_name(f".{whole.name}.new")


def unwritten(path: Path, error: OSError) -> MapError:
    """What is said of a map that can't be written."""
    why = error.strerror or str(error)
    return MapError(
        f"{path} can't be written: {why}. What was finished stays: put that right, and give the same command again"
    )


_ELSE = "Give another path, or delete it"


def _attributes(path: Path) -> dict[str, Any]:
    if not path.exists():
        raise MapError(f"there is no map at {path}")
    if not path.is_dir():
        raise MapError(f"{path} is a file, and no map: maps are folders. Give another path")
    document = _document(path)
    attributes = document.get("attributes")
    if document.get("node_type") != "group" or not isinstance(attributes, dict):
        raise MapError(f"{path} is no zarr group that can be read, so no map. Give another path")
    if attributes.get("kind") != KIND:
        raise MapError(f"{path} is a zarr group, but no map of cinegen's. Give another path")
    return attributes


def _document(path: Path) -> dict[str, Any]:
    """Of a group or an array; nothing where it can't be read."""
    try:
        document = json.loads((path / "zarr.json").read_bytes())
    except PermissionError as error:
        raise MapError(f"{path} can't be read: {error.strerror}") from None
    except (OSError, ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}


def _read(path: Path) -> bytes:
    """A file's bytes; none where there is no file."""
    try:
        return path.read_bytes()
    except FileNotFoundError:
        return b""
    except OSError as error:  # the disk is failing, or it may not be read
        raise MapError(f"{path} can't be read: {error.strerror}") from None
