"""What a user would pick instead: other programs, each measured only if it is installed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from typing import Any

import numpy as np

from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.errors import MapError

from .candidate import Candidate

PACKAGES = ("bpy", "pymeshlab", "xatlas")
MARGIN = 0.001  # of charts in Blender, which has it by default when it unwraps; else they overlap


def versions() -> dict[str, str]:
    """Versions of the packages that are installed."""
    found = {}
    for package in PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found


def _in_blender(V: Floats, F: Ints, unwrap: Callable[[Any], None]) -> tuple[Floats, Ints]:
    """Return images (3m, 2) and vertices (3m,) of the corners, by what is done in edit mode."""
    bpy = import_module("bpy")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("surface")
    mesh.from_pydata(V.tolist(), [], F.tolist())
    mesh.uv_layers.new()
    shown = bpy.data.objects.new("surface", mesh)
    bpy.context.collection.objects.link(shown)
    bpy.context.view_layer.objects.active = shown
    shown.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    unwrap(bpy.ops.uv)
    bpy.ops.object.mode_set(mode="OBJECT")
    corners: Any = np.empty(6 * len(F), np.float32)
    vertices: Any = np.empty(3 * len(F), np.int32)
    mesh.uv_layers.active.data.foreach_get("uv", corners)
    mesh.loops.foreach_get("vertex_index", vertices)
    return corners.reshape(-1, 2), vertices


def _blender(V: Floats, F: Ints, *, method: str) -> Floats:
    """Unwrap as a person would; without seams it is one island."""

    def unwrap(uv: Any) -> None:
        uv.unwrap(method=method, margin=0, correct_aspect=False)

    return _of_corners(*_in_blender(V, F, unwrap), len(V))


def _meshlab(V: Floats, F: Ints, *, filter: str) -> Floats:
    pymeshlab = import_module("pymeshlab")
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(V, F.astype(np.int32)))
    getattr(meshes, f"compute_texcoord_parametrization_{filter}")()
    return meshes.current_mesh().vertex_tex_coord_matrix()


def _xatlas(V: Floats, F: Ints) -> Floats:
    """Make one chart, if it does; its own answer is an atlas of many."""
    atlas = import_module("xatlas").Atlas()
    atlas.add_mesh(V.astype(np.float32), F.astype(np.uint32))
    atlas.generate()
    if atlas.chart_count != 1:
        raise MapError(f"cut into {atlas.chart_count} charts")
    vertices, _, uv = atlas[0]
    return _of_corners(uv, vertices, len(V))


def _blender_atlas(V: Floats, F: Ints, *, again: str = "") -> Floats:
    """Unwrap by the smart projection; then, by its seams, again."""

    def unwrap(uv: Any) -> None:
        uv.smart_project(island_margin=MARGIN)
        if again:
            uv.seams_from_islands()
            uv.unwrap(method=again, margin=MARGIN)

    corners, vertices = _in_blender(V, F, unwrap)
    if not np.array_equal(vertices, F.ravel()):
        raise MapError("the faces are others")
    return corners.reshape(-1, 3, 2)


def _xatlas_charts(V: Floats, F: Ints) -> Floats:
    _, corners, uv = import_module("xatlas").parametrize(V.astype(np.float32), F.astype(np.uint32))
    return uv[corners]


def _of_corners(uv: Floats, vertices: Ints, n: int) -> Floats:
    """Find the image of each vertex from those of the corners, which must agree."""
    images = np.full((n, 2), np.nan)
    images[vertices] = uv
    if not (images[vertices] == uv).all():
        raise MapError("cut: the corners of a vertex have several images")
    return images


def _counterclockwise(V: Floats, F: Ints, *, map: Callable[[Floats, Ints], Any]) -> Floats:
    """Mirror a map that is clockwise as a whole."""
    uv = np.asarray(map(np.asarray(V, dtype=float), np.asarray(F)), dtype=float)
    a, b = uv[F[:, 1]] - uv[F[:, 0]], uv[F[:, 2]] - uv[F[:, 0]]
    clockwise = np.nansum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) < 0
    return uv * [1, -1] if clockwise else uv


def _without(package: str) -> str:
    return "" if find_spec(package) else f"not to be had: needs pip install --no-deps {package}"


def _of_package(
    package: str, function: Callable[[Floats, Ints], Any], citation: str, onto_disk: bool = False
) -> Candidate:
    """Describe what makes coordinates in single precision."""
    return Candidate(
        function,
        *("free", citation, True),
        missing=partial(_without, package),
        prepare=partial(import_module, package),
        onto_disk=onto_disk,
    )


def _map(package: str, map: Callable[[Floats, Ints], Any], *about: Any) -> Candidate:
    return _of_package(package, partial(_counterclockwise, map=map), *about)


LSCM, HARMONIC = "least_squares_conformal_maps", "harmonic"  # as MeshLab calls its filters

# Atlases of any surface, images (m, 3, 2) of the corners, each with the options that it has by
# default.
ATLASES: Mapping[str, Candidate] = {
    "xatlas": _of_package("xatlas", _xatlas_charts, "charts that grow"),
    "Blender smart projection": _of_package("bpy", _blender_atlas, "charts by direction"),
    "Blender angle-based": _of_package(
        "bpy", partial(_blender_atlas, again="ANGLE_BASED"), "ABF++, cut as the projection is"
    ),
}

# Single precision is too coarse for a certificate: what is said to be onto the disk is taken for
# a map with free boundary, too.
PEERS: Mapping[str, Candidate] = {
    "Blender angle-based": _map("bpy", partial(_blender, method="ANGLE_BASED"), "ABF++"),
    "Blender conformal": _map("bpy", partial(_blender, method="CONFORMAL"), "LSCM"),
    "Blender minimum stretch": _map("bpy", partial(_blender, method="MINIMUM_STRETCH"), "SLIM"),
    "MeshLab LSCM": _map("pymeshlab", partial(_meshlab, filter=LSCM), "LSCM"),
    "MeshLab harmonic": _map(
        "pymeshlab", partial(_meshlab, filter=HARMONIC), "harmonic, onto the circle", True
    ),
    "xatlas": _map("xatlas", _xatlas, "an atlas of charts"),
}
