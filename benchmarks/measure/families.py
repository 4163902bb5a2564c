"""Disks of several families, from scans to those that need every mechanism of the rescue."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice

import igl
import numpy as np

from cdcp_igl import check, clean, surface_map
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.io import READABLE, read_mesh

from .models import GENERATED, Model, data, given, patches
from .punctures import opened, row_to_open

LENGTHS = (5, 10, 20, 22, 25, 40, 60, 80)  # of strips, by their width
CELLS = 10  # across a strip
GIVEN = "given"  # the family of models that are chosen by name
PLACES = (1, 2, 3)  # seeds of the places where a closed surface is opened
TUBES = ((4, 1, 1), (6, 1, 9), (8, 8, 2), (16, 1, 0.1), (32, 40, 8))  # sides, rows, length
BOXES = ((1, 1, 1), (4, 4, 4), (9, 9, 1), (12, 2, 1), (2, 2, 30))  # squares along each edge
FEW_FACES = 60  # of a chart


def family_of(model: str) -> str:
    """Name the family of a model."""
    name, found, _ = model.partition(": ")
    return name if found and name in FAMILIES else GIVEN


def disks(families: list[str], count: int, most: int) -> list[Model]:
    """Take from each family the first `count`, by size, with at most so many vertices."""
    found = []
    for family in families:
        small = (one for one in FAMILIES[family]() if len(one[1]) <= most)
        for name, V, F in islice(small, count):
            found.append(Model(f"{family}: {name}", partial(given, V, F)))
    return found


def _read(folder: str) -> Iterator[tuple[str, Floats, Ints]]:
    """Yield the surfaces of a folder of the data, from small to large files."""
    of_data = data()
    files = [] if of_data is None else (of_data / folder).glob("*")
    readable = (path for path in files if path.suffix in READABLE)
    for path in sorted(readable, key=lambda path: path.stat().st_size):
        yield path.stem, *read_mesh(path)


def _scans() -> Iterator[tuple[str, Floats, Ints]]:
    """Yield those at hand, or those that every machine has."""
    if data():
        yield from _read(".")
    else:
        yield from ((model.name, *model.load()) for model in GENERATED)


def _fuzzed() -> Iterator[tuple[str, Floats, Ints]]:
    for model in patches():
        yield model.name, *model.load()


def _punctured() -> Iterator[tuple[str, Floats, Ints]]:
    """Yield closed surfaces less a face."""
    for name, V, F in _read("any"):
        if check(V, F).kind == "genus 0, closed":
            yield from _opened(name, V, F, "face", PLACES)


def _opened(
    name: str, V: Floats, F: Ints, kind: str, places: tuple[int, ...]
) -> Iterator[tuple[str, Floats, Ints]]:
    for place in places:
        row = row_to_open(np.random.default_rng(place), V, F, kind)
        if row is not None:
            yield f"{name}, {kind} {row}", *opened(V, F, kind, row)


def _parts() -> Iterator[tuple[str, Floats, Ints]]:
    """Yield parts as scenes have them: tubes with one end, cans and boxes with a hole, plates."""
    for sides, rows, length in TUBES:
        P, F = igl.triangulated_grid(sides + 1, rows + 1)
        angle, name = 2 * np.pi * P[:, 0], f"{sides} sides, {length} long"
        V = np.column_stack([np.cos(angle), np.sin(angle), length * P[:, 1]])
        yield f"tube of {name}", *clean(V, F)[:2]
        yield from _opened(f"can of {name}", *clean(V, F, close=True)[:2], "face", PLACES[:1])
    for squares in BOXES:
        V, F = _box(squares)
        for kind in ("face", "vertex"):
            yield from _opened(f"box of {squares}", V, F, kind, PLACES[:1])


def _box(squares: tuple[int, ...]) -> tuple[Floats, Ints]:
    sides = []
    for axis in range(3):
        P, F = igl.triangulated_grid(*(np.roll(squares, -axis)[1:] + 1))
        for end in (0, 1):
            V = np.roll(np.column_stack([np.full(len(P), end), P]), axis, axis=1)
            sides.append((V * squares, F))
    starts = np.cumsum([0, *(len(V) for V, _ in sides)])
    faces = [F + start for (_, F), start in zip(sides, starts, strict=False)]
    return clean(np.vstack([V for V, _ in sides]), np.vstack(faces))[:2]


def _charts() -> Iterator[tuple[str, Floats, Ints]]:
    """Yield charts of few faces."""
    for name, V, F in _read("any"):
        for number, chart in enumerate(surface_map(V, F).charts):
            if len(chart.mesh.F) <= FEW_FACES:
                yield f"{name}, chart {number}", chart.mesh.V, chart.mesh.F


def _strips() -> Iterator[tuple[str, Floats, Ints]]:
    for length in LENGTHS:
        V, F = igl.triangulated_grid(CELLS * length + 1, CELLS + 1)
        yield f"{length}:1", V * [length, 1], F


FAMILIES: dict[str, Callable[[], Iterator[tuple[str, Floats, Ints]]]] = {
    "scans": _scans,
    "hard": partial(_read, "hard"),
    "fuzzed": _fuzzed,
    "punctured": _punctured,
    "strips": _strips,
    "parts": _parts,
    "charts": _charts,
}
