"""The certificate of a free outline: a simple polygon, and no flipped face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import libigl
from ..arrays import Bools, Complex, Floats, Ints, as_complex, coordinates
from ..errors import spell
from ..surface.mesh import Mesh
from ..surface.triangles import BLOCK, flipped_faces
from .certificate import Verified


@dataclass(frozen=True, eq=False)
class OutlineCertificate(Verified):
    """What was verified on the coordinates of a map with a free outline.

    If the outline, the image of the boundary, is a simple polygon and every face is positively
    oriented, the map is a bijection onto the polygon: each of its points has as many images as
    the outline goes around it, and that is once inside and never outside.

    Attributes
    ----------
    winding_number : int
        Turns of the outline: its exterior angles by 2 pi.
    meeting : (k, 2) ndarray of int64
        Edges of the outline that meet elsewhere than at a common end, exactly: the boundary
        vertices that they leave. Some if there are any, and not always all.
    finite, flipped, n_exact
        As in `Certificate`.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(20)
    >>> certificate = cdcp_igl.free_map(V, F).certificate
    >>> certificate.valid, certificate.winding_number, len(certificate.meeting)
    (True, 1, 0)
    """

    finite: bool
    winding_number: int
    meeting: Ints
    flipped: Ints
    n_exact: int

    @property
    def valid(self) -> bool:
        """True for a bijection onto a simple polygon."""
        return self.simple and len(self.flipped) == 0

    @property
    def simple(self) -> bool:
        """True if the outline goes around once and meets itself nowhere."""
        return self.finite and self.winding_number == 1 and len(self.meeting) == 0

    def _said(self) -> str:
        overlap = f"overlaps itself at {spell(self.meeting)}" if len(self.meeting) else "simple"
        return f"outline {overlap}, winding number {self.winding_number}"


def certify_outline(
    mesh: Mesh, uv: Floats, known: tuple[Ints, int] | None = None
) -> OutlineCertificate:
    """Verify a map (n, 2) of a mesh with a free outline; `flipped_faces` of it may be `known`."""
    if not np.isfinite(uv).all():
        return OutlineCertificate(False, 0, np.empty((0, 2), int), np.arange(len(mesh.F)), 0)
    f = as_complex(uv)
    edges = np.roll(f[mesh.loop], -1) - f[mesh.loop]
    turns = np.angle(edges * np.roll(edges, 1).conj()).sum() / (2 * np.pi)
    flipped, n_exact = known or flipped_faces(f, mesh.F)
    meeting = mesh.loop[meeting_edges(f[mesh.loop])]
    return OutlineCertificate(True, round(turns), meeting, flipped, n_exact)


def meeting_edges(z: Complex) -> Ints:
    """(k, 2) edges of a closed polygon that meet elsewhere than at a common end; some if any do.

    Edge i leaves z[i]. Boxes around runs of edges, the halves of these and so on: only where
    two boxes overlap, runs are looked into. Whether edges meet is decided exactly.
    """
    n, ends = len(z), np.stack([coordinates(z), coordinates(np.append(z[1:], z[0]))])
    depth = (n - 1).bit_length()
    low, high = np.full((2, 1 << depth, 2), np.inf) * [[[1]], [[-1]]]  # empty boxes at the end
    low[:n], high[:n] = ends.min(axis=0), ends.max(axis=0)
    boxes = [(low, high)]
    for _ in range(depth):
        low, high = low.reshape(-1, 2, 2).min(axis=1), high.reshape(-1, 2, 2).max(axis=1)
        boxes.append((low, high))
    stack = [(depth, np.zeros((1, 2), dtype=np.int64))]
    while stack:
        level, pairs = stack.pop()
        if level == 0:
            pairs = pairs[_may_meet(z, *pairs.T)]
            if len(found := pairs[[_meet(z, i, j) for i, j in pairs.tolist()]]):
                return found
            continue
        (low, high), level = boxes[level - 1], level - 1
        halves = 2 * pairs[:, None] + [[0, 0], [0, 1], [1, 0], [1, 1]]
        i, j = halves.reshape(-1, 2).T
        kept = np.flatnonzero((i < j) | ((i == j) & (level > 0)))
        i, j = i[kept], j[kept]
        over = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
        pairs = np.column_stack([i[over], j[over]])
        # The first part is looked into first, so that the others take no memory meanwhile.
        stack += [(level, pairs[start : start + BLOCK]) for start in range(0, len(pairs), BLOCK)]
    return np.empty((0, 2), dtype=np.int64)


def _may_meet(z: Complex, i: Ints, j: Ints) -> Bools:
    """(k,) no for neighbours i < j that do not leave their common end for the same quadrant."""
    n = len(z)
    middle = np.where(j - i == 1, j, i)
    back, on = z[middle - 1] - z[middle], z[(middle + 1) % n] - z[middle]
    folded = (np.sign(back.real) == np.sign(on.real)) & (np.sign(back.imag) == np.sign(on.imag))
    return np.asarray(folded | ((j - i > 1) & (j - i < n - 1)))


def _meet(z: Complex, i: int, j: int) -> bool:
    """Whether edges i < j of a closed polygon meet elsewhere than at a common end, exactly."""
    n = len(z)
    if j - i not in (1, n - 1):
        points = coordinates(z[[i, i + 1, j, (j + 1) % n]])
        return libigl.meet(*points)
    p, q, r = z[[i, j, (j + 1) % n] if j - i == 1 else [j, i, i + 1]]
    both = coordinates(np.array([[p, q, r], [r, q, p]]).ravel()).reshape(2, 3, 2)
    return not libigl.is_counterclockwise(both).any()  # they go back along one line
