"""Rings without flipped faces, from embeddings of disks in which the hole is in the middle."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from ..arrays import Complex, Ints, marked, places, shifted
from ..errors import MeshError
from ..refine.balance import lower_shear
from ..rescue.boundary import arc_length_map
from ..rescue.means import centered
from ..steps.circle import Rejected
from ..surface.filling import with_middle
from ..surface.mesh import DiskMesh, Mesh
from ..surface.triangles import flipped_faces

HALVINGS = 40  # of the radius of the inner circle
EVEN = 0.1  # the share of even distances on it, so that none is 0


def embedded_rings(mesh: Mesh) -> Iterator[tuple[str, Complex]]:
    """Yield maps (n,) onto rings around 0 without flipped faces, with what was done to the hole.

    The outer loop lies by arc length until the shear is lowered.
    """
    for name, way in (("filled", _from_filled), ("closed", _from_closed)):
        with suppress(MeshError, Rejected):
            yield f"arc length, hole {name}", way(mesh)


def _from_closed(mesh: Mesh) -> Complex:
    """Draw the inner loop together to one vertex, and open it again to a circle.

    Where that is small enough, no face with one corner on it is flipped. Neither is one with an
    edge on it where the edge is seen from outside by the third corner: the ends of edges lie
    halfway between the directions of these corners, so that the middle of an edge is off the
    direction of its corner by a quarter of the difference of two angles, of less than 2 pi
    together. MeshError if what has been drawn together is no disk.
    """
    loop, n = mesh.loops[1], len(mesh.V)
    inner = marked(n, loop)
    others = np.flatnonzero(~inner)
    row = places(others, n)
    row[loop] = len(others)
    F = row[mesh.F]
    F = F[np.count_nonzero(inner[mesh.F], axis=1) < 2]
    f = np.zeros(n, dtype=complex)
    f[others] = _embedded(DiskMesh(with_middle(mesh.V[others], mesh.V[loop]), F))[:-1]
    near = mesh.F[inner[mesh.F].any(axis=1)]
    radius = abs(f[near[~inner[near]]]).min()
    seen = np.angle(f[_seen_by(mesh, loop)])
    steps = (seen - shifted(seen)) % (2 * np.pi)  # the loop runs clockwise
    ends = np.cumsum(steps) - steps - shifted(steps, -1) / 2
    even = 2 * np.pi * np.arange(len(loop)) / len(loop)
    even += (ends - even).mean()
    angle = seen[0] - ((1 - EVEN) * ends + EVEN * even)
    return _opened(mesh, f, radius, np.exp(1j * angle))


def _from_filled(mesh: Mesh) -> Complex:
    """Fill the hole by a fan, and draw the inner loop to a circle around its middle."""
    loop, n = mesh.loops[1], len(mesh.V)
    fan = np.column_stack([shifted(loop), loop, np.full(len(loop), n)])
    disk = DiskMesh(with_middle(mesh.V, mesh.V[loop]), np.vstack([mesh.F, fan]))
    f = _embedded(disk)[:-1]
    size = abs(f[loop])
    return _opened(mesh, f, float(np.exp(np.log(size).mean())), f[loop] / size)


def _seen_by(mesh: Mesh, loop: Ints) -> Ints:
    """(k,) third corners of the faces at the edges of a loop (k,), which begin at its vertices."""
    # Half-edge k m + f leaves corner k of face f, and lies opposite corner k - 1.
    corner, border = mesh.F.T.ravel(), mesh.edges.border.astype(np.int64)
    at = places(loop, len(mesh.V))[corner[border]]
    seen_by = np.empty_like(loop)
    seen_by[at[at >= 0]] = corner[border[at >= 0] - len(mesh.F)]
    return seen_by


def _opened(mesh: Mesh, f: Complex, radius: float, on_circle: Complex) -> Complex:
    """Halve the inner radius of a map (n,) until no face is flipped; `Rejected` if one stays so."""
    for _ in range(HALVINGS):
        f[mesh.loops[1]] = radius * on_circle
        if len(flipped_faces(f, mesh.F)[0]) == 0:
            return f
        radius /= 2
    raise Rejected("the hole cannot be opened to a circle")


def _embedded(disk: DiskMesh) -> Complex:
    """Embed a disk with its last vertex at 0, and lower the shear (n,); `Rejected` by doubles."""
    last = len(disk.V) - 1
    f, _ = centered(disk, arc_length_map(disk), last)
    if len(flipped_faces(f, disk.F)[0]):
        raise Rejected("it crowds the mean values too much for double precision")
    return lower_shear(disk, f, marked(last + 1, last))
