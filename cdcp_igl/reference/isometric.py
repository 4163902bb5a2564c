"""Maps with free boundary that keep lengths: not conformal."""

from __future__ import annotations

from numpy.typing import ArrayLike

from .. import libigl
from ..arrays import Complex, Floats, as_complex, coordinates
from ..descent.energies import HALF, SymmetricDirichlet, resized
from ..docstrings import like
from ..io.given import takes_meshes
from ..maps.free import free_map
from ..surface.mesh import Mesh
from .certified import checked_free_map
from .free_boundary import lscm

ARAP_ROUNDS, SLIM_ROUNDS = 100, 20


@takes_meshes
@like(lscm)
def arap(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk to the plane, as rigidly as possible, by libigl.

    In turn, each face is turned to where it fits best, and all corners follow those of the faces,
    in the least squares sense; a hundred times, from `free_map`. The map may overlap itself and
    flip faces.

    Returns
    -------
    (n, 2) float64
        Rows as in V, faces counterclockwise but for flips, in the unit of V.

    References
    ----------
    L. Liu, L. Zhang, Y. Xu, C. Gotsman, S. J. Gortler. A local/global approach to mesh
    parameterization. Comput. Graph. Forum 27(5), 2008.
    """
    mesh, f = _start(V, F)
    return _finished(mesh, libigl.arap(mesh.scaled, mesh.F, coordinates(f), ARAP_ROUNDS))


@takes_meshes
@like(lscm)
def slim(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a triangulated disk to the plane with little symmetric Dirichlet energy, by libigl.

    Twenty rounds of weighted least squares that step by step lower the energy, from `free_map`; no
    face flips. The map may overlap itself. ``free_map(V, F, keep="lengths")`` has the same energy.

    Returns
    -------
    (n, 2) float64
        Rows as in V, faces counterclockwise, in the unit of V.

    References
    ----------
    M. Rabinovich, R. Poranne, D. Panozzo, O. Sorkine-Hornung. Scalable locally injective mappings.
    ACM Trans. Graph. 36(2), 2017.
    """
    mesh, f = _start(V, F)
    return _finished(mesh, libigl.slim(mesh.scaled, mesh.F, coordinates(f), SLIM_ROUNDS))


def _start(V: ArrayLike, F: ArrayLike) -> tuple[Mesh, Complex]:
    """Map with a free outline, in the size with the least symmetric Dirichlet energy."""
    plain = free_map(V, F, refine=0)
    mesh = plain.mesh
    return mesh, resized(SymmetricDirichlet.of(mesh, HALF), as_complex(mesh.in_own_unit(plain.uv)))


def _finished(mesh: Mesh, uv: Floats) -> Floats:
    return mesh.in_given_unit(checked_free_map(mesh, as_complex(uv)))
