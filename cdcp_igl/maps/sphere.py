"""A closed surface of genus 0, mapped conformally onto the unit sphere."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Bools, Complex, Floats, Indices, Ints, coordinates
from ..cached import cached_property
from ..descent.descent import from_tutte
from ..descent.targets import Sphere
from ..docstrings import like
from ..errors import MapError, MeshError, counted
from ..io.given import takes_meshes
from ..options import Options
from ..phases import Phases, Progress
from ..plot.layout import Layout
from ..rescue.boundary import BoundaryMethod
from ..rescue.repair import repair_locally
from ..rescue.untangling import over_hemispheres, repaired_on_sphere, without_pole
from ..result.base import announced, how_made, valid_map
from ..result.bijection import Registered
from ..result.making import MadeMap, best_of, fields_of, refined, steps_of
from ..solve.factored import FactoredSurface
from ..solve.laplacian import LAPLACIANS
from ..solve.solvers import SolverName, using
from ..steps.dipole import dipole_map
from ..steps.mobius import conformal_barycenter, mobius_transformation
from ..steps.stereographic import moved_to_center, rotation, spherical_barycenter, to_plane
from ..surface.filling import fill_hole
from ..surface.location import SphereFinder
from ..surface.mesh import SphereMesh
from ..surface.orientation import points_inward
from ..surface.topology import Topology
from ..surface.triangles import face_areas, flipped_faces
from ..surface.validation import checked_surface
from ..verdict.any_map import certify
from ..verdict.certificate import SphereCertificate, certify_sphere
from ..verdict.distortion import area_distortion, sphere_angle_errors
from .disk import disk_map

log = logging.getLogger("cdcp_igl")

HOLES = 0.05  # of the area of the surface: more is no hole
GAP = 0.01  # between the hemispheres of a chart, by their width


@dataclass(frozen=True, eq=False, repr=False)
class SphereMap(MadeMap):
    """A conformal map onto the unit sphere. Printing it gives a summary.

    Attributes
    ----------
    points : (n, 3) float64
        Row i is the image of row i of V, on the unit sphere. Faces are counterclockwise seen from
        outside; unless they point inward on the surface, too.
    uv : (m, 3, 2) float64
        A chart for pictures and textures: the corners of each face on one of two hemispheres,
        upper and lower, in stereographic projection side by side: to the left and to the right of
        0. Where that flips faces, the vertices near them are relaxed; where the chart overlaps
        itself all the same, upper and lower are along another axis, if that mends it.
    mesh : SphereMesh
        The surface, seen from outside; faces that fill holes come last.
    inward : bool
        True if the given faces point inward.
    filled : int
        Holes that were filled for the time of the map; those faces are not in the results.
    certificate : SphereCertificate
        What was verified about `points`.
    distortion : AngleDistortion
        Mean, SD and maximum of the angular distortion in degrees, between the faces of the surface
        and the straight triangles with their corners on the sphere.
    pole : int
        The vertex that carried the dipole, or was taken out for an embedding.
    mobius : {"area", "none"}
        What chose the Möbius transformation of the sphere.
    laplacian : str
        ``"cotangent"``; or, where that flipped faces, or its map is not conformal, and this
        distorts less, ``"intrinsic Delaunay"``; or ``"mean value"`` where neither is conformal, and
        an embedding, from which shear was lowered, leads nearer.
    conformality, repair, refinement, solver, timings
        As of a `DiskMap`.

    Examples
    --------
    >>> import cdcp_igl
    >>> V, F, exact = cdcp_igl.datasets.spheroid(4, height=1.5)
    >>> result = cdcp_igl.sphere_map(V, F)
    >>> result.valid, result.conformal, bool(abs(result.points - exact).max() < 0.02)
    (True, True, True)
    """

    points: Floats
    mesh: SphereMesh
    certificate: SphereCertificate
    pole: int
    mobius: str
    laplacian: str
    filled: int = 0
    inward: bool = False
    _n_faces: int | None = None

    _kind = "sphere"
    _plane = "Sphere"
    _reported = ("pole", "filled")
    _columns = 3

    def _made(self) -> dict[str, Any]:
        return how_made(self, BoundaryMethod("none", laplacian=self.laplacian), self.mobius)

    @property
    def is_embedded(self) -> bool:
        """Whether the map comes from an embedding by mean values."""
        return self.laplacian == "mean value"

    @property
    def uv(self) -> Floats:  # type: ignore[override]
        """(m, 3, 2) the chart of two hemispheres."""
        return self._chart[0]

    @cached_property
    def _chart(self) -> tuple[Floats, Bools, bool]:
        """(m, 3, 2) the chart, the faces (m,) that lie upwards, and whether it is one to one.

        It is seen along the first axis of three along which it is, or else along the third.
        """
        charts = []
        for turn in range(3):
            uv, upper = self._halves(np.roll(self.points, turn, axis=1))
            is_one_to_one = certify(*self._surface(), _in_square(uv)).valid
            charts.append((uv, upper, is_one_to_one))
            if is_one_to_one:
                return charts[-1]
        return charts[0]

    def _halves(self, P: Floats) -> tuple[Floats, Bools]:
        """Lay two halves of a map P (n, 3) side by side: (m, 3, 2), and (m,) the upper faces.

        Those reach farther up than down.
        """
        height = P[self.mesh.F[: self._n_faces], 2]
        uv, upper = np.empty((len(height), 3, 2)), height.min(axis=1) + height.max(axis=1) > 0
        for side in np.unique(np.where(upper, 1, -1)):
            faces = np.flatnonzero(upper == (side > 0))
            half, rows = self.mesh.part(faces)
            # Slivers and large faces may be flipped: their edges are straight here, and no arcs.
            f, _ = repair_locally(half, to_plane(P[rows], side), is_free=True)
            uv[faces] = coordinates(f - side * (1 + GAP) * (side * f.real).max())[half.F]
        return uv[:, :: -1 if self.inward else 1], upper

    @property
    def _faces(self) -> Ints:
        return self.mesh.F[: self._n_faces, :: -1 if self.inward else 1]

    @property
    def _turned(self) -> bool:
        return self.inward

    def packed(self) -> Floats:
        """Return the chart `uv` scaled into the unit square, (m, 3, 2): texture coordinates.

        Whether these overlap themselves, as they may where faces are large, or crowded, is logged:
        what is certified are `points`.
        """
        return self._texture

    @cached_property
    def _texture(self) -> Floats:
        if not self._chart[2]:
            log.warning(
                "the sphere's texture overlaps itself, or has flipped faces (cdcp_igl.certify says "
                "where): cut the surface for one without (cdcp_igl.surface_map, --cut)"
            )
        return _in_square(self.uv)

    def apply(self, face: ArrayLike, barycentric: ArrayLike) -> Floats:
        """Map points of the surface to the unit sphere, as `Bijection.apply`: (..., 3)."""
        straight = super().apply(face, barycentric)
        return straight / np.linalg.norm(straight, axis=-1)[..., None]

    def register(self, to: SphereMap, landmarks: ArrayLike) -> Registered:
        """Lay the map over that of another surface, by landmarks.

        Both spheres are centred, so that the landmarks have their conformal barycentre at 0; then
        this one is turned to bring them nearest. The result does not depend on the normalisation
        of the two maps. Of two landmarks only the rotation is sought.

        Parameters
        ----------
        to : SphereMap
            Of the other surface.
        landmarks : (k, 2) array_like of integers
            In each row a vertex of this surface and the vertex of the other that corresponds to
            it; at least two rows.

        Returns
        -------
        Registered
            The vertices (n, 3) of this surface on the sphere of the other, still a certified map:
            ``to.interpolate(values, points)`` carries what lives on the other surface to them. Its
            ``residual`` is as of `DiskMap.register`.

        Raises
        ------
        ValueError
            If `landmarks` is none of that.
        MapError
            If the landmarks ask for so strong a transformation that faces are flipped. Its
            ``result`` is this map with the points and the certificate that were refused.

        Examples
        --------
        >>> import cdcp_igl
        >>> V, F, _ = cdcp_igl.datasets.spheroid(3, 2)
        >>> one, other = cdcp_igl.sphere_map(V, F, mobius=None), cdcp_igl.sphere_map(V, F)
        >>> points = one.register(other, [[5, 5], [70, 70], [200, 200]])
        >>> bool(abs(points - other.points).max() < 1e-6)
        True
        """

        def fitted(here: Floats, there: Floats, points: Floats | None = None) -> Floats:
            w, v = (
                spherical_barycenter(P, np.ones(len(P))) if len(P) > 2 else np.zeros(3)
                for P in (here, there)
            )
            turn = rotation(moved_to_center(here, w), moved_to_center(there, v))
            moved = moved_to_center(here if points is None else points, w)
            return moved_to_center(moved @ turn, -v)

        P = fitted(*self._landmarks(to, landmarks), self.points)
        P, _ = repaired_on_sphere(self.mesh, P / np.linalg.norm(P, axis=1)[:, None])
        certificate = certify_sphere(self.mesh.F, P)
        if not certificate.valid:
            refused = replace(self, points=P, certificate=certificate)
            raise MapError(
                "Moved to the landmarks, the map is not a bijection onto the sphere: "
                f"{certificate}. Choose other landmarks",
                refused,
            )
        return self._registered(P, to, landmarks, fitted)

    def area_distortion(self) -> Floats:
        """Logarithm of the area on the sphere by that on the surface, as fractions of their totals.

        Returns
        -------
        (m,) float64
            Of each face; the area is that of the straight triangle with its corners on the sphere.
        """
        return area_distortion(self.mesh.V, self.mesh.F[: self._n_faces], self.points)

    @property
    def _images(self) -> Floats:
        return self.points

    @cached_property
    def _finder(self) -> SphereFinder:
        return SphereFinder(self.mesh.F, self.points, self.mesh.edges)

    def _located(self, points: Floats) -> tuple[Ints, Floats]:
        length = np.linalg.norm(points, axis=1)[:, None]
        if not length.all():
            raise ValueError("uv must not be 0, the middle of the sphere")
        face, barycentric, _ = self._finder.locate(points / length)
        return face, barycentric[:, :: -1 if self.inward else 1]

    @property
    def _reach(self) -> float:
        return float(abs(self.uv).max())

    def _steps(self) -> list[tuple[str, str]]:
        return [
            (
                ("embedding", f"without vertex {self.pole:,}")
                if self.is_embedded
                else ("dipole", f"at vertex {self.pole:,}")
            ),
            ("Laplacian", self.laplacian),
            ("Möbius", "centre of mass at 0" if self.mobius == "area" else "none"),
            *(
                [("change", f"filled {counted(self.filled, 'hole', 'holes')}")]
                if self.filled
                else []
            ),
            *super()._steps(),
        ]

    def _surface(self) -> tuple[Floats, Ints]:
        return self.mesh.positions, self._faces

    def _layout(self) -> Layout:
        # A vertex comes twice where its faces are on both hemispheres.
        name, corner = np.unique(2 * self._faces + self._chart[1][:, None], return_inverse=True)
        uv = np.empty((len(name), 2))
        F = corner.reshape(-1, 3)
        uv[F] = self.uv / self._reach
        rows = name // 2
        also = {"scale": self._reach, "ball": self.points[rows], "vertices": rows}
        return self._drawn(self.mesh.V[rows], F, uv, **also)


def _in_square(uv: Floats) -> Floats:
    """Scale a chart (m, 3, 2), which lies around 0, into the unit square."""
    return 0.5 + uv / (2 * abs(uv).max())


@takes_meshes
@like(disk_map)
def sphere_map(
    V: ArrayLike,
    F: ArrayLike,
    *,
    mobius: Literal["area"] | None = "area",
    align: Mapping[int, ArrayLike] | None = None,
    refine: int | None = None,
    refine_norm: float = 1.5,
    refine_seconds: float = np.inf,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> SphereMap:
    """Map a closed triangulated surface of genus 0 conformally onto the unit sphere.

    Holes are filled for the time of the map, if that takes less than 5 % of the area.

    Eq. (18) of the paper, which maps the double cover of a disk, on the surface itself: a harmonic
    function with a dipole, then stereographic projection. Here the dipole is spread over the
    neighbours of a vertex such that it has no moments of second order, which makes the map one of
    second order in the length of edges wherever it is.

    Parameters
    ----------
    V, F
        As in `disk_map`, of a closed surface, but for holes.
    mobius : {"area"} or None
        ``"area"`` puts the centre of mass of the image at 0, masses being areas on the surface:
        the conformal barycentre, which evens out the area, and does not depend on the mesh. None
        leaves the pole of the dipole at (0, 0, 1). Refinement comes later.
    align : mapping of int to (3,) array_like, optional
        Directions from the centre in which vertices shall lie: the sphere is turned to bring them
        near, after `mobius`. Without it, the sphere is turned to match the surface in space; not
        if `mobius` is None.
    refine : int or None
        As in `disk_map`; the vertex `SphereMap.pole` stays.

    Returns
    -------
    SphereMap

    Raises
    ------
    MeshError
        If the surface is not closed but for small holes, has a handle or several components, or is
        no mesh.
    MapError
        If no map is a bijection; the one of least distortion is its ``result``.

    References
    ----------
    S. Haker et al. Conformal surface parameterization for texture mapping. IEEE Trans. Vis.
    Comput. Graph. 6(2), 2000.
    J. Cantarella, H. Schumacher. Computing the conformal barycenter. SIAM J. Appl. Algebra
    Geometry 6(3), 2022.

    Examples
    --------
    >>> import cdcp_igl
    >>> V = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    >>> F = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    >>> cdcp_igl.sphere_map(V, F).points.round(6) + 0
    array([[ 1.,  0.,  0.],
           [-1.,  0.,  0.],
           [ 0.,  1.,  0.],
           [ 0., -1.,  0.],
           [ 0.,  0.,  1.],
           [ 0.,  0., -1.]])
    """
    if mobius not in ("area", None):
        raise ValueError(f'of a sphere, mobius must be "area" or None, not {mobius!r}')
    options = Options(
        refine=refine, refine_norm=refine_norm, refine_seconds=refine_seconds, solver=solver
    )
    directions = None if align is None else _directions(align)
    phase = Phases(progress, refine or 0, skipped=("center", "circle", "extension"))
    with using(solver):
        with phase("check"):
            mesh, n_faces, filled = _closed(V, F)
            inward = points_inward(mesh.V, mesh.F)
            mesh = SphereMesh(V, mesh.F[:, ::-1]) if inward else mesh
            if directions and directions[0].max() >= len(mesh.V):
                raise ValueError(f"align must give directions of vertices in 0..{len(mesh.V) - 1}")
        best = _best_map(mesh, mobius, directions, options, phase)
    remedy = (
        "Parts of it may be too small for double precision: cut the surface (cdcp_igl.surface_map)"
    )
    best = replace(best, filled=filled, inward=inward, _n_faces=n_faces)
    best = valid_map(best, " onto the sphere", remedy)
    phase.done()
    return announced(best)


def _closed(V: ArrayLike, F: ArrayLike) -> tuple[SphereMesh, int, int]:
    """Fill holes whose filling has little area: the sphere, faces that were given, and holes."""
    try:
        mesh = SphereMesh(V, F)
        return mesh, len(mesh.F), 0
    except MeshError as error:
        if [defect.name for defect in error.defects] != ["boundary"]:
            raise
        positions, faces = checked_surface(V, F)
        topology = Topology(faces, len(positions))
        loops = topology.loops
        patches = [fill_hole(positions, topology, loop, middle=False) for loop in loops]
        filling = np.concatenate([patch for patch in patches if patch is not None] or [faces])
        areas = [face_areas(positions, some).sum() for some in (filling, faces)]
        if any(patch is None for patch in patches) or areas[0] > HOLES * areas[1]:
            raise
        return SphereMesh(V, np.vstack([faces, filling])), len(faces), len(loops)


def _directions(align: Mapping[int, ArrayLike]) -> tuple[Ints, Floats]:
    """Read `align`: the vertices, and their directions (k, 3)."""
    try:
        vertices = np.array(list(align), dtype=np.int64)
        directions = np.array(list(align.values()), dtype=np.float64).reshape(-1, 3)
    except (TypeError, ValueError, AttributeError):
        raise ValueError(f"align must give 3-vectors for vertices, not {align!r}") from None
    if not (len(vertices) and (vertices >= 0).all()):
        raise ValueError(f"align must give directions of vertices, not {align!r}")
    lengths = np.linalg.norm(directions, axis=1)
    if not (np.isfinite(lengths).all() and lengths.all()):
        raise ValueError("align must give finite directions, not 0")
    return vertices, directions / lengths[:, None]


def _best_map(
    mesh: SphereMesh,
    mobius: Literal["area"] | None,
    align: tuple[Ints, Floats] | None,
    options: Options,
    phase: Phases,
) -> SphereMap:
    """Try one way after the other until a map is conformal; the best, refined, valid or not."""

    def by_dipole(name: str) -> SphereMap:
        with phase("laplacian"):
            L = LAPLACIANS[name](mesh)
        with phase("factor"):
            surface = FactoredSurface(mesh, L, np.arange(len(mesh.V)) > 0)  # eq. (18), pinned
        orders.append(surface.order)
        with phase("trace"):
            P, pole = dipole_map(surface)
        return _finished(mesh, P, pole, name, surface.solver, mobius, align, phase)

    orders = list[Indices]()
    best = best_of(
        (partial(by_dipole, name) for name in LAPLACIANS),
        lambda made: made.conformal and made.repair.n_flipped == 0,
    )
    best = _lowered(mesh, best, orders[-1], options, phase)
    if best.conformal and not best.is_far_from_mended:
        return best

    def around(pole: int) -> SphereMap:
        with phase("repair"):
            P = _embedded(mesh, pole)
        kind, made = (pole, "mean value", best.solver), [best]
        for how in dict.fromkeys((mobius, None)):  # large faces may be flipped by the first
            other = _finished(mesh, P, *kind, how, align, phase)
            made.append(_lowered(mesh, other, orders[-1], options, phase))
        return min(made, key=lambda one: one.refined_rank)

    # A hemisphere for the faces of a vertex: where one is too narrow, there is another.
    poles = dict.fromkeys((best.pole, int(mesh.vertex_areas.argmax())))
    return best_of(partial(around, pole) for pole in poles)


def _embedded(mesh: SphereMesh, pole: int) -> Floats:
    """Begin with an embedding of all but the pole on the disk, lower its shear, even out its area.

    Returns a map onto the sphere (n, 3); some faces may be flipped where double precision does.
    """
    disk, rows, f = without_pole(mesh, pole)
    f = from_tutte(disk, f)
    moved = mobius_transformation(f, conformal_barycenter(f, mesh.vertex_areas[rows]))
    even = len(flipped_faces(moved, disk.F)[0]) == 0
    return over_hemispheres(mesh, pole, rows, moved if even else f)


def _lowered(
    mesh: SphereMesh, best: SphereMap, order: Indices, options: Options, phase: Phases
) -> SphereMap:
    """Refine a map, if that is asked for or needed."""
    steps, sphere = steps_of(best, options), Sphere(best.points, best.pole)
    if steps == 0:
        return best

    def finished(z: Complex, known: float) -> SphereMap:
        kind = best.pole, best.laplacian, best.solver
        lowered = _finished(mesh, sphere.points(z), *kind, None, None, phase, known)
        return replace(lowered, mobius=best.mobius)

    z, order = sphere.plane(best.points), np.append(order, 0)
    order = order[order != best.pole]
    return refined(best, z, sphere, order, steps, finished, options, phase)


def _finished(
    mesh: SphereMesh,
    P: Floats,
    pole: int,
    laplacian: str,
    solver: str,
    mobius: Literal["area"] | None,
    align: tuple[Ints, Floats] | None,
    phase: Phases,
    known: float = 0.0,
) -> SphereMap:
    """Normalise a map, repair it, certify and judge it."""
    mass = mesh.vertex_areas
    with phase("mobius"):
        if mobius:
            P = moved_to_center(P, spherical_barycenter(P, mass))
        if align is not None:
            P = P @ rotation(P[align[0]], align[1])
        elif mobius:
            P = P @ rotation(P * mass[:, None], mesh.V - np.average(mesh.V, axis=0, weights=mass))
        P /= np.linalg.norm(P, axis=1)[:, None]
    with phase("repair"):
        P, repair = repaired_on_sphere(mesh, P)
    with phase("certificate"):
        certificate = certify_sphere(mesh.F, P)
        degrees = np.degrees(abs(sphere_angle_errors(mesh, P, certificate.flipped)))
        fields = fields_of(mesh, P, degrees, certificate, repair, known=known)
    return SphereMap(
        **fields,
        points=P,
        pole=pole,
        mobius=mobius or "none",
        laplacian=laplacian,
        solver=solver,
        timings=phase.seconds,
    )
