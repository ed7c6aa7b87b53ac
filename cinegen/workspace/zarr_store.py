"""Maps on disk: zarr groups that xarray opens as a `Dataset`, written chunk by chunk.

zarr writes each chunk of an array to a file of its own, compressed and with a CRC-32C: first to a temporary file, which
it renames, so that a file is complete or absent. `status` is the last array that is written: a chunk of the map is
complete where its file exists. Nothing waits for the disk (fsync): written data outlive the process, and after a power
failure the checksums show which files are damaged.

Import this module where it is needed, not at the top of others: it imports zarr, which takes half a second.
"""

from __future__ import annotations

import hashlib
import math
import os
import shutil
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from cinegen.arrays import Bools, Indices, Integers
from cinegen.workspace.cells import CellStatus
from cinegen.workspace.chunks import chunk_cells, chunk_counts
from cinegen.workspace.errors import DAMAGED, MapError
from cinegen.workspace.loads import described
from cinegen.workspace.quantities import QUANTITIES
from cinegen.workspace.specification import VERSION, MapSpecification
from raff2urdf.command.extras import needs
from raff2urdf.errors import raised_as

with needs("maps", "maps"):
    import zarr
    from zarr.codecs import Crc32cCodec, ZstdCodec
    from zarr.storage import LocalStore, MemoryStore
from cinegen.workspace.checked_files import LAST, CheckedFiles, is_sound

Values = np.ndarray[Any, np.dtype[Any]]

KIND = "cinegen map"
JOINT, UNIT = "joint", "joint_unit"

_ADVICE = "Give another path, or delete it"
_CONFIG: Any = {"write_empty_chunks": True}  # a chunk is complete where its file exists
_ENCODING: dict[str, Any] = {
    "chunk_key_encoding": {"name": "default", "separator": "."},  # one folder for each array: more take longer
    "compressors": (ZstdCodec(level=0, checksum=False), Crc32cCodec()),
    "config": _CONFIG,
}


class MapStore:
    """A map's folder, which exists.

    Attributes:
        path: the folder.
        spec: the map's specification.
        text: the specification as JSON text.
        chunk_shape: number of cells along each axis of a chunk.

    Raises:
        MapError: the folder is missing, is not a map or is damaged.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        group = _open_group(self.path)
        try:
            attributes: dict[str, Any] = group.attrs.asdict()
            self.text = str(attributes["specification"])
            self.spec = MapSpecification.of_attributes(attributes)
            self.chunk_shape = tuple(int(width) for width in attributes["chunks"])
            expected = _template(self.spec, self.chunk_shape)
        except MapError as error:
            raise MapError(f"{self.path}: {error}") from None
        except DAMAGED as error:
            raise MapError(f"{self.path} is damaged: its description is invalid ({error}). {_ADVICE}") from None
        with np.errstate(over="ignore"):  # a fill value that is too large becomes infinite, which is found
            for name in _coordinates(self.spec):
                self._checked(name, group, expected)
            self._arrays = {name: self._checked(name, group, expected) for name in _data_arrays(self.spec)}

    def _checked(self, name: str, group: Any, expected: Any) -> Any:
        """Return an array of the group, once its type, shape and encoding and a coordinate's values are as expected."""
        problem = f"{name} is missing, or its description is wrong"
        try:
            stored = group[name]
            actual, wanted = (array.metadata.to_dict() | {"attributes": {}} for array in (stored, expected[name]))
            if actual == wanted:
                problem = f"the values of {name} are missing or wrong"
                if name not in _coordinates(self.spec) or np.array_equal(stored[:], expected[name][:]):
                    return stored.with_config(_CONFIG)
        except DAMAGED:
            pass
        raise MapError(f"{self.path} is damaged: {problem}. {_ADVICE}") from None

    @property
    def digest(self) -> str:
        """SHA-256 of the description."""
        return hashlib.sha256((self.path / "zarr.json").read_bytes()).hexdigest()

    @property
    def chunk_counts(self) -> tuple[int, ...]:
        """Number of chunks along each axis."""
        return chunk_counts(self.spec.region.shape, self.chunk_shape)

    def cells(self, chunk: int) -> tuple[slice, ...]:
        """Return the cells of a chunk, given by its number (C order)."""
        return chunk_cells(chunk, self.spec.region.shape, self.chunk_shape)

    def sizes(self, chunks: Indices) -> Integers:
        """Return the number of cells (n,) of each of some chunks (n,)."""
        index = np.unravel_index(chunks, self.chunk_counts)
        widths = zip(index, self.chunk_shape, self.spec.region.shape, strict=True)
        return np.asarray(math.prod(np.minimum(width, count - i * width) for i, width, count in widths), dtype=np.int64)

    def complete(self) -> Bools:
        """Return whether each chunk (n,) is complete. Lists a folder, which is faster than asking for each file."""
        complete = np.zeros(self.chunk_counts, dtype=bool)
        for entry in os.scandir(self.path / LAST):
            first, *index = entry.name.split(".")
            if first == "c" and len(index) == complete.ndim and all(map(str.isdecimal, index)):
                complete[tuple(map(int, index))] = True
        return complete.ravel()

    @property
    def done(self) -> int:
        """Number of evaluated cells: those of all complete chunks."""
        return int(self.sizes(np.flatnonzero(self.complete())).sum())

    def is_complete(self, chunk: int) -> bool:
        """Return whether a chunk is complete."""
        return self._file(LAST, chunk).exists()

    def is_sound(self, chunk: int) -> bool:
        """Return whether all files of a chunk exist, with the right checksums."""
        try:
            return all(is_sound(self._file(name, chunk).read_bytes()) for name in self._arrays)
        except FileNotFoundError:
            return False
        except OSError as error:
            raise MapError(f"{error.filename} can't be read: {error.strerror}") from None

    def discard(self, chunk: int) -> None:
        """Mark a chunk as incomplete.

        Raises:
            MapError: the map can't be written.
        """
        try:
            self._file(LAST, chunk).unlink(missing_ok=True)
        except OSError as error:
            raise write_error(self.path, error) from None

    def write(self, chunk: int, values: Mapping[str, Values]) -> None:
        """Write a chunk.

        Args:
            chunk: its number.
            values: by the name of each array (n, ...) the values of its n cells, the last axis fastest.

        Raises:
            MapError: the map can't be written. Complete chunks stay.
        """
        cells = self.cells(chunk)
        shape = [part.stop - part.start for part in cells]
        try:
            for name, array in self._arrays.items():
                array[cells] = values[name].reshape(*shape, *values[name].shape[1:])
        except OSError as error:
            raise write_error(self.path, error) from None

    def _file(self, name: str, chunk: int) -> Path:
        array = self._arrays[name]
        index = [int(k) for k in np.unravel_index(chunk, self.chunk_counts)]
        index += [0] * (array.ndim - len(index))
        return self.path / name / str(array.metadata.encode_chunk_key(tuple(index)))


