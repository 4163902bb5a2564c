"""Algorithm 1 over parts: what the steps of the parts leave to be done for the whole."""

from __future__ import annotations

import errno
import hashlib
import logging
import shutil
from collections.abc import Callable
from contextlib import closing
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NoReturn
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from .. import __version__, libigl
from ..arrays import Complex, Floats, Ints, Numbers, coordinates, distinct_rows, evenly_spaced_rows
from ..certificate import certificate_of, is_around
from ..distortion import AngleDistortion, disk_map_distortion
from ..errors import MapError, counted
from ..rescue.boundary import BoundaryMethod
from ..rescue.conformality import NOT_VALID, judge_by, sampled_faces
from ..rescue.recentering import FACES, deep_vertex
from ..rescue.repair import Repair, repair_locally
from ..rescue.straightening import FEW_FACES, is_sheared
from ..selection import MANY_FLIPPED
from ..solve.solvers import SolverName, solver, using
from ..solve.threads import one_thread
from ..steps.center import CANDIDATES, Center, first_well_shaped
from ..steps.circle import Rejected, onto_circle
from ..steps.least_distortion import AngleErrors, faces_to_judge_by, least_angle_distortion
from ..steps.mobius import (
    Normalization,
    barycenter_by_moments,
    check_slope,
    harmless,
    mobius_transformation,
)
from ..steps.options import Options
from ..steps.phases import Phases, Progress
from ..steps.trace import lengths_along, shares_of_edges, trace_of_shares
from ..surface.mesh import DiskMesh
from ..surface.topology import components_of_pairs
from . import steps
from .part import SOME, Arrays, Folder, Gathered, Part, named
from .parting import Table, refuse
from .result import RESULT, PartsMap
from .running import Engine

log = logging.getLogger("cdcp_igl")

Finished = tuple[list[str], Arrays]  # names of the results of the parts, and their values on seams


