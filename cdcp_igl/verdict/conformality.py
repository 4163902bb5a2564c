"""Whether a valid map is what a conformal map of this mesh should be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import libigl
from ..arrays import Complex, Floats, Ints, marked
from ..surface.mesh import Mesh
from .distortion import face_dilatation

NEGLIGIBLE_DEGREES = 1.0  # mean error that no one sees, whatever its cause
LARGEST_DEGREES = 12.0  # mean error that any use of a conformal map can bear
LARGEST_STRETCH = 3.0  # times as long one way as the other: no use can bear more
LARGEST_EXCESS = 1.2  # errors by those that the scale explains; 0.9 to 1.06 in conformal maps
LEAST_EXCESS = 0.6
SAMPLE, RUN = 4_096, 128  # faces in the sample, and how many of them in succession


@dataclass(frozen=True)
class Conformality:
    """Whether a map is as conformal as its mesh lets it be, and if not, why.

    On a mesh, even the exact conformal map changes angles: its scale differs between the
    corners of a face. A map is called conformal if its mean angle error is at most 1 degree; or
    at most 12 degrees and at most 1.2 times what the scale at the vertices explains, see
    `explained_errors`; and if its faces are stretched, see `dilatation`, at most 3 times as much
    one way as the other, for stretching a needle hardly changes its angles. Faces inscribed in
    the circle do not count in the 3 times. Refinement that lowers the mean angle error makes no map
    less conformal.

    Attributes
    ----------
    sheared : bool
        There are errors that no scale explains: another map of this mesh may be better.
    reasons : tuple of str
        Why the map is not conformal; empty if it is.
    remedies : tuple of str
        What would help.
    excess : float
        Mean angle error by what the scale explains; 1 where the error is at most 1 degree, or
        has been lowered from that of a map without shear.
    stretch : float
        How many times a face is longer one way than the other, compared with itself on the
        surface: the geometric mean, by area.
    mean : float
        Mean angle error in degrees, by the arctangents that the verdict is by; the distortion that
        is reported is by libigl's angles.
    wanted : float
        The share of the mean angle error that would be left if the map were conformal: 1 if
        it is, or if other errors keep it from being so.
    asked : bool
        Whether a conformal map was asked for. Of one that is to keep lengths or areas nothing is
        said here, and nothing objected to; it is false in a condition.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    >>> conformality = cdcp_igl.disk_map(V, F).conformality
    >>> bool(conformality), conformality.reasons, str(conformality)
    (True, (), 'yes')
    """

    sheared: bool
    reasons: tuple[str, ...] = ()
    remedies: tuple[str, ...] = ()
    excess: float = 1.0
    stretch: float = 1.0
    mean: float = np.nan
    wanted: float = 1.0
    asked: bool = True

    @property
    def is_doubtful(self) -> bool:
        """Whether another map of this mesh may be nearer to the conformal one.

        It may if the faces are sheared or needles are stretched, or if the scale is not smooth:
        then it explains errors so much larger than they are.
        """
        return self.sheared or self.stretch > LARGEST_STRETCH or self.excess < LEAST_EXCESS

    @property
    def verdict(self) -> bool | None:
        """Whether the map is conformal; None if nobody asked."""
        return not self.reasons if self.asked else None

    def __bool__(self) -> bool:
        return bool(self.verdict)

    def report(self) -> dict[str, Any]:
        """Return what a user asks for, as JSON types."""
        return {
            "conformal": self.verdict,
            "not_conformal_because": list(self.reasons),
            "remedies": list(self.remedies),
        }

    def __str__(self) -> str:
        if not self.reasons:
            return "yes" if self.asked else "not asked for"
        remedies = "; ".join(self.remedies)
        return f"NO: {'; '.join(self.reasons)}" + (f". To lower it, {remedies}" if remedies else "")


NOT_VALID = Conformality(True, ("it is not valid",))
NOT_ASKED = Conformality(False, asked=False)


def judge(
    mesh: Mesh,
    f: Complex | Floats,
    degrees: Floats,
    *,
    valid: bool = True,
    closely: bool = False,
    known: float = 0.0,
) -> Conformality:
    """Judge a map f, (n,) or into space (n, 3), with angular distortion `degrees` (m, 3).

    One that is not `valid` is not conformal. `closely` judges all faces, for a map that may be
    sheared in few places only, rather than a sample of some 4,000. A mean error up to `known`, that
    of a map without shear, is none.
    """
    if not valid:
        return NOT_VALID
    faces = np.arange(len(degrees)) if closely else sampled_faces(len(degrees))
    return judge_by(mesh, f, degrees[faces], faces, float(degrees.mean()), known)


def judge_by(
    mesh: Mesh,
    f: Complex | Floats,
    degrees: Floats,
    faces: Ints,
    mean: float,
    known: float = 0.0,
) -> Conformality:
    """Judge a valid map by some faces, with their angular distortion (k, 3).

    `mean` is that of all faces, `known` as in `judge`. Of `mesh`, the faces at the vertices of
    these are needed.
    """
    inscribed = mesh.on_boundary.take(mesh.F[faces].T).all(axis=0)
    free = faces[~inscribed]
    stretch = dilatation(mesh, f, free if len(free) else faces)
    enough = max(NEGLIGIBLE_DEGREES, min(known, LARGEST_DEGREES))
    if mean <= enough and stretch <= LARGEST_STRETCH:
        return Conformality(sheared=False, stretch=stretch, mean=mean)
    explained_there = np.degrees(abs(explained_errors(mesh, f, faces))).mean()
    explained = float(mean * explained_there / degrees.mean())

    reasons, remedies = [], []
    bearable = max(LARGEST_EXCESS * explained, NEGLIGIBLE_DEGREES, known)
    sheared = mean > bearable
    if sheared:
        reasons.append(
            f"the mean angle error is {mean:.2f} degrees, and the scale explains {explained:.2f}"
        )
        remedies.append("cut the surface where it is long or branches (cdcp_igl.cut)")
    elif mean > LARGEST_DEGREES:
        reasons.append(f"the mean angle error is {mean:.2f} degrees, as the faces are large")
        remedies.append("subdivide the faces, or cut the surface (cdcp_igl.cut)")
    elif stretch > LARGEST_STRETCH:
        reasons.append(
            f"faces are stretched {stretch:.3g} times more one way than the other, which the "
            "angles of needles do not show"
        )
        remedies.append("remesh the surface to rounder faces")
    if reasons and degrees[inscribed].sum() > degrees.sum() / 2:
        remedies.append("flip the ears (cdcp_igl.clean with flip_ears=True)")
    excess = mean / explained if explained else np.inf
    wanted = min(1, bearable / mean, LARGEST_DEGREES / mean)
    return Conformality(sheared, tuple(reasons), tuple(remedies), excess, stretch, mean, wanted)


def dilatation(mesh: Mesh, f: Complex | Floats, faces: Ints) -> float:
    """Geometric mean, by area, of the dilatation K of some faces: 1 where no angle changes."""
    F = mesh.F[faces]
    log_K = np.log(face_dilatation(mesh.scaled, F, f))
    known = np.isfinite(log_K)
    area = libigl.double_areas(mesh.scaled, F[known])
    return float(np.exp(np.average(log_K[known], weights=area))) if known.any() else 1.0


def explained_errors(mesh: Mesh, f: Complex | Floats, faces: Ints) -> Floats:
    """Find the changes (k, 3) of the angles of some faces, in radians, that the scale explains.

    On every face, three factors u at the corners take the lengths of the surface to those of
    the image, l_ij -> exp((u_i + u_j) / 2) l_ij. Their means at the vertices are the scale of
    the map. Lengths that are changed by this scale and nothing else give triangles with other
    angles than the surface has: these changes every conformal map makes. Shear, which has the
    same direction on neighbouring faces, does not show in them.

    References
    ----------
    B. Springborn, P. Schröder, U. Pinkall. Conformal equivalence of triangle meshes. ACM
    Trans. Graph. 27(3), 2008.
    """
    i, j, k = marked(len(mesh.scaled), mesh.F[faces]).take(mesh.F.T)
    F = mesh.F[np.flatnonzero(i | j | k)]
    scale = _edge_scales(mesh, f, F)
    u = scale.sum(axis=0) - 2 * scale
    known = np.isfinite(u).all(axis=0)  # not so where an edge has collapsed
    u[:, ~known] = 0
    corners = F.T.ravel()
    count = np.maximum(np.bincount(corners, np.tile(known, 3), len(f)), 1)
    u_v = np.bincount(corners, u.ravel(), len(f)) / count

    F = mesh.F[faces]
    i, j, k = np.exp(u_v.take(F.T))
    square = libigl.squared_edge_lengths(mesh.scaled, F).T * [j * k, k * i, i * j]
    i, j, k = np.sqrt(square)
    cosine = (square.sum(axis=0) - 2 * square) / (2 * np.array([j * k, k * i, i * j]))
    return np.arccos(np.clip(cosine, -1, 1)).T - mesh.angles_of(faces)


def _edge_scales(mesh: Mesh, f: Complex | Floats, F: Ints) -> Floats:
    """(3, k) logarithms of the length on the disk by that on the surface, opposite corners."""
    i, j, k = f.take(F.T, axis=0)
    edges = np.array([j - k, k - i, i - j])
    with np.errstate(divide="ignore", invalid="ignore"):  # of edges that have collapsed
        squared = edges.real**2 + edges.imag**2
        if f.ndim == 2:
            squared = squared.sum(axis=2)
        return np.log(squared / libigl.squared_edge_lengths(mesh.scaled, F).T) / 2


def sampled_faces(m: int) -> Ints:
    """(k,) some of m faces: runs of neighbours in F, spread evenly, as these share vertices."""
    runs = np.arange(0, m, RUN * -(-m // SAMPLE))
    rows = (runs[:, None] + np.arange(RUN)).ravel()
    return rows[rows < m]
