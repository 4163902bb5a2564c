"""Values at the vertices of a surface, and parts of it, from files of neuroimaging."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from ..arrays import Bools, Floats, Ints
from .neuro import Values, patch_of, values_of
from .reading import file_to_read


def read_patch(path: str | PathLike[str]) -> tuple[Ints, Floats, Bools]:
    """Read a patch of FreeSurfer, a part of a surface; it is flat if its z are 0.

    Parameters
    ----------
    path : path-like
        Such as ``lh.cortex.patch.flat``.

    Returns
    -------
    vertices : (k,) int64
        Rows of the surface that the patch is a part of, which `submesh` takes.
    positions : (k, 3) float64
        Of these vertices, in mm.
    border : (k,) bool
        Those at the border of the patch.

    Raises
    ------
    OSError
        If there is no such file, or it must not be read.
    MeshError
        If it is no patch, or damaged.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(2)
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder, "lh.cap.patch.flat")
    ...     cdcp_igl.free_map(V, F).save(file)
    ...     vertices, positions, border = cdcp_igl.io.read_patch(file)
    >>> len(vertices), bool(positions[:, 2].any()), int(border.sum())
    (19, False, 12)
    """
    with file_to_read(Path(path)) as file:
        return patch_of(file)


def read_values(path: str | PathLike[str], n: int | None = None) -> Values:
    """Read values at vertices from a file of FreeSurfer, in GIFTI or in MGH.

    Parameters
    ----------
    path : path-like
        ``.annot`` and ``.label.gii`` hold labels with names; ``.label`` the rows of some
        vertices; ``.func.gii``, ``.shape.gii``, ``.mgh``, ``.mgz`` and files of any other name,
        such as ``lh.sulc``, real numbers.
    n : int, optional
        Vertices of the surface: needed for a ``.label`` file, and verified for others.

    Returns
    -------
    Values
        ``values`` (n,), or (n, k) if the file has several columns: float64, labels as int64,
        vertices of a label as bool; ``names``, what the labels are called.

    Raises
    ------
    OSError
        If there is no such file, or it must not be read.
    MeshError
        If it is damaged.
    ValueError
        If it has values for another number of vertices than `n`.
    ImportError
        If nibabel is not installed.
    """
    with file_to_read(Path(path)) as file:
        found = values_of(file, n)
    if n is not None and len(found.values) != n:
        raise ValueError(
            f"{file.name!r} has values for {len(found.values):,} vertices, not for {n:,}"
        )
    return found
