"""The time of a map with each solver that is installed."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Annotated

import numpy as np
import typer

from cdcp_igl import MapError, MeshError, SolverError, check, disk_map, surface_map
from cdcp_igl.io import read_mesh
from cdcp_igl.io.output import whole_file
from cdcp_igl.solve.solvers import SOLVERS, using
from cdcp_igl.solve.solvers import solver as solver_in_use

__all__ = ["solvers"]

ENOUGH = 60  # seconds of a surface, after which another round hardly changes the ratios


def solvers(
    meshes: Annotated[list[Path], typer.Argument(metavar="IN...", exists=True, dir_okay=False)],
    rounds: Annotated[
        int, typer.Option(min=1, help="At most; each solver has its turn in each.")
    ] = 3,
    out: Annotated[Path | None, typer.Option(help="Where the table goes, too.")] = None,
) -> None:
    """Write a table: seconds with the first solver, multiples of that with the others.

    Medians over the rounds; the mean angular distortion with each is beside it, to the digits
    in which they may differ. Surfaces that are no disk are cut open. A dash: there is no map.
    """
    packages = []
    for name in SOLVERS:
        with using(name):
            packages.append(f"{solver_in_use().LIBRARY} ({solver_in_use().PACKAGE})")
    lines = [
        f"# Solvers\n\nWhole maps, medians of at most {rounds} rounds in one process, "
        f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}. "
        f"Multiples of the seconds with {packages[0]}; mean angular distortion in degrees.\n"
        "Surfaces that are no disk are cut open. A dash: there is no map.\n",
        f"| surface | vertices | {' | '.join(packages)} | mean | greatest difference |",
        f"|---|{'--:|' * (len(packages) + 3)}",
    ]
    typer.echo("\n".join(lines))
    for path in sorted(meshes, key=lambda path: path.stat().st_size):
        lines.append(_row(path, rounds))
        typer.echo(lines[-1])
    if out:
        with whole_file(out) as unfinished:
            unfinished.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _row(path: Path, rounds: int) -> str:
    V, F = read_mesh(path)
    mapped = disk_map if check(V, F).is_disk else surface_map
    seconds: dict[str, list[float]] = {name: [] for name in SOLVERS}
    means: dict[str, float] = {}
    begun = perf_counter()
    for round_ in range(rounds):
        if round_ and perf_counter() - begun > ENOUGH:
            break
        for name in SOLVERS:
            start = perf_counter()
            try:
                with using(name):
                    means[name] = mapped(V, F).distortion.mean
            except (MapError, MeshError, SolverError):
                continue
            seconds[name].append(perf_counter() - start)
    first, *others = (median(times) if times else np.nan for times in seconds.values())
    mean = means.get(next(iter(SOLVERS)), np.nan)
    difference = max((abs(other - mean) for other in means.values()), default=np.nan)
    numbers = (f"{first:.2f} s", *(f"{other / first:.2f}" for other in others))
    numbers = (*numbers, f"{mean:.4f}", f"{difference:.0e}")
    cells = [path.stem, f"{len(V):,}", *("–" if "nan" in text else text for text in numbers)]
    return f"| {' | '.join(cells)} |"
