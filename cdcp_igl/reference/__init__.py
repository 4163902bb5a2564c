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
['lscm', 'spectral']
"""

from .arc_length import harmonic
from .beltrami import beltrami_coefficient, generalized_laplacian, linear_beltrami_solver
from .certified import ReferenceMap
from .dirichlet import Dirichlet
from .explicit_cover import double_cover, double_cover_trace
from .fast import fdcp
from .free_boundary import spectral
from .least_squares import lscm
from .linear import ldcp
from .methods import METHODS, Method

__all__ = [
    "METHODS",
    "Dirichlet",
    "Method",
    "ReferenceMap",
    "beltrami_coefficient",
    "double_cover",
    "double_cover_trace",
    "fdcp",
    "generalized_laplacian",
    "harmonic",
    "ldcp",
    "linear_beltrami_solver",
    "lscm",
    "spectral",
]
