"""Measures of distortion: angular, eq. (7), quasi-conformal, and of length and area."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import libigl
from ..arrays import Bools, Complex, Floats, Ints, as_complex, size_exponent
from ..docstrings import like
from ..io.given import takes_meshes
from ..surface.mesh import Mesh
from ..surface.triangles import blocks, face_areas, hat_gradients, opposite_edges, oriented_areas
from ..surface.validation import checked_surface, checked_vertices

DENSITIES = 0.05, 0.95  # by area
ON_SPHERE = 1e-6  # points may be so far from the unit sphere, as in single precision


@dataclass(frozen=True)
class AngleDistortion:
    """Mean, standard deviation and maximum of the angular distortion over all corners.

    Attributes
    ----------
    mean, sd, max : float
        Degrees. `mean` and `sd` are the two numbers of the paper's Table 1.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, uv = cdcp_igl.datasets.ellipse(40)
    >>> print(cdcp_igl.AngleDistortion.of(cdcp_igl.angle_distortion(V, F, uv)))
    mean 0.6330, SD 0.3954, max 1.76 degrees
    """

    mean: float
    sd: float
    max: float

    @classmethod
    def of(cls, degrees: Floats) -> AngleDistortion:
        """Summarise an (m, 3) array that `angle_distortion` returned."""
        return cls(float(degrees.mean()), float(degrees.std()), float(degrees.max()))

    def __str__(self) -> str:
        return f"mean {self.mean:.4f}, SD {self.sd:.4f}, max {self.max:.2f} degrees"


@dataclass(frozen=True)
class AreaDistortion:
    """How far the scale of a map is from being constant.

    Attributes
    ----------
    sd : float
        Standard deviation, over the faces, of the logarithm of the area in the image by that on
        the surface; infinite if a face is flipped or has collapsed.
    texels : float
        Density of texels: how many times longer lengths are in the image where this is so for 95
        percent of the surface at most, than where it is for 5 percent.

    Examples
    --------
    >>> import numpy as np
    >>> import cdcp_igl
    >>> print(cdcp_igl.AreaDistortion.of(np.array([1.0, 4.0]), np.array([1.0, 1.0])))
    SD 0.6931 of log areas, texel density within 2
    """

    sd: float
    texels: float

    @classmethod
    def of(cls, ratio: Floats, area: Floats) -> AreaDistortion:
        """Summarise areas in the image by those on the surface, and the latter (m,)."""
        ratio, area = ratio[area > 0], area[area > 0]
        low, high = weighted_quantiles(ratio, area, DENSITIES)
        sd = float(np.log(ratio).std()) if ratio.min() > 0 else np.inf
        return cls(sd, float(np.sqrt(high / low)) if low > 0 else np.inf)

    def __str__(self) -> str:
        return f"SD {self.sd:.4f} of log areas, texel density within {self.texels:.3g}"


def weighted_quantiles(x: Floats, weights: Floats, shares: tuple[float, ...]) -> Floats:
    """(k,) the values x (m,) that these shares of the weight do not exceed."""
    order = np.argsort(x)
    sums = np.cumsum(weights[order])
    found: Floats = x[order][np.searchsorted(sums, np.asarray(shares) * sums[-1])]
    return found


@takes_meshes
def angle_distortion(V: ArrayLike, F: ArrayLike, uv: ArrayLike) -> Floats:
    """Absolute change of every corner angle, eq. (7).

    Parameters
    ----------
    V : (n, 3) or (n, 2) array_like
        Vertex positions of the surface.
    F : (m, 3) array_like of integers
        Corners of the faces. The surface need not be a disk.
    uv : (n, 2) or (n, 3) array_like
        Positions in the plane, or on the unit sphere, whose faces are straight.

    Returns
    -------
    (m, 3) float64
        Degrees; column k belongs to corner k of the face. The angles of a flipped face
        count as negative, so that it is never taken for a conformal one.

    Raises
    ------
    MeshError
        If V and F are no triangle mesh, or a coordinate is not finite.
    ValueError
        If `uv` does not have two or three columns and a row for each row of V, or is
        in space but not on the unit sphere.

    Examples
    --------
    A square stretched to twice its width:

    >>> import cdcp_igl
    >>> V = [[0, 0], [1, 0], [1, 1], [0, 1]]
    >>> F = [[0, 1, 2], [0, 2, 3]]
    >>> uv = [[0, 0], [2, 0], [2, 1], [0, 1]]
    >>> cdcp_igl.angle_distortion(V, F, uv).round(2)
    array([[18.43,  0.  , 18.43],
           [18.43, 18.43,  0.  ]])
    """
    positions, faces, image = _surface_and_points(V, F, uv, (2, 3))
    plane = image.shape[1] == 2
    size = libigl.double_areas(image, faces) if plane else np.linalg.det(image[faces])
    return reported_distortion(positions, faces, image, size < 0)


@takes_meshes
@like(angle_distortion)
def quasi_conformal_dilatation(V: ArrayLike, F: ArrayLike, uv: ArrayLike) -> Floats:
    """Ratio of the singular values of the map on every face, the larger by the smaller.

    K = (|f_z| + |f_zbar|) / (|f_z| - |f_zbar|), with z a coordinate in the plane of the
    face: circles become ellipses with axes K : 1.

    Parameters
    ----------
    uv : (n, 2) array_like
        Positions in the plane.

    Returns
    -------
    (m,) float64
        At least 1, which is conformal; infinity for a flipped or collapsed face.

    References
    ----------
    L. V. Ahlfors. Lectures on Quasiconformal Mappings. Van Nostrand, 1966.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F = [[0, 0], [1, 0], [1, 1], [0, 1]], [[0, 1, 2], [0, 2, 3]]
    >>> stretched = [[0, 0], [2, 0], [2, 1], [0, 1]]
    >>> cdcp_igl.quasi_conformal_dilatation(V, F, stretched)
    array([2., 2.])
    """
    positions, faces, image = _surface_and_points(V, F, uv, (2,))
    return face_dilatation(positions, faces, as_complex(image))


@takes_meshes
@like(angle_distortion)
def conformal_factor(V: ArrayLike, F: ArrayLike, uv: ArrayLike) -> Floats:
    """Logarithm of the scale of the map at every vertex.

    Two triangles are conformally equivalent with factors u at their vertices if each edge
    satisfies log(length in the plane / length on the surface) = (u_i + u_j) / 2. Every
    triangle determines its three factors; at a vertex they are averaged over its faces. A
    discrete conformal equivalence, such as a Möbius transformation of the plane, has its
    factors recovered exactly.

    Returns
    -------
    (n,) float64
        A short length on the surface is e^u as long in the plane, each in its own unit.
        Lengths do not see flipped faces. Minus infinity at the vertices of a face with an
        edge of length 0; NaN at vertices without faces.

    References
    ----------
    B. Springborn, P. Schröder, U. Pinkall. Conformal equivalence of triangle meshes. ACM
    Trans. Graph. 27(3), 2008.

    Examples
    --------
    An enlargement, and lengths in another unit:

    >>> import cdcp_igl
    >>> V, F = [[0, 0], [1, 0], [1, 1], [0, 1]], [[0, 1, 2], [0, 2, 3]]
    >>> uv = [[0, 0], [2, 0], [2, 2], [0, 2]]
    >>> cdcp_igl.conformal_factor(V, F, uv).round(3)
    array([0.693, 0.693, 0.693, 0.693])
    """
    positions, faces, image = _surface_and_points(V, F, uv, (2, 3))
    scale = np.empty(faces.shape)  # column k belongs to the edge opposite corner k
    with np.errstate(divide="ignore", invalid="ignore"):
        for k in range(3):
            i, j = faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
            length = np.linalg.norm(positions[i] - positions[j], axis=1)
            scale[:, k] = np.log(np.linalg.norm(image[i] - image[j], axis=1) / length)
        u = scale.sum(axis=1, keepdims=True) - 2 * scale
        u[~np.isfinite(u).all(axis=1)] = -np.inf
        corners = np.bincount(faces.ravel(), minlength=len(image))
        mean = np.bincount(faces.ravel(), u.ravel(), len(image)) / corners
    # The coordinates have been scaled to unit size by powers of two: back to their units.
    exponent = size_exponent(np.asarray(uv)) - size_exponent(np.asarray(V))
    return mean + exponent * np.log(2)


@takes_meshes
@like(angle_distortion)
def area_distortion(V: ArrayLike, F: ArrayLike, uv: ArrayLike) -> Floats:
    """Logarithm of the area of the image by the area on the surface, for every face.

    Both areas are fractions of their totals, so that a map with a constant scale has no
    distortion of area.

    Returns
    -------
    (m,) float64
        0 is no distortion. The area of a flipped face counts as 0, and its distortion is
        minus infinity, like that of a collapsed one.

    References
    ----------
    M.-H. Yueh, W.-W. Lin, C.-T. Wu, S.-T. Yau. A novel stretch energy minimization
    algorithm for equiareal parameterizations. J. Sci. Comput. 78, 2019.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F = [[0, 0], [1, 0], [1, 1], [0, 1]], [[0, 1, 2], [0, 2, 3]]
    >>> cdcp_igl.area_distortion(V, F, [[0, 0], [3, 0], [3, 1], [0, 1]])
    array([0., 0.])
    """
    positions, faces, points = _surface_and_points(V, F, uv, (2, 3))
    if points.shape[1] == 2:
        image = np.maximum(oriented_areas(as_complex(points), faces)[0], 0)
    else:
        image = np.where(np.linalg.det(points[faces]) > 0, face_areas(points, faces), 0)
    surface = face_areas(positions, faces)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (image / image.sum()) / (surface / surface.sum())
        return np.where(ratio > 0, np.log(ratio), -np.inf)


def _surface_and_points(
    V: ArrayLike, F: ArrayLike, uv: ArrayLike, columns: tuple[int, ...]
) -> tuple[Floats, Ints, Floats]:
    positions, faces = checked_surface(V, F)
    shapes = [(len(positions), k) for k in columns]
    if np.shape(uv) not in shapes:
        raise ValueError(
            f"uv has shape {np.shape(uv)}, V has {len(positions)} rows: uv must be "
            + " or ".join(f"(n, {k})" for k in columns)
        )
    image = checked_vertices(uv, "uv")
    if np.shape(uv)[1] == 2:
        return positions, faces, image[:, :2]
    if (abs(np.linalg.norm(uv, axis=1) - 1) > ON_SPHERE).any():
        raise ValueError("uv (n, 3) must lie on the unit sphere, as the points of a SphereMap do")
    return positions, faces, image


def _angles(V: Floats, F: Ints) -> Floats:
    """(m, 3) unsigned corner angles in radians; 0 at the ends of edges without length."""
    angles = libigl.angles(V, F)
    if np.isnan(angles.sum()):
        angles[np.isnan(angles)] = 0
    return angles


def _signed_angles(P: Floats, F: Ints, flipped: Bools | Ints) -> Floats:
    """(m, 3) corner angles in radians, negative in flipped faces."""
    angles = _angles(P, F)
    angles[flipped] *= -1
    return angles


def sphere_angle_errors(mesh: Mesh, P: Floats, flipped: Ints) -> Floats:
    """(m, 3) as `angle_errors`, of a map (n, 3) onto the sphere whose faces are straight."""
    return _signed_angles(P, mesh.F, flipped) - mesh.angles


def reported_distortion(V: Floats, F: Ints, image: Floats, flipped: Bools | Ints) -> Floats:
    """(m, 3) `angle_distortion` by libigl's angles, the `flipped` faces being known."""
    # By a power of two, which is exact: libigl squares lengths, in whatever unit the image is.
    image = np.ldexp(image, -size_exponent(image))
    return np.degrees(abs(_signed_angles(image, F, flipped) - _angles(V, F)))


