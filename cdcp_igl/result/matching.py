"""A bijection of two surfaces in which pairs of vertices meet."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import typed
from ..arrays import Complex, Floats, Ints, as_complex, coordinates, marked
from ..cached import cached_property
from ..descent.descent import Descent, Limits, pulled
from ..descent.energies import SymmetricDirichlet
from ..descent.targets import DISK
from ..errors import MapError
from ..surface.mesh import Mesh
from ..verdict.certificate import Certificate, certify_disk
from ..verdict.distortion import face_dilatation
from .bijection import DiskBijection

STEEP = 4.0  # the cost of shear grows so that the largest counts: a point that is held is a spike
RELEASED = 6  # steps without a pair, to see what that gains
SUSPECT = 3.0  # times the median gain


@dataclass(frozen=True, eq=False)
class Match:
    """A bijection of two surfaces by their disks, in which pairs of vertices meet.

    Attributes
    ----------
    uv : (n, 2) float64
        The vertices of the first surface in the disk of the other.
    certificate : Certificate
        What was verified about `uv`.
    stretch : (m,) float64
        Of each face of the first surface, how many times more it is stretched one way than the
        other from the best Möbius transformation to here.
    pairs : (k, 2) int64
        Vertices of the first surface and of the other, as they were given.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.spherical_cap(6)
    >>> one, other = cdcp_igl.disk_map(V, F), cdcp_igl.disk_map(V * [1, 1.2, 1], F)
    >>> match = one.match(other, [[5, 5], [30, 40], [80, 80]])
    >>> match.certificate.valid, bool((match.uv[30] == other.uv[40]).all())
    (True, True)
    >>> heights = match.pull_back(V[:, 2])
    """

    uv: Floats
    certificate: Certificate
    stretch: Floats
    pairs: Ints
    _disk: Mesh = field(repr=False)
    _energy: SymmetricDirichlet = field(repr=False)
    _to: DiskBijection = field(repr=False)

    @typed
    def pull_back(self, values: ArrayLike) -> Floats:
        """Carry values at the vertices of the other surface to those of the first.

        Parameters
        ----------
        values : (k, ...) array_like
            As of ``to.interpolate``.

        Returns
        -------
        (n, ...) float64
        """
        return self._to.interpolate(values, self.uv)

    @cached_property
    def gains(self) -> Floats:
        """(k,) which share of the shear each pair costs: what is saved if it is left out.

        A pair that is false stands out.
        """
        f, rows = as_complex(self.uv), self.pairs[:, 0]
        whole = self._energy.value(f)
        gains = np.zeros(len(rows))
        for pair in range(len(rows)):
            held = marked(len(f), np.delete(rows, pair))
            without = Descent(self._disk, f, DISK, held)
            left = without.lower(self._energy, Limits(RELEASED))
            gains[pair] = 1 - left / whole if whole else 0
        return gains

    @property
    def suspects(self) -> Ints:
        """Pairs that may be false: `gains` of three times the median, and half the largest.

        Those around a false pair give way to it, and would gain a little, too.
        """
        least = max(SUSPECT * np.median(self.gains), self.gains.max() / 2)
        return np.flatnonzero(self.gains > least)


def matched(mesh: Mesh, near: Complex, to: DiskBijection, pairs: Ints) -> Match:
    """Take a disk (n,) that lies near another to where pairs meet; MapError if they do not."""
    disk = Mesh(np.column_stack([coordinates(near), np.zeros(len(near))]), mesh.F, mesh.loop)
    rows, goal = pairs[:, 0], to._f[pairs[:, 1]]
    energy = SymmetricDirichlet.of(disk, 0.0, STEEP, DISK)
    descent = Descent(disk, near, DISK, marked(len(near), rows))
    reached = pulled(descent, energy, rows, goal)
    certificate = certify_disk(mesh, descent.f)
    uv, stretch = coordinates(descent.f), face_dilatation(disk.scaled, mesh.F, descent.f)
    made = Match(uv, certificate, stretch, pairs, disk, energy, to)
    if not (reached and certificate.valid):
        left = abs(descent.f[rows] - goal)
        raise MapError(
            f"The pairs do not all meet: pair {left.argmax()} is {left.max():.2g} off. They go "
            "around one another, or faces are too large there: leave pairs out, or subdivide",
            made,
        )
    return made
