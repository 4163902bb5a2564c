from . import datasets, io, plot, reference
from .atlas.cutting import cut
from .atlas.surface import surface_map
from .errors import Defect, MapError, MeshError, SolverError
from .maps.annulus import annulus_map
from .maps.disk import cdcp, disk_map
from .maps.free import free_map
from .maps.mapper import DiskMapper
from .maps.rectangle import rectangle_map
from .maps.sphere import sphere_map
from .reference.comparison import Comparison, compare
from .result.annulus_map import AnnulusMap
from .result.cut import Cut
from .result.disk_map import DiskMap
from .result.free_map import FreeMap
from .result.rectangle_map import RectangleMap
from .result.sphere_map import SphereMap
from .result.surface_map import SurfaceMap
from .scale.batching import Batch, batch
from .scale.parts import PartsMap, partition, parts_map
from .surface.checking import MeshReport, check
from .surface.cleaning import Cleaned, clean, submesh
from .verdict.any_map import MapCertificate, certify
from .verdict.certificate import Certificate, SphereCertificate
from .verdict.conformality import Conformality
from .verdict.distortion import (
    AngleDistortion,
    AreaDistortion,
    angle_distortion,
    area_distortion,
    conformal_factor,
    quasi_conformal_dilatation,
)
from .verdict.outline import OutlineCertificate

__all__ = [
    "AngleDistortion",
    "AnnulusMap",
    "AreaDistortion",
    "Batch",
    "Certificate",
    "Cleaned",
    "Comparison",
    "Conformality",
    "Cut",
    "Defect",
    "DiskMap",
    "DiskMapper",
    "FreeMap",
    "MapCertificate",
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
    "certify",
    "check",
    "clean",
    "compare",
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
    "submesh",
    "surface_map",
]

__version__: str
