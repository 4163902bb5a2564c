"""A sphere without one vertex as a disk, embedded, and that disk on the sphere."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats, Ints, coordinates, marked
from ..steps.dipole import star
from ..surface.mesh import DiskMesh, Mesh
from .tutte import tutte_embedding


def without_pole(mesh: Mesh, pole: int) -> tuple[DiskMesh, Ints, Complex]:
    """Take a vertex and its faces out: the disk that is left, rows of V, and an embedding (k,)."""
    part, rows = mesh.part(np.flatnonzero(~marked(len(mesh.scaled), pole)[mesh.F].any(axis=1)))
    disk, (ring, w) = DiskMesh(part.scaled, part.F), star(mesh, pole)
    z = np.zeros(len(mesh.scaled), dtype=complex)
    z[ring] = abs(w) / w
    f, _ = tutte_embedding(disk, z[rows], on_disk=True)
    return disk, rows, f


def over_hemispheres(mesh: Mesh, pole: int, rows: Ints, f: Complex) -> Floats:
    """Map a surface onto the sphere, given a map (k,) of all but the pole onto the disk.

    Central projection takes the disk to a part of a hemisphere, and its edges to great arcs, so
    that no face is flipped. The pole lies on the other hemisphere.
    """
    P = np.empty((len(mesh.scaled), 3))
    P[pole] = 0, 0, 1
    # Seen from outside, from below.
    P[rows] = np.column_stack([coordinates(f.conj()), -np.ones(len(f))])
    return P / np.linalg.norm(P, axis=1)[:, None]
