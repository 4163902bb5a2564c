"""A closed surface of genus 0, mapped conformally onto the unit sphere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Bools, Complex, Floats, Indices, Ints, as_complex, coordinates, marked
from .cached import cached_property
from .certificate import SphereCertificate, certify_sphere, flipped_on_sphere
from .distortion import area_distortion, sphere_angle_errors
from .errors import MapError
from .io.given import takes_meshes
from .plot.layout import Layout
from .rescue.figures import Figure, Flipped
from .rescue.repair import MANY, POWERS, Neighbourhood, Repair, grow, repair_locally
from .result.base import valid_map
from .result.bijection import Bijection
from .result.making import MadeMap, best_of, fields_of, refined, steps_of
from .solve.factored import FactoredSurface
from .solve.laplacian import LAPLACIANS
from .solve.solvers import SolverName, using
from .steps.options import Options
from .steps.phases import Phases, Progress
from .surface.location import SphereFinder
from .surface.mesh import DiskMesh, SphereMesh
from .surface.triangles import EPS, oriented_areas, vertex_areas

WELL_SHAPED = np.radians(20)  # the smallest angle around the vertex of the dipole, if there is one
NEAR = 2.0  # |h| in a cap around the dipole, 20 % of the sphere, which is solved again
# Towards the conformal barycentre: how many, how long, and how near to the sphere, in whose
# points half of the surface may crowd.
MAX_STEPS, LONGEST, NEAREST = 60, 0.6, 1 - 1e-10
CLOSE = 1e-8  # a shorter step leaves its square
AT_INFINITY = 1e12  # the place of the pole of the sphere in the plane, 2e-12 from it
HEMISPHERE = 0.5  # cosine of the radius of a chart in which flipped faces are repaired
CHARTS = 200  # of them
# Flipped faces that are untangled, rings around them, moves of a vertex, and planes for each.
FEW, MOST_RINGS, MOST_MOVES, MOST_PLANES = 100, 6, 20_000, 20


@dataclass(frozen=True, eq=False, repr=False)
class SphereMap(MadeMap, Bijection):
    """A conformal map onto the unit sphere. Printing it gives a summary.

    Attributes
    ----------
    points : (n, 3) float64
        Row i is the image of row i of V, on the unit sphere. Faces are counterclockwise seen from
        outside.
    uv : (m, 3, 2) float64
        A chart for pictures and textures: the corners of each face on one of two hemispheres,
        upper and lower, in stereographic projection side by side: around (-1, 0) and (1, 0).
    mesh : SphereMesh
        The surface.
    certificate : SphereCertificate
        What was verified about `points`.
    distortion : AngleDistortion
        Mean, SD and maximum of the angular distortion in degrees, between the faces of the surface
        and the straight triangles with their corners on the sphere.
    pole : int
        The vertex that carried the dipole.
    mobius : {"area", "none"}
        What chose the Möbius transformation of the sphere.
    laplacian : str
        ``"cotangent"``; or, where that flipped faces, or its map is not conformal, and this
        distorts less, ``"intrinsic Delaunay"``; or ``"mean value"`` where parts of the surface are
        too small on the sphere for double precision, and had to be enlarged.
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

    _kind = "sphere"
    _plane = "Sphere"
    _reported = ("pole", "laplacian", "mobius")

    @cached_property
    def uv(self) -> Floats:  # type: ignore[override]
        """(m, 3, 2) the chart of two hemispheres."""
        corners, side = self.points[self.mesh.F], np.where(self._upper, 1, -1)[:, None]
        scale = 1 + side * corners[..., 2]
        x, y = corners[..., 0] / scale, side * corners[..., 1] / scale
        return np.stack([x - side, y], axis=2)

    @cached_property
    def _upper(self) -> Bools:
        """(m,) faces turned upwards: the pole below is outside of their circles on the sphere."""
        return oriented_areas(as_complex(self.points[:, :2]), self.mesh.F)[0] > 0

    def packed(self) -> Floats:
        """Return the chart `uv` scaled into the unit square, (m, 3, 2): texture coordinates."""
        return 0.5 + self.uv / (2 * self._reach)

    def apply(self, face: ArrayLike, barycentric: ArrayLike) -> Floats:
        """Map points of the surface to the unit sphere, as `Bijection.apply`: (..., 3)."""
        straight = super().apply(face, barycentric)
        return straight / np.linalg.norm(straight, axis=-1)[..., None]

    def register(self, to: SphereMap, landmarks: ArrayLike) -> Floats:
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
        (n, 3) float64
            The vertices of this surface on the sphere of the other, still a certified map:
            ``to.interpolate(values, points)`` carries what lives on the other surface to them.

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
        here, there = self._landmarks(to, landmarks)
        w, v = (
            conformal_barycenter(P, np.ones(len(P))) if len(P) > 2 else np.zeros(3)
            for P in (here, there)
        )
        turn = rotation(moved_to_center(here, w), moved_to_center(there, v))
        P = moved_to_center(moved_to_center(self.points, w) @ turn, -v)
        P, _ = repaired_on_sphere(self.mesh, P / np.linalg.norm(P, axis=1)[:, None])
        certificate = certify_sphere(self.mesh.F, P)
        if not certificate.valid:
            refused = replace(self, points=P, certificate=certificate)
            raise MapError(
                "Moved to the landmarks, the map is not a bijection onto the sphere: "
                f"{certificate}. Choose other landmarks",
                refused,
            )
        return P

    def area_distortion(self) -> Floats:
        """Logarithm of the area on the sphere by that on the surface, as fractions of their totals.

        Returns
        -------
        (m,) float64
            Of each face; the area is that of the straight triangle with its corners on the sphere.
        """
        return area_distortion(self.mesh.V, self.mesh.F, self.points)

    @property
    def _images(self) -> Floats:
        return self.points

    @cached_property
    def _finder(self) -> SphereFinder:
        if not self.valid:
            raise ValueError("the map is no bijection onto the sphere: points have no one place")
        return SphereFinder(self.mesh.F, self.mesh.edges, self.points)

    def _located(self, points: Floats) -> tuple[Ints, Floats]:
        length = np.linalg.norm(points, axis=1)[:, None]
        if not length.all():
            raise ValueError("uv must not be 0, the middle of the sphere")
        return self._finder.locate(points / length)

    @property
    def _reach(self) -> float:
        return float(abs(self.uv).max())

    def _steps(self) -> list[tuple[str, str]]:
        return [
            ("dipole", f"at vertex {self.pole:,}"),
            ("Laplacian", self.laplacian),
            ("Möbius", "centre of mass at 0" if self.mobius == "area" else "none"),
            *super()._steps(),
        ]

    def _surface(self) -> tuple[Floats, Ints]:
        return self.mesh.positions, self.mesh.F

    def _layout(self) -> Layout:
        # A vertex comes twice where its faces are on both hemispheres.
        name, corner = np.unique(2 * self.mesh.F + self._upper[:, None], return_inverse=True)
        uv = np.empty((len(name), 2))
        F = corner.reshape(-1, 3)
        uv[F] = self.uv / self._reach
        rows = name // 2
        also = {"scale": self._reach, "ball": self.points[rows], "vertices": rows}
        return self._drawn(self.mesh.V[rows], F, uv, **also)


