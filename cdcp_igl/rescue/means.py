"""Vertices that are weighted means of their neighbours: embeddings, by Floater's theorem."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_matrix, diags, identity
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import SuperLU, splu

from ..arrays import Complex, Floats, Ints, as_complex, coordinates
from ..steps.mobius import conformal_barycenter, mobius_transformation
from ..surface.mesh import Mesh

LEAST_COTANGENT = 0.01  # where they are to be positive
INWARDS = 0.1  # the weight of a neighbour one ring further from the boundary
# No psi_w takes a vertex to 0 that one boundary vertex draws by more than half: one that has more
# than the first share is left with the second.
MOST_DRAWN, DRAWN, ROUNDS = 0.4, 0.3, 20

Weights = Callable[[Floats, Ints, Floats], csr_matrix]  # of the neighbours, by V, F and angles


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


def means_of_neighbours(weights: csr_matrix, inside: Ints) -> tuple[csr_matrix, SuperLU]:
    """(k, n) parts that neighbours have in the means that vertices are to be; the system, factored.

    The weights (n, n) are positive, the vertices `inside` (k,) those that are means.
    """
    rows = weights[inside]
    rows = diags(1 / np.asarray(rows.sum(axis=1)).ravel()) @ rows
    return rows, splu((identity(len(inside)) - rows[:, inside]).tocsc())


# In turn, until double precision keeps all faces.
EMBEDDING = mean_value_weights, roots_of_mean_values, positive_cotangents, outward_mean_values


def centered(mesh: Mesh, z: Complex, vertex: int, weights: csr_matrix) -> tuple[Complex, complex]:
    """Embed a disk with an interior vertex at 0; return the map (n,) and the point it had been at.

    Vertices are weighted means of their neighbours. How much each boundary vertex draws the given
    one follows from the weights, which may be any that are positive; the boundary (b,) is moved by
    psi_w, eq. (19), until that balances.
    """
    inside = mesh.interior
    at_vertex = (inside == vertex).astype(float)
    for _ in range(ROUNDS):
        rows, system = means_of_neighbours(weights, inside)
        draw = rows[:, mesh.loop].T @ system.solve(at_vertex, trans="T")
        most = np.flatnonzero(draw > MOST_DRAWN)
        if len(most) == 0:
            break
        scale = np.ones(len(mesh.V))
        scale[mesh.loop[most]] = DRAWN / (1 - DRAWN) * (1 / draw[most] - 1)
        weights = weights @ diags(scale)
    w = conformal_barycenter(z, draw)
    z = mobius_transformation(z, w)
    f = np.zeros(len(mesh.V), dtype=complex)
    f[mesh.loop] = z = z / abs(z)
    f[inside] = as_complex(system.solve(coordinates(rows[:, mesh.loop] @ z)))
    f[vertex] = 0
    return f, w
