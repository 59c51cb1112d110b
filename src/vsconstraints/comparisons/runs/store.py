"""Results folder from the start to the end of the command that fills it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...plugins.processes import INTERRUPTS, signal_of
from .files import RUNS_ARE_KEPT, seal, storing, write_json
from .folder import MANIFEST


@dataclass
class Store:
    """Locked results folder that a command fills, with its manifest and checksums.

    The command begins the store, makes runs until they are finished or a signal interrupts it, and
    finishes the store in both cases. After any other error the results stored until then remain,
    and the same command continues.

    ``name`` is that of the results in messages. ``files`` lists the files of a folder that have
    checksums, some of which may not exist. ``kept`` states in errors which results remain.
    """

    folder: Path
    name: str
    files: Callable[[Path], Iterable[Path]]
    kept: str = RUNS_ARE_KEPT
    manifest: dict[str, Any] = field(default_factory=dict)
    interrupted: int = 0  #: Number of the signal that interrupted the command, or 0.
    started: float = field(default_factory=time.perf_counter)

    @property
    def seconds(self) -> float:
        """Wall time since the command started [s]."""
        return time.perf_counter() - self.started

    def storing(self) -> AbstractContextManager[None]:
        """Turn an OSError in the block into a StorageError, see :func:`.storing`."""
        return storing(self.name, self.folder, self.kept)

    def begin(self, manifest: dict[str, Any], complete: Iterable[Path]) -> None:
        """Store a manifest, and the checksums of ``complete`` files, which stay as they are."""
        self.manifest = manifest
        with self.storing():
            seal(self.folder, complete)
            write_json(self.folder / MANIFEST, manifest)

    @contextmanager
    def interruptible(self) -> Iterator[None]:
        """End the block at a signal, and remember its number."""
        try:
            yield
        except INTERRUPTS as interrupt:
            self.interrupted = signal_of(interrupt)

    def finish(self, **entries: Any) -> None:
        """Store the manifest with further entries, and the checksums of all files."""
        self.manifest.update(entries)
        with self.storing():
            write_json(self.folder / MANIFEST, self.manifest)
            seal(self.folder, self.files(self.folder))