@takes_meshes
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

    Eq. (18) of the paper, which maps the double cover of a disk, on the surface itself: a harmonic
    function with a dipole, then stereographic projection. Here the dipole is spread over the
    neighbours of a vertex such that it has no moments of second order, which makes the map one of
    second order in the length of edges wherever it is.

    Parameters
    ----------
    V, F
        As in `disk_map`, of a closed surface.
    mobius : {"area"} or None
        ``"area"`` puts the centre of mass of the image at 0, masses being areas on the surface:
        the conformal barycentre, which evens out the area, and does not depend on the mesh. None
        leaves the pole of the dipole at (0, 0, 1). Refinement comes later.
    align : mapping of int to (3,) array_like, optional
        Directions from the centre in which vertices shall lie: the sphere is turned to bring them
        near, after `mobius`. Without it, the sphere is turned to match the surface in space; not
        if `mobius` is None.
    refine, refine_norm, refine_seconds, solver, progress
        As in `disk_map`; of refinement, the vertex `SphereMap.pole` stays.

    Returns
    -------
    SphereMap

    Raises
    ------
    MeshError
        If the surface is not closed, has a handle or several components, or is no mesh.
    MapError
        If no map is a bijection; the one of least distortion is its ``result``.
    SolverError, ValueError, ImportError
        As `disk_map`.

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
    phase = Phases(progress, refine or 0, skipped=("center", "circle", "extension"))
    with using(solver):
        with phase("check"):
            mesh = SphereMesh(V, F)
            directions = None if align is None else _directions(align, len(mesh.V))
        best = _best_map(mesh, mobius, directions, options, phase)
    remedy = (
        "Parts of it may be too small for double precision: cut the surface (cdcp_igl.surface_map)"
    )
    best = valid_map(best, " onto the sphere", remedy)
    phase.done()
    return best


