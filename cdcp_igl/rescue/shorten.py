"""Shorten a surface that is too long for double precision, where its map would be too small."""

from __future__ import annotations

import numpy as np

from ..arrays import Complex, Floats
from ..distortion import wirtinger_derivative
from ..solve.cholesky import Numbers
from ..solve.factored import FactoredSurface
from ..solve.laplacian import Laplacian
from ..solve.solvers import factorize
from ..surface.triangles import face_areas
from .harmonic_measure import edge_shares

__all__ = ["Shortened", "image_scale"]

# Faces whose size in the disk is this at least survive the rounding of their corners.
SMALLEST_FACE = 5e-16
# What is shortened becomes this part of its length, unless more is needed: stronger, and the faces
# fold; weaker, and more of the surface is concerned.
COMPRESSION = 0.6
FARTHEST = 650.0  # conductivities down to exp(-650) are doubles


class Shortened:
    """A surface with a lower conductivity where its conformal map is too small.

    In a strip of width 1 with conductivity exp(-b x), harmonic functions of the kind
    exp(-p x) cos(pi y) have p^2 + b p = pi^2: they fall off as if the strip were shorter by
    a = p / pi, where b / pi = 1 / a - a. The scale |f'| of the conformal map falls off like
    exp(-pi x). So a conductivity of (|f'| / s)^(1/a - a) shortens a surface by a where its scale
    is below s, and leaves the rest; s is such that all faces get large enough to be told
    apart. Positive weights stay positive, so that nothing folds (Tutte, Floater).

    Parameters
    ----------
    surface : FactoredSurface
        Without negative weights at interior vertices.
    face : int
        The central face.

    Attributes
    ----------
    part : float
        The part of its length that is left of what is shortened; 1 where nothing is too small,
        0 where no conductivity is low enough.
    steps : (nB,) float64
        Shares of the circle by harmonic measure of the shortened surface.
    """

    def __init__(self, surface: FactoredSurface, face: int) -> None:
        mesh, L = surface.mesh, surface.laplacian
        self._mesh, self._order = mesh, surface.order
        scale, size = image_scale(surface, face)
        self.part, conductivity = _conductivity(scale, size)
        if not 0 < self.part < 1:
            return
        # Weights w_ij sqrt(c_i c_j), of which the logarithms are within range, on the edges that
        # a Dirichlet problem sees; the matrix is scaled to a unit diagonal.
        seen = ~(mesh.on_boundary[L.low] & mesh.on_boundary[L.high])
        self._low, self._high, self._weights = L.low[seen], L.high[seen], L.weights[seen]
        self._root = np.exp(conductivity / 2)
        ratio = self._root[self._high] / self._root[self._low]
        diagonal = np.bincount(self._low, self._weights * ratio, len(mesh.V))
        diagonal += np.bincount(self._high, self._weights / ratio, len(mesh.V))
        unit = np.sqrt(np.maximum(diagonal, np.finfo(float).tiny))
        weights = self._weights / (unit[self._low] * unit[self._high])
        matrix = Laplacian(self._low, self._high, weights, np.ones(len(mesh.V)))
        self._cholesky = factorize(matrix.block(self._order), ordering="natural")
        self._scale = 1 / (self._root * unit)
        heat = np.zeros(len(mesh.V))
        heat[mesh.F[face]] = 1
        self.steps = edge_shares(mesh, -(surface.coupling.T @ self._solve(heat)))

    def extend(self, f_B: Complex) -> Complex:
        """Extend boundary values (nB,) harmonically, with this conductivity."""
        f = np.zeros(len(self._mesh.V), dtype=complex)
        f[self._mesh.loop] = f_B
        weights = self._weights * self._root[self._low] * self._root[self._high]
        pull = np.zeros_like(f)
        np.add.at(pull, self._low, weights * f[self._high])
        np.add.at(pull, self._high, weights * f[self._low])
        return f + self._solve(pull)

    def _solve(self, b: Numbers) -> Numbers:
        """Solve L_II x = b; x is zero on the boundary, where b is not looked at."""
        x = np.zeros_like(b)
        scale = self._scale[self._order]
        x[self._order] = scale * self._cholesky.solve(scale * b[self._order])
        return x


def image_scale(surface: FactoredSurface, face: int) -> tuple[Floats, Floats]:
    """Scale |f'| of the conformal map at the vertices, and the size of its faces.

    Near the circle |f'| is the gradient of log|f|, the temperature of `harmonic_shares`, which
    is accurate however small. In the middle it is not that small, and not of interest.

    Parameters
    ----------
    surface : FactoredSurface
        Without negative weights at interior vertices.
    face : int
        The central face.

    Returns
    -------
    scale, size : (n,) float64
        Zero where the temperature is zero all around.
    """
    mesh = surface.mesh
    source = np.zeros(len(mesh.V))
    source[mesh.F[face]] = 1
    heat = surface.solve(source)
    heat *= 2 * np.pi / -(surface.coupling.T @ heat).sum()
    derivative = (wirtinger_derivative(mesh.V, mesh.F) * heat[mesh.F]).sum(axis=1)
    area = face_areas(mesh.V, mesh.F)
    corners, n = mesh.F.ravel(), len(mesh.V)
    around = np.bincount(corners, np.repeat(area, 3), n)
    scale = np.bincount(corners, np.repeat(2 * abs(derivative) * area, 3), n) / around
    return scale, scale * np.sqrt(around / 3)


def _conductivity(scale: Floats, size: Floats) -> tuple[float, Floats]:
    """(n,) logarithm of the conductivity at the vertices, and the part of the length left."""
    known = scale > np.finfo(float).tiny
    smallest, wanted = np.log(size[known].min()), np.log(SMALLEST_FACE)
    if smallest >= wanted:
        return 1.0, np.zeros(len(scale))
    # Sizes from the threshold down to the smallest become those down to the wanted.
    threshold = min((wanted - COMPRESSION * smallest) / (1 - COMPRESSION), 0)
    part = float((threshold - wanted) / (threshold - smallest))
    edge = np.median(size[known] / scale[known])
    below = np.log(np.maximum(scale, scale[known].min()) * edge) - threshold
    conductivity = (1 / part - part) * np.minimum(below, 0)
    return (part if conductivity.min() > -FARTHEST else 0.0), conductivity
