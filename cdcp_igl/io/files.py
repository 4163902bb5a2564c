"""Meshes from files and maps to files."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike, getpid
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import Defect, MeshError
from .archives import read_mat, read_npz, write_npz
from .obj import read_obj, write_obj
from .off import read_off
from .ply import read_ply, write_ply
from .stl import read_stl

__all__ = ["READABLE", "WRITABLE", "read_mesh", "whole_file", "write_map"]

Array = NDArray[Any]

READERS: dict[str, Callable[[Path], tuple[Array, Array]]] = {
    ".mat": read_mat,
    ".npz": read_npz,
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".stl": read_stl,
}
READABLE = tuple(READERS)
WRITABLE = (".npz", ".obj", ".ply")

# What the readers and the libraries below them raise on damaged files.
_DAMAGE = (
    *(OSError, EOFError, ValueError, TypeError, LookupError, NotImplementedError, MemoryError),
    *(BadZipFile, struct.error, zlib.error),
)


def read_mesh(
    path: str | PathLike[str], note: Callable[[str], None] | None = None
) -> tuple[Array, Array]:
    """Read a triangle mesh.

    Parameters
    ----------
    path : path-like
        A file named .obj, .off, .ply or .stl; or .npz or .mat with V and F (or v and f).
    note : callable, optional
        Told, in a sentence, what was changed on reading.

    Returns
    -------
    V : (n, 3) ndarray
        Vertex positions, in the order of the file; in stl files, where each triangle has
        its own corners, equal ones are merged in the order of their first appearance.
    F : (m, 3) ndarray of integers
        Corners of the faces, in the order of the file, counting from 0. Polygons in obj,
        off and ply files are split into fans.

    Raises
    ------
    OSError
        If there is no such file, or it must not be read.
    MeshError
        If it is not of a known type, or not readable as its type. Whether the mesh is a
        disk is not examined.

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
    >>> F
    array([[0, 1, 2]])
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise _unreadable(f"{path.name!r} is of no known type", f"Readable: {' '.join(READABLE)}.")
    path.open("rb").close()  # OSError if it is missing or forbidden; later ones mean damage
    try:
        V, F = reader(path)
    except MeshError:
        raise
    except _DAMAGE as error:
        reason = str(error) or type(error).__name__
        raise _unreadable(
            f"{path.name!r} is not a readable {path.suffix[1:]} file: {reason}",
            "Export it again, or in another format.",
        ) from error
    if path.suffix.lower() in (".npz", ".mat") and _counts_from_one(V, F):
        F = F.astype(np.int64) - 1
        if note:
            note("The faces count vertices from 1, as in MATLAB; 1 was subtracted.")
    return V, F


def _unreadable(what: str, remedy: str) -> MeshError:
    return MeshError(Defect("unreadable file", what, remedy))


def _counts_from_one(V: Array, F: Array) -> bool:
    # No mesh that counts from 0 has an index n.
    return F.dtype.kind in "iuf" and F.size > 0 and F.min() == 1 and F.max() == len(V)


def write_map(
    path: str | PathLike[str], V: ArrayLike, F: ArrayLike, uv: ArrayLike, *, disk: bool = False
) -> None:
    """Write a surface with its map, to the last bit.

    Parameters
    ----------
    path : path-like
        Named .npz (V, F and uv as given), or .obj or .ply (uv as texture coordinates).
        An existing file is replaced once the new one is complete.
    V : (n, 3) or (n, 2) array_like
        Vertex positions.
    F : (m, 3) array_like of integers
        Corners of the faces.
    uv : (n, 2) array_like
        Map onto the unit disk.
    disk : bool
        Leave texture coordinates in the unit disk, rather than in the unit square
        ((uv + 1) / 2), where texturing programs expect them.

    Raises
    ------
    ValueError
        If the file is not of a known type.
    OSError
        If the file cannot be written; nothing is left behind.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import cdcp_igl
    >>> from cdcp_igl.io import write_map
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(4)
    >>> uv = cdcp_igl.cdcp(V, F)
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "cap.npz")
    ...     write_map(file, V, F, uv)
    ...     with np.load(file) as saved:
    ...         bool((saved["uv"] == uv).all())
    True
    """
    suffix = Path(path).suffix.lower()
    if suffix not in WRITABLE:
        raise ValueError(f"{Path(path).name!r} is of no known type. Writable: {' '.join(WRITABLE)}")
    with whole_file(path) as unfinished:
        if suffix == ".npz":
            write_npz(unfinished, V, F, uv)
            return
        positions = np.zeros((len(np.asarray(V)), 3))
        positions[:, : np.shape(V)[1]] = V
        faces, plane = np.asarray(F, dtype=np.int64), np.asarray(uv, dtype=np.float64)
        write = write_obj if suffix == ".obj" else write_ply
        write(unfinished, positions, faces, plane if disk else (plane + 1) / 2)


@contextmanager
def whole_file(path: str | PathLike[str]) -> Iterator[Path]:
    """Let the body write a file that takes its place only when it is complete.

    Parameters
    ----------
    path : path-like
        The file to create or to replace; what a symbolic link points to.

    Yields
    ------
    Path
        In the same folder and of the same type. It is moved to `path` at the end, or
        removed if the body fails.
    """
    target = Path(path).resolve()
    unfinished = target.with_name(f".{target.stem}.{getpid()}{target.suffix}")
    try:
        yield unfinished
        unfinished.replace(target)
    finally:
        unfinished.unlink(missing_ok=True)
