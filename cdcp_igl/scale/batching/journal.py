"""results.jsonl: a line for each surface, written when it is done and never changed."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, BinaryIO

try:
    import fcntl
except ModuleNotFoundError:  # Windows: two batches in one folder are not kept apart there
    fcntl = None  # type: ignore[assignment]

from ...errors import printable
from ...io.output import write_table
from ...printing import finite
from .names import Shard

BLOCK = 1 << 16  # bytes that are read at once, from the end
DONE, FAILED, REFUSED = "done", "failed", "refused"


@dataclass(frozen=True)
class Record:
    """What became of one surface of a batch.

    Examples
    --------
    >>> from cdcp_igl.scale.batching import Record
    >>> record = Record("scan", "/scans/scan.obj", status="done", mean=1.25)
    >>> Record.from_line(record.line()).mean
    1.25
    """

    name: str  #: of the result without its suffix, with folders where files share a name
    input: str  #: absolute path of the surface
    input_digest: str = ""  #: SHA-256 of its bytes; empty if it could not be read
    output_digest: str = ""  #: SHA-256 of the result; empty if there is none
    input_size: int = -1  #: bytes; -1 if there is no such file
    input_mtime: int = -1  #: when it was changed last, in nanoseconds
    options_digest: str = ""  #: tells the options of the batch from others
    version: str = ""  #: of cdcp_igl
    finished: str = ""  #: date and time in UTC, ISO 8601
    status: str = FAILED  #: or "done"; "refused" because of a file that is there already
    error: str = ""  #: "MeshError", "MapError", ..., "Crash", "TimeLimit", "MemoryLimit"; or none
    message: str = ""  #: what it says
    changes: tuple[str, ...] = ()  #: on reading and cleaning, a sentence each
    vertices: int = 0  #: of the surface as it was given
    faces: int = 0
    left_out: int = 0  #: vertices that were not mapped, by `only`, `without` or `clean`
    charts: int = 0  #: that it was mapped onto; 1 unless it was cut
    flips: int = 0  #: faces that are not positively oriented
    mean: float = math.nan  #: angular distortion in degrees; NaN, as below, if there is no map
    sd: float = math.nan
    area_sd: float = math.nan  #: of the logarithm of the ratio of areas, as in `AreaDistortion`
    texels: float = math.nan  #: density, 95th by 5th percentile of the surface, the same
    conformal: bool | None = False  #: whether it is what a conformal map should be, or not asked
    reasons: str = ""  #: why it is not
    boundary: str = ""  #: how it was laid out; of a sphere "none"
    seconds: float = math.nan  #: from reading to writing
    memory: float = math.nan  #: peak resident MiB of the process meanwhile, Python included

    def line(self) -> str:
        """Return the record as one line of JSON, null for what is not a finite number."""
        return json.dumps(self.values()) + "\n"

    def values(self) -> dict[str, Any]:
        """Return the record as JSON types."""
        return finite(asdict(self))

    @classmethod
    def from_line(cls, line: str) -> Record:
        """Read a line; ValueError if it is none of a record, or half of one."""
        values = json.loads(line)
        if not isinstance(values, dict) or not {"name", "input", "status"} <= values.keys():
            raise ValueError("no record")
        known: dict[str, Any] = {
            name: math.nan if value is None and name != "conformal" else value
            for name, value in values.items()
            if name in COLUMNS
        }
        return cls(**{**known, "changes": tuple(known.get("changes", ()))})


COLUMNS = tuple(field.name for field in fields(Record))


class Journal:
    """The file that a batch appends to, a shard of its own; no other batch can open it meanwhile.

    OSError if it cannot be written, or another batch has it.
    """

    def __init__(self, folder: Path, shard: Shard | None = None) -> None:
        name = "results" + (f".{shard[0]}-of-{shard[1]}" if shard else "")
        self.path = folder / f"{name}.jsonl"
        self._file = self.path.open("ab+", buffering=0)
        try:
            self._lock()
        except BaseException:
            self._file.close()
            raise

    def append(self, line: str) -> None:
        """Add a line, which is there for good when this returns."""
        text = line.encode()
        self._end_last_line()
        if self._file.write(text) != len(text):
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

    def _end_last_line(self) -> None:
        """End a line that lacks nothing else; take half a line away, as a power failure leaves it.

        It is left until there is another line: until then it says that a result may have none.
        """
        last = last_line(self._file)
        if is_half(last):
            self._file.truncate(self._file.seek(-len(last), os.SEEK_END))
        elif not last.endswith(b"\n"):
            self._file.write(b"\n" * bool(last))

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *exception: object) -> None:
        self._file.close()


def last_line(file: BinaryIO) -> bytes:
    """Return the last line of a file, or what there is of it."""
    at, found = file.seek(0, os.SEEK_END), b""
    while at and b"\n" not in found[:-1]:
        size = min(at, BLOCK)
        at = file.seek(at - size)
        found = file.read(size) + found
        file.seek(at)
    return found[found[:-1].rfind(b"\n") + 1 :]


def is_half(line: bytes) -> bool:
    """Whether a last line is no whole record, and was not ended."""
    try:
        Record.from_line(line.decode("utf-8", "replace"))
    except ValueError:
        return bool(line) and not line.endswith(b"\n")
    return False


def ends_in_half_a_line(folder: Path) -> bool:
    """Whether a journal does: the machine may have died when a result was in place already."""
    for path in folder.glob("results*.jsonl"):
        with path.open("rb") as file:
            if is_half(last_line(file)):
                return True
    return False


def journal_lines(folder: Path) -> Iterator[str]:
    """Yield the lines of all journals of a folder; some may be cut off."""
    for path in sorted(folder.glob("results*.jsonl")):
        with path.open(encoding="utf-8", errors="replace") as file:
            yield from file


def read_journals(folder: Path, options_digest: str | None = None) -> dict[str, list[Record]]:
    """Return the records of each name, latest last, from all journals; all, or of some options."""
    records: dict[str, list[Record]] = {}
    for line in journal_lines(folder):
        try:
            record = Record.from_line(line)
        except ValueError:  # cut off
            continue
        if options_digest in (None, record.options_digest):
            records.setdefault(record.name, []).append(record)
    for of_name in records.values():
        of_name.sort(key=lambda record: record.finished)
    return records


def latest_records(folder: Path) -> Iterator[Record]:
    """Yield the latest record of each name, sorted; that of a refusal only where it is alone."""
    for _, records in sorted(read_journals(folder).items()):
        yield max(records, key=lambda record: (record.status != REFUSED, record.finished))


SUMMARY_BEGINS = "name,input,"


def write_summary(path: Path, records: Iterable[Record]) -> None:
    """Write one line for each surface, empty where there is no number."""
    rows = (
        record.values() | {"input": printable(record.input), "changes": " ".join(record.changes)}
        for record in records
    )
    write_table(path, COLUMNS, rows)
