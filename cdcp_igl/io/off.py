"""Object file format, off."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ..arrays import Floats, Ints
from .polygons import fans

__all__ = ["read_off"]


def read_off(path: Path) -> tuple[Floats, Ints]:
    """(n, 3) vertices and (m, 3) faces; normals and colours are skipped."""
    vertices, corners, sizes = array("d"), array("q"), array("q")
    with path.open("rb") as file:
        lines = _lines(file)
        _, magic = next(lines, (1, [b""]))
        if magic[0] not in (b"OFF", b"COFF", b"NOFF", b"CNOFF"):
            raise ValueError("the first line must be OFF, COFF, NOFF or CNOFF")
        number, counts = (1, magic[1:]) if len(magic) > 1 else next(lines, (2, []))
        try:
            n, m = map(int, counts[:2])
            for number, words in islice(lines, max(n, 0)):  # noqa: B007 - for the message
                x, y, z, *_ = map(float, words)
                vertices.extend((x, y, z))
            for number, (size, *words) in islice(lines, max(m, 0)):  # noqa: B007
                sizes.append(int(size))
                corners.extend(map(int, words[: sizes[-1]]))
                if len(words) < sizes[-1]:
                    raise ValueError("a corner is missing")
        except (ValueError, OverflowError) as error:
            raise ValueError(f"line {number}: {error}") from error
    if (len(vertices), len(sizes)) != (3 * n, m):
        raise ValueError(
            f"{len(vertices) // 3:,} vertices and {len(sizes):,} faces of {n:,} and {m:,}"
        )
    return np.array(vertices).reshape(-1, 3), fans(corners, sizes)


def _lines(file: BinaryIO) -> Iterator[tuple[int, list[bytes]]]:
    """Yield number and words of each line that is not empty, comments taken off."""
    for number, line in enumerate(file, 1):
        if words := line.partition(b"#")[0].split():
            yield number, words
