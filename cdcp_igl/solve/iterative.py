"""Preconditioned conjugate gradients for complex vectors as vectors of real numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Complex

__all__ = ["conjugate_gradients"]


def conjugate_gradients(
    A: Callable[[Complex], Complex],
    b: Complex,
    preconditioner: Callable[[Complex], Complex],
    iterations: int,
) -> Complex:
    """Lower x^T A x / 2 - x^T b from x = 0, inner product Re x^H y (A is real-linear)."""
    x, residual, direction = np.zeros_like(b), b, np.zeros_like(b)
    rho = 1.0
    for _ in range(iterations):
        z = preconditioner(residual)
        rho, last = _dot(residual, z), rho
        if rho == 0:  # solved exactly
            break
        direction = z + rho / last * direction
        image = A(direction)
        alpha = rho / _dot(direction, image)
        x = x + alpha * direction
        residual = residual - alpha * image
    return x


def _dot(x: Complex, y: Complex) -> float:
    """Re x^H y, in an order of summation that no number of threads changes, unlike BLAS's."""
    return float(np.einsum("i,i", x.view(float), y.view(float)))
