"""A map of any kind as a surface and its image in the square from -1 to 1."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, cast

import numpy as np

from ..arrays import Floats, Ints, as_complex
from ..certificate import Certificate
from ..distortion import AngleDistortion
from ..surface.mesh import DiskMesh
from ..surface.triangles import oriented_areas
from ..surface.validation import unit_size

__all__ = ["Layout", "Mapped", "Opened", "lay_out"]


class Mapped(Protocol):
    """A map of a disk: a DiskMap, or a RectangleMap, which has a ``modulus`` besides."""

    @property
    def uv(self) -> Floats:
        """(n, 2) images of the vertices."""

    @property
    def mesh(self) -> DiskMesh:
        """The surface."""

    @property
    def certificate(self) -> Certificate:
        """What was verified."""

    @property
    def distortion(self) -> AngleDistortion:
        """Of all faces."""

    @property
    def valid(self) -> bool:
        """True for a bijection."""

    @property
    def conformal(self) -> bool:
        """True for a map that is as conformal as the mesh lets it be."""


class Opened(Protocol):
    """A map of a surface that was cut open: a SurfaceMap."""

    @property
    def cut(self) -> Any:
        """The opened surface: ``V``, ``F`` and ``vertex_index``."""

    @property
    def disks(self) -> Sequence[Mapped]:
        """The maps of its components."""

    @property
    def face_disk(self) -> Ints:
        """(m,) which disk each face is in; -1 if in none."""

    @property
    def distortion(self) -> AngleDistortion:
        """Of all of them."""

    @property
    def valid(self) -> bool:
        """True if all are certified."""

    @property
    def conformal(self) -> bool:
        """True if all are."""

    def packed(self) -> Floats:
        """(m, 3, 2) corners of the faces in the unit square."""


@dataclass(frozen=True, eq=False)
class Layout:
    """What is drawn of a map.

    Attributes
    ----------
    V : (n, 3) float64
        Scaled to unit size, so that it is drawn alike in any unit.
    F : (m, 3) int64
        Opened where the surface was cut.
    uv : (n, 2) float64
        In the square from -1 to 1.
    vertices : (n,) int64
        Their rows in the mesh that was given.
    faces : (m,) int64
        Those of the faces.
    plane : str
        What the image is called.
    middle, scale : (float, float) and float
        The coordinates of the map are ``middle + scale * uv``.
    distortion : AngleDistortion
        Of the faces that are drawn.
    flipped : int
        How many of them are not positively oriented.
    facts : tuple of str
        What there is to know of it.
    """

    V: Floats
    F: Ints
    uv: Floats
    vertices: Ints
    faces: Ints
    plane: str
    middle: tuple[float, float]
    scale: float
    distortion: AngleDistortion
    flipped: int
    facts: tuple[str, ...]

    @property
    def turns(self) -> bool:
        """Whether the image may be turned to match the surface; a rectangle stands upright."""
        return self.plane == "Disk"


def lay_out(result: Mapped | Opened) -> Layout:
    """Lay out a map of any kind."""
    verdict = "certified bijection" if result.valid else "NOT VALID"
    verdict += "" if result.conformal else ", NOT CONFORMAL"
    mean, sd = result.distortion.mean, result.distortion.sd
    facts = [f"angular distortion: mean {mean:.3g}°, SD {sd:.3g}°", verdict]
    if hasattr(result, "disks"):
        return _laid_out_opened(cast(Opened, result), facts)
    V, F, uv = result.mesh.V, result.mesh.F, result.uv
    plane, middle, scale = "Disk", (0.0, 0.0), 1.0
    if modulus := getattr(result, "modulus", None):
        plane, middle, scale = "Rectangle", (modulus / 2, 0.5), max(modulus, 1) / 2
        facts.insert(1, f"modulus {modulus:.6g}")
    facts.insert(0, f"{len(V):,} vertices")
    uv = (uv - middle) / scale
    rows = np.arange(len(V)), np.arange(len(F))
    flipped = len(result.certificate.flipped)
    return Layout(V, F, uv, *rows, plane, middle, scale, result.distortion, flipped, tuple(facts))


def _laid_out_opened(result: Opened, facts: Sequence[str]) -> Layout:
    cut, count = result.cut, len(result.disks)
    V = unit_size(cut.V)
    faces = np.flatnonzero(result.face_disk >= 0)  # the others have no area, or are there twice
    F, uv = cut.F[faces], np.zeros((len(V), 2))
    uv[F] = 2 * result.packed()[faces] - 1
    area, _ = oriented_areas(as_complex(uv), F)
    # Faces of a surface with faces turned over, as the disks have them.
    F = np.where((area < 0)[:, None], F[:, ::-1], F)
    plane = f"{count:,} disks" if count > 1 else "Disk"
    named = (f"{len(np.unique(cut.vertex_index)):,} vertices", *facts)
    return Layout(
        V=V,
        F=F,
        uv=uv,
        vertices=cut.vertex_index,
        faces=faces,
        plane=plane,
        middle=(0.5, 0.5),
        scale=0.5,
        distortion=result.distortion,
        flipped=sum(len(disk.certificate.flipped) for disk in result.disks),
        facts=named,
    )
