"""The folder of a surface in parts, a part of it, and some faces of several parts."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO
from zlib import crc32

import numpy as np

from ...arrays import Bools, Complex, Floats, Ints
from ...cached import cached_property
from ...errors import Defect, MeshError
from ...io.output import whole_file
from ...io.reading import DAMAGE
from ...solve.factored import FactoredSurface, harmonic_extension
from ...solve.laplacian import cotangent_laplacian
from ...steps.center import most_central
from ...surface.mesh import Mesh
from ...surface.triangles import corner_angles
from .parting import MANIFEST

Arrays = dict[str, Any]
GIVEN = "part-", "seams"  # what `partition` has made


@dataclass(frozen=True)
class Folder:
    """The parts of a surface, and beside them a folder of what is computed of them.

    Attributes
    ----------
    path, work : Path
        Of the parts, and of what is computed.
    vertices, faces, seams : int
        How many the whole has; `seams` are the vertices that are in several parts.
    parts : list of int
        Those that have faces. Part p is node p + `n_leaves` of a heap, whose root is 1.
    levels : int
        Of cuts.
    exponent : int
        Of the unit, a power of 2.
    """

    path: Path
    work: Path
    vertices: int
    faces: int
    seams: int
    parts: list[int]
    levels: int
    exponent: int

    @classmethod
    def of(cls, path: Path, work: str) -> Folder:
        """Open what `partition` has made."""
        with undamaged(path / MANIFEST) as file:
            return cls(path, path / work, **json.load(file))

    @property
    def n_leaves(self) -> int:
        """How many parts there may be."""
        return 1 << self.levels

    @property
    def nodes(self) -> set[int]:
        """The nodes of the heap with faces below."""
        return {(self.n_leaves + p) >> up for p in self.parts for up in range(self.levels + 1)}

    @property
    def cuts(self) -> list[int]:
        """The nodes that have others below, from the root."""
        return sorted(node for node in self.nodes if node < self.n_leaves)

    def has(self, name: str) -> bool:
        """Whether something is computed."""
        return self.file(name).exists()

    def read(self, name: str, *only: str) -> Arrays:
        """Read the arrays of a part or of something that is computed, all or some."""
        with undamaged(self.file(name)) as file, np.load(file) as archive:
            return {key: archive[key] for key in only or archive.files}

    def each(self, names: Mapping[int, str], *only: str) -> tuple[list[Any], ...]:
        """Read some arrays of several parts: a list of each array."""
        found = [self.read(name, *only) for name in names.values()]
        return tuple([arrays[key] for arrays in found] for key in only)

    def write(self, name: str, **arrays: Any) -> None:
        """Write arrays, all or nothing."""
        with whole_file(self.file(name)) as unfinished:
            np.savez(unfinished, **arrays)

    def file(self, name: str) -> Path:
        """Where arrays are: those of `partition` beside what is computed of them."""
        return (self.path if name.startswith(GIVEN) else self.work) / f"{name}.npz"


@contextmanager
def undamaged(path: Path) -> Iterator[BinaryIO]:
    """Let the body read a file; MeshError if it is not what `partition` or `parts_map` has made."""
    try:
        with path.open("rb") as file:
            yield file
    except OSError:
        raise
    except DAMAGE as error:
        raise MeshError(Defect.of("unreadable file, of parts", name=path.name)) from error


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
        vars(self).update(folder.read(f"part-{p}"))

    @cached_property
    def known(self) -> Ints:
        """(n,) rows in the table of seams and then the boundary loop; -1 of vertices inside."""
        loop = self._folder.read("loop")["loop"]
        order, known = np.argsort(loop), self.row.copy()
        at = order[among(self.vertices, loop[order])]
        known[among(loop[order], self.vertices)] = self._folder.seams + at
        return known

    @property
    def on_boundary(self) -> Bools:
        """(n,) which vertices are on the boundary of the surface, on a seam or not."""
        return self.known >= self._folder.seams

    @cached_property
    def mesh(self) -> Mesh:
        """The part as a mesh, whose boundary are its seams and then the boundary."""
        seam = (self.known >= 0) & ~self.on_boundary
        rim = np.concatenate([np.flatnonzero(seam), np.flatnonzero(self.on_boundary)])
        return Mesh(self.V, self.F, rim)

    @property
    def rows(self) -> Ints:
        """(k,) where seams and boundary of the part are in the table of the whole."""
        return self.known[self.mesh.loop]

    @cached_property
    def factored(self) -> FactoredSurface:
        """What is inside, factored in the order that was found when the part was condensed."""
        order = self._folder.read(f"eliminate-{self._p}", "order")["order"]
        return FactoredSurface(self.mesh, cotangent_laplacian(self.mesh), order=order)

    @property
    def sources(self) -> Floats:
        """(n,) right-hand side of the torsion function; of seams, in one part only."""
        return ((self.row < 0) | self.own).astype(float)

    def faces_at(self, vertices: Ints) -> Bools:
        """(m,) which faces have one of some vertices of the whole, which ascend."""
        i, j, k = among(vertices, self.vertices)[self.F.T]
        return i | j | k

    def given(self, name: str) -> Any:
        """(k,) values on the seams and the boundary, of the table that is written."""
        return self._folder.read(name, "table")["table"][self.rows]

    def most_central(self) -> Arrays:
        """Find the most central faces by torsion: how central, rows, and smallest angles."""
        within = self.factored.solve(self.sources)
        u = within + harmonic_extension(self.factored, self.given("torsion"))
        i, j, k = u[self.F.T]
        best = most_central(central := i + j + k)
        smallest = corner_angles(self.mesh.cotangents[best]).min(axis=1)
        return {"central": central[best], "candidates": self.faces[best], "smallest": smallest}


@dataclass(frozen=True, eq=False)
class Gathered:
    """Faces of several parts as a mesh, with their `rows` in the whole and those of `vertices`.

    The map of its vertices is f (n,).
    """

    rows: Ints
    vertices: Ints
    mesh: Mesh
    f: Complex

    @classmethod
    def of(
        cls, folder: Folder, names: Mapping[int, str], chosen: Callable[[Part], Any]
    ) -> Gathered:
        """Gather the faces that are `chosen` of some parts, with the maps of these names."""

        def some_of(p: int, name: str) -> tuple[Any, ...]:
            part, f = Part(folder, p), folder.read(name, "f")["f"]
            here = chosen(part)
            F = part.F[here]
            return part.faces[here], part.vertices[F], part.V[F], f[F]

        found = zip(*(some_of(*pair) for pair in names.items()), strict=True)
        rows, corners, V, f_corners = map(np.concatenate, found)
        order = np.argsort(rows)
        vertices, F = np.unique(corners, return_inverse=True)
        F = F.reshape(-1, 3)
        positions, f = np.empty((len(vertices), 3)), np.empty(len(vertices), complex)
        positions[F], f[F] = V, f_corners
        border = np.flatnonzero(np.isin(vertices, folder.read("loop")["loop"]))
        return cls(rows[order], vertices, Mesh(positions, F[order], border), f)

    def places(self, rows: Ints) -> Ints:
        """Find faces of the whole."""
        return np.searchsorted(self.rows, rows)

    def only(self, rows: Ints) -> Mesh:
        """Take some faces of the whole as a mesh with the same vertices."""
        return Mesh(self.mesh.scaled, self.mesh.F[self.places(rows)], self.mesh.loop)


def among(some: Ints, rows: Ints) -> Bools:
    """(k,) which of k rows are among some others, which ascend."""
    found: Bools = np.append(some, -1)[np.searchsorted(some, rows)] == rows
    return found


def named(what: Callable[..., Arrays], of: int, *given: Any) -> str:
    """Name the result of a step with a part or a cut, by all that it depends on."""
    name = f"{what.__name__}-{of}"
    return f"{name}-{crc32(repr(given).encode()):08x}" if given else name
