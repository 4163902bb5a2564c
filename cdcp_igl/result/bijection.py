"""A bijection of a triangulated surface, and what one can carry through it."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import typed
from ..arrays import Complex, Floats, Ints, as_complex, coordinates, unit_size
from ..cached import cached_property
from ..errors import counted
from ..fields import Field, Method
from ..surface.location import FaceFinder
from ..surface.mesh import Mesh
from ..surface.triangles import corner_cotangents, degenerate_faces
from .base import Result

log = logging.getLogger("cdcp_igl")

# Between the circle and the lattice, in sides. Among 0.4, 0.45, ..., 0.9 this has the largest
# smallest angle, 31 degrees, over sides from 1 to 0.01.
MARGIN = 0.8
CORNER = 0.2  # least height of a corner that gets a point, by the chord that would cut it off
SUM_TOLERANCE = 1e-6  # barycentric coordinates that add up to 1 no better are a mistake

# Landmarks are left or right where, in the median, they miss by more than the first, of the size of
# what they span, and by less than the second of that if one surface is mirrored.
MISSED, BETTER = 0.01, 0.5


class Registered(np.ndarray[Any, np.dtype[np.float64]]):
    """The vertices of a surface (n, 2) or (n, 3) in the map of another, as `register` lays them.

    Attributes
    ----------
    residual : (k,) float64
        How far each landmark is from its partner, on the other surface and in its unit.
    mirrored : (k,) float64
        How far it would be if the surface were mirrored.
    """

    residual: Floats
    mirrored: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Bijection(Result):
    """A map of a surface onto its image in the plane, or the sphere, there and back.

    A point of the surface is a face and barycentric coordinates in it; the map is linear on
    every face. That onto the sphere is linear, and then goes along the ray from 0. The plane is
    that of `uv`; of a SurfaceMap, whose charts lie on one another there, that of `packed`.
    """

    _columns: ClassVar[int] = 2  # of the images
    _inscribed: ClassVar[bool] = True  # in the unit circle

    @property
    def _images(self) -> Floats:
        """The images (n, 2) or (n, 3) of the vertices."""
        return self.uv

    @cached_property
    def _finder(self) -> FaceFinder:
        """Locates points among them."""
        z = self._in_plane(self._images)
        return FaceFinder(self._faces, z, inscribed=self._inscribed)

    def __getstate__(self) -> dict[str, Any]:
        return {name: x for name, x in vars(self).items() if name != "_finder"}  # trees stay here

    @typed
    def apply(self, face: ArrayLike, barycentric: ArrayLike) -> Floats:
        """Map points of the surface to the plane, or to the sphere.

        Parameters
        ----------
        face : (...) array_like of integers
            Rows of F.
        barycentric : (..., 3) array_like
            Weights of the three corners of the face, which add up to 1.

        Returns
        -------
        (..., 2) float64
            Of a SphereMap (..., 3), on the unit sphere; of a SurfaceMap, where `packed` lays them.
            See `invert` for an example.

        Raises
        ------
        ValueError
            If a face is none of the mesh, or weights do not add up to 1.
        """
        rows, weights = np.asarray(face), np.asarray(barycentric, dtype=np.float64)
        if rows.dtype.kind not in "iu" or weights.shape != (*rows.shape, 3):
            raise ValueError(
                f"face must be integers and barycentric have three columns for each; they are "
                f"{rows.dtype} {rows.shape} and {weights.shape}"
            )
        if rows.size and not (rows.min() >= 0 and rows.max() < self._size()[1]):
            raise ValueError(f"faces must lie in 0..{self._size()[1] - 1}")
        if not (abs(weights.sum(axis=-1) - 1) <= SUM_TOLERANCE).all():
            raise ValueError("barycentric coordinates must add up to 1")
        return np.einsum("...k,...kc->...c", weights, self._corner_images(rows))

    @typed
    def invert(self, uv: ArrayLike) -> tuple[Ints, Floats]:
        """Find the points of the surface whose images are given.

        Parameters
        ----------
        uv : (..., 2) array_like
            Points of the plane. Of a SphereMap (..., 3), directions from 0 of any length but 0; of
            a SurfaceMap, points of the unit square, where `packed` lays the charts.

        Returns
        -------
        face : (...) int64
            -1 outside of the image and in holes. Of a point on an edge or on a vertex, one of
            the faces there. Points within 1e-6 of the rim are taken to it, so that coordinates in
            single precision, or with six digits, have a place; the unit is the largest
            coordinate.
        barycentric : (..., 3) float64
            Not negative; NaN where there is no face. Maps onto the disk and the ring cover the
            polygon inscribed in the circle: points between an edge of it and its arc are taken to
            the nearest point of the edge, so that all of the disk has a place on the surface.

        Raises
        ------
        ValueError
            If a coordinate is not finite, or there are not two, of a SphereMap three; or the map
            is no bijection.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> result = cdcp_igl.disk_map(V, F)
        >>> face, barycentric = result.invert([[0.3, 0.4], [2, 0]])
        >>> result.apply(face[0], barycentric[0]).round(12)
        array([0.3, 0.4])
        >>> print(face[1])
        -1
        """
        points = np.asarray(uv, dtype=np.float64)
        if points.ndim == 0 or points.shape[-1] != self._columns:
            raise ValueError(f"uv has shape {points.shape}; it must have {self._columns} columns")
        if not np.isfinite(points).all():
            raise ValueError("uv must be finite")
        if not self.valid:
            raise ValueError("the map is no bijection: points have no one place on the surface")
        face, barycentric = self._located(points.reshape(-1, self._columns))
        return face.reshape(points.shape[:-1]), barycentric.reshape(*points.shape[:-1], 3)

    @typed
    def interpolate(
        self, values: ArrayLike, uv: ArrayLike, *, method: Method | None = None
    ) -> Floats:
        """Interpolate values at the vertices to points of the plane, or of the sphere.

        Parameters
        ----------
        values : (n, ...) array_like
            A row a vertex of the given mesh: positions, colours, a field, labels. What is masked
            is NaN.
        uv : (..., 2) array_like
            Points as in `invert`.
        method : {"linear", "nearest"}, optional
            Between the corners of a face linear, or as at the nearest of them by barycentric
            coordinates: the default of integers and truth values, which are labels.

        Returns
        -------
        (..., ...) float64
            NaN where there is no face, and where a corner that counts is NaN.

        Raises
        ------
        ValueError
            If `values` has not a row for each vertex or is complex, or as `invert`.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> abs(cdcp_igl.disk_map(V, F).interpolate(V, [0, 0])).round(2)
        array([0., 0., 1.])
        """
        field = self._field(values, method)
        face, barycentric = self.invert(uv)
        # Where there is no face, those of the last one, with weights that are NaN.
        found = field.at(self._corners(face.ravel()), barycentric.reshape(-1, 3))
        return found.reshape(face.shape + field.values.shape[1:])

    def _corners(self, face: Ints) -> Ints:
        """Vertices (..., 3) of faces, rows of the given mesh."""
        return self._faces[face]

    def _corner_images(self, face: Ints) -> Floats:
        """Images (..., 3, c) of the corners of faces."""
        return self._images[self._faces[face]]

    def _located(self, points: Floats) -> tuple[Ints, Floats]:
        """Locate points (k, 2) or (k, 3)."""
        return self._finder.locate(self._in_plane(points))[:2]

    def _in_plane(self, points: Floats) -> Complex:
        """(k,) points of the plane, in a unit in which those of the map are at most 1."""
        return as_complex(points)

    def _landmarks(self, to: Bijection, landmarks: ArrayLike) -> tuple[Floats, Floats]:
        """Images of landmarks in this map and in the other; ValueError if they are none."""
        pairs = np.asarray(landmarks)
        if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
            raise ValueError(f"landmarks must be (k, 2) integers, not {pairs.dtype} {pairs.shape}")
        if not ((pairs >= 0) & (pairs < [self._size()[0], to._size()[0]])).all():
            raise ValueError("landmarks must be vertices of the two surfaces")
        if min(len(np.unique(column)) for column in pairs.T) < 2:
            raise ValueError("two landmarks or more are needed, at different vertices")
        return self._images[pairs[:, 0]], to._images[pairs[:, 1]]

    def _registered(
        self,
        images: Floats,
        to: Bijection,
        landmarks: ArrayLike,
        fitted: Callable[[Floats, Floats], Floats],
    ) -> Registered:
        """Say how well landmarks meet, `fitted` (k, c) to those of the other map."""
        here, there = self._landmarks(to, landmarks)
        V, goal = to._surface()[0], np.asarray(landmarks)[:, 1]
        in_mirror = here * np.where(np.arange(here.shape[1]) == 1, -1, 1)
        registered = images.view(Registered)
        registered.residual, registered.mirrored = (
            np.linalg.norm(to.interpolate(V, fitted(points, there)) - V[goal], axis=1)
            for points in (here, in_mirror)
        )
        miss, mirrored = (np.median(x) for x in (registered.residual, registered.mirrored))
        if miss > MISSED * np.linalg.norm(np.ptp(V[goal], axis=0)) and mirrored < BETTER * miss:
            log.warning(
                "landmarks miss by %.3g in the median, and by %.3g if one surface is mirrored, to "
                "V * [-1, 1, 1], F[:, ::-1]: are left and right exchanged?",
                miss,
                mirrored,
            )
        return registered


@dataclass(frozen=True, eq=False, repr=False)
class DiskBijection(Bijection):
    """A map of a triangulated disk onto the polygon inscribed in the unit circle."""

    mesh: Mesh
    _f: Complex

    @typed
    def pull_back(self, values: ArrayLike, *, method: Method | None = None) -> Floats:
        """Pull an image of the disk back to the vertices of the surface.

        Parameters
        ----------
        values : (height, width, ...) array_like
            Over the square from (-1, -1) to (1, 1), the top row at v = 1: a texture, or
            samples of a function of the disk at the centres of the pixels. What is masked is NaN.
        method : {"linear", "nearest"}, optional
            Between the pixels bilinear, or as the nearest: the default of integers and truth
            values.

        Returns
        -------
        (n, ...) float64
            At each vertex the value at its image. A function g
            that can be evaluated anywhere needs no image: ``g(result.uv)``.

        Raises
        ------
        ValueError
            If `values` is no image, or complex.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> result = cdcp_igl.disk_map(V, F)
        >>> heights = result.pull_back(result.bake(V[:, 2]))
        >>> bool(abs(heights - V[:, 2]).max() < 0.01)
        True
        """
        image = Field.of(values, method)
        shape = image.values.shape
        if len(shape) < 2 or image.values.size == 0:
            raise ValueError(f"values has shape {shape}; it must be (height, width, ...)")
        pixels = replace(image, values=image.values.reshape(-1, *shape[2:]))
        return pixels.at(*_bilinear(shape[0], shape[1], self._f))

    @typed
    def remesh(self, side: float) -> tuple[Floats, Ints, Floats]:
        """Mesh the surface anew by a regular mesh of the disk.

        A lattice of equilateral triangles in the disk and a ring on the circle are carried
        back to the surface. A conformal map keeps their shape; their size varies with its
        scale, least with ``mobius="area"``. Points of the ring move to the corners of the
        boundary that are near.

        Between a boundary edge and its arc the disk has no surface but the edge (see `invert`).
        Where an edge is longer on the disk than about the root of ``8 * side``, whole triangles
        lie there, and their faces have no area. ``cdcp_igl.check(V, F)`` lists them, and a
        warning is logged; a larger side helps, or to split such edges before the map.

        Parameters
        ----------
        side : float
            Of the triangles in the disk, from 0 to 1.

        Returns
        -------
        V : (k, 3) float64
            Points of the surface. Those of the boundary come first, counterclockwise.
        F : (m, 3) int64
            A disk by its topology, oriented as the surface is.
        uv : (k, 2) float64
            The lattice: the map of the new mesh.

        Raises
        ------
        ValueError
            If `side` is not between 0 and 1.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spherical_cap(10)
        >>> W, G, uv = cdcp_igl.disk_map(V, F).remesh(0.1)
        >>> cdcp_igl.check(W, G).is_disk
        True
        """
        if not 0 < side <= 1:
            raise ValueError(f"side must be between 0 and 1, not {side!r}")
        V, loop = self.mesh.scaled, self.mesh.loop
        ring = even_ring(side)
        ring = with_corners(ring, self._f[loop], self.interpolate(V, coordinates(ring)), V[loop])
        z, F = disk_lattice(side, ring)
        uv = coordinates(z)
        W = self.interpolate(self.mesh.V, uv)
        flat = degenerate_faces(corner_cotangents(unit_size(W), F))
        if len(flat):
            faces = counted(len(flat), "new face has", "new faces have")
            log.warning("%s no area, between a boundary edge and its arc", faces)
        return W, F, uv

    @cached_property
    def _finder(self) -> FaceFinder:
        return FaceFinder(self.mesh.F, self._f, self.mesh.edges, inscribed=True)


def _bilinear(height: int, width: int, z: Complex) -> tuple[Ints, Floats]:
    """(k, 4) pixels around points z (k,) of the square from -1 to 1, row by row, and weights.

    The top row lies at v = 1. Between the rim and the outermost pixel centres, these count.
    """
    row = np.clip((1 - z.imag) / 2 * height - 0.5, 0, height - 1)
    column = np.clip((1 + z.real) / 2 * width - 0.5, 0, width - 1)
    top, left = row.astype(np.int64), column.astype(np.int64)
    bottom, right = np.minimum(top + 1, height - 1), np.minimum(left + 1, width - 1)
    down, across = row - top, column - left
    above, below = top * width, bottom * width
    corners = [above + left, above + right, below + left, below + right]
    weights = [(1 - down) * (1 - across), (1 - down) * across, down * (1 - across), down * across]
    return np.stack(corners, axis=1), np.stack(weights, axis=1)


def even_ring(side: float) -> Complex:
    """(k,) points of the unit circle, counterclockwise from 1, about `side` apart."""
    return np.exp(2j * np.pi * np.linspace(0, 1, round(2 * np.pi / side), endpoint=False))


def with_corners(ring: Complex, loop: Complex, V_ring: Floats, V_loop: Floats) -> Complex:
    """Move points of an even ring to the corners of a boundary.

    A vertex is a corner if it lies far from the chord between the two points of the ring next
    to it. The farthest come first, and no two points come nearer than half of their distance.

    `loop` (nB,) are the boundary vertices on the unit circle; `V_ring` and `V_loop` are where the
    points of the ring (k,) and of the loop lie on the surface.
    """
    step = 2 * np.pi / len(ring)
    angle = np.angle(loop) % (2 * np.pi) / step  # in distances of the ring, as all angles here
    before = angle.astype(np.int64) % len(ring)
    start, end = V_ring[before], V_ring[(before + 1) % len(ring)]
    along, away = end - start, V_loop - start
    length = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    share = np.clip((along * away).sum(axis=1) / length, 0, 1)
    height = np.linalg.norm(away - share[:, None] * along, axis=1) / np.sqrt(length)
    corners = np.flatnonzero(height > CORNER)
    shift = np.zeros(len(ring))
    moved = ring.copy()
    for corner in corners[np.argsort(-height[corners], kind="stable")]:
        nearest = round(angle[corner])
        by, here = angle[corner] - nearest, nearest % len(ring)
        behind, ahead = shift[here - 1], shift[(here + 1) % len(ring)]
        if shift[here] == 0 and 1 + by - behind >= 0.5 and 1 + ahead - by >= 0.5:
            shift[here], moved[here] = by, loop[corner]
    return moved


def disk_lattice(side: float, ring: Complex) -> tuple[Complex, Ints]:
    """Mesh the unit disk by a lattice of equilateral triangles and a ring on the circle.

    The points of the ring are about as far apart as the triangles are wide, `side`. Returns the
    vertices, those of the ring first, and their Delaunay triangulation, counterclockwise.
    """
    from scipy.spatial import Delaunay  # slow to import, and only a lattice uses it

    reach = int(2 / side) + 1
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    inner = side * (column + row * np.exp(1j * np.pi / 3)).ravel()
    inner = inner[abs(inner) < 1 - MARGIN * side]
    z = np.concatenate([ring, inner])
    F = Delaunay(coordinates(z)).simplices.astype(np.int64)
    a, b, c = z[F.T]
    clockwise = ((b - a).conj() * (c - a)).imag < 0
    F[clockwise] = F[clockwise, ::-1]
    return z, F
