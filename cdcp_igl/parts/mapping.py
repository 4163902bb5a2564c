"""Algorithm 1 over parts: what the steps of the parts leave to be done for the whole."""

from __future__ import annotations

import errno
import hashlib
import logging
import shutil
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NoReturn
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from .. import __version__, libigl
from ..arrays import (
    Complex,
    Floats,
    Ints,
    as_complex,
    coordinates,
    distinct_rows,
    evenly_spaced_rows,
)
from ..certificate import Certificate, certificate_of, is_around
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
from ..surface.topology import Topology, components_of_pairs, heads
from . import steps
from .part import Arrays, Folder, Part, Piece, named
from .parting import refuse
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
        If a part cannot be factored, or does not fit into memory.
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
    files = Folder.of(Path(folder), f"map-{digest}")
    if (files.work / RESULT).exists():
        return PartsMap.read(files)
    files.work.mkdir(exist_ok=True)
    for attempts in files.work.glob("*.attempts"):  # of a run that was stopped
        attempts.unlink()
    with closing(Engine(files, executor, solver)) as engine, one_thread():
        return _Mapping(files, engine, options, Phases(progress), engine_of).run()


def _solver_name() -> str:
    chosen = solver()
    order = "AMD" if chosen.ORDERS else "minimum degree"
    return f"{chosen.LIBRARY} ({chosen.PACKAGE}, {order} ordering in parts, {chosen.MODE} mode)"


@dataclass(frozen=True, eq=False)
class _Sample:
    """Some faces of the whole, by their rows, as a mesh of its own; and its map f (n,)."""

    rows: Ints
    vertices: Ints
    mesh: Piece
    f: Complex

    @classmethod
    def of(cls, folder: Folder, names: Iterable[str]) -> _Sample:
        """Gather what steps have taken of their parts."""
        found = folder.each(names, "faces", "corners", "V", "images", "on_boundary")
        rows, corners, V, images, border = map(np.concatenate, found)
        order = np.argsort(rows)
        vertices, F = np.unique(corners, return_inverse=True)
        F = F.reshape(-1, 3)
        positions, f = np.empty((len(vertices), 3)), np.empty(len(vertices), complex)
        positions[F], f[F] = V, images
        mesh = Piece(positions, F[order], np.unique(F[border]))
        return cls(rows[order], vertices, mesh, f)

    def of_faces(self, rows: Ints) -> Piece:
        """Take some of the faces, by their rows in the whole, as a mesh."""
        return Piece(self.mesh.V, self.mesh.F[self.places(rows)], self.mesh.loop)

    def places(self, rows: Ints) -> Ints:
        """Find faces of the whole in the sample."""
        return np.searchsorted(self.rows, rows)


