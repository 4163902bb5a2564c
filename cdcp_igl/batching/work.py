"""One surface of a batch: read, mapped and written. This is what runs in the workers."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter

from .. import __version__
from ..io import read_polygons
from ..one_file import Mapped, Settings, map_one
from ..reference.processes import forget_peak_memory, peak_memory
from .journal import DONE, FAILED, Record


class Unwritten(OSError):
    """A result could not be written, which is no fault of the surface."""


@dataclass(frozen=True)
class Task:
    """A surface to map.

    Attributes
    ----------
    name : str
        Name of the result.
    source, target : str
        Absolute paths of the surface and of the result.
    draft : str
        Where the worker writes the result. The batch moves it to `target`.
    settings : Settings
    options_digest : str
        Tells the options of the batch from others.
    """

    name: str
    source: str
    target: str
    draft: str
    settings: Settings
    options_digest: str

    def state(self) -> tuple[int, int]:
        """Return size and time of the surface's file, -1 if there is none."""
        try:
            stat = os.stat(self.source)
        except OSError:
            return -1, -1
        return stat.st_size, stat.st_mtime_ns

    def record(self, status: str, error: str = "", message: str = "") -> Record:
        """Make a record of this surface."""
        size, mtime = self.state()
        return Record(
            self.name,
            self.source,
            input_size=size,
            input_mtime=mtime,
            options_digest=self.options_digest,
            version=__version__,
            finished=_now(),
            status=status,
            error=error,
            message=message,
        )

    def failed(self, error: str, message: str) -> Record:
        """Make the record of this surface if there is no other."""
        return self.record(FAILED, error, message)

    def run(self) -> Record:
        """Map the surface; whatever is wrong with it is in the record.

        Raises
        ------
        Unwritten
            If the result cannot be written.
        """
        start = perf_counter()
        forget_peak_memory()
        record = self.record(FAILED)
        try:
            record = replace(record, input_digest=digest_of(self.source))
            notes: list[str] = []
            V, F, polygon_of_face = read_polygons(self.source, notes.append)
            record = replace(record, vertices=len(V), faces=len(F))
            mapped = map_one(V, F, polygon_of_face, self.settings)
            output_digest = self._write(mapped)
            measures = mapped.measures() | {"changes": (*notes, *mapped.changes)}
            record = replace(record, status=DONE, output_digest=output_digest, **measures)
        except Unwritten:
            raise
        except Exception as error:  # whatever it is, the other surfaces can do without this one
            message = (error.strerror if isinstance(error, OSError) else None) or str(error)
            record = replace(record, error=type(error).__name__, message=message)
        seconds = perf_counter() - start
        return replace(record, seconds=seconds, memory=peak_memory(), finished=_now())

    def _write(self, mapped: Mapped) -> str:
        """Write the draft and return its digest."""
        draft = Path(self.draft)
        try:
            mapped.write(draft, Path(self.source), self.settings)
            return digest_of(draft)
        except OSError as error:
            raise Unwritten(error.errno, error.strerror, self.target) from error


def digest_of(path: str | os.PathLike[str]) -> str:
    """SHA-256 of the bytes of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="microseconds")
