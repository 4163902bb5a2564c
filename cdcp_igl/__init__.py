"""Disk conformal maps of triangulated surfaces, accurate, fast and certified."""

from . import datasets
from .cdcp import cdcp, disk_map
from .check import check
from .clean import clean
from .distortion import angle_distortion
from .errors import MapError, MeshError, SolverError

__all__ = [
    "MapError",
    "MeshError",
    "SolverError",
    "angle_distortion",
    "cdcp",
    "check",
    "clean",
    "datasets",
    "disk_map",
]

__version__ = "0.1.0"
