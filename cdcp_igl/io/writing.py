"""Maps to files."""

from __future__ import annotations

import logging
from os import PathLike
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats, Ints, distinct_rows, in_space, marked, rows_not_in
from ..errors import counted, spell
from ..surface.validation import checked_vertices, usable_arrays
from .archives import write_npz
from .contents import contents_of
from .given import in_given_rows, takes_meshes
from .glb import warn_of_lost_faces, write_glb
from .glb_like import write_glb_like
from .images import Image, Texture, as_image, write_material
from .neuro import SPHERE, neuro_type, write_neuro
from .obj import material_files, write_like, write_obj
from .output import whole_file
from .ply import write_ply
from .ply_like import write_ply_like
from .reading import read_mesh
from .vtk import write_vtk

log = logging.getLogger("cdcp_igl")

WRITABLE = (".glb", ".npz", ".obj", ".ply", ".vtk", ".vtp")
COLOURED = (".glb", ".obj", ".ply")  # what can have colours at vertices
# Which types of a given file can be written again, otherwise as they are, as which type.
LIKE = {".obj": (".obj",), ".ply": (".ply",), ".glb": (".glb", ".gltf")}


@runtime_checkable
class MapResult(Protocol):
    """What the functions that map return."""

    @property
    def uv(self) -> Floats:
        """(n, 2) for each vertex, or (m, 3, 2) for each corner."""

    def packed(self) -> Floats:
        """Scale it into the unit square."""


@takes_meshes
def write_map(
    path: str | PathLike[str],
    V: ArrayLike,
    F: ArrayLike,
    uv: ArrayLike | MapResult,
    *,
    disk: bool = False,
    like: str | PathLike[str] | None = None,
    image: Texture | None = None,
) -> None:
    """Write a surface with its map.

    Parameters
    ----------
    path : path-like
        Named .npz (V, F and uv as given), .obj or .ply (uv as texture coordinates, to the
        last bit), .vtk or .vtp, or .glb (in single precision, with normals and an image); or a
        surface whose vertices lie where the map takes them, with nibabel: .gii, .gii.gz, or
        FreeSurfer's ``lh.NAME`` and, of a part, ``lh.NAME.patch.flat``, all in the rows of the
        surface that
        was given, z = 0 in the plane and a radius of 100 on the sphere. These have one place for
        each vertex: a patch leaves out those that were split or cut, as FreeSurfer's cuts do,
        which is logged. An existing file is replaced once the new one is complete.
    V, F
        As in `disk_map`, whatever surface they are.
    uv : (n, 2) array_like, (m, 3, 2) array_like or a map
        Map onto the unit disk, for each vertex or for each corner of the faces. Faces with NaN
        at all corners are on no disk: in an obj file they have no texture coordinates, else
        zeros. What a function of this library returns may be any map: where it is not onto the
        disk, its ``packed()`` become texture coordinates.
    disk : bool
        Leave texture coordinates as they are, in the unit disk, rather than in the unit
        square ((uv + 1) / 2), where texturing programs expect them.
    like : path-like, optional
        The file that V and F were read from. If it is obj, ply, glb or gltf, a file of the same
        type (glb of gltf) differs from it in texture coordinates only. Of an obj file polygons,
        groups, materials, normals, colours and comments stay; of a ply file encoding, types,
        comments, all properties and elements. Polygons that were cut open within are written as
        triangles; there are none if `surface_map` was given `polygon_of_face`, see
        `read_polygons`. Of a glb or gltf file nodes, names, materials, skins, animations and
        all attributes of the vertices stay; of its texture coordinates the first,
        ``TEXCOORD_0``, are replaced. Of FreeSurfer's and GIFTI files, the volume and the
        metadata are kept. To obj, ply and glb, vertices bring their colours from a file of
        another type; what else it has is logged, as it is not in the new one.
    image : path-like or (height, width, 3 or 4) array_like, optional
        A PNG or JPEG file to show on the surface, colours from 0 to 1, the top row at v = 1, or
        ``"checkerboard"``, which is what a glb file has if nothing else is named, neither an image
        nor colours. For an obj file, a .mtl file and the image are written beside it, under its
        name. With `like`, its materials stay and show this image instead of their own.

    Raises
    ------
    MeshError
        If V or F are no vertices and faces.
    ValueError
        If the file is not of a known type, uv does not fit V and F or is not finite, `like`
        is another mesh, or an option does not go with the type; if the map has several places for
        a vertex, and the file holds one, and is no patch.
    OSError
        If the file cannot be written; nothing is left behind.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import cdcp_igl
    >>> V, F, uv = cdcp_igl.datasets.spherical_cap(4)
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "cap.obj")
    ...     cdcp_igl.io.write_map(file, V, F, uv)
    ...     cdcp_igl.io.read_mesh(file)[0].shape
    (61, 3)
    """
    path, source = Path(path), None if like is None else Path(like)
    suffix = path.suffix.lower()
    _check_options(path, suffix, source, image)
    checked_vertices(V)
    given, faces = usable_arrays(V, F)
    if suffix not in WRITABLE:
        surface = _as_surface(path, uv, faces)
        with whole_file(path) as unfinished:
            write_neuro(path, unfinished, *surface, source)
        warn_of_loss(source, path)
        return
    plane = _map(uv, len(given), len(faces), in_square=suffix != ".npz" and not disk)
    positions = in_space(given)
    kept = source if source and is_kept(source, suffix) else None
    if source:
        _check_like(source, positions, faces)
    colours = None if kept else warn_of_loss(source, path)
    if suffix == ".npz":
        with whole_file(path) as unfinished:
            write_npz(unfinished, V, F, plane)
        return
    texture, FT, vertex = _indexed(faces, plane)
    if suffix != ".obj":  # in which alone a face may be without
        texture = np.nan_to_num(texture)
    shown = _image(image, bare=suffix == ".glb" and colours is None and not kept)
    with whole_file(path) as unfinished:
        if suffix == ".ply":
            at_corners = None if np.array_equal(vertex, np.arange(len(positions))) else FT
            if kept:
                write_ply_like(unfinished, kept, positions, texture, at_corners)
            else:
                write_ply(unfinished, positions, faces, texture, at_corners, colours)
        elif suffix in (".vtk", ".vtp"):
            write_vtk(unfinished, positions[vertex], FT, texture, xml=suffix == ".vtp")
        elif kept and suffix == ".glb":
            warn_of_lost_faces(positions, faces, texture, FT)
            write_glb_like(unfinished, kept, texture, FT, vertex, shown)
        elif suffix == ".glb":
            shades = None if shown else colours  # which would darken an image
            write_glb(unfinished, positions, faces, texture, FT, vertex, shown, shades)
        elif kept:
            files = material_files(kept)
            materials = write_material(path, shown, files) if shown else None
            write_like(unfinished, kept, texture, FT, materials)
        else:
            materials = write_material(path, shown) if shown else None
            write_obj(unfinished, positions, faces, texture, FT, materials, colours)


