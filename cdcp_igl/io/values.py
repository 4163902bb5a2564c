"""Values at the vertices of a surface, and parts of it, from files of neuroimaging."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from ..arguments import typed
from ..arrays import Bools, Floats, Ints, marked
from .neuro import HEMISPHERE, Values, neuro_type, patch_of, values_of
from .reading import file_to_read

NO_LABEL = "unknown", "???"  # FreeSurfer, Connectome Workbench


@typed
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


@typed
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

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from nibabel.freesurfer import write_morph_data
    >>> from cdcp_igl.io import read_values
    >>> with TemporaryDirectory() as folder:
    ...     write_morph_data(Path(folder, "lh.sulc"), [0.5, -1, 2])
    ...     read_values(Path(folder, "lh.sulc"), n=3).values
    array([ 0.5, -1. ,  2. ])
    """
    with file_to_read(Path(path)) as file:
        found = values_of(file, n)
    if n is not None and len(found.values) != n:
        raise ValueError(
            f"{file.name!r} has values for {len(found.values):,} vertices, not for {n:,}"
        )
    return found


@typed
def read_vertices(given: str, n: int, surface: str | PathLike[str]) -> Bools:
    r"""Read which vertices of a surface a file names.

    Parameters
    ----------
    given : str
        A file: ``lh.cortex.label``; a patch, ``lh.cut.patch.3d``; or values as in `read_values`,
        one for each vertex, for those where there is one that is not 0. Where it is NaN, a negative
        label, or one called unknown or ???, there is none. After a colon, names of labels, with
        commas between: ``lh.aparc.annot:unknown,corpuscallosum``; unknown are all that have none.
        ``{hemi}`` stands for the hemisphere in the name of the surface, lh or rh.
    n : int
        Vertices of the surface.
    surface : path-like
        Its file: where there is no `given` in its folder, it is sought in the working folder.

    Returns
    -------
    (n,) bool

    Raises
    ------
    OSError
        If there is no such file, or it must not be read.
    MeshError
        If it is damaged.
    ValueError
        If it is that of another surface, has no such label or several columns, or the hemisphere
        is not known.
    ImportError
        If nibabel is not installed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from cdcp_igl.io import read_vertices
    >>> with TemporaryDirectory() as folder:
    ...     lines = "#!ascii label", "2", "0  0 0 0 0", "3  0 0 0 0"
    ...     _ = Path(folder, "lh.cortex.label").write_text("\n".join(lines))
    ...     read_vertices("{hemi}.cortex.label", 4, Path(folder, "lh.pial"))
    array([ True, False, False,  True])
    """
    beside = Path(surface)
    if "{hemi}" in given:
        if not HEMISPHERE.match(beside.name.lower()):
            raise ValueError(f"{beside.name!r} begins neither with lh. nor with rh.: no {{hemi}}")
        given = given.replace("{hemi}", beside.name[:2])
    folder, _, last = given.rpartition("/")
    name, _, labels = last.partition(":")
    path = Path(folder, name)
    path = beside.parent / path if (beside.parent / path).exists() else path
    if neuro_type(path) == "patch":
        rows = read_patch(path)[0]
        if len(rows) and rows.max() >= n:
            raise ValueError(f"{path.name!r} has vertex {rows.max():,}, and the surface has {n:,}")
        return marked(n, rows)
    values, names = read_values(path, n)
    if values.ndim > 1:
        raise ValueError(f"{path.name!r} has {values.shape[1]:,} columns, not one: write one alone")
    no_label = [key for key, text in names.items() if text.lower() in NO_LABEL]
    nothing = np.isnan(values) if values.dtype.kind == "f" else (values < 0)
    nothing |= np.isin(values, no_label)
    if not labels:
        return np.asarray(values != 0) & ~nothing
    wanted = labels.split(",")
    of_none = [label for label in wanted if label.lower() in NO_LABEL]
    if missing := [label for label in wanted if label not in (*names.values(), *of_none)]:
        known = ", ".join(dict.fromkeys([*names.values(), NO_LABEL[0]]))
        raise ValueError(f"{path.name!r} has no {', '.join(missing)}, but {known}")
    chosen = np.isin(values, [key for key, text in names.items() if text in wanted])
    return chosen | nothing if of_none else chosen
