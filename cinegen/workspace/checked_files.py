"""Files of a map with checksums of their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cinegen.workspace.errors import MapError
from raff2urdf.command.extras import needs

with needs("maps", "maps"):
    import google_crc32c
    from zarr.storage import LocalStore

if TYPE_CHECKING:
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype


LAST = "status"
"""The array that is written last in each chunk."""

_CRC = 4  # bytes, at the end of a chunk's file


class CheckedFiles(LocalStore):
    """A map's folder whose damaged files are reported by name. Plain zarr reads missing chunks as fill values."""

    async def get(
        self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return the content of a file; None if there is none."""
        return self._checked(key, await super().get(key, prototype, byte_range))

    def get_sync(
        self, key: str, *, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return the same, without waiting."""
        return self._checked(key, super().get_sync(key, prototype=prototype, byte_range=byte_range))

    def _checked(self, key: str, content: Buffer | None) -> Buffer | None:
        name, _, chunk = key.rpartition("/")
        index = chunk.split(".")
        if index[0] != "c":
            return content
        status = self.root / LAST / ".".join(index[: -1 if name == "configuration" else None])
        if content is None and (name == LAST or not status.exists()):
            return None
        if content is None or not is_sound(content.to_bytes()):
            raise MapError(
                f"{self.root / key} is {'missing' if content is None else 'damaged'}: repeat the command that made the "
                f"map, which evaluates this chunk again; or delete {status}, which marks it as not evaluated"
            )
        return content


def is_sound(data: bytes) -> bool:
    """Return whether the content of a chunk's file ends with its checksum."""
    return len(data) > _CRC and google_crc32c.value(data[:-_CRC]).to_bytes(_CRC, "little") == data[-_CRC:]