def parts_map(
    folder: str | PathLike[str],
    *,
    executor: Any = None,
    center: Literal["torsion"] | int = "torsion",
    mobius: Literal["angle", "area"] | None = "angle",
    align: int | ArrayLike | None = None,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> PartsMap:
    """Map a surface in parts onto the disk: the map of `disk_map`, in a fraction of its memory.

    Everything that is computed is a file in a folder beside the parts, and what is there is not
    computed again: a run that was stopped goes on. These files are removed at the end; the map
    stays there, and is found when it is asked for again.

    Parameters
    ----------
    folder : path-like
        What `partition` has made.
    executor : int, concurrent.futures.Executor or dask.distributed.Client, optional
        Computes the parts side by side: so many processes of this machine, or an executor whose
        workers, perhaps on many machines, share the file system. None computes them one after the
        other, here. The results are the same bit by bit.
    center : "torsion" or int
        The face that carries the dipole: by the torsion function, or a row of F.
    mobius, align, solver
        As in `disk_map`.
    progress : callable, optional
        Called as ``progress(phase, fraction)``.

    Returns
    -------
    PartsMap
        Its `certificate` is that of the whole.

    Raises
    ------
    MeshError
        If the surface is no disk: as `check` says, which then reads the whole surface.
    SolverError
        If a part cannot be factored, or does not fit into memory; or the surface is no disk, and
        memory is too small to say where.
    MapError
        If the map would have to be rescued otherwise than by moving some vertices near a few
        flipped faces: there, `disk_map` tries other maps.
    ValueError
        If an option is none of those above.
    OSError
        If something cannot be read or written. What is done is kept.
    BrokenExecutor
        If workers die again and again. What is done is kept.
    ImportError
        If the solver that was asked for is not installed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import cdcp_igl
    >>> V, F, _ = cdcp_igl.datasets.ellipse(20)
    >>> with TemporaryDirectory() as folder:
    ...     parts = cdcp_igl.partition((V, F), Path(folder, "ellipse"), parts=4)
    ...     center = int(F[100, 0])  # of two that are alike, rounding would choose
    ...     uv = cdcp_igl.parts_map(parts, center=center).uv
    >>> bool(abs(uv - cdcp_igl.disk_map(V, F, center=center).uv).max() < 1e-9)
    True
    """
    options = Options(center, mobius, align, solver=solver)
    if isinstance(center, str) and center != "torsion":
        raise ValueError(f'in parts, center must be "torsion" or a row of F, not {center!r}')
    with using(solver):
        engine_of = _solver_name()
        chosen = [__version__, engine_of, center, mobius, np.asarray(align).tolist()]
    digest = hashlib.sha256(repr(chosen).encode()).hexdigest()[:8]
    files = Folder.of(Path(folder).absolute(), f"map-{digest}")  # wherever workers are
    if (files.work / RESULT).exists():
        return PartsMap.read(files)
    files.work.mkdir(exist_ok=True)
    for attempts in files.work.glob("*.attempts"):  # of a run that was stopped
        attempts.unlink()
    with closing(Engine(files, executor, solver)) as engine, one_thread():
        return _Mapping(files, engine, options, Phases(progress)).run(engine_of)


def _solver_name() -> str:
    chosen = solver()
    order = "AMD" if chosen.ORDERS else "minimum degree"
    return f"{chosen.LIBRARY} ({chosen.PACKAGE}, {order} ordering in parts, {chosen.MODE} mode)"


class _Mapping:
    """One map: the steps of Algorithm 1, each of the parts first and then of the whole."""

    def __init__(self, folder: Folder, engine: Engine, options: Options, phase: Phases) -> None:
        self.folder, self.engine, self.options, self.phase = folder, engine, options, phase
        self.parts, self.m, self.cuts = folder.parts, folder.faces, folder.cuts

    def run(self, solver_name: str) -> PartsMap:
        """Map the surface and write the result."""
        phase = self.phase
        with phase("check") as advance:
            self.check(advance)
        with phase("factor") as advance:
            self.factor(advance)
        with phase("center"):
            center = self.center()
        while True:
            with phase("trace"):
                trace, on_boundary = self.trace(center.face)
            with phase("circle"):
                try:
                    f_B = onto_circle(trace)
                except Rejected as reason:
                    self.give_up(str(reason))
            with phase("extension") as advance:
                self.extend(center.face, f_B, advance)
            # Where weights are negative, the torsion may be larger than its bound.
            if center.method == "given" or center == self.most_central(self.extended):
                break
            center = self.most_central(self.extended)
        sample = self.gathered(self.extended)
        self.refuse_rescue(sample, on_boundary)
        judged = sample.only(sampled_faces(self.m))
        self.folder.write("near", vertices=np.unique(sample.vertices[judged.F]))
        with phase("mobius"):
            mobius = self.normalize(sample)
        with phase("repair"):
            repair = self.repair(mobius.w)
        with phase("certificate"):
            result = self.judge(center=center, mobius=mobius, repair=repair, solver=solver_name)
        phase.done()
        if not result.valid:
            self.give_up(f"it would not be a bijection: {result.certificate}", result)
        if result.conformality.is_doubtful:
            reasons = "; ".join(result.conformality.reasons)
            self.give_up(f"it may not be conformal: {reasons}", result)
        result.write(self.names)
        return result

    # -- is it a disk? -----------------------------------------------------------------

    def check(self, advance: Callable[[float], None]) -> None:
        """Find the boundary loop; MeshError if the surface is no disk."""
        names = self.engine.run(steps.examine, advance=advance)
        if not self.folder.has("loop"):
            loop = self.loop(names)
            if loop is None:
                self.refuse_surface()
            self.folder.write("loop", loop=loop)
        loop = self.folder.read("loop")["loop"]
        self.options.check_rows(self.m, loop)
        self.n_border = len(loop)

    def loop(self, names: list[str]) -> Ints | None:
        """(nB,) the boundary from the smallest vertex; None if the whole is no disk.

        Edges with both ends on seams, and those with one face in a part, come from all parts that
        have them. No edge with more than two faces, one component, Euler characteristic 1, and a
        boundary that does not touch itself: then there is no pinched vertex either.
        """
        keys = "half_edges", "component", "n_components", "n_inner", "sound"
        sides, components, n_components, n_inner, sound = self.folder.each(names, *keys)
        half_edges, offsets = np.concatenate(sides), np.cumsum([0, *n_components])
        first, edge = distinct_rows(np.sort(half_edges, axis=1))
        valence = np.bincount(edge)
        forward = np.where(half_edges[:, 0] < half_edges[:, 1], 1, -1)
        vertices, ends = np.unique(half_edges[valence[edge] == 1], return_inverse=True)
        component = np.concatenate([x + k for x, k in zip(components, offsets[:-1], strict=True)])
        joined = np.empty(len(first), np.int64)
        joined[edge] = component  # of one of the two sides
        is_disk = (
            all(sound)
            and len(vertices) > 0
            and valence.max() <= 2
            and not np.bincount(edge, forward)[valence == 2].any()
            and components_of_pairs(component, joined[edge], offsets[-1])[0] == 1
            and self.folder.vertices - len(first) - sum(n_inner) + self.m == 1
            and np.bincount(ends.ravel()).max() <= 2
        )
        if not is_disk:
            return None
        loop = libigl.path(ends.reshape(-1, 2))
        return vertices[np.roll(loop, -int(loop.argmin()))]

    def refuse_surface(self) -> NoReturn:
        """Raise the MeshError of `check`, for which the whole is read."""
        V, F = np.empty((self.folder.vertices, 3)), np.empty((self.m, 3), np.int64)
        for p in self.parts:
            part = Part(self.folder, p)
            V[part.vertices], F[part.faces] = part.V, part.vertices[part.F]
        refuse(Table(np.ldexp(V, self.folder.exponent, out=V)), Table(F))

    # -- the factor --------------------------------------------------------------------

    def factor(self, advance: Callable[[float], None]) -> None:
        """Condense the parts, and eliminate the seams, level by level from the leaves."""
        memory = self.require_room()
        self.condensed = self.engine.run(steps.eliminate, advance=advance)
        for level in range(self.folder.levels, 0, -1):
            cuts = [node for node in self.cuts if node.bit_length() == level]
            self.engine.run(steps.merge, of=cuts, memory=memory)
            for node in cuts:
                for side in (2 * node, 2 * node + 1):
                    self.folder.remove(f"schur-{side}")

    def require_room(self) -> float:
        """Find how many MiB the largest front takes to be made; OSError if the disk is too small.

        The smaller ones, which come first, are given as much: what does not fit is told at once.
        """
        rows, most, written = dict[int, Ints](), 0.0, 0
        node_of = self.folder.read("seams")["node"]
        self.n_seams = len(node_of)
        for p in self.parts:
            row = self.folder.read(f"part-{p}", "row")["row"]
            rows[self.folder.n_leaves + p] = np.sort(row[row >= 0])
            written += 8 * len(rows[self.folder.n_leaves + p]) ** 2
        for node in reversed(self.cuts):
            sides = [rows.pop(k) for k in (2 * node, 2 * node + 1) if k in rows]
            together = np.unique(np.concatenate(sides))
            rows[node] = together[node_of[together] != node]
            size, rest = len(together), len(rows[node])
            written += 8 * (size * (size - rest) + rest**2)
            # The front, the larger of its sides, and what is taken from it.
            most = max(most, 8 * (size**2 + max(map(len, sides)) ** 2 + 2 * rest**2) / 2**20)
        log.info(
            "the seams take up to %s MiB on disk and %s MiB of memory, a part some %s MiB",
            *(f"{x:,.0f}" for x in (written / 2**20, most, self.engine.memory)),
        )
        self.written, left = written, shutil.disk_usage(self.folder.work).free
        if written > left and not self.folder.has(named(steps.merge, 1)):
            reason = f"{written / 2**30:,.1f} GiB are needed and {left / 2**30:,.1f} GiB are free"
            raise OSError(errno.ENOSPC, reason, str(self.folder.work))
        return most

    def solve(self, g: Numbers) -> Numbers:
        """Solve for the values (s,) on seams, by right-hand sides g condensed to them, in place.

        The fronts are read one after the other, from the leaves and back.
        """
        x = g[:, None].view(float)
        for node in reversed(self.cuts):
            here, rest, L11, L21 = self.front(node)
            x[here] = solve_triangular(L11, x[here], lower=True, check_finite=False)
            x[rest] -= L21 @ x[here]
        for node in self.cuts:
            here, rest, L11, L21 = self.front(node)
            y = x[here] - L21.T @ x[rest]
            x[here] = solve_triangular(L11, y, lower=True, trans="T", check_finite=False)
        return g

    def front(self, node: int) -> tuple[Any, ...]:
        """Read which rows are eliminated at a cut and which are left, and L11 and L21."""
        front = self.folder.read(named(steps.merge, node))
        return front["here"], front["rest"], front["L11"], front["L21"]

    # -- Algorithm 1 -------------------------------------------------------------------

    def center(self) -> Center:
        """Find the central face, (13)-(15), in the few parts that may have it.

        In a part, the torsion function is at most what it is with 0 on the seams, and the most that
        it is there. Nothing is looked for in parts whose bound is below all candidates.
        """
        if not isinstance(self.options.center, str):
            return Center("given", int(self.options.center))
        rows, condensed, most = self.folder.each(self.condensed, "rows", "torsion", "most")
        u = np.zeros(self.n_seams)
        np.add.at(u, np.concatenate(rows), np.concatenate(condensed))
        self.folder.write("torsion", seams=self.solve(u), boundary=np.zeros(self.n_border))
        bound = most + 3 * np.array([u[some].max(initial=0) for some in rows])
        found, central = list[str](), np.empty(0)
        for k in np.argsort(-bound, kind="stable").tolist():
            if len(central) >= CANDIDATES and bound[k] < central[-CANDIDATES]:
                break
            found += self.engine.run(steps.central, of=[self.parts[k]])
            more = self.folder.read(found[-1], "central")["central"]
            central = np.sort(np.concatenate([central, more]))
        return self.most_central(found)

    def most_central(self, names: list[str]) -> Center:
        """Choose among the most central faces of some parts."""
        found = self.folder.each(names, "central", "candidates", "smallest")
        return Center("torsion", first_well_shaped(*map(np.concatenate, found)))

    def trace(self, face: int) -> tuple[Complex, bool]:
        """Boundary values (nB,), Theorem 1; and whether the face has a vertex on the boundary."""
        home = [p for p in self.parts if face in self.folder.read(f"part-{p}", "faces")["faces"]]
        [name] = self.engine.run(steps.dipole, face, of=home)
        sources = self.folder.read(name)
        g, n = np.zeros(self.n_seams, complex), self.n_border
        g[sources["rows"]] = -sources["seams"]
        self.solve(g)
        flux, around, points = np.zeros(n, complex), np.zeros(n), np.empty((n, 3))
        flux[sources["places"]] = sources["boundary"]
        for p in self.parts:
            side = self.folder.read(f"side-{p}")
            places = side["places"]
            flux[places] += side["side"].T @ g[side["rows"]]
            points[places] = side["positions"]
            around[places] += side["around"]
        shares = shares_of_edges(flux, lengths_along(points), around)
        return trace_of_shares(shares), bool(sources["on_boundary"])

    def extend(self, face: int, f_B: Complex, advance: Callable[[float], None]) -> None:
        """Extend boundary values harmonically, eq. (10), and take a sample of the faces."""
        g = np.zeros(self.n_seams, complex)
        for p in self.parts:
            side = self.folder.read(f"side-{p}", "rows", "places", "side")
            g[side["rows"]] -= side["side"] @ f_B[side["places"]]
        self.face, self.values = face, {"seams": self.solve(g), "boundary": f_B}
        self.folder.write(f"values-{face}", **self.values)
        rows = [evenly_spaced_rows(self.m, k) for k in (FEW_FACES, FACES)]
        rows += [faces_to_judge_by(self.m), sampled_faces(self.m)]
        self.folder.write("sample", faces=np.unique(np.concatenate(rows)))
        self.extended = self.engine.run(steps.extend, face, advance=advance)

    def gathered(self, names: list[str]) -> Gathered:
        """Gather the faces that steps have taken of their parts."""
        return Gathered.of([self.folder.read(name, *SOME) for name in names])

    def refuse_rescue(self, sample: Gathered, on_boundary: bool) -> None:
        """Give up where `disk_map` would correct the harmonic map, or doubt it."""
        few = sample.only(evenly_spaced_rows(self.m, FEW_FACES))
        if is_sheared(few, sample.f, self.values["boundary"]):
            self.give_up("the faces have a shear in common")
        if deep_vertex(sample.only(evenly_spaced_rows(self.m, FACES)), sample.f) is not None:
            self.give_up("a part of the surface is too small for double precision where it lies")
        if on_boundary:
            self.give_up("the central face lies at the boundary")

    def normalize(self, sample: Gathered) -> Normalization:
        """Find the best Möbius transformation that does no harm, (19) and (20); finish the parts.

        Sets `self.names` of the results and `self.final`, the values on seams and boundary.
        """
        method = self.options.mobius
        w, reason, finished = 0j, "", None
        if method is not None:
            some = sample.only(faces_to_judge_by(self.m))
            errors = AngleErrors.of(some.F, sample.f, some.angles)
            before = errors.mean(0j)
            w, finished, reason = harmless(
                least_angle_distortion(errors) if method == "angle" else self.barycenter(),
                lambda w: method == "area" or errors.mean(w) < before,
                lambda w: self.finish(w) if is_around(self.boundary(w)) else None,
                lambda: self.finish(0j)[1],
            )
        self.names, self.final = finished or self.finish(0j)[0]
        return Normalization(method or "none", w, reason)

    def barycenter(self) -> complex:
        """Find the point that goes to 0 for even area."""

        def means(w: complex) -> tuple[complex, complex]:
            mass, z, square, *_ = self.moments(w)[0]
            return complex(z / mass), complex(square / mass)

        return barycenter_by_moments(means)

    def moments(self, w: complex, *direction: float) -> tuple[Complex, Floats]:
        """Sum the moments of the parts, and take the extremes of their heights."""
        names = self.engine.run(steps.moments, self.face, w, *direction)
        moments, heights = self.folder.each(names, "moments", "heights")
        return np.sum(moments, axis=0), np.concatenate(heights)

    def boundary(self, w: complex) -> Complex:
        """(nB,) boundary values after psi_w."""
        return mobius_transformation(self.values["boundary"], w)

    def turn(self, w: complex) -> complex:
        """Find what f is divided by so that what `align` names lies at angle 0."""
        align = self.options.align
        if align is None:
            return complex(self.boundary(w)[0])
        if isinstance(align, int | np.integer):
            loop = self.folder.read("loop")["loop"]
            return complex(self.boundary(w)[loop == align][0])
        (mass, z, _, h, hz), heights = self.moments(w, *np.asarray(align, float).tolist())
        moment = complex(hz - h / mass * z)
        check_slope(align, moment, mass.real * float(np.ptp(heights)))
        return moment / abs(moment)

    def finish(self, w: complex) -> tuple[Finished, Ints]:
        """Apply psi_w and certify the parts: names of the results, values; flipped faces."""
        turn = self.turn(w)
        f_B = self.boundary(w) / turn
        f_B /= abs(f_B)
        seams = mobius_transformation(self.values["seams"], w) / turn
        final = {"seams": seams, "boundary": f_B, "turn": turn, "vertices": [], "moved": []}
        names = self.certified(w, final, self.parts)
        return (names, final), np.concatenate(self.folder.each(names, "flipped")[0])

    def certified(self, w: complex, final: Arrays, of: list[int]) -> list[str]:
        """Finish some parts with the values of seams, boundary and vertices that have moved."""
        digest = crc32(b"".join(np.asarray(x).tobytes() for x in final.values()))
        values = f"final-{digest:08x}"
        self.folder.write(values, **final)
        return self.engine.run(steps.finish, self.face, w, values, of=of)

    def repair(self, w: complex) -> Repair:
        """Repair flipped faces, if they are few, in their parts and those beside them."""
        [flipped] = self.folder.each(self.names, "flipped")
        n_flipped, rounds, moved = sum(map(len, flipped)), 0, dict[int, complex]()
        if n_flipped > MANY_FLIPPED * self.m:
            self.give_up(counted(n_flipped, "face is flipped", "faces are flipped"))
        [rows] = self.folder.each(self.condensed, "rows")
        for k in np.flatnonzero([len(faces) for faces in flipped]).tolist():
            near = [j for j, other in enumerate(rows) if j == k or np.isin(other, rows[k]).any()]
            vertices, piece, f = self.whole_of(near)
            g, repair = repair_locally(piece, f)
            changed = np.flatnonzero(g != f)
            moved |= dict(zip(vertices[changed].tolist(), g[changed].tolist(), strict=True))
            rounds += repair.rounds
            self.final["vertices"] = sorted(moved)
            self.final["moved"] = [moved[vertex] for vertex in sorted(moved)]
            names = self.certified(w, self.final, [self.parts[j] for j in near])
            for j, name in zip(near, names, strict=True):
                self.names[j] = name
        return Repair(n_flipped, len(moved), rounds)

    def whole_of(self, some: list[int]) -> tuple[Ints, DiskMesh, Complex]:
        """Make a mesh of some parts, whose border stays; its vertices in the whole, and f."""
        each = [Part(self.folder, self.parts[k]).all(self.names[k]) for k in some]
        found = Gathered.of(each)
        V, F, edges = found.mesh.V, found.mesh.F, found.mesh.edges
        border = np.unique(edges.ends(edges.valence == 1))
        return found.vertices, DiskMesh.piece(V, F, border), found.f

    def judge(self, **done: Any) -> PartsMap:
        """Certify and measure the whole; judge it by the faces that `disk_map` judges it by."""
        keys = "flipped", "n_exact", "degrees", "lost"
        flipped, n_exact, degrees, lost = self.folder.each(self.names, *keys)
        rows = np.sort(np.concatenate(flipped))
        certificate = certificate_of(self.final["boundary"], rows, int(sum(n_exact)))
        free, inscribed = np.moveaxis(np.array(degrees), 1, 0)
        distortion = of_free = _distortion(np.concatenate([free, inscribed]))
        if inscribed[:, 0].any() and free[:, 0].any():
            of_free = _distortion(free)
        n_lost, area, whole = map(sum, zip(*lost, strict=True))
        others = set(self.folder.work.glob("*.npz")) - set(self.folder.work.glob("merge-*.npz"))
        conformality = NOT_VALID
        if certificate.valid:
            near = self.gathered(self.names)
            faces = near.places(sampled_faces(self.m))
            errors = disk_map_distortion(near.mesh, coordinates(near.f))[faces]
            conformality = judge_by(near.mesh, near.f, errors, faces, distortion.mean)
        return PartsMap(
            folder=self.folder,
            certificate=certificate,
            conformality=conformality,
            distortion=distortion,
            distortion_of_free_faces=of_free,
            lost=(int(n_lost), float(area / whole)),
            moved_bytes=self.written + sum(file.stat().st_size for file in others),
            boundary=BoundaryMethod("geodesic"),
            timings=self.phase.seconds,
            **done,
        )

    def give_up(self, reason: str, result: Any = None) -> NoReturn:
        """Raise MapError: what is left to do is done on one machine only."""
        raise MapError(
            f"In parts, there is no map of this surface: {reason}. Where memory suffices, "
            "cdcp_igl.disk_map tries other boundaries, moves what is too small, straightens, "
            "repairs the whole interior, and refines.",
            result,
        )


def _distortion(sums: Floats) -> AngleDistortion:
    """Mean, SD and maximum by the sums of parts: number, sum, sum of squares and maximum."""
    number, total, squares, _ = sums.sum(axis=0)
    mean = total / number
    sd = np.sqrt(max(squares / number - mean**2, 0))
    return AngleDistortion(float(mean), float(sd), float(sums[:, 3].max()))