def _directions(align: Mapping[int, ArrayLike], n: int) -> tuple[Ints, Floats]:
    """Read `align`: the vertices, and their directions (k, 3)."""
    try:
        vertices = np.array(list(align), dtype=np.int64)
        directions = np.array(list(align.values()), dtype=np.float64).reshape(-1, 3)
    except (TypeError, ValueError, AttributeError):
        raise ValueError(f"align must give 3-vectors for vertices, not {align!r}") from None
    if not (len(vertices) and ((vertices >= 0) & (vertices < n)).all()):
        raise ValueError(f"align must give directions of vertices in 0..{n - 1}")
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
    if not best.valid:
        with phase("repair"):
            P = _mean_value_map(mesh, best.pole)
        whole = _finished(mesh, P, best.pole, "mean value", best.solver, None, align, phase)
        best = min(best, whole, key=lambda made: made.rank)
    steps, sphere = steps_of(best, options), Sphere(best.points, best.pole)
    if steps == 0:
        return best

    def finished(z: Complex, known: float) -> SphereMap:
        kind = best.pole, best.laplacian, best.solver
        lowered = _finished(mesh, sphere.points(z), *kind, None, None, phase, known)
        return replace(lowered, mobius=best.mobius)

    z, order = sphere.plane(best.points), np.append(orders[-1], 0)
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
            P = moved_to_center(P, conformal_barycenter(P, mass))
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


# -- eq. (18) -------------------------------------------------------------------------------------


def dipole_map(surface: FactoredSurface) -> tuple[Floats, int]:
    """Map a closed surface onto the sphere (n, 3) by a dipole; and the vertex that carried it.

    The first dipole is at the vertex with the best angles around it. The second, which is taken, is
    where the surface is widest: of the vertices with good angles, at the one whose area has grown
    most. On a limb nothing else would have digits.
    """
    mesh = surface.mesh
    mass, angles = mesh.vertex_areas, np.minimum.reduce(mesh.angles.T)
    smallest = np.full(len(mesh.V), np.pi)
    for corner in mesh.F.T:
        np.minimum.at(smallest, corner, angles)
    few = np.bincount(mesh.F.ravel()) < 5  # neighbours: the dipole would not be free of moments
    smallest[few] /= np.pi
    P = from_plane(_dipole_solution(surface, int(smallest.argmax())), -1)
    P = moved_to_center(P, conformal_barycenter(P, mass))
    growth = vertex_areas(P, mesh.F) / mass
    growth[smallest < min(WELL_SHAPED, smallest.max())] = 0
    pole = int(growth.argmax())
    h = _dipole_solution(surface, pole)
    # Next to the pole h is large and rough; seen from the other side, 1 / h is small and smooth.
    near = (abs(h) > NEAR) | (np.arange(len(h)) == pole)
    w = np.divide(1, h, out=np.zeros_like(h), where=~near & (h != 0))
    order = np.append(surface.order, 0)
    cap = FactoredSurface(mesh, surface.laplacian, order=order[near[order]])
    w -= cap.solve(surface.laplacian.times(w))
    P = from_plane(h, -1)
    P[near] = from_plane(w[near], 1)
    return P, pole


def _dipole_solution(surface: FactoredSurface, pole: int) -> Complex:
    """Solve eq. (18), (n,); half of the area lies on either side of 0, and in the unit disk."""
    mesh = surface.mesh
    mass = mesh.vertex_areas.copy()
    mass[pole] = 0
    h = surface.solve(vertex_dipole(mesh, pole))
    # So little is left to do for the conformal barycentre.
    h -= _median(h.real, mass) + 1j * _median(h.imag, mass)
    h /= _median(np.abs(h), mass) or 1
    return h


def _median(x: Floats, mass: Floats) -> float:
    order = np.argsort(x)
    total = np.cumsum(mass[order])
    return float(x[order[np.searchsorted(total, total[-1] / 2)]])


