"""A given obj file, with texture coordinates put in and all else as it is."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice, pairwise
from pathlib import Path

from ..arrays import Floats, Ints
from .lines import BYTE_ORDER_MARK
from .obj import write_texture

__all__ = ["write_like"]

WORD = re.compile(r"([^\s\\]+)")


def write_like(path: Path, given: Path, texture: Floats, FT: Ints) -> None:
    """Write an obj file again, with other texture coordinates.

    Vertices, normals, groups, materials, comments and polygons stay as they are. Only a
    polygon that was cut open within is written as triangles, with its texture coordinates
    on either side of the cut.

    Parameters
    ----------
    path, given : Path
        Where to write, and what to read.
    texture : (k, 2) float64
    FT : (m, 3) int64
        Rows of `texture` at the corners of the triangles that `read_obj` makes of `given`.
    """
    triangles: Iterator[list[int]] | None = None
    with path.open("w", encoding="latin-1", newline="") as file:
        for lines in _statements(given):
            if lines[0].startswith(("v ", "vn ")):  # most, and nothing is to be done
                file.writelines(lines)
                continue
            split = [_split(line) for line in lines]
            keyword, *words = [word for parts in split for word in parts[1::2]] or [""]
            name = keyword.removeprefix(BYTE_ORDER_MARK)
            if name == "vt":
                continue
            if name == "f":
                if triangles is None:
                    number = write_texture(file, texture, _line_end(lines[0]))
                    triangles = iter(number[FT].tolist())
                fan = list(islice(triangles, len(words) - 2))
                file.write(_face(split, keyword, words, fan))
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
            if "\\" not in line or not _code(line).rstrip().endswith("\\"):
                yield lines
                lines = []


def _code(line: str) -> str:
    return line.partition("#")[0]


def _split(line: str) -> list[str]:
    """Split a line into what is between words, even, and words, odd; comments are no words."""
    if "#" in line:
        code = _code(line)
        parts = WORD.split(code)
        parts[-1] += line[len(code) :]
        return parts
    return WORD.split(line)


def _line_end(line: str) -> str:
    return line[len(line.rstrip("\r\n")) :] or "\n"


def _face(split: list[list[str]], keyword: str, words: list[str], fan: list[list[int]]) -> str:
    """Put texture coordinates into a face; `fan` has them for each of its triangles."""
    whole = all(triangle[0] == fan[0][0] for triangle in fan)
    if whole and all(one[2] == other[1] for one, other in pairwise(fan)):
        polygon = [*fan[0], *(triangle[2] for triangle in fan[1:])]
        return _joined(split, [keyword, *map(_corner, words, polygon)])
    end = _line_end(split[-1][-1])
    return "".join(
        " ".join([keyword, *map(_corner, (words[0], *words[k : k + 2]), triangle)]) + end
        for k, triangle in enumerate(fan, 1)
    )


def _corner(word: str, texture: int) -> str:
    """Put the number of a vt line into a corner; 0 is none."""
    if "/" not in word:
        return f"{word}/{texture}" if texture else word
    vertex, _, *normal = word.split("/")
    if not texture and not normal:
        return vertex
    return "/".join([vertex, str(texture or ""), *normal])


def _joined(split: list[list[str]], words: list[str]) -> str:
    """Join what was split, with other words."""
    following = iter(words)
    for parts in split:
        parts[1::2] = islice(following, len(parts) // 2)
    return "".join("".join(parts) for parts in split)
