"""The methods that CDCP is compared with, and CDCP itself, behind one signature."""

from .beltrami import beltrami_coefficient
from .certified import ReferenceMap
from .conformal_equivalence import ricci
from .dirichlet import harmonic
from .doubled import double_cover
from .fast import fdcp
from .free_boundary import abf, bff, lscm, spectral
from .harmonic_maps import cem, heat_flow, sem
from .isometric import arap, slim
from .linear import flash, ldcp
from .methods import METHODS, Method
from .welding import pgcp

__all__ = [
    "METHODS",
    "Method",
    "ReferenceMap",
    "abf",
    "arap",
    "beltrami_coefficient",
    "bff",
    "cem",
    "double_cover",
    "fdcp",
    "flash",
    "harmonic",
    "heat_flow",
    "ldcp",
    "lscm",
    "pgcp",
    "ricci",
    "sem",
    "slim",
    "spectral",
]
