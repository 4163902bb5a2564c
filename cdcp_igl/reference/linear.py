"""Linear maps by a north and a south step: of a closed surface, or of the double of a disk."""

from __future__ import annotations

from operator import index

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix

from ..arrays import Complex, Floats, Ints
from ..docstrings import like
from ..io.given import takes_meshes
from ..solve.laplacian import cotangent_laplacian
from ..steps.stereographic import from_plane
from ..surface.mesh import DiskMesh, Mesh, SphereMesh
from .certified import certified_disk_map, certified_sphere_map
from .dirichlet import Dirichlet, harmonic
from .doubled import doubled_laplacian


@takes_meshes
@like(harmonic)
def ldcp(V: ArrayLike, F: ArrayLike, *, pinned: int = 50) -> Floats:
    """Map a triangulated disk conformally onto the unit disk, Choi and Lui 2018.

    The doubly covered surface is mapped to the sphere, seen here in the plane: first with
    one face around everything else (north), then once more with the vertices of that
    neighbourhood pinned (south). The boundary lands near a circle, a Möbius transformation
    takes it near the unit circle, and it is projected.

    The published program also balances the scale and lifts to the sphere between the steps, which
    the last one undoes. That takes three points, a third of the loop apart, to the cube roots of
    unity; the program's own choice fails where the boundary lands on a short arc.

    Parameters
    ----------
    pinned : int
        Number of vertices pinned in the south step, at least 3, else ValueError.

    References
    ----------
    G. P. T. Choi, L. M. Lui. A linear formulation for disk conformal parameterization of
    simply-connected open surfaces. Adv. Comput. Math. 44, 2018.
    """
    if index(pinned) < 3:
        raise ValueError(f"pinned must be at least 3, not {pinned!r}")
    mesh = DiskMesh(V, F)
    L = cotangent_laplacian(mesh).matrix()
    L2 = doubled_laplacian(mesh, L)
    z = _north_step(L2, *most_regular_face(mesh))
    z = _south_step(L2, z, pinned)
    # Which side of the boundary the surface lies on does not matter: the other choice
    # would give 1/conj(f_B), with the same projection.
    f_B = to_cube_roots_of_unity(z[mesh.loop])
    return certified_disk_map(mesh, Dirichlet(L, mesh.loop).solve(f_B / abs(f_B)))


@takes_meshes
def flash(V: ArrayLike, F: ArrayLike) -> Floats:
    """Map a closed surface of genus 0 conformally onto the unit sphere, Choi, Lam and Lui 2015.

    FLASH without its landmarks: the north and south step of `ldcp`, a tenth of the vertices pinned,
    on the surface itself. The coefficient of the Beltrami solve in the south step is that of the
    map from the chart to the surface, so that it is a solve with the cotangent Laplacian, see
    `generalized_laplacian`. The scale is such that the face of the north step and the one opposite
    it have the same size.

    Parameters
    ----------
    V : (n, 3) array_like of real numbers
        Vertex positions.
    F : (m, 3) array_like of integers
        Corners of the faces, counterclockwise seen from outside.

    Returns
    -------
    (n, 3) float64
        Row i is the image of row i of V on the unit sphere.

    Raises
    ------
    MeshError
        If the surface is no triangulated sphere.
    SolverError
        If the Laplacian cannot be factored.
    MapError
        If the map is no bijection; its ``result`` is a `ReferenceMap`.

    References
    ----------
    P. T. Choi, K. C. Lam, L. M. Lui. FLASH: Fast landmark aligned spherical harmonic
    parameterization for genus-0 closed brain surfaces. SIAM J. Imaging Sci. 8(1), 2015.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, exact = cdcp_igl.datasets.spheroid(4, height=1.5)
    >>> cdcp_igl.reference.flash(V, F).shape
    (2562, 3)
    """
    mesh = SphereMesh(V, F)
    L = cotangent_laplacian(mesh).matrix()
    corners, triangle = most_regular_face(mesh)
    z = _north_step(L, corners, triangle).conj()  # counterclockwise, as the surface is
    opposite = mesh.F[abs(z[mesh.F]).sum(axis=1).argmax()]
    here, there = (abs(w - np.roll(w, 1)).sum() for w in (1 / z[corners], z[opposite]))
    scale = np.sqrt(here / there)
    z = _south_step(L, z, max(round(len(z) / 10), 3))
    return certified_sphere_map(mesh, from_plane(scale * z, 1))


def _north_step(L: csr_matrix, corners: Ints, triangle: Complex) -> Complex:
    """Map all into a triangle, and that inside out: what is crowded together is now far out."""
    z = Dirichlet(L, corners).solve(triangle)
    return 1 / (z - z.mean())


def _south_step(L: csr_matrix, z: Complex, pinned: int) -> Complex:
    """Let all but the vertices farthest out find their place."""
    far = np.argsort(-abs(z), kind="stable")[:pinned]
    return Dirichlet(L, far).solve(z[far])


def most_regular_face(mesh: Mesh) -> tuple[Ints, Complex]:
    """Corners of the face nearest to equilateral, and a similar triangle in the plane."""
    p = mesh.scaled[mesh.F]
    lengths = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2)
    share = lengths / lengths.sum(axis=1, keepdims=True)
    face = abs(share - 1 / 3).sum(axis=1).argmin()
    i, j, k = mesh.scaled[mesh.F[face]]
    a, b = j - i, k - i
    apex = complex(a @ b, np.linalg.norm(np.cross(a, b))) / (a @ a)
    return mesh.F[face], np.array([0, 1, apex])


def to_cube_roots_of_unity(z: Complex) -> Complex:
    """Apply the Möbius transformation that takes three thirds of a loop to 1, w and w^2."""
    a, b, c = z[[0, len(z) // 3, 2 * len(z) // 3]]
    w = np.exp(2j * np.pi / 3)
    # Their quotient takes a, b, c to 0, 1, infinity; (1 + w r)/(1 + conj(w) r) those to
    # the cube roots, and real r to the unit circle.
    over, under = (z - a) * (b - c), (z - c) * (b - a)
    return (under + w * over) / (under + w.conjugate() * over)
