"""The three ways in which a map can fail, and what each one tells; files that cannot be read."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .arrays import Ints
from .defects import DEFECTS

_SHOWN = 8  # indices spelled out in a message; the attribute holds them all


@dataclass(frozen=True, eq=False)
class Defect:
    """One thing that keeps the input from being mapped: what is wrong, where, and what to do.

    Attributes
    ----------
    name : str
        Short identifier, e.g. ``"non-manifold edge"``.
    what : str
        One sentence that states the defect with its count.
    remedy : str
        What to do about it.
    kind : str
        What `indices` count: ``"faces"``, ``"vertices"`` or ``"edges"``; or ``"polygons"``, of
        files in which faces have more than three corners.
    indices : ndarray of int64
        All offenders: (k,) rows of F or V, or (k, 2) pairs of rows of V for edges; the polygon
        that each face is a part of.
    remedy_in_shell : str
        What to do about it on the command line.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(5)
    >>> F[[3, 8]] = F[[3, 8], ::-1]
    >>> [defect] = cdcp_igl.check(V, F).defects
    >>> defect.name, defect.kind, defect.indices
    ('inconsistent orientation', 'faces', array([3, 8]))
    """

    name: str
    what: str
    remedy: str
    kind: str = "faces"
    indices: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    remedy_in_shell: str = ""

    @classmethod
    def of(cls, row: str, indices: Ints | None = None, **given: Any) -> Defect:
        """Make a defect of a row of the table; `given` are what its message has in braces."""
        said, found = DEFECTS[row], np.empty(0, np.int64) if indices is None else indices
        subject = counted(len(found), *said.subject) + " " if said.subject else ""
        return cls(
            name=row.partition(", ")[0],
            what=subject + said.message.format(**given),
            remedy=said.remedy,
            kind=said.kind,
            indices=found,
            remedy_in_shell=said.remedy_in_shell,
        )

    def __str__(self) -> str:
        return f"{self._found}. {self.remedy}"

    @property
    def in_shell(self) -> str:
        """What `str` gives, with the remedy on the command line."""
        return f"{self._found}. {self.remedy_in_shell or self.remedy}"

    @property
    def _found(self) -> str:
        named = np.unique(self.indices) if self.kind == "polygons" else self.indices
        return self.what + (f" ({self.kind} {spell(named)})" if len(named) else "")


class MeshError(ValueError):
    """The input is not a surface of the kind that is asked for, or no triangle mesh at all.

    Attributes
    ----------
    defects : tuple of Defect
        Every defect found, the most fundamental one first; the message states that one.
    defect : str
        Name of the first defect.
    indices : ndarray of int64
        Offending rows of the first defect, see `Defect`.
    remedy : str
        What to do about it.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F = [[0, 0], [1, 0], [0, 1], [1, 1]], [[0, 1, 2]]
    >>> try:
    ...     cdcp_igl.cdcp(V, F)
    ... except cdcp_igl.MeshError as error:
    ...     print(error.defect, error.indices)
    ...     print(error.remedy)
    unreferenced vertex [3]
    Drop them and renumber F, as cdcp_igl.clean does; cdcp_igl.surface_map ignores them.
    """

    def __init__(self, *defects: Defect) -> None:
        first = defects[0]
        self.defects = defects
        self.defect, self.indices, self.remedy = first.name, first.indices, first.remedy
        others = ", ".join(d.name for d in defects[1:])
        super().__init__(str(first) + (f" Also: {others}." if others else ""))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self.defects


class SolverError(RuntimeError):
    """The sparse solver could not factor or solve a valid mesh's Laplacian.

    The message names the solver, the matrix and the remedy.

    Examples
    --------
    >>> import cdcp_igl
    >>> issubclass(cdcp_igl.SolverError, RuntimeError)
    True
    """


class MapError(RuntimeError):
    """There is no certified bijection to return.

    Attributes
    ----------
    result : object or None
        The map as it is, with the ``certificate`` that says what is wrong with it: what the
        function returns if all is well, or a ReferenceMap from a method of `cdcp_igl.reference`.

    Examples
    --------
    A method that finds no map without interior vertices:

    >>> import cdcp_igl
    >>> try:
    ...     cdcp_igl.reference.cem([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]])
    ... except cdcp_igl.MapError as error:
    ...     print(error)
    There is no interior vertex from which the boundary could follow
    """

    def __init__(self, message: str, result: Any = None) -> None:
        self.result = result
        super().__init__(message)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.result)


class Damage(Exception):
    """A file that is not what its name says, in words for whoever made the file."""


def spell(indices: Ints) -> str:
    """Write out the first few indices."""
    shown = ", ".join(
        f"{row[0]}-{row[1]}" if np.ndim(row) else str(row) for row in indices[:_SHOWN].tolist()
    )
    hidden = len(indices) - _SHOWN
    return shown + (f" and {hidden:,} more" if hidden > 0 else "")


def counted(number: int, one: str, many: str) -> str:
    """Say how many there are: ``"1 face has"``, ``"2 faces have"``."""
    return f"{number:,} {one if number == 1 else many}"


def printable(path: str | os.PathLike[str]) -> str:
    r"""Spell a path so that it can be printed: bytes that are no UTF-8 as \xe9."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")
