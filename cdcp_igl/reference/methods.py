"""The table of methods that the command line and the benchmarks read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Literal

from numpy.typing import ArrayLike

from ..arrays import Floats
from ..io.given import takes_meshes
from ..maps.disk import cdcp
from ..maps.sphere import sphere_map
from .conformal_equivalence import ricci
from .dirichlet import harmonic
from .doubled import double_cover
from .fast import fdcp
from .free_boundary import abf, bff, lscm, spectral
from .harmonic_maps import cem, heat_flow, sem
from .isometric import arap, slim
from .linear import flash, ldcp
from .welding import pgcp


@dataclass(frozen=True)
class Method:
    """A way to map a triangulated disk to the plane, or a closed surface onto the sphere.

    Attributes
    ----------
    function : callable
        ``function(V, F)`` returns (n, 2) float64, or (n, 3), rows as in V, and raises MeshError,
        SolverError or MapError.
    boundary : {"disk", "free", "sphere"}
        A certified bijection onto the unit disk; or a map with free boundary, which may
        flip faces and is to be compared on angles only, or on lengths if it keeps those; or a
        certified bijection of a closed surface of genus 0 onto the unit sphere.
    citation : str
        Where it comes from.

    Examples
    --------
    >>> from cdcp_igl.reference import METHODS
    >>> [name for name, method in METHODS.items() if method.boundary == "free"]
    ['abf', 'lscm', 'spectral', 'bff', 'bff_disk', 'arap', 'slim']
    """

    function: Callable[[ArrayLike, ArrayLike], Floats]
    boundary: Literal["disk", "free", "sphere"]
    citation: str


@takes_meshes
def _sphere(V: ArrayLike, F: ArrayLike) -> Floats:
    return sphere_map(V, F).points


METHODS: Mapping[str, Method] = MappingProxyType(
    {
        "cdcp": Method(cdcp, "disk", "Yueh et al., CDCP, eq. (18)"),
        "double_cover": Method(double_cover, "disk", "Yueh et al., CDCP, eq. (17)"),
        "fdcp": Method(fdcp, "disk", "Choi and Lui 2015"),
        "ldcp": Method(ldcp, "disk", "Choi and Lui 2018"),
        "cem": Method(cem, "disk", "Yueh, Lin, Wu and Yau 2017"),
        "heat_flow": Method(heat_flow, "disk", "Gu and Yau 2002"),
        "ricci": Method(ricci, "disk", "Springborn et al. 2008"),
        "pgcp": Method(pgcp, "disk", "Choi, Leung-Liu, Gu and Lui 2020"),
        "sem": Method(sem, "disk", "Yueh, Lin, Wu and Yau 2019"),
        "harmonic": Method(harmonic, "disk", "Eck et al. 1995"),
        "abf": Method(abf, "free", "Sheffer et al. 2005"),
        "lscm": Method(lscm, "free", "Lévy et al. 2002"),
        "spectral": Method(spectral, "free", "Mullen et al. 2008"),
        "bff": Method(bff, "free", "Sawhney and Crane 2018"),
        "bff_disk": Method(partial(bff, disk=True), "free", "Sawhney and Crane 2018, near a disk"),
        "arap": Method(arap, "free", "Liu et al. 2008"),
        "slim": Method(slim, "free", "Rabinovich et al. 2017"),
        "sphere": Method(_sphere, "sphere", "Haker et al. 2000, sphere_map"),
        "flash": Method(flash, "sphere", "Choi, Lam and Lui 2015"),
    }
)
