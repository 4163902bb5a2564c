"""What `cut` returns: a surface that was cut open."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from ..arrays import Floats, Ints


class Cut(NamedTuple):
    """A surface that was cut open; ``cut(V, F)[:2]`` is a surface again.

    Attributes
    ----------
    V : (n, 3) or (n, 2) float64
        Vertices that a face uses, in their order; then the copies along the cut.
    F : (m, 3) int64
        The faces in their rows, each corner where it was.
    vertex_index : (n,) int64
        The row of the given V that each row comes from: ``V == V_given[vertex_index]`` and
        ``vertex_index[F] == F_given``. Of a part that was given, such as `submesh` returns, the
        row of what that was made of, -1 for a new vertex; so are `edges` and `face_index`.
    edges : (k, 2) int64
        Edges that were cut, rows of the given V, the smaller first.
    length : float
        Their length, in the unit of V.
    face_index : (m,) int64
        The row of the given F that each row comes from.
    n_given : int
        How many rows the given V has.
    F_given : (k, 3) int64
        The given F, in rows of the given V.
    source : Path or None
        The file, if one was given.

    Examples
    --------
    >>> import cdcp_igl
    >>> V = [[0, 0], [2, 0], [2, 1], [0, 1], [1, 0.5]]
    >>> F = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    >>> opened = cdcp_igl.cut(V, F, path=[0, 4])
    >>> opened.edges, opened.vertex_index
    (array([[0, 4]]), array([0, 1, 2, 3, 4, 0]))
    """

    V: Floats
    F: Ints
    vertex_index: Ints
    edges: Ints
    length: float
    face_index: Ints
    n_given: int
    F_given: Ints
    source: Path | None = None
