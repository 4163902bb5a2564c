"""Whether a file may be written, known before there is anything to write."""

from __future__ import annotations

import errno
import hashlib
import os
from collections.abc import Callable
from pathlib import Path

from ..errors import printable
from .stamps import Stamp, read_stamp

__all__ = ["digest_of", "objection", "refuse_another"]


def digest_of(path: Path) -> str:
    """SHA-256 of the bytes of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def objection(target: Path, source: Path, ours: Callable[[Stamp | None], bool], remedy: str) -> str:
    """Say why what is there must not be replaced; nothing if it may.

    Parameters
    ----------
    target, source : Path
        The file to write, and the surface it is made from.
    ours : callable
        Whether a file with this mark, or None, may be made again.
    remedy : str
        For the message.
    """
    if not target.exists():
        return ""
    if os.path.samefile(source, target):
        return f"{printable(target)} is the surface itself; give the result another place."
    if not target.is_file() or target.stat().st_size == 0:
        return ""  # a device or a pipe, which is written to and not replaced; nothing to lose
    if ours(read_stamp(target)):
        return ""
    return f"{printable(target)} is there, and was not made from {printable(source.name)}{remedy}."


def refuse_another(target: Path, ours: Callable[[Path], object], what: str) -> None:
    """Raise FileExistsError if there is a file that is not such as we write."""
    if target.is_file() and not ours(target):
        reason = f"{what}; move it, or name another place"
        raise FileExistsError(errno.EEXIST, reason, os.fspath(target))
