"""Wavefront obj files."""

from __future__ import annotations

from array import array
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from .polygons import fans

__all__ = ["read_obj", "write_obj"]

ROWS = 1 << 16  # formatted at a time


def read_obj(path: Path) -> tuple[Floats, Ints]:
    """(n, 3) vertices and (m, 3) faces; texture coordinates, normals, groups are skipped."""
    vertices, corners, sizes = array("d"), array("q"), array("q")
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            keyword, *words = line.split() or [b""]
            try:
                if keyword == b"v":
                    x, y, z, *_ = map(float, words)  # a weight or a colour may follow
                    vertices.extend((x, y, z))
                elif keyword == b"f":
                    seen = len(vertices) // 3
                    for word in words:
                        index = int(word.partition(b"/")[0])
                        corners.append(index - 1 if index >= 0 else seen + index)
                    sizes.append(len(words))
            except (ValueError, OverflowError) as error:
                raise ValueError(f"line {number}: {error}") from error
    return np.array(vertices).reshape(-1, 3), fans(corners, sizes)


def write_obj(path: Path, V: Floats, F: Ints, uv: Floats) -> None:
    """Write a surface with a texture coordinate for each vertex, exact to the last bit."""
    with path.open("w", encoding="ascii") as file:
        _write_rows(file, "v %r %r %r\n", V)
        _write_rows(file, "vt %r %r\n", uv)
        _write_rows(file, "f %d/%d %d/%d %d/%d\n", np.repeat(F + 1, 2, axis=1))


def _write_rows(file: TextIO, template: str, rows: NDArray[np.generic]) -> None:
    for start in range(0, len(rows), ROWS):
        block = rows[start : start + ROWS]
        file.write(template * len(block) % tuple(block.ravel().tolist()))
