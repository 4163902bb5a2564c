"""Partial welding: parts flattened on their own, and joined along their seams."""

from __future__ import annotations

from operator import index

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from ..arrays import Complex, Floats, Ints, places
from ..docstrings import like
from ..errors import MapError
from ..io.given import takes_meshes
from ..solve.laplacian import cotangent_laplacian
from ..starts.boundary import arc_length_map
from ..steps.mobius import normalize
from ..steps.zipper import open_blocks
from ..surface.mesh import DiskMesh, Mesh
from ..surface.topology import components_of_pairs
from .certified import certified_disk_map
from .dirichlet import Dirichlet, harmonic
from .free_boundary import least_squares_layout


@takes_meshes
@like(harmonic)
def pgcp(V: ArrayLike, F: ArrayLike, *, parts: int = 4) -> Floats:
    """Map a triangulated disk conformally onto the unit disk, by parts (Choi et al. 2020).

    The surface is halved again and again. Each part is flattened with a free outline, by least
    squares (discrete natural conformal parameterization); the others are not needed for that. Then
    the outlines of two halves are joined: conformal maps of the halves take what they share to the
    same places. They are those of the zipper, by which each side of the seam is opened into a line,
    and what undoes it, for both lines at once. The outline of the whole is opened into that of the
    disk in the same way. At last, each part is harmonic between its seams. MapError if no seam goes
    through an interior vertex, or if the parts cannot be joined.

    Parameters
    ----------
    parts : int
        How many, at least 2, else ValueError.

    References
    ----------
    G. P. T. Choi, Y. Leung-Liu, X. Gu, L. M. Lui. Parallelizable global conformal parameterization
    of simply-connected surfaces via partial welding. SIAM J. Imaging Sci. 13(3), 2020.
    """
    if index(parts) < 2:
        raise ValueError(f"parts must be at least 2, not {parts!r}")
    mesh = DiskMesh(V, F)
    with np.errstate(all="ignore"):  # of an outline that crosses itself, nothing is finite
        z = _onto_the_disk(mesh, _flattened(mesh, parts))
    known = np.isfinite(z)
    if not known[mesh.loop].all():
        raise MapError("The parts cannot be joined: an outline crosses itself, or is too crowded")
    f = Dirichlet(cotangent_laplacian(mesh).matrix(), np.flatnonzero(known)).solve(z[known])
    f, _ = normalize(mesh, f / f[mesh.loop[0]], "angle")
    return certified_disk_map(mesh, f)


def _onto_the_disk(mesh: Mesh, z: Complex) -> Complex:
    """Take the boundary to the circle and the seams into it (n,), NaN elsewhere."""
    B, seams = mesh.loop, np.flatnonzero(np.isfinite(z) & ~mesh.on_boundary)
    if not len(seams):
        raise MapError("There is no interior vertex through which the surface could be halved")
    x, y = _opened(z[B], z[seams])
    # The last edge closes a quadrant, whose square is the upper half-plane.
    inside, line = x[:-1] ** 2, y**2
    middle = complex(np.median(inside.real), np.median(inside.imag))
    z[seams] = (inside - middle) / (inside - middle.conjugate())
    z[B[:-1]] = (line - middle) / (line - middle.conjugate())
    z[B[-1]] = 1
    z[B] /= abs(z[B])
    return z


