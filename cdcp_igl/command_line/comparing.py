"""``cdcp-igl compare``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from .messages import BAD_INPUT, SOME_FAILED, check_targets, exit_codes, writing
from .options import FORCE, INPUTS, PICTURES, file_option
from .screen import print_table, progress_bar

if TYPE_CHECKING:
    from ..arrays import Floats, Ints
    from ..reference.case import Case

# Those of `reference`, spelled out: `--help` shows them, and must not wait for NumPy.
METHODS = (
    *("cdcp", "double_cover", "fdcp", "ldcp", "cem", "heat_flow", "ricci", "pgcp", "sem"),
    *("harmonic", "abf", "lscm", "spectral", "bff", "bff_disk", "arap", "slim"),
    *("sphere", "flash"),
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
    chosen = [name.strip() for name in methods.split(",")] if methods else []
    if unknown := [name for name in chosen if name not in METHODS]:
        raise typer.BadParameter(f"{unknown[0]!r} is not one of {', '.join(METHODS)}.")
    meshes = list(dict.fromkeys(meshes))
    if view and len(meshes) > 1:
        raise typer.BadParameter("--view is for one mesh.")
    files = json_file, csv_file, picture, view
    with exit_codes():
        check_targets(files, meshes, force)
    compared: list[_Compared] = []
    unprinted: list[BaseException] = []
    for mesh in meshes:
        try:
            with exit_codes(mesh):
                found = _surfaces_of(mesh, chosen)
        except typer.Exit:
            continue  # and the message has been printed
        for surface in found:
            surface.run(time_limit)
        compared += (surface for surface in found if surface.made)
        try:
            _print(found)
        except (OSError, SystemExit) as error:  # Rich exits where nobody reads from a pipe
            if not any(files):
                raise
            unprinted.append(error)  # the files are still to be written
    if not compared:
        raise typer.Exit(BAD_INPUT)
    with writing():
        _write(compared, json_file, csv_file, picture)
    if view:
        with exit_codes(meshes[0]), writing():
            _write_page(compared[0], view)
    if unprinted:
        raise unprinted[0]
    if len({surface.mesh for surface in compared}) < len(meshes):
        raise typer.Exit(SOME_FAILED)


@dataclass
class _Compared:
    """A surface of a mesh, as it is or cut open, and what some methods have made of it."""

    mesh: Path
    V: Floats
    F: Ints
    methods: Sequence[str]
    closed: bool = False
    made: list[tuple[Case, Floats | None]] = field(default_factory=list)

    def run(self, time_limit: float) -> None:
        """Run the methods, each in a process of its own."""
        from ..reference.case import run_case

        with writing(), progress_bar() as progress:  # what each process says is a file
            for done, method in enumerate(self.methods):
                progress(method, done / len(self.methods))
                self.made.append(run_case(method, self.V, self.F, time_limit=time_limit))


def _surfaces_of(mesh: Path, chosen: Sequence[str]) -> list[_Compared]:
    """Read a mesh: a disk; or a closed surface, cut open for maps to the plane, and as it is."""
    from ..io import read_polygons
    from ..io.polygons import naming_polygons

    V, F, polygon_of_face = read_polygons(mesh)
    with naming_polygons(polygon_of_face):
        opened = _opened(V, F)
    plane = [name for name in chosen or METHODS if name not in SPHERES]
    if opened is None:
        return [_Compared(mesh, V, F, chosen or plane)]
    spheres = [name for name in chosen or SPHERES if name in SPHERES]
    return [_Compared(mesh, *opened, plane), _Compared(mesh, V, F, spheres, closed=True)]


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
    chart = surface_map(V, F, outline="disk", max_charts=1).charts[0].mesh
    return chart.positions, chart.F


def _print(found: Sequence[_Compared]) -> None:
    """Print what methods have made of a mesh."""
    from ..errors import printable

    whole = found[-1]
    title = f"{printable(whole.mesh)}: {len(whole.V):,} vertices"
    title += ", cut open for maps to the plane" if whole.closed else ""
    print_cases(title, [case for surface in found for case, _ in surface.made])


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


def _write(
    compared: Sequence[_Compared],
    json_file: Path | None,
    csv_file: Path | None,
    picture: Path | None,
) -> None:
    """Write the numbers, a row a case, and draw the maps side by side, a row a surface."""
    from ..errors import printable
    from ..io.output import whole_file, write_table, write_text

    table = [
        {"mesh": printable(surface.mesh), **case.as_json()}
        for surface in compared
        for case, _ in surface.made
    ]
    if json_file:
        write_text(json_file, json.dumps(table, indent=2, ensure_ascii=False) + "\n")
    if csv_file:
        write_table(csv_file, table[0], table)
    if picture:
        from ..plot import side_by_side

        maps = [[(case.method, case.mean, uv) for case, uv in one.made] for one in compared]
        rows = [(one.V, one.F, made) for one, made in zip(compared, maps, strict=True)]
        names = [printable(surface.mesh.name) for surface in compared]
        with whole_file(picture) as unfinished:
            side_by_side(rows, names=names).savefig(unfinished)


def _write_page(surface: _Compared, view: Path) -> None:
    """Write the page of the disk map, or that onto the sphere, with the other maps beside it."""
    from ..errors import printable
    from ..maps.disk import disk_map
    from ..maps.sphere import sphere_map

    maps = {case.method: uv for case, uv in surface.made if uv is not None}
    beside = {name: maps[name] for name in maps if name not in ("cdcp", *SPHERES)}
    shown = (sphere_map if surface.closed else disk_map)(surface.V, surface.F)
    shown.view(view, beside=beside, title=printable(surface.mesh.name))
