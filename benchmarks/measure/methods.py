"""What is measured: the methods of `cdcp_igl.reference`, settings of CDCP, and the unit of cost."""

from __future__ import annotations

import statistics
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np

from cdcp_igl import (
    DiskMapper,
    RectangleMap,
    cdcp,
    disk_map,
    free_map,
    rectangle_map,
    reference,
    sphere_map,
)
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.reference.case import Timed
from cdcp_igl.solve.laplacian import cotangent_laplacian
from cdcp_igl.solve.solvers import factorize
from cdcp_igl.surface.mesh import DiskMesh

from .ablation import ABLATIONS, RESCUES
from .candidate import Candidate, Methods
from .peers import PEERS

WARM_CALLS = 101
FRAMES = 5


def _factor(V: Floats, F: Ints) -> Timed:
    """Measure the unit of cost: one CHOLMOD analysis (AMD) and factorization of L_II."""
    mesh = DiskMesh(V, F)
    L_II = cotangent_laplacian(mesh).block(mesh.interior)
    start = perf_counter()
    factor = factorize(L_II, ordering="amd")
    both = perf_counter() - start
    start = perf_counter()
    factor.refactor(L_II)
    numeric = perf_counter() - start
    return Timed(both, {"analyse": both - numeric, "factor": numeric})


def _warm(function: Callable[[Floats, Ints], Any], V: Floats, F: Ints) -> Timed:
    """Median of many calls in one process, after one that does not count."""
    function(V, F)
    seconds = []
    for _ in range(WARM_CALLS):
        start = perf_counter()
        function(V, F)
        seconds.append(perf_counter() - start)
    return Timed(statistics.median(seconds))


def _sequence(V: Floats, F: Ints) -> Timed:
    """Median of maps of a surface that moves, by `DiskMapper.moved`; those by `disk_map` beside."""
    mapper, seconds = DiskMapper(V, F), []
    mapper.map()
    for frame in range(FRAMES):
        positions = V * (1 + 0.01 * np.sin(6 * V[:, [1, 2, 0]] / np.ptp(V) + frame))
        start = perf_counter()
        disk_map(positions, F)
        between = perf_counter()
        mapper.moved(positions).map()
        seconds.append((between - start, perf_counter() - between))
    afresh, moved = map(statistics.median, zip(*seconds, strict=True))
    return Timed(moved, {"afresh": afresh})


def _import(V: Floats, F: Ints) -> Timed:
    """Import of cdcp_igl in a fresh interpreter, NumPy and SciPy included."""
    code = "from time import perf_counter as t; s = t(); import cdcp_igl; print(t() - s)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    return Timed(float(done.stdout))


def _rectangle(V: Floats, F: Ints) -> RectangleMap:
    """Map with corners that part the boundary into four of the same length."""
    loop = DiskMesh(V, F).loop
    length = np.linalg.norm(np.diff(V[loop], axis=0), axis=1).cumsum()
    quarters = np.searchsorted(length, length[-1] * np.array([0.25, 0.5, 0.75]))
    return rectangle_map(V, F, loop[[0, *quarters]])


_OWN = Methods(
    {
        **{
            name: Candidate(method.function, method.boundary, method.citation)
            for name, method in reference.METHODS.items()
        },
        "cdcp": Candidate(disk_map, "disk", "Yueh et al., CDCP, eq. (18)"),  # seconds per phase
        "free": Candidate(free_map, "free", "free_map"),
        "sphere": Candidate(sphere_map, "sphere", "Haker et al. 2000, sphere_map"),
        "rectangle": Candidate(_rectangle, "free", "rectangle_map, corners at quarters of length"),
    }
)
# Options of the library that have rows of their own. Without one, CDCP is refined as needed.
_SETTINGS = (
    *("cdcp refine=0", "cdcp refine=5", "cdcp refine=10 refine_norm=1.2", "cdcp preset=paper"),
    *("cdcp mobius=area", "free refine=5", "sphere refine=0", "sphere refine=5"),
    *("free keep=0.2", "free keep=lengths", "free keep=areas", "cdcp keep=areas"),
)

METHODS = Methods(
    {
        **_OWN,
        **{name: _OWN[name] for name in _SETTINGS},
        "factor": Candidate(_factor, "none", "CHOLMOD, AMD"),
        "cdcp warm": Candidate(partial(_warm, cdcp), "none", "median of many calls in one process"),
        "cdcp sequence": Candidate(_sequence, "none", "DiskMapper.moved, median of five frames"),
        "import": Candidate(_import, "none", "import cdcp_igl in a fresh process"),
        **{**PEERS, **ABLATIONS, **RESCUES},
    }
)

# Rough time by that of CDCP, for the time that is left.
COST = {
    **{"double_cover": 4, "fdcp": 9, "ldcp": 3, "harmonic": 0.6, "lscm": 1.5, "spectral": 4},
    **{"cem": 40, "heat_flow": 8, "ricci": 12, "pgcp": 4, "abf": 14},
    **{"bff": 1.5, "bff_disk": 4, "rectangle": 2, "free": 1.3, "free refine=5": 4},
    **{"cdcp preset=paper": 2.5, "cdcp refine=5": 3.6, "cdcp refine=10 refine_norm=1.2": 6},
    **{"factor": 0.8, "sphere": 1.5, "sphere refine=5": 4, "flash": 2},
    **{"slim": 150, "arap": 30, "sem": 20, "cdcp keep=areas": 20},
    **{"free keep=0.2": 10, "free keep=lengths": 10, "free keep=areas": 15},
    **{"xatlas": 300, "Blender conformal": 20},
    **{"Blender angle-based": 60, "Blender minimum stretch": 150, "MeshLab LSCM": 3},
}


def maps() -> list[str]:
    """Names of the methods of the library that make maps."""
    return [*_OWN, *_SETTINGS]
