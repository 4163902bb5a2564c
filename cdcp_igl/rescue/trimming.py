"""Trimming: a map without the pieces at its boundary that have no room in double precision."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Ints
from ..certificate import increments
from ..surface.mesh import DiskMesh
from .pieces import flat_pieces

__all__ = ["Trimmed"]


class Trimmed:
    """A mesh without the pieces behind short chords, and the way back.

    In these pieces angles mean nothing any more, and what is done to lower their distortion
    would turn over other faces.

    Parameters
    ----------
    mesh : DiskMesh
    f : (n,) complex128
        Map onto the disk.

    Attributes
    ----------
    mesh : DiskMesh
        The given one if nothing is trimmed.
    """

    def __init__(self, mesh: DiskMesh, f: Complex) -> None:
        self.mesh, self._f, self._vertices = mesh, f, np.arange(len(f))
        self._runs: list[Ints] = []
        flat = flat_pieces(mesh, f[mesh.loop])
        if len(flat):
            outside = np.ones(len(mesh.F), dtype=bool)
            for k in mesh.chords.outermost(flat):
                outside[mesh.chords.faces(k)] = False
                self._runs.append(mesh.chords.run(k))
            self._vertices, corners = np.unique(mesh.F[outside], return_inverse=True)
            self.mesh = DiskMesh(mesh.V[self._vertices], corners.reshape(-1, 3))

    def order(self, order: Ints) -> Ints:
        """Take an order of the interior vertices, those that are left."""
        place = np.full(len(self._f), -1)
        place[self._vertices] = np.arange(len(self._vertices))
        places = place[order]
        return places[places >= 0]

    @property
    def f(self) -> Complex:
        """The map of the vertices that are left."""
        return self._f[self._vertices]

    def completed(self, f: Complex) -> Complex:
        """Put the pieces back behind their chords.

        Parameters
        ----------
        f : complex128
            Another map of the vertices that are left.

        Returns
        -------
        (n,) complex128
            With the insides of the pieces where they were.
        """
        whole = self._f.copy()
        whole[self._vertices] = f
        for run in self._runs:
            along = np.cumsum(increments(self._f[run])[:-1])
            arc = increments(whole[run[[0, -1]]])[0]
            inner = whole[run[0]] * np.exp(1j * arc * along[:-1] / along[-1])
            whole[run[1:-1]] = inner / abs(inner)
        return whole
