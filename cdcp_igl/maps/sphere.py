"""A closed surface of genus 0, mapped conformally onto the unit sphere."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Complex, Floats, Indices, Ints
from ..descent.descent import from_tutte
from ..descent.placing import judged
from ..descent.preconditioning import WeightedLaplacian
from ..descent.sphere_repair import repaired_on_sphere
from ..descent.targets import Sphere
from ..docstrings import like
from ..errors import MeshError
from ..io.given import takes_meshes
from ..options import Options
from ..phases import Phases, Progress
from ..result.base import announced
from ..result.sphere_map import SphereMap
from ..solve.factored import FactoredSurface
from ..solve.laplacian import LAPLACIANS
from ..solve.solvers import SolverName, using
from ..starts.punctured import over_hemispheres, without_pole
from ..steps.dipole import dipole_map
from ..steps.mobius import conformal_barycenter, mobius_transformation
from ..steps.stereographic import moved_to_center, rotation, spherical_barycenter
from ..surface.filling import fill_hole
from ..surface.mesh import SphereMesh
from ..surface.orientation import points_inward
from ..surface.topology import Topology
from ..surface.triangles import face_areas, flipped_faces
from ..surface.validation import checked_surface
from ..verdict.certificate import certify_sphere
from ..verdict.distortion import sphere_angle_errors
from . import rules
from .disk import disk_map
from .problem import OnTarget, Problem, Start, solve

HOLES = 0.05  # of the area of the surface: more is no hole


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
            inward = points_inward(mesh.scaled, mesh.F)
            mesh = SphereMesh(V, mesh.F[:, ::-1]) if inward else mesh
            if directions and directions[0].max() >= len(mesh.scaled):
                raise ValueError(
                    f"align must give directions of vertices in 0..{len(mesh.scaled) - 1}"
                )
        problem = SphereProblem(mesh, mobius, directions, options, phase)
        problem.given = {"filled": filled, "inward": inward, "_n_faces": n_faces}
        return announced(solve(problem))


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


class SphereProblem(Problem[SphereMap]):
    """A closed surface onto the sphere, normalised by `mobius`, turned to directions `align`.

    `given` are fields of the result that say what was given.
    """

    onto = " onto the sphere"
    remedy = (
        "Parts of it may be too small for double precision: cut the surface (cdcp_igl.surface_map)"
    )
    mesh: SphereMesh

    def __init__(
        self,
        mesh: SphereMesh,
        mobius: Literal["area"] | None,
        align: tuple[Ints, Floats] | None,
        options: Options,
        phase: Phases,
    ) -> None:
        super().__init__(mesh, options, phase)
        self.mobius, self.align = mobius, align
        self.given: dict[str, Any] = {}

    def starts(self) -> Iterator[Start[SphereMap]]:
        """Yield the map by a dipole on each Laplacian."""
        return (partial(self._by_dipole, name) for name in LAPLACIANS)

    def is_good_start(self, made: SphereMap) -> bool:
        """Whether no other Laplacian is tried."""
        return made.is_acceptable and made.repair.n_flipped == 0

    def _by_dipole(self, laplacian: str) -> SphereMap:
        with self.phase("laplacian"):
            L = LAPLACIANS[laplacian](self.mesh)
        with self.phase("factor"):
            surface = FactoredSurface(
                self.mesh, L, np.arange(len(self.mesh.scaled)) > 0
            )  # eq. (18)
        self._order: Indices = surface.order
        with self.phase("trace"):
            P, pole = dipole_map(surface)
        how = {"pole": pole, "laplacian": laplacian, "solver": surface.solver}
        return self._placed(P, how, self.mobius)

    def tutte_starts(self, best: SphereMap) -> Iterator[Start[SphereMap]]:
        """Yield maps from embeddings around two poles, each with and without `mobius`.

        Around a vertex there is a hemisphere for its faces: where one is too narrow, there is the
        one around the vertex of the largest area. Large faces may be flipped by `mobius`.
        """
        for pole in dict.fromkeys((best.pole, int(self.mesh.vertex_areas.argmax()))):
            with self.phase("repair"):
                P = _embedded(self.mesh, pole)
            how = {"pole": pole, "laplacian": "mean value", "solver": best.solver}
            for mobius in dict.fromkeys((self.mobius, None)):
                yield partial(self._placed, P, how, mobius)

    def needs_no_other_start(self, made: SphereMap) -> bool:
        """Whether no Tutte embedding may lead nearer to the conformal map."""
        return made.is_acceptable and not rules.is_heavily_repaired(made)

    def _placed(
        self,
        P: Floats,
        how: dict[str, Any],
        mobius: Literal["area"] | None,
        known: float = 0.0,
        *,
        turned: bool = True,
    ) -> SphereMap:
        """Normalise a map (n, 3) and turn it, repair it, certify and judge it."""
        mesh, mass, align = self.mesh, self.mesh.vertex_areas, self.align
        with self.phase("mobius"):
            if mobius:
                P = moved_to_center(P, spherical_barycenter(P, mass))
            if align is not None and turned:
                P = P @ rotation(P[align[0]], align[1])
            elif mobius:
                P = P @ rotation(
                    P * mass[:, None], mesh.scaled - np.average(mesh.scaled, axis=0, weights=mass)
                )
            P = P / np.linalg.norm(P, axis=1)[:, None]
        with self.phase("repair"):
            P, repair = repaired_on_sphere(mesh, P)
        with self.phase("certificate"):
            certificate = certify_sphere(mesh.F, P)
            degrees = np.degrees(abs(sphere_angle_errors(mesh, P, certificate.flipped)))
            fields = judged(mesh, P, degrees, certificate, repair, known)
        fields |= {"points": P, "mobius": mobius or "none", "timings": self.phase.seconds}
        return SphereMap(**fields, **how)

    def on_target(self, made: SphereMap) -> OnTarget:
        """Return a map as descent sees it: in the plane, seen from the pole, which stays."""
        sphere, order = Sphere(made.points, made.pole), np.append(self._order, 0)
        laplacian = WeightedLaplacian(self.mesh, order[order != made.pole])
        return OnTarget(sphere, sphere.plane(made.points), laplacian)

    def moved(self, made: SphereMap, f: Complex, known: float) -> SphereMap:
        """Return what descent made of a map: neither normalised nor turned again."""
        P = Sphere(made.points, made.pole).points(f)
        how = {"pole": made.pole, "laplacian": made.laplacian, "solver": made.solver}
        return replace(self._placed(P, how, None, known, turned=False), mobius=made.mobius)

    def finished(self, best: SphereMap) -> SphereMap:
        """Say what was given."""
        return replace(best, **self.given)


def _embedded(mesh: SphereMesh, pole: int) -> Floats:
    """Begin with an embedding of all but the pole on the disk, lower its shear, even out its area.

    Returns a map onto the sphere (n, 3); some faces may be flipped where double precision does.
    """
    disk, rows, f = without_pole(mesh, pole)
    f = from_tutte(disk, f)
    moved = mobius_transformation(f, conformal_barycenter(f, mesh.vertex_areas[rows]))
    even = len(flipped_faces(moved, disk.F)[0]) == 0
    return over_hemispheres(mesh, pole, rows, moved if even else f)
