from . import datasets, io, plot, reference
from .algorithm import cdcp, disk_map
from .annulus import AnnulusMap, annulus_map
from .atlas.cutting import Cut, cut
from .atlas.surface import SurfaceMap, surface_map
from .batching import Batch, batch
from .certificate import Certificate, OutlineCertificate, SphereCertificate
from .distortion import (
    AngleDistortion,
    angle_distortion,
    area_distortion,
    conformal_factor,
    quasi_conformal_dilatation,
)
from .errors import Defect, MapError, MeshError, SolverError
from .free import FreeMap, free_map
from .mapper import DiskMapper
from .parts import PartsMap, partition, parts_map
from .rectangle import RectangleMap, rectangle_map
from .rescue.conformality import Conformality
from .result.disk_map import DiskMap
from .sphere import SphereMap, sphere_map
from .surface.checking import MeshReport, check
from .surface.cleaning import Cleaned, clean

__all__ = [
    "AngleDistortion",
    "AnnulusMap",
    "Batch",
    "Certificate",
    "Cleaned",
    "Conformality",
    "Cut",
    "Defect",
    "DiskMap",
    "DiskMapper",
    "FreeMap",
    "MapError",
    "MeshError",
    "MeshReport",
    "OutlineCertificate",
    "PartsMap",
    "RectangleMap",
    "SolverError",
    "SphereCertificate",
    "SphereMap",
    "SurfaceMap",
    "angle_distortion",
    "annulus_map",
    "area_distortion",
    "batch",
    "cdcp",
    "check",
    "clean",
    "conformal_factor",
    "cut",
    "datasets",
    "disk_map",
    "free_map",
    "io",
    "partition",
    "parts_map",
    "plot",
    "quasi_conformal_dilatation",
    "rectangle_map",
    "reference",
    "sphere_map",
    "surface_map",
]

__version__: str