@contextmanager
def open_for_writing(path: Path, spec: MapSpecification, chunk_shape: tuple[int, ...]) -> Iterator[MapStore]:
    """Lock a map against other writers while it is open; create it, empty, where there is none.

    The map appears complete with its description, and temporary files are removed in the end.

    Raises:
        MapError: another process writes the map; the path holds something else; or it can't be written.
    """
    where = path.resolve()  # of a link, the target: a rename does not leave the file system
    new = where.with_name(f".{where.name}.new")
    try:
        where.parent.mkdir(parents=True, exist_ok=True)
        with _locked(where):
            shutil.rmtree(new, ignore_errors=True)
            if not os.path.lexists(path):
                try:
                    _create(LocalStore(new), spec, chunk_shape)
                    new.rename(where)
                finally:
                    shutil.rmtree(new, ignore_errors=True)
            store = MapStore(path)
            try:
                yield store
            finally:
                for name in _data_arrays(store.spec):  # left by writers that were killed
                    for entry in os.scandir(path / name):
                        if entry.name.endswith(".partial"):  # it may have been completed meanwhile
                            Path(entry).unlink(missing_ok=True)
    except OSError as error:
        raise write_error(path, error) from None


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """Hold the lock of a map: a file next to it. The system releases it however the process ends.

    Raises:
        MapError: another process holds it.
        OSError: the file can't be created.
    """
    lock = FileLock(path.with_name(f".{path.name}.lock"), blocking=False)
    try:
        with lock:
            try:
                yield
            finally:
                Path(lock.lock_file).unlink()
    except Timeout:
        raise MapError(f"another process makes {path}: wait until it has finished") from None


def open_dataset(path: Path) -> Any:
    """Open a map as an `xarray.Dataset` without loading its values.

    Raises:
        MapError: there is no map; or, later, where values are loaded, a file is damaged.
    """
    with needs("maps", "maps"):
        import xarray

    store = MapStore(path)
    with raised_as(MapError, DAMAGED, f"{store.path} is damaged: zarr can't open it (", f"). {_ADVICE}"):
        dataset = xarray.open_zarr(CheckedFiles(store.path, read_only=True), consolidated=False, chunks=None)
    dataset.encoding["source"] = str(store.path)
    return dataset


def write_error(path: Path, error: OSError) -> MapError:
    """Return the error of a map that can't be written."""
    return MapError(
        f"{path} can't be written: {error.strerror or error}. Complete chunks stay: solve the problem, then repeat the "
        "command"
    )


# --- layout ----------------------------------------------------------------------------------------------------------


