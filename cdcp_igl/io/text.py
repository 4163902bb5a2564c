"""Object and Wavefront files, off and obj: meshes as lines of words."""

from __future__ import annotations

import os
from array import array
from collections.abc import Callable, Iterator
from itertools import chain, islice
from pathlib import Path

import numpy as np

from ..arrays import Floats, Ints
from ..errors import Damage
from .polygons import triangles_of

# Of UTF-8, read as Latin-1: every sequence of bytes is text in Latin-1, and numbers and
# keywords are the same in both.
BYTE_ORDER_MARK = "\xef\xbb\xbf"

Lines = Iterator[tuple[int, list[str]]]  # number and words of each


def read_obj(path: Path) -> tuple[Floats, Ints, Ints]:
    """(n, 3) vertices, (m, 3) faces and (m,) their polygons; all else is skipped."""
    V, corners, sizes = polygons_of_obj(path)
    return V, *triangles_of(V, corners, sizes)


def polygons_of_obj(path: Path) -> tuple[Floats, Ints, Ints]:
    """(n, 3) vertices; the corners of all polygons in succession, and how many each has."""
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
    V = np.array(vertices).reshape(-1, 3)
    return V, np.array(corners, np.int64), np.array(sizes, np.int64)


def texture_of_obj(path: Path) -> Floats:
    """(k, 2) texture coordinates of the corners of `polygons_of_obj`, NaN where there are none."""
    texture, index = array("d"), array("q")
    for number, words in words_of_lines(path, continued=True):
        try:
            if words[0] == "vt":
                texture.extend((float(words[1]), float(words[2])))
            elif words[0] == "f":
                for word in words[1:]:
                    given = int([*word.split("/"), "0"][1] or 0)
                    index.append(given - 1 if given >= 0 else len(texture) // 2 + given)
        except (ValueError, IndexError, OverflowError):
            raise Damage(f"line {number}: no texture coordinates") from None
    rows, uv = np.array(index, np.int64), np.array(texture).reshape(-1, 2)
    if rows.min(initial=-1) < -1 or rows.max(initial=-1) >= len(uv):
        raise Damage("a face names texture coordinates that are not there")
    return np.vstack([uv, [[np.nan, np.nan]]])[rows]


def _corner(word: str) -> int:
    return array("q", [int(word.partition("/")[0])])[0]


def read_off(path: Path) -> tuple[Floats, Ints, Ints]:
    """(n, 3) vertices, (m, 3) faces and (m,) their polygons; normals and colours are skipped."""
    try:
        return _read_off(words_of_lines(path))
    except Damage as damage:  # or the lines mean nothing, as some programs write it
        try:
            return _read_off(_rows_of_words(words_of_lines(path)))
        except (Damage, ValueError):
            raise damage from None


def _rows_of_words(lines: Lines) -> Lines:
    """Yield the rows of an off file whose lines end anywhere; faces have no colours."""
    words = ((number, word) for number, line in lines for word in line)

    def row(length: int) -> tuple[int, list[str]]:
        numbered = list(islice(words, length))
        return numbered[-1][0] if numbered else 0, [word for _, word in numbered]

    yield (magic := row(1))
    yield (counts := row(3))
    columns = 3 + 4 * ("C" in magic[1][0]) + 3 * ("N" in magic[1][0])
    for _ in range(int(counts[1][0])):
        yield row(columns)
    while size := row(1)[1]:
        number, face = row(int(size[0]))
        yield number, size + face


def _read_off(lines: Lines) -> tuple[Floats, Ints, Ints]:
    vertices, corners, sizes = array("d"), array("q"), array("q")
    _, magic = next(lines, (1, [""]))
    if "BINARY" in magic:
        raise Damage("it is binary, and of off files only those of text are read")
    if magic[0] not in ("OFF", "COFF", "NOFF", "CNOFF"):
        raise Damage("the first line must be OFF, COFF, NOFF or CNOFF")
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
    V = np.array(vertices).reshape(-1, 3)
    return V, *triangles_of(V, corners, sizes)


def words_of_lines(path: Path, *, continued: bool = False) -> Lines:
    r"""Yield number and words of each line that is not empty, comments taken off.

    With `continued`, a line that ends with a backslash goes on in the next; it has the number
    of the last. Damage if it is no text: UTF-16, or binary.
    """
    before: list[str] = []
    with path.open(encoding="latin-1") as file:  # \r and \r\n end lines as \n does
        first = file.readline().removeprefix(BYTE_ORDER_MARK)
        if "\0" in first:
            raise Damage("it is no text in UTF-8 or Latin-1")
        for number, line in enumerate(chain([first], file), 1):
            if "#" in line:
                line = line.partition("#")[0]
            words = line.split()
            if continued and "\\" in line and words and words[-1].endswith("\\"):
                before += [*words[:-1], words[-1][:-1]]
                continue
            if before:
                words, before = [word for word in (*before, *words) if word], []
            if words:
                yield number, words
    if before:
        raise Damage("it ends in the middle of a line that goes on")


def decoded(name: str) -> str:
    """Return the name of a file that was read as Latin-1."""
    return os.fsdecode(name.encode("latin-1"))


def culprit(words: list[str], kind: Callable[[str], object], what: str) -> str:
    """Say which of the words is not of a kind; there is one."""
    for word in words:
        try:
            kind(word)
        except (ValueError, OverflowError):
            return f"{word!r} is no {what}"
    return f"it has too few {what}s"
