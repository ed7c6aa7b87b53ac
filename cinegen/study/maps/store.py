"""`Store`: a map on disk, written piece by piece: a zarr group that xarray opens as a `Dataset`.

Of a piece `settled` is written last: where its chunk is there, all of the piece is, and is never computed again. Each
chunk is a file of its own that is written beside and then renamed, so that none is ever half there.
"""

from __future__ import annotations

import fcntl
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import cinegen.study.maps.quantities as known
from cinegen.study.maps.errors import MapError
from cinegen.study.maps.region import piece, pieces
from cinegen.study.maps.settled import How
from cinegen.study.maps.survey import VERSION, Survey

if TYPE_CHECKING:
    import zarr

_KIND = "cinegen map"

Values = np.ndarray[Any, np.dtype[Any]]


class Store:
    """A map's folder.

    Attributes:
        path: where it is.
        survey: what it shows.
        chunks: cells along each axis of a piece.

    Raises:
        MapError: there is something else, or it can't be read.
    """

    def __init__(self, path: str | Path, folder: str = ".") -> None:
        self.path = Path(path)
        self._group = _opened(self.path)
        attributes: dict[str, Any] = dict(self._group.attrs)
        if attributes.get("kind") != _KIND:
            raise MapError(f"{self.path} is a zarr group, but no map of cinegen's")
        try:
            self.text = str(attributes["survey"])
            self.survey = Survey.of_document(json.loads(self.text), str(attributes.get("folder", folder)))
            self.chunks = tuple(int(width) for width in attributes["chunks"])
        except MapError as error:
            raise MapError(f"{self.path}: {error}") from None
        except (KeyError, ValueError, TypeError, RecursionError) as error:
            raise MapError(f"{self.path} is damaged: its description can't be read ({error})") from None
        missing = [name for name in self.names if name not in self._group]
        if missing:
            raise MapError(f"{self.path} is damaged: it lacks {', '.join(missing)}")

    @property
    def names(self) -> tuple[str, ...]:
        """Of what is written of each piece, in this order."""
        return (*self.survey.quantities, "configuration", "reachable", "settled")

    @property
    def pieces(self) -> int:
        """How many there are."""
        shape = self.survey.region.shape
        return math.prod(-(-count // width) for count, width in zip(shape, self.chunks, strict=True))

    def left(self) -> Iterator[tuple[int, ...]]:
        """Pieces that are not written yet, one after the other."""
        for index in pieces(self.survey.region.shape, self.chunks):
            if not self.is_done(index):
                yield index

    def is_done(self, index: Sequence[int]) -> bool:
        """Whether a piece is written."""
        return (self.path / "settled" / "c" / "/".join(map(str, index))).exists()

    def cells(self, index: Sequence[int]) -> tuple[slice, ...]:
        """Of a piece."""
        return piece(index, self.survey.region.shape, self.chunks)

    def write(self, index: Sequence[int], values: Mapping[str, Values]) -> None:
        """Writes a piece: for each name (n, ...) of its cells, the last axis fastest.

        Raises:
            MapError: it can't be written: what is there already stays.
        """
        cells = self.cells(index)
        shape = [len(range(*s.indices(s.stop))) for s in cells]
        try:
            for name in self.names:
                array = values[name]
                self._group[name][cells] = array.reshape(*shape, *array.shape[1:])  # type: ignore[index]
        except OSError as error:
            raise MapError(
                f"{self.path}: can't be written: {error.strerror}. What was finished stays: make room, and give the "
                "same command again"
            ) from None


def create(path: Path, survey: Survey, chunks: Sequence[int]) -> Store:
    """A new map, with nothing in it yet: it appears all at once.

    Raises:
        MapError: it can't be written.
    """
    import shutil

    fresh = path.with_name(f".{path.name}.new")
    try:
        shutil.rmtree(fresh, ignore_errors=True)
        fresh.parent.mkdir(parents=True, exist_ok=True)
        _fill(fresh, survey, chunks)
        fresh.rename(path)
    except OSError as error:
        shutil.rmtree(fresh, ignore_errors=True)
        raise MapError(f"{path}: can't be written: {error.strerror}") from None
    return Store(path)


def _fill(path: Path, survey: Survey, chunks: Sequence[int]) -> None:
    import zarr

    mechanism, region = survey.mechanism, survey.region
    group = zarr.create_group(path, attributes={
        "kind": _KIND,
        "title": f"{mechanism.name} over {', '.join(region.names)}",
        "robot": mechanism.name,
        "robot_sha256": survey.robot_hash,
        "node": survey.node,
        "characteristic_length_m": mechanism.length,
        "counted": f"{survey.counted[0]} translations, {survey.counted[1]} rotations of {survey.node}",
        "version": VERSION,
        "chunks": list(chunks),
        "folder": survey.folder,
        "survey": survey.text,
    })  # fmt: skip
    for axis in region.axes:
        group.create_array(
            axis.name, data=axis.middles(), chunks=(axis.count,), dimension_names=(axis.name,),
            attributes={"units": _unit(survey, axis.name), "cell_width": axis.width},
        )  # fmt: skip

    def put(name: str, dtype: str, fill: Any, attributes: dict[str, Any], more: tuple[int, ...] = ()) -> None:
        group.create_array(
            name, shape=(*region.shape, *more), chunks=(*chunks, *more), dtype=dtype, fill_value=fill,
            dimension_names=(*region.names, *("joint",) * len(more)), attributes=attributes,
        )  # fmt: skip

    for name in survey.quantities:
        quantity = known.QUANTITIES[name]
        fill = 0 if quantity.dtype.startswith("int") else math.nan
        put(name, quantity.dtype, fill, {"units": quantity.unit, "long_name": quantity.words})
    joints = _numbers(survey)
    put("configuration", "float64", math.nan, {
        "units": "rad or m", "long_name": "a configuration, loops closed", "joints": joints,
    }, (mechanism.model.nq,))  # fmt: skip
    put("reachable", "bool", False, {"units": "1", "long_name": "whether there is a configuration"})
    put("settled", "uint8", 0, {
        "units": "1", "long_name": "how the cell was settled",
        "flag_values": [int(how) for how in How], "flag_meanings": " ".join(how.name.lower() for how in How),
    })  # fmt: skip


def _numbers(survey: Survey) -> list[str]:
    """A name for each number of a configuration."""
    names = [""] * survey.mechanism.model.nq
    for name, joint in zip(survey.mechanism.model.names, survey.mechanism.model.joints, strict=True):
        for k in range(joint.nq if name != "universe" else 0):
            names[joint.idx_q + k] = name if joint.nq == 1 else f"{name}.{k}"
    return names


def _unit(survey: Survey, name: str) -> str:
    mechanism = survey.mechanism
    long = mechanism.slides(name) if name in mechanism.joints else name in ("x", "y", "z", "radius", "way")
    return "m" if long else "rad"


def _opened(path: Path) -> zarr.Group:
    import zarr

    try:
        return zarr.open_group(path, mode="r+")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise MapError(f"{path} is no zarr group that can be read: {error}") from None


class Lock:
    """Holds a map while it is made: two at once would do all work twice."""

    def __init__(self, path: Path) -> None:
        self._path, self._file = path, (path / "zarr.json").open("rb")

    def __enter__(self) -> Lock:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._file.close()
            raise MapError(f"{self._path} is being made by another process: wait for it") from None
        except OSError:  # a file system without locks
            pass
        for left in self._path.glob("**/*.partial"):  # of a process that was killed
            left.unlink(missing_ok=True)
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()
