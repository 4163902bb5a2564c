"""The rescue without each of its mechanisms in turn: what does its work then does nothing.

The library has no switch for this; here, and only here, its functions are replaced.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from typing import Any
from unittest import mock

import numpy as np

from cdcp_igl import DiskMap, disk_map
from cdcp_igl.arrays import Complex, Floats, Ints
from cdcp_igl.rescue.boundary import FALLBACKS, _balanced
from cdcp_igl.rescue.candidate import Candidate as Judged
from cdcp_igl.rescue.collapsed_faces import open_collapsed_faces
from cdcp_igl.rescue.correction import Straightening, recentered, straighten
from cdcp_igl.rescue.relaxation import Relaxation
from cdcp_igl.rescue.repair import Neighbourhood, Repair, repair_locally, replace_interior
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.surface.triangles import flipped_faces

from .candidate import Candidate

TABLE = f"{__name__}:RESCUES"
ALL, NONE = "all mechanisms", "no mechanism"
Without = Callable[[], AbstractContextManager[Any]]


@contextmanager
def _replaced(function: Callable[..., Any], by: Callable[..., Any]) -> Iterator[None]:
    """Replace a function of the library wherever it has been imported."""
    with ExitStack() as stack:
        for name, module in list(sys.modules.items()):
            if name.startswith("cdcp_igl."):
                for attribute in [key for key, value in vars(module).items() if value is function]:
                    stack.enter_context(mock.patch.object(module, attribute, by))
        yield


def _without_boundary(name: str) -> AbstractContextManager[Any]:
    left = {key: boundary for key, boundary in FALLBACKS.items() if key != name}
    return mock.patch.dict(FALLBACKS, left, clear=True)


def _not_balanced(surface: object, shares: Floats) -> Floats:
    return shares


def _not_repaired(
    mesh: DiskMesh, f: Complex, most: float = np.inf, *, on_disk: bool = True
) -> tuple[Complex, Repair]:
    return f, Repair(len(flipped_faces(f, mesh.F)[0]))


def _not_swept(self: Relaxation, f: Complex, times: int, softness: float = 0.0) -> Complex:
    return f


def _not_relaxed(self: Neighbourhood, g: Complex, rings: int) -> Complex:
    return g


def _not_straightened(mesh: DiskMesh, f: Complex, extend: object) -> tuple[Complex, Straightening]:
    return f, Straightening()


def _not_moved(mesh: DiskMesh, f: Complex, *others: object) -> tuple[Complex, int]:
    return f, 0


MECHANISMS: Mapping[str, Without] = {
    "harmonic measure": partial(_without_boundary, "harmonic measure"),
    "balance of harmonic measure": partial(_replaced, _balanced, _not_balanced),
    "arc length": partial(_without_boundary, "arc length"),
    "local repair": partial(_replaced, repair_locally, _not_repaired),
    "relaxation of what is repaired": partial(mock.patch.object, Relaxation, "sweep", _not_swept),
    "relaxation of flipped faces": partial(
        mock.patch.object, Neighbourhood, "relax_flipped", _not_relaxed
    ),
    "replacement of the interior": partial(_replaced, replace_interior, _not_repaired),
    "straightening": partial(_replaced, straighten, _not_straightened),
    "recentering": partial(_replaced, recentered, _not_moved),
    "opening of collapsed faces": partial(_replaced, open_collapsed_faces, _not_moved),
    "refinement as needed": partial(mock.patch.object, Judged, "steps_due", 0),
}


def _mapped(V: Floats, F: Ints, *, without: tuple[str, ...] = ()) -> DiskMap:
    with ExitStack() as stack:
        for name in without:
            stack.enter_context(MECHANISMS[name]())
        return disk_map(V, F)


RESCUES: Mapping[str, Candidate] = {
    name: Candidate(partial(_mapped, without=without), "disk", "CDCP with a part of its rescue")
    for name, without in {
        ALL: (),
        **{f"without {name}": (name,) for name in MECHANISMS},
        NONE: tuple(MECHANISMS),
    }.items()
}
