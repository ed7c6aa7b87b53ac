"""`CheckedStore`: a map's files as zarr reads them, each looked at first: what is broken is said, not handed on.

To be imported where it is used: it brings zarr along.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from zarr.storage import LocalStore

from cinegen.workspace.errors import MapError
from cinegen.workspace.storage.chunk import is_sound
from cinegen.workspace.storage.layout import LAST, file_name, index_of

if TYPE_CHECKING:
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype


class CheckedStore(LocalStore):
    """Of a map's folder.

    Raises:
        MapError: a chunk that is read is not as it was written, or not there though its piece is finished.
    """

    async def get(
        self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """A file's bytes; None where there is none."""
        return self._looked_at(key, await super().get(key, prototype, byte_range))

    def get_sync(
        self, key: str, *, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """The same, for who can't wait."""
        return self._looked_at(key, super().get_sync(key, prototype=prototype, byte_range=byte_range))

    def _looked_at(self, key: str, found: Buffer | None) -> Buffer | None:
        name, _, file = key.rpartition("/")
        index = index_of(file)
        if index is None or (found is not None and is_sound(found.to_bytes())):
            return found
        if name == "configuration":  # which has one number more
            index = index[:-1]
        last = self.root / LAST / file_name(index)
        if found is None and (name == LAST or not last.exists()):
            return None
        what = "is not there, though its piece is finished" if found is None else "is not as it was written"
        raise MapError(
            f"{self.root / key} {what}. Give the command that made the map again, and its piece is made again; or "
            f"delete {last}, and it counts as not made"
        )
