"""Beltrami coefficients, the generalised Laplacian, and the linear Beltrami solver.

A chart is a complex coordinate p of the vertices, in which each face is a triangle of
either orientation. Gradients in a chart are written as complex numbers d/dx + i d/dy.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from ..arrays import Complex, Floats, Ints
from ..surface.triangles import face_areas, opposite_edges, twice_areas
from .dirichlet import Dirichlet


def beltrami_coefficient(p: Complex, F: Ints, M: Floats) -> Complex:
    """Beltrami coefficient of the piecewise linear map from a chart to a surface.

    On each face, mu = (E - G + 2i H) / (E + G + 2 sqrt(E G - H^2)) with the first
    fundamental form E = M_x.M_x, H = M_x.M_y, G = M_y.M_y of the map M(p), p = x + iy. It
    is 0 where the chart has the angles of the surface, and 1 in modulus where either one
    has collapsed.

    Parameters
    ----------
    p : (n,) complex128
        Chart.
    F : (m, 3) int64
    M : (n, 3) float64
        Positions of the vertices in space.

    Returns
    -------
    (m,) complex128
        One coefficient a face, at most 1 in modulus: surfaces have no orientation of
        their own in space.

    Examples
    --------
    Stretched to twice its width, mu = (2 - 1) / (2 + 1):

    >>> import numpy as np
    >>> from cdcp_igl.reference import beltrami_coefficient
    >>> p, F = np.array([0, 1, 1j]), np.array([[0, 1, 2]])
    >>> M = np.array([[0.0, 0, 0], [2, 0, 0], [0, 1, 0]])
    >>> beltrami_coefficient(p, F, M).round(4)
    array([0.3333+0.j])
    """
    edges = opposite_edges(p[F])
    # The hat function of corner k has the gradient i times edge k over twice the area.
    # That area cancels, so that a collapsed face does no harm.
    gradient = np.einsum("fk,fkd->fd", 1j * edges, M[F])  # M_x + i M_y, times twice the area
    stretch = 2 * face_areas(M, F) * abs(twice_areas(edges))  # sqrt(E G - H^2), likewise
    return (gradient**2).sum(axis=1) / ((abs(gradient) ** 2).sum(axis=1) + 2 * stretch)


def generalized_laplacian(p: Complex, F: Ints, mu: Complex) -> csr_matrix:
    """Assemble the generalised Laplacian G(p, mu) of div(A grad u) = 0.

    Maps of the chart with Beltrami coefficient mu have coordinates u that satisfy this
    equation with A = [[|1 - mu|^2, -2 Im mu], [-2 Im mu, |1 + mu|^2]] / (1 - |mu|^2) (Lui, Lam,
    Wong, Gu 2013). To first order such a map is p + mu conj(p) up to a similarity, so G is the
    cotangent Laplacian of faces with the edges e + mu conj(e). When mu belongs to the map from the
    chart to a surface, those faces are similar to the surface's own, and **G(p, mu) is the
    cotangent Laplacian of the surface, whatever the chart**.
    """
    edges = opposite_edges(p[F])
    edges = edges + mu[:, None] * edges.conj()
    twice_area = abs(twice_areas(edges))
    elements = (edges.conj()[:, :, None] * edges[:, None, :]).real / (2 * twice_area[:, None, None])
    rows, columns = np.repeat(F, 3, axis=1), np.tile(F, 3)
    return coo_matrix((elements.ravel(), (rows.ravel(), columns.ravel())), (len(p), len(p))).tocsr()


def linear_beltrami_solver(p: Complex, F: Ints, mu: Complex, S: Ints, c: Complex) -> Complex:
    """Find the map of a chart with a given Beltrami coefficient and given values on S.

    The coefficients are less than 1 in modulus; S has at least one vertex, and none twice. The
    map (n,) has the coefficients mu as nearly as the triangulation and the values c (k,) allow.
    """
    return Dirichlet(generalized_laplacian(p, F, mu), S).solve(c)
