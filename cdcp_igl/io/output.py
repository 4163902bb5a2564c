"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from io import BufferedRandom, BufferedWriter
from itertools import count
from os import PathLike
from pathlib import Path
from platform import node
from tempfile import TemporaryDirectory
from zlib import crc32

__all__ = ["remove_stale", "try_to_write", "whole_file"]

# The name of an unfinished file tells who writes it: the machine, as several may share the
# folder; the process; and when that began, as numbers of processes come again. It does not
# hold the name of the target, which may be as long as names can be.
_PREFIX = ".cdcp_igl"
_MACHINE = f"{crc32(node().encode()):08x}"
_BORN = secrets.token_hex(4)
_SERIAL = count()
_DAY = 86_400  # seconds


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[Path]:
    """Let the body write a file that takes its place only when it is complete.

    Parameters
    ----------
    path : path-like
        The file to create or to replace; what a symbolic link points to. It keeps its mode
        and its owner. One that has other names (hard links) keeps them, too, and is written
        over for that, once all is there; and so is a device or a FIFO.

    Yields
    ------
    Path
        An empty file, as a rule in the same folder, of the same type. It is moved to `path`
        at the end, or removed if the body fails.

    Raises
    ------
    OSError
        If it cannot be written. It names `path`.
    """
    unfinished = None
    try:
        there = _status(path)
        if there is None or stat.S_ISREG(there.st_mode):
            target = Path(os.path.realpath(path))
            _remove_stale_once(target.parent)
            unfinished = _created(target, there)
            yield unfinished
            with unfinished.open("rb+") as file:  # lest a power failure leave an empty one
                os.fsync(file.fileno())
            if there is not None and there.st_nlink > 1:
                _overwrite(target, unfinished)  # to move it would cut the links
            else:
                unfinished.replace(target)
        else:
            with TemporaryDirectory() as folder, _open_stream(path) as stream:
                whole = Path(folder, f"whole{Path(path).suffix}")
                whole.touch()
                yield whole
                with whole.open("rb") as file:
                    shutil.copyfileobj(file, stream)
    except OSError as error:
        named = os.path.basename(str(error.filename or _PREFIX))
        if error.errno is None or not named.startswith(_PREFIX):
            raise
        # Nobody knows the unfinished file: name what was asked for.
        raise OSError(error.errno, error.strerror, os.fspath(path)) from error
    finally:
        if unfinished:
            unfinished.unlink(missing_ok=True)


class _Tried(Exception):
    """Nothing is to be written yet."""


def try_to_write(path: str | PathLike[str]) -> None:
    """Raise OSError if a file cannot be written; leave what is there as it is."""
    path = Path(path)
    if path.exists() and not path.is_file() and not path.is_dir():
        return  # who reads from a pipe would take the trial for the end of the file
    try:
        with whole_file(path):
            raise _Tried
    except _Tried:
        return


def _status(path: str | PathLike[str]) -> os.stat_result | None:
    """Of what is there; None if nothing is. OSError if it must not be replaced."""
    try:
        there = os.stat(path)
    except FileNotFoundError:
        return None
    if stat.S_ISDIR(there.st_mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    return there


def _created(target: Path, there: os.stat_result | None) -> Path:
    """Create an empty file of a name of its own; no more people may read it than the target."""
    name = f"{_PREFIX}-{_MACHINE}-{os.getpid()}-{_BORN}-{next(_SERIAL)}{target.suffix}"
    unfinished = target.with_name(name)
    mode = 0o666 if there is None else 0o600
    os.close(os.open(unfinished, os.O_CREAT | os.O_EXCL | os.O_WRONLY, mode))
    if there is not None:
        with suppress(OSError, AttributeError):  # only root may give files away
            os.chown(unfinished, there.st_uid, there.st_gid)
        os.chmod(unfinished, stat.S_IMODE(there.st_mode))
    return unfinished


def _overwrite(target: Path, whole: Path) -> None:
    """Copy a file over another one, which stays as it was if the disk is full."""
    size = whole.stat().st_size
    with whole.open("rb") as source, target.open("rb+") as file:
        _reserve(file, size)
        shutil.copyfileobj(source, file)
        file.truncate(size)


def _reserve(file: BufferedRandom, size: int) -> None:
    """Take the space for so many bytes, where the system can; OSError if there is none."""
    before = os.fstat(file.fileno()).st_size
    try:
        if size:
            os.posix_fallocate(file.fileno(), 0, size)
    except AttributeError:  # another system
        return
    except OSError as error:
        file.truncate(before)
        if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP):  # this file system cannot
            raise


def _open_stream(path: str | PathLike[str]) -> BufferedWriter:
    """Open a device or a FIFO; OSError if nobody reads from the FIFO."""
    descriptor = os.open(path, os.O_WRONLY | getattr(os, "O_NONBLOCK", 0))
    os.set_blocking(descriptor, True)
    return os.fdopen(descriptor, "wb")


def remove_stale(folder: str | PathLike[str]) -> list[Path]:
    """Remove what processes that were killed have left unfinished in a folder.

    Parameters
    ----------
    folder : path-like

    Returns
    -------
    list of Path
        What was removed. Files of other machines stay, and on systems where one cannot ask
        whether a process is alive, those of the last day.
    """
    removed = []
    with suppress(OSError):
        for path in Path(folder).glob(f"{_PREFIX}-{_MACHINE}-*-*-*"):
            pid, born = path.name.split("-")[2:4]
            if pid.isdecimal() and not _alive(int(pid), born, path):
                path.unlink(missing_ok=True)
                removed.append(path)
    return removed


_remove_stale_once = cache(remove_stale)


def _alive(pid: int, born: str, path: Path) -> bool:
    if pid == os.getpid():
        return born == _BORN
    if os.name != "posix":
        return time.time() - path.stat().st_mtime < _DAY
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        pass
    # Nobody may have asked how it ended: in containers orphans remain where init does not.
    with suppress(OSError):
        return not Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].startswith(b" Z")
    return True