def vertex_dipole(mesh: DiskMesh, vertex: int) -> Complex:
    """Right-hand side (n,) of eq. (18): the derivative of a point mass at a vertex.

    With coordinates w of its neighbours, in which the angles around the vertex add up to 2 pi, it
    takes 1 and conj(w) to 0, w to 1, and w^2 and conj(w)^2 to 0 as far as there are enough
    neighbours; of all such, the one of least norm. The dipole of one face takes w^2 to what shears
    the whole map by the length of an edge.
    """
    ring, w = _star(mesh, vertex)
    w = np.append(0, w)
    moments = np.array([np.ones_like(w), w, w.conj(), w**2, w.conj() ** 2])
    r = np.zeros(len(mesh.V), dtype=complex)
    r[np.append(vertex, ring)] = np.linalg.lstsq(moments, np.eye(5)[1], rcond=None)[0]
    return r


def _star(mesh: DiskMesh, vertex: int) -> tuple[Ints, Complex]:
    """Neighbours (k,) of a vertex in order, and coordinates whose angles add up to 2 pi."""
    faces, corner = np.nonzero(np.equal(mesh.F, vertex))
    following = dict(zip(mesh.F[faces, corner - 2].tolist(), range(len(faces)), strict=True))
    ring, angle = [int(mesh.F[faces[0], corner[0] - 2])], [0.0]
    while True:
        row = following[ring[-1]]
        angle.append(angle[-1] + float(mesh.angles[faces[row], corner[row]]))
        if len(angle) > len(faces):
            break
        ring.append(int(mesh.F[faces[row], corner[row] - 1]))
    power = 2 * np.pi / angle[-1]
    length = np.linalg.norm(mesh.V[ring] - mesh.V[vertex], axis=1)
    direction = np.exp(1j * power * np.array(angle[:-1]))
    return np.array(ring), (length / length.mean()) ** power * direction


def from_plane(z: Complex, side: int) -> Floats:
    """(n, 3) points of the sphere; 0 is at the pole (0, 0, side), 1 at (1, 0, 0)."""
    square = abs(z) ** 2
    P = np.column_stack([2 * z.real, 2 * side * z.imag, side * (1 - square)])
    return P / (1 + square)[:, None]


# -- Möbius transformations of the sphere ---------------------------------------------------------


def moved_to_center(P: Floats, w: Floats) -> Floats:
    """Transform the unit ball such that w goes to 0, and points (n, 3) of the sphere with it."""
    from_w = P - w
    square = np.einsum("...i,...i", from_w, from_w)[..., None]
    within = 1 - np.einsum("...i,...i", P, P)[..., None]  # 0 on the sphere
    return ((1 - w @ w) * from_w - square * w) / (square + (1 - w @ w) * within)


def conformal_barycenter(P: Floats, mass: Floats) -> Floats:
    """Find w (3,) that puts the centre of mass of ``moved_to_center(P, w)`` at 0: Newton's method.

    See Cantarella and Schumacher 2022, in `sphere_map`.
    """
    mass = mass / mass.sum()
    w = np.zeros(3)
    for _ in range(MAX_STEPS):
        moved = moved_to_center(P, w)
        moment = mass @ moved
        slope = 2 * (np.eye(3) - moved.T @ (mass[:, None] * moved))
        d = np.linalg.lstsq(slope, moment, rcond=None)[0]
        d *= min(1.0, LONGEST / max(float(np.linalg.norm(d)), EPS))
        farther = moved_to_center(np.asarray(d), -w)
        if np.linalg.norm(farther) > NEAREST:
            break
        w = farther
        if np.linalg.norm(d) < CLOSE:
            break
    return w


def _axes_along(direction: Floats) -> Floats:
    """Right-handed orthonormal axes (3, 3) in rows, the first along a direction (3,)."""
    axes = np.linalg.svd(direction[None])[2]  # the first one is along it, or against it
    axes *= np.sign(axes[0] @ direction)
    axes[2] *= np.linalg.det(axes)
    return axes


def rotation(P: Floats, targets: Floats) -> Floats:
    """Rotation R (3, 3) that brings points nearest to targets, both (k, 3): ``P @ R`` (Kabsch)."""
    U, _, W = np.linalg.svd(P.T @ targets)
    U[:, 2] *= np.sign(np.linalg.det(U @ W))
    return U @ W


# -- flipped faces --------------------------------------------------------------------------------


