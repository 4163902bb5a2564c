"""A map of any kind as a surface and its image in the square from -1 to 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from ..arrays import Floats, Ints
from ..distortion import AngleDistortion
from ..quadrilateral import RectangleMap
from ..result import DiskMap
from ..surface.triangles import area_products

__all__ = ["Layout", "Opened", "lay_out"]


class Opened(Protocol):
    """A map of a surface that was cut open: `cdcp_igl.SurfaceMap`."""

    @property
    def cut(self) -> Any:
        """The opened surface: ``V``, ``F`` and ``vertex_index``."""

    @property
    def disks(self) -> tuple[DiskMap, ...]:
        """The maps of its components."""

    @property
    def distortion(self) -> AngleDistortion:
        """Of all of them."""

    @property
    def valid(self) -> bool:
        """True if all are certified."""

    def packed(self) -> Floats:
        """(m, 3, 2) corners of the faces in the unit square."""


@dataclass(frozen=True, eq=False)
class Layout:
    """What is drawn of a map.

    Attributes
    ----------
    V : (n, 3) float64
    F : (m, 3) int64
        Opened where the surface was cut.
    uv : (n, 2) float64
        In the square from -1 to 1.
    vertices : (n,) int64
        Their rows in the mesh that was given.
    plane : str
        What the image is called.
    middle, scale : (float, float) and float
        The coordinates of the map are ``middle + scale * uv``.
    facts : tuple of str
        What there is to know of it.
    """

    V: Floats
    F: Ints
    uv: Floats
    vertices: Ints
    plane: str
    middle: tuple[float, float]
    scale: float
    facts: tuple[str, ...]


def lay_out(result: DiskMap | RectangleMap | Opened) -> Layout:
    """Lay out a map of any kind."""
    if isinstance(result, DiskMap | RectangleMap):
        V, F, vertices = result.mesh.positions, result.mesh.F, np.arange(len(result.uv))
    else:
        cut = result.cut
        V, F, vertices = np.zeros((len(cut.V), 3)), cut.F, cut.vertex_index
        V[:, : cut.V.shape[1]] = cut.V
    verdict = "certified bijection" if result.valid else "NOT VALID"
    facts = (
        f"{len(V):,} vertices",
        f"angular distortion {result.distortion.mean:.3g}° ± {result.distortion.sd:.3g}°",
    )
    if isinstance(result, DiskMap):
        return Layout(V, F, result.uv, vertices, "Disk", (0.0, 0.0), 1.0, (*facts, verdict))
    if isinstance(result, RectangleMap):
        middle, scale = (result.modulus / 2, 0.5), max(result.modulus, 1) / 2
        uv = (result.uv - middle) / scale
        modulus = f"modulus {result.modulus:.6g}"
        named = (*facts, modulus, verdict)
        return Layout(V, F, uv, vertices, "Rectangle", middle, scale, named)
    uv = np.zeros((len(V), 2))
    uv[F] = 2 * result.packed() - 1
    left, right = area_products(uv[:, 0], uv[:, 1], F)
    F = np.where((left < right)[:, None], F[:, ::-1], F)  # of a surface with faces turned over
    plane = f"{len(result.disks):,} disks" if len(result.disks) > 1 else "Disk"
    return Layout(V, F, uv, vertices, plane, (0.5, 0.5), 0.5, (*facts, verdict))
