"""Remote parts of a surface, placed relative to boundary points near them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Complex, Floats, Ints
from ..surface.mesh import DiskMesh

__all__ = ["Remote", "remote_parts"]

# Solving for values of size 1 leaves errors of some 5e-15. Next to arcs shorter than this they
# would show in the angles of the faces.
CROWDED_ARC = 1e-9
# How far from its anchor a vertex is placed relative to it. Solving for values of this size
# leaves errors below the last digit of the position; the smaller it is, the more anchors are
# needed to go once around the circle.
REACH = 0.03


@dataclass(frozen=True, eq=False)
class Remote:
    """Positions of vertices relative to points on the circle near them.

    Near the circle, a position next to 1 can be told from its neighbours only as far as
    1e-16, however small its faces are. Its difference from a fixed point near them, the
    anchor, keeps all its digits, and is rounded once, when the map is finished.

    Attributes
    ----------
    vertices : (k,) ndarray of int64
        Those that have an anchor.
    anchor : (k,) ndarray of int64
        The boundary vertex that is the anchor of each.
    origin : (k,) complex128
        Where the anchor is.
    offset : (k,) complex128
        The position minus the anchor's.
    """

    vertices: Ints
    anchor: Ints
    origin: Complex
    offset: Complex

    def placed(self, f: Complex, w: complex) -> Complex:
        """Put the remote vertices of a map where they are to the last digit.

        Parameters
        ----------
        f : (n,) complex128
            The harmonic map after psi_w, eq. (19), turned about 0.
        w : complex

        Returns
        -------
        (n,) complex128
        """
        c, d = self.origin, self.offset
        # psi_w(c + d) / psi_w(c) - 1 without a difference of large numbers, as |c| = 1.
        moved = d * (1 - abs(w) ** 2) / ((c - w) * (1 - np.conj(w) * (c + d)))
        near = abs(moved) < REACH  # w may lie in a remote part, which is then none any more
        vertices, anchor = self.vertices[near], self.anchor[near]
        f = f.copy()
        f[vertices] = f[anchor] + f[anchor] * moved[near]
        return f


def remote_parts(
    mesh: DiskMesh, steps: Floats, f_B: Complex, extend: Callable[[Complex], Complex]
) -> Remote | None:
    """Find what is too close to the circle for plain complex numbers, and place it.

    A direct solver's errors are relative to the largest values on the boundary, weighted by
    the harmonic measure of where these are: with positive weights neither substitution
    subtracts. So the extension of f_B - c, c = f(b) at a boundary vertex b in the remote
    part, is accurate there: what is near is small, and what is far has next to no weight.

    Parameters
    ----------
    mesh : DiskMesh
    steps : (nB,) float64
        Shares of the circle from each boundary vertex to the next; accurate however small.
    f_B : (nB,) complex128
        The boundary on the circle, by these steps.
    extend : callable
        Extends boundary values harmonically; called once for each anchor.

    Returns
    -------
    Remote or None
        None where no arc is so short: the ordinary case, which costs nothing.
    """
    arcs = 2 * np.pi * steps / steps.sum()
    waiting = arcs < CROWDED_ARC
    if not waiting.any():
        return None
    n = len(mesh.V)
    nearest, anchor = np.full(n, REACH), np.full(n, -1)
    offset, origin = np.zeros(n, dtype=complex), np.zeros(n, dtype=complex)
    while waiting.any():
        b = int(np.where(waiting, arcs, np.inf).argmin())
        offset_B = f_B[b] * np.expm1(1j * _angles_from(b, arcs))
        waiting &= abs(offset_B) > REACH / 2
        difference = extend(offset_B)
        closer = abs(difference) < nearest
        nearest[closer], offset[closer] = abs(difference[closer]), difference[closer]
        anchor[closer], origin[closer] = mesh.loop[b], f_B[b]
    vertices = np.flatnonzero(anchor >= 0)
    return Remote(vertices, anchor[vertices], origin[vertices], offset[vertices])


def _angles_from(b: int, arcs: Floats) -> Floats:
    """(nB,) angle of each boundary vertex from vertex b, from -pi to pi, small ones accurate."""
    along = np.roll(arcs, -b)
    after, before = np.cumsum(along) - along, np.cumsum(along[::-1])[::-1]
    after[0] = 0
    return np.roll(np.where(after < before, after, -before), b)
