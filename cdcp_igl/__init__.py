"""Disk conformal maps of triangulated surfaces, accurate, fast and certified."""

import logging

from . import datasets
from .algorithm import cdcp, disk_map
from .distortion import (
    angle_distortion,
    area_distortion,
    conformal_factor,
    quasi_conformal_dilatation,
)
from .errors import MapError, MeshError, SolverError
from .mapper import DiskMapper
from .surface.cleaning import clean
from .surface.report import check

__all__ = [
    "DiskMapper",
    "MapError",
    "MeshError",
    "SolverError",
    "angle_distortion",
    "area_distortion",
    "cdcp",
    "check",
    "clean",
    "conformal_factor",
    "datasets",
    "disk_map",
    "quasi_conformal_dilatation",
]

logging.getLogger(__name__).addHandler(logging.NullHandler())

__version__ = "0.1.0"
