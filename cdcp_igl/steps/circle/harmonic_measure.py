"""The boundary seen from the centre: harmonic measure, and arc length for comparison."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...solve.factor import Factor
from ...solve.laplacian import Laplacian
from ...surface.mesh import DiskMesh

__all__ = ["arc_length_shares", "harmonic_shares"]


def harmonic_shares(mesh: DiskMesh, L: Laplacian, factor: Factor, face: int) -> Floats:
    """Share of the circle that belongs to every boundary edge when a face goes to its centre.

    log|f| of a conformal map f onto the disk is harmonic, 0 on the boundary, and has its pole
    where f = 0; arg f is its conjugate. So heat that enters at the central face and leaves
    through the cold boundary does so in proportion to the angles on the circle. A vertex
    stands for half of each of its edges. Without negative weights there is no negative flux
    (maximum principle), and even the smallest keep their digits, however crowded.

    Parameters
    ----------
    mesh : DiskMesh
    L : Laplacian
        Without negative weights at interior vertices.
    factor : Factor
        Its factorization.
    face : int
        The central face.

    Returns
    -------
    (nB,) float64
        From each vertex of ``mesh.loop`` to the next; they sum to 1. Zero between vertices
        without interior neighbours, which no heat reaches; NaN if the face has no interior
        corner.

    References
    ----------
    J. B. Garnett, D. E. Marshall. Harmonic Measure. Cambridge University Press, 2005.
    """
    source = np.zeros(len(mesh.V))
    source[mesh.F[face]] = 1
    heat = np.zeros(len(mesh.V))
    heat[mesh.interior] = factor.solve_interior(source[mesh.interior])
    flux = np.maximum(-(L.matrix() @ heat)[mesh.loop], 0)
    with np.errstate(invalid="ignore"):
        return (flux + np.roll(flux, -1)) / (2 * flux.sum())


def arc_length_shares(mesh: DiskMesh) -> Floats:
    """(nB,) shares of the boundary edges in its length."""
    points = mesh.V[mesh.loop]
    lengths = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    return lengths / lengths.sum()
