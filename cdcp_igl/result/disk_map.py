"""What `disk_map` returns: the map and everything one has to know about it."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import asdict, astuple, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import typed
from ..arrays import Complex, Floats, Ints, as_complex, coordinates
from ..cached import cached_property
from ..descent.collapsed_faces import open_collapsed_faces
from ..descent.placing import moved_on_disk
from ..descent.repair import repair_locally
from ..descent.targets import DISK
from ..errors import MapError
from ..phases import Phases
from ..plot.layout import Layout
from ..records import Provenance, Refinement
from ..verdict.certificate import BOUNDARY_TOLERANCE, Certificate, certify_disk
from ..verdict.distortion import AngleDistortion
from .base import how_made
from .bijection import Bijection, DiskBijection, Registered
from .keeping import KeepingMap
from .landmarks import landmark_automorphism
from .matching import Match, matched


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OntoDisk(Bijection, Provenance):
    """A map onto the disk with how it came about: a DiskMap or a PartsMap."""

    certificate: Certificate
    refinement: Refinement | None = None
    solver: str

    _kind = "disk"
    _plane = "Disk"

    @property
    @abstractmethod
    def distortion_of_free_faces(self) -> AngleDistortion:
        """Of the angles, without faces inscribed in the circle."""

    def packed(self) -> Floats:
        """Return the square around the disk, scaled to the unit square: texture coordinates."""
        return (self.uv + 1) / 2

    def _summary(self) -> list[tuple[str, str]]:
        pairs = super()._summary()
        if (free := self.distortion_of_free_faces) != self.distortion:
            text = f"{free}, without those with all corners on the circle"
            pairs.insert(1, ("of free faces", text))
        return pairs

    def _steps(self) -> list[tuple[str, str]]:
        straightening = [("straightening", str(self.straightening))]
        return [
            ("center", str(self.center)),
            ("boundary", str(self.boundary)),
            *(straightening if self.straightening.before else []),
            ("repair", str(self.repair)),
            ("Möbius", str(self.mobius)),
            ("refinement", str(self.refinement or "not asked for")),
            ("solver", self.solver),
        ]

    def _details(self) -> dict[str, Any]:
        return {
            "angular_distortion_of_free_faces_degrees": asdict(self.distortion_of_free_faces),
            "center": {"method": self.center.method, "face": self.center.face},
            "straightening": asdict(self.straightening),
        }

    def _made(self) -> dict[str, Any]:
        return how_made(self, self.boundary, *astuple(self.mobius))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class DiskMap(OntoDisk, DiskBijection, KeepingMap):
    """A disk conformal map. Printing it gives a summary.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V, in the closed unit disk. Faces are
        counterclockwise; what `align` named, or else the boundary vertex of smallest
        index at (1, 0), lies at angle 0.
    mesh : DiskMesh
        The surface.
    certificate, conformality, distortion, timings
        As of every `Result`.
    distortion_of_free_faces : AngleDistortion
        `distortion` without the faces that have all three corners on the boundary: the circle
        fixes their angles, whatever the method. Equal to `distortion` where there are
        none, or no others.
    solver : str
        Sparse solver, version and ordering.
    kept : Kept or None
        What the map keeps rather than angles, and how well; None if nothing else was asked for.
    center, boundary, straightening, mobius, repair, refinement
        What was done, as in `Provenance`; of a map that keeps lengths or areas, before that.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, exact = cdcp_igl.datasets.paraboloid(30)
    >>> result = cdcp_igl.disk_map(V, F, align=[1, 0, 0])
    >>> float(abs(result.uv - exact).max()) < 0.01
    True
    """

    @cached_property
    def distortion_of_free_faces(self) -> AngleDistortion:
        """Mean, SD and maximum without the faces that the circle fixes."""
        inscribed = self.mesh.inscribed
        if not 0 < len(inscribed) < len(self.mesh.F):
            return self.distortion
        return AngleDistortion.of(np.delete(self._degrees(), inscribed, axis=0))

    _target = DISK

    @property
    def _straightened(self) -> bool:
        return self.straightening.before > 0

    def _moved(self, f: Complex, phase: Phases, known: float = 0.0) -> DiskMap:
        return replace(self, **moved_on_disk(self.mesh, f, self.repair, phase, known))

    @property
    def _from_tutte(self) -> bool:
        return self.boundary.laplacian == "mean value"

    @typed
    def register(self, to: DiskMap, landmarks: ArrayLike) -> Registered:
        """Lay the map over that of another surface, by landmarks.

        A map onto the disk is unique up to a Möbius transformation of the disk. The one
        here brings the landmarks of this map nearest to those of the other: it minimises
        the sum of their squared distances, once the disk has been moved so that the
        landmarks of the other have their conformal barycentre at 0, so that the
        normalisations of the two maps do not matter.

        Parameters
        ----------
        to
            The map of the other surface.
        landmarks : (k, 2) array_like of integers
            In each row a vertex of this surface and the vertex of the other that
            corresponds to it; at least two rows. Two on the boundary leave one degree of
            freedom, for which the smallest change is taken.

        Returns
        -------
        Registered
            The vertices (n, 2) of this surface in the disk of the other, still a certified map:
            ``to.interpolate(values, uv)`` carries what lives on the other surface to them. Its
            ``residual`` says how far landmarks are from each other then; where they would be far
            nearer if one surface were mirrored, a warning is logged.

        Raises
        ------
        ValueError
            If `landmarks` is none of that.
        MapError
            If the landmarks ask for a transformation that flips large faces, as their edges
            stay straight, or so strong that vertices coincide. Its ``result`` is this map with
            the coordinates and the certificate that were refused.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> one, other = cdcp_igl.disk_map(V, F, align=[0, 1, 0]), cdcp_igl.disk_map(V, F)
        >>> uv = one.register(other, [[5, 5], [70, 70], [200, 200]])
        >>> bool(abs(uv - other.uv).max() < 1e-6)
        True
        """
        here, there = map(as_complex, self._landmarks(to, landmarks))
        mesh, f = self.mesh, landmark_automorphism(here, there)(self._f)
        # Only what left the circle is normalised again, and faces that this flips are reopened.
        radius = abs(f[mesh.loop])
        f[mesh.loop] /= np.where(abs(radius - 1) < BOUNDARY_TOLERANCE / 10, 1, radius)
        f, _ = open_collapsed_faces(mesh, f)
        f, _ = repair_locally(mesh, f)
        certificate = certify_disk(mesh, f)
        if not certificate.valid:
            raise MapError(
                f"Moved to the landmarks, the map is not a bijection onto the disk: {certificate}. "
                "Faces are too large for this transformation, or too small: choose other landmarks",
                replace(self, _f=f, certificate=certificate),
            )

        def fitted(here: Floats, there: Floats) -> Floats:
            z, target = as_complex(here), as_complex(there)
            return coordinates(landmark_automorphism(z, target)(z))

        return self._registered(coordinates(f), to, landmarks, fitted)

    @typed
    def match(self, to: DiskMap, pairs: ArrayLike) -> Match:
        """Map the surface onto another one so that pairs of vertices meet.

        From the best Möbius transformation, see `register`, the vertices are brought to where
        their partners lie in the disk of the other, and the rest of the disk gives way with as
        little stretch as it can: no face flips on the way.

        Parameters
        ----------
        to
            The map of the other surface.
        pairs : (k, 2) array_like of integers
            In each row a vertex of this surface and the vertex of the other that it must meet; at
            least two rows, no vertex twice, those on the boundary with such on the boundary.

        Returns
        -------
        Match
            The bijection, its stretch, and which pairs may be false.

        Raises
        ------
        ValueError
            If `pairs` is none of that.
        MapError
            If they do not all meet; its ``result`` is the Match as far as it went. Or as
            `register`.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(6)
        >>> one, other = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(V * [1, 1.2, 1], F)
        >>> match = one.match(other, [[5, 5], [30, 40], [80, 80]])
        >>> bool((match.uv[30] == other.uv[40]).all())
        True
        """
        self._landmarks(to, pairs)
        chosen = np.asarray(pairs, dtype=np.int64)
        for column, mesh in zip(chosen.T, (self.mesh, to.mesh), strict=True):
            rows, counts = np.unique(column, return_counts=True)
            if counts.max() > 1:
                raise ValueError(f"vertex {rows[counts.argmax()]} of {mesh!r} is in several pairs")
        at_boundary = self.mesh.on_boundary[chosen[:, 0]] != to.mesh.on_boundary[chosen[:, 1]]
        if at_boundary.any():
            here, there = chosen[at_boundary][0]
            raise ValueError(
                f"of the pair {here}, {there} only one is on the boundary: the boundaries meet"
            )
        return matched(self.mesh, as_complex(self.register(to, chosen)), to, chosen)

    def _steps(self) -> list[tuple[str, str]]:
        return [*self._kept_pairs(), *super()._steps()]

    def _details(self) -> dict[str, Any]:
        return {**self._kept_details(), **super()._details()}

    def _surface(self) -> tuple[Floats, Ints]:
        return self.mesh.V, self.mesh.F

    def _layout(self) -> Layout:
        return self._drawn(
            self.mesh.scaled, self.mesh.F, self.uv, *map(str, filter(None, [self.kept]))
        )
