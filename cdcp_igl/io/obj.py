"""Wavefront obj files with texture coordinates: new ones, and given ones otherwise as they are."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from .polygons import rows_of_triangles
from .text import BYTE_ORDER_MARK, decoded, polygons_of_obj

ROWS = 1 << 16  # formatted at a time
WORD = re.compile(r"([^\s\\]+)")


def write_obj(
    path: Path,
    V: Floats,
    F: Ints,
    texture: Floats,
    FT: Ints,
    materials: str | None = None,
    colours: Floats | None = None,
) -> None:
    """Write a surface with texture coordinates, exact to the last bit.

    ``texture[FT]`` are those of the corners of F; where they are NaN, a face has none.
    `materials` is the name of the mtl file, whose material ``surface`` all faces get. Colours
    (n, 3) of the vertices are from 0 to 1.
    """
    with path.open("w", encoding="utf-8", newline="\n") as file:
        if materials:
            file.write(f"mtllib {materials}\n")
        rows = V if colours is None else np.hstack([V, colours])
        _write_rows(file, f"v{' %r' * rows.shape[1]}\n", rows)
        number = _write_texture(file, texture)
        if materials:
            file.write("usemtl surface\n")
        corners = np.stack([F + 1, number[FT]], axis=2).reshape(-1, 6)
        without = corners[:, 1] == 0
        ends = np.flatnonzero(without[1:] != without[:-1]) + 1
        for run in np.split(np.arange(len(F)), ends):
            if len(run) and without[run[0]]:
                _write_rows(file, "f %d %d %d\n", corners[run, ::2])
            else:
                _write_rows(file, "f %d/%d %d/%d %d/%d\n", corners[run])


def _write_texture(file: TextIO, texture: Floats, end: str = "\n") -> Ints:
    """Write the vt lines; return the number (k,) of each in the file, 0 where it is NaN."""
    there = ~np.isnan(texture).any(axis=1)
    _write_rows(file, f"vt %r %r{end}", texture[there])
    return np.where(there, np.cumsum(there), 0)


def _write_rows(file: TextIO, template: str, rows: NDArray[np.generic]) -> None:
    """Write each row of numbers by the same template."""
    for start in range(0, len(rows), ROWS):
        block = rows[start : start + ROWS]
        file.write(template * len(block) % tuple(block.ravel().tolist()))


def material_files(path: Path) -> list[Path]:
    """Return the files of materials that an obj file names, and that are there."""
    found = list[Path]()
    for line in re.findall(rb"^[ \t]*mtllib[ \t]([^\r\n]*)", path.read_bytes(), re.MULTILINE):
        words = line.decode("latin-1").partition("#")[0].split()
        files = [path.parent / decoded(name) for name in (" ".join(words), *words)]
        found += [file for file in dict.fromkeys(files) if file.is_file()]
    return found


def write_like(
    path: Path, given: Path, texture: Floats, FT: Ints, materials: str | None = None
) -> None:
    """Write a given obj file again, with other texture coordinates.

    Vertices, normals, groups, materials, comments and polygons stay as they are; in another
    folder, files of materials are named by the way to them from there. Only a
    polygon that was cut open within is written as triangles, with its texture coordinates
    on either side of the cut. ``texture[FT]`` are those of the corners of the triangles that
    `read_obj` makes of `given`. `materials` is the name of an mtl file instead of all others; if
    there are none, all faces get its material ``surface``.
    """
    faces: Iterator[tuple[Ints, Ints]] | None = None
    with path.open("w", encoding="latin-1", newline="") as file:
        if materials:
            file.write(f"mtllib {os.fsencode(materials).decode('latin-1')}\n")
            file.write("" if material_files(given) else "usemtl surface\n")
        for lines in _statements(given):
            if lines[0].startswith(("v ", "vn ")):  # most, and nothing is to be done
                file.writelines(lines)
                continue
            split = [_split(line) for line in lines]
            keyword, *words = [word for parts in split for word in parts[1::2]] or [""]
            name = keyword.removeprefix(BYTE_ORDER_MARK)
            if name == "vt" or (name == "mtllib" and materials):
                continue
            if name == "mtllib" and not path.parent.samefile(given.parent):
                words = _elsewhere(words, given.parent, path.parent)
                file.write(_joined(split, [keyword, *words]))
                continue
            if name == "f":
                if faces is None:
                    number = _write_texture(file, texture, _line_end(lines[0]))
                    faces = _in_polygons(given, number[FT])
                file.write(_face(split, keyword, words, *next(faces)))
            elif name == "l":
                file.write(_joined(split, [keyword, *(word.partition("/")[0] for word in words)]))
            else:
                file.writelines(lines)


def _statements(path: Path) -> Iterator[list[str]]:
    """Yield the lines of each statement, with their ends as they are."""
    lines: list[str] = []
    with path.open(encoding="latin-1", newline="") as file:
        for line in file:
            lines.append(line)
            if "\\" not in line or not line.partition("#")[0].rstrip().endswith("\\"):
                yield lines
                lines = []


def _split(line: str) -> list[str]:
    """Split a line into separators and words in turn; a comment is part of the last separator."""
    code, mark, comment = line.partition("#")
    parts = WORD.split(code)
    parts[-1] += mark + comment
    return parts


def _joined(split: list[list[str]], words: list[str]) -> str:
    """Join what was split, with other words."""
    following = iter(words)
    for parts in split:
        parts[1::2] = islice(following, len(parts) // 2)
    return "".join("".join(parts) for parts in split)


def _elsewhere(words: list[str], folder: Path, other: Path) -> list[str]:
    """Name files of a folder as they are found from another one; all words may be one name."""

    def is_there(name: str) -> bool:
        return (folder / decoded(name)).is_file()

    above = folder.resolve()
    with suppress(ValueError):  # from one drive of Windows there is no way to another
        above = Path(os.path.relpath(above, other.resolve()))
    there = os.fsencode(above.as_posix()).decode("latin-1")
    if is_there(" ".join(words)):
        return [f"{there}/{words[0]}", *words[1:]]
    return [f"{there}/{word}" if is_there(word) else word for word in words]


def _line_end(line: str) -> str:
    return line[len(line.rstrip("\r\n")) :] or "\n"


def _in_polygons(path: Path, texture: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Yield, of each polygon of an obj file, its corners (m, 3) of triangles, and `texture`'s."""
    V, corners, sizes = polygons_of_obj(path)
    ends = np.cumsum(sizes)
    rows, polygon = rows_of_triangles(V, corners, sizes)
    rows -= (ends - sizes)[polygon, None]
    parts = np.cumsum(sizes - 2)[:-1]
    yield from zip(np.split(rows, parts), np.split(texture, parts), strict=True)


def _face(
    split: list[list[str]], keyword: str, words: list[str], triangles: Ints, texture: Ints
) -> str:
    """Put texture coordinates into a face, into each of its triangles if its corners have two."""
    polygon = np.zeros(len(words), np.int64)
    polygon[triangles] = texture
    if (polygon[triangles] == texture).all():
        return _joined(split, [keyword, *map(_corner, words, polygon.tolist())])
    end = _line_end(split[-1][-1])
    return "".join(
        " ".join([keyword, *map(_corner, (words[k] for k in corners), triangle)]) + end
        for corners, triangle in zip(triangles.tolist(), texture.tolist(), strict=True)
    )


def _corner(word: str, texture: int) -> str:
    """Put the number of a vt line into a corner; 0 is none."""
    vertex, _, *normal = word.split("/") if "/" in word else (word, "")
    if not texture and not normal:
        return vertex
    return "/".join([vertex, str(texture or ""), *normal])
