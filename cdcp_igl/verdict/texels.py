"""How evenly a texture would cover a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints

LOW, HIGH = 0.05, 0.95
ROUNDING = 1e-9  # a logarithm of the scale that varies less does not vary


@dataclass(frozen=True)
class TexelDensity:
    """Length in texture coordinates by length on the surface, compared over the area.

    Of a face, it is the square root of area by area.

    Attributes
    ----------
    ratio : float
        The 95th by the 5th percentile, by area: 1 where texels have the same size everywhere.
    smallest : float
        That of the face with fewest texels, by the mean; 0 if it has collapsed.
    charts : tuple of float
        `ratio` of each chart alone.

    Examples
    --------
    The net of a cube has the same texels everywhere:

    >>> import cdcp_igl
    >>> V = [[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    >>> sides = [0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]
    >>> F = [half for a, b, c, d in sides for half in ([a, b, c], [a, c, d])]
    >>> print(cdcp_igl.surface_map(V, F).texel_density)
    95 % by 5 %: 1.00, smallest by mean 1.00
    """

    ratio: float
    smallest: float
    charts: tuple[float, ...]

    @classmethod
    def of(cls, density: Floats, area: Floats, chart: Ints) -> TexelDensity:
        """Compare the densities (m,) of faces with these areas (m,) in these charts (m,)."""
        mean = np.average(density, weights=area)
        charts = (chart == k for k in range(int(chart.max()) + 1))
        ratios = (_ratio(density[rows], area[rows]) for rows in charts)
        return cls(_ratio(density, area), float(density.min() / mean), tuple(ratios))

    def __str__(self) -> str:
        return f"95 % by 5 %: {self.ratio:.2f}, smallest by mean {self.smallest:.2f}"


def variation(factor: Floats, area: Floats | None = None) -> float:
    """Measure the standard deviation of a factor (n,) over the area (n,); 0 if it is rounding."""
    average = np.average(factor, weights=area)
    deviation = float(np.sqrt(np.average((factor - average) ** 2, weights=area)))
    return deviation if deviation > ROUNDING else 0.0


def _ratio(density: Floats, area: Floats) -> float:
    order = np.argsort(density)
    below = np.cumsum(area[order])
    low, high = density[order][np.searchsorted(below, np.array([LOW, HIGH]) * below[-1])]
    return float(high / low) if low else np.inf
