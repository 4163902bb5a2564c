"""Generated surfaces whose conformal map is known in closed form."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from .. import libigl
from ..arguments import typed
from ..arrays import Complex, Floats, Ints, coordinates
from ..docstrings import like

# Up to where there are some 2**31 faces: no memory holds more.
MOST_RINGS, MOST_LEVELS = 2**14, 13


@typed
def square(resolution: int) -> tuple[Floats, Ints, Floats]:
    """Triangulate the square [-1, 1]^2, with its map by the lemniscate sine.

    Parameters
    ----------
    resolution : int
        Cells along half a side, from 1 to 16,384.

    Returns
    -------
    V : (n, 3) float64
        What is flat has z = 0.
    F : (m, 3) int64
        Counterclockwise, no ears.
    uv : (n, 2) float64
        Exact conformal map of the vertices onto the unit disk, 0 to 0.

    Raises
    ------
    ValueError
        If a number is out of range.

    Examples
    --------
    >>> from cdcp_igl.datasets import square
    >>> V, F, uv = square(4)
    >>> len(V), len(F)
    (81, 128)
    """
    _check_resolution(resolution)
    t = np.linspace(-1, 1, 2 * resolution + 1)
    x, y = (grid.ravel() for grid in np.meshgrid(t, t))
    corner = np.arange(x.size).reshape(len(t), len(t))
    a, b, c, d = (
        corner[i : i + 2 * resolution, j : j + 2 * resolution].ravel()
        for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))
    )
    # Diagonals point to the centre: a diagonal that cut off a corner would make an ear.
    row, column = np.divmod(np.arange(a.size), 2 * resolution)
    rising = (row < resolution) == (column < resolution)
    F = np.concatenate(
        [
            np.where(rising[:, None], np.column_stack([a, b, c]), np.column_stack([a, b, d])),
            np.where(rising[:, None], np.column_stack([a, c, d]), np.column_stack([b, c, d])),
        ]
    )
    from scipy.special import ellipk  # slow to import

    # The lemniscate sine sl(z) = sd(sqrt(2) z | 1/2) / sqrt(2) maps the square with corners
    # at +-K / sqrt(2), +-iK / sqrt(2) onto the disk.
    z = (x + 1j * y) * np.exp(0.25j * np.pi) / np.sqrt(2) * ellipk(0.5)
    sn, dn = _jacobi(z, 0.5)
    return np.column_stack([x, y, 0 * x]), F, coordinates(sn / dn / np.sqrt(2))


@like(square)
@typed
def ellipse(resolution: int, aspect: float = 2.0) -> tuple[Floats, Ints, Floats]:
    """Triangulate an ellipse, with its map by Schwarz's formula.

    Parameters
    ----------
    resolution : int
        Rings of vertices, from 1 to 16,384.
    aspect : float
        Ratio of the axes, above 1 and at most 8, up to where the map has ten digits; the short
        half-axis is 1.

    Examples
    --------
    >>> from cdcp_igl.datasets import ellipse
    >>> V, F, uv = ellipse(10, aspect=3)
    >>> V.max(axis=0)
    array([3., 1., 0.])
    """
    if not 1 < aspect <= 8:
        raise ValueError(f"aspect must be above 1 and at most 8, not {aspect!r}")
    z, F = _rings(resolution)
    V = np.column_stack([aspect * z.real, z.imag, 0 * z.real])
    from scipy.special import ellipk  # slow to import

    # f(z) = sqrt(k) sn(2 K / pi arcsin(z / c)), foci at +-c, nome ((a - b) / (a + b))^2.
    nome = ((aspect - 1) / (aspect + 1)) ** 2
    powers = np.arange(1, 200)
    theta_2 = 2 * nome**0.25 * (1 + (nome ** (powers * (powers + 1))).sum())
    theta_3 = 1 + 2 * (nome ** (powers**2)).sum()
    m = (theta_2 / theta_3) ** 4
    amplitude = np.arcsin((V[:, 0] + 1j * V[:, 1]) / np.sqrt(aspect**2 - 1))
    sn, _ = _jacobi(2 * ellipk(m) / np.pi * amplitude, m)
    return V, F, coordinates(m**0.25 * sn)


@like(square)
@typed
def spherical_cap(resolution: int, angle: float = 120.0) -> tuple[Floats, Ints, Floats]:
    """Triangulate a cap of the unit sphere around its pole, with its stereographic projection.

    Parameters
    ----------
    resolution : int
        Rings of vertices, from 1 to 16,384.
    angle : float
        Polar angle of the rim in degrees, between 0 and 180.

    Examples
    --------
    >>> from cdcp_igl.datasets import spherical_cap
    >>> V, F, uv = spherical_cap(10, angle=90)
    >>> print((V**2).sum(axis=1).round(12).min())
    1.0
    """
    if not 0 < angle < 180:
        raise ValueError(f"angle must be between 0 and 180 degrees, not {angle!r}")
    z, F = _rings(resolution)
    polar: Floats = np.abs(z) * np.radians(angle)
    direction = _unit(np.angle(z))
    equatorial = np.sin(polar) * direction
    V = np.column_stack([equatorial.real, equatorial.imag, np.cos(polar)])
    return V, F, coordinates(np.tan(polar / 2) / np.tan(np.radians(angle) / 2) * direction)


@like(square)
@typed
def paraboloid(resolution: int, steepness: float = 1.0) -> tuple[Floats, Ints, Floats]:
    """Triangulate the paraboloid z = steepness r^2, r <= 1, with its isothermal coordinate.

    Parameters
    ----------
    resolution : int
        Rings of vertices, from 1 to 16,384.
    steepness : float
        Positive.

    Examples
    --------
    >>> from cdcp_igl.datasets import paraboloid
    >>> V, F, uv = paraboloid(10, steepness=2)
    >>> print(V[:, 2].max().round(12))
    2.0
    """
    if not 0 < steepness < np.inf:
        raise ValueError(f"steepness must be positive, not {steepness!r}")
    z, F = _rings(resolution)
    r: Floats = np.abs(z)
    V = np.column_stack([z.real, z.imag, steepness * r**2])

    def isothermal(r: Floats | float) -> Floats:
        # exp of the integral of ds / r along the meridian, ds^2 = (1 + 4 s^2 r^2) dr^2
        root = np.sqrt(1 + (2 * steepness * r) ** 2)
        return np.exp(root) * r / (1 + root)

    return V, F, coordinates(isothermal(r) / isothermal(1.0) * _unit(np.angle(z)))


@typed
def spheroid(levels: int, height: float = 1.5) -> tuple[Floats, Ints, Floats]:
    """Triangulate a spheroid, with its map onto the sphere by its conformal latitude.

    Parameters
    ----------
    levels : int
        How often the faces of an icosahedron are split into four.
    height : float
        Half-axis along z, positive; the others are 1.

    Returns
    -------
    V : (n, 3) float64
    F : (m, 3) int64
        Counterclockwise seen from outside.
    points : (n, 3) float64
        Exact conformal map of the vertices onto the unit sphere, with the conformal barycentre
        at 0.

    Raises
    ------
    ValueError
        If `levels` is negative or above 13, or `height` not positive.

    References
    ----------
    J. P. Snyder. Map Projections: A Working Manual. U.S. Geological Survey, 1987. Eq. (3-1).

    Examples
    --------
    >>> from cdcp_igl.datasets import spheroid
    >>> V, F, points = spheroid(2, height=2)
    >>> V.max(axis=0).round(6), len(V)
    (array([1., 1., 2.]), 162)
    """
    if not 0 <= levels <= MOST_LEVELS:
        raise ValueError(f"levels must be from 0 to {MOST_LEVELS}, not {levels!r}")
    if not 0 < height < np.inf:
        raise ValueError(f"height must be positive, not {height!r}")
    golden = (1 + np.sqrt(5)) / 2
    V = np.array([[0, s, t * golden] for s in (-1.0, 1) for t in (-1, 1)])
    V = np.vstack([V, V[:, [2, 0, 1]], V[:, [1, 2, 0]]])
    F = np.array(list(combinations(range(12), 3)))
    F = F[(np.linalg.norm(V[F] - V[np.roll(F, 1, axis=1)], axis=2) < 3).all(axis=1)]
    outwards = np.linalg.det(V[F]) > 0
    F = np.where(outwards[:, None], F, F[:, ::-1])
    for _ in range(levels):
        V, F = libigl.upsample(V, F)
    V /= np.linalg.norm(V, axis=1)[:, None]
    r, z = np.hypot(V[:, 0], V[:, 1]), V[:, 2]
    # The sine of the geographic latitude, of which z is that of the reduced one.
    sine = z / np.hypot(z, height * r)
    if height > 1:
        eccentricity = np.sqrt(height**2 - 1)
        shift = eccentricity * np.arctan(eccentricity * sine)
    else:
        eccentricity = np.sqrt(1 - height**2)
        shift = -eccentricity * np.arctanh(eccentricity * sine)
    # r exp(-q) etc. of the isometric latitude q, without dividing by r at the poles.
    up, down = (1 + sine) * np.exp(shift), (1 - sine) * np.exp(-shift)
    equatorial = 2 * np.sqrt((1 - sine) * (1 + sine)) / (up + down)
    around = V[:, :2] / np.maximum(r, np.finfo(float).tiny)[:, None]
    points = np.column_stack([equatorial[:, None] * around, (up - down) / (up + down)])
    return V * [1, 1, height], F, points


def _rings(resolution: int) -> tuple[Complex, Ints]:
    """Triangulate the unit disk by rings of 6, 12, 18, ... vertices about 0."""
    _check_resolution(resolution)
    ring = np.repeat(np.arange(resolution + 1), np.maximum(6 * np.arange(resolution + 1), 1))
    first = 1 + 3 * np.arange(-1, resolution + 1) * np.arange(resolution + 2)
    first[0] = 0
    place = np.arange(len(ring)) - first[ring]
    z = ring / resolution * _unit(2 * np.pi * place / np.maximum(6 * ring, 1))

    faces = []
    for r in range(1, resolution + 1):
        outer = np.arange(6 * r)
        sector, step = np.divmod(outer, r)
        inner = sector * (r - 1) + step  # the vertex inside, ring r - 1 has r - 1 a sector

        def at(ring: int, place: Ints) -> Ints:
            return first[ring] + place % max(6 * ring, 1)

        faces.append(np.column_stack([at(r, outer), at(r, outer + 1), at(r - 1, inner)]))
        between = step > 0
        faces.append(
            np.column_stack(
                [at(r, outer[between]), at(r - 1, inner[between]), at(r - 1, inner[between] - 1)]
            )
        )
    return z, np.concatenate(faces)


def _check_resolution(resolution: int) -> None:
    if not 1 <= resolution <= MOST_RINGS:
        raise ValueError(
            f"resolution must be at least 1 and at most {MOST_RINGS:,}, not {resolution!r}"
        )


def _unit(angle: Floats) -> Complex:
    return np.cos(angle) + 1j * np.sin(angle)


def _jacobi(z: Complex, m: float) -> tuple[Complex, Complex]:
    """Jacobi's sn and dn of complex argument, by the addition theorem."""
    from scipy.special import ellipj  # slow to import

    s, c, d, _ = ellipj(z.real, m)
    s1, c1, d1, _ = ellipj(z.imag, 1 - m)
    below = c1**2 + m * s**2 * s1**2
    return (
        (s * d1 + 1j * c * d * s1 * c1) / below,
        (d * c1 * d1 - 1j * m * s * c * s1) / below,
    )
