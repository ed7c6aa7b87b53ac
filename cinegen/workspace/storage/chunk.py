"""A chunk's file: numbers of one array over one piece, compressed, with a checksum behind; whole, or not there at all.

As zarr's codecs have it (`bytes`, `zstd`, `crc32c`): zarr reads what is written here. It is written beside and then
renamed. Nothing waits for the disk (fsync): what a process has written outlives it, and where the machine itself loses
power before its files have reached the disk, the checksum tells.
"""

from __future__ import annotations

import os
import uuid
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

_LEVEL = 0  # zstd's default
_WIDTH = 4  # bytes of the checksum

Values = np.ndarray[Any, np.dtype[Any]]


def compressors() -> tuple[Any, ...]:
    """What stands behind `bytes` among zarr's codecs."""
    from zarr.codecs import Crc32cCodec, ZstdCodec

    return ZstdCodec(level=_LEVEL, checksum=False), Crc32cCodec()


CODECS = ("bytes", "zstd", "crc32c")
"""The same by the names that stand in an array's zarr.json."""


def packed(values: Values, shape: Sequence[int], fill: Any) -> bytes:
    """A chunk's bytes.

    Args:
        values: at the grid's end fewer than the chunk has room for.
        shape: of the chunk.
        fill: what stands where no values are.
    """
    if values.shape != tuple(shape):
        full = np.full(shape, fill, values.dtype)
        full[tuple(slice(0, count) for count in values.shape)] = values
        values = full
    little = values.astype(values.dtype.newbyteorder("<"), copy=False)
    data = bytes(_zstd().encode(np.ascontiguousarray(little)))
    return data + _checksum(data)


def is_sound(data: bytes) -> bool:
    """Whether bytes of a file are those that were written."""
    return len(data) > _WIDTH and _checksum(data[:-_WIDTH]) == data[-_WIDTH:]


def put(path: Path, data: bytes, beside: Path) -> None:
    """Writes a file so that it is whole at once.

    Args:
        path: of the file.
        data: what is to stand in it.
        beside: a folder of the same file system for what is not whole yet.

    Raises:
        OSError: it can't be written; nothing is left of it.
    """
    fresh = beside / uuid.uuid4().hex
    try:
        _write(fresh, data)
        os.replace(fresh, path)
    except BaseException:
        fresh.unlink(missing_ok=True)
        raise


def _write(path: Path, data: bytes) -> None:
    try:
        path.write_bytes(data)
    except FileNotFoundError:
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)


def _checksum(data: bytes) -> bytes:
    from google_crc32c import value

    return int(value(data)).to_bytes(_WIDTH, "little")


@lru_cache(maxsize=1)
def _zstd() -> Any:
    from numcodecs import Zstd

    return Zstd(level=_LEVEL)