class _Mapping:
    """One map: the steps of Algorithm 1, each of the parts first and then of the whole."""

    def __init__(
        self, folder: Folder, engine: Engine, options: Options, phase: Phases, solver: str
    ) -> None:
        self.folder, self.engine, self.options, self.phase = folder, engine, options, phase
        self.solver, self.leaves, self.m = solver, folder.leaves, folder.manifest["faces"]

    def run(self) -> PartsMap:
        """Map the surface and write the result."""
        phase = self.phase
        with phase("check") as advance:
            self.check(advance)
        with phase("factor") as advance:
            self.factor(advance)
        bound: Floats | None = None
        while True:
            with phase("center"):
                center = self.center(bound)
            with phase("trace"):
                trace, on_boundary = self.trace(center.face)
            with phase("circle"):
                try:
                    f_B = onto_circle(trace)
                except Rejected as reason:
                    self.give_up(str(reason))
            with phase("extension") as advance:
                highest = self.extend(center.face, f_B, advance)
            # Where weights are negative, the torsion may be larger than its bound.
            if bound is not None or not (highest[self.unvisited] > self.threshold).any():
                break
            bound = highest
        sample = _Sample.of(self.folder, self.extended)
        self.refuse_rescue(sample, on_boundary)
        judged = sample.mesh.F[sample.places(sampled_faces(self.m))]
        self.folder.write("near", {"vertices": np.unique(sample.vertices[judged])})
        with phase("mobius"):
            mobius = self.normalize(sample)
        with phase("repair"):
            repair = self.repair(mobius.w)
        with phase("certificate"):
            found = self.judge()
            for p, name in zip(self.leaves, self.names, strict=True):
                self.folder.write_uv(p, self.folder.read(name, "uv")["uv"])
        phase.done()
        result = PartsMap(
            folder=self.folder,
            center=center,
            boundary=BoundaryMethod("geodesic"),
            mobius=mobius,
            repair=repair,
            solver=self.solver,
            timings=phase.seconds,
            **found,
        )
        if not result.valid:
            self.give_up(f"it would not be a bijection: {result.certificate}", result)
        if result.conformality.is_doubtful:
            self.give_up(f"it may not be conformal: {result.conformality}", result)
        result.write()
        return result

    # -- is it a disk? -----------------------------------------------------------------

    def check(self, advance: Callable[[float], None]) -> None:
        """Find the boundary loop; MeshError if the surface is no disk."""
        names = self.engine.run(steps.examine, advance=advance)
        if not self.folder.has("loop"):
            loop = self.loop(names)
            if loop is None:
                self.refuse_surface()
            self.folder.write("loop", {"loop": loop})
        self.options.check_rows(self.m, self.folder.read("loop")["loop"])

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
            and self.folder.manifest["vertices"] - len(first) - sum(n_inner) + self.m == 1
            and np.bincount(ends.ravel()).max() <= 2
        )
        if not is_disk:
            return None
        loop = libigl.path(ends.reshape(-1, 2))
        return vertices[np.roll(loop, -int(loop.argmin()))]

    def refuse_surface(self) -> NoReturn:
        """Raise the MeshError of `check`, for which the whole is read."""
        manifest = self.folder.manifest
        V, F = np.empty((manifest["vertices"], 3)), np.empty((self.m, 3), np.int64)
        for p in self.leaves:
            part = Part(self.folder, p)
            V[part.vertices], F[part.faces] = part.V, part.vertices[part.F]
        refuse([np.ldexp(V, manifest["exponent"], out=V)], [F])

    # -- the factor --------------------------------------------------------------------

    def factor(self, advance: Callable[[float], None]) -> None:
        """Condense the parts, and eliminate the seams, level by level from the leaves."""
        memory = self.require_room()
        self.engine.run(steps.eliminate, advance=advance)
        for level in range(self.folder.manifest["levels"] - 1, -1, -1):
            cuts = [node for node in self.folder.cuts if node.bit_length() == level + 1]
            largest = max((memory[node] for node in cuts), default=0)
            self.engine.run(steps.merge, of=cuts, memory=largest / 2**20)
            for node in cuts:
                for side in (2 * node, 2 * node + 1):
                    self.folder.remove(f"schur-{side}")

    def require_room(self) -> dict[int, float]:
        """Find how many bytes each front takes to be made; OSError if the disk is too small."""
        rows, memory, written = dict[int, Ints](), dict[int, float](), 0
        for p in self.leaves:
            row = self.folder.part(p, "row")["row"]
            rows[self.folder.n_leaves + p] = np.sort(row[row >= 0])
            written += 8 * len(rows[self.folder.n_leaves + p]) ** 2
        for node in reversed(self.folder.cuts):
            sides = [rows.pop(k) for k in (2 * node, 2 * node + 1) if k in rows]
            together = np.unique(np.concatenate(sides))
            rows[node] = together[self.folder.seams[together] != node]
            size, rest = len(together), len(rows[node])
            written += 8 * (size * (size - rest) + rest**2)
            # The front, the larger of its sides, and what is taken from it.
            memory[node] = 8.0 * (size**2 + max(map(len, sides)) ** 2 + 2 * rest**2)
        most, left = max(memory.values(), default=0), shutil.disk_usage(self.folder.work).free
        log.info(
            "the seams take up to %s MiB on disk and %s MiB of memory, a part some %s MiB",
            *(f"{x:,.0f}" for x in (written / 2**20, most / 2**20, self.engine.memory)),
        )
        if written > left and not self.folder.has(named(steps.merge, 1)):
            reason = f"{written / 2**30:,.1f} GiB are needed and {left / 2**30:,.1f} GiB are free"
            raise OSError(errno.ENOSPC, reason, str(self.folder.work))
        return memory

    def solve(self, g: Floats) -> Floats:
        """Solve for the values (s, k) on seams, by right-hand sides (s, k) condensed to them."""
        x = g.copy()
        for node in reversed(self.folder.cuts):
            front = self.folder.read(named(steps.merge, node))
            here, L11 = front["here"], front["L11"]
            y = solve_triangular(L11, x[here], lower=True, check_finite=False)
            x[here] = y
            x[front["rest"]] -= front["L21"] @ y
        for node in self.folder.cuts:
            front = self.folder.read(named(steps.merge, node))
            here, L11 = front["here"], front["L11"]
            y = x[here] - front["L21"].T @ x[front["rest"]]
            x[here] = solve_triangular(L11, y, lower=True, trans="T", check_finite=False)
        return x

    def on_seams(self, columns: int) -> Floats:
        """(s, k) zeros."""
        return np.zeros((len(self.folder.seams), columns))

    # -- Algorithm 1 -------------------------------------------------------------------

    def center(self, bound: Floats | None) -> Center:
        """Find the central face, (13)-(15), in the few parts that may have it.

        In a part, the torsion function is at most what it is with 0 on the seams, and the most that
        it is there. Nothing is looked for in the parts `unvisited`, whose bound is below the
        `threshold`.
        """
        self.unvisited, self.threshold = np.empty(0, np.int64), -np.inf
        if not isinstance(self.options.center, str):
            return Center("given", int(self.options.center))
        names = [named(steps.eliminate, p) for p in self.leaves]
        rows, condensed, most = self.folder.each(names, "rows", "torsion", "most")
        if not self.folder.has("torsion"):
            g = self.on_seams(1)
            for some, values in zip(rows, condensed, strict=True):
                g[some, 0] += values
            self.folder.write("torsion", {"torsion": self.solve(g)[:, 0]})
        if bound is None:
            u = self.folder.read("torsion")["torsion"]
            on_seams = np.array([u[some].max(initial=0) for some in rows])
            bound = np.array(most) + 3 * on_seams
        found: list[str] = []
        order = np.argsort(-bound, kind="stable")
        for k in order:
            if bound[k] < self.threshold:
                break
            found += self.engine.run(steps.central, of=[self.leaves[k]])
            keys = "centrality", "faces", "smallest"
            candidates = list(map(np.concatenate, self.folder.each(found, *keys)))
            if len(candidates[0]) >= CANDIDATES:
                self.threshold = float(np.sort(candidates[0])[-CANDIDATES])
        self.unvisited = order[len(found) :]
        return Center("torsion", first_well_shaped(*candidates))

    def trace(self, face: int) -> tuple[Complex, bool]:
        """Boundary values (nB,), Theorem 1; and whether the face has a vertex on the boundary."""
        home = [p for p in self.leaves if face in self.folder.part(p, "faces")["faces"]]
        [name] = self.engine.run(steps.dipole, face, of=home)
        sources = self.folder.read(name)
        g = self.on_seams(2)
        g[sources["rows"]] = -coordinates(sources["seams"])
        g = self.solve(g)
        n = len(self.folder.read("loop")["loop"])
        flux, around, points = np.zeros((n, 2)), np.zeros(n), np.empty((n, 3))
        flux[sources["places"]] = coordinates(sources["boundary"])
        for p in self.leaves:
            side = self.folder.read(f"side-{p}")
            flux[side["places"]] += side["side"].T @ g[side["rows"]]
            x = self.folder.read(named(steps.eliminate, p), "places", "positions", "around")
            points[x["places"]] = x["positions"]
            around[x["places"]] += x["around"]
        shares = shares_of_edges(as_complex(flux), lengths_along(points), around)
        return trace_of_shares(shares), bool(sources["on_boundary"])

    def extend(self, face: int, f_B: Complex, advance: Callable[[float], None]) -> Floats:
        """Extend boundary values harmonically, eq. (10); (parts,) highest torsion of a face."""
        self.face, values = face, f"values-{face}"
        if not self.folder.has(values):
            g = self.on_seams(2)
            for p in self.leaves:
                side = self.folder.read(f"side-{p}")
                g[side["rows"]] -= side["side"] @ coordinates(f_B[side["places"]])
            on_seams = as_complex(self.solve(g))
            self.folder.write(values, {"seams": on_seams, "boundary": f_B})
        rows = [evenly_spaced_rows(self.m, k) for k in (FEW_FACES, FACES)]
        rows += [faces_to_judge_by(self.m), sampled_faces(self.m)]
        self.folder.write("sample", {"faces": np.unique(np.concatenate(rows))})
        self.extended = self.engine.run(steps.extend, face, advance=advance)
        self.values = self.folder.read(values)
        return np.array(self.folder.each(self.extended, "highest")[0])

    def refuse_rescue(self, sample: _Sample, on_boundary: bool) -> None:
        """Give up where `disk_map` would correct the harmonic map, or doubt it."""
        few = sample.of_faces(evenly_spaced_rows(self.m, FEW_FACES))
        if is_sheared(few, sample.f, self.values["boundary"]):
            self.give_up("the faces have a shear in common")
        if deep_vertex(sample.of_faces(evenly_spaced_rows(self.m, FACES)), sample.f) is not None:
            self.give_up("a part of the surface is too small for double precision where it lies")
        if on_boundary:
            self.give_up("the central face lies at the boundary")

    def normalize(self, sample: _Sample) -> Normalization:
        """Find the best Möbius transformation that does no harm, (19) and (20); finish the parts.

        Sets `self.names` of the results and `self.final`, the values on seams and boundary.
        """
        method = self.options.mobius
        if method is None:
            self.names, self.final = self.unmoved()[0]
            return Normalization()
        some = sample.of_faces(faces_to_judge_by(self.m))
        errors = AngleErrors.of(some.F, sample.f, some.angles)
        before = errors.mean(0j)
        w, finished, reason = harmless(
            least_angle_distortion(errors) if method == "angle" else self.barycenter(),
            lambda w: method == "area" or errors.mean(w) < before,
            self.finish,
            lambda: self.unmoved()[1],
        )
        self.names, self.final = finished or self.unmoved()[0]
        return Normalization(method, w, reason)

    def barycenter(self) -> complex:
        """Find the point that goes to 0 for even area."""

        def means(w: complex) -> tuple[complex, complex]:
            mass, z, square, *_ = self.moments(w)[0]
            return complex(z / mass.real), complex(square / mass.real)

        return barycenter_by_moments(means)

    def moments(self, w: complex, *direction: float) -> tuple[Complex, Floats]:
        """Sum the moments of the parts, and take the extremes of their heights."""
        names = self.engine.run(steps.moments, self.face, w, *direction)
        moments, heights = self.folder.each(names, "moments", "heights")
        for name in names:
            self.folder.remove(name)
        return np.sum(moments, axis=0), np.concatenate(heights)

    def turn(self, w: complex, f_B: Complex) -> complex:
        """Find what f is divided by so that what `align` names lies at angle 0."""
        align = self.options.align
        if align is None:
            return complex(f_B[0])
        if isinstance(align, int | np.integer):
            loop = self.folder.read("loop")["loop"]
            return complex(f_B[loop == align][0])
        (mass, z, _, h, hz), heights = self.moments(w, *np.asarray(align, float).tolist())
        moment = complex(hz - h / mass * z)
        check_slope(align, moment, mass.real * float(np.ptp(heights)))
        return moment / abs(moment)

    def finish(self, w: complex) -> tuple[Finished, Ints] | None:
        """Apply psi_w and certify the parts: names of the results, values; flipped faces.

        None where the boundary is crowded.
        """
        f_B = mobius_transformation(self.values["boundary"], w)
        turn = self.turn(w, f_B)
        f_B = f_B / turn
        f_B /= abs(f_B)
        if not is_around(f_B):
            return None
        final = {
            "seams": mobius_transformation(self.values["seams"], w) / turn,
            "boundary": f_B,
            "turn": turn,
            "vertices": np.empty(0, np.int64),
            "moved": np.empty(0, complex),
        }
        names = self.certified(w, final, self.leaves)
        return (names, final), np.concatenate(self.folder.each(names, "flipped")[0])

    def unmoved(self) -> tuple[Finished, Ints]:
        """Do what `finish` does, without a Möbius transformation: the boundary is not crowded."""
        finished = self.finish(0j)
        assert finished is not None
        return finished

    def certified(self, w: complex, final: Arrays, of: list[int]) -> list[str]:
        """Finish some parts with the values of seams, boundary and vertices that have moved."""
        digest = crc32(b"".join(np.asarray(x).tobytes() for x in final.values()))
        values = f"final-{digest:08x}"
        self.folder.write(values, final)
        return self.engine.run(steps.finish, self.face, w, values, of=of)

    def repair(self, w: complex) -> Repair:
        """Repair flipped faces, if they are few, in their parts and those beside them."""
        [flipped] = self.folder.each(self.names, "flipped")
        n_flipped = sum(map(len, flipped))
        if n_flipped == 0:
            return Repair()
        if n_flipped > MANY_FLIPPED * self.m:
            self.give_up(counted(n_flipped, "face is flipped", "faces are flipped"))
        [rows] = self.folder.each([named(steps.eliminate, p) for p in self.leaves], "rows")
        rounds, touched, moved = 0, set[int](), dict[int, complex]()
        for k in np.flatnonzero([len(faces) for faces in flipped]).tolist():
            near = [j for j, other in enumerate(rows) if j == k or np.isin(other, rows[k]).any()]
            vertices, piece, f = self.gathered(near, moved)
            g, repair = repair_locally(piece, f)
            changed = np.flatnonzero(g != f)
            moved |= dict(zip(vertices[changed].tolist(), g[changed].tolist(), strict=True))
            rounds += repair.rounds
            touched.update(near)
        self.final["vertices"] = np.array(sorted(moved), np.int64)
        self.final["moved"] = np.array([moved[vertex] for vertex in sorted(moved)], complex)
        order = sorted(touched)
        names = self.certified(w, self.final, [self.leaves[k] for k in order])
        for k, name in zip(order, names, strict=True):
            self.names[k] = name
        return Repair(n_flipped, len(moved), rounds)

    def gathered(self, some: list[int], moved: dict[int, complex]) -> tuple[Ints, Piece, Complex]:
        """Make a mesh of some parts, whose border stays; its vertices in the whole, and f."""
        parts = [Part(self.folder, self.leaves[k]) for k in some]
        [uv] = self.folder.each([self.names[k] for k in some], "uv")
        vertices = np.unique(np.concatenate([part.vertices for part in parts]))
        V, f, F = np.empty((len(vertices), 3)), np.empty(len(vertices), complex), []
        for part, points in zip(parts, uv, strict=True):
            at = np.searchsorted(vertices, part.vertices)
            V[at], f[at] = part.V, as_complex(points)
            F.append(at[part.F])
        for row, vertex in enumerate(vertices.tolist()):
            f[row] = moved.get(vertex, f[row])
        surface = Topology(np.concatenate(F), len(vertices))
        border = surface.F.T.ravel()[surface.border], heads(surface.F.T.ravel())[surface.border]
        return vertices, Piece(V, surface.F, np.unique(np.concatenate(border))), f

    def judge(self) -> dict[str, Any]:
        """Certify and measure the whole; judge it by the faces that `disk_map` judges it by."""
        keys = "flipped", "n_exact", "finite", "degrees", "lost"
        flipped, n_exact, finite, degrees, lost = self.folder.each(self.names, *keys)
        rows = np.sort(np.concatenate(flipped))
        certificate = Certificate(False, np.inf, False, 0, rows, 0)
        if all(finite):
            certificate = certificate_of(self.final["boundary"], rows, int(sum(n_exact)))
        free, inscribed = np.moveaxis(np.array(degrees), 1, 0)
        distortion = of_free = _distortion(np.concatenate([free, inscribed]))
        if inscribed[:, 0].any() and free[:, 0].any():
            of_free = _distortion(free)
        n_lost, area, whole = map(sum, zip(*lost, strict=True))
        conformality = NOT_VALID
        if certificate.valid:
            near = _Sample.of(self.folder, self.names)
            faces = near.places(sampled_faces(self.m))
            errors = disk_map_distortion(near.mesh, coordinates(near.f))[faces]
            conformality = judge_by(near.mesh, near.f, errors, faces, distortion.mean)
        return {
            "certificate": certificate,
            "conformality": conformality,
            "distortion": distortion,
            "distortion_of_free_faces": of_free,
            "lost": (int(n_lost), float(area / whole)),
            "moved_bytes": sum(file.stat().st_size for file in self.folder.computed()),
        }

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
