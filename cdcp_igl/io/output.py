"""Files that appear whole or not at all."""

from __future__ import annotations

import csv
import errno
import os
import secrets
import shutil
import stat
import time
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any

# Of an unfinished file. What follows does not hold the name of the target, which may be as long as
# names can be.
_PREFIX = ".cdcp_igl-"
_DAY = 86_400.0  # seconds


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[Path]:
    """Let the body write a file that takes its place only when it is complete.

    The body is given an empty file of the same type in the folder of `path`, or of what a
    symbolic link points to. At the end it replaces what is there, and keeps its permissions.
    If the body fails, the old file stays. A device or a pipe is given to the body as it is. An
    OSError names `path`.
    """
    unfinished = None
    try:
        there = _status(path)
        if there and not stat.S_ISREG(there.st_mode):
            yield Path(path)
            return
        target = Path(os.path.realpath(path))
        _remove_stale_once(target.parent)
        unfinished = target.with_name(f"{_PREFIX}{secrets.token_hex(8)}{target.suffix}")
        unfinished.touch(exist_ok=False)
        if there:
            shutil.copymode(target, unfinished)
        yield unfinished
        with unfinished.open("rb+") as file:  # lest a power failure leave an empty one
            os.fsync(file.fileno())
        unfinished.replace(target)
    except OSError as error:
        named = os.path.basename(str(error.filename or _PREFIX))
        if error.errno is None or not named.startswith(_PREFIX):
            raise
        # Nobody knows the unfinished file: name what was asked for.
        missing = error.errno == errno.ENOENT and not os.path.isdir(Path(path).parent)
        reason = "there is no such folder" if missing else error.strerror
        raise OSError(error.errno, reason, os.fspath(path)) from error
    finally:
        if unfinished:
            unfinished.unlink(missing_ok=True)


def write_text(path: str | PathLike[str], text: str) -> None:
    """Write a whole file of text in UTF-8."""
    with whole_file(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def write_table(path: str | PathLike[str], columns: Collection[str], rows: Iterable[Any]) -> None:
    """Write a whole csv file of rows that have the columns as keys, empty where there is None."""
    with (
        whole_file(path) as unfinished,
        unfinished.open("w", newline="", encoding="utf-8", errors="backslashreplace") as file,
    ):
        writer: csv.DictWriter[str] = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)


class _Tried(Exception):
    """Nothing is to be written yet."""


def try_to_write(path: str | PathLike[str]) -> None:
    """Raise OSError if a file cannot be written; leave what is there as it is."""
    path = Path(path)
    if path.exists() and not path.is_file() and not path.is_dir():
        return  # who reads from a pipe would take the trial for the end of the file
    with suppress(_Tried), whole_file(path):
        raise _Tried


def _status(path: str | PathLike[str]) -> os.stat_result | None:
    """Return what is there, None if nothing is; OSError if it must not be replaced."""
    try:
        there = os.stat(path)
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(there.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return there


def remove_stale(folder: str | PathLike[str], age: float = _DAY) -> None:
    """Remove what a process that was killed has left unfinished in a folder so many seconds ago.

    Whether it still lives cannot be asked on another machine, or of another container.
    """
    with suppress(OSError):
        for path in Path(folder).glob(f"{_PREFIX}*"):
            if time.time() - path.stat().st_mtime > age:
                path.unlink(missing_ok=True)


_remove_stale_once = cache(remove_stale)