def map_distortion(mesh: Mesh, f: Complex) -> Floats:
    """(m, 3) `angle_distortion` of a map f (n,) without collapsed faces, in a fifth of the time.

    With c the cotangent on the surface and p, q the edges at the corner in the plane, the error is
    the argument of (c + i) conj(p) q, up to conjugation, which is small where the error is: no
    angle of the surface is needed, and digits are not lost.
    """
    errors = np.empty((3, len(mesh.F)))
    for part in blocks(len(mesh.F)):
        i, j, k = f.take(mesh.F[part].T)
        u, v, w = j - i, k - j, i - k  # each leaves its corner
        twice_area = u.real * v.imag - u.imag * v.real
        sides = (u, w), (v, u), (w, v)
        for (p, q), c, out in zip(sides, mesh.cotangents[part].T, errors[:, part], strict=True):
            cosine = -(p.real * q.real + p.imag * q.imag)
            sine, cosine = c * twice_area - cosine, c * cosine + twice_area
            if cosine.min() > 0:
                np.arctan(sine / cosine, out=out)  # in half the time
            else:
                np.arctan2(sine, cosine, out=out)
    np.abs(errors, out=errors)  # in place: new pages take as long as the angles
    return np.degrees(errors, out=errors).T


def angle_errors(mesh: Mesh, f: Complex) -> Floats:
    """(m, 3) corner angles of a map f (n,) minus those of the surface, in radians."""
    errors = np.empty_like(mesh.angles)
    for part in blocks(len(errors)):
        errors[part] = plane_angles(f, mesh.F[part]) - mesh.angles[part]
    return errors


