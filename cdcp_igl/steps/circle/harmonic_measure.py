"""The boundary seen from the centre: harmonic measure, and arc length for comparison."""

from __future__ import annotations

import numpy as np

from ...arrays import Complex, Floats
from ...solve.factor import Factor
from ...solve.laplacian import Laplacian
from ...surface.mesh import DiskMesh

__all__ = ["arc_length_shares", "around", "edge_shares", "flow", "harmonic_shares"]

# What a face behind an edge receives, as part of what its neighbours do. On scans with ears, whose
# shares are known from finer meshes of the same surface, 0.01 to 0.1 are equally good.
BEHIND = 0.1


def harmonic_shares(mesh: DiskMesh, L: Laplacian, factor: Factor, face: int) -> Floats:
    """Share of the circle that belongs to every boundary edge when a face goes to its centre.

    log|f| of a conformal map f onto the disk is harmonic, 0 on the boundary, and has its pole
    where f = 0; arg f is its conjugate. So heat that enters at the central face and leaves
    through the cold boundary does so in proportion to the angles on the circle. Without
    negative weights there is no negative flux (maximum principle), and even the smallest keep
    their digits, however crowded.

    What leaves at a vertex belongs to both its edges. Next to a corner of angle a, where the
    conformal map is like z^(pi/a), they get heat in proportion to their lengths to the power
    pi/a: to the lengths themselves where the boundary is straight.

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
        From each vertex of ``mesh.loop`` to the next; positive, and they sum to 1. Edges
        between vertices without interior neighbours, which no heat reaches, share a part of
        what the edges around them have. NaN if the face has no interior corner.

    References
    ----------
    J. B. Garnett, D. E. Marshall. Harmonic Measure. Cambridge University Press, 2005.
    """
    source = np.zeros(len(mesh.V))
    source[mesh.F[face]] = 1
    heat = np.zeros(len(mesh.V))
    heat[mesh.interior] = factor.solve_interior(source[mesh.interior])
    return edge_shares(mesh, flow(mesh, L, heat))


def flow(mesh: DiskMesh, L: Laplacian, heat: Floats) -> Floats:
    """(nB,) what leaves through each boundary vertex at temperatures (n,), 0 on the boundary."""
    return np.maximum(-(L.matrix() @ heat)[mesh.loop], 0)


def edge_shares(mesh: DiskMesh, flux: Floats) -> Floats:
    """(nB,) what leaves through each boundary edge, by what leaves through the vertices."""
    if not flux.any():
        return np.full(len(flux), np.nan)
    exponent = np.pi / np.bincount(mesh.F.ravel(), mesh.angles.ravel())[mesh.loop]
    length = arc_length_shares(mesh)
    # The part of the edge that follows, at most 1 / (1 + 0): a power of a ratio may overflow.
    with np.errstate(over="ignore"):
        following = 1 / (1 + (np.roll(length, 1) / length) ** exponent)
    steps = _filled(flux * following + np.roll(flux * (1 - following), -1))
    return steps / steps.sum()


def _filled(steps: Floats) -> Floats:
    """Let each run of zeros share a part of the smaller of the positive numbers around it."""
    known = np.flatnonzero(steps > 0)
    if len(known) == len(steps):
        return steps
    last = np.searchsorted(known, np.arange(len(steps)), side="right") - 1
    following = (last + 1) % len(known)
    run = (known[following] - known[last] - 1) % len(steps)
    smaller = np.minimum(steps[known[last]], steps[known[following]])
    return np.where(steps > 0, steps, BEHIND * smaller / np.maximum(run, 1))


def arc_length_shares(mesh: DiskMesh) -> Floats:
    """(nB,) shares of the boundary edges in its length."""
    points = mesh.V[mesh.loop]
    lengths = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    return lengths / lengths.sum()


def around(steps: Floats) -> Complex:
    """Points on the unit circle, from 1, each followed by its step in proportion."""
    return np.exp(2j * np.pi * (np.cumsum(steps) - steps) / steps.sum())