def repaired_on_sphere(mesh: SphereMesh, P: Floats) -> tuple[Floats, Repair]:
    """Repair flipped faces by moving vertices near them, one part of the sphere after the other.

    A part is seen in central projection, which keeps the orientation of its triangles.
    """
    n_flipped = len(flipped := flipped_on_sphere(P, mesh.F)[0])
    if n_flipped > MANY * len(mesh.F):
        return P, Repair(n_flipped)
    moved, rounds = np.zeros(len(P), dtype=bool), 0
    tried = np.zeros(len(mesh.F), dtype=bool)
    while len(left := flipped[~tried[flipped]]) and rounds < CHARTS:
        axes = _axes_along(P[mesh.F[left[0]]].sum(axis=0))
        height = P @ axes[0]
        faces = np.flatnonzero((height[mesh.F] > HEMISPHERE).all(axis=1))
        tried[left[0]], rounds = True, rounds + 1
        if len(faces) == 0:
            continue
        part, rows = mesh.part(faces)
        z = (P[rows] @ axes[1] + 1j * (P[rows] @ axes[2])) / height[rows]
        f, _ = repair_locally(part, z)
        there = rows[f != z]
        direction = axes[0] + coordinates(f[f != z]) @ axes[1:]
        P = P.copy()
        P[there] = direction / np.linalg.norm(direction, axis=1)[:, None]
        moved[there] = True
        tried[faces] = True
        flipped = flipped_on_sphere(P, mesh.F)[0]
    Q = _untangled(mesh, P) if len(flipped) else P
    moved |= (Q != P).any(axis=1)
    return Q, Repair(n_flipped, int(moved.sum()), rounds)


def _untangled(mesh: SphereMesh, P: Floats) -> Floats:
    """Move vertices at flipped faces to where they see their neighbours best, one by one.

    All faces of a vertex are positively oriented if it lies on one side of planes through 0 and the
    edges opposite: of all places, in the one farthest from the nearest plane. More rings of
    vertices move where that repairs nothing.

    References
    ----------
    L. A. Freitag, P. Plassmann. Local optimization-based simplicial mesh untangling and
    improvement. Int. J. Numer. Methods Eng. 49, 2000.
    """
    P, F = P.copy(), mesh.F
    by_vertex = np.argsort(F, axis=None, kind="stable")
    start = np.append(0, np.cumsum(np.bincount(F.ravel())))
    flipped, rings, moves = flipped_on_sphere(P, F)[0], 0, 0
    while len(flipped) <= FEW:
        moving = grow(F, marked(len(P), F[flipped]), rings)
        for vertex in np.flatnonzero(moving):
            face, corner = np.divmod(by_vertex[start[vertex] : start[vertex + 1]], 3)
            planes = np.cross(P[F[face, corner - 2]], P[F[face, corner - 1]])
            planes /= np.maximum(np.linalg.norm(planes, axis=1), 1e-300)[:, None]
            place = _deepest(planes)
            if (planes @ place).min() > (planes @ P[vertex]).min():
                P[vertex] = place
        before, flipped = len(flipped), flipped_on_sphere(P, F)[0]
        moves += int(moving.sum())
        if len(flipped) == 0 or moves > MOST_MOVES:
            break
        rings = min(rings + (len(flipped) >= before), MOST_RINGS)
    return P


def _deepest(normals: Floats) -> Floats:
    """Point (3,) of the sphere that is farthest above the lowest of planes, of normals (k, 3).

    It is the centre of the smallest cap around the normals, which two or three of them determine.
    """
    chosen = normals[:MOST_PLANES]
    i, j = np.triu_indices(len(chosen), 1)
    a, b, c = (chosen[list(t)] for t in zip(*combinations(range(len(chosen)), 3), strict=True))
    circumcenters = np.cross(b - a, c - a)
    centers = np.vstack([chosen[i] + chosen[j], circumcenters, -circumcenters])
    centers /= np.maximum(np.linalg.norm(centers, axis=1), 1e-300)[:, None]
    return centers[(centers @ normals.T).min(axis=1).argmax()]


