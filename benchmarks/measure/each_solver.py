"""The time of a map with each solver that is installed."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Annotated

import typer

from cdcp_igl import SolverError, disk_map
from cdcp_igl.io import read_mesh, whole_file
from cdcp_igl.solve.solvers import SOLVERS, SolverName, using
from cdcp_igl.solve.solvers import solver as solver_in_use

__all__ = ["solvers"]


def solvers(
    meshes: Annotated[list[Path], typer.Argument(metavar="IN...")],
    rounds: Annotated[int, typer.Option(min=1, help="Each solver has its turn in each.")] = 3,
    out: Annotated[Path | None, typer.Option(help="Where the table goes, too.")] = None,
) -> None:
    """Write a table: seconds with the first solver, multiples of that with the others.

    Medians over the rounds; the mean angular distortion with each is beside it, to the digits
    in which they may differ.
    """
    packages = []
    for name in SOLVERS:
        with using(name):
            packages.append(f"{solver_in_use().LIBRARY} ({solver_in_use().PACKAGE})")
    lines = [
        f"# Solvers\n\nWhole maps, medians of {rounds} rounds in one process, "
        f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}. "
        f"Multiples of the seconds with {packages[0]}; mean angular distortion in degrees.\n",
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
    seconds: dict[SolverName, list[float]] = {name: [] for name in SOLVERS}
    means: dict[str, float] = {}
    for _ in range(rounds):
        for name, measured in seconds.items():
            start = perf_counter()
            try:
                means[name] = disk_map(V, F, solver=name).distortion.mean
            except SolverError:
                continue
            measured.append(perf_counter() - start)
    first, *others = seconds.values()
    unit = median(first)
    ratios = [f"{median(times) / unit:.2f}" if times else "failed" for times in others]
    mean = means[next(iter(SOLVERS))]
    difference = max(abs(other - mean) for other in means.values())
    cells = [path.stem, f"{len(V):,}", f"{unit:.2f} s", *ratios, f"{mean:.4f}", f"{difference:.0e}"]
    return f"| {' | '.join(cells)} |"
