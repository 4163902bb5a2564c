"""Vertices that are weighted means of their neighbours: embeddings, by Floater's theorem."""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.sparse import csr_matrix, diags, identity
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import SuperLU, splu

from ..arrays import Complex, Floats, Ints, as_complex, coordinates
from ..steps.mobius import conformal_barycenter, mobius_transformation
from ..surface.mesh import Mesh
from ..surface.triangles import flipped_faces
from .recentring import deep_vertex, recentered

LEAST_COTANGENT = 0.01  # where they are to be positive
INWARDS = 0.1  # the weight of a neighbour one ring further from the boundary
# No psi_w takes a vertex to 0 that one boundary vertex draws by more than half: one that has more
# than the first share is left with the second.
MOST_DRAWN, DRAWN, ROUNDS = 0.4, 0.3, 20


def mean_value_weights(V: Floats, F: Ints, angles: Floats) -> csr_matrix:
    """(n, n) mean-value weights: (tan(a/2) + tan(b/2)) / |v_i - v_j|, all positive.

    a and b are the angles at v_i in the two faces at the edge; row i belongs to v_i.
    """
    half_tangents = np.tan(angles / 2)
    i, j = np.repeat(F, 2, axis=1), F[:, [1, 2, 2, 0, 0, 1]]
    weights = np.repeat(half_tangents, 2, axis=1) / np.linalg.norm(V[i] - V[j], axis=2)
    return csr_matrix((weights.ravel(), (i.ravel(), j.ravel())), (len(V), len(V)))


def roots_of_mean_values(V: Floats, F: Ints, angles: Floats) -> csr_matrix:
    """(n, n) roots of the mean-value weights, which differ less."""
    return mean_value_weights(V, F, angles).sqrt()


def positive_cotangents(V: Floats, F: Ints, angles: Floats) -> csr_matrix:
    """(n, n) sums of the cotangents of the angles opposite each edge, raised where too small."""
    i, j = F[:, [1, 2, 0]].ravel(), F[:, [2, 0, 1]].ravel()
    weights = csr_matrix((1 / np.tan(angles).ravel(), (i, j)), (len(V), len(V)))
    weights = csr_matrix(weights + weights.T)
    weights.data = np.maximum(weights.data, LEAST_COTANGENT)
    return weights


def outward_mean_values(V: Floats, F: Ints, angles: Floats) -> csr_matrix:
    """(n, n) mean-value weights, of which those of neighbours nearer to the boundary count more.

    Along a leg mean values shrink by exp(-2 pi) for each length that is its circumference. Means of
    those further out alone would shrink by cos(pi / k) for each ring of k vertices.
    """
    weights = mean_value_weights(V, F, angles)
    weights.sum_duplicates()
    on_boundary = np.diff(weights.indptr) > np.bincount(F.ravel())  # more neighbours than faces
    rims = np.flatnonzero(on_boundary)
    depth = dijkstra(weights, indices=rims, unweighted=True, min_only=True)
    deeper = depth[weights.indices] - np.repeat(depth, np.diff(weights.indptr))
    weights.data *= INWARDS**deeper
    return weights


# In turn, until double precision keeps all faces.
WEIGHTS = mean_value_weights, roots_of_mean_values, positive_cotangents, outward_mean_values


def tutte_embedding(mesh: Mesh, f: Complex, *, on_disk: bool = False) -> tuple[Complex, complex]:
    """Set the interior of a map (n,) with a convex boundary to mean values of its neighbours.

    Floater's theorem applies: positive weights and a convex boundary give an embedding, as far as
    double precision goes. Where the mean values crowd too much for it, or lie almost on a line,
    their roots are taken for weights, then the cotangents, as far as they are positive, and then
    mean values of which those towards the boundary count more. If the map is `on_disk` and most of
    the surface is in one spot, a Möbius transformation takes that to 0, and where faces at the
    boundary are flipped by it, or more, the boundary is moved alone. Returns the map and the point
    that has gone to 0.

    References
    ----------
    M. S. Floater. Mean value coordinates. Comput. Aided Geom. Design 20(1), 2003.
    """
    crowded = list[Complex]()
    for weigh in WEIGHTS:
        again = partial(combined, weigh(mesh.scaled, mesh.F, mesh.angles), inside=mesh.interior)
        g, w = again(f), 0j
        if on_disk:
            crowded.append(g)
            g, w = recentered(mesh, g, again)
        if len(flipped_faces(g, mesh.F)[0]) == 0:
            return g, w
    for start in crowded:
        if (vertex := deep_vertex(mesh, start, mesh.F)) is not None:
            return centered(mesh, f[mesh.loop], vertex)
    return g, w


def centered(mesh: Mesh, z: Complex, vertex: int) -> tuple[Complex, complex]:
    """Embed a disk with an interior vertex at 0; return the map (n,) and the point it had been at.

    The boundary (b,) is moved by psi_w, eq. (19), until what draws the vertex balances. As far as
    double precision goes, by weights in turn.
    """
    for weigh in WEIGHTS:
        f, w = _balanced_around(mesh, z, vertex, weigh(mesh.scaled, mesh.F, mesh.angles))
        if len(flipped_faces(f, mesh.F)[0]) == 0:
            break
    return f, w


def _balanced_around(
    mesh: Mesh, z: Complex, vertex: int, weights: csr_matrix
) -> tuple[Complex, complex]:
    """Do what `centered` does, by given weights, which may be any that are positive.

    How much each boundary vertex draws the given one follows from them.
    """
    inside = mesh.interior
    at_vertex = (inside == vertex).astype(float)
    for _ in range(ROUNDS):
        rows, system = _means_of_neighbours(weights, inside)
        draw = rows[:, mesh.loop].T @ system.solve(at_vertex, trans="T")
        most = np.flatnonzero(draw > MOST_DRAWN)
        if len(most) == 0:
            break
        scale = np.ones(len(mesh.scaled))
        scale[mesh.loop[most]] = DRAWN / (1 - DRAWN) * (1 / draw[most] - 1)
        weights = weights @ diags(scale)
    w = conformal_barycenter(z, draw)
    z = mobius_transformation(z, w)
    f = np.zeros(len(mesh.scaled), dtype=complex)
    f[mesh.loop] = z = z / abs(z)
    f[inside] = as_complex(system.solve(coordinates(rows[:, mesh.loop] @ z)))
    f[vertex] = 0
    return f, w


def combined(weights: csr_matrix, g: Complex, inside: Ints) -> Complex:
    """Make the vertices `inside` (k,) the weighted means of their neighbours in a map (n,).

    Solved for the displacements, by differences of neighbours: where a patch is small,
    differences are more accurate than positions.
    """
    rows, system = _means_of_neighbours(weights, inside)
    owner = np.repeat(np.arange(len(inside)), np.diff(rows.indptr))
    g = g.copy()
    for _ in range(2):
        pull = rows.data * (g[rows.indices] - g[inside[owner]])
        b = [np.bincount(owner, part, len(inside)) for part in (pull.real, pull.imag)]
        g[inside] += as_complex(system.solve(np.column_stack(b)))
    return g


def _means_of_neighbours(weights: csr_matrix, inside: Ints) -> tuple[csr_matrix, SuperLU]:
    """(k, n) parts that neighbours have in the means that vertices are to be; the system, factored.

    The weights (n, n) are positive, the vertices `inside` (k,) those that are means.
    """
    rows = weights[inside]
    rows = diags(1 / np.asarray(rows.sum(axis=1)).ravel()) @ rows
    return rows, splu((identity(len(inside)) - rows[:, inside]).tocsc())
