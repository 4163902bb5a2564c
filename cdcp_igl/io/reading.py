"""Meshes from files."""

from __future__ import annotations

import stat
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from lzma import LZMAError
from os import PathLike
from pathlib import Path
from tokenize import TokenError
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from ..arguments import typed
from ..docstrings import like
from ..errors import Damage, Defect, MeshError
from .archives import read_mat, read_npz
from .glb import read_gltf
from .neuro import read_neuro, reads_as_neuro
from .ply import read_ply
from .polygons import triangulated
from .stl import read_stl
from .text import read_obj, read_off
from .vtk import read_vtk

Array = NDArray[Any]

# V and F, and where faces may be polygons, which of these each triangle is a part of.
READERS: dict[str, Callable[[Path], tuple[Array, ...]]] = {
    ".gii": read_neuro,
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".mat": read_mat,
    ".npz": read_npz,
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
    ".vtk": read_vtk,
    ".vtp": read_vtk,
    ".vtu": read_vtk,
}
READABLE = (*READERS, ".gii.gz")

POINTER = b"version https://git-lfs"  # how what Git LFS puts in the place of a file begins
# What libraries below the readers raise on bytes that they do not understand.
DAMAGE = (
    *(OSError, EOFError, ValueError, LookupError, ArithmeticError, RuntimeError),
    *(BadZipFile, LZMAError, struct.error, zlib.error),
    *(SyntaxError, TypeError, TokenError),  # a header of NumPy is an expression of Python
    AttributeError,  # in gltf files, of what is no object
)


@typed
def read_mesh(
    path: str | PathLike[str], note: Callable[[str], None] | None = None
) -> tuple[Array, Array]:
    """Read a triangle mesh.

    Parameters
    ----------
    path : path-like
        A file named .obj, .off, .ply, .stl, .glb or .gltf; .npz or .mat with V and F (or v and
        f); .vtk or .vtp with a surface (POLYDATA); or another .vtk, or .vtu, for which meshio must
        be installed; or, with nibabel, .gii or .gii.gz, and surfaces of FreeSurfer, of whatever
        name.
    note : callable, optional
        Told, in a sentence, what was changed on reading.

    Returns
    -------
    V : (n, 3) ndarray
        Vertex positions, in the order of the file; in stl files, where each triangle has
        its own corners, equal ones are merged in the order of their first appearance.
    F : (m, 3) ndarray of integers
        Corners of the faces, in the order of the file, counting from 0. Polygons
        become triangles that cover them.

    Raises
    ------
    OSError
        If there is no such file, or it must not be read.
    MeshError
        If it is not of a known type, not readable as its type, no regular file, or of a size
        that no mesh unpacks to. Whether the mesh is a disk is not examined.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from cdcp_igl.io import read_mesh
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "triangle.npz")
    ...     np.savez(file, V=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], F=[[1, 2, 3]])
    ...     V, F = read_mesh(file, print)
    The faces count vertices from 1, as in MATLAB; 1 was subtracted.
    """
    V, F, _ = read_polygons(path, note)
    return V, F


@like(read_mesh)
@typed
def read_polygons(
    path: str | PathLike[str], note: Callable[[str], None] | None = None
) -> tuple[Array, Array, Array]:
    """Read a mesh as `read_mesh` does, and which polygon each triangle is a part of.

    Returns
    -------
    V, F
        As of `read_mesh`.
    polygon_of_face : (m,) ndarray of int64
        Number of the polygon that each face is a part of, in the order of the file, counting
        from 0. With it, `cut` and `surface_map` go around polygons.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from cdcp_igl.io import read_polygons
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "square.off")
    ...     _ = file.write_text("OFF 4 1 0 0 0 0 1 0 0 1 1 0 0 1 0 4 0 1 2 3")
    ...     read_polygons(file)[2]
    array([0, 0])
    """
    path = Path(path)
    if path.is_dir():
        raise MeshError(Defect.of("unreadable file, a folder", path=str(path)))
    reader = READERS.get(path.suffix.lower())
    if reader is None and path.is_file() and reads_as_neuro(path):
        reader = read_neuro
    if reader is None:
        known = f"{' '.join(READABLE)}, and surfaces of FreeSurfer"
        raise _unreadable(f"{path.name!r} is of no known type; readable are {known}")
    with file_to_read(path):
        V, F, *polygons = reader(path)
    if len(V) == 0:
        raise _empty(path)
    if path.suffix.lower() in (".npz", ".mat"):
        if _counts_from_one(V, F):
            F = F - 1
            if (np.rint(F) == F).all():  # fractions stay, and are refused as those of any mesh
                F = F.astype(np.int64)
            if note:
                note("The faces count vertices from 1, as in MATLAB; 1 was subtracted.")
        F, *polygons = triangulated(V, F)
    return V, F, polygons[0] if polygons else np.arange(len(F))


@contextmanager
def file_to_read(path: Path) -> Iterator[Path]:
    """Let the body read a file in which there is something; MeshError names it if it is damaged."""
    if "\0" in str(path):
        raise _unreadable(f"{path.name!r} is no name of a file, as it holds a zero")
    if not stat.S_ISREG(path.stat().st_mode):  # to open a FIFO may take for ever
        raise _unreadable(f"{path.name!r} is a device, a FIFO or a socket")
    with path.open("rb") as file:  # OSError if it is forbidden; later ones mean damage
        head = file.read(len(POINTER))
    if not head:
        raise _empty(path)
    if head == POINTER:
        raise MeshError(Defect.of("unreadable file, a pointer", name=path.name))
    try:
        yield path
    except Damage as error:
        raise _damaged(path, str(error)) from None
    except MemoryError as error:
        raise _damaged(path, "it does not fit into the memory") from error
    except MeshError:
        raise
    except DAMAGE as error:
        raise _damaged(path, "it is cut off, or damaged") from error


def _unreadable(reason: str) -> MeshError:
    return MeshError(Defect.of("unreadable file", reason=reason))


def _empty(path: Path) -> MeshError:
    return MeshError(Defect.of("unreadable file, empty", name=path.name))


def _damaged(path: Path, reason: str) -> MeshError:
    kind = Path(path.name.removesuffix(".gz")).suffix[1:]
    return MeshError(
        Defect.of("unreadable file, damaged", name=path.name, type=kind, reason=reason)
    )


def _counts_from_one(V: Array, F: Array) -> bool:
    # No mesh that counts from 0 has an index n.
    return F.dtype.kind in "iuf" and F.size > 0 and F.min() == 1 and F.max() == len(V)
