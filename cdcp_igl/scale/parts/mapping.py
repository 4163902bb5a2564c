"""Algorithm 1 over parts: what the steps of the parts leave to be done for the whole."""

from __future__ import annotations

import errno
import logging
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from itertools import compress
from os import PathLike
from pathlib import Path
from typing import Any, Literal, NoReturn
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from ... import __version__, libigl
from ...arguments import typed
from ...arrays import Complex, Floats, Ints, Numbers, distinct_rows, evenly_spaced_rows
from ...descent.repair import repair_locally
from ...errors import MapError, counted
from ...maps.rules import FEW_FLIPPED
from ...options import Options
from ...phases import Phases, Progress
from ...records import BoundaryMethod, Repair
from ...solve import solvers
from ...solve.solvers import SolverName, using
from ...solve.threads import one_thread
from ...starts.recentring import FEW_FACES, deep_vertex
from ...starts.straightening import is_sheared
from ...steps.center import CANDIDATES, Center, first_well_shaped
from ...steps.circle import Rejected, onto_circle
from ...steps.least_distortion import AngleErrors, faces_to_judge_by
from ...steps.mobius import (
    Normalization,
    barycenter_by_moments,
    check_slope,
    harmless,
    mobius_transformation,
    nearest_to,
)
from ...steps.trace import lengths_along, shares_of_edges, trace_of_shares
from ...surface.mesh import Mesh
from ...surface.topology import components_of_pairs
from ...verdict.certificate import certificate_of, is_around
from ...verdict.conformality import judge_by, sampled_faces
from ...verdict.distortion import AngleDistortion, map_distortion
from ..batching.executors import Executor
from . import tasks
from .part import Arrays, Folder, Gathered, Part, among, named
from .parting import Table, refuse
from .result import RESULT, PartsMap
from .running import Engine

log = logging.getLogger("cdcp_igl")

Finished = tuple[dict[int, str], Arrays]  # the results of the parts, and what they were given


