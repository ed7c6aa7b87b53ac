"""What arrays a map has, and what zarr is told about them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cinegen.workspace.quantities as known
from cinegen.workspace.settled import How
from cinegen.workspace.specification import VERSION, MapSpecification
from cinegen.workspace.storage.chunk import CODECS, compressors

KIND = "cinegen map"

LAST = "settled"
"""The array that is written last of each piece: where its chunk is there, all of the piece is."""

_KEYS: dict[str, Any] = {"name": "default", "separator": "."}
_FIRST = "c."


def file_name(index: Sequence[int]) -> str:
    """Of a chunk, in its array's folder, which holds them all: to make a folder takes longer than to write a file."""
    return _FIRST + ".".join(map(str, index))


def index_of(name: str) -> tuple[int, ...] | None:
    """Of the chunk whose file has this name; None where no chunk's has."""
    numbers = name.removeprefix(_FIRST).split(".")
    index = tuple(int(number) for number in numbers if number.isdecimal())
    return index if name == file_name(index) else None


@dataclass(frozen=True, eq=False)
class Layout:
    """Of one array.

    Attributes:
        name: of the array.
        dtype: of its numbers.
        fill: what stands where nothing was written.
        attributes: units and words.
        more: what it has of each cell, where that is not one number.
    """

    name: str
    dtype: str
    fill: Any
    attributes: dict[str, Any]
    more: tuple[int, ...] = ()

    def fits(self, document: dict[str, Any], names: Sequence[str], shape: Sequence[int], chunks: Sequence[int]) -> bool:
        """Whether zarr's document of an array says the same."""
        return (
            document.get("node_type") == "array"
            and document["zarr_format"] == 3
            and document["dimension_names"] == [*names, *("joint",) * len(self.more)]
            and document["data_type"] == self.dtype
            and document["shape"] == [*shape, *self.more]
            and document["chunk_grid"]["configuration"]["chunk_shape"] == [*chunks, *self.more]
            and document["chunk_key_encoding"]["configuration"]["separator"] == _KEYS["separator"]
            and tuple(codec["name"] for codec in document["codecs"]) == CODECS
            and document["codecs"][0].get("configuration", {}).get("endian", "little") == "little"
        )


def layouts(spec: MapSpecification) -> tuple[Layout, ...]:
    """Of all that is written of each piece, in this order."""
    found = []
    for name in spec.quantities:
        quantity = known.QUANTITIES[name]
        fill = 0 if quantity.dtype.startswith("int") else math.nan
        found.append(Layout(name, quantity.dtype, fill, {"units": quantity.unit, "long_name": quantity.words}))
    joints = _numbers(spec)
    words: dict[str, Any] = {"units": "rad or m", "long_name": "a configuration, loops closed", "joints": joints}
    found.append(Layout("configuration", "float64", math.nan, words, (spec.mechanism.model.nq,)))
    words = {"units": "1", "long_name": "whether there is a configuration"}
    found.append(Layout("reachable", "bool", False, words))
    words = {
        "units": "1", "long_name": "how the cell was settled",
        "flag_values": [int(how) for how in How], "flag_meanings": " ".join(how.name.lower() for how in How),
    }  # fmt: skip
    return (*found, Layout(LAST, "uint8", 0, words))


def coordinates(spec: MapSpecification) -> tuple[Layout, ...]:
    """Of the axes."""
    return tuple(
        Layout(axis.name, "float64", 0.0, {"units": _unit(spec, axis.name), "cell_width": axis.width})
        for axis in spec.region.axes
    )


def lay_out(path: Path, spec: MapSpecification, chunks: Sequence[int]) -> None:
    """Writes a map that holds nothing yet.

    Raises:
        OSError: it can't be written.
    """
    import zarr

    mechanism, region = spec.mechanism, spec.region
    group = zarr.create_group(path, attributes={
        "kind": KIND,
        "title": f"{mechanism.name} over {', '.join(region.names)}",
        "robot": mechanism.name,
        "robot_sha256": spec.robot_hash,
        "node": spec.node,
        "characteristic_length_m": mechanism.length,
        "counted": f"{spec.counted[0]} translations, {spec.counted[1]} rotations of {spec.node}",
        "version": VERSION,
        "chunks": list(chunks),
        **spec.attributes,
    })  # fmt: skip
    for axis, array in zip(region.axes, coordinates(spec), strict=True):
        group.create_array(
            array.name, data=axis.middles(), chunks=(axis.count,), dimension_names=(axis.name,),
            chunk_key_encoding=_KEYS, compressors=compressors(), config={"write_empty_chunks": True},
            attributes=array.attributes,
        )  # fmt: skip
    for array in layouts(spec):
        group.create_array(
            array.name, shape=(*region.shape, *array.more), chunks=(*chunks, *array.more), dtype=array.dtype,
            fill_value=array.fill, dimension_names=(*region.names, *("joint",) * len(array.more)),
            chunk_key_encoding=_KEYS, compressors=compressors(), attributes=array.attributes,
        )  # fmt: skip


def _numbers(spec: MapSpecification) -> list[str]:
    """A name for each number of a configuration."""
    names = [""] * spec.mechanism.model.nq
    for name, joint in zip(spec.mechanism.model.names, spec.mechanism.model.joints, strict=True):
        for k in range(joint.nq if name != "universe" else 0):
            names[joint.idx_q + k] = name if joint.nq == 1 else f"{name}.{k}"
    return names


def _unit(spec: MapSpecification, name: str) -> str:
    mechanism = spec.mechanism
    long = mechanism.is_prismatic(name) if name in mechanism.joints else name in ("x", "y", "z", "radius", "way")
    return "m" if long else "rad"
