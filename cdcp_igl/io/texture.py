"""Surfaces with the texture coordinates that their files have."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import typed
from ..arrays import Floats, Ints
from ..errors import Damage, Defect, MeshError
from .archives import texture_of_mat, texture_of_npz
from .glb import texture_of_gltf
from .ply import texture_of_ply
from .polygons import rows_of_triangles
from .reading import file_to_read, read_mesh
from .text import polygons_of_obj, texture_of_obj
from .vtk import texture_of_vtk


def _of_obj(path: Path) -> Floats:
    V, corners, sizes = polygons_of_obj(path)
    uv: Floats = texture_of_obj(path)[rows_of_triangles(V, corners, sizes)[0]]
    return uv


# (m, 3, 2) coordinates of the corners, or (n, 2) of the vertices; None or NaN where there are none.
TEXTURED: dict[str, Callable[[Path], Floats | None]] = {
    ".glb": texture_of_gltf,
    ".gltf": texture_of_gltf,
    ".mat": texture_of_mat,
    ".npz": texture_of_npz,
    ".obj": _of_obj,
    ".ply": texture_of_ply,
    ".vtk": texture_of_vtk,
    ".vtp": texture_of_vtk,
}


@typed
def read_texture(path: str | PathLike[str]) -> tuple[Floats, Ints, Floats]:
    """Read a mesh and its texture coordinates: what `certify` takes.

    Parameters
    ----------
    path : path-like
        A file named .obj, .ply, .glb or .gltf; .npz or .mat with uv beside V and F; or .vtk or .vtp
        with a surface (POLYDATA). Of several sets of coordinates, the first is read.

    Returns
    -------
    V, F
        As of `read_mesh`.
    uv : (m, 3, 2) float64
        Coordinates of the corners of each face, v upwards; NaN where a face has none. Charts that
        a batch has written to npz, each around 0, are laid beside one another.

    Raises
    ------
    OSError
        If there is no such file, or it must not be read.
    MeshError
        If it is of another type, not readable as its type, or has no texture coordinates.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import cdcp_igl
    >>> V, F, uv = cdcp_igl.datasets.spherical_cap(4)
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "cap.obj")
    ...     cdcp_igl.io.write_map(file, V, F, uv, disk=True)
    ...     read = cdcp_igl.io.read_texture(file)
    >>> bool((read[2] == uv[F]).all()), cdcp_igl.certify(*read).valid
    (True, True)
    """
    path = Path(path)
    V, F = read_mesh(path)
    if path.suffix.lower() not in TEXTURED:
        reason = f"{path.name!r} is of no type with texture coordinates: {' '.join(TEXTURED)}"
        raise MeshError(Defect.of("unreadable file", reason=reason))
    with file_to_read(path):
        uv = TEXTURED[path.suffix.lower()](path)
        if uv is not None and uv.shape == (len(V), 2):
            uv = uv[F]
        if uv is not None and uv.shape != (len(F), 3, 2):
            raise Damage("its texture coordinates are not those of its faces")
    if uv is None or np.isnan(uv).all():
        raise MeshError(Defect.of("unreadable file, without a map", name=path.name))
    return V, F, uv


def with_texture(options: Mapping[str, Any], path: str | PathLike[str]) -> dict[str, Any]:
    """Take the texture coordinates of a file for ``seams="uv"`` among the options of a map."""
    seams = options.get("seams")
    of_file = isinstance(seams, str) and seams == "uv"
    return {**options, "seams": read_texture(path)[2]} if of_file else dict(options)
