"""The methods that CDCP is compared with, and CDCP itself, behind one signature.

Examples
--------
>>> import cdcp_igl
>>> from cdcp_igl.reference import METHODS
>>> V = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 1]]
>>> F = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
>>> for name, method in METHODS.items():
...     distortion = cdcp_igl.angle_distortion(V, F, method.function(V, F))
...     print(f"{name:<12} {method.boundary}  {distortion.mean():.2f} degrees")
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
