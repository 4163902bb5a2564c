"""The boundary seen from the centre: harmonic measure, and arc length for comparison."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats
from ..solve.factored import FactoredSurface
from ..steps.flux import boundary_flux, edge_lengths, shared_by_edges
from ..surface.mesh import DiskMesh

__all__ = ["arc_length_shares", "around", "edge_shares", "harmonic_shares"]

# What a face behind an edge receives, as part of what its neighbours do. On scans with ears, whose
# shares are known from finer meshes of the same surface, 0.01 to 0.1 are equally good.
BEHIND = 0.1


def harmonic_shares(surface: FactoredSurface, face: int) -> Floats:
    """Share of the circle that belongs to every boundary edge when a face goes to its centre.

    log|f| of a conformal map f onto the disk is harmonic, 0 on the boundary, and has its pole
    where f = 0; arg f is its conjugate. So heat that enters at the central face and leaves
    through the cold boundary does so in proportion to the angles on the circle. Without
    negative weights there is no negative flux (maximum principle), and even the smallest keep
    their digits, however crowded.

    Parameters
    ----------
    surface : FactoredSurface
        Without negative weights at interior vertices.
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
    source = np.zeros(len(surface.mesh.V))
    source[surface.mesh.F[face]] = 1
    source[surface.mesh.loop] = 0
    return edge_shares(surface.mesh, -boundary_flux(surface, source))


def edge_shares(mesh: DiskMesh, flux: Floats) -> Floats:
    """(nB,) parts of all that leaves of each boundary edge, by what leaves at the vertices."""
    flux = np.maximum(flux, 0)
    if not flux.any():
        return np.full(len(flux), np.nan)
    steps = _filled(shared_by_edges(mesh, flux))
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
    lengths = edge_lengths(mesh)
    return lengths / lengths.sum()


def around(steps: Floats) -> Complex:
    """Points on the unit circle, from 1, each followed by its step in proportion."""
    return np.exp(2j * np.pi * (np.cumsum(steps) - steps) / steps.sum())