def is_kept(given: str | PathLike[str], suffix: str) -> bool:
    """Whether a file can be written as a type with nothing changed but texture coordinates."""
    return Path(given).suffix.lower() in LIKE.get(suffix, ())


def carries(given: Path, suffix: str) -> bool:
    """Whether a file has something to keep, or to tell of, if it is written as a type."""
    if is_kept(given, suffix) or not given.is_file():
        return is_kept(given, suffix)
    colours, others = contents_of(given)
    return colours is not None or bool(others)


def warn_of_loss(source: Path | None, path: Path, *, rows: bool = True) -> Floats | None:
    """Say what a file has that the new one has not, in a line; return the colours it can have.

    Without `rows`, the vertices are others.
    """
    colours, others = contents_of(source) if source else (None, ())
    if colours is not None and not (rows and path.suffix.lower() in COLOURED):
        colours, others = None, ("colours", *others)
    if colours is not None and colours.shape[1] == 4 and path.suffix.lower() == ".obj":
        others = others if colours[:, 3].min() == 1 else ("opacity", *others)
        colours = colours[:, :3]
    if source and others:
        log.warning("not in %s: %s of %s", path.name, ", ".join(others), source.name)
    return colours


def _check_options(
    path: Path,
    suffix: str,
    like: Path | None,
    image: Texture | None,
) -> None:
    if "\0" in str(path):
        raise ValueError(f"{path.name!r} holds a zero and is no name of a file.")
    neuro = suffix not in WRITABLE and neuro_type(path)
    if suffix not in WRITABLE and not neuro:
        known = f"{' '.join(WRITABLE)} .gii .gii.gz, and lh.NAME and rh.NAME of FreeSurfer"
        raise ValueError(f"{path.name!r} is of no known type. Writable: {known}")
    if image is not None and suffix not in (".glb", ".obj"):
        raise ValueError(f"A {suffix} file shows no image: write .glb or .obj.")


def _image(image: Texture | None, *, bare: bool) -> Image | None:
    """Take an image that was asked for; a `bare` surface shows the checkerboard."""
    if image is None and bare:
        image = "checkerboard"
    return None if image is None else as_image(image)


