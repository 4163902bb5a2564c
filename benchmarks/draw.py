"""The command that draws: pictures and the report for the browser, from the results."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from cdcp_igl import MeshError
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.io import whole_file

from . import ablation, methods
from .ablation import ABLATIONS
from .figures import PLOTS, Measured, NotMeasured, encode
from .figures.accuracy import CENTERS, MOBIUS
from .measure import MACHINE, Machine, Out, Quick, Session, WorkFolder
from .methods import METHODS, maps
from .models import digest, find
from .pages import write_pages
from .store import RESULTS, WORK, Record, Work, code, read_results

__all__ = ["figures"]

SECONDS = 60  # limit of a case of --quick


def figures(
    quick: Quick = False,
    machine: Machine = MACHINE,
    out: Out = None,
    work: WorkFolder = None,
) -> None:
    """Draw Figures 4 to 12 and the report for the browser, from what has been measured.

    Nothing is measured again; --quick measures first what three small models need.
    """
    if quick:
        _measure(Session(quick, machine, out, work, SECONDS, 0, threads=1))
        work = work or WORK / f"quick-{code()}"
        out = out or work
    folder = (out or RESULTS) / machine
    results = folder.with_name(folder.name + ".json")
    if not results.exists():
        raise typer.BadParameter(f"there is no {results}; first run: python -m benchmarks tables")
    about, records = read_results(results)
    kept = Work(work or WORK / about["code"])
    measured = Measured(records, _surfaces(records), kept.map)

    folder.mkdir(parents=True, exist_ok=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=len(PLOTS) + len(measured.sizes))
        drawn = []
        for plot in PLOTS:
            bar.update(task, description=plot.title)
            shown: dict[str, Any] = {"title": plot.title, "caption": plot.caption}
            shown["id"] = Path(plot.file).stem
            target = folder / plot.file
            try:
                picture = encode(plot.draw(measured), target.suffix)
            except NotMeasured as reason:
                shown["missing"] = str(reason)
                target.unlink(missing_ok=True)  # it would show something else
            else:
                with whole_file(target) as unfinished:
                    unfinished.write_bytes(picture)
                shown["file"] = target
            drawn.append(shown)
            bar.advance(task)

        def advance(model: str) -> None:
            bar.update(task, description=model, advance=1)

        index = write_pages(folder, about, measured, drawn, advance)
    with whole_file(folder / "README.md") as unfinished:
        unfinished.write_text(_gallery(drawn), encoding="utf-8")
    typer.echo(index)


def _measure(session: Session) -> None:
    wanted = {
        "tables": (METHODS, ["factor", *maps()], methods.TABLE),
        "speed": (METHODS, ["factor", "cdcp"], methods.TABLE),
        "ablation": (ABLATIONS, CENTERS + MOBIUS, ablation.TABLE),
    }
    for section, (known, names, table) in wanted.items():
        chosen = {name: known[name] for name in names}
        session.run(section, session.models("", ()), chosen, table, lambda method, n: 1)
    session.write()


def _surfaces(records: list[Record]) -> Any:
    meshes = {record.model: record.mesh for record in records}

    @cache
    def surface(model: str) -> tuple[Floats, Ints]:
        try:
            V, F = find([model])[0].load()
        except (OSError, ValueError, ImportError, MeshError) as error:
            raise NotMeasured(f"the surface is not to be had any more: {error}") from error
        if digest(V, F) != meshes[model]:
            raise NotMeasured("the surface is not the one that was measured")
        return V, F

    return surface


def _gallery(drawn: list[dict[str, Any]]) -> str:
    """Return the figures as a page for where HTML is not shown."""
    parts = ["# Figures\n\nWritten by `python -m benchmarks figures`.\n"]
    for shown in drawn:
        body = f"![{shown['title']}]({shown['file'].name})\n\n" if "file" in shown else ""
        note = f" ({shown['missing']})" if "missing" in shown else ""
        parts.append(f"## {shown['title']}\n\n{body}{shown['caption']}{note}\n")
    return "\n".join(parts)
