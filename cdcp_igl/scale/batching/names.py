"""Which files a batch maps, what their results are called, and the shares of job arrays."""

from __future__ import annotations

import glob
import hashlib
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import TypeVar

from ...errors import printable
from ...io import READABLE
from ...io.neuro import reads_as_neuro

Shard = tuple[int, int]  # part i of n, from 1

Item = TypeVar("Item")


def surface_files(
    inputs: str | os.PathLike[str] | Iterable[str | os.PathLike[str]], out: Path
) -> list[Path]:
    """List the files to map: those that are named, there or not, and those of folders and patterns.

    They are absolute, each once, in their order; those of a folder, with what is below it, or of
    a pattern sorted. What is in `out`, the folder of the results, is passed over. ValueError if a
    folder is not there, a folder or a pattern has no surface, or a folder is that of the results.
    """
    out = _resolved(out)
    if isinstance(inputs, str | os.PathLike):
        inputs = [inputs]
    return list(dict.fromkeys(file for given in inputs for file in _expand(Path(given), out)))


def _expand(given: Path, out: Path) -> Iterable[Path]:
    if os.path.isdir(given):  # and no error where a name is too long to be one
        found = _surfaces_below(_resolved(given), out)
    elif glob.has_magic(str(given)) and not os.path.exists(given):
        found = _surfaces_like(given, out)
    elif _readable(given) or os.path.exists(given):
        return [located(given)]
    else:
        raise ValueError(f"{printable(given)}: there is no such folder or surface")
    if not found:
        raise ValueError(f"{printable(given)}: no surface there ({' '.join(READABLE)})")
    return found


def _surfaces_below(folder: Path, out: Path) -> list[Path]:
    if folder == out:
        raise ValueError(f"{printable(folder)} is the folder of the results; give them another one")

    def walk() -> Iterator[Path]:
        for parent, folders, files in os.walk(folder):
            folders[:] = [name for name in folders if name[0] != "." and Path(parent, name) != out]
            yield from (Path(parent, name) for name in files if name[0] != ".")

    return sorted(filter(_readable, walk()))


def _surfaces_like(pattern: Path, out: Path) -> list[Path]:
    paths = {located(Path(path)) for path in glob.glob(str(pattern), recursive=True)}
    plain = Path(*takewhile(lambda part: not glob.has_magic(part), pattern.parts))
    if not _resolved(plain).is_relative_to(out):  # else that folder is meant, and named
        paths = {path for path in paths if not path.is_relative_to(out)}
    return sorted(path for path in paths if _readable(path) and path.is_file())


def _readable(path: Path) -> bool:
    return path.name.lower().endswith(READABLE) or (path.is_file() and reads_as_neuro(path))


def located(path: Path) -> Path:
    """Make a path absolute; one folder, however it is spelled, is one path."""
    # The last name stays, though it may be that of a symbolic link: people know the file by it.
    return _resolved(path) if path.name in ("", "..") else _resolved(path.parent) / path.name


def _resolved(path: Path) -> Path:
    """Follow symbolic links, as `Path.resolve` does, which raises RuntimeError where they loop."""
    return Path(os.path.realpath(path))


def result_names(files: list[Path]) -> list[str]:
    """Name the result of each file, `located`, without suffix and all different.

    The name of the file will do where it is the only one; files of one name in several
    folders keep the folders below the common one, and those of one name and folder their
    suffixes. Large and small letters count as equal, as they do to some file systems.
    """
    root = Path(os.path.commonpath([file.parent for file in files])) if files else Path()
    below = [file.relative_to(root) for file in files]
    spelled = [
        (
            path.stem,
            path.with_suffix("").as_posix(),
            path.as_posix(),
            f"{path.as_posix()}-{hashlib.sha256(os.fsencode(path)).hexdigest()[:8]}",
        )
        for path in below
    ]
    levels = [0] * len(files)
    while True:  # each name is spelled out three times at most
        names = [spellings[level] for spellings, level in zip(spelled, levels, strict=True)]
        count = Counter(name.casefold() for name in names)
        clashes = [
            i for i, name in enumerate(names) if count[name.casefold()] > 1 and levels[i] < 3
        ]
        if not clashes:
            return names
        for i in clashes:
            levels[i] += 1


def read_shard(text: str) -> Shard:
    """Read ``"i/n"``; ValueError if that is no part."""
    part, slash, parts = text.partition("/")
    if not (slash and part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
        raise ValueError("must be I/N, with I from 1 to N.")
    return int(part), int(parts)


def shard_of(items: Sequence[Item], shard: Shard | None) -> Sequence[Item]:
    """Take every n-th from the i-th on, or all; ValueError if there is no such part."""
    part, parts = shard or (1, 1)
    if not 1 <= part <= parts:
        raise ValueError(f"shard must be (i, n) with i from 1 to n, not {shard!r}")
    return items[part - 1 :: parts]