def _as_surface(path: Path, uv: ArrayLike | MapResult, F: Ints) -> tuple[Floats, Ints, Ints]:
    """Places (n, 3), faces, and which vertices have one, in the rows of the surface as given.

    A sphere has FreeSurfer's radius; in the plane, z is 0.
    """
    n = int(F.max()) + 1
    given_rows = getattr(uv, "given_rows", None) or (np.arange(n), n)
    rows, _ = given_rows
    if (points := getattr(uv, "points", None)) is not None:
        places = SPHERE * np.asarray(points)
    else:
        plane = np.asarray(uv.uv if isinstance(uv, MapResult) else uv, dtype=np.float64)
        if plane.ndim != 2 or plane.shape[1] != 2:
            raise ValueError(
                f"uv has shape {plane.shape}: such a file has one place for each vertex. Of a "
                "surface that was cut open, write .obj, .ply or .glb"
            )
        places = np.column_stack([plane, np.zeros(len(plane))])
    P, several = in_given_rows(places[: len(rows)], given_rows, 0.0)
    whole = rows[F]
    whole = whole[(whole >= 0).all(axis=1)]
    vertices, turned = np.unique(rows[rows >= 0]), whole[_turned_in_single_precision(P, whole)]
    if neuro_type(path) == "patch":
        faces_given = getattr(uv, "given_faces", None)
        of_whole = whole if faces_given is None else faces_given
        lost = np.union1d(several, turned)
        return P, *_patch(path, whole, marked(len(P), vertices), lost, of_whole)
    if len(several):
        raise ValueError(
            "such a file has one place for each vertex, and the map has several for "
            f"{counted(len(several), 'vertex', 'vertices')} split or cut ({spell(several)}). Leave "
            "out such vertices of the surface first, or write a patch, lh.NAME.patch.flat, which "
            "does that"
        )
    if len(turned):
        flipped = counted(len(turned), "face is", "faces are")
        log.warning("in %s %s flipped: it has single precision", path.name, flipped)
    return P, whole, vertices


def _turned_in_single_precision(P: Floats, F: Ints) -> Bools:
    """(m,) faces in the plane that rounding flips; on a sphere none are looked for."""
    before, after = (
        np.cross(places[F[:, 1]] - places[F[:, 0]], places[F[:, 2]] - places[F[:, 0]])[:, 2]
        for places in (P, P.astype(np.float32).astype(np.float64))
    )
    return np.asarray((np.sign(before) == -np.sign(after)) & (after != 0) & ~P[:, 2].any())


def _patch(path: Path, F: Ints, among: Bools, lost: Ints, of_whole: Ints) -> tuple[Ints, Ints]:
    """Faces and vertices of a patch, `among` the mapped ones, without those that are `lost`.

    Its readers take all faces of the whole surface whose corners it has: of a face that is not in
    the map it has none.
    """
    count = among.sum()
    among[lost] = False
    seen = np.sort(of_whole[among[of_whole].all(axis=1)], axis=1)
    among[rows_not_in(np.sort(F, axis=1), seen)] = False
    F = F[among[F].all(axis=1)]
    kept = np.unique(F)
    if len(kept) == 0:
        raise ValueError(f"{path.name!r} would have no face: its vertices are all left out")
    if left_out := int(count) - len(kept):
        said = counted(left_out, "vertex", "vertices")
        why = "that were split or cut, or where single precision would flip a face"
        log.warning("not in %s: %s %s", path.name, said, why)
    return F, kept


def _map(uv: ArrayLike | MapResult, n: int, m: int, *, in_square: bool) -> Floats:
    """Take uv as an array; ValueError if it is no map of n vertices or m faces."""
    if isinstance(uv, MapResult):
        plane = uv.packed() if in_square else uv.uv
        if plane.ndim == 3:  # a face is on no disk if one of its corners is on none
            plane = np.where(np.isnan(plane).any(axis=(1, 2), keepdims=True), np.nan, plane)
    else:
        plane = np.asarray(uv)
    if plane.dtype.kind not in "iuf" or plane.shape not in ((n, 2), (m, 3, 2)):
        raise ValueError(
            f"uv has shape {plane.shape}: it must be ({n}, 2), a row a vertex, "
            f"or ({m}, 3, 2), for each corner of the faces."
        )
    rows = plane.reshape(len(plane), -1)
    without = np.isnan(rows).all(axis=1) & (plane.ndim == 3)
    bad = np.flatnonzero(~np.isfinite(rows).all(axis=1) & ~without)
    if len(bad):
        raise ValueError(
            f"uv is NaN or infinite in {counted(len(bad), 'row', 'rows')}, the first {bad[0]}."
        )
    if in_square and not isinstance(uv, MapResult):
        return (plane + 1) / 2
    return plane.astype(np.float64, copy=False)


def _check_like(like: Path, V: Floats, F: Ints) -> None:
    given_V, given_F = read_mesh(like)
    if not (np.array_equal(in_space(given_V), V) and np.array_equal(given_F, F)):
        raise ValueError(
            f"{like.name!r} holds another mesh than V and F: pass them as `read_mesh` read them."
        )


def _indexed(F: Ints, uv: Floats) -> tuple[Floats, Ints, Ints]:
    """List each pair of a vertex and its texture coordinates once, in the order of the vertices.

    Given are those of the vertices (n, 2) or, where the surface was cut open and a vertex may have
    several, of the corners (m, 3, 2). Returned are the texture coordinates (k, 2), their rows
    (m, 3) at the corners, and the vertex (k,) of each. NaN is the same as NaN.
    """
    if uv.ndim == 2:
        return uv, F, np.arange(len(uv))
    corner, plane = F.ravel(), uv.reshape(-1, 2)
    first, FT = distinct_rows(np.column_stack([corner, np.nan_to_num(plane, nan=np.inf)]))
    return plane[first], FT.reshape(F.shape), corner[first]
