"""The central face of the surface, sect. 4.1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.sparse import identity

from ..arrays import Floats, Ints
from ..solve.factored import FactoredSurface
from ..solve.solvers import factorize
from ..surface.triangles import face_areas

CenterMethod = Literal["torsion", "heat", "centroid"]
METHODS = get_args(CenterMethod)

HEAT_TIME = 1e4  # t of eq. (14)
CANDIDATES = 24  # most central faces among which a well-shaped one is sought
EQUAL = 9  # digits
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
    surface: FactoredSurface, center: CenterMethod | int = "torsion", *, well_shaped: bool = True
) -> Center:
    """Choose the face that is sent to infinity, eq. (15): a given one, or the most central.

    If `well_shaped`, the most central one without small angles: the dipole of eq. (18) sits on one
    face, and the shape of that face matters more than its place.
    """
    if not isinstance(center, str):
        return Center("given", int(center))
    central = centrality(surface, center)
    if not well_shaped:
        return Center(center, int(central.argmax()))
    faces = most_central(central)
    smallest = surface.mesh.angles_of(faces).min(axis=1)
    return Center(center, first_well_shaped(central[faces], faces, smallest))


def centrality(surface: FactoredSurface, method: CenterMethod) -> Floats:
    """How central each face (m,) is, by one of three measures; larger is more central.

    - ``"heat"``: heat 1 on the boundary flows in for time t = 1e4; the centre is the
      coldest face, eqs. (13)-(15). Factors I + t L.
    - ``"torsion"``: L u = 1 inside, u = 0 on the boundary; the centre is the face with
      the largest u. Costs one solve with the factor that is already there.
    - ``"centroid"``: nearest to the centroid of the surface's area.
    """
    mesh = surface.mesh
    if method == "heat":
        initial = mesh.on_boundary.astype(float)
        system = identity(len(mesh.scaled)) + HEAT_TIME * surface.laplacian.matrix()
        heat = factorize(system).solve(initial)  # (14)
        return -heat[mesh.F].sum(axis=1)  # (15)
    if method == "torsion":
        u = surface.solve(np.ones(len(mesh.scaled)))
        i, j, k = u[mesh.F.T]
        return i + j + k
    barycenters = mesh.scaled[mesh.F].mean(axis=1)
    centroid = np.average(barycenters, axis=0, weights=face_areas(mesh.scaled, mesh.F))
    return -np.linalg.norm(barycenters - centroid, axis=1)


def most_central(central: Floats) -> Ints:
    """Find the faces among which `first_well_shaped` chooses, in any order."""
    k = min(CANDIDATES, len(central))
    return np.argpartition(-central, k - 1)[:k]


def first_well_shaped(central: Floats, faces: Ints, smallest: Floats) -> int:
    """Choose the most central of some faces, given their rows, that has no small angle.

    What differs by rounding only is equal, as on parts that are symmetric: there the smallest row
    counts, which is the same in another unit, and where the surface is turned.
    """
    central = np.round(central / max(abs(central).max(), np.finfo(float).tiny), EQUAL)
    order = np.lexsort((faces, -central))[:CANDIDATES]
    faces, smallest = faces[order], np.round(smallest[order], EQUAL)
    good = smallest > SMALLEST_ANGLE
    return int(faces[good.argmax() if good.any() else smallest.argmax()])
