"""What a reference method has to pass before its map is returned."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Complex, Floats, coordinates
from ..certificate import Certificate, certify
from ..errors import MapError
from ..surface.mesh import DiskMesh

__all__ = ["ReferenceMap", "certified_disk_map", "checked_free_map"]


@dataclass(frozen=True, eq=False)
class ReferenceMap:
    """A map that a reference method computed and had to reject: `MapError.result`.

    Attributes
    ----------
    uv : (n, 2) float64
        Row i is the image of row i of V.
    certificate : Certificate
        What was verified about `uv`. Of a map with free boundary only ``finite`` and
        ``flipped`` matter.

    Examples
    --------
    >>> import numpy as np
    >>> from cdcp_igl.certificate import certify
    >>> from cdcp_igl.surface.mesh import DiskMesh
    >>> from cdcp_igl.reference import ReferenceMap
    >>> uv = np.array([[0.0, 0], [0, 1], [1, 0]])
    >>> mesh = DiskMesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]])
    >>> ReferenceMap(uv, certify(mesh, uv)).certificate.flipped
    array([0])
    """

    uv: Floats
    certificate: Certificate


def certified_disk_map(mesh: DiskMesh, f: Complex) -> Floats:
    """Return a map onto the disk as (n, 2) coordinates, if it is a bijection.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128

    Returns
    -------
    (n, 2) float64

    Raises
    ------
    MapError
        If the certificate is not valid.
    """
    result = _certified(mesh, f)
    if not result.certificate.valid:
        raise MapError(f"The map is not a bijection onto the disk: {result.certificate}", result)
    return result.uv


def checked_free_map(mesh: DiskMesh, f: Complex) -> Floats:
    """Return a map with free boundary as (n, 2) coordinates, if it is one at all.

    Such a map may overlap itself and flip faces; ``certify(mesh, uv).flipped`` lists them.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128

    Returns
    -------
    (n, 2) float64

    Raises
    ------
    MapError
        If a coordinate is not finite, or no face at all is counterclockwise.
    """
    result = _certified(mesh, f)
    if not result.certificate.finite:
        raise MapError("The map is not finite", result)
    if len(result.certificate.flipped) == len(mesh.F):
        raise MapError("The map has collapsed: no face is counterclockwise", result)
    return result.uv


def _certified(mesh: DiskMesh, f: Complex) -> ReferenceMap:
    uv = coordinates(f)
    return ReferenceMap(uv, certify(mesh, uv))
