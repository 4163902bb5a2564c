"""Conformal energy minimization: the interior and the boundary take turns."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Floats
from ..errors import MapError
from ..io.given import takes_meshes
from ..rescue.boundary import arc_length_map
from ..solve.laplacian import cotangent_laplacian
from ..surface.mesh import DiskMesh
from .certified import certified_disk_map
from .dirichlet import Dirichlet

TOLERANCE = 1e-9  # of what a round takes from the conformal energy; the disk has area pi
MAX_ROUNDS = 500  # the Chinese Lion takes 230


@takes_meshes
def cem(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk conformally onto the unit disk, Yueh, Lin, Wu and Yau 2017.

    Conformal energy is Dirichlet energy minus area. For a given boundary, the interior minimises
    it; for the interior reflected at the circle, the boundary does. That is then centred and
    pushed back onto the circle, and so in turn until the energy falls no more.

    Parameters
    ----------
    V, F
        As in `harmonic`.

    Returns
    -------
    (n, 2) float64
        As of `harmonic`.

    Raises
    ------
    MeshError, SolverError, MapError
        As `harmonic`; MapError, too, if there is no interior vertex, or if the energy still falls
        after 500 rounds.

    References
    ----------
    M.-H. Yueh, W.-W. Lin, C.-T. Wu, S.-T. Yau. An efficient energy minimization for conformal
    parameterizations. J. Sci. Comput. 73, 2017.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.paraboloid(8)
    >>> cdcp_igl.reference.cem(V, F).shape
    (217, 2)
    """
    mesh = DiskMesh(V, F)
    if not len(mesh.interior):
        raise MapError("There is no interior vertex from which the boundary could follow")
    # A vertex that comes to 0 is reflected to infinity; the energy says so.
    with np.errstate(divide="ignore", invalid="ignore"):
        return certified_disk_map(mesh, _cem(mesh))


def _cem(mesh: DiskMesh) -> Complex:
    B, I = mesh.loop, mesh.interior  # noqa: E741
    L = cotangent_laplacian(mesh).matrix()
    interior_problem, boundary_problem = Dirichlet(L, B), Dirichlet(L, I)

    def conformal_energy(f: Complex) -> float:
        area = (f[B].conj() * np.roll(f[B], -1)).imag.sum() / 2
        return float(np.vdot(f, L @ f).real / 2 - area)

    f = interior_problem.solve(arc_length_map(mesh))
    energy = conformal_energy(f)
    for _ in range(MAX_ROUNDS):
        f_B = boundary_problem.solve(f[I] / abs(f[I]) ** 2)[B]
        f_B -= f_B.mean()
        f = interior_problem.solve(f_B / abs(f_B))
        before, energy = energy, conformal_energy(f)
        if not before - energy > TOLERANCE:
            return f / f[B[0]]
    raise MapError(f"The conformal energy still falls after {MAX_ROUNDS} rounds")
