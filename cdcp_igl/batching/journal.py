"""results.jsonl: a line for each surface, written when it is done and never changed."""

from __future__ import annotations

import csv
import errno
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Protocol

try:
    import fcntl
except ModuleNotFoundError:  # Windows: two batches in one folder are not kept apart there
    fcntl = None  # type: ignore[assignment]

from ..errors import printable
from ..io import whole_file
from .records import COLUMNS, Record
from .shards import Shard

__all__ = ["Journal", "is_summary", "journal_lines", "read_journals", "write_summary"]


class Line(Protocol):
    """What can be written down in a line."""

    def line(self) -> str:
        """Return it with the end of the line."""


class Journal:
    """The file that a batch appends to, kept from other batches as long as it is open.

    Parameters
    ----------
    folder : Path
        Of the results.
    shard : (int, int) or None
        Part i of n, from 1, which has a file of its own.

    Raises
    ------
    OSError
        If the file cannot be written, or another batch writes it.
    """

    def __init__(self, folder: Path, shard: Shard | None = None) -> None:
        name = "results" + (f".{shard[0]}-of-{shard[1]}" if shard else "")
        self.path = folder / f"{name}.jsonl"
        self._file = self.path.open("ab+", buffering=0)
        try:
            self._lock()
            self._mend()
        except BaseException:
            self._file.close()
            raise

    def append(self, record: Line) -> None:
        """Add a line, which is there for good when this returns."""
        line = record.line().encode()
        if self._file.write(line) != len(line):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.path))
        os.fsync(self._file.fileno())

    def _lock(self) -> None:
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            reason = (
                "another batch is writing there; wait for it, take another folder, or share "
                "the work by shards"
            )
            raise OSError(error.errno, reason, str(self.path.parent)) from error
        except OSError:  # a file system without locks
            return

    def _mend(self) -> None:
        """End the line that a full disk or a power failure has left unfinished."""
        size = self._file.seek(0, os.SEEK_END)
        if size:
            self._file.seek(size - 1)
            if self._file.read(1) != b"\n":
                self._file.write(b"\n")

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._file.close()


def journal_lines(folder: Path) -> Iterator[str]:
    """Yield the lines of all journals of a folder; some may be cut off."""
    for path in sorted(folder.glob("results*.jsonl")):
        with path.open(encoding="utf-8", errors="replace") as file:
            yield from file


def read_journals(folder: Path, options_digest: str) -> dict[str, Record]:
    """Return the latest record of each name made with these options, from all journals."""
    records: dict[str, Record] = {}
    for line in journal_lines(folder):
        try:
            record = Record.from_line(line)
        except ValueError:  # cut off
            continue
        known = records.get(record.name, record)
        if record.options_digest == options_digest and record.finished >= known.finished:
            records[record.name] = record
    return records


def is_summary(path: Path) -> bool:
    """Whether a file begins as `write_summary` begins it."""
    with path.open("rb") as file:
        return file.read(11) == b"name,input,"


def write_summary(path: Path, records: Iterable[Record]) -> None:
    """Write one line for each surface, empty where there is no number."""
    with (
        whole_file(path) as unfinished,
        unfinished.open("w", newline="", encoding="utf-8", errors="backslashreplace") as file,
    ):
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        for record in records:
            changes = " ".join(record.changes)
            writer.writerow(
                record.values() | {"input": printable(record.input), "changes": changes}
            )
