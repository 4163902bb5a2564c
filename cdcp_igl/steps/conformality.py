"""Whether a valid map is what a conformal map of this mesh should be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Complex, Floats
from ..surface.mesh import DiskMesh

__all__ = ["Conformality", "explained_errors", "judge"]

SMALL = 1.0  # degrees: a mean error that no one sees, whatever it comes from
LARGE = 12.0  # degrees: more than any use of a conformal map can bear
EXCESS = 1.2  # of the errors, by those that the scale explains; of conformal maps it is 0.9 to 1.06


@dataclass(frozen=True)
class Conformality:
    """Whether a map is as conformal as its mesh lets it be, and if not, why.

    On a mesh, even the exact conformal map changes angles: its scale differs between the
    corners of a face. A map is called conformal if its mean angle error is at most 1 degree; or
    at most 12 degrees and at most 1.2 times what the scale at the vertices explains, see
    `explained_errors`. Faces inscribed in the circle do not count in the 12 degrees.

    Attributes
    ----------
    sheared : bool
        There are errors that no scale explains: another map of this mesh may be better.
    reasons : tuple of str
        Why the map is not conformal; empty if it is.
    remedies : tuple of str
        What would help.
    """

    sheared: bool
    reasons: tuple[str, ...] = ()
    remedies: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return not self.reasons

    def __str__(self) -> str:
        if self:
            return "yes"
        remedies = "; ".join(self.remedies)
        return f"NO: {'; '.join(self.reasons)}" + (f". To lower it, {remedies}" if remedies else "")


def judge(mesh: DiskMesh, f: Complex, errors: Floats) -> Conformality:
    """Judge a valid map.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128
        Map onto the disk without flipped faces.
    errors : (m, 3) float64
        Its angle errors in radians, of `angle_errors`.

    Returns
    -------
    Conformality
    """
    mean = float(np.degrees(abs(errors).mean()))
    if mean <= SMALL:
        return Conformality(sheared=False)
    explained = float(np.degrees(abs(explained_errors(mesh, f)).mean()))
    free = errors
    if len(mesh.inscribed) < len(mesh.F):
        free = np.delete(errors, mesh.inscribed, axis=0)
    mean_free = float(np.degrees(abs(free).mean()))

    reasons, remedies = [], []
    sheared = mean > EXCESS * explained
    if sheared:
        reasons.append(
            f"the mean angle error is {mean:.2f} degrees, and the scale explains {explained:.2f}"
        )
        remedies.append("cut the surface where it is long or branches (cdcp_igl.cut)")
    elif mean_free > LARGE:
        reasons.append(f"the mean angle error is {mean_free:.2f} degrees, as the faces are large")
        remedies.append("subdivide the faces, or cut the surface (cdcp_igl.cut)")
    if reasons and mean > 2 * mean_free:
        remedies.append("flip the ears (cdcp_igl.clean with flip_ears=True)")
    return Conformality(sheared, tuple(reasons), tuple(remedies))


def explained_errors(mesh: DiskMesh, f: Complex) -> Floats:
    """(m, 3) changes of the corner angles in radians that the scale at the vertices explains.

    On every face, three factors u at the corners take the lengths of the surface to those of
    the image, l_ij -> exp((u_i + u_j) / 2) l_ij. Their means at the vertices are the scale of
    the map. Lengths that are changed by this scale and nothing else give triangles with other
    angles than the surface has: these changes every conformal map makes. Shear, which has the
    same direction on neighbouring faces, does not show in them.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128
        Map onto the disk.

    Returns
    -------
    (m, 3) float64

    References
    ----------
    B. Springborn, P. Schröder, U. Pinkall. Conformal equivalence of triangle meshes. ACM
    Trans. Graph. 27(3), 2008.
    """
    F, n = mesh.F, len(mesh.V)
    length, image = np.empty((2, 3, len(F)))
    for k in range(3):  # of the edges opposite corner k
        tail, head = F[:, k - 2], F[:, k - 1]
        length[k] = np.linalg.norm(mesh.V[tail] - mesh.V[head], axis=1)
        image[k] = abs(f[tail] - f[head])
    with np.errstate(divide="ignore", invalid="ignore"):  # of edges that have collapsed
        scale = np.log(image / length)
        u = (scale.sum(axis=0) - 2 * scale).T
    known = np.isfinite(u).all(axis=1)
    rows = F[known].ravel()
    count = np.maximum(np.bincount(rows, minlength=n), 1)
    u_v = np.bincount(rows, u[known].ravel(), n) / count
    scaled = length * np.exp((u_v[F.T[[1, 2, 0]]] + u_v[F.T[[2, 0, 1]]]) / 2)
    square = scaled * scaled
    angles = np.empty(F.shape)
    for k in range(3):
        i, j = k - 2, k - 1
        cosine = (square[i] + square[j] - square[k]) / (2 * scaled[i] * scaled[j])
        angles[:, k] = np.arccos(np.clip(cosine, -1, 1))
    return angles - mesh.angles