def plane_angles(z: Complex, F: Ints) -> Floats:
    """(m, 3) corner angles in radians of plane triangles, negative in clockwise ones.

    0 or pi, never NaN, in triangles that have collapsed.
    """
    return angles_between(*z.take(F.T)).T


def angles_between(i: Complex, j: Complex, k: Complex) -> Floats:
    """(3, m) as `plane_angles`, of triangles with these corners; row by row a corner."""
    u, v, w = j - i, k - j, i - k  # each leaves its corner
    twice_area = u.real * v.imag - u.imag * v.real
    angles = np.empty((3, len(u)))
    for (ahead, back), out in zip([(u, w), (v, u), (w, v)], angles, strict=True):
        cosine = -(ahead.real * back.real + ahead.imag * back.imag)
        np.arctan2(twice_area, cosine, out=out)
    return angles


def wirtinger_derivative(V: Floats, F: Ints) -> Complex:
    """(m, 3) coefficients of df/dz: p = sum of coefficient times value over the corners.

    z is a coordinate of the face's own plane; q = df/d conj(z) has the conjugates.
    """
    corner = np.zeros(F.shape, dtype=np.complex128)
    corner[:, 1], corner[:, 2] = _plane_triangles(V, F)
    twice_area = corner[:, 1].real * corner[:, 2].imag
    return hat_gradients(opposite_edges(corner), twice_area).conj() / 2


