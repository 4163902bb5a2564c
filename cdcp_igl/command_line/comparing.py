"""``cdcp-igl compare``."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..extras import from_extra
from .messages import BAD_INPUT, SOME_FAILED, check_targets, exit_codes, writing
from .options import FORCE, INPUTS, PICTURES, file_option
from .screen import print_table, progress_bar

if TYPE_CHECKING:
    from ..arrays import Floats, Ints
    from ..plot.pictures import MapRow
    from ..reference.case import Case

# Those of `reference`, spelled out: `--help` shows them, and must not wait for NumPy.
METHODS = (
    *("cdcp", "double_cover", "fdcp", "ldcp", "cem", "heat_flow", "ricci", "pgcp"),
    *("harmonic", "abf", "lscm", "spectral", "bff", "bff_disk", "sphere", "flash"),
)
SPHERES = METHODS[-2:]  # onto the sphere, of closed surfaces
NUMBERS = ("mean", "sd", "max", "area", "flips", "boundary_error", "seconds", "memory")


def compare_command(
    meshes: list[Path] = INPUTS,
    methods: str | None = typer.Option(
        None,
        metavar="NAME,...",
        help=f"Of {', '.join(METHODS)}. [default: all that map the surface]",
    ),
    time_limit: float = typer.Option(
        600, metavar="SECONDS", min=0, help="For each method on each mesh."
    ),
    json_file: Path | None = file_option("--json", "R.json", (".json",), "The numbers."),
    csv_file: Path | None = file_option("--csv", "R.csv", (".csv",), "The numbers."),
    picture: Path | None = file_option(
        "--picture", "P.png", PICTURES, "The maps side by side, a row a mesh (.png .svg .pdf)."
    ),
    view: Path | None = file_option(
        *("--view", "V.html", (".html",)),
        help="The maps of one mesh, each beside the disk map and the turning surface.",
    ),
    force: bool = FORCE,
) -> None:
    """Compare methods on meshes: a table of distortion, flips, time and memory for each.

    Each method runs in a process of its own; one that fails has a row without numbers, and a line
    that says why. A closed surface of genus 0 is mapped onto the sphere by sphere and flash, and
    cut open for the others. Any other mesh that is no disk is named, and left out.

    Exit codes: 0 all rows are there; 1 a file could not be written, or an extra is missing;
    2 bad input; 4 some meshes were left out.
    """
    from ..errors import printable
    from ..io import read_polygons
    from ..io.output import whole_file, write_table, write_text
    from ..io.polygons import naming_polygons
    from ..maps.disk import disk_map
    from ..maps.sphere import sphere_map
    from ..reference.case import run_case

    chosen = [name.strip() for name in methods.split(",")] if methods else []
    if unknown := [name for name in chosen if name not in METHODS]:
        raise typer.BadParameter(f"{unknown[0]!r} is not one of {', '.join(METHODS)}.")
    meshes = list(dict.fromkeys(meshes))
    if view and len(meshes) > 1:
        raise typer.BadParameter("--view is for one mesh.")
    cases: dict[Path, list[Case]] = {}
    rows: list[MapRow] = []
    names: list[str] = []
    unprinted: list[BaseException] = []
    with exit_codes():
        if picture or view:
            with from_extra("plot"):
                from ..plot import side_by_side
        check_targets((json_file, csv_file, picture, view), meshes, force)
    for mesh in meshes:
        try:
            with exit_codes(mesh):
                V, F, polygon_of_face = read_polygons(mesh)
                with naming_polygons(polygon_of_face):
                    opened = _opened(V, F)
        except typer.Exit:
            continue  # and the message has been printed
        title, cases[mesh] = f"{printable(mesh)}: {len(V):,} vertices", []
        plane = [name for name in chosen or METHODS if name not in SPHERES]
        surfaces = [(V, F, chosen or plane)]
        if opened:
            title += ", cut open for maps to the plane"
            spheres = [name for name in chosen or SPHERES if name in SPHERES]
            surfaces = [(*opened, plane), (V, F, spheres)]
        for P, G, wanted in surfaces:
            made = []
            with writing(), progress_bar() as progress:  # what each process says is a file
                for done, method in enumerate(wanted):
                    progress(method, done / len(wanted))
                    made.append(run_case(method, P, G, time_limit=time_limit))
            cases[mesh] += [case for case, _ in made]
            if made:
                rows.append((P, G, [(case.method, case.mean, uv) for case, uv in made]))
                names.append(printable(mesh.name))
        try:
            print_cases(title, cases[mesh])
        except (OSError, SystemExit) as error:  # Rich exits where nobody reads from a pipe
            if not (json_file or csv_file or picture or view):
                raise
            unprinted.append(error)  # the files are still to be written
    if not cases:
        raise typer.Exit(BAD_INPUT)
    with writing():
        table = _table(cases)
        if json_file:
            write_text(json_file, json.dumps(table, indent=2, ensure_ascii=False) + "\n")
        if csv_file:
            write_table(csv_file, table[0], table)
        if picture:
            with whole_file(picture) as unfinished:
                side_by_side(rows, names=names).savefig(unfinished)
    if view:
        V, F, maps = rows[0]  # of a closed surface, the disk, if there are maps of it
        known = ("cdcp", *SPHERES)
        beside = {name: uv for name, _, uv in maps if name not in known and uv is not None}
        with exit_codes(meshes[0]), writing():
            shown = disk_map(V, F) if plane or not opened else sphere_map(V, F)
            shown.view(view, beside=beside, title=printable(meshes[0].name))
    if unprinted:
        raise unprinted[0]
    if len(cases) < len(meshes):
        raise typer.Exit(SOME_FAILED)


def _opened(V: Floats, F: Ints) -> tuple[Floats, Ints] | None:
    """Cut a closed surface of genus 0 open; None of a disk, MeshError of any other."""
    from ..atlas.surface import surface_map
    from ..errors import MeshError
    from ..surface.mesh import DiskMesh, SphereMesh

    try:
        DiskMesh(V, F)
        return None
    except MeshError as error:
        if error.defect != "closed surface":
            raise
    SphereMesh(V, F)
    chart = surface_map(V, F, max_charts=1).charts[0].mesh
    return chart.positions, chart.F


def print_cases(title: str, cases: Sequence[Case]) -> None:
    """Print a row a method, and below why one has no map."""
    from ..defects import as_commands

    rows = []
    for case in cases:
        if case.boundary == "free" and case.outcome == "ok":
            rows.append((f"{case.method} *", replace(case, boundary_error=nan)))
        else:
            rows.append((case.method, case))
    print_table(title, "method", NUMBERS, rows)
    if any(name.endswith("*") for name, _ in rows):
        typer.echo("* no disk: a map with free boundary; compare it on angles only")
    for case in cases:
        if case.outcome != "ok":
            typer.echo(f"{case.method}: {as_commands(case.outcome)}")


def _table(cases: Mapping[Path, Sequence[Case]]) -> list[dict[str, Any]]:
    """Return a row a case; None where there is no number."""
    from ..errors import printable

    return [
        {"mesh": printable(mesh), **case.as_json()} for mesh, made in cases.items() for case in made
    ]
