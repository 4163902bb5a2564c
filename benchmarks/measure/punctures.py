"""Closed surfaces with a small hole: no option and no other method may do much better."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import groupby
from pathlib import Path
from time import process_time
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from cdcp_igl import MapError, MeshError, SolverError, angle_distortion, check, disk_map
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.io import READABLE, read_mesh
from cdcp_igl.reference import fdcp, harmonic
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.verdict.certificate import certify

from ..records.store import WORK, code
from .models import digest, files_of
from .worker import Jobs, WorkFolder, answered, kept_answers, wide_console

SECONDS = 600.0  # after which a map hangs
RINGS = {"face": 0, "vertex": 1, "2-ring": 2}  # of faces around a vertex that are taken out
REFINE = (None, 5)  # as needed, and five steps
NOT_WORSE = 1.2  # than the best of the others
MAPPED = "map"
TYPED = ("MapError", "SolverError")


@dataclass(frozen=True)
class Row:
    """What a method made of a surface with a hole.

    It is opened at `row` of F, or of V; `mesh` is the digest of the two.
    """

    surface: str
    mesh: str
    kind: str
    place: int
    row: int
    method: str
    outcome: str = answered("")
    mean: float = answered(np.nan)  # angular distortion, degrees
    message: str = answered("")
    vertices: int = answered(0)
    boundary_vertices: int = answered(0)
    seconds: float = answered(np.nan)  # of CPU


@dataclass(frozen=True)
class Comparison:
    """A map of a surface with a hole, beside those of other methods."""

    ours: Row
    others: Sequence[Row]

    @property
    def best(self) -> Row | None:
        """The best of the others, if one of them is a map."""
        mapped = [row for row in self.others if row.outcome == MAPPED]
        return min(mapped, key=lambda row: row.mean, default=None)

    @property
    def ratio(self) -> float:
        """Mean distortion by that of the best of the others; NaN without two maps."""
        return self.ours.mean / self.best.mean if self.best else np.nan

    @property
    def is_fault(self) -> bool:
        """Whether what happened must not happen."""
        return self.ours.outcome not in (MAPPED, *TYPED)

    @property
    def is_worse(self) -> bool:
        """Whether another method is much better; there may be no map of ours."""
        return self.best is not None and not self.ratio <= NOT_WORSE

    def __str__(self) -> str:
        ours, best = self.ours, self.best
        where = "face" if ours.kind == "face" else "vertex"
        text = f"{ours.surface} less a {ours.kind} ({where} {ours.row}): {ours.method} "
        if ours.outcome == MAPPED:
            text += f"{ours.mean:.2f}°"
        else:
            text += f"{ours.outcome}, {ours.message[:100]}"
        return text + (f"; {best.method} {best.mean:.2f}°" if best else "; no other map")


# The methods by the steps of refinement for which they are compared: the first is ours.
COMPARED: Mapping[int | None, Sequence[str]] = {
    refine: (f"refine={refine}", f"refine={refine}, mobius=None", "FDCP", "arc length")
    for refine in REFINE
}
METHODS = tuple(dict.fromkeys(method for methods in COMPARED.values() for method in methods))


def punctures(
    folder: Annotated[
        Path | None,
        typer.Argument(
            exists=True, file_okay=False, help="Files; those of no closed surface are left out."
        ),
    ] = None,
    places: Annotated[int, typer.Option(min=1, help="Places to open each surface at.")] = 3,
    most: Annotated[int, typer.Option(min=1, help="Vertices of the largest.")] = 10**9,
    seed: Annotated[int, typer.Option(min=0, help="A place depends on this and its number.")] = 1,
    jobs: Jobs = 1,
    work: WorkFolder = None,
) -> None:
    """Take a face, a vertex or a 2-ring out of closed surfaces without handles, and map them.

    Maps refined as needed, and by 5 steps, stand beside those without a Möbius transformation, of
    FDCP, and by arc length. Exit code 1 if one is much worse than the best of the others, or
    something crashes, hangs or goes wrong without saying so. What has been mapped is kept in
    build/benchmarks, and not mapped again.
    """
    files = files_of(folder, READABLE)
    paths = {path.stem: path for path in files if _is_closed(path, most)}
    requests = list(_requests(paths, places, seed))
    console = wide_console()
    kept = (work or WORK / code()) / f"punctures-{seed}"
    rows = kept_answers(partial(examine, paths), requests, kept, SECONDS, jobs, console)
    wrong = False
    for methods in COMPARED.values():
        comparisons = list(_comparisons(rows, methods))
        console.print(f"Mean angular distortion in degrees, {methods[0]}\n{_summary(comparisons)}")
        for one in comparisons:
            if one.is_fault or one.is_worse:
                console.print(str(one), soft_wrap=True)
            wrong |= one.is_fault or one.is_worse
    console.print(f"All rows: {kept}", soft_wrap=True)
    if wrong:
        raise typer.Exit(1)


def _is_closed(path: Path, most: int) -> bool:
    V, F = _surface(path)
    return len(V) <= most and check(V, F).kind == "genus 0, closed"


@cache
def _surface(path: Path) -> tuple[Floats, Ints]:
    V, F = read_mesh(path)
    return V.astype(np.float64), F.astype(np.int64)


def opened(V: Floats, F: Ints, kind: str, row: int) -> tuple[Floats, Ints]:
    """Take out a face, a vertex, or a vertex with its neighbours.

    Parameters
    ----------
    V : (n, 3) float64
    F : (m, 3) int64
    kind : {"face", "vertex", "2-ring"}
    row : int
        Row of F or of V.

    Returns
    -------
    V, F
        What is left, without vertices that no face uses.
    """
    if kind == "face":
        left = np.delete(F, row, axis=0)
    else:
        near = np.arange(len(V)) == row
        for _ in range(RINGS[kind] - 1):
            near[F[near[F].any(axis=1)]] = True
        left = F[~near[F].any(axis=1)]
    used = np.unique(left)
    return V[used], np.searchsorted(used, left)


def _requests(paths: Mapping[str, Path], places: int, seed: int) -> Iterator[Row]:
    """Choose random places at which a hole leaves a disk."""
    for name, path in paths.items():
        V, F = _surface(path)
        for kind in RINGS:
            for place in range(places):
                rng = np.random.default_rng([seed, RINGS[kind], place])
                row = row_to_open(rng, V, F, kind)
                if row is not None:
                    for method in METHODS:
                        yield Row(name, digest(V, F), kind, place, row, method)


def row_to_open(rng: np.random.Generator, V: Floats, F: Ints, kind: str) -> int | None:
    """Choose a random row at which a hole leaves a disk."""
    rows = rng.permutation(len(F if kind == "face" else V)).tolist()
    return next((row for row in rows if check(*opened(V, F, kind, row)).is_disk), None)


def examine(paths: Mapping[str, Path], request: Row) -> Row:
    """Map a surface with a hole by one method, and judge the map."""
    V, F = opened(*_surface(paths[request.surface]), request.kind, request.row)
    mesh = DiskMesh(V, F)
    start = process_time()
    mean, message = np.nan, ""
    try:
        uv = _map(request.method, V, F)
    except (MapError, MeshError, SolverError) as error:
        outcome, message = type(error).__name__, str(error)
    except Exception as error:
        outcome, message = "untyped exception", f"{type(error).__name__}: {error}"
    else:
        outcome = MAPPED if certify(mesh, uv).valid else "not certified"
        mean = float(angle_distortion(V, F, uv).mean())
    return replace(
        request,
        outcome=outcome,
        mean=mean,
        message=message,
        vertices=len(V),
        boundary_vertices=len(mesh.loop),
        seconds=process_time() - start,
    )


def _map(method: str, V: Floats, F: Ints) -> Floats:
    for refine, (ours, plain, *_) in COMPARED.items():
        if method == ours:
            return disk_map(V, F, refine=refine).uv
        if method == plain:
            return disk_map(V, F, refine=refine, mobius=None).uv
    return fdcp(V, F) if method == "FDCP" else harmonic(V, F)


# -- what is told ----------------------------------------------------------------------


def _comparisons(rows: Iterable[Row], methods: Sequence[str]) -> Iterator[Comparison]:
    for _, group in groupby(rows, lambda row: (row.surface, row.mesh, row.kind, row.place)):
        of = {row.method: row for row in group}
        ours, *others = (of[method] for method in methods)
        yield Comparison(ours, others)


def _summary(comparisons: Sequence[Comparison]) -> str:
    """Show quantiles of the distortion and count what is wrong, surface by surface."""
    rows = [
        {
            **{"surface": one.ours.surface, "worse": one.is_worse, "fault": one.is_fault},
            "mean": one.ours.mean if one.ours.outcome == MAPPED else np.nan,
            **{"ratio": one.ratio, "typed": one.ours.outcome in TYPED},
        }
        for one in comparisons
    ]
    every = pd.DataFrame(rows)
    of = pd.concat([every, every.assign(surface="all")]).groupby("surface", sort=False)
    columns = {
        **{"holes": of.size(), "median": of["mean"].median(), "90 %": of["mean"].quantile(0.9)},
        **{"worst": of["mean"].max(), "worst by the best": of["ratio"].max()},
        **{f"above {NOT_WORSE:g} times": of["worse"].sum()},
        **{"typed errors": of["typed"].sum(), "faults": of["fault"].sum()},
    }
    return pd.DataFrame(columns).to_string(float_format="{:.3f}".format)
