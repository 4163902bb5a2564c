"""What is computed of one part, or of one cut: pure functions of files and a few numbers.

Each takes the folder and the number of the part (or of the cut), and returns arrays. The vertices
of a part are inside; on seams, in several parts; or on the boundary of the surface, where values
are given. To what is inside, the other two are the boundary.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import coo_matrix, csc_matrix

from ...arrays import Floats, Indices, Ints, coordinates, marked
from ...errors import MapError, SolverError
from ...solve.factored import harmonic_extension
from ...solve.laplacian import Laplacian, cotangent_laplacian
from ...solve.memory import require_memory
from ...solve.ordering import elimination_order
from ...solve.solvers import solver
from ...steps.mobius import mobius_transformation
from ...steps.trace import boundary_flux, face_dipole
from ...surface.topology import Topology, heads
from ...surface.triangles import (
    corner_cotangents,
    degenerate_faces,
    face_areas,
    flipped_faces,
    lost_in_single_precision,
    vertex_areas,
)
from ...verdict.distortion import reported_distortion
from .part import Arrays, Folder, Part, among, named


def examine(folder: Folder, p: int) -> Arrays:
    """Find what tells whether the whole is a disk.

    ``sound``: nothing is wrong inside. ``half_edges`` (k, 2): those of edges that have one face
    here, or may have faces in other parts, by their ends, with the ``component`` of each.
    """
    part = Part(folder, p)
    surface = Topology(part.F, len(part.vertices))
    edges, tail = surface.edges, part.F.T.ravel()
    one, other = surface.twins
    flat = degenerate_faces(corner_cotangents(part.V, part.F))
    sound = not (surface.singular.any() or (tail[one] == tail[other]).any() or len(flat))
    on_seam = part.row >= 0
    open_ = (edges.valence == 1) | (on_seam[edges.low] & on_seam[edges.high])
    sides = edges.sides[np.repeat(open_, edges.valence)]
    n_components, component = surface.components
    return {
        "sound": sound,
        "half_edges": part.vertices[np.column_stack([tail, heads(tail)])[sides]],
        "component": component[sides % len(part.F)],
        "n_components": n_components,
        "n_inner": np.count_nonzero(~open_),
    }


def eliminate(folder: Folder, p: int) -> Arrays:
    """Condense a part to its seams and its boundary.

    The Schur complement of the seams is written. Returned are the condensed right-hand side of the
    torsion function, and the most that its sum over a face can be with 0 on the seams; and what
    the trace needs: the block of the seams and the boundary, positions, and angles around them.
    """
    part = Part(folder, p)
    loop, rows = part.mesh.loop, part.rows
    condensed = Condensed(cotangent_laplacian(part.mesh), part.V, loop)
    u, torsion = condensed.solve(part.sources)
    k = np.count_nonzero(rows < folder.seams)
    folder.write(f"schur-{folder.n_leaves + p}", rows=rows[:k], schur=condensed.schur[:k, :k])
    return {
        "rows": rows,
        "torsion": torsion,
        "most": u[part.F].sum(axis=1).max(),
        "order": condensed.order,
        "side": condensed.schur[:k, k:],
        "positions": part.V[loop],
        "around": np.bincount(part.F.ravel(), part.mesh.angles.ravel(), len(part.V))[loop],
    }


def merge(folder: Folder, node: int) -> Arrays:
    """Eliminate the vertices of a cut, which has the Schur complements of its two sides.

    Returns L11 and L21 of its front, with the rows that are eliminated `here` and the `rest`.
    """
    sides = [folder.read(f"schur-{k}") for k in (2 * node, 2 * node + 1) if k in folder.nodes]
    rows = np.unique(np.concatenate([side["rows"] for side in sides]))
    is_here = folder.read("seams")["node"][rows] == node
    here, rest = rows[is_here], rows[~is_here]
    rows, h = np.concatenate([here, rest]), len(here)
    order = np.argsort(rows)
    front = np.zeros((len(rows), len(rows)))
    while sides:  # one of them is gone before the next is added
        side = sides.pop()
        at = order[np.searchsorted(rows[order], side["rows"])]
        front[np.ix_(at, at)] += side["schur"]
    try:
        L11 = np.linalg.cholesky(front[:h, :h])
    except np.linalg.LinAlgError as error:
        raise SolverError(
            f"the seams of cut {node} failed: {error}. If the mesh has slivers, remesh it."
        ) from error
    L21 = solve_triangular(L11, front[:h, h:], lower=True, check_finite=False).T
    schur = front[h:, h:]
    schur -= L21 @ L21.T
    folder.write(f"schur-{node}", rows=rest, schur=schur)
    return {"here": here, "rest": rest, "L11": L11, "L21": L21}


def central(folder: Folder, p: int) -> Arrays:
    """Find the most central faces of a part."""
    return Part(folder, p).most_central()


def dipole(folder: Folder, p: int, face: int) -> Arrays:
    """Condense the dipole on a face of a part: what flows into its seams and its boundary."""
    part = Part(folder, p)
    row = int(np.searchsorted(part.faces, face))
    return {
        "rows": part.rows,
        "flux": boundary_flux(part.factored, face_dipole(part.mesh, row)),
        "on_boundary": part.on_boundary[part.F[row]].any(),
    }


def extend(folder: Folder, p: int, face: int) -> Arrays:
    """Extend the values of seams and boundary harmonically, eq. (10): ``f`` (n,).

    They are those of a central face; if this was found by the torsion function, the most central
    faces are returned, too.
    """
    part = Part(folder, p)
    f = harmonic_extension(part.factored, part.given(f"values-{face}"))
    return {"f": f, **(part.most_central() if folder.has("torsion") else {})}


def finish(folder: Folder, p: int, face: int, values: str) -> Arrays:
    """Apply a Möbius transformation to f, and certify the part on the coordinates as written.

    ``f`` (n,) has the values of seams and boundary bit by bit as they are given: both sides of
    a seam certify the same. ``degrees`` are sums of the angular distortion: number, sum, sum of
    squares and maximum, and the same of faces inscribed in the circle, which are not among the
    first. ``lost``: the number of faces without area as texture coordinates in single precision,
    their area, and that of all.
    """
    part, given = Part(folder, p), folder.read(values, "w", "turn", "vertices", "moved")
    f = folder.read(named(extend, p, face), "f")["f"]
    f = mobius_transformation(f, complex(given["w"])) / given["turn"]
    f[part.mesh.loop] = part.given(values)
    moved = given["vertices"].astype(int)
    f[among(moved, part.vertices)] = given["moved"][among(part.vertices, moved)]
    uv = coordinates(f)
    if not np.isfinite(uv).all():
        raise MapError(f"The map of part {p} is not finite. If the mesh has slivers, remesh it.")
    flipped, n_exact = flipped_faces(f, part.F)
    degrees = reported_distortion(part.V, part.F, uv, flipped)
    inscribed = part.on_boundary[part.F].all(axis=1)
    lost, areas = lost_in_single_precision((uv + 1) / 2, part.F), face_areas(part.V, part.F)
    return {
        "f": f,
        "flipped": part.faces[flipped],
        "n_exact": n_exact,
        "degrees": np.array([_sums(degrees[~inscribed]), _sums(degrees[inscribed])]),
        "lost": np.array([len(lost), areas[lost].sum(), areas.sum()]),
    }


def moments(folder: Folder, p: int, face: int, w: complex, *direction: float) -> Arrays:
    """Moments of area, on the surface, of psi_w o f, and of the height in a direction.

    ``moments``: sums of the mass m, m z, m z^2, m h and m h z. ``heights``: least and largest.
    """
    part = Part(folder, p)
    z = mobius_transformation(folder.read(named(extend, p, face), "f")["f"], w)
    mass = vertex_areas(part.V, part.F)
    h = part.V @ np.array(direction or (0.0, 0.0, 0.0))
    sums = np.array([mass.sum(), mass @ z, mass @ (z * z), mass @ h, (mass * h) @ z])
    return {"moments": sums, "heights": np.array([h.min(), h.max()])}


def _sums(degrees: Floats) -> Floats:
    most = degrees.max(initial=0)
    return np.array([degrees.size, degrees.sum(), (degrees * degrees).sum(), most])


class Condensed:
    """What a Laplacian is to the vertices G that are `kept`, with the others, I, eliminated.

    The rows of G come last, all of them joined, by zeros, so that their block of the factor is
    dense; and are shifted by 1, which is the size of the weights, so that a part without a
    boundary is definite, too.

    `order` (n - k,) is I in the order of elimination, `schur` (k, k) S = L_GG - L_GI L_II^-1 L_IG.
    SolverError if L_II is numerically not positive definite, or its factor cannot fit into memory.
    """

    def __init__(self, laplacian: Laplacian, V: Floats, kept: Ints) -> None:
        n, k = len(V), len(kept)
        require_memory(n)
        factorization = solver()
        rows, ordering, _ = elimination_order(laplacian, V, ~marked(n, kept), factorization)
        if ordering == "amd" and len(rows):
            rows = rows[factorization.fill_reducing_order(laplacian.block(rows))]
        self.order = rows
        self._rows: Indices = np.concatenate([rows, kept])
        self._kept = kept
        A = _joined_and_shifted(laplacian.block(self._rows), k)
        self._factor = factorization(A, "natural")
        self._shifted = self._factor.schur_complement(A, k)
        self.schur: Floats = self._shifted - np.identity(k)

    def solve(self, b: Floats) -> tuple[Floats, Floats]:
        """Solve L_II x_I = b_I for b (n,): x (n,), 0 on G, and b_G - L_GI x_I (k,)."""
        n, k = len(b), len(self._kept)
        x, b_rows = np.zeros(n), b[self._rows]
        b_rows[n - k :] = 0
        # With the shifted matrix M, M [y_I; y_G] = [b_I; 0] gives L_GI x_I = -(S + 1) y_G, and
        # M [x_I; 0] = [b_I; L_GI x_I].
        b_rows[n - k :] = pull = -self._shifted @ self._factor.solve(b_rows)[n - k :]
        x[self._rows[: n - k]] = self._factor.solve(b_rows)[: n - k]
        return x, b[self._kept] - pull


def _joined_and_shifted(lower: csc_matrix, k: int) -> csc_matrix:
    """Join the last k rows with one another, by zeros, and add 1 to their diagonal."""
    n, A = lower.shape[0], lower.tocoo()
    rows, columns = np.tril_indices(k)
    entries = np.concatenate([A.data, (rows == columns).astype(float)])
    rows = np.concatenate([A.row, rows + (n - k)])
    columns = np.concatenate([A.col, columns + (n - k)])
    return coo_matrix((entries, (rows, columns)), (n, n)).tocsc()
