"""What the reference methods share: what is told of them, and what their maps have to pass."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from inspect import getdoc
from typing import Any, Concatenate, ParamSpec, TypeAlias

from numpy.typing import ArrayLike

from ..arrays import Complex, Floats, coordinates
from ..errors import MapError
from ..io.given import OfSurface, takes_meshes
from ..surface.mesh import Mesh
from ..verdict.certificate import Certificate, SphereCertificate, certify, certify_sphere

Options = ParamSpec("Options")
Reference: TypeAlias = Callable[Concatenate[ArrayLike, ArrayLike, Options], Floats]


def like(
    model: Callable[..., Any],
) -> Callable[[Reference[Options]], OfSurface[Options, Floats]]:
    """Let a docstring leave out what another one says, too: V, F, the map, the errors.

    Sections that it lacks are those of the model; its parameters come after V and F.
    """

    def told(method: Reference[Options]) -> OfSurface[Options, Floats]:
        given, own = _sections(model), _sections(method)
        if "Parameters" in own:
            own["Parameters"] = "\n".join([given["Parameters"], *own["Parameters"].split("\n")[2:]])
        text = "\n\n".join((given | own).values())
        method.__doc__ = text.replace(f".{model.__name__}(", f".{method.__name__}(")
        return takes_meshes(method)

    return told


def _sections(method: Callable[..., Any]) -> dict[str, str]:
    """Take a docstring apart at the titles of its sections; what is before them has none."""
    before, *sections = re.split(r"\n\n(?=\w+\n-+\n)", getdoc(method) or "")
    return {"": before} | {section.partition("\n")[0]: section for section in sections}


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