@typed
def parts_map(
    folder: str | PathLike[str],
    *,
    executor: int | Executor | None = None,
    center: Literal["torsion"] | int = "torsion",
    mobius: Literal["angle", "area"] | None = "angle",
    align: int | ArrayLike | None = None,
    solver: SolverName | None = None,
    progress: Progress | None = None,
) -> PartsMap:
    """Map a surface in parts onto the disk: the map of `disk_map`, in a fraction of its memory.

    Everything that is computed is a file in a folder beside the parts, and what is there is not
    computed again: a run that was stopped goes on. These files are removed at the end; the map
    stays there, and is found when it is asked for again. There is no refinement, whose steps need
    the whole surface.

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
        If the surface is no disk: as `check` says, which then reads the whole surface. Or if a file
        in the folder is damaged.
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
        order = "AMD" if solvers.solver().ORDERS else "minimum degree"
        name = solvers.solver().described(f"{order} ordering in parts")
    chosen = repr((__version__, name, center, mobius, np.asarray(align).tolist()))
    work = f"map-{crc32(chosen.encode()):08x}"
    files = Folder.of(Path(folder).absolute(), work)  # wherever workers are
    phase = Phases(progress)
    if (files.work / RESULT).exists():
        result = PartsMap.read(files)
        phase.done()
        return result
    files.work.mkdir(exist_ok=True)
    for attempts in files.work.glob("*.attempts"):  # of a run that was stopped
        attempts.unlink()
    with closing(Engine(files, executor, solver)) as engine, one_thread():
        return _Mapping(files, engine, options, phase).run(name)


class _Mapping:
    """One map: the steps of Algorithm 1, each of the parts first and then of the whole."""

    def __init__(self, folder: Folder, engine: Engine, options: Options, phase: Phases) -> None:
        self.folder, self.engine, self.options, self.phase = folder, engine, options, phase
        self.border = slice(folder.seams, None)  # of the table of seams and boundary

    def run(self, name: str) -> PartsMap:
        """Map the surface and write the result; `name` is the solver's."""
        phase = self.phase
        with phase("check") as advance:
            self.check(advance)
        with phase("factor") as advance:
            self.factor(advance)
        with phase("center"):
            found = self.center()
        center = None
        while found != center:  # thrice at most: once all parts are extended, all are asked
            center = found
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
            found = center if center.method == "given" else self.most_central(self.extended)
        sample = self.sample()
        self.refuse_rescue(sample, on_boundary)
        with phase("mobius"):
            mobius = self.normalize(sample)
        with phase("repair"):
            repair = self.repair()
        with phase("certificate"):
            result = self.judge(sample, center=center, mobius=mobius, repair=repair, solver=name)
        phase.done()
        result.write(self.finished)
        return result

    # -- is it a disk? -----------------------------------------------------------------

    def check(self, advance: Callable[[float], None]) -> None:
        """Find the boundary loop; MeshError if the surface is no disk."""
        loop = self.loop(self.engine.run(tasks.examine, advance=advance))
        self.options.check_rows(self.folder.faces, loop)
        self.folder.write("loop", loop=loop)
        align = self.options.align  # first on the loop, if no other vertex is named
        self.first = loop.tolist().index(align) if isinstance(align, int | np.integer) else 0
        self.size = self.folder.seams + len(loop)

    def loop(self, names: dict[int, str]) -> Ints:
        """(nB,) the boundary from the smallest vertex; MeshError if the whole is no disk.

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
        component = np.concatenate([x + k for x, k in zip(components, offsets, strict=False)])
        joined = component[first][edge]  # that of one of the sides
        if not (
            all(sound)
            and len(vertices) > 0
            and valence.max() <= 2
            and not np.bincount(edge, forward)[valence == 2].any()
            and components_of_pairs(component, joined, offsets[-1])[0] == 1
            and self.folder.vertices - len(first) - sum(n_inner) + self.folder.faces == 1
            and np.bincount(ends.ravel()).max() <= 2
        ):
            self.refuse_surface()
        loop = libigl.path(ends.reshape(-1, 2))
        return vertices[np.roll(loop, -int(loop.argmin()))]

    def refuse_surface(self) -> NoReturn:
        """Raise the MeshError of `check`, for which the whole is read."""
        V, F = np.empty((self.folder.vertices, 3)), np.empty((self.folder.faces, 3), np.int64)
        for p in self.folder.parts:
            part = Part(self.folder, p)
            V[part.vertices], F[part.faces] = part.V, part.vertices[part.F]
        refuse(Table(np.ldexp(V, self.folder.exponent, out=V)), Table(F))

    # -- the factor --------------------------------------------------------------------

    def factor(self, advance: Callable[[float], None]) -> None:
        """Condense the parts, and eliminate the seams, level by level from the leaves."""
        memory = self.require_room()
        self.condensed = self.engine.run(tasks.eliminate, advance=advance)
        for level in range(self.folder.levels, 0, -1):
            cuts = [node for node in self.folder.cuts if node.bit_length() == level]
            self.engine.run(tasks.merge, of=cuts, memory=memory)
            for node in cuts:
                for side in (2 * node, 2 * node + 1):
                    self.folder.file(f"schur-{side}").unlink(missing_ok=True)

    def require_room(self) -> float:
        """Find how many MiB the largest front takes to be made; OSError if the disk is too small.

        The smaller ones, which come first, are given as much: what does not fit is told at once.
        """
        rows, most, written = dict[int, Ints](), 0.0, 0
        node_of = self.folder.read("seams")["node"]
        for p in self.folder.parts:
            row = self.folder.read(f"part-{p}", "row")["row"]
            rows[self.folder.n_leaves + p] = np.sort(row[row >= 0])
            written += 8 * int(np.count_nonzero(row >= 0)) ** 2
        for node in reversed(self.folder.cuts):
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
        if written > left and not self.folder.has(named(tasks.merge, 1)):
            reason = f"{written / 2**30:,.1f} GiB are needed and {left / 2**30:,.1f} GiB are free"
            raise OSError(errno.ENOSPC, reason, str(self.folder.work))
        return most

    def solve(self, g: Numbers) -> Numbers:
        """Solve for the values on seams, by right-hand sides g condensed to them, in place.

        The fronts are read one after the other, from the leaves and back.
        """
        x, cuts = g[:, None].view(float), self.folder.cuts
        for node in reversed(cuts):
            here, rest, L11, L21 = self.folder.read(named(tasks.merge, node)).values()
            x[here] = solve_triangular(L11, x[here], lower=True, check_finite=False)
            x[rest] -= L21 @ x[here]
        for node in cuts:
            here, rest, L11, L21 = self.folder.read(named(tasks.merge, node)).values()
            y = x[here] - L21.T @ x[rest]
            x[here] = solve_triangular(L11, y, lower=True, trans="T", check_finite=False)
        return g

    # -- Algorithm 1 -------------------------------------------------------------------

    def center(self) -> Center:
        """Find the central face, (13)-(15), in the few parts that may have it.

        In a part, the torsion function is at most what it is with 0 on the seams, and the most that
        it is there. Nothing is looked for in parts whose bound is below all candidates.
        """
        if not isinstance(self.options.center, str):
            return Center("given", int(self.options.center))
        rows, condensed, most = self.folder.each(self.condensed, "rows", "torsion", "most")
        u = np.zeros(self.size)
        np.add.at(u, np.concatenate(rows), np.concatenate(condensed))
        u[self.border] = 0
        self.folder.write("torsion", table=self.solve(u))
        bound = most + 3 * np.array([u[some].max(initial=0) for some in rows])
        found, central = dict[int, str](), np.empty(0)
        for k in np.argsort(-bound, kind="stable").tolist():
            if len(central) >= CANDIDATES and bound[k] < central[-CANDIDATES]:
                break
            found |= self.engine.run(tasks.central, of=[self.folder.parts[k]])
            central = np.sort(np.concatenate(self.folder.each(found, "central")[0]))
        return self.most_central(found)

    def most_central(self, names: dict[int, str]) -> Center:
        """Choose among the most central faces of some parts."""
        found = self.folder.each(names, "central", "candidates", "smallest")
        return Center("torsion", first_well_shaped(*map(np.concatenate, found)))

    def trace(self, face: int) -> tuple[Complex, bool]:
        """Boundary values (nB,), Theorem 1; and whether the face has a vertex on the boundary."""
        parts = self.folder.parts
        home = [p for p in parts if face in self.folder.read(f"part-{p}", "faces")["faces"]]
        [name] = self.engine.run(tasks.dipole, face, of=home).values()
        dipole, g = self.folder.read(name), np.zeros(self.size, complex)
        g[dipole["rows"]] = -dipole["flux"]
        self.solve(g)
        for here, there, side in self.sides():
            g[there] -= side.T @ g[here]
        keys = "rows", "positions", "around"
        rows, V, angles = map(np.concatenate, self.folder.each(self.condensed, *keys))
        points, around = np.empty((self.size, 3)), np.zeros(self.size)
        points[rows] = V
        np.add.at(around, rows, angles)
        points, around, flux = points[self.border], around[self.border], -g[self.border]
        shares = shares_of_edges(flux, lengths_along(points), around)
        return trace_of_shares(shares), bool(dipole["on_boundary"])

    def sides(self) -> Iterator[tuple[Ints, Ints, Floats]]:
        """Yield of each part its rows on seams and on the boundary, and the block of the two."""
        for name in self.condensed.values():
            rows, side = self.folder.read(name, "rows", "side").values()
            yield rows[: len(side)], rows[len(side) :], side

    def extend(self, face: int, f_B: Complex, advance: Callable[[float], None]) -> None:
        """Extend boundary values harmonically, eq. (10)."""
        g = np.append(np.zeros(self.folder.seams, complex), f_B)
        for here, there, side in self.sides():
            g[here] -= side @ g[there]
        self.face, self.table = face, self.solve(g)
        self.folder.write(f"values-{face}", table=g)
        self.extended = self.engine.run(tasks.extend, face, advance=advance)

    def sample(self) -> Gathered:
        """Gather the faces by which `disk_map` judges a map, and chooses w."""
        m = self.folder.faces
        spread = evenly_spaced_rows(m, FEW_FACES), faces_to_judge_by(m)
        rows = np.unique(np.concatenate([*spread, sampled_faces(m)]))
        return Gathered.of(self.folder, self.extended, lambda part: among(rows, part.faces))

    def refuse_rescue(self, sample: Gathered, on_boundary: bool) -> None:
        """Give up where `disk_map` would correct the harmonic map, or doubt it."""
        few = sample.only(evenly_spaced_rows(self.folder.faces, FEW_FACES))
        if is_sheared(sample.f, few.F, few.angles):
            self.give_up("the faces have a shear in common")
        if deep_vertex(few, sample.f, few.F) is not None:
            self.give_up("a part of the surface is too small for double precision where it lies")
        if on_boundary:
            self.give_up("the central face lies at the boundary")

    def normalize(self, sample: Gathered) -> Normalization:
        """Find the best Möbius transformation that does no harm, (19) and (20); finish the parts.

        Sets `self.finished`, the results, and `self.final`, what they were given.
        """
        method = self.options.mobius
        if method is None:
            made, done = self.finish(0j)[0], Normalization()
        else:
            some = sample.only(faces_to_judge_by(self.folder.faces))
            errors = AngleErrors.of(some.F, sample.f, some.angles)
            w, most = self.barycenter(), np.inf
            if method == "angle":
                w, most = nearest_to(w, errors)
            made, done = harmless(
                *(method, w, lambda w: errors.mean(w) <= most),
                lambda w: self.finish(w) if is_around(self.moved(w)[self.border]) else None,
                lambda: self.finish(0j),
            )
        self.finished, self.final = made
        return done

    def barycenter(self) -> complex:
        """Find the point that goes to 0 for even area."""

        def means(w: complex) -> tuple[complex, complex]:
            mass, z, square, *_ = self.moments(w)[0]
            return complex(z / mass), complex(square / mass)

        return barycenter_by_moments(means)

    def moments(self, w: complex, *direction: float) -> tuple[Complex, Floats]:
        """Sum the moments of the parts, and take the extremes of their heights."""
        names = self.engine.run(tasks.moments, self.face, w, *direction)
        moments, heights = self.folder.each(names, "moments", "heights")
        return np.sum(moments, axis=0), np.concatenate(heights)

    def moved(self, w: complex) -> Complex:
        """Take the values on seams and boundary to those after psi_w."""
        return mobius_transformation(self.table, w)

    def turn(self, w: complex) -> complex:
        """Find what f is divided by so that what `align` names lies at angle 0."""
        align = self.options.align
        if align is None or isinstance(align, int | np.integer):
            return complex(self.moved(w)[self.border][self.first])
        (mass, z, _, h, hz), heights = self.moments(w, *np.asarray(align, float).tolist())
        moment = complex(hz - h / mass * z)
        check_slope(align, moment, mass.real * float(np.ptp(heights)))
        return moment / abs(moment)

    def finish(self, w: complex) -> tuple[Finished, Ints]:
        """Apply psi_w and certify the parts: names of the results, values; flipped faces."""
        turn = self.turn(w)
        table = self.moved(w) / turn
        table[self.border] /= abs(table[self.border])
        final = {"w": w, "turn": turn, "table": table, "vertices": [], "moved": []}
        names = self.certified(final, self.folder.parts)
        return (names, final), np.concatenate(self.folder.each(names, "flipped")[0])

    def certified(self, final: Arrays, of: Iterable[int]) -> dict[int, str]:
        """Finish some parts with the values of seams, boundary and vertices that have moved."""
        digest = crc32(b"".join(np.asarray(x).tobytes() for x in final.values()))
        self.folder.write(values := f"final-{digest:08x}", **final)
        return self.engine.run(tasks.finish, self.face, values, of=of)

    def repair(self) -> Repair:
        """Repair flipped faces, if they are few, in their parts and those beside them."""
        [rows] = self.folder.each(self.condensed, "rows")
        [flipped] = self.folder.each(self.finished, "flipped")
        n_flipped, rounds, moved = sum(map(len, flipped)), 0, dict[int, complex]()
        if n_flipped > FEW_FLIPPED * self.folder.faces:
            self.give_up(counted(n_flipped, "face is flipped", "faces are flipped"))
        for k in np.flatnonzero([len(faces) for faces in flipped]).tolist():
            beside = [np.isin(other, rows[k]).any() for other in rows]
            near = dict(compress(self.finished.items(), beside))
            some = Gathered.of(self.folder, near, lambda part: slice(None))
            rim = np.unique(some.mesh.edges.ends(some.mesh.edges.valence == 1))
            f, repair = repair_locally(Mesh(some.mesh.scaled, some.mesh.F, rim), some.f)
            rounds += repair.rounds
            changed = np.flatnonzero(f != some.f)
            moved |= zip(some.vertices[changed].tolist(), f[changed].tolist(), strict=True)
            self.final["vertices"] = sorted(moved)
            self.final["moved"] = [moved[vertex] for vertex in sorted(moved)]
            self.finished |= self.certified(self.final, near)
        return Repair(n_flipped, len(moved), rounds)

    def judge(self, sample: Gathered, **done: Any) -> PartsMap:
        """Certify and measure the whole; judge it by the faces that `disk_map` judges it by."""
        keys = "flipped", "n_exact", "degrees", "lost"
        flipped, n_exact, degrees, lost = self.folder.each(self.finished, *keys)
        rows = np.sort(np.concatenate(flipped))
        certificate = certificate_of(self.final["table"][self.border], rows, int(sum(n_exact)))
        if not certificate.valid:
            self.give_up(f"it would not be a bijection: {certificate}")
        free, inscribed = np.moveaxis(np.array(degrees), 1, 0)
        distortion = of_free = _distortion(np.concatenate([free, inscribed]))
        if inscribed[:, 0].any() and free[:, 0].any():
            of_free = _distortion(free)
        n_lost, area, whole = map(sum, zip(*lost, strict=True))
        others = set(self.folder.work.glob("*.npz")) - set(self.folder.work.glob("merge-*.npz"))
        rows = sampled_faces(self.folder.faces)
        near = sample.vertices[np.unique(sample.only(rows).F)]
        some = Gathered.of(self.folder, self.finished, lambda part: part.faces_at(near))
        faces = some.places(rows)
        errors = map_distortion(some.mesh, some.f)[faces]
        conformality = judge_by(some.mesh, some.f, errors, faces, distortion.mean)
        if conformality.is_doubtful:
            self.give_up(f"it may not be conformal: {'; '.join(conformality.reasons)}")
        return PartsMap(
            folder=self.folder,
            certificate=certificate,
            conformality=conformality,
            _angles=distortion,
            _free_angles=of_free,
            lost=(int(n_lost), float(area / whole)),
            moved_bytes=self.written + sum(file.stat().st_size for file in others),
            boundary=BoundaryMethod("geodesic"),
            timings=self.phase.seconds,
            **done,
        )

    def give_up(self, reason: str) -> NoReturn:
        """Raise MapError: what is left to do is done on one machine only."""
        raise MapError(
            f"In parts, there is no map of this surface: {reason}. Where memory suffices, "
            "cdcp_igl.disk_map tries other boundaries, moves what is too small, straightens, "
            "repairs the whole interior, and refines."
        )


def _distortion(sums: Floats) -> AngleDistortion:
    """Mean, SD and maximum by the sums of parts: number, sum, sum of squares and maximum."""
    number, total, squares, _ = sums.sum(axis=0)
    mean = total / number
    sd = np.sqrt(max(squares / number - mean**2, 0))
    return AngleDistortion(float(mean), float(sd), float(sums[:, 3].max()))
