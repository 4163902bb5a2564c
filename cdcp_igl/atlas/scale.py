"""The scale of a map, whatever Möbius transformation it comes with."""

from __future__ import annotations

import numpy as np

from ..arrays import Floats, Ints, as_complex
from ..distortion import conformal_factor
from ..steps.mobius import conformal_barycenter

__all__ = ["centered_factor"]

# Where an edge has collapsed the conformal factor is minus infinity: counted as this.
LEAST_FACTOR = -50.0


def centered_factor(V: Floats, F: Ints, uv: Floats, area: Floats) -> Floats:
    """Compute the conformal factor that a map has with the conformal barycentre at 0.

    Parameters
    ----------
    V : (n, 3) float64
    F : (m, 3) int64
    uv : (n, 2) float64
        A map onto the unit disk.
    area : (n,) float64
        Of the surface at each vertex, for the barycentre.

    Returns
    -------
    (n,) float64
    """
    z = as_complex(uv)
    w = conformal_barycenter(z, area)
    derivative = (1 - abs(w) ** 2) / abs(1 - w.conjugate() * z) ** 2  # of the transformation (19)
    return np.maximum(conformal_factor(V, F, uv) + np.log(derivative), LEAST_FACTOR)