def _mean_value_map(mesh: SphereMesh, pole: int) -> Floats:
    """Map the surface without its pole into the plane by mean values, and onto the sphere.

    Positive weights and a convex boundary, the neighbours of the pole, give an embedding (Floater's
    theorem), which central projection takes to a hemisphere, great arcs for edges. The pole is on
    the other. Where the surface crowds too much for double precision, the weights differ less.
    """
    part, rows = mesh.part(np.flatnonzero(~marked(len(mesh.V), pole)[mesh.F].any(axis=1)))
    mass = mesh.vertex_areas[rows]
    ring, w = _star(mesh, pole)
    z = np.zeros(len(mesh.V), dtype=complex)
    z[ring] = abs(w) / w
    P = np.empty((len(mesh.V), 3))
    for power in POWERS:
        whole = Neighbourhood(part, np.ones(len(rows), dtype=bool), power)
        f = whole.combine(z[rows], whole.free)
        # In the middle of the area, but at a vertex inside, if there is one.
        middle = _median(f.real, mass) + 1j * _median(f.imag, mass)
        f -= min(f[whole.free], key=lambda z: abs(z - middle), default=z.mean())
        P[pole] = 0, 0, 1
        # Seen from outside, from below.
        f = f.conj() / _median(np.abs(f), mass)
        P[rows] = np.column_stack([coordinates(f), -np.ones(len(f))])
        P /= np.linalg.norm(P, axis=1)[:, None]
        if len(flipped_on_sphere(P, mesh.F)[0]) == 0:
            break
    return P


class Sphere(Figure):
    """The unit sphere, by stereographic projection from the image of one vertex, which stays.

    Vector fields on the sphere have the same shear in this plane, and its coordinate has no
    singularity but at the pole: so the Laplacian of all others preconditions their displacements.
    The faces are straight, their corners on the sphere.
    """

    def __init__(self, P: Floats, pole: int) -> None:
        axes = _axes_along(P[pole])
        axes[2] *= -1  # seen from outside, opposite the pole
        self._axes, self._pole = axes, pole

    def plane(self, P: Floats) -> Complex:
        """(n,) coordinates of points (n, 3)."""
        height, x, y = self._axes @ P.T
        # Near the pole 1 - height has no digits, near the other point 1 + height has none.
        outside = (x * x + y * y) / np.maximum(1 + height, 1)
        z: Complex = (x + 1j * y) / np.where(height > 0, np.maximum(outside, 1e-300), 1 - height)
        z[self._pole] = AT_INFINITY
        return z

    def image(self, f: Complex) -> Floats:
        """Points of the sphere, (n, 3)."""
        return self.points(f)

    def points(self, z: Complex) -> Floats:
        """(n, 3) points with these coordinates."""
        return from_plane(z.conj(), -1)[:, [2, 0, 1]] @ self._axes

    def flipped(self, F: Ints, f: Complex) -> Flipped:
        """Faces that are not positively oriented, exactly, and how many were in doubt."""
        return flipped_on_sphere(self.points(f), F)

    def errors(self, mesh: DiskMesh, f: Complex, flipped: Flipped) -> Floats:
        """(m, 3) signed angle errors in radians."""
        return sphere_angle_errors(mesh, self.points(f), flipped[0])

    def certificate(self, mesh: DiskMesh, f: Complex, flipped: Flipped) -> SphereCertificate:
        """Verify a map f (n,) whose `flipped` faces are known."""
        return certify_sphere(mesh.F, self.points(f), flipped)

    def tangential(self, mesh: DiskMesh, f: Complex, x: Complex) -> Complex:
        """Let the pole stay."""
        x[self._pole] = 0
        return x

    def corners(self, f: Complex, F: Ints) -> tuple[Complex, Complex | float]:
        """Corners (3, k) of faces in their own planes, and what turns dz into these.

        A tangent plane is tilted against the plane of the face; what is linear in conj(dz), of the
        second order in the length of edges, is left out.
        """
        P, z = self.points(f[F].ravel()).reshape(*F.shape, 3), f[F]
        u, v = P[:, 1] - P[:, 0], P[:, 2] - P[:, 0]
        normal = np.cross(u, v)
        along = u / np.linalg.norm(u, axis=1)[:, None]
        across = np.cross(normal, along) / np.linalg.norm(normal, axis=1)[:, None]
        frame = along + 1j * across
        corner = np.zeros(F.shape, dtype=complex)
        corner[:, 1], corner[:, 2] = (u * frame).sum(axis=1), (v * frame).sum(axis=1)
        # The derivative of a point by x less i times that by y: these are tangents of equal length.
        scale = 2 / (1 + abs(z) ** 2)
        toward = scale * z.conj()
        tangents = np.stack([toward, 1 - toward * z.real, -1j - toward * z.imag], axis=2)
        turn = np.einsum("fkc,fc->fk", tangents, frame @ self._axes.T)
        return corner.T, (scale * turn / 2).T
