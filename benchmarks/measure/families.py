"""Disks of several families, from scans to those that need every mechanism of the rescue."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice

import igl
import numpy as np

from cdcp_igl import check
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.io import READABLE, read_mesh

from .models import GENERATED, Model, data, given, patches
from .punctures import opened, row_to_open

LENGTHS = (5, 10, 20, 22, 25, 40, 60, 80)  # of strips, by their width
CELLS = 10  # across a strip
GIVEN = "given"  # the family of models that are chosen by name
SEED = 1  # of the places where a closed surface is opened


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
            row = row_to_open(np.random.default_rng(SEED), V, F, "face")
            if row is not None:
                yield name, *opened(V, F, "face", row)


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
}
