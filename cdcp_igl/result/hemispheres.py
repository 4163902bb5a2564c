"""A sphere as a chart of two hemispheres, side by side, for textures and pictures."""

from __future__ import annotations

import numpy as np

from ..arrays import Bools, Floats, coordinates
from ..descent.repair import repair_locally
from ..steps.stereographic import to_plane
from ..surface.mesh import SphereMesh
from ..verdict.any_map import certify

GAP = 0.01  # between the hemispheres, by their width


def two_hemispheres(
    mesh: SphereMesh, P: Floats, n_faces: int | None, *, inward: bool
) -> tuple[Floats, Bools, bool]:
    """Lay out a map P (n, 3) onto the sphere: the chart (m, 3, 2) of the first `n_faces` faces.

    Returns the chart, the faces (m,) that lie upwards, and whether the chart is one to one. It is
    seen along the first axis of three along which it is, or else along the third.
    """
    F, charts = mesh.F[:n_faces, :: -1 if inward else 1], []
    for turn in range(3):
        uv, upper = _side_by_side(mesh, np.roll(P, turn, axis=1), n_faces)
        uv = uv[:, :: -1 if inward else 1]
        charts.append((uv, upper, bool(certify(mesh.V, F, in_square(uv)).valid)))
        if charts[-1][2]:
            return charts[-1]
    return charts[0]


def _side_by_side(mesh: SphereMesh, P: Floats, n_faces: int | None) -> tuple[Floats, Bools]:
    """Lay the two halves of a map side by side: (m, 3, 2), and (m,) the upper faces.

    Those reach farther up than down.
    """
    height = P[mesh.F[:n_faces], 2]
    uv, upper = np.empty((len(height), 3, 2)), height.min(axis=1) + height.max(axis=1) > 0
    for side in np.unique(np.where(upper, 1, -1)):
        faces = np.flatnonzero(upper == (side > 0))
        half, rows = mesh.part(faces)
        # Slivers and large faces may be flipped: their edges are straight here, and no arcs.
        f, _ = repair_locally(half, to_plane(P[rows], side), is_free=True)
        uv[faces] = coordinates(f - side * (1 + GAP) * (side * f.real).max())[half.F]
    return uv, upper


def in_square(uv: Floats) -> Floats:
    """Scale a chart (m, 3, 2), which lies around 0, into the unit square."""
    return 0.5 + uv / (2 * abs(uv).max())
