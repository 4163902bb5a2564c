"""The methods that CDCP is compared with, and CDCP itself, behind one signature.

Examples
--------
>>> from cdcp_igl.reference import METHODS
>>> V = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 1]]
>>> F = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
>>> uv = METHODS["fdcp"].function(V, F)
>>> uv.shape
(5, 2)
>>> [name for name, method in METHODS.items() if method.boundary == "free"]
['abf', 'lscm', 'spectral', 'bff', 'bff_disk']
"""

from .angle_based import abf
from .arc_length import harmonic
from .beltrami import beltrami_coefficient
from .certified import ReferenceMap
from .conformal_equivalence import ricci
from .diffusion import heat_flow
from .doubled import double_cover
from .energy_minimization import cem
from .fast import fdcp
from .free_boundary import bff, lscm, spectral
from .linear import flash, ldcp
from .methods import METHODS, Method
from .welding import pgcp

__all__ = [
    "METHODS",
    "Method",
    "ReferenceMap",
    "abf",
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
    "spectral",
]
