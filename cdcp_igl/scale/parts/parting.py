"""Parting the faces of a surface by planes, from files that are larger than memory."""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from math import log2
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ...arguments import typed
from ...arrays import Ints, evenly_spaced_rows, size_exponent, unit_size
from ...errors import MeshError
from ...io import read_mesh
from ...io.ply import triangles_of_ply
from ...phases import Progress
from ...solve.memory import BYTES, available_memory, require
from ...solve.ordering import SAMPLE, cuts, sides
from ...surface.validation import examine, repeated_corners

Array = NDArray[Any]
Numbers = NDArray[np.uint16]  # of parts
Source = str | PathLike[str] | tuple[Any, Any]  # V and F, whose reader names the defect

ROWS = 1 << 20  # of V or F that are looked at together
MANIFEST = "parts.json"
# Parts of this size take less than a core has of the memory of most machines; larger ones have
# shorter seams in all, and smaller ones cheaper factors.
LARGE_PART = 50_000  # vertices
MOST_PARTS = 1 << 15
SHARE = 8  # of the memory that there is, a part may take one
BYTES_TO_EXAMINE = 500.0  # a vertex, if the whole is examined at once


@typed
def partition(
    source: Source,
    folder: str | PathLike[str],
    parts: int | None = None,
    *,
    progress: Progress | None = None,
) -> Path:
    """Part the faces of a surface by planes, for `parts_map`.

    The surface is read in blocks and need not fit into memory; 2 bytes for each vertex do, twice.

    Parameters
    ----------
    source : path-like, or (V, F) of array_like or path-like
        Arrays as `disk_map` takes them, or npy files of them, which are mapped into memory; a
        folder with ``V*.npy`` and ``F*.npy``, each perhaps in several files that follow one another
        in the order of their names; a binary ply file of triangles. Any other file that
        `cdcp_igl.io.read_mesh` takes is read as a whole.
    folder : path-like
        Where the parts go. It appears once it is complete; nothing may be there but an empty
        folder.
    parts : int or None
        How many, a power of 2. None is as many as give parts of at most some 50,000 vertices, and
        fewer ones where the memory is small.
    progress : callable, optional
        Called as ``progress(phase, fraction)``.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    MeshError
        If the arrays are no mesh, or a vertex is not used; otherwise, `parts_map` examines the
        surface.
    SolverError
        If they are not, and memory is too small to say where.
    ValueError
        If `parts` is no power of 2, or too large.
    OSError
        If a file cannot be read or written, or something is there already.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
    >>> with TemporaryDirectory() as folder:
    ...     cap = cdcp_igl.partition((V, F), Path(folder, "cap"), parts=4)
    ...     result = cdcp_igl.parts_map(cap)
    ...     result.certificate.valid, result.uv.shape
    (True, (331, 2))
    """
    V, F = _tables(source)
    if parts is not None and not (1 <= parts <= MOST_PARTS and parts & (parts - 1) == 0):
        raise ValueError(f"parts must be a power of 2 up to {MOST_PARTS:,}, not {parts!r}")
    n, m = len(V), len(F)
    if not (V.is_table(2, 3) and F.is_table(3) and n >= 3 and m > 0):
        refuse(V, F)
    levels = (parts or number_of_parts(n)).bit_length() - 1
    target = Path(folder).absolute()
    if target.exists() and not (target.is_dir() and not any(target.iterdir())):
        reason = "is there, and not empty; name another folder"
        raise FileExistsError(errno.EEXIST, reason, os.fspath(folder))
    unfinished = target.with_name(f".{target.name}.unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)  # of a run that was killed
    unfinished.mkdir(parents=True)
    try:
        _Parting(V, F, levels, unfinished, progress or (lambda phase, done: None)).run()
        if target.exists():
            target.rmdir()
        unfinished.rename(target)
    except OSError as error:
        error.filename = error.filename or os.fspath(folder)
        raise
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return Path(folder)


def number_of_parts(n: int) -> int:
    """Choose how many parts n vertices are to have: a power of 2."""
    parts = 1
    most = available_memory() / SHARE
    while parts < MOST_PARTS and (n > parts * LARGE_PART or BYTES * n * log2(n) > parts * most):
        parts *= 2
    return parts


class Table:
    """Rows of arrays that follow one another, or of files of them, which are mapped into memory."""

    def __init__(self, *arrays: Any) -> None:
        self._arrays = [_mapped(array) for array in arrays]
        self._ends = np.cumsum([0, *(len(x) if x.ndim else 0 for x in self._arrays)])

    def __len__(self) -> int:
        return int(self._ends[-1])

    def is_table(self, *columns: int) -> bool:
        """Whether these are numbers in so many columns."""
        arrays = self._arrays
        return all(x.ndim == 2 and x.shape[1] in columns and x.dtype.kind in "iuf" for x in arrays)

    def whole(self) -> Array:
        """Read all of it into memory."""
        return self._arrays[0] if len(self._arrays) == 1 else np.concatenate(self._arrays)

    def blocks(self) -> Iterator[tuple[int, Array]]:
        """Yield blocks of rows, each with the number of its first row."""
        for start, array in zip(self._ends, self._arrays, strict=False):
            for first in range(0, len(array), ROWS):
                yield int(start) + first, np.asarray(array[first : first + ROWS])

    def take(self, rows: Ints) -> Array:
        """Read some rows, which ascend."""
        parts = np.split(rows, np.searchsorted(rows, self._ends[1:-1]))
        each = zip(self._arrays, parts, self._ends, strict=False)
        return np.concatenate([array[part - start] for array, part, start in each])


def refuse(V: Table, F: Table) -> NoReturn:
    """Raise the MeshError of a whole surface, which is read into memory for that.

    SolverError if it does not fit.
    """
    what = "the surface is no triangulated disk; to say where, reading it"
    require(BYTES_TO_EXAMINE * len(V), what, "Decimate it")
    raise MeshError(*examine(V.whole(), F.whole()).defects)


@dataclass
class _Parting:
    """The work of `partition`; `levels` cuts make 2^levels parts."""

    V: Table
    F: Table
    levels: int
    folder: Path
    progress: Progress

    def run(self) -> None:
        """Write the parts, the seams, and what there is."""
        side, exponent = self._sides()
        least, most = self._part_faces(side)
        del side
        seams = np.flatnonzero(least != most)
        # They are eliminated at the last cut that all parts of a vertex have in common, as the
        # number of a heap whose leaves are the parts.
        depth = self.levels - np.frexp((least[seams] ^ most[seams]).astype(float))[1]
        node = (least[seams].astype(np.int64) + (1 << self.levels)) >> (self.levels - depth)
        np.savez(self.folder / "seams.npz", node=node)
        parts = [p for p in range(1 << self.levels) if self._raw(p).exists()]
        for number, part in enumerate(parts):
            self.progress("write", number / len(parts))
            self._write(part, exponent, seams, least)
        manifest = {
            "vertices": len(self.V),
            "faces": len(self.F),
            "seams": len(seams),
            "levels": self.levels,
            "parts": parts,
            "exponent": exponent,
        }
        (self.folder / MANIFEST).write_text(json.dumps(manifest) + "\n")

    def _sides(self) -> tuple[Numbers, int]:
        """(n,) the part in which each vertex lies, and the exponent of the unit."""
        exponent = -(2**20)
        for _, block in self.V.blocks():
            if not np.isfinite(block).all():
                refuse(self.V, self.F)
            exponent = max(exponent, size_exponent(block))
        seen = self.V.take(evenly_spaced_rows(len(self.V), SAMPLE))
        found = cuts(unit_size(seen, exponent), self.levels)
        side = np.empty(len(self.V), np.uint16)
        for start, block in self.V.blocks():
            self.progress("cut", start / len(self.V))
            side[start : start + len(block)] = sides(unit_size(block, exponent), found)
        return side, exponent

    def _part_faces(self, side: Numbers) -> tuple[Numbers, Numbers]:
        """Write each face to its part; (n,) the smallest and the largest part of each vertex."""
        n = len(self.V)
        least, most = np.full(n, np.iinfo(np.uint16).max, np.uint16), np.zeros(n, np.uint16)
        for start, block in self.F.blocks():
            self.progress("part", start / len(self.F))
            if not (block.min() >= 0 and block.max() < n):
                refuse(self.V, self.F)
            faces = block.astype(np.int64)
            if (faces != block).any() or len(repeated_corners(faces)):
                refuse(self.V, self.F)
            part = side[faces].min(axis=1)
            for corner in faces.T:
                np.minimum.at(least, corner, part)
                np.maximum.at(most, corner, part)
            order = np.argsort(part, kind="stable")
            ends = np.searchsorted(part[order], np.arange((1 << self.levels) + 1))
            rows = np.column_stack([order + start, faces[order]])
            for p in np.unique(part):
                with self._raw(p).open("ab") as file:
                    file.write(rows[ends[p] : ends[p + 1]].tobytes())
        if (least > most).any():  # in no face
            refuse(self.V, self.F)
        return least, most

    def _write(self, part: int, exponent: int, seams: Ints, least: Numbers) -> None:
        """Write a part with vertices of its own, and remove its raw faces."""
        faces, *corners = np.fromfile(self._raw(part), np.int64).reshape(-1, 4).T
        vertices, F = np.unique(np.column_stack(corners), return_inverse=True)
        row = np.full(len(vertices), -1)
        _, here, there = np.intersect1d(vertices, seams, assume_unique=True, return_indices=True)
        row[here] = there
        np.savez(
            self.folder / f"part-{part}.npz",
            vertices=vertices,
            faces=faces,
            V=unit_size(self.V.take(vertices), exponent),
            F=F.reshape(-1, 3),
            row=row,
            own=least[vertices] == part,
        )
        self._raw(part).unlink()

    def _raw(self, part: int) -> Path:
        return self.folder / f"{part}.raw"


def _tables(source: Source) -> tuple[Table, Table]:
    """V and F; files are mapped into memory."""
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        if path.is_dir():
            V, F = (sorted(path.glob(f"{name}*.npy")) for name in "VF")
            if not (V and F):
                raise FileNotFoundError(errno.ENOENT, "has no V*.npy and F*.npy", os.fspath(path))
            return Table(*V), Table(*F)
        found = triangles_of_ply(path) if path.suffix.lower() == ".ply" else None
        source = found or read_mesh(path)
    return Table(source[0]), Table(source[1])


def _mapped(array: Any) -> Array:
    if isinstance(array, str | os.PathLike):
        mapped: Array = np.load(array, mmap_mode="r")
        return mapped
    try:
        return np.asarray(array)
    except ValueError:  # ragged
        return np.empty(0, dtype=object)
