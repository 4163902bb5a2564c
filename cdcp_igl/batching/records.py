"""What became of one surface of a batch: a line of results.jsonl."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, fields
from typing import Any

__all__ = ["COLUMNS", "DONE", "FAILED", "REFUSED", "Record"]

DONE, FAILED, REFUSED = "done", "failed", "refused"


@dataclass(frozen=True)
class Record:
    """What became of one surface of a batch.

    Attributes
    ----------
    name : str
        Name of the result without its suffix, with folders where files of one name are in
        several.
    input : str
        Absolute path of the surface.
    input_digest : str
        SHA-256 of its bytes; empty if it could not be read.
    input_size, input_mtime : int
        Its bytes, and when it was changed last, in nanoseconds; -1 if there is no such file.
    options_digest : str
        Tells the options of the batch from others.
    version : str
        Of cdcp_igl.
    finished : str
        Date and time in UTC, ISO 8601.
    status : {"done", "failed", "refused"}
        Mapped; not mapped; or not mapped because of a file that is there already and was made
        from something else.
    error : str
        Type of the error: ``"MeshError"``, ``"MapError"``, ..., ``"Crash"``, ``"TimeLimit"``
        or ``"MemoryLimit"``; empty if there was none.
    message : str
        What it says.
    changes : tuple of str
        What was changed on reading and mending, a sentence each.
    vertices, faces, disks : int
        Of the surface as it was given; disks it was mapped to.
    flips : int
        Faces that are not positively oriented.
    mean, sd : float
        Angular distortion in degrees; NaN, as below, where there is no map.
    area : float
        Area distortion, mean of |log of the ratio of areas|.
    conformal : bool
        Whether it is what a conformal map should be, see `DiskMap`.
    boundary : str
        How the boundary got onto the circle.
    seconds : float
        From reading to writing.
    memory : float
        Peak resident memory of the process meanwhile in MiB, Python included.

    Examples
    --------
    >>> from cdcp_igl.batching import Record
    >>> record = Record("scan", "/scans/scan.obj", status="done", mean=1.25)
    >>> Record.from_line(record.line()).line() == record.line()
    True
    """

    name: str
    input: str
    input_digest: str = ""
    input_size: int = -1
    input_mtime: int = -1
    options_digest: str = ""
    version: str = ""
    finished: str = ""
    status: str = FAILED
    error: str = ""
    message: str = ""
    changes: tuple[str, ...] = ()
    vertices: int = 0
    faces: int = 0
    disks: int = 0
    flips: int = 0
    mean: float = math.nan
    sd: float = math.nan
    area: float = math.nan
    conformal: bool = False
    boundary: str = ""
    seconds: float = math.nan
    memory: float = math.nan

    def line(self) -> str:
        """Return the record as one line of JSON, null for what is not a finite number."""
        return json.dumps(self.values()) + "\n"

    def values(self) -> dict[str, Any]:
        """Return the record as JSON types."""
        return {
            name: None if isinstance(value, float) and not math.isfinite(value) else value
            for name, value in asdict(self).items()
        }

    @classmethod
    def from_line(cls, line: str) -> Record:
        """Read a line; ValueError if it is none of a record, or half of one."""
        values = json.loads(line)
        if not isinstance(values, dict) or not {"name", "input", "status"} <= values.keys():
            raise ValueError("no record")
        known: dict[str, Any] = {name: values[name] for name in COLUMNS if name in values}
        return cls(**{name: _of_type(_TYPES[name], value) for name, value in known.items()})


def _of_type(kind: type, value: Any) -> Any:
    """Return what JSON has for a value of this type; ValueError if that is another."""
    if kind is float:
        value = math.nan if value is None else value
        is_one = isinstance(value, int | float)
    elif kind is tuple:
        is_one = isinstance(value, list) and all(isinstance(text, str) for text in value)
    else:
        is_one = isinstance(value, kind)
    if not is_one:
        raise ValueError("no record")
    return tuple(value) if kind is tuple else value


COLUMNS = tuple(field.name for field in fields(Record))
_TYPES = {name: type(getattr(Record, name, "")) for name in COLUMNS}  # "": there is no default
