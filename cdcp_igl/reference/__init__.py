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

from .beltrami import beltrami_coefficient, generalized_laplacian, linear_beltrami_solver
from .certified import ReferenceMap
from .dirichlet import Dirichlet
from .double_cover import double_cover, double_cover_trace
from .fdcp import fdcp
from .harmonic import harmonic
from .ldcp import ldcp
from .lscm import lscm
from .methods import METHODS, Method
from .spectral import spectral

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
