"""Cut any surface open, so that each component becomes a disk."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Floats, Ints, places, rows_not_in
from ..errors import Defect, MeshError
from ..io.given import takes_meshes
from ..result.cut import Cut
from ..surface.topology import Topology, duplicate_faces
from ..surface.validation import repeated_corners, usable_arrays
from .cut_graph import split_components
from .cut_paths import open_to_disk
from .own_seams import among_edges, cut_at
from .sheets import orient, part_sheets, polygon_numbers, used_positions


@takes_meshes
def cut(
    V: ArrayLike,
    F: ArrayLike,
    path: ArrayLike | None = None,
    *,
    polygon_of_face: ArrayLike | None = None,
) -> Cut:
    """Cut a surface open, so that each of its components becomes a disk.

    A closed surface of genus 0 is cut between two far vertices; handles along the shortest
    loops, and boundary loops are joined. Then each arc of the cut is laid anew where that
    makes it shorter and straighter. Components that are disks stay whole. Vertices where
    fans of faces meet are split, and sheets that meet in an edge of three or more
    faces are parted.

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like of real numbers
        Vertex positions, in any unit.
    F : (m, 3) array_like of integers
        Corners of the faces, consistently oriented.
    path : (k,) or (k, 2) array_like of integers, optional
        Cut along this path and nowhere else, whether disks result or not: vertices in
        succession, or edges by their two vertices.
    polygon_of_face : (m,) array_like of integers, optional
        Which polygon each face is a part of, as `cdcp_igl.io.read_polygons` returns it: faces
        with the same number are not parted, unless their polygon has a vertex or a hole inside.

    Returns
    -------
    Cut

    Raises
    ------
    MeshError
        If V and F are no triangle mesh; if faces are flipped or the surface is one-sided,
        and no path is given; if a step of the path is no edge between two faces.
    ValueError
        If path or polygon_of_face are no arrays as above.

    References
    ----------
    J. Erickson, K. Whittlesey. Greedy optimal homotopy and homology generators. SODA 2005.

    Examples
    --------
    A tetrahedron, cut open along two edges:

    >>> import cdcp_igl
    >>> V = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> F = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    >>> opened = cdcp_igl.cut(V, F, path=[1, 0, 2])
    >>> opened.vertex_index
    array([0, 1, 2, 3, 0])
    >>> cdcp_igl.check(opened.V, opened.F).is_disk
    True
    """
    given, faces = usable_arrays(V, F)
    positions = used_positions(given, faces)
    if len(repeated := repeated_corners(faces)):
        raise MeshError(Defect.of("repeated corner", repeated))
    given = given.astype(np.float64)
    polygon = polygon_numbers(polygon_of_face, len(faces))
    if path is not None:
        return cut_along(given, faces, _corners_cut_at(faces, len(given), path))
    if len(duplicates := duplicate_faces(faces)):
        raise MeshError(Defect.of("duplicate face", duplicates))
    sheets = part_sheets(positions, faces)
    flipped = orient(sheets, np.arange(len(sheets)))
    if len(flipped):
        raise MeshError(Defect.of("inconsistent orientation", flipped))
    corners = np.empty(faces.shape, np.int64)
    count = 0
    anywhere = np.zeros(faces.shape, dtype=bool)
    for component in split_components(positions, faces, sheets, polygon, anywhere):
        opened = open_to_disk(component)
        corners[component.rows] = count + opened.F
        count += opened.n
    return cut_along(given, faces, corners)


def cut_along(V: Floats, F: Ints, corners: Ints, counted: Bools | slice = slice(None)) -> Cut:
    """Make a vertex of each set of corners (m, 3) with the same number.

    Edges that were cut are those of the `counted` faces.
    """
    _, first, corner = np.unique(corners, return_index=True, return_inverse=True)
    vertex = F.ravel()[first]
    # The first copy of each vertex keeps its place among the others.
    order = np.argsort(vertex, kind="stable")
    surplus = np.diff(vertex[order], prepend=-1) == 0
    order = np.concatenate([order[~surplus], order[surplus]])
    row = places(order, len(order))
    F_cut, vertex_index = row[corner.reshape(F.shape)], vertex[order]

    # An edge that was cut is the origin of several.
    opened = Topology(F_cut[counted], len(vertex)).edges
    origin = np.sort(vertex_index[np.column_stack([opened.low, opened.high])], axis=1)
    number, copies = np.unique(origin[:, 0] * len(V) + origin[:, 1], return_counts=True)
    edges = np.column_stack(np.divmod(number[copies > 1], len(V)))
    unit = abs(V[edges]).max(initial=np.finfo(float).tiny)  # whose square is in range
    apart = (V[edges[:, 1]] - V[edges[:, 0]]) / unit
    length = float(unit * np.linalg.norm(apart, axis=1).sum())
    of_given = np.arange(len(F)), len(V), F
    return Cut(V[vertex_index], F_cut, vertex_index, edges, length, *of_given)


def _corners_cut_at(F: Ints, n: int, path: ArrayLike) -> Ints:
    """(m, 3) numbers of the vertices of the surface cut along a given path."""
    try:
        steps = np.asarray(path)
    except ValueError:  # ragged
        steps = np.array(None)
    if steps.shape == (0,):  # an empty list, which numpy takes for one of floats
        steps = steps.astype(np.int64)
    if steps.dtype.kind not in "iu" or not (steps.ndim == 1 or steps.shape[1:] == (2,)):
        raise ValueError(
            "path must be vertices in succession (k,) or edges (k, 2), integers; "
            f"it has shape {steps.shape} and type {steps.dtype}"
        )
    if steps.ndim == 1:
        steps = np.column_stack([steps[:-1], steps[1:]])
    steps = np.sort(steps.astype(np.int64), axis=1)
    surface = Topology(F, n)
    missing = rows_not_in(surface.edges.ends(surface.edges.valence > 1), steps)
    if len(missing):
        raise MeshError(Defect.of("not an edge", missing, missing=len(missing), steps=len(steps)))
    return cut_at(F, among_edges(F, steps))