def _flattened(mesh: Mesh, parts: int) -> Complex:
    """(n,) the boundary and the seams in the plane, joined; NaN elsewhere."""
    z = np.full(len(mesh.scaled), np.nan, dtype=complex)
    if parts == 1 or len(mesh.F) == 1:
        z[mesh.loop] = least_squares_layout(mesh, mesh.angles)[mesh.loop]
        return z
    path = _path_across(mesh)
    sides = np.stack([z, z])
    for side, faces in enumerate(_sides(mesh, path)):
        vertices, corners = np.unique(mesh.F[faces], return_inverse=True)
        half = DiskMesh(mesh.scaled[vertices], corners.reshape(-1, 3))
        sides[side, vertices] = _flattened(half, (parts + side) // 2)
    return _welded(sides[0], sides[1], path)


def _path_across(mesh: Mesh) -> Ints:
    """Vertices of a path through the interior, from a boundary vertex to one far from it.

    It is the shortest path in a harmonic map.
    """
    B, circle = mesh.loop, arc_length_map(mesh)
    f = Dirichlet(cotangent_laplacian(mesh).matrix(), B).solve(circle)
    inner = mesh.edges.ends(mesh.edges.valence == 2)
    tail, head = np.vstack([inner, inner[:, ::-1]]).T
    start = B[np.isin(B, tail).argmax()]
    use = ~mesh.on_boundary[tail] | (tail == start)
    tail, head = tail[use], head[use]
    graph = csr_matrix((abs(f[tail] - f[head]), (tail, head)), 2 * (len(f),))
    distance, before = dijkstra(graph, indices=start, return_predecessors=True)
    off = np.where(np.isfinite(distance[B]) & (start != B), abs(circle + f[start]), np.inf)
    path = [B[off.argmin()]]
    while path[-1] != start:
        path.append(before[path[-1]])
    return np.array(path)


def _sides(mesh: Mesh, path: Ints) -> tuple[Ints, Ints]:
    """Faces on the left and on the right of a path across."""
    m, edges = len(mesh.F), mesh.edges
    place = places(path, len(mesh.scaled))[edges.ends(edges.valence == 2)]
    along = (place.min(axis=1) >= 0) & (abs(place[:, 0] - place[:, 1]) == 1)
    one, other = edges.twins
    _, side = components_of_pairs(one[~along] % m, other[~along] % m, m)
    begins = (path[0] == mesh.F) & (np.roll(mesh.F, -1, axis=1) == path[1])
    left = side == side[begins.any(axis=1)]
    return np.flatnonzero(left), np.flatnonzero(~left)


def _opened(arc: Complex, rest: Complex) -> tuple[Complex, Floats]:
    """Open an arc (k,) into the positive real axis, from 0 to infinity, and what is on its left.

    Return the rest, with infinity at the end, in the upper half-plane, and the arc but for its end.
    """
    points = np.concatenate([arc[2:], rest])
    x = np.append(1j * np.sqrt((points - arc[0]) / (points - arc[1])), 1j)
    y = np.zeros(len(arc) - 1)
    open_blocks(x, y, len(arc) - 2)
    return x[len(arc) - 2 :] - y[0], y - y[0]


def _welded(left: Complex, right: Complex, path: Ints) -> Complex:
    """Join two maps (n,), NaN where they are not known, of what is left and right of a path."""
    of_left, of_right = np.isfinite(left), np.isfinite(right)
    of_left[path] = of_right[path] = False
    x, after = _opened(left[path], left[of_left])
    y, before = _opened(right[path].conj(), right[of_right].conj())
    # Two quadrants, with the seam from 0 to infinity on the real axis, on either side.
    x, y, after, before = np.sqrt(x), -np.sqrt(y).conj(), np.sqrt(after[1:]), -np.sqrt(before[1:])
    k = len(path) - 1
    scale = np.exp(np.log(after / -before).sum() / k)
    z = np.concatenate([[0], after, [0], scale * before, scale * y[:-1], x])
    for j in range(k - 1, 0, -1):
        # Pair j goes to -1 and 1, and they to infinity: what is outside closes, see `open_arcs`.
        high, low = z[j].real, z[k + j].real
        z[[j, k + j]] = (high + low) / 2  # any number between them
        z = (2 * z - high - low) / (high - low)
        z /= np.sqrt(1 - z**2)
        z[j + 1] = 1j
    z = (z - z[0].real) ** 2  # the last edge closes
    z -= z[-1]  # to which infinity on the left has come
    joined = np.full(len(left), np.nan, dtype=complex)
    joined[path] = 1 / z[: k + 1]
    joined[path[1]] = 0
    joined[of_right], joined[of_left] = np.split(1 / z[2 * k : -1], [of_right.sum()])
    return joined
