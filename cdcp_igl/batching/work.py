"""One surface of a batch: read, mapped and written. This is what runs in the workers."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from .. import __version__
from ..algorithm import disk_map
from ..distortion import area_distortion
from ..io import read_mesh, whole_file, write_map
from ..processes import forget_peak_memory, peak_memory
from ..surface.cleaning import clean
from .names import shown
from .records import DONE, FAILED, REFUSED, Record
from .settings import Settings
from .stamps import Stamp, put_stamp, read_stamp

__all__ = ["Task", "Unwritten", "map_file"]


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
    """

    name: str
    source: str
    target: str
    settings: Settings

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
            options_digest=self.settings.digest,
            version=__version__,
            finished=_now(),
            status=status,
            **values,
        )


class Unwritten(OSError):
    """A result could not be written, which is no fault of the surface."""


def map_file(task: Task) -> Record:
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
    try:
        with open(task.source, "rb") as file:
            stamp = Stamp(hashlib.file_digest(file, "sha256").hexdigest(), task.settings.digest)
        record = replace(record, input_digest=stamp.input)
        if objection := _objection(task, stamp):
            record = replace(record, status=REFUSED, error="FileExistsError", message=objection)
        else:
            record = _mapped(task, stamp, record)
    except Unwritten:
        raise
    except Exception as error:  # whatever it is, the other surfaces can do without this one
        message = (error.strerror if isinstance(error, OSError) else None) or str(error)
        record = replace(record, error=type(error).__name__, message=message)
    seconds = perf_counter() - start
    return replace(record, seconds=seconds, memory=peak_memory(), finished=_now())


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="microseconds")


def _objection(task: Task, stamp: Stamp) -> str:
    """Say why the result must not be written, if so."""
    target = Path(task.target)
    if not target.exists():
        return ""
    if os.path.samefile(task.source, target):
        return "The result would replace the surface; take another folder."
    if read_stamp(target) == stamp:
        return ""  # from a run that was killed before it could say so
    return (
        f"{shown(target)} is there, and was not made from this file with these options; "
        "move it, or take another folder."
    )


def _mapped(task: Task, stamp: Stamp, record: Record) -> Record:
    notes: list[str] = []
    V, F = read_mesh(task.source, notes.append)
    record = replace(record, vertices=len(V), faces=len(F))
    n, m = len(V), len(F)
    if task.settings.clean:
        V, F, vertex_index, face_index = cleaned = clean(V, F)
        notes += cleaned.changes
        n, m = int((vertex_index >= 0).sum()), int((face_index >= 0).sum())
    result = disk_map(V, F, **task.settings.options)
    target = Path(task.target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(target) as unfinished:
            write_map(unfinished, V[:n], F[:m], result.uv[:n], disk=task.settings.disk)
            put_stamp(unfinished, stamp)
    except OSError as error:
        raise Unwritten(error.errno, error.strerror, task.target) from error
    return replace(
        record,
        status=DONE,
        changes=tuple(notes),
        disks=1,
        flips=len(result.certificate.flipped),
        mean=result.distortion.mean,
        sd=result.distortion.sd,
        area=float(np.abs(area_distortion(V, F, result.uv)).mean()),
        conformal=result.conformal,
        boundary=result.trace.name,
    )
