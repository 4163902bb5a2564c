"""One object in the place of V and F: a mesh of another library, a tuple, or a path.

Other libraries are known by the attributes of their meshes; none of them is imported.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import wraps
from inspect import signature
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from ..arrays import Floats, Ints
from ..errors import Defect, MeshError
from .polygons import naming_polygons, triangulated
from .reading import Array, read_polygons

log = logging.getLogger("cdcp_igl")

Function = TypeVar("Function", bound=Callable[..., Any])

# trimesh has vertices and faces, Open3D vertices and triangles, PyVista points and faces, meshio
# points and cells, and what `clean` and `cut` return V and F.
VERTICES, FACES = ("vertices", "points", "V"), ("faces", "triangles", "cells", "F")
# Methods of scenes, tensors and grids that give such a mesh.
INSTEAD = ("to_mesh", "to_legacy", "extract_surface")
POLYGONS_OF_VTK = (5, 7, 9)  # triangles, polygons, quads


class FromFile:
    """A map of a surface, which knows the file that was given in its place."""

    uv: Floats
    source: Path | None = None


def takes_meshes(function: Function) -> Function:
    """Let one object stand in the place of the arguments V and F.

    Polygons are triangulated; errors name them, and a function that takes `polygon_of_face` is
    told.
    """
    names = list(signature(function).parameters)
    at = names.index("V")

    @wraps(function)
    def run(*args: Any, **options: Any) -> Any:
        if len(args) <= at:
            return function(*args, **options)
        given, alone = args[at], len(args) == at + 1 and "F" not in options
        if not (alone or _is_mesh(given)):
            return function(*args, **options)
        V, F, polygon_of_face = surface_of(given)
        if "polygon_of_face" in names:
            options.setdefault("polygon_of_face", polygon_of_face)
        with naming_polygons(polygon_of_face):
            made = function(*args[:at], V, F, *args[at + 1 :], **options)
        if isinstance(made, FromFile) and isinstance(given, str | PathLike):
            object.__setattr__(made, "source", Path(given))  # which may be frozen
        return made

    return cast("Function", run)


def _is_mesh(given: Any) -> bool:
    if isinstance(given, str | PathLike) or any(hasattr(given, name) for name in VERTICES):
        return True
    return isinstance(given, tuple) and len(given) == 2 and np.ndim(given[0]) == 2


def surface_of(mesh: Any) -> tuple[Array, Array, Ints]:
    """V, F, and the polygon (m,) that each face is a part of; MeshError if it has none of these."""
    if isinstance(mesh, str | PathLike):
        return read_polygons(mesh, log.warning)
    if isinstance(mesh, tuple) and len(mesh) == 2:
        return mesh[0], *triangulated(mesh[1])
    V, faces = (
        next((getattr(mesh, name) for name in names if hasattr(mesh, name)), None)
        for names in (VERTICES, FACES)
    )
    kinds = getattr(mesh, "celltypes", POLYGONS_OF_VTK)
    if V is None or faces is None or not np.isin(kinds, POLYGONS_OF_VTK).all():
        raise MeshError(_no_surface(mesh, [name for name in INSTEAD if hasattr(mesh, name)]))
    if getattr(mesh, "n_strips", 0):
        raise MeshError(_no_surface(mesh, ["triangulate"]))
    return np.asarray(V), *triangulated(faces)


def _no_surface(mesh: Any, instead: list[str]) -> Defect:
    kind = type(mesh).__name__
    if instead:
        return Defect.of("no surface, but another", type=kind, method=instead[0])
    return Defect.of("no surface", type=kind)
