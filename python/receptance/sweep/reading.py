"""A Zarr store that checks each chunk when it is read, so that errors name the store and the chunk."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from zarr.storage import LocalStore

from receptance.sweep.disk import Marks, SweepError, fault

if TYPE_CHECKING:
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype


class CheckedStore(LocalStore):
    """The folder of a sweep, opened for reading.

    The arrays `blocked` are written block by block; without the chunk of the array `last` a block is not finished.
    """

    def __init__(
        self, root: Path | str, *, read_only: bool = True, last: str = "", blocked: tuple[str, ...] = ()
    ) -> None:
        super().__init__(root, read_only=read_only)
        self._last, self._blocked = last, frozenset(blocked)
        self._marks = Marks(self.root, blocked)

    async def get(
        self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return the content of a file; see `zarr.abc.store.Store.get`."""
        return self._checked(key, await super().get(key, prototype, byte_range), byte_range)

    def get_sync(
        self, key: str, *, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Return the content of a file; see `zarr.abc.store.Store.get`."""
        return self._checked(key, super().get_sync(key, prototype=prototype, byte_range=byte_range), byte_range)

    def _checked(self, key: str, content: Buffer | None, byte_range: ByteRequest | None) -> Buffer | None:
        name, separator, chunk = key.partition("/c/")
        if not separator or byte_range is not None:
            return content
        whole = None if content is None else content.to_bytes()
        if name in self._blocked:
            block = chunk.partition("/")[0]
            if not (self.root / self._last / "c" / block).exists():
                return None
            wrong = self._marks.fault(name, int(block), whole)
            remedy = "run the same sweep with this store again to evaluate the block"
        else:
            wrong, remedy = fault(whole), "remove the store and run the sweep again"
        if wrong:
            raise SweepError(f"{self.root}: the chunk {key} {wrong}; {remedy}")
        return content
