"""What a reference method has to pass before its map is returned."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Complex, Floats, coordinates
from ..errors import MapError
from ..surface.mesh import Mesh
from ..verdict.certificate import Certificate, SphereCertificate, certify, certify_sphere


@dataclass(frozen=True, eq=False)
class ReferenceMap:
    """A map that a reference method computed and had to reject: `MapError.result`.

    Attributes
    ----------
    uv : (n, 2) float64, or (n, 3) on the sphere
        Row i is the image of row i of V.
    certificate : Certificate or SphereCertificate
        What was verified about `uv`. Of a map with free boundary only ``finite`` and
        ``flipped`` matter.

    Examples
    --------
    >>> import numpy as np
    >>> from cdcp_igl.reference import ReferenceMap
    >>> from cdcp_igl.surface.mesh import DiskMesh
    >>> mesh = DiskMesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]])
    >>> ReferenceMap.of(mesh, np.array([0, 1j, 1])).certificate.flipped
    array([0])
    """

    uv: Floats
    certificate: Certificate | SphereCertificate

    @classmethod
    def of(cls, mesh: Mesh, f: Complex) -> ReferenceMap:
        """Certify a map f (n,)."""
        uv = coordinates(f)
        return cls(uv, certify(mesh, uv))


def certified_disk_map(mesh: Mesh, f: Complex) -> Floats:
    """Return a map as (n, 2) coordinates; MapError if it is no bijection onto the disk."""
    result = ReferenceMap.of(mesh, f)
    if not result.certificate.valid:
        raise MapError(f"The map is not a bijection onto the disk: {result.certificate}", result)
    return result.uv


def certified_sphere_map(mesh: Mesh, P: Floats) -> Floats:
    """Return a map (n, 3); MapError if it is no bijection onto the sphere."""
    result = ReferenceMap(P, certify_sphere(mesh.F, P))
    if not result.certificate.valid:
        raise MapError(f"The map is not a bijection onto the sphere: {result.certificate}", result)
    return P


def checked_free_map(mesh: Mesh, f: Complex) -> Floats:
    """Return a map with free boundary as (n, 2) coordinates; MapError if it is none at all.

    It may overlap itself and flip faces, but not all of them, and is finite.
    """
    result = ReferenceMap.of(mesh, f)
    if not result.certificate.finite:
        raise MapError("The map is not finite", result)
    if len(result.certificate.flipped) == len(mesh.F):
        raise MapError("The map has collapsed: no face is counterclockwise", result)
    return result.uv
