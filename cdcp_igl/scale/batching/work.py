"""One surface of a batch: read, mapped and written in a worker; its result put into its place."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter
from zipfile import ZipFile

from ... import __version__
from ...errors import printable
from ...io import read_polygons
from ...solve.memory import forget_peak_memory, peak_memory
from ..one_file import Mapped, Settings, map_one
from ..pool import Unwritten
from .journal import DONE, FAILED, REFUSED, Record

# Peak memory of a map; a batch writes it down for every surface, and on those from 100,000 to a
# million vertices it is less than this, cut open or not.
MIB_PER_VERTEX = 2.5e-3
MIB_OF_PYTHON = 150.0

# The fewest bytes that a vertex and its two faces take in each kind of file.
BYTES_PER_VERTEX = {".npz": 36, ".obj": 40, ".off": 40, ".ply": 36, ".stl": 100}


@dataclass(frozen=True)
class Task:
    """A surface to map, from the file `source`.

    A worker writes the result as `draft`, which the batch then moves to `target`; all three are
    absolute paths. `options_digest` tells the options of the batch from others.
    """

    name: str
    source: str
    target: str
    draft: str
    settings: Settings
    options_digest: str

    @property
    def memory(self) -> float:
        """MiB that the map may need."""
        return memory_needed(Path(self.source))

    def record(self, status: str, error: str = "", message: str = "") -> Record:
        """Make a record of this surface."""
        size, mtime = _size_and_time(self.source)
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

    def is_done(self, record: Record, retry: bool) -> bool:
        """Whether a former run, which left this record, has done with the surface as it is now."""
        state = (record.input_size, record.input_mtime)
        if record.input != self.source or state != _size_and_time(self.source):
            return False
        if record.status == DONE:  # and the result is what it was
            return os.path.isfile(self.target) and _digest(self.target) == record.output_digest
        return record.status == FAILED and not retry

    def refusal(self, history: Sequence[Record], force: bool) -> Record | None:
        """Refuse the surface if what has the name of its result must not be replaced.

        It may by `force`, unless it is the surface; if it is empty; or if `history`, the records of
        this name, says that it was made from the surface as it is now, and nobody has changed it.
        """
        if not (os.path.lexists(self.target) and os.access(self.source, os.R_OK)):
            return None  # if the surface cannot be read, its worker will say so
        target = printable(self.target)
        if os.path.exists(self.target) and os.path.samefile(self.source, self.target):
            message = f"{target} is the surface itself; give the result another place."
            return self.record(REFUSED, "FileExistsError", message)
        if force:
            return None
        if os.path.isfile(self.target):
            digests = _digest(self.source), _digest(self.target)
            made = [(record.input_digest, record.output_digest) for record in history]
            if os.path.getsize(self.target) == 0 or digests in made:
                return None
        message = (
            f"{target} is there, and was not made from {printable(Path(self.source).name)} "
            "with these options, or has been changed; move it, take another folder, or replace it "
            "by force."
        )
        return self.record(REFUSED, "FileExistsError", message)

    def run(self) -> Record:
        """Map the surface and record what is wrong with it; Unwritten if the disk is full."""
        start = perf_counter()
        forget_peak_memory()
        record = self.record(FAILED)
        try:
            record = replace(record, input_digest=_digest(self.source))
            notes: list[str] = []
            V, F, polygon_of_face = read_polygons(self.source, notes.append)
            record = replace(record, vertices=len(V), faces=len(F))
            source = Path(self.source)
            mapped = map_one(V, F, polygon_of_face, self.settings, source=source)
            output_digest = self._write(mapped)
            changes = (*notes, *mapped.changes)
            record = replace(record, output_digest=output_digest, changes=changes)
            record = replace(record, status=DONE, **mapped.measures())
        except Unwritten:
            raise
        except Exception as error:  # whatever it is, the other surfaces can do without this one
            message = str(error)
            if isinstance(error, OSError) and error.strerror:
                other = error.filename not in (None, self.source)  # such as a label
                message = f"{printable(error.filename)}: " * other + error.strerror
            record = replace(record, error=type(error).__name__, message=message)
        seconds = perf_counter() - start
        return replace(record, seconds=seconds, memory=peak_memory(), finished=_now())

    def _write(self, mapped: Mapped) -> str:
        """Write the draft and return its digest."""
        try:
            mapped.write(Path(self.draft), Path(self.source), self.settings)
            return _digest(self.draft)
        except OSError as error:
            raise Unwritten(error.errno, error.strerror, self.target) from error

    def move_draft(self) -> None:
        """Put the result into its place; OSError if that cannot be done."""
        try:
            os.makedirs(os.path.dirname(self.target), exist_ok=True)
            os.replace(self.draft, self.target)
        except OSError as error:
            raise OSError(error.errno, error.strerror, self.target) from error


def memory_needed(path: Path) -> float:
    """Guess from the file of a surface how many MiB it will need, rather too many."""
    try:
        size, suffix = path.stat().st_size, path.suffix.lower()
        if suffix == ".npz":  # before they were packed
            with ZipFile(path) as archive:
                size = sum(array.file_size for array in archive.infolist())
        return MIB_OF_PYTHON + MIB_PER_VERTEX * size / BYTES_PER_VERTEX.get(suffix, 12)
    except Exception:  # whatever is wrong with the file, its worker will find out and say
        return MIB_OF_PYTHON


def _digest(path: str) -> str:
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _size_and_time(path: str) -> tuple[int, int]:
    """Bytes of a file, and when it was changed last, in nanoseconds; -1 if there is none."""
    try:
        stat = os.stat(path)
    except OSError:
        return -1, -1
    return stat.st_size, stat.st_mtime_ns


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="microseconds")
