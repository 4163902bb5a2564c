"""What `sphere_map` returns: a map onto the sphere, and its chart of two hemispheres."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import typed
from ..arrays import Bools, Floats, Ints
from ..cached import cached_property
from ..descent.sphere_repair import repaired_on_sphere
from ..errors import MapError, counted
from ..plot.layout import Layout
from ..records import BoundaryMethod
from ..steps.stereographic import moved_to_center, rotation, spherical_barycenter
from ..surface.location import SphereFinder
from ..surface.mesh import SphereMesh
from ..verdict.certificate import SphereCertificate, certify_sphere
from ..verdict.distortion import area_distortion
from .base import how_made
from .bijection import Registered
from .hemispheres import in_square, two_hemispheres
from .made import MadeMap

log = logging.getLogger("cdcp_igl")


@dataclass(frozen=True, eq=False, repr=False)
class SphereMap(MadeMap):
    """A conformal map onto the unit sphere. Printing it gives a summary.

    Attributes
    ----------
    points : (n, 3) float64
        Row i is the image of row i of V, on the unit sphere. Faces are counterclockwise seen from
        outside; unless they point inward on the surface, too.
    uv : (m, 3, 2) float64
        A chart for pictures and textures: the corners of each face on one of two hemispheres,
        upper and lower, in stereographic projection side by side: to the left and to the right of
        0. Where that flips faces, the vertices near them are relaxed; where the chart overlaps
        itself all the same, upper and lower are along another axis, if that mends it.
    mesh : SphereMesh
        The surface, seen from outside; faces that fill holes come last.
    inward : bool
        True if the given faces point inward.
    filled : int
        Holes that were filled for the time of the map; those faces are not in the results.
    certificate : SphereCertificate
        What was verified about `points`.
    distortion : AngleDistortion
        Mean, SD and maximum of the angular distortion in degrees, between the faces of the surface
        and the straight triangles with their corners on the sphere.
    pole : int
        The vertex that carried the dipole, or was taken out for an embedding.
    mobius : {"area", "none"}
        What chose the Möbius transformation of the sphere.
    laplacian : str
        ``"cotangent"``; or, where that flipped faces, or its map is not conformal, and this
        distorts less, ``"intrinsic Delaunay"``; or ``"mean value"`` where neither is conformal, and
        an embedding, from which shear was lowered, leads nearer.
    conformality, repair, refinement, solver, timings
        As of a `DiskMap`.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, exact = cdcp_igl.datasets.spheroid(4, height=1.5)
    >>> result = cdcp_igl.sphere_map(V, F)
    >>> result.valid, result.conformal, bool(abs(result.points - exact).max() < 0.02)
    (True, True, True)
    """

    points: Floats
    mesh: SphereMesh
    certificate: SphereCertificate
    pole: int
    mobius: str
    laplacian: str
    filled: int = 0
    inward: bool = False
    _n_faces: int | None = None

    _kind = "sphere"
    _plane = "Sphere"
    _reported = ("pole", "filled")
    _columns = 3

    @property
    def _from_tutte(self) -> bool:
        return self.laplacian == "mean value"

    def _made(self) -> dict[str, Any]:
        return how_made(self, BoundaryMethod("none", laplacian=self.laplacian), self.mobius)

    @property
    def uv(self) -> Floats:  # type: ignore[override]
        """(m, 3, 2) the chart of two hemispheres."""
        return self._chart[0]

    @cached_property
    def _chart(self) -> tuple[Floats, Bools, bool]:
        """(m, 3, 2) the chart, the faces (m,) that lie upwards, and whether it is one to one.

        It is seen along the first axis of three along which it is, or else along the third.
        """
        return two_hemispheres(self.mesh, self.points, self._n_faces, inward=self.inward)

    @property
    def _faces(self) -> Ints:
        return self.mesh.F[: self._n_faces, :: -1 if self.inward else 1]

    @property
    def _turned(self) -> bool:
        return self.inward

    def packed(self) -> Floats:
        """Return the chart `uv` scaled into the unit square, (m, 3, 2): texture coordinates.

        Whether these overlap themselves, as they may where faces are large, or crowded, is logged:
        what is certified are `points`.
        """
        return self._texture

    @cached_property
    def _texture(self) -> Floats:
        if not self._chart[2]:
            log.warning(
                "the sphere's texture overlaps itself, or has flipped faces (cdcp_igl.certify says "
                "where): cut the surface for one without (cdcp_igl.surface_map, --cut)"
            )
        return in_square(self.uv)

    @typed
    def apply(self, face: ArrayLike, barycentric: ArrayLike) -> Floats:
        """Map points of the surface to the unit sphere, as `Bijection.apply`: (..., 3)."""
        straight = super().apply(face, barycentric)
        return straight / np.linalg.norm(straight, axis=-1)[..., None]

    @typed
    def register(self, to: SphereMap, landmarks: ArrayLike) -> Registered:
        """Lay the map over that of another surface, by landmarks.

        Both spheres are centred, so that the landmarks have their conformal barycentre at 0; then
        this one is turned to bring them nearest. The result does not depend on the normalisation
        of the two maps. Of two landmarks only the rotation is sought.

        Parameters
        ----------
        to : SphereMap
            Of the other surface.
        landmarks : (k, 2) array_like of integers
            In each row a vertex of this surface and the vertex of the other that corresponds to
            it; at least two rows.

        Returns
        -------
        Registered
            The vertices (n, 3) of this surface on the sphere of the other, still a certified map:
            ``to.interpolate(values, points)`` carries what lives on the other surface to them. Its
            ``residual`` is as of `DiskMap.register`.

        Raises
        ------
        ValueError
            If `landmarks` is none of that.
        MapError
            If the landmarks ask for so strong a transformation that faces are flipped. Its
            ``result`` is this map with the points and the certificate that were refused.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spheroid(3, 2)
        >>> one, other = cdcp_igl.sphere_map(V, F, mobius=None), cdcp_igl.sphere_map(V, F)
        >>> points = one.register(other, [[5, 5], [70, 70], [200, 200]])
        >>> bool(abs(points - other.points).max() < 1e-6)
        True
        """

        def fitted(here: Floats, there: Floats, points: Floats | None = None) -> Floats:
            w, v = (
                spherical_barycenter(P, np.ones(len(P))) if len(P) > 2 else np.zeros(3)
                for P in (here, there)
            )
            turn = rotation(moved_to_center(here, w), moved_to_center(there, v))
            moved = moved_to_center(here if points is None else points, w)
            return moved_to_center(moved @ turn, -v)

        P = fitted(*self._landmarks(to, landmarks), self.points)
        P, _ = repaired_on_sphere(self.mesh, P / np.linalg.norm(P, axis=1)[:, None])
        certificate = certify_sphere(self.mesh.F, P)
        if not certificate.valid:
            raise MapError(
                "Moved to the landmarks, the map is not a bijection onto the sphere: "
                f"{certificate}. Choose other landmarks",
                replace(self, points=P, certificate=certificate),
            )
        return self._registered(P, to, landmarks, fitted)

    def area_distortion(self) -> Floats:
        """Logarithm of the area on the sphere by that on the surface, as fractions of their totals.

        Returns
        -------
        (m,) float64
            Of each face; the area is that of the straight triangle with its corners on the sphere.
        """
        return area_distortion(self.mesh.scaled, self.mesh.F[: self._n_faces], self.points)

    @property
    def _images(self) -> Floats:
        return self.points

    @cached_property
    def _finder(self) -> SphereFinder:
        return SphereFinder(self.mesh.F, self.points, self.mesh.edges)

    def _located(self, points: Floats) -> tuple[Ints, Floats]:
        length = np.linalg.norm(points, axis=1)[:, None]
        if not length.all():
            raise ValueError("uv must not be 0, the middle of the sphere")
        face, barycentric, _ = self._finder.locate(points / length)
        return face, barycentric[:, :: -1 if self.inward else 1]

    @property
    def _reach(self) -> float:
        return float(abs(self.uv).max())

    def _steps(self) -> list[tuple[str, str]]:
        return [
            (
                ("embedding", f"without vertex {self.pole:,}")
                if self._from_tutte
                else ("dipole", f"at vertex {self.pole:,}")
            ),
            ("Laplacian", self.laplacian),
            ("Möbius", "centre of mass at 0" if self.mobius == "area" else "none"),
            *(
                [("change", f"filled {counted(self.filled, 'hole', 'holes')}")]
                if self.filled
                else []
            ),
            *super()._steps(),
        ]

    def _surface(self) -> tuple[Floats, Ints]:
        return self.mesh.V, self._faces

    def _layout(self) -> Layout:
        # A vertex comes twice where its faces are on both hemispheres.
        name, corner = np.unique(2 * self._faces + self._chart[1][:, None], return_inverse=True)
        uv = np.empty((len(name), 2))
        F = corner.reshape(-1, 3)
        uv[F] = self.uv / self._reach
        rows = name // 2
        also = {"scale": self._reach, "ball": self.points[rows], "vertices": rows}
        return self._drawn(self.mesh.scaled[rows], F, uv, **also)
