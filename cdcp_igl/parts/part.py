"""The folder of a surface in parts, and a part as a mesh whose boundary are its seams, too."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from ..arrays import Bools, Floats, Ints, marked
from ..cached import cached_property
from ..io.output import whole_file
from ..surface.mesh import DiskMesh
from ..surface.topology import Edges, Topology
from ..surface.triangles import corner_cotangents
from .parting import MANIFEST

Arrays = dict[str, Any]


class Piece(DiskMesh):
    """Some faces of a surface, which need be no disk; on its `loop` the values are given.

    Parameters
    ----------
    V : (n, 3) float64
        In the unit of the whole surface.
    F : (m, 3) int64
    given : (k,) ndarray of int
        The vertices that count as its boundary, in any order.
    """

    def __init__(self, V: Floats, F: Ints, given: Ints) -> None:
        on_boundary = marked(len(V), given)
        self._set(
            V=V,
            F=F,
            loop=given,
            interior=np.flatnonzero(~on_boundary),
            on_boundary=on_boundary,
            cotangents=corner_cotangents(V, F),
        )

    @cached_property
    def edges(self) -> Edges:
        """Its undirected edges."""
        return Topology(self.F, len(self.V)).edges


@dataclass(frozen=True, eq=False)
class Part:
    """A part as it lies in its folder.

    Attributes
    ----------
    vertices : (n,) int64
        Rows of V of the whole surface, ascending.
    faces : (m,) int64
        Rows of F of the whole surface, ascending.
    V : (n, 3) float64
    F : (m, 3) int64
    seam : (n,) int64
        Row of each vertex in the table of seams, -1 of those in no other part.
    own : (n,) bool
        Which vertices count here, of those that are in several parts.
    """

    vertices: Ints
    faces: Ints
    V: Floats
    F: Ints
    seam: Ints
    own: Bools


@dataclass(frozen=True)
class Folder:
    """The parts of a surface, and beside them a folder of what is computed of them.

    Attributes
    ----------
    parts : Path
        Of the parts.
    work : Path
        Of what is computed.
    """

    parts: Path
    work: Path

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """Numbers of vertices and faces, levels of cuts, parts with faces, exponent of the unit."""
        manifest: dict[str, Any] = json.loads((self.parts / MANIFEST).read_text())
        return manifest

    @property
    def n_leaves(self) -> int:
        """How many parts there may be: part p is node p + this of a heap, whose root is 1."""
        return 1 << self.manifest["levels"]

    @cached_property
    def leaves(self) -> list[int]:
        """The parts that have faces."""
        return self.manifest["parts"]

    @cached_property
    def nodes(self) -> set[int]:
        """The nodes of the heap with faces below."""
        nodes, level = set[int](), {self.n_leaves + p for p in self.leaves}
        while level != {0}:
            nodes |= level
            level = {node // 2 for node in level}
        return nodes

    def part(self, p: int) -> Part:
        """Read a part."""
        return Part(**self.part_arrays(p))

    def part_arrays(self, p: int, *only: str) -> Arrays:
        """Read the arrays of a part, all or some."""
        return _read(self.parts / f"part-{p}.npz", *only)

    @cached_property
    def seams(self) -> Arrays:
        """``vertices`` in several parts, and the ``node`` of the heap that eliminates each."""
        return _read(self.parts / "seams.npz")

    def has(self, name: str) -> bool:
        """Whether something is computed."""
        return self._file(name).exists()

    def read(self, name: str, *only: str) -> Arrays:
        """Read the arrays of something that is computed, all or some."""
        return _read(self._file(name), *only)

    def write(self, name: str, arrays: Arrays) -> None:
        """Write arrays, all or nothing."""
        with whole_file(self._file(name)) as unfinished:
            np.savez(unfinished, **arrays)

    def has_face(self, p: int, face: int) -> bool:
        """Whether a part has a face, by its row."""
        return bool(among(np.array([face]), self.part_arrays(p, "faces")["faces"]).any())

    def remove(self, name: str) -> None:
        """Remove what is not needed any more."""
        self._file(name).unlink(missing_ok=True)

    def total_size(self) -> int:
        """How many bytes all that is computed has."""
        return sum(file.stat().st_size for file in self.work.glob("*.npz"))

    def keep_only(self, names: set[str]) -> None:
        """Remove the rest of what is computed."""
        for file in self.work.glob("*.npz"):
            if file.stem not in names:
                file.unlink()

    def _file(self, name: str) -> Path:
        return self.work / f"{name}.npz"


def _read(path: Path, *only: str) -> Arrays:
    with np.load(path) as archive:
        return {name: archive[name] for name in only or archive.files}


def among(some: Ints, rows: Ints) -> Bools:
    """(k,) which of k ascending rows are among some others."""
    mask = np.zeros(len(rows), dtype=bool)
    at = np.searchsorted(rows, some)
    inside = at < len(rows)
    at = at[inside]
    mask[at[rows[at] == some[inside]]] = True
    return mask


def named(what: Callable[..., Arrays], of: int, given: tuple[Any, ...] = ()) -> str:
    """Name the result of a step with a part or a cut, by all that it depends on."""
    name = f"{what.__name__}-{of}"
    return f"{name}-{crc32(repr(given).encode()):08x}" if given else name