def _open_group(path: Path) -> zarr.Group:
    if not path.exists():
        raise MapError(f"there is no map at {path}")
    if not path.is_dir():
        raise MapError(f"{path} is a file, not a map: maps are folders. Give another path")
    try:
        group = zarr.open_group(path, mode="r+", zarr_format=3, use_consolidated=False)
        kind = group.attrs.get("kind")
    except PermissionError as error:
        raise MapError(f"{path} can't be read: {error.strerror}") from None
    except DAMAGED:
        raise MapError(f"{path} is not a zarr group, so not a map, or can't be read. Give another path") from None
    if kind != KIND:
        raise MapError(f"{path} is a zarr group, but not a map of cinegen. Give another path")
    return group


def _create(store: LocalStore | MemoryStore, spec: MapSpecification, chunk_shape: tuple[int, ...]) -> zarr.Group:
    """Write a map without values, but for the coordinates.

    Raises:
        OSError: it can't be written.
    """
    mechanism, region = spec.mechanism, spec.region
    group = zarr.create_group(store, attributes={
        "Conventions": "CF-1.11",
        "kind": KIND,
        "title": f"{mechanism.name} over {', '.join(region.names)}",
        "robot": mechanism.name,
        "robot_sha256": spec.robot_hash,
        "node": spec.node,
        "characteristic_length_m": mechanism.length,
        "counted": f"{spec.counted[0]} translations, {spec.counted[1]} rotations of {spec.node}",
        "version": VERSION,
        "chunks": list(chunk_shape),
        **spec.attributes,
    })  # fmt: skip
    for name, (values, attributes) in _coordinates(spec).items():
        group.create_array(
            name, data=values, chunks=values.shape, attributes=attributes, **_ENCODING,
            dimension_names=(name if name in region.names else JOINT,),
        )  # fmt: skip
    for name, (dtype, attributes) in _data_arrays(spec).items():
        joints = (mechanism.model.nq,) if name == "configuration" else ()
        group.create_array(
            name, shape=(*region.shape, *joints), chunks=(*chunk_shape, *joints), dtype=dtype,
            fill_value=math.nan if dtype.startswith("float") else 0, attributes=attributes,
            dimension_names=(*region.names, *(JOINT for _ in joints)), **_ENCODING,
        )  # fmt: skip
    with warnings.catch_warnings():  # xarray reads it, whether or not zarr's specification has it
        warnings.simplefilter("ignore", zarr.errors.ZarrUserWarning)
        zarr.consolidate_metadata(store)
    return group


@lru_cache(maxsize=4)
def _template(spec: MapSpecification, chunk_shape: tuple[int, ...]) -> zarr.Group:
    """Return an empty map in memory."""
    return _create(MemoryStore(), spec, chunk_shape)


def _coordinates(spec: MapSpecification) -> dict[str, tuple[Values, dict[str, Any]]]:
    """Return the values and the attributes of each coordinate, by name."""
    mechanism, region = spec.mechanism, spec.region
    coordinates: dict[str, tuple[Values, dict[str, Any]]] = {}
    for axis, unit in zip(region.axes, region.units(mechanism), strict=True):
        of = "actuated joint" if spec.over_joints else f"of {spec.node}"
        coordinates[axis.name] = axis.middles(), {
            "units": unit, "long_name": f"{axis.name} {of}", "cell_width": axis.width
        }  # fmt: skip
    names, units = list[str](), list[str]()
    for name, joint in zip(mechanism.model.names[1:], mechanism.model.joints[1:], strict=True):
        names += [name] if joint.nq == 1 else [f"{name}.{k}" for k in range(joint.nq)]
        positions = 3 if joint.nq == 7 else 0  # then a unit quaternion
        single = "m" if name in mechanism.joints and mechanism.is_prismatic(name) else "rad"
        units += [single] if joint.nq == 1 else ["m"] * positions + ["1"] * (joint.nq - positions)
    text = np.dtypes.StringDType()
    coordinates[JOINT] = np.array(names, dtype=text), {"long_name": "joint variable"}
    coordinates[UNIT] = np.array(units, dtype=text), {"long_name": "unit of the joint variable"}
    return coordinates


def _data_arrays(spec: MapSpecification) -> dict[str, tuple[str, dict[str, Any]]]:
    """Return the type and the attributes of each array of cells, by name, in the order in which they are written."""
    arrays: dict[str, tuple[str, dict[str, Any]]] = {}
    for name in spec.quantities:
        quantity = QUANTITIES[name]
        arrays[name] = quantity.dtype, {
            "units": quantity.unit, "long_name": described(spec, name, quantity.description),
        }  # fmt: skip
    arrays["configuration"] = "float64", {"long_name": "configuration, loops closed", "coordinates": UNIT}
    arrays["reachable"] = "bool", {"units": "1", "long_name": "whether there is a configuration"}
    arrays[LAST] = "uint8", {
        "units": "1", "long_name": "status of the cell",
        "flag_values": [int(status) for status in CellStatus],
        "flag_meanings": " ".join(status.name.lower() for status in CellStatus),
    }  # fmt: skip
    return arrays
