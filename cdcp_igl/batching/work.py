"""One surface of a batch: read, mapped and written. This is what runs in the workers."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import __version__
from ..io import read_polygons, whole_file
from ..one_file import Settings, map_one
from ..reference.processes import forget_peak_memory, peak_memory
from .records import DONE, FAILED, REFUSED, Record
from .stamps import Stamp, put_stamp
from .targets import digest_of, objection
from .thumbnails import draw_thumbnail

__all__ = ["Task", "Unwritten"]

Array = NDArray[Any]

ANOTHER = " with these options; move it, or take another folder"


@dataclass(frozen=True)
class Task:
    """A surface to map.

    Attributes
    ----------
    name : str
        Name of the result.
    source, target : str
        Absolute paths of the surface and of the result.
    settings : Settings
    thumbnail : str
        Path of a picture of the disks; empty for none.
    """

    name: str
    source: str
    target: str
    settings: Settings
    thumbnail: str = ""

    def state(self) -> tuple[int, int]:
        """Return size and time of the surface's file, -1 if there is none."""
        try:
            stat = os.stat(self.source)
        except OSError:
            return -1, -1
        return stat.st_size, stat.st_mtime_ns

    def record(self, status: str, **values: Any) -> Record:
        """Make a record of this surface."""
        size, mtime = self.state()
        return Record(
            self.name,
            self.source,
            input_size=size,
            input_mtime=mtime,
            options_digest=digest_of_settings(self.settings),
            version=__version__,
            finished=_now(),
            status=status,
            **values,
        )

    def failed(self, error: str, message: str) -> Record:
        """Make the record of this surface if there is no other."""
        return self.record(FAILED, error=error, message=message)

    def run(self) -> Record:
        """Map the surface; Unwritten if the result cannot be written."""
        return _map_file(self)


class Unwritten(OSError):
    """A result could not be written, which is no fault of the surface."""


def _map_file(task: Task) -> Record:
    """Map one surface.

    Returns
    -------
    Record
        Whatever is wrong with the surface is in it.

    Raises
    ------
    Unwritten
        If the result cannot be written.
    """
    start = perf_counter()
    forget_peak_memory()
    record = task.record(FAILED)
    source = Path(task.source)
    try:
        stamp = Stamp(digest_of(source), digest_of_settings(task.settings))
        record = replace(record, input_digest=stamp.input)
        if message := _objection(task, stamp):
            record = replace(record, status=REFUSED, error="FileExistsError", message=message)
        else:
            notes: list[str] = []
            V, F, whole = read_polygons(source, notes.append)
            record = replace(record, vertices=len(V), faces=len(F))
            record = _mapped(task, (V, F, whole), stamp, record)
            record = replace(record, status=DONE, changes=(*notes, *record.changes))
    except Unwritten:
        raise
    except Exception as error:  # whatever it is, the other surfaces can do without this one
        message = (error.strerror if isinstance(error, OSError) else None) or str(error)
        record = replace(record, error=type(error).__name__, message=message)
    seconds = perf_counter() - start
    return replace(record, seconds=seconds, memory=peak_memory(), finished=_now())


def _objection(task: Task, stamp: Stamp) -> str:
    """Say why a file that is there must not be replaced; nothing if all may."""
    source = Path(task.source)
    # With the right mark, it is from a run that was killed before it could say so.
    message = objection(Path(task.target), source, lambda found: found == stamp, ANOTHER)
    if task.thumbnail and not message:
        # Results in several formats share a picture: any mark shows that a batch has drawn it.
        message = objection(Path(task.thumbnail), source, lambda found: found is not None, ANOTHER)
    return message


def digest_of_settings(settings: Settings) -> str:
    """Tell these settings from others."""
    text = json.dumps(asdict(settings), sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{value!r} is no option of a batch: it cannot be written down")


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="microseconds")


def _mapped(
    task: Task, surface: tuple[Array, Array, Array], stamp: Stamp, record: Record
) -> Record:
    """Map and write; Unwritten if the file cannot be written."""
    mapped = map_one(*surface, task.settings)
    target = Path(task.target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(target) as unfinished:
            mapped.write(unfinished, Path(task.source), task.settings)
            put_stamp(unfinished, stamp)
        if task.thumbnail:
            draw_thumbnail(Path(task.thumbnail), mapped.disks, stamp)
    except OSError as error:
        raise Unwritten(error.errno, error.strerror, task.target) from error
    return replace(record, **mapped.measures())
