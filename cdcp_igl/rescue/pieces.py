"""Pieces of the disk behind chords so short that doubles leave them no room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import identity
from scipy.sparse.linalg import splu

from ..arrays import Complex, Floats, Ints, as_complex, coordinates
from ..certificate import flipped_faces, increments
from ..surface.mesh import DiskMesh
from .repair import mean_value_weights

__all__ = ["flat_pieces", "raise_pieces"]

FLAT = 1e-5  # radians: a piece over an arc of this length is 1e-11 high, its faces much less
# Above the circle, in turn; a certificate allows 1e-12.
HEIGHTS = 1e-13 * 4.0 ** np.arange(-3, 1)


def flat_pieces(mesh: DiskMesh, f_B: Complex) -> Ints:
    """Find ``mesh.chords`` that cut off an arc of the circle that is as good as straight.

    Parameters
    ----------
    mesh : DiskMesh
    f_B : (nB,) complex128
        The boundary on the circle.

    Returns
    -------
    ndarray of int
        Their numbers, ascending.
    """
    angle = np.append(0, np.cumsum(increments(f_B)))
    if not _is_a_chord_short(mesh, angle):
        return np.empty(0, dtype=np.int64)
    chords = mesh.chords
    arc = angle[chords.end] - angle[chords.start]
    return np.flatnonzero(np.where(chords.end < chords.start, arc + angle[-1], arc) < FLAT)


def _is_a_chord_short(mesh: DiskMesh, angle: Floats) -> bool:
    """Whether a chord cuts off a flat piece; all but always not, and that saves the pieces."""
    if (np.diff(angle) >= FLAT).all():  # no arc is shorter than an edge
        return False
    start, end = angle[mesh.chord_ends].T
    arc = abs(end - start)
    return bool((np.minimum(arc, angle[-1] - arc) < FLAT).any())


def raise_pieces(mesh: DiskMesh, f: Complex) -> tuple[Complex, int]:
    """Give pieces with collapsed faces a height above their chord, no more than rounding errors.

    A piece of the disk over a short arc s of the circle is s^2 / 8 high. Where that is less than
    the distance between doubles, it has no room for vertices inside. So its boundary is spread
    evenly on a parabola over the chord, and its interior put at mean values, which in a convex
    polygon turn over no face.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128
        Map onto the disk, boundary counterclockwise on the circle.

    Returns
    -------
    f : (n,) complex128
        The argument itself where nothing could be gained.
    int
        The number of collapsed faces that were opened.
    """
    n_opened = 0
    for k in flat_pieces(mesh, f[mesh.loop]).tolist():
        chords = mesh.chords
        if not chords.hollow[k]:
            continue
        F = mesh.F[chords.faces(k)]
        collapsed = len(flipped_faces(f, F)[0])
        if collapsed == 0:
            continue
        raised = _Raised(mesh, chords.faces(k), chords.run(k))
        for height in HEIGHTS:
            trial = raised.by(f, height)
            left = len(flipped_faces(trial, F)[0])
            if left < collapsed:
                f, n_opened, collapsed = trial, n_opened + collapsed - left, left
            if left == 0:
                break
    return f, n_opened


@dataclass(frozen=True, eq=False)
class _Corners:
    V: Floats
    F: Ints
    angles: Floats


class _Raised:
    """A piece over its chord, whose ends stay where they are."""

    def __init__(self, mesh: DiskMesh, faces: Ints, run: Ints) -> None:
        self._ends, self._run = run[[0, -1]], run[1:-1]
        self._along = np.linspace(0, 1, len(run))[1:-1]
        vertices, corners = np.unique(mesh.F[faces], return_inverse=True)
        W = mean_value_weights(
            _Corners(mesh.V[vertices], corners.reshape(-1, 3), mesh.angles[faces])
        )
        inside = ~mesh.on_boundary[vertices]
        self._rim, self._inside = vertices[~inside], vertices[inside]
        rows = W[inside].multiply(1 / W[inside].sum(axis=1)).tocsr()
        self._from_rim = rows[:, ~inside]
        self._system = splu((identity(len(self._inside)) - rows[:, inside]).tocsc())

    def by(self, f: Complex, height: float) -> Complex:
        """Raise it by a height in the middle."""
        f = f.copy()
        arc = increments(f[self._ends])[0]
        turned = f[self._ends[0]] * np.exp(1j * arc * self._along)
        bulge = 4 * self._along * (1 - self._along)
        f[self._run] = turned / abs(turned) * (1 + height * bulge)
        origin = f[self._rim[0]]  # a small shape has digits that its place has not
        pull = self._from_rim @ (f[self._rim] - origin)
        f[self._inside] = origin + as_complex(self._system.solve(coordinates(pull)))
        return f