def _plane_triangles(V: Any, F: Ints) -> tuple[Floats, Complex]:
    """Second and third corner of each face laid into the plane with its first corner at 0."""
    i, j, k = V.take(F.T, axis=0)  # in less time than by indexing
    # By coordinate: sums over short rows take long.
    e, g = (np.ascontiguousarray((end - i).T) for end in (j, k))
    length = np.sqrt((e * e).sum(axis=0))
    return length, ((e * g).sum(axis=0) + 1j * libigl.double_areas(V, F)) / length


def face_dilatation(V: Floats, F: Ints, z: Complex | Floats) -> Floats:
    """(m,) `quasi_conformal_dilatation` of a map z (n,), or into space (n, 3), without checks."""
    K = np.full(len(F), np.inf)
    i, j, k = F.T
    with np.errstate(divide="ignore", invalid="ignore"):  # of faces without area on the surface
        length, third = _plane_triangles(V, F)
        # The derivatives from differences, which are accurate on tiny faces too.
        e, g = (z[j] - z[i], z[k] - z[i]) if np.iscomplexobj(z) else _plane_triangles(z, F)
        f_x = e / length
        f_y = (g - third.real * f_x) / third.imag
        p, q = abs(f_x - 1j * f_y), abs(f_x + 1j * f_y)
    np.divide(p + q, p - q, out=K, where=p > q)
    return K
