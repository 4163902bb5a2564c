"""Rings without flipped faces, from embeddings of disks in which the hole is in the middle."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats, marked, shifted
from ..descent.descent import Descent, from_tutte, pulled
from ..descent.energies import mean_squared_log_dilatation
from ..descent.targets import DISK
from ..starts.boundary import arc_length_map
from ..starts.tutte import centered
from ..steps.circle import Rejected
from ..surface.mesh import DiskMesh, Mesh
from ..surface.triangles import flipped_faces


def embedded_ring(mesh: Mesh) -> Complex:
    """Map a surface (n,) onto a ring around 0 without flipped faces.

    The hole is filled by a fan whose middle is held at 0; the outer loop lies by arc length until
    the shear is lowered. Then the inner loop is pulled to a circle, each vertex along its ray, as
    far at a time as no face flips. `Rejected` if doubles do not suffice for that; MeshError if a
    face of the fan has no area.
    """
    loop, n = mesh.loops[1], len(mesh.scaled)
    fan = np.column_stack([shifted(loop), loop, np.full(len(loop), n)])
    disk = DiskMesh(np.vstack([mesh.scaled, _apex(mesh.scaled[loop])]), np.vstack([mesh.F, fan]))
    f, _ = centered(disk, arc_length_map(disk), n)
    if len(flipped_faces(f, disk.F)[0]):
        raise Rejected("it crowds the mean values too much for double precision")
    f = from_tutte(disk, f, marked(n + 1, n))
    size = abs(f[loop])
    on_circle = f[loop] * (np.exp(np.log(size).mean()) / size)
    descent = Descent(disk, f, DISK, marked(n + 1, np.append(loop, n)))
    if not pulled(descent, mean_squared_log_dilatation(disk), loop, on_circle):
        raise Rejected("the hole cannot be pulled to a circle")
    return descent.f[:-1]


def _apex(V: Floats) -> Floats:
    """(3,) a point over the middle of a loop (k, 3), which may be a slit: its fan has an area."""
    middle = V.mean(axis=0)
    _, sizes, axes = np.linalg.svd(V - middle, full_matrices=False)
    return middle + np.linalg.norm(sizes) / np.sqrt(len(V)) * axes[-1]
