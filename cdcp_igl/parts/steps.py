"""What is computed of one part, or of one cut: pure functions of files and a few numbers.

Each takes the folder and the number of the part (or of the cut), and returns arrays. The vertices
of a part are inside; on seams, in several parts; or on the boundary of the surface, where values
are given. To what is inside, the other two are the boundary.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from ..arrays import Bools, Complex, Floats, Ints, coordinates, marked
from ..cached import cached_property
from ..certificate import flipped_faces
from ..distortion import disk_map_distortion
from ..errors import SolverError
from ..solve.condensed import Condensed
from ..solve.factored import FactoredSurface
from ..solve.laplacian import cotangent_laplacian
from ..steps.center import most_central
from ..steps.extension import harmonic_extension
from ..steps.mobius import mobius_transformation
from ..steps.trace import boundary_flux, face_dipole
from ..surface.topology import Topology
from ..surface.triangles import corner_cotangents, degenerate_faces, vertex_areas
from .part import Arrays, Folder, Part, Piece, among, named


class Placed:
    """A part with its seams and its boundary.

    Attributes
    ----------
    part : Part
    seam, rows : (s,) int64
        Vertices on seams and not on the boundary, and their rows in the table of seams.
    border, places : (b,) int64
        Vertices on the boundary, and their places on the loop of the surface.
    """

    def __init__(self, folder: Folder, p: int) -> None:
        self.part: Part = folder.part(p)
        loop = folder.read("loop", "loop")["loop"]
        order = np.argsort(loop)
        at = np.searchsorted(loop[order], self.part.vertices)
        at[at == len(loop)] = 0
        place = order[at]
        on_boundary = loop[place] == self.part.vertices
        self.border: Ints = np.flatnonzero(on_boundary)
        self.places: Ints = place[self.border]
        self.seam: Ints = np.flatnonzero((self.part.seam >= 0) & ~on_boundary)
        self.rows: Ints = self.part.seam[self.seam]

    @property
    def given(self) -> Ints:
        """What is the boundary of the part: seams first."""
        return np.concatenate([self.seam, self.border])

    @cached_property
    def piece(self) -> Piece:
        """The part with this boundary, as a mesh."""
        return Piece(self.part.V, self.part.F, self.given)

    def factored(self, folder: Folder, p: int) -> FactoredSurface:
        """Factor what is inside, in the order that was found when the part was condensed."""
        order = folder.read(named(eliminate, p), "order")["order"]
        return FactoredSurface(self.piece, cotangent_laplacian(self.piece), order=order)

    @property
    def sources(self) -> Floats:
        """(n,) right-hand side of the torsion function; of seams, in one part only."""
        sources: Floats = ((self.part.seam < 0) | self.part.own).astype(float)
        return sources


def examine(folder: Folder, p: int) -> Arrays:
    """Find what tells whether the whole is a disk.

    ``sound``: nothing is wrong inside. ``half_edges`` (k, 2): those of edges that have one face
    here, or may have faces in other parts, by their ends, with the ``component`` of each.
    """
    part = folder.part(p)
    surface = Topology(part.F, len(part.vertices))
    edges, tail = surface.edges, surface._tail
    one, other = surface.twins
    flat = degenerate_faces(corner_cotangents(part.V, part.F))
    sound = not (surface.singular.any() or (tail[one] == tail[other]).any() or len(flat))
    on_seam = part.seam >= 0
    open_ = (edges.valence == 1) | (on_seam[edges.low] & on_seam[edges.high])
    sides = edges.sides[np.repeat(open_, edges.valence)]
    m = len(part.F)
    ends = np.column_stack([tail[sides], tail[(sides + m) % (3 * m)]])
    n_components, component = surface.components
    return {
        "sound": sound,
        "half_edges": part.vertices[ends],
        "component": component[sides % m],
        "n_components": n_components,
        "n_inner": np.count_nonzero(~open_),
    }


def eliminate(folder: Folder, p: int) -> Arrays:
    """Condense a part to its seams and its boundary.

    The Schur complement of the seams and its block to the boundary are written. Returned are the
    condensed right-hand side of the torsion function, and the most that its sum over a face can be
    with 0 on the seams; and of the boundary vertices ``places``, ``positions`` and the angles
    ``around`` them.
    """
    placed = Placed(folder, p)
    part, piece, k = placed.part, placed.piece, len(placed.seam)
    condensed = Condensed(cotangent_laplacian(piece), piece.V, piece.loop)
    u, torsion = condensed.solve(placed.sources)
    schur = condensed.schur
    node = folder.n_leaves + p
    folder.write(f"schur-{node}", {"rows": placed.rows, "schur": schur[:k, :k]})
    side = {"rows": placed.rows, "places": placed.places, "side": schur[:k, k:]}
    folder.write(f"side-{p}", side)
    around = np.bincount(part.F.ravel(), piece.angles.ravel(), len(part.vertices))
    return {
        "rows": placed.rows,
        "torsion": torsion[:k],
        "most": u[part.F].sum(axis=1).max(),
        "order": condensed.order,
        "places": placed.places,
        "positions": part.V[placed.border],
        "around": around[placed.border],
    }


def merge(folder: Folder, node: int) -> Arrays:
    """Eliminate the vertices of a cut, which has the Schur complements of its two sides.

    Returns L11 and L21 of its front, with the rows that are eliminated `here` and the `rest`.
    """
    sides = [folder.read(f"schur-{k}") for k in (2 * node, 2 * node + 1) if k in folder.nodes]
    rows = np.unique(np.concatenate([side["rows"] for side in sides]))
    is_here = folder.seams["node"][rows] == node
    here, rest = rows[is_here], rows[~is_here]
    rows, h = np.concatenate([here, rest]), len(here)
    order = np.argsort(rows)
    front = np.zeros((len(rows), len(rows)))
    while sides:
        side = sides.pop()
        at = order[np.searchsorted(rows[order], side["rows"])]
        front[np.ix_(at, at)] += side["schur"]
    try:
        L11 = np.linalg.cholesky(front[:h, :h])
    except np.linalg.LinAlgError as error:
        raise SolverError(
            f"the seams of cut {node} failed: {error}. If the mesh has slivers, remesh it."
        ) from error
    L21 = solve_triangular(L11, front[:h, h:], lower=True, check_finite=False).T
    schur = front[h:, h:]
    schur -= L21 @ L21.T
    folder.write(f"schur-{node}", {"rows": rest, "schur": schur})
    return {"here": here, "rest": rest, "L11": L11, "L21": L21}


def central(folder: Folder, p: int) -> Arrays:
    """Find the most central faces by torsion: how central, their rows, their smallest angles."""
    placed = Placed(folder, p)
    part, piece = placed.part, placed.piece
    surface = placed.factored(folder, p)
    centrality = _torsion(folder, placed, surface)
    best = most_central(centrality)
    return {
        "centrality": centrality[best],
        "faces": part.faces[best],
        "smallest": piece.angles[best].min(axis=1),
    }


def dipole(folder: Folder, p: int, face: int) -> Arrays:
    """Condense the dipole on a face of a part: what flows into its seams and its boundary."""
    placed = Placed(folder, p)
    piece = placed.piece
    surface = placed.factored(folder, p)
    row = int(np.searchsorted(placed.part.faces, face))
    flux = boundary_flux(surface, face_dipole(piece, row))
    k = len(placed.seam)
    return {
        "rows": placed.rows,
        "seams": flux[:k],
        "places": placed.places,
        "boundary": flux[k:],
        "on_boundary": marked(len(piece.V), placed.border)[piece.F[row]].any(),
    }


def extend(folder: Folder, p: int, values: str, sample: str, with_torsion: bool) -> Arrays:
    """Extend the values of seams and boundary harmonically, eq. (10): ``f`` (n,).

    And a sample of the faces, as `chosen`; and the highest torsion of a face.
    """
    placed = Placed(folder, p)
    given = folder.read(values)
    surface = placed.factored(folder, p)
    f = harmonic_extension(
        surface, np.concatenate([given["seams"][placed.rows], given["boundary"][placed.places]])
    )
    highest = _torsion(folder, placed, surface).max() if with_torsion else -np.inf
    here = among(folder.read(sample)["rows"], placed.part.faces)
    return {"f": f, "highest": highest, **chosen(placed, here, f)}


def finish(
    folder: Folder, p: int, extension: tuple[Any, ...], values: str, w: complex, near: str
) -> Arrays:
    """Apply a Möbius transformation to f, and certify the part on the coordinates as written.

    ``uv`` (n, 2) has the values of seams and boundary bit by bit as they are given: both sides of
    a seam certify the same. ``degrees`` are sums of the angular distortion: number, sum, sum of
    squares and maximum, and the same of faces inscribed in the circle, which are not among the
    first. And the faces at some vertices, as `chosen`.
    """
    placed = Placed(folder, p)
    part, given = placed.part, folder.read(values)
    f = mobius_transformation(folder.read(named(extend, p, extension), "f")["f"], w) / given["turn"]
    f[placed.seam] = given["seams"][placed.rows]
    f[placed.border] = given["boundary"][placed.places]
    f[among(given["vertices"], part.vertices)] = given["moved"][
        among(part.vertices, given["vertices"])
    ]
    uv = coordinates(f)
    finite = bool(np.isfinite(uv).all())
    flipped, n_exact = flipped_faces(f, part.F) if finite else (np.arange(len(part.F)), 0)
    degrees = disk_map_distortion(placed.piece, uv)
    inscribed = marked(len(f), placed.border)[part.F].all(axis=1)
    i, j, k = among(folder.read(near)["rows"], part.vertices)[part.F.T]
    return {
        "uv": uv,
        "finite": finite,
        "flipped": part.faces[flipped],
        "n_exact": n_exact,
        "degrees": np.array([_sums(degrees[~inscribed]), _sums(degrees[inscribed])]),
        **chosen(placed, i | j | k, f),
    }


def moments(
    folder: Folder, p: int, extension: tuple[Any, ...], w: complex, *direction: float
) -> Arrays:
    """Moments of area, on the surface, of psi_w o f, and of the height in a direction.

    ``moments``: sums of the mass m, m z, m z^2, m h and m h z. ``heights``: least and largest.
    """
    placed = Placed(folder, p)
    z = mobius_transformation(folder.read(named(extend, p, extension), "f")["f"], w)
    mass = vertex_areas(placed.part.V, placed.part.F)
    h = placed.part.V @ np.array(direction or (0.0, 0.0, 0.0))
    sums = np.array([mass.sum(), mass @ z, mass @ (z * z), mass @ h, (mass * h) @ z])
    return {"moments": sums, "heights": np.array([h.min(), h.max()])}


def chosen(placed: Placed, here: Bools, f: Complex) -> Arrays:
    """Return some faces: rows, corners, their positions, images, and which are on the boundary."""
    part, F = placed.part, placed.part.F[here]
    return {
        "faces": part.faces[here],
        "corners": part.vertices[F],
        "V": part.V[F],
        "images": f[F],
        "on_boundary": marked(len(f), placed.border)[F],
    }


def _torsion(folder: Folder, placed: Placed, surface: FactoredSurface) -> Floats:
    """(m,) sums of the torsion function over the corners of the faces."""
    on_seams = folder.read("torsion")["torsion"][placed.rows]
    on_given = np.concatenate([on_seams, np.zeros(len(placed.border))])
    u = surface.solve(placed.sources) + harmonic_extension(surface, on_given)
    i, j, k = u[placed.part.F.T]
    return i + j + k


def _sums(degrees: Floats) -> Floats:
    most = degrees.max() if degrees.size else 0.0
    return np.array([degrees.size, degrees.sum(), (degrees * degrees).sum(), most])
