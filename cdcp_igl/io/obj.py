"""Wavefront obj files."""

from __future__ import annotations

from array import array
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from .damage import Damage
from .lines import culprit, words_of_lines
from .polygons import fans

__all__ = ["read_obj", "write_obj", "write_texture"]

ROWS = 1 << 16  # formatted at a time


def read_obj(path: Path) -> tuple[Floats, Ints, Ints]:
    """(n, 3) vertices, (m, 3) faces and (m,) their polygons; all else is skipped."""
    vertices, corners, sizes = array("d"), array("q"), array("q")
    for number, words in words_of_lines(path, continued=True):
        if words[0] == "v":
            try:
                # A weight or a colour may follow.
                vertices.extend((float(words[1]), float(words[2]), float(words[3])))
            except (ValueError, IndexError):
                raise Damage(f"line {number}: {culprit(words[1:], float, 'number')}") from None
        elif words[0] == "f":
            seen = len(vertices) // 3
            try:
                indices = [int(word.partition("/")[0]) for word in words[1:]]
                corners.extend([i - 1 if i >= 0 else seen + i for i in indices])
            except (ValueError, OverflowError):
                raise Damage(f"line {number}: {culprit(words[1:], _corner, 'corner')}") from None
            sizes.append(len(words) - 1)
    if len(corners) and min(corners) < 0:
        raise Damage("a face names vertex 0, or one before the first; vertices count from 1")
    return np.array(vertices).reshape(-1, 3), *fans(corners, sizes)


def _corner(word: str) -> int:
    return array("q", [int(word.partition("/")[0])])[0]


def write_obj(
    path: Path, V: Floats, F: Ints, texture: Floats, FT: Ints, materials: str | None = None
) -> None:
    """Write a surface with texture coordinates, exact to the last bit.

    Parameters
    ----------
    path : Path
    V : (n, 3) float64
    F : (m, 3) int64
    texture : (k, 2) float64
        Where it is NaN, faces have no texture coordinates.
    FT : (m, 3) int64
        Rows of `texture` at the corners of the faces.
    materials : str, optional
        Name of the mtl file, whose material ``surface`` all faces get.
    """
    with path.open("w", encoding="utf-8", newline="\n") as file:
        if materials:
            file.write(f"mtllib {materials}\n")
        write_rows(file, "v %r %r %r\n", V)
        number = write_texture(file, texture)
        if materials:
            file.write("usemtl surface\n")
        corners = np.stack([F + 1, number[FT]], axis=2).reshape(-1, 6)
        without = corners[:, 1] == 0
        ends = np.flatnonzero(without[1:] != without[:-1]) + 1
        for run in np.split(np.arange(len(F)), ends):
            if len(run) and without[run[0]]:
                write_rows(file, "f %d %d %d\n", corners[run, ::2])
            else:
                write_rows(file, "f %d/%d %d/%d %d/%d\n", corners[run])


def write_texture(file: TextIO, texture: Floats, end: str = "\n") -> Ints:
    """Write the vt lines; return the number (k,) of each in the file, 0 where it is NaN."""
    there = ~np.isnan(texture).any(axis=1)
    write_rows(file, f"vt %r %r{end}", texture[there])
    return np.where(there, np.cumsum(there), 0)


def write_rows(file: TextIO, template: str, rows: NDArray[np.generic]) -> None:
    """Write each row of numbers by the same template."""
    for start in range(0, len(rows), ROWS):
        block = rows[start : start + ROWS]
        file.write(template * len(block) % tuple(block.ravel().tolist()))
