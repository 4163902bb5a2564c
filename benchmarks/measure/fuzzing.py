"""Random surfaces, good and bad: each ends as a certified map or as a typed error."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from rich.console import Console
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order

from cdcp_igl import MapError, MeshError, SolverError, check, clean, datasets, disk_map, libigl
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.surface.mesh import DiskMesh
from cdcp_igl.verdict.certificate import certify

from ..records.store import WORK, code
from .worker import Jobs, WorkFolder, answered, kept_answers

SECONDS = 600.0  # after which a case hangs, on however busy a machine
FEWEST, MOST = 8, 4_000  # vertices of a patch
STRETCHES = (2.0, 5.0, 20.0)  # upper ends of the classes
TARGETS = {5.0: 0.995, 20.0: 0.97}  # share of the disks up to a stretch that must be mapped
DAMAGED = 1 / 3  # share of the cases
REFINE = (0, 0, 1, 5)  # steps of refinement beside those needed, case by case in turn
QUANTILES = (0.5, 0.9, 0.99, 1)  # of the distortions

FAULTS = (
    *("crash", "hang", "not certified", "untyped exception", "disk refused"),
    "refinement failed",
)


@dataclass(frozen=True)
class Case:
    """A surface, how far it was stretched, and how it was made."""

    V: Floats
    F: Ints
    stretch: float
    made: str


@dataclass(frozen=True)
class Row:
    """What became of a case."""

    case: int
    stretch: float = answered(np.nan)
    disk: bool = answered(False)
    outcome: str = answered("")
    made: str = answered("")
    message: str = answered("")
    distortion: float = answered(np.nan)  # mean angular, degrees
    refine: int = answered(0)  # steps asked for, of a map that is there without them
    refined: float = answered(np.nan)  # its mean angular distortion, degrees


def fuzz(
    cases: Annotated[int, typer.Option(min=1, help="How many surfaces.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="A case depends on this and its number.")] = 1,
    jobs: Jobs = 1,
    work: WorkFolder = None,
) -> None:
    """Map random surfaces, half of them refined as well.

    Exit code 1 if one crashes, hangs or goes wrong without saying so, or too few disks are
    mapped. What has been examined is kept in build/benchmarks, and not examined again.
    """
    console = Console()
    requests = [Row(case, made=f"surface({seed}, {case})") for case in range(cases)]
    folder = (work or WORK / code()) / f"fuzz-{seed}"
    rows = kept_answers(partial(examine, seed), requests, folder, SECONDS, jobs, console)
    console.print(_outcomes(rows))
    for name, means in (
        ("maps", [row.distortion for row in rows if _is_mapped(row)]),
        ("refined maps", [row.refined for row in rows if row.refine and _is_mapped(row)]),
    ):
        if means:
            quantiles = zip(QUANTILES, np.quantile(means, QUANTILES), strict=True)
            told = ", ".join(f"{share:.0%} to {mean:.2f}" for share, mean in quantiles)
            console.print(f"{len(means):,} {name}, mean angular distortion in degrees: {told}")
    enough = True
    for limit, target in TARGETS.items():
        disks = [row for row in rows if row.disk and row.stretch <= limit]
        mapped = sum(map(_is_mapped, disks))
        enough &= mapped >= target * len(disks)
        console.print(
            f"disks stretched up to {limit:g}: {mapped:,} of {len(disks):,} mapped"
            + (f" ({mapped / len(disks):.2%}, wanted {target:.1%})" if disks else "")
        )
    faults = [row for row in rows if row.outcome in FAULTS]
    refused = [row for row in rows if row.disk and not _is_mapped(row)]
    for row in dict.fromkeys(refused + faults):
        console.print(f"case {row.case}: {row.made}: {row.outcome}. {row.message[:100]}")
    if faults or not enough:
        raise typer.Exit(1)


def _is_mapped(row: Row) -> bool:
    return row.outcome.startswith("map, ")


def _outcomes(rows: list[Row]) -> str:
    """Count by outcome, or boundary method where there is a map, and by stretch."""
    of = pd.DataFrame(rows)
    ends = pd.cut(of["stretch"], [0, *STRETCHES], labels=[f"to {end:g}" for end in STRETCHES])
    return pd.crosstab(of["outcome"], ends.astype(str).where(of["disk"], "no disk")).to_string()


# -- one case --------------------------------------------------------------------------


def examine(seed: int, asked: Row) -> Row:
    """Map the surface of a case, and judge the answer; map it refined, if that is its turn."""
    given = surface(seed, asked.case)
    disk = check(given.V, given.F).is_disk
    refine = REFINE[asked.case % len(REFINE)]
    plain = _judged(given, disk, None)
    row = Row(asked.case, given.stretch, disk, plain[0], given.made, *plain[1:])
    if not (refine and _is_mapped(row)):
        return row
    outcome, message, mean = _judged(given, disk, refine)
    if not outcome.startswith("map, "):
        message = f"refine={refine}: {outcome}. {message}"
        return replace(row, outcome="refinement failed", message=message)
    return replace(row, refine=refine, refined=mean)


def _judged(given: Case, disk: bool, refine: int | None) -> tuple[str, str, float]:
    """Map a surface; return the outcome, the message, and the mean angular distortion."""
    try:
        result = disk_map(given.V, given.F, refine=refine)
    except MeshError as error:
        return "disk refused" if disk else f"MeshError: {error.defect}", str(error), np.nan
    except MapError as error:
        crowding = "crowding" in str(error).lower()
        outcome = "MapError: crowding" if crowding else "MapError: not a bijection"
        return outcome, str(error), np.nan
    except SolverError as error:
        return "SolverError", str(error), np.nan
    except Exception as error:
        return "untyped exception", f"{type(error).__name__}: {error}", np.nan
    sound = disk and certify(DiskMesh(given.V, given.F), result.uv).valid
    outcome = f"map, {result.boundary.name}" if sound else "not certified"
    return outcome, "", result.distortion.mean


# -- surfaces --------------------------------------------------------------------------


def surface(
    seed: int, case: int, names: Sequence[str] | None = None, damage: float = DAMAGED
) -> Case:
    """Make the surface of a case: a patch, deformed, renumbered, and perhaps damaged.

    It is one of the surfaces with these names, or of `sources`.
    """
    rng = np.random.default_rng([seed, case])
    name = rng.choice(names or sources())
    V, F = _patch(rng, *_surface(name))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    stretch = float(np.exp(rng.uniform(0, np.log(20))))
    V = V @ turn * [stretch, 1, 1]
    made = [f"{name} with {len(V):,} vertices, stretched {stretch:.1f}"]
    if rng.random() < 0.3:
        edges = np.linalg.norm(V[F[:, 0]] - V[F[:, 1]], axis=1)
        V = V + rng.choice([0.03, 0.1, 0.3]) * np.median(edges) * rng.normal(size=V.shape)
        made.append("noise")
    if rng.random() < 0.3:
        V, F = _slivers(rng, V, F)
        made.append("slivers")
    if rng.random() < damage:
        V, F, done = _damage(rng, V, F)
        made.append(done)
    size = np.ptp(V[np.isfinite(V).all(axis=1)], axis=0).max()
    if rng.random() < 0.3:
        offset = 10 ** rng.uniform(0, 8)
        V = V + offset * size * rng.normal(size=3)
        made.append(f"offset {offset:.0e}")
    V = V * 10 ** rng.uniform(-12, 12) / size

    order = rng.permutation(len(V))
    in_range = (F >= 0) & (len(V) > F)
    renamed = np.where(in_range, np.argsort(order)[F % len(V)], F)
    V, F = V[order], renamed[rng.permutation(len(F))]
    return Case(V, F, stretch, ", ".join(made))


@cache
def sources() -> list[str]:
    """Surfaces to take patches of."""
    directory = os.environ.get("CDCP_IGL_DATA")
    if directory:
        return sorted(path.stem for path in Path(directory).glob("*.npz"))
    return ["square", "ellipse", "spherical_cap", "paraboloid", "jacksboro_fault"]


@cache
def _surface(name: str) -> tuple[Floats, Ints, csr_matrix]:
    """Vertices, faces and the graph of the edges."""
    if generate := getattr(datasets, name, None):
        V, F, _ = generate(60)
    else:
        V, F = datasets.load(name)
    F = F.astype(np.int64)
    return V.astype(float), F, libigl.adjacency_matrix(F)


def _patch(rng: np.random.Generator, V: Floats, F: Ints, graph: csr_matrix) -> tuple[Floats, Ints]:
    """Cut out what lies within so many edges of a random vertex, and fill its holes."""
    size = int(np.exp(rng.uniform(np.log(FEWEST), np.log(min(MOST, len(V))))))
    near = np.zeros(len(V), dtype=bool)
    near[breadth_first_order(graph, rng.integers(len(V)))[0][:size]] = True
    inside = near[F]
    # With all corners near there are many ears, with any corner near there are few.
    patch = F[inside.all(axis=1)] if rng.random() < 0.5 else F[inside.any(axis=1)]
    V, F = clean(V, patch if len(patch) else F[inside.any(axis=1)])[:2]
    return V, F


def _slivers(rng: np.random.Generator, V: Floats, F: Ints) -> tuple[Floats, Ints]:
    """Split faces by points near their edges."""
    split = rng.choice(len(F), max(1, len(F) // 20), replace=False)
    height = 10 ** rng.uniform(-6, -1, len(split))
    along = rng.uniform(0.1, 0.9, len(split))
    weight = np.column_stack([(1 - height) * along, (1 - height) * (1 - along), height])
    weight = rng.permuted(weight, axis=1)
    point = (weight[:, :, None] * V[F[split]]).sum(axis=1)
    new = len(V) + np.arange(len(split))
    i, j, k = F[split].T
    corners = ([i, j, new], [j, k, new], [k, i, new])
    fans = [np.column_stack(face) for face in corners]
    return np.vstack([V, point]), np.vstack([np.delete(F, split, axis=0), *fans])


def _damage(rng: np.random.Generator, V: Floats, F: Ints) -> tuple[Floats, Ints, str]:
    """Make a few bad edits of one kind."""
    kind = str(rng.choice(["dropped", "reversed", "duplicated", "merged", "NaN", "index"]))
    V, F = V.copy(), F.copy()
    count = int(rng.integers(1, 4))
    faces, vertices = rng.integers(len(F), size=count), rng.integers(len(V), size=count)
    if kind == "dropped":
        F = np.delete(F, faces, axis=0)
    elif kind == "reversed":
        F[faces] = F[faces, ::-1]
    elif kind == "duplicated":
        F = np.vstack([F, np.roll(F[faces], 1, axis=1)])
    elif kind == "merged":
        F[np.isin(F, vertices)] = vertices[0]
    elif kind == "NaN":
        V[vertices, rng.integers(3, size=count)] = np.nan
    else:
        F[faces, 0] = rng.choice([-1, len(V)])
    return V, F, f"{count} {kind}"
