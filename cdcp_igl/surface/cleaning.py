"""Clean a surface that is nearly a disk, and say what was changed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Bools, Floats, Ints, marked, size_exponent, unit_size
from ..errors import Defect, MeshError, counted
from ..io.given import takes_meshes
from .checking import check
from .filling import fill_hole
from .orientation import INWARD, wrong_side
from .sheets import fans_of_sheets
from .topology import ROUNDING, Topology, by_reach, duplicate_faces, rim_pairs, sewn
from .triangles import corner_cotangents, degenerate_faces
from .validation import repeated_corners, usable_arrays, without_data


class Cleaned(NamedTuple):
    """A cleaned surface; ``clean(V, F)[:2]`` is a surface again.

    Attributes
    ----------
    V : (n, 3) or (n, 2) float64
        Vertices that were kept, in their order; then copies of vertices that were split;
        then new vertices in the holes.
    F : (m, 3) int64
        Faces that were kept, in their order; then those that fill holes.
    vertex_index : (n,) int64
        The row of the given V that each row comes from, -1 for a new vertex; of a Cleaned that was
        given, such as a part, the row of what that was made of. So is `face_index`.
    face_index : (m,) int64
        The row of the given F that each row comes from, -1 for a face that fills a hole.
    flipped : (k,) int64
        Rows of F whose edge was flipped, so that they are not the faces they come from.
    changes : tuple of str
        What was done, a sentence each; empty if the surface came back as it was.
    n_given : int
        How many rows the given V has.
    F_given : (k, 3) int64
        The given F, in rows of the given V.
    source : Path or None
        The file, if one was given.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    >>> cdcp_igl.clean(V, F[1:]).changes
    ('filled 1 hole',)
    """

    V: Floats
    F: Ints
    vertex_index: Ints
    face_index: Ints
    flipped: Ints
    changes: tuple[str, ...]
    n_given: int
    F_given: Ints
    source: Path | None = None


@takes_meshes
def clean(
    V: ArrayLike,
    F: ArrayLike,
    *,
    within: float = 0.0,
    fill: bool = True,
    close: bool = False,
    flip_ears: bool = False,
) -> Cleaned:
    """Mend what can be mended without guessing, so that the surface may become a disk.

    In this order: faces at a vertex with a NaN or infinite coordinate are dropped, and those at
    points that stand for missing data; vertices at one place merged along seams, their
    coordinates equal but for rounding; faces with a repeated corner, duplicate and
    degenerate faces dropped; vertices where several fans of faces meet split; of the sheets that
    meet in an edge of more than two faces, those that continue each other stay together, so that
    what is closed stays closed; the largest component kept, its
    faces oriented like the majority, and all holes filled; what is closed then points outward.
    A hole is a boundary loop other than the one that reaches farthest; it is filled by a fan
    around a new vertex or, where that would be flat, without one, and a hole that is a mere line
    takes a face behind it along. A surface that is a disk already comes back as it is, even if
    vertices coincide, as they do along a cut; not if they nearly do, which no cut does.

    Parameters
    ----------
    V, F
        As in `disk_map`, whatever surface they are.
    within : float
        In the unit of V: merge vertices along seams that lie so near to each other, if that is
        less than half of the shortest edge there. Those that differ by rounding, 1.5e-11 of the
        size of the surface, always are.
    fill : bool
        False leaves all holes open, as for `annulus_map`.
    close : bool
        Fill the loop that reaches farthest, too, so that the surface is closed.
    flip_ears : bool
        Also flip the inner edge of each ear (a face with two boundary edges) that has an
        interior vertex behind it. The corner of an ear cannot move on the circle without
        all three of its angles changing; that of a flipped one can. The surface changes
        slightly, by the two faces of each flipped edge.

    Returns
    -------
    Cleaned
        What it cannot mend is left for `check` to find and `disk_map` to refuse: a handle,
        a closed or a one-sided surface, and flat holes at another boundary.

    Raises
    ------
    MeshError
        If V and F are not numeric, have the wrong shape, an index is out of range or
        fractional, or no face is left.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    >>> cleaned = cdcp_igl.clean(V, F[10:])
    >>> uv = cdcp_igl.cdcp(cleaned.V, cleaned.F)[cleaned.vertex_index >= 0]
    >>> F = cleaned.F[cleaned.face_index >= 0]
    """
    positions, faces = usable_arrays(V, F)
    if not within >= 0:
        raise ValueError(f"within must be 0 or more, not {within!r}")
    surface = _Surface(positions.astype(np.float64), faces)
    if close or not check(V, F).is_disk or surface.has_seam(within):
        mends: tuple[Callable[[], None], ...] = (
            surface.drop_non_finite,
            surface.drop_missing,
            partial(surface.merge_vertices, within),
            surface.drop_faces,
            surface.split_vertices,
            surface.keep_largest_component,
            surface.orient,
            surface.drop_unreferenced,
            partial(surface.fill_holes, fill, close),
            surface.turn_outward,
        )
        for mend in mends:
            mend()
            if len(surface.F) == 0:
                done = f"Cleaning {', '.join(surface.changes)}"
                raise MeshError(Defect.of("nothing left", done=done))
    if flip_ears:
        surface.flip_ears()
    return Cleaned(
        surface.V,
        surface.F,
        surface.vertex_index,
        surface.face_index,
        surface.flipped,
        tuple(surface.changes),
        len(positions),
        faces,
    )


@takes_meshes
def submesh(
    V: ArrayLike,
    F: ArrayLike,
    *,
    vertices: ArrayLike | None = None,
    without: ArrayLike | None = None,
) -> Cleaned:
    """Take a part of a surface: the faces all of whose corners are among some vertices.

    Maps of it carry values back to the rows of the whole, ``result.to_given(values)``: a cortex
    without its medial wall, or a patch that was cut out.

    Parameters
    ----------
    V, F
        As in `disk_map`, whatever surface they are.
    vertices : (n,) array_like of bool, or (k,) of integers
        Which to keep: a truth value for each, which may be 0 or 1, or their rows.
    without : (n,) array_like of bool, or (k,) of integers
        Which to leave out, in place of `vertices`.

    Returns
    -------
    Cleaned
        The part, vertices and faces in their order; its ``vertex_index`` and ``face_index`` are
        rows of V and F. Vertices that are at none of its faces are not in it.

    Raises
    ------
    MeshError
        If V and F are no surface, or no face is left.
    ValueError
        If not one of `vertices` and `without` is given, or it names no vertices of V; if it has
        a label for each vertex, which is no row.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    >>> cdcp_igl.submesh(V, F, without=[0, 1]).changes
    ('kept 89 of 91 vertices, 140 of 150 faces',)
    """
    positions, faces = usable_arrays(V, F)
    if (vertices is None) == (without is None):
        raise ValueError("submesh takes either vertices, which to keep, or without, which not to")
    chosen = _chosen(np.asarray(vertices if without is None else without), len(positions))
    if without is not None:
        chosen = ~chosen
    face_index = np.flatnonzero(chosen[faces].all(axis=1))
    if len(face_index) == 0:
        raise MeshError(Defect.of("nothing left", done="Leaving vertices out"))
    vertex_index, F = np.unique(faces[face_index], return_inverse=True)
    (n, m), (left, right) = (len(positions), len(faces)), (len(vertex_index), len(face_index))
    change = f"kept {left:,} of {n:,} vertices, {right:,} of {m:,} faces"
    part = positions[vertex_index].astype(np.float64), F.reshape(-1, 3), vertex_index, face_index
    return Cleaned(*part, np.empty(0, np.int64), (change,), n, faces)


def _chosen(given: NDArray[Any], n: int) -> Bools:
    """(n,) which of n vertices are named, by truth values or by rows."""
    whole = given.ndim == 1 and given.dtype.kind in "iu"
    if whole and len(given) > 2 and np.isin(given, (0, 1)).all():  # a mask, and no rows
        given = given.astype(bool)
    elif whole:
        if len(given) and not 0 <= given.min() <= given.max() < n:
            raise ValueError(f"rows of vertices must be in 0..{n - 1}")
        if len(given) == n > len(np.unique(given)):
            raise ValueError(
                f"vertices has a whole number for each of {n}, some of them alike: of labels, "
                "give truth values, such as labels == 3"
            )
        return marked(n, given)
    if given.shape != (n,) or given.dtype != bool:
        raise ValueError(
            f"vertices must be a truth value for each of {n}, or rows, "
            f"not {given.dtype} of shape {given.shape}"
        )
    return given


class _Surface:
    """The surface while it is being cleaned."""

    def __init__(self, V: Floats, F: Ints) -> None:
        self.V, self.F = V, F
        self.vertex_index, self.face_index = np.arange(len(V)), np.arange(len(F))
        self.flipped = np.empty(0, np.int64)
        self.changes: list[str] = []

    def drop_non_finite(self) -> None:
        bad = np.flatnonzero(~np.isfinite(self.V).all(axis=1))
        at_bad = np.flatnonzero(np.isin(self.F, bad).any(axis=1))
        self._drop_faces(at_bad, "with a NaN or infinite coordinate")

    def drop_missing(self) -> None:
        missing, place = without_data(self.V, self.F)
        at_missing = np.flatnonzero(np.isin(self.F, missing).any(axis=1))
        self._drop_faces(at_missing, f"at points without data, at {place}")

    def has_seam(self, within: float) -> bool:
        """Whether boundary vertices lie nearly at one place."""
        return len(rim_pairs(self._scaled(), self._topology().edges, self._near(within))[0]) > 0

    def merge_vertices(self, within: float) -> None:
        self.F, n_merged = sewn(self._scaled(), self.F, self._near(within))
        self._say(n_merged, "merged {} with an equal one", "vertex", "vertices")

    def _near(self, within: float) -> float:
        """Scale a distance as positions are, and add what rounding may do."""
        return max(ROUNDING, float(np.ldexp(within, -size_exponent(self.V[np.isfinite(self.V)]))))

    def drop_faces(self) -> None:
        self._drop_faces(repeated_corners(self.F), "with a repeated corner")
        self._drop_faces(duplicate_faces(self.F), "that repeated another")
        cotangents = corner_cotangents(self._scaled(), self.F)
        self._drop_faces(degenerate_faces(cotangents), "without area")

    def split_vertices(self) -> None:
        """Give each fan of faces at a vertex its own copy; the first keeps the vertex."""
        n, corner = len(self.V), self.F.T.ravel()
        _, fan = fans_of_sheets(self._scaled(), self.F)
        # Each fan by its first corner, those of a vertex in succession.
        _, first = np.unique(fan, return_index=True)
        order = np.lexsort((first, corner[first]))
        vertex = corner[first[order]]
        surplus = np.diff(vertex, prepend=-1) == 0
        name = vertex.copy()
        name[surplus] = n + np.arange(surplus.sum())
        vertex_of_fan = np.empty(len(first), np.int64)
        vertex_of_fan[order] = name
        self.F = np.ascontiguousarray(vertex_of_fan[fan].reshape(3, -1).T)
        self.V = np.vstack([self.V, self.V[vertex[surplus]]])
        self.vertex_index = np.append(self.vertex_index, self.vertex_index[vertex[surplus]])
        self._say(int(surplus.sum()), "split off {} where fans of faces met", "vertex", "vertices")

    def keep_largest_component(self) -> None:
        _, component = self._topology().components
        smaller = np.flatnonzero(component != np.bincount(component).argmax())
        self._drop_faces(smaller, "of smaller components")

    def orient(self) -> None:
        wrong = self._topology().misoriented
        if wrong is not None:
            self.F[wrong] = self.F[wrong, ::-1]
            self._say(len(wrong), "reversed {}", "face", "faces")

    def drop_unreferenced(self) -> None:
        used = self._topology().used
        self.F = (np.cumsum(used) - 1)[self.F]
        self._say(int((~used).sum()), "dropped {} that no face uses", "vertex", "vertices")
        self.V, self.vertex_index = self.V[used], self.vertex_index[used]

    def fill_holes(self, fill: bool, close: bool) -> None:
        loops = self._topology().loops
        if len(loops) < 2 - close or not (fill or close):
            return
        outer = None if close else by_reach(self.V, loops)[0]
        on_boundary = marked(len(self.V), *loops)
        given, filling = len(self.F), []
        for loop in loops:
            faces = None if loop is outer else self._filling(loop, on_boundary)
            if faces is not None:
                filling.append(faces)
        self._say(given - len(self.F), "took out {} beside flat holes", "face", "faces")
        self._say(len(filling), "filled {}", "hole", "holes")
        self.F = np.vstack([self.F, *filling])
        self.face_index = np.append(
            self.face_index, np.full(len(self.F) - len(self.face_index), -1)
        )

    def turn_outward(self) -> None:
        side, rows = wrong_side(self._scaled(), self._topology())
        if side == INWARD:
            self.F[rows] = self.F[rows, ::-1]
            self._say(len(rows), "turned {} outward", "face", "faces")

    def _filling(self, hole: Ints, on_boundary: Bools) -> Ints | None:
        """Faces that fill a hole, widened until they have an area; None if that cannot be."""
        while (faces := fill_hole(self._scaled(), self._topology(), hole)) is None:
            wider = self._widened(hole, on_boundary)
            if wider is None:
                return None
            hole = wider
        if faces.max() == len(self.V):
            middle = (self.V[hole] / len(hole)).sum(axis=0)  # the sum alone may overflow
            self.V = np.vstack([self.V, middle])
            self.vertex_index = np.append(self.vertex_index, -1)
        return faces

    def _widened(self, hole: Ints, on_boundary: Bools) -> Ints | None:
        """Take out the face behind the longest edge of a hole; None if each touches a boundary.

        A hole whose corners lie on a line, as a face without area leaves it, cannot be filled.
        """
        after, V = np.roll(hole, -1), self._scaled()
        lengths = np.linalg.norm(V[after] - V[hole], axis=1)
        tail, head, opposite = (np.roll(self.F.T, -k, axis=0) for k in range(3))
        for i in np.argsort(-lengths, kind="stable"):
            [corner], [face] = np.nonzero((tail == hole[i]) & (head == after[i]))
            apex = opposite[corner, face]
            if not on_boundary[apex]:
                on_boundary[apex] = True
                self.F = np.delete(self.F, face, axis=0)
                self.face_index = np.delete(self.face_index, face)
                return np.insert(hole, i + 1, apex)
        return None

    def flip_ears(self) -> None:
        one, other = self._topology().twins
        m = len(self.F)
        inner = marked(3 * m, one, other).reshape(3, m)
        sides = inner.sum(axis=0)
        at_border = marked(len(self.V), self.F.T[~inner])
        mine, theirs = np.append(one, other), np.append(other, one)
        ear = sides[mine % m] == 1
        mine, theirs = mine[ear], theirs[ear]
        a, b, tip = self._from(mine)
        c, d, back = self._from(theirs)
        can = (a == d) & (b == c) & ~at_border[back]
        V = self._scaled()
        # Both new faces must look the same way as the two old ones.
        before = _area_vectors(V, a, b, tip) + _area_vectors(V, b, a, back)
        for after in (_area_vectors(V, tip, a, back), _area_vectors(V, tip, back, b)):
            can &= (after * before).sum(axis=1) > 0
        a, b, tip, back = a[can], b[can], tip[can], back[can]
        self.F[mine[can] % m] = np.column_stack([tip, a, back])
        self.F[theirs[can] % m] = np.column_stack([tip, back, b])
        flipped = np.concatenate([mine[can] % m, theirs[can] % m])
        self.flipped = np.sort(flipped).astype(np.int64)
        self._say(int(can.sum()), "flipped the inner edge of {}", "ear", "ears")

    # -- what the steps share ----------------------------------------------------------

    def _topology(self) -> Topology:
        return Topology(self.F, len(self.V))

    def _from(self, half: Ints) -> tuple[Ints, Ints, Ints]:
        """Corners of the faces of half-edges: tail, head, the one opposite."""
        k, face = np.divmod(half, len(self.F))
        return self.F[face, k], self.F[face, (k + 1) % 3], self.F[face, (k + 2) % 3]

    def _scaled(self) -> Floats:
        """Positions in three columns and of unit size, as `check` judges them."""
        return unit_size(self.V)

    def _drop_faces(self, rows: Ints, why: str) -> None:
        self.F = np.delete(self.F, rows, axis=0)
        self.face_index = np.delete(self.face_index, rows)
        self._say(len(rows), f"dropped {{}} {why}", "face", "faces")

    def _say(self, count: int, what: str, one: str, many: str) -> None:
        if count > 0:
            self.changes.append(what.format(counted(count, one, many)))


def _area_vectors(V: Floats, a: Ints, b: Ints, c: Ints) -> Floats:
    return np.cross(V[b] - V[a], V[c] - V[a])
