"""Object file format, off."""

from __future__ import annotations

from array import array
from itertools import islice
from pathlib import Path

import numpy as np

from ..arrays import Floats, Ints
from .damage import Damage
from .lines import culprit, words_of_lines
from .polygons import fans

__all__ = ["read_off"]


def read_off(path: Path) -> tuple[Floats, Ints, Ints]:
    """(n, 3) vertices, (m, 3) faces and (m,) their polygons; normals and colours are skipped."""
    vertices, corners, sizes = array("d"), array("q"), array("q")
    lines = words_of_lines(path)
    _, magic = next(lines, (1, [""]))
    if magic[0] not in ("OFF", "COFF", "NOFF", "CNOFF") or "BINARY" in magic:
        raise Damage("the first line must be OFF, COFF, NOFF or CNOFF, followed by text")
    number, words = (1, magic[1:]) if len(magic) > 1 else next(lines, (2, []))
    try:
        n, m = map(int, words[:2])
    except ValueError:
        raise Damage(f"line {number}: {culprit(words[:2], int, 'count')}") from None
    if min(n, m) < 0:
        raise Damage(f"line {number}: a count is negative")
    for number, words in islice(lines, n):
        try:
            x, y, z, *_ = map(float, words)
        except ValueError:
            raise Damage(f"line {number}: {culprit(words, float, 'number')}") from None
        vertices.extend((x, y, z))
    for number, words in islice(lines, m):
        try:
            size, *face = map(int, words[: int(words[0]) + 1])  # colours may follow
            corners.extend(face)
        except (ValueError, OverflowError):
            raise Damage(f"line {number}: {culprit(words, int, 'index')}") from None
        if len(face) != size:
            raise Damage(f"line {number}: a corner is missing")
        sizes.append(size)
    if (len(vertices), len(sizes)) != (3 * n, m):
        raise Damage(f"{len(vertices) // 3:,} vertices and {len(sizes):,} faces of {n:,} and {m:,}")
    return np.array(vertices).reshape(-1, 3), *fans(corners, sizes)
