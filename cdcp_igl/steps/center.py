"""The central face of the surface, sect. 4.1."""

from __future__ import annotations

from dataclasses import dataclass
from operator import index
from typing import Literal

import numpy as np
from scipy.sparse import identity

from ..arrays import Floats
from ..solve.cholmod import Cholesky
from ..solve.factor import Factor
from ..solve.laplacian import Laplacian
from ..surface.mesh import DiskMesh
from ..surface.triangles import face_areas

__all__ = ["Center", "CenterMethod", "central_face", "centrality"]

CenterMethod = Literal["torsion", "heat", "centroid"]

HEAT_TIME = 1e4  # t of eq. (14)
CANDIDATES = 24  # most central faces among which a well-shaped one is sought
SMALLEST_ANGLE = np.radians(20)  # that makes a face well shaped


@dataclass(frozen=True)
class Center:
    """The face that carries the dipole.

    Attributes
    ----------
    method : str
        ``"torsion"``, ``"heat"``, ``"centroid"`` or ``"given"``.
    face : int
        Row of F.
    """

    method: str
    face: int

    def __str__(self) -> str:
        return f"{self.method}, face {self.face}"


def central_face(
    mesh: DiskMesh,
    L: Laplacian,
    factor: Factor,
    center: CenterMethod | int,
    *,
    well_shaped: bool,
) -> Center:
    """Choose the face that is sent to infinity, eq. (15).

    Parameters
    ----------
    mesh : DiskMesh
    L : Laplacian
    factor : Factor
        Its factorization.
    center : {"torsion", "heat", "centroid"} or int
        A measure of centrality, or a row of F.
    well_shaped : bool
        Take the most central face without small angles, rather than the most central one.
        The dipole of eq. (18) sits on one face, and the shape of that face matters more
        than its place.

    Returns
    -------
    Center
    """
    if not isinstance(center, str):
        face = index(center)
        if not 0 <= face < len(mesh.F):
            raise ValueError(f"center is face {face}; the mesh has faces 0..{len(mesh.F) - 1}")
        return Center("given", face)
    central = centrality(mesh, L, factor, center)
    return Center(center, _well_shaped(mesh, central) if well_shaped else int(central.argmax()))


def centrality(mesh: DiskMesh, L: Laplacian, factor: Factor, method: CenterMethod) -> Floats:
    """How central each face is, by one of three measures.

    Parameters
    ----------
    mesh : DiskMesh
    L : Laplacian
    factor : Factor
        Its factorization.
    method : {"torsion", "heat", "centroid"}
        - ``"heat"``: heat 1 on the boundary flows in for time t = 1e4; the centre is the
          coldest face, eqs. (13)-(15). Factors I + t L.
        - ``"torsion"``: L u = 1 inside, u = 0 on the boundary; the centre is the face with
          the largest u. Costs one solve with the factor that is already there.
        - ``"centroid"``: nearest to the centroid of the surface's area.

    Returns
    -------
    (m,) float64
        Larger is more central.
    """
    if method == "heat":
        initial = mesh.on_boundary.astype(float)
        heat = Cholesky(identity(len(mesh.V)) + HEAT_TIME * L.matrix()).solve(initial)  # (14)
        return -heat[mesh.F].sum(axis=1)  # (15)
    if method == "torsion":
        u = np.zeros(len(mesh.V))
        u[mesh.interior] = factor.solve_interior(np.ones(len(mesh.interior)))
        return u[mesh.F].sum(axis=1)
    if method == "centroid":
        barycenters = mesh.V[mesh.F].mean(axis=1)
        centroid = np.average(barycenters, axis=0, weights=face_areas(mesh.V, mesh.F))
        return -np.linalg.norm(barycenters - centroid, axis=1)
    raise ValueError(f'center must be "torsion", "heat", "centroid" or a face, not {method!r}')


def _well_shaped(mesh: DiskMesh, central: Floats) -> int:
    k = min(CANDIDATES, len(mesh.F))
    faces = np.argpartition(-central, k - 1)[:k]
    faces = faces[np.lexsort((faces, -central[faces]))]
    smallest = mesh.angles[faces].min(axis=1)
    good = smallest > SMALLEST_ANGLE
    return int(faces[good.argmax() if good.any() else smallest.argmax()])
