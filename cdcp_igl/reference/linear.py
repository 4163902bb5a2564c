"""Linear disk conformal parameterization, through the doubly covered surface."""

from __future__ import annotations

from operator import index

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Floats, Ints
from ..io.given import takes_meshes
from ..solve.laplacian import cotangent_laplacian
from ..surface.mesh import DiskMesh
from .certified import certified_disk_map
from .dirichlet import Dirichlet
from .doubled import doubled_laplacian


@takes_meshes
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
    V, F
        As in `harmonic`.
    pinned : int
        Number of vertices pinned in the south step, at least 3.

    Returns
    -------
    (n, 2) float64
        As of `harmonic`.

    Raises
    ------
    MeshError, SolverError, MapError
        As `harmonic`.
    ValueError
        If `pinned` is too small.

    References
    ----------
    G. P. T. Choi, L. M. Lui. A linear formulation for disk conformal parameterization of
    simply-connected open surfaces. Adv. Comput. Math. 44, 2018.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.paraboloid(8)
    >>> cdcp_igl.reference.ldcp(V, F).shape
    (217, 2)
    """
    if index(pinned) < 3:
        raise ValueError(f"pinned must be at least 3, not {pinned!r}")
    mesh = DiskMesh(V, F)
    L = cotangent_laplacian(mesh).matrix()
    L2 = doubled_laplacian(mesh, L)

    corners, triangle = most_regular_face(mesh)
    z = Dirichlet(L2, corners).solve(triangle)
    z = 1 / (z - z.mean())  # what the first solve has crowded together is now far out
    far = np.argsort(-abs(z), kind="stable")[:pinned]
    z = Dirichlet(L2, far).solve(z[far])
    # Which side of the boundary the surface lies on does not matter: the other choice
    # would give 1/conj(f_B), with the same projection.
    f_B = to_cube_roots_of_unity(z[mesh.loop])
    return certified_disk_map(mesh, Dirichlet(L, mesh.loop).solve(f_B / abs(f_B)))


def most_regular_face(mesh: DiskMesh) -> tuple[Ints, Complex]:
    """Corners of the face nearest to equilateral, and a similar triangle in the plane."""
    p = mesh.V[mesh.F]
    lengths = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2)
    share = lengths / lengths.sum(axis=1, keepdims=True)
    face = abs(share - 1 / 3).sum(axis=1).argmin()
    i, j, k = mesh.V[mesh.F[face]]
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
