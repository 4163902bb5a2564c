"""Is the input a triangulated disk? Every defect, found without calling libigl.

libigl 2.6 crashes the process on some of these inputs, and answers others with NaN.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from ..arrays import Bools, Floats, Indices, Ints
from ..errors import Defect, MeshError, spell
from .edges import Edges, group_by_edge, half_edges
from .notebook import html_table
from .triangles import corner_cotangents

__all__ = ["MeshReport", "check"]


# A face is degenerate when area / longest edge^2 is below this: a relative measure, so
# that metres and microns are judged alike. The worst faces of real scans are near 1e-5;
# cotangents above 1e10 would leave the other faces at a vertex too few digits.
DEGENERATE = 1e-10


@dataclass(frozen=True, eq=False)
class MeshReport:
    """What `check` found. Printing it gives a line for each defect.

    Attributes
    ----------
    n_vertices, n_faces : int
        Rows of V and of F; 0 where the array is unusable.
    n_boundary : int
        Vertices on the longest boundary loop; 0 where there is none.
    ears : (k,) ndarray of int64
        Faces with two boundary edges. Legal, but all three corners of an ear lie on the
        circle, so its angles are distorted whatever the method.
    chords : (k, 2) ndarray of int64
        Interior edges that join two boundary vertices, the smaller index first. Legal;
        ears lie behind chords, and so do longer parts of the surface.
    defects : tuple of Defect
        Everything that keeps the mesh from being a disk; empty for a disk.
    """

    n_vertices: int
    n_faces: int
    n_boundary: int
    ears: Ints
    chords: Ints
    defects: tuple[Defect, ...]

    @property
    def is_disk(self) -> bool:
        """True if the mesh can be mapped."""
        return not self.defects

    def __repr__(self) -> str:
        found = "a disk" if self.is_disk else ", ".join(d.name for d in self.defects)
        return f"MeshReport({self.n_vertices:,} vertices, {self.n_faces:,} faces: {found})"

    def _repr_html_(self) -> str:
        counts = f"{self.n_vertices:,} vertices, {self.n_faces:,} faces"
        rows = {
            "triangulated disk": "yes" if self.is_disk else "no",
            "boundary vertices": f"{self.n_boundary:,}",
            "ears": f"{len(self.ears):,}",
        }
        return html_table(counts, rows | {defect.name: str(defect) for defect in self.defects})

    def __str__(self) -> str:
        counts = (
            f"{self.n_vertices:,} vertices, {self.n_faces:,} faces, "
            f"{self.n_boundary:,} boundary vertices, {len(self.ears):,} ears"
            + (f" (faces {spell(self.ears)})" if len(self.ears) else "")
            + f", {len(self.chords):,} chords"
            + (f" (edges {spell(self.chords)})" if len(self.chords) else "")
        )
        verdict = "A triangulated disk." if self.is_disk else "Not a triangulated disk:"
        return "\n".join([counts, verdict, *(f"- {d.name}: {d}" for d in self.defects)])


def check(V: ArrayLike, F: ArrayLike) -> MeshReport:
    """Examine a mesh and report every defect; raise nothing.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like
        Vertex positions.
    F : (m, 3) array_like
        Corners of the faces, rows of V.

    Returns
    -------
    MeshReport
        Counts and defects. A defect of the arrays (shape, type, index range) hides those
        of the surface, and a non-manifold edge hides those of the boundary: mend it and
        check again.

    Examples
    --------
    >>> import cdcp_igl
    >>> report = cdcp_igl.check([[0, 0], [1, 0], [0, 1], [1, 1]], [[0, 1, 2]])
    >>> print(report.defects[0].name, report.defects[0].indices)
    unreferenced vertex [3]
    """
    found = examine(V, F)
    longest = max(map(len, found.loops), default=0)
    return MeshReport(
        n_vertices=len(found.V),
        n_faces=len(found.F),
        n_boundary=longest,
        ears=found.ears,
        chords=found.chords,
        defects=tuple(found.defects),
    )


@dataclass
class Examined:
    """Arrays in their final form (V scaled to unit size), what comes from them, all defects.

    The edges and cotangents are there if the surface could be examined.
    """

    V: Floats = field(default_factory=lambda: np.empty((0, 3)))
    F: Ints = field(default_factory=lambda: np.empty((0, 3), np.int64))
    edges: Edges = field(init=False)
    cotangents: Floats = field(init=False)
    loops: list[Ints] = field(default_factory=list)
    ears: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    chords: Ints = field(default_factory=lambda: np.empty((0, 2), np.int64))
    defects: list[Defect] = field(default_factory=list)


def examine(V: ArrayLike, F: ArrayLike) -> Examined:
    """Check everything that section "Raises" of `DiskMesh` promises."""
    found = Examined()
    try:
        found.V = as_vertices(V)
        found.F = as_faces(F, len(found.V))
    except MeshError as error:  # the surface cannot be examined
        found.defects += error.defects
        return found
    found.defects += _topological_defects(found)
    found.cotangents = corner_cotangents(found.V, found.F)
    if defect := degenerate_defect(found.cotangents):
        found.defects.append(defect)
    return found


# -- the arrays ------------------------------------------------------------------------


def _numeric(name: str, array: ArrayLike) -> NDArray[Any]:
    try:
        numeric = np.asarray(array)
    except ValueError:  # ragged
        numeric = np.empty(0, dtype=object)
    if numeric.dtype.kind not in "iuf":
        raise MeshError(
            Defect(
                "not numeric",
                f"{name} is not a rectangular array of real numbers",
                "V takes rows of 3 (or 2) real numbers, F rows of 3 integers.",
            )
        )
    return numeric


def vertex_array(V: ArrayLike, name: str = "V") -> NDArray[Any]:
    """V as an array of 2 or 3 numeric columns, finite or not; MeshError if it is none."""
    given = _numeric(name, V)
    if given.ndim != 2 or given.shape[1] not in (2, 3) or len(given) < 3:
        raise MeshError(
            Defect(
                f"shape of {name}",
                f"{name} has shape {given.shape}",
                "It must be (n, 3), or (n, 2) for a planar mesh, with n at least 3.",
            )
        )
    return given


def as_vertices(V: ArrayLike, name: str = "V") -> Floats:
    """(n, 3) float64 copy of V, scaled to unit size; MeshError if that cannot be."""
    given = vertex_array(V, name)
    if not np.isfinite(given).all():
        bad = np.flatnonzero(~np.isfinite(given).all(axis=1))
        raise MeshError(
            Defect(
                "non-finite coordinate",
                f"{_count(bad, 'vertex has', 'vertices have')} a NaN or infinite coordinate",
                "Restore the coordinates, or remove these vertices and their faces.",
                "vertices",
                bad,
            )
        )
    positions = np.zeros((len(given), 3))
    positions[:, : given.shape[1]] = given
    # By a power of two, which is exact: products of lengths stay in range in any unit.
    exponent = int(np.frexp(max(positions.max(), -positions.min()))[1])
    return np.ldexp(positions, -exponent, out=positions)


def face_array(F: ArrayLike, n: int) -> Ints:
    """(m, 3) int64 F in C order, indices in range; MeshError if that cannot be."""
    given = _numeric("F", F)
    if given.ndim != 2 or given.shape[1] != 3 or len(given) == 0:
        polygons = given.ndim == 2 and given.shape[1] > 3
        raise MeshError(
            Defect(
                "shape of F",
                f"F has shape {given.shape}",
                "It must be (m, 3) with m at least 1."
                + (" Triangulate the polygons first." if polygons else ""),
            )
        )
    # Judged as given: a cast would wrap large unsigned numbers and truncate fractions.
    if not (given.min() >= 0 and given.max() < n):
        outside = np.flatnonzero(~((given >= 0) & (given < n)).all(axis=1))
        one_based = given.min() == 1 and given.max() == n
        raise MeshError(
            Defect(
                "index out of range",
                f"{_count(outside, 'face has', 'faces have')} an index outside 0..{n - 1}",
                "The indices count from 1: pass F - 1." if one_based else "Mend or drop them.",
                "faces",
                outside,
            )
        )
    faces = np.ascontiguousarray(given, dtype=np.int64)
    if given.dtype.kind == "f" and not np.array_equal(faces, given):
        fractional = np.flatnonzero((faces != given).any(axis=1))
        raise MeshError(
            Defect(
                "fractional index",
                f"{_count(fractional, 'face has', 'faces have')} an index that is no integer",
                "F takes integers; perhaps V and F have changed places.",
                "faces",
                fractional,
            )
        )
    return faces


def as_faces(F: ArrayLike, n: int) -> Ints:
    """Like `face_array`; MeshError also if a face has the same vertex at two corners."""
    faces = face_array(F, n)
    repeated = repeated_corners(faces)
    if len(repeated):
        raise MeshError(
            Defect(
                "repeated corner",
                f"{_count(repeated, 'face has', 'faces have')} the same vertex at two corners",
                "Drop these faces.",
                "faces",
                repeated,
            )
        )
    return faces


def repeated_corners(F: Ints) -> Ints:
    """Faces with the same vertex at two corners."""
    i, j, k = F.T
    return np.flatnonzero((i == j) | (j == k) | (k == i))


# -- the surface -----------------------------------------------------------------------


def _topological_defects(found: Examined) -> Iterator[Defect]:
    """Yield what is wrong with the surface, and fill in its edges, loops, ears and chords.

    One sort of undirected edges answers it all. If the faces hang together across
    edges, no edge is singular, there is one simple boundary loop and the Euler
    characteristic is 1, then no interior vertex is pinched either: a surface of genus g
    with p pinches undone has characteristic 1 - 2g = 1 + p, so g = p = 0. Only where
    that fails are the corners grouped around their vertices to name the culprits.
    """
    F, n, m = found.F, len(found.V), len(found.F)
    tail, head = half_edges(F, n)
    edges = found.edges = group_by_edge(tail, head, n)
    start, valence = edges.start, edges.valence

    used = np.bincount(F.ravel(), minlength=n) > 0
    unused = np.flatnonzero(~used)
    if len(unused):
        yield Defect(
            "unreferenced vertex",
            f"{_count(unused, 'vertex belongs', 'vertices belong')} to no face",
            "Remove them and renumber F.",
            "vertices",
            unused,
        )

    singular = valence > 2
    duplicates = duplicate_faces(F) if singular.any() or (valence == 2).all() else unused[:0]
    if len(duplicates):
        yield Defect(
            "duplicate face",
            f"{_count(duplicates, 'face repeats', 'faces repeat')} the corners of another",
            "Drop these faces.",
            "faces",
            duplicates,
        )
    if singular.any():
        ends = _ends(edges, singular)
        yield Defect(
            "non-manifold edge",
            f"{_count(ends, 'edge lies', 'edges lie')} on three or more faces",
            "Drop the surplus faces, or cut the surface along these edges.",
            "edges",
            ends,
        )
        return

    inner = valence == 2
    one, other = edges.sides[start[inner]], edges.sides[start[inner] + 1]
    border = edges.sides[start[~inner]]
    found.ears = np.flatnonzero(np.bincount(border % m, minlength=m) > 1)
    on_boundary = np.zeros(n, dtype=bool)
    on_boundary[tail[border]] = on_boundary[head[border]] = True
    found.chords = _ends(edges, inner & on_boundary[edges.low] & on_boundary[edges.high])

    clash = tail[one] == tail[other]
    if clash.any():
        yield _orientation_defect(one % m, other % m, clash, m)

    n_parts, part = face_components(one, other, m)
    if n_parts > 1:
        sizes = np.bincount(part)
        coincide = len(np.unique(found.V, axis=0)) < n
        yield Defect(
            "several components",
            f"{n_parts:,} components, the largest with {sizes.max():,} of {m:,} faces",
            "Keep one of them."
            + (" Some vertices coincide: merging them may join the parts." if coincide else ""),
            "faces",
            np.flatnonzero(part != sizes.argmax()),
        )

    euler = int(used.sum()) - len(start) + m
    simple = np.bincount(tail[border], minlength=n).max() <= 1
    if n_parts > 1 or not simple or euler != 1:
        pinched = _pinched_vertices(F, one, other, n)
        if len(pinched):
            yield Defect(
                "non-manifold vertex",
                f"{_count(pinched, 'vertex joins', 'vertices join')} several fans of faces",
                "Split each into one copy a fan.",
                "vertices",
                pinched,
            )
            return

    if len(border) == 0:
        yield Defect(
            "closed surface",
            "The surface has no boundary",
            "Cut it open or remove faces: a disk has one boundary loop.",
        )
    if len(border) == 0 or clash.any():
        return
    found.loops = boundary_loops(tail[border], head[border])
    if len(found.loops) > n_parts:
        longest = max(found.loops, key=len)
        yield Defect(
            "several boundary loops",
            f"{len(found.loops):,} boundary loops, the longest with {len(longest):,} vertices",
            "Fill the holes: a disk has one boundary loop.",
            "vertices",
            np.concatenate([loop for loop in found.loops if loop is not longest]),
        )
    genus = (2 * n_parts - len(found.loops) - euler) // 2
    if genus:
        yield Defect(
            "handle",
            f"The surface has genus {genus}, a disk has 0",
            "Cut the surface along a loop around each handle.",
        )


def _ends(edges: Edges, chosen: Bools) -> Ints:
    """(k, 2) vertices of some of the edges."""
    return np.column_stack([edges.low[chosen], edges.high[chosen]]).astype(np.int64)


def duplicate_faces(F: Ints) -> Ints:
    _, first = np.unique(np.sort(F, axis=1), axis=0, return_index=True)
    return np.setdiff1d(np.arange(len(F)), first)


def _orientation_defect(left: Indices, right: Indices, clash: Bools, m: int) -> Defect:
    """Name the faces to reverse."""
    against = faces_to_reverse(left, right, clash, m)
    if against is None:
        return Defect(
            "not orientable",
            "The surface is one-sided, like a Möbius strip",
            "Cut it until it has two sides.",
        )
    return Defect(
        "inconsistent orientation",
        f"{_count(against, 'face is', 'faces are')} oriented against the others",
        "Reverse the corners of these faces.",
        "faces",
        against,
    )


def faces_to_reverse(left: Indices, right: Indices, clash: Bools, m: int) -> Ints | None:
    """Find the smaller side of each component's orientation cover; None if it has one side.

    Node f stands for face f as it is, node f + m for its reversal.
    """
    shift = np.where(clash, m, 0)
    rows = np.concatenate([left, left + m])
    columns = np.concatenate([right + shift, right + m - shift])
    graph = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(2 * m, 2 * m))
    _, side = connected_components(graph, directed=False)
    if (side[:m] == side[m:]).any():
        return None
    size = np.bincount(side[:m], minlength=side.max() + 1)
    mine, theirs = size[side[:m]], size[side[m:]]
    return np.flatnonzero((mine < theirs) | ((mine == theirs) & (side[:m] > side[m:])))


def face_components(one: Indices, other: Indices, m: int) -> tuple[int, NDArray[np.int32]]:
    """Components of faces that share edges; `one` and `other` are twin half-edges."""
    # Every face has three neighbours, itself where one is missing, so the adjacency can
    # be written down in CSR form without sorting. Nobody reads its entries.
    neighbour = np.tile(np.arange(m, dtype=np.int32), 3)
    neighbour[one], neighbour[other] = other % m, one % m
    graph = csr_matrix(
        (np.zeros(3 * m), neighbour.reshape(3, m).T.ravel(), np.arange(0, 3 * m + 1, 3)), (m, m)
    )
    if len(breadth_first_order(graph, 0, return_predecessors=False)) == m:
        return 1, np.zeros(m, np.int32)
    return connected_components(graph, directed=False)


def _pinched_vertices(F: Ints, one: Indices, other: Indices, n: int) -> Ints:
    """Vertices whose corners form more than one fan across shared edges."""
    n_fans, fan = fans(F, one, other)
    vertex_of_fan = np.empty(n_fans, np.int64)
    vertex_of_fan[fan] = F.T.ravel()
    return np.flatnonzero(np.bincount(vertex_of_fan, minlength=n) > 1)


def fans(F: Ints, one: Indices, other: Indices) -> tuple[int, NDArray[np.int32]]:
    """Group the corners, (3m,) in the order of ``F.T``, around each vertex across twins."""

    def after(half: Indices) -> Indices:  # the next half-edge of the same face
        return (half + len(F)) % F.size

    corner = F.T.ravel()
    aligned = corner[one] == corner[other]  # twins that leave the same vertex
    rows = np.concatenate([one, after(one)])
    columns = np.concatenate(
        [np.where(aligned, other, after(other)), np.where(aligned, after(other), other)]
    )
    graph = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(corner), len(corner)))
    return connected_components(graph, directed=False)


def boundary_loops(tail: Indices, head: Indices) -> list[Ints]:
    """Cycles of the permutation tail -> head, each from its smallest vertex."""
    by_tail = np.argsort(tail)
    following = dict(zip(tail[by_tail].tolist(), head[by_tail].tolist(), strict=True))
    loops = []
    while following:
        loop = [next(iter(following))]
        while (vertex := following.pop(loop[-1])) != loop[0]:
            loop.append(vertex)
        loops.append(np.array(loop, dtype=np.int64))
    return loops


def degenerate_defect(cotangents: Floats) -> Defect | None:
    """Faces without area, as a defect; None if there are none."""
    bad = degenerate_faces(cotangents)
    if len(bad) == 0:
        return None
    return Defect(
        "degenerate face",
        f"{_count(bad, 'face has', 'faces have')} no area to speak of",
        "Merge coinciding vertices, and collapse or flip the slivers.",
        "faces",
        bad,
    )


def degenerate_faces(cotangents: Floats) -> Ints:
    """Faces without area, by the square of their longest edge."""
    # The cotangents at the ends of an edge add up to its squared length by twice the area.
    i, j, k = cotangents.T
    with np.errstate(invalid="ignore"):  # of faces without any area
        longest_squared = np.maximum(np.maximum(i + j, j + k), k + i)
    return np.flatnonzero(~(longest_squared < 1 / (2 * DEGENERATE)))


def _count(indices: Ints, one: str, many: str) -> str:
    return f"{len(indices):,} {one if len(indices) == 1 else many}"
