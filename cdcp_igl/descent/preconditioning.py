"""Conjugate gradients for displacements, and the weighted Laplacian that preconditions them."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from ..arrays import Complex, Floats, Indices, Ints
from ..solve.cholesky import Cholesky, Ordering
from ..solve.laplacian import Laplacian, sum_opposite
from ..solve.solvers import factorize
from ..surface.mesh import Mesh
from ..surface.triangles import blocks

SHIFT = 1e-10  # of the unit diagonal: keeps rounding from an indefinite matrix


class WeightedLaplacian:
    """The Laplacian with face weights s: its interior block, factored, and its diagonal.

    B^H diag(s) B is the normal matrix without its second, conjugate-linear term. Its real
    part is the Laplacian sum_f s / 4 grad.grad of the plane triangles, one matrix for both
    coordinates. The diagonal does for the boundary: with 3 iterations the whole matrix,
    whose inverse ignores the circle, is worse than a boundary that stays, and the
    boundary block along the tangents is no better. `order` are the interior vertices, or all of
    them where the outline is free, at least one, in a fill-reducing order or that of an `analysis`
    of the pattern, which is taken over; or the solver finds an `ordering`.
    """

    def __init__(
        self,
        mesh: Mesh,
        order: Ints | Indices,
        analysis: Cholesky | None = None,
        ordering: Ordering = "natural",
    ) -> None:
        self.ordering = ordering
        self._F, self._edges, self._n, self.order = mesh.F, mesh.edges, len(mesh.scaled), order
        self._cholesky = analysis

    def weigh(self, beta: Complex, s: Floats) -> None:
        """Set the diagonal by weights: beta is (m, 3), s is (m,) and positive."""
        corner = np.empty(beta.shape)
        for part in blocks(len(s)):
            corner[part] = s[part, None] * abs(beta[part]) ** 2
        self._inverse = 1 / np.bincount(self._F.ravel(), corner.ravel(), self._n)

    @np.errstate(over="ignore", invalid="ignore")  # the solver refuses what is not finite
    def factor(self, beta: Complex, s: Floats) -> None:
        """Set the weights, as `weigh` does, and factor the interior block."""
        self.weigh(beta, s)
        opposite = np.empty((3, len(s))).T
        for part in blocks(len(s)):
            b, weight = beta[part], s[part, None]
            opposite[part] = weight * (b[:, [1, 2, 0]] * b[:, [2, 0, 1]].conj()).real
        # A unit diagonal: entries go with 1 / area, which may range over 20 digits.
        scale = np.sqrt(self._inverse)
        self._scale = scale[self.order]
        low, high = self._edges.low, self._edges.high
        weights = -sum_opposite(self._edges, opposite) * scale[low] * scale[high]
        del opposite  # before the matrix is made
        unit = np.full(self._n, 1 + SHIFT)
        self._scaled = Laplacian(low, high, weights, unit)
        matrix = self._scaled.block(self.order)
        if self._cholesky is None:
            self._cholesky = factorize(matrix, ordering=self.ordering)
        else:  # the pattern is that of the edges, whatever the weights
            self._cholesky.refactor(matrix)

    def solve(self, x: Complex) -> Complex:
        """Solve with the weights set last."""
        if self._cholesky is None:
            raise ValueError("the weights have not been set: call factor first")
        y = self.divide(x)
        y[self.order] = self._scale * self._cholesky.solve(self._scale * x[self.order])
        return y

    def extended(self, x: Complex) -> Complex:
        """Extend what is prescribed (n,), 0 where it is to be found, harmonically."""
        scale = np.sqrt(self._inverse)
        y = x.copy()
        y[self.order] = self.solve(self._scaled.matrix() @ (x / scale) / -scale)[self.order]
        return y

    def divide(self, x: Complex) -> Complex:
        """Divide by the diagonal of the weights set last."""
        return x * self._inverse


def conjugate_gradients(
    A: Callable[[Complex], Complex],
    b: Complex,
    towards: Iterable[Callable[[Complex], Complex]],
    project: Callable[[Complex], Complex],
    enough: float = 0,
) -> Complex:
    """Lower x^T A x / 2 - x^T b from x = 0, inner product Re x^H y (A is real-linear).

    Each of `towards` makes the next direction of the residual, which b becomes, and `project` a
    possible one of it. The last is one that brings less than the share `enough` of what all have.
    """
    x, residual = np.zeros_like(b), b
    direction, image, curvature, lowered = np.zeros_like(b), np.zeros_like(b), 1.0, 0.0
    for next_direction in towards:
        z = project(next_direction(residual))
        direction *= -dot(z, image) / curvature
        direction += z
        image = A(direction)
        curvature = dot(direction, image)
        if curvature == 0:  # solved exactly
            break
        alpha = dot(direction, residual) / curvature
        x += alpha * direction
        residual -= alpha * image
        lowered += alpha**2 * curvature
        if alpha**2 * curvature < enough * lowered:
            break
    return x


def dot(x: Complex, y: Complex) -> float:
    """Re x^H y, in an order of summation that no number of threads changes, unlike BLAS's."""
    return float(np.einsum("i,i", x.view(float), y.view(float)))
