"""The folder of a surface in parts, and a part as a mesh whose boundary are its seams, too."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from ..arrays import Bools, Floats, Ints, marked
from ..cached import cached_property
from ..io.output import whole_file
from ..solve.factored import FactoredSurface
from ..solve.laplacian import cotangent_laplacian
from ..steps.extension import harmonic_extension
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
class Folder:
    """The parts of a surface, and beside them a folder of what is computed of them.

    Attributes
    ----------
    parts, work : Path
        Of the parts, and of what is computed.
    manifest : dict
        Numbers of vertices and faces, levels of cuts, parts with faces, exponent of the unit.
    """

    parts: Path
    work: Path
    manifest: dict[str, Any]

    @classmethod
    def of(cls, parts: Path, work: str) -> Folder:
        """Open what `partition` has made."""
        return cls(parts, parts / work, json.loads((parts / MANIFEST).read_text()))

    @property
    def n_leaves(self) -> int:
        """How many parts there may be: part p is node p + this of a heap, whose root is 1."""
        return 1 << self.manifest["levels"]

    @property
    def leaves(self) -> list[int]:
        """The parts that have faces."""
        leaves: list[int] = self.manifest["parts"]
        return leaves

    @cached_property
    def nodes(self) -> set[int]:
        """The nodes of the heap with faces below."""
        ups = range(self.manifest["levels"] + 1)
        return {(self.n_leaves + p) >> up for p in self.leaves for up in ups}

    @property
    def cuts(self) -> list[int]:
        """The nodes that have others below, from the root."""
        return sorted(node for node in self.nodes if node < self.n_leaves)

    def part(self, p: int, *only: str) -> Arrays:
        """Read the arrays of a part, all or some."""
        return _read(self.parts / f"part-{p}.npz", *only)

    @cached_property
    def seams(self) -> Ints:
        """(s,) the node of the heap that eliminates each vertex that is in several parts."""
        node: Ints = _read(self.parts / "seams.npz", "node")["node"]
        return node

    def has(self, name: str) -> bool:
        """Whether something is computed."""
        return self._file(name).exists()

    def read(self, name: str, *only: str) -> Arrays:
        """Read the arrays of something that is computed, all or some."""
        return _read(self._file(name), *only)

    def each(self, names: Iterable[str], *only: str) -> tuple[list[Any], ...]:
        """Read some arrays of several things: a list of each array."""
        found = [self.read(name, *only) for name in names]
        return tuple([arrays[key] for arrays in found] for key in only)

    def write(self, name: str, arrays: Arrays) -> None:
        """Write arrays, all or nothing."""
        with whole_file(self._file(name)) as unfinished:
            np.savez(unfinished, **arrays)

    def remove(self, name: str) -> None:
        """Remove what is not needed any more."""
        self._file(name).unlink(missing_ok=True)

    def computed(self) -> list[Path]:
        """List the files of what is computed, but for the map itself."""
        return list(self.work.glob("*.npz"))

    def uv(self, p: int) -> Floats:
        """Read the map of a part."""
        uv: Floats = np.load(self.work / f"uv-{p}.npy")
        return uv

    def write_uv(self, p: int, uv: Floats) -> None:
        """Write the map of a part."""
        file = BytesIO()  # to files, NumPy does not say why it cannot write
        np.save(file, uv)
        with whole_file(self.work / f"uv-{p}.npy") as unfinished:
            unfinished.write_bytes(file.getvalue())

    def _file(self, name: str) -> Path:
        return self.work / f"{name}.npz"


class Part:
    """A part with its seams and its boundary; inside are its other vertices.

    Attributes
    ----------
    vertices, faces : (n,), (m,) int64
        Rows of V and of F of the whole surface, ascending.
    V : (n, 3) float64
    F : (m, 3) int64
    row : (n,) int64
        Of each vertex in the table of seams, -1 of those in no other part.
    own : (n,) bool
        Which vertices count here, of those that are in several parts.
    """

    vertices: Ints
    faces: Ints
    V: Floats
    F: Ints
    row: Ints
    own: Bools

    def __init__(self, folder: Folder, p: int) -> None:
        self._folder, self._p = folder, p
        vars(self).update(folder.part(p))

    @cached_property
    def _place(self) -> Ints:
        loop = self._folder.read("loop")["loop"]
        order = np.argsort(loop)
        place: Ints = np.full(len(self.vertices), -1)
        place[among(loop[order], self.vertices)] = order[among(self.vertices, loop[order])]
        return place

    @property
    def border(self) -> Ints:
        """(b,) vertices on the boundary of the surface."""
        return np.flatnonzero(self._place >= 0)

    @property
    def places(self) -> Ints:
        """(b,) their places on its loop."""
        return self._place[self.border]

    @property
    def seam(self) -> Ints:
        """(s,) vertices on seams and not on the boundary."""
        return np.flatnonzero((self.row >= 0) & (self._place < 0))

    @property
    def rows(self) -> Ints:
        """(s,) their rows in the table of seams."""
        return self.row[self.seam]

    @cached_property
    def piece(self) -> Piece:
        """The part as a mesh, whose boundary are its seams and then the boundary."""
        return Piece(self.V, self.F, np.concatenate([self.seam, self.border]))

    @cached_property
    def factored(self) -> FactoredSurface:
        """What is inside, factored in the order that was found when the part was condensed."""
        order = self._folder.read(f"eliminate-{self._p}", "order")["order"]
        return FactoredSurface(self.piece, cotangent_laplacian(self.piece), order=order)

    @property
    def sources(self) -> Floats:
        """(n,) right-hand side of the torsion function; of seams, in one part only."""
        return ((self.row < 0) | self.own).astype(float)

    def torsion(self) -> Floats:
        """(m,) sums of the torsion function over the corners of the faces."""
        on_seams = self._folder.read("torsion")["torsion"][self.rows]
        on_given = np.concatenate([on_seams, np.zeros(len(self.border))])
        u = self.factored.solve(self.sources) + harmonic_extension(self.factored, on_given)
        i, j, k = u[self.F.T]
        return i + j + k

    def some(self, here: Bools, f: Any) -> Arrays:
        """Return some faces: rows, corners, positions, images, and which are on the boundary."""
        F = self.F[here]
        return {
            "faces": self.faces[here],
            "corners": self.vertices[F],
            "V": self.V[F],
            "images": f[F],
            "on_boundary": (self._place >= 0)[F],
        }


def _read(path: Path, *only: str) -> Arrays:
    with np.load(path) as archive:
        return {name: archive[name] for name in only or archive.files}


def among(some: Ints, rows: Ints) -> Bools:
    """(k,) which of k rows are among some others, which ascend."""
    found: Bools = np.append(some, -1)[np.searchsorted(some, rows)] == rows
    return found


def named(what: Callable[..., Arrays], of: int, *given: Any) -> str:
    """Name the result of a step with a part or a cut, by all that it depends on."""
    name = f"{what.__name__}-{of}"
    return f"{name}-{crc32(repr(given).encode()):08x}" if given else name
