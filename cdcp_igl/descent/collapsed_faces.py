"""Open faces inscribed in the circle that have collapsed in double precision."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Ints, coordinates
from ..libigl import is_counterclockwise
from ..surface.mesh import Mesh
from ..surface.triangles import flipped_faces, oriented_areas
from ..verdict.certificate import increments

LAST_DIGIT = 2.0**-53  # of a coordinate between 1/2 and 1
MOST = 1e-13  # that a corner may leave the circle by; a certificate allows 1e-12
ROUNDS = 8  # as a raised corner may be that of another face; then give up


def open_collapsed_faces(mesh: Mesh, f: Complex) -> tuple[Complex, int]:
    """Move corners of collapsed inscribed faces outwards, by no more than rounding errors.

    A triangle inscribed in the unit circle with arcs p and q, both short, is p q / 2 high. In a
    crowded part of the surface that is far less than the distance between doubles, and rounding
    decides on which side of the chord under the two arcs the corner between them comes to lie.
    It belongs outside, and is put there by the fewest last digits that will do. Returns the map
    (n,), the argument itself where nothing has collapsed, and how many inscribed faces had.
    """
    collapsed = _collapsed(mesh, f)
    if len(collapsed) == 0:
        return f, 0
    n_collapsed = len(collapsed)
    tip, span = _tips(mesh, f)
    f = f.copy()
    for _ in range(ROUNDS):
        # The chord under a face may be a side of another with a longer chord: that one first.
        for row in collapsed[np.argsort(-span[collapsed], kind="stable")]:
            _raise(f, mesh.F[mesh.inscribed[row]], tip[row])
        before, collapsed = collapsed, _collapsed(mesh, f)
        if len(collapsed) == 0 or np.array_equal(collapsed, before):
            break
    return f, n_collapsed


def _collapsed(mesh: Mesh, f: Complex) -> Ints:
    """Rows of ``mesh.inscribed`` whose faces have lost their area, and may get it back."""
    F = mesh.F[mesh.inscribed]
    rows = flipped_faces(f, F)[0]
    if len(rows) == 0:
        return rows
    area, _ = oriented_areas(f, F[rows])
    return rows[area > -2 * MOST]  # a side is 2 long at most


def _tips(mesh: Mesh, f: Complex) -> tuple[Ints, Complex]:
    """(k,) corner opposite the longest arc of each inscribed face; length of the other two."""
    angle = np.append(0, np.cumsum(increments(f[mesh.loop])))
    corners = np.sort(mesh.loop_index[mesh.F[mesh.inscribed]], axis=1)
    arcs = angle[np.roll(corners, -1, axis=1)] - angle[corners]
    arcs[:, 2] += angle[-1]
    longest = arcs.argmax(axis=1)
    tip = np.take_along_axis(corners, (longest[:, None] + 2) % 3, axis=1)[:, 0]
    return mesh.loop[tip], angle[-1] - arcs.max(axis=1)


def _raise(f: Complex, face: Ints, tip: int) -> None:
    """Move the tip outwards until the face is positively oriented, in place."""
    on_circle, outwards = f[tip] / abs(f[tip]), LAST_DIGIT
    while outwards <= MOST and not is_counterclockwise(coordinates(f[face])[None])[0]:
        f[tip] = on_circle * (1 + outwards)
        outwards *= 2
