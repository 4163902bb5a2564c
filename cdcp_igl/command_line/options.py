"""Arguments and options that several commands take, each spelled out once."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperOption

# Those of `io`, spelled out: `--help` shows them, and must not wait for NumPy.
READABLE = (
    *(".gii", ".glb", ".gltf", ".mat", ".npz", ".obj", ".off", ".ply", ".stl"),
    *(".vtk", ".vtp", ".vtu", ".gii.gz"),
)
WRITABLE = (".glb", ".npz", ".obj", ".ply", ".vtk", ".vtp")
TEXTURED = (".glb", ".gltf", ".mat", ".npz", ".obj", ".ply", ".vtk", ".vtp")
PICTURES = (".png", ".svg", ".pdf")
SURFACES = " ".join(READABLE)

INPUTS = typer.Argument(metavar="IN...", help=f"Triangulated surfaces ({SURFACES}).")
# What `--help` lists together, and in which order; what is in no group comes last.
GROUPS = {
    "What to map": (
        "clean",
        "within",
        "only",
        "without",
        "cut",
        "no_merge",
        "outline",
        "fill",
        "seams",
        "forbidden",
        "scale_variation",
        "max_charts",
        *("size", "padding", "density", "no_rotate"),
    ),
    "Onto what": (
        *("free", "sphere", "annulus", "rectangle", "split"),
        *("center", "mobius", "align", "preset"),
    ),
    "Quality": ("keep", "pins", "refine", "refine_norm", "refine_seconds"),
    "Output": (
        *("disk", "bake", "out_dir", "format", "force", "report", "json_file", "csv_file"),
        *("picture", "view", "pattern", "unit", "quiet"),
    ),
    "Run": ("jobs", "scheduler", "shard", "retry", "time_limit", "memory_limit", "methods"),
}

QUIET = typer.Option(False, "--quiet", "-q", help="Print nothing but what went wrong.")
FORCE = typer.Option(False, "--force", help="Replace files that are there.")


class Command(TyperCommand):
    """A command that lists its options in groups, and refuses a value in the words of its option.

    On a terminal and in a pipe alike, which is why the panels of Rich are not asked for.
    """

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """List arguments and options."""
        groups: dict[str, list[Any]] = {"Arguments": [], **{name: [] for name in GROUPS}}
        for parameter in self.get_params(ctx):
            other = "Arguments" if parameter.param_type_name == "argument" else "Options"
            among = next((name for name in GROUPS if parameter.name in GROUPS[name]), other)
            groups.setdefault(among, []).append(parameter.get_help_record(ctx))
        for name, records in groups.items():
            if records:
                with formatter.section(name):
                    formatter.write_dl(records)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the arguments."""
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            option = error.param
            if isinstance(option, TyperOption) and option.callback is None:
                said = (option.get_help_record(ctx) or ("", ""))[1]
                error.message = f"it takes {option.metavar}. {said}"
            raise


def verify_target(path: Path, suffixes: tuple[str, ...]) -> None:
    """Refuse a path at which no file of one of these types can be put."""
    if path.suffix.lower() not in suffixes:
        raise typer.BadParameter(f"{path.name!r} must end in {' or '.join(suffixes)}.")
    if not os.path.isdir(path.parent):  # and no error where a name is too long to be one
        raise typer.BadParameter(f"there is no folder {str(path.parent)!r}.")
    if os.path.isdir(path):
        raise typer.BadParameter(f"{str(path)!r} is a folder.")


def file_option(name: str, example: str, suffixes: tuple[str, ...], help: str) -> Any:
    """Declare an option that names a file to write, of one of these types."""

    def verify(path: Path | None) -> Path | None:
        if path is not None:
            verify_target(path, suffixes)
        return path

    return typer.Option(None, name, metavar=example, callback=verify, help=help)


def _map_options(
    clean: bool = typer.Option(
        False,
        "--clean",
        help="Clean the surface first and say how: merge equal vertices, drop bad faces, orient, "
        "keep the largest component, fill holes. OUT has what is left of IN, in its order, "
        "without the filling. With --cut, what is left is cut open.",
    ),
    within: float = typer.Option(
        0.0,
        metavar="D",
        min=0,
        help="With --clean, merge vertices along seams that lie so near to each other, in the unit "
        "of IN; `check` counts them.",
    ),
    only: str | None = typer.Option(
        None,
        metavar="FILE[:NAMES]",
        help="Map only the vertices that a file of FreeSurfer or GIFTI names: lh.cortex.label, a "
        "patch, or labels as in lh.aparc.annot:insula,cuneus; sought beside the surface, {hemi} "
        "being lh or rh.",
    ),
    without: str | None = typer.Option(
        None, metavar="FILE[:NAMES]", help="Leave these vertices out, and map all others."
    ),
    cut: bool = typer.Option(
        False,
        "--cut",
        help="Map a surface that is no disk: closed, with handles, holes or several parts. Equal "
        "vertices are merged along seams, it is cut open, and each part mapped; texture "
        "coordinates show the charts side by side.",
    ),
    no_merge: bool = typer.Option(
        False, "--no-merge", help="With --cut, leave equal vertices along seams apart."
    ),
    outline: str | None = typer.Option(
        None,
        metavar="free|disk",
        help="With --cut, charts with outlines of their own, or onto disks. [default: free]",
    ),
    fill: bool | None = typer.Option(
        None,
        "--fill/--no-fill",
        help="With --cut, fill holes meanwhile, or cut to them. [default: what distorts less]",
    ),
    seams: str | None = typer.Option(
        None,
        metavar="uv|keep|FILE",
        help="With --cut, cut along these edges, and elsewhere only to make disks: where the "
        "texture coordinates of IN do, where IN has the same place twice, or those of a file with "
        "two vertices in each line, counted from 0.",
    ),
    forbidden: Path | None = typer.Option(
        None, metavar="FILE", help="With --cut, a file of edges, as of --seams, not to be cut."
    ),
    scale_variation: float | None = typer.Option(
        None,
        metavar="S",
        min=0,
        help="With --cut, how much the scale may vary (the standard deviation of its logarithm): "
        "slits and more charts see to it. [default: 0.2; of disks, 1]",
    ),
    max_charts: int | None = typer.Option(
        None, metavar="N", min=1, help="With --cut, so many charts a component at most."
    ),
    size: int | None = typer.Option(
        None,
        metavar="N",
        min=1,
        help="With --cut, texels along each side of the texture. [default: 2048]",
    ),
    padding: float | None = typer.Option(
        None,
        metavar="N",
        min=0,
        help="With --cut, texels between charts, and between them and the rim. [default: 4]",
    ),
    density: float | None = typer.Option(
        None,
        metavar="D",
        min=0,
        help="With --cut, texels a unit of the surface. [default: as many as there is room for]",
    ),
    no_rotate: bool = typer.Option(
        False, "--no-rotate", help="With --cut, do not turn charts to fill the texture better."
    ),
    free: bool = typer.Option(
        False,
        "--free",
        help="Map with a free outline, the boundary as long as it is: the least distortion.",
    ),
    sphere: bool = typer.Option(
        False,
        "--sphere",
        help="Map a closed surface without handles onto the sphere; texture coordinates show two "
        "hemispheres side by side, and an .npz file has its points, too.",
    ),
    annulus: bool = typer.Option(
        False,
        "--annulus",
        help="Map a surface with two boundary loops onto a ring; more loops are filled meanwhile.",
    ),
    rectangle: str | None = typer.Option(
        None,
        metavar="A,B,C,D",
        help="Map onto a rectangle with these boundary vertices, counted from 0, in its corners, "
        "from the lower left one on, the surface to the left.",
    ),
    split: bool = typer.Option(
        False,
        "--split",
        help="Split edges inside that join two vertices of one side of a rectangle.",
    ),
    center: str | None = typer.Option(
        None,
        metavar="torsion|heat|centroid|FACE",
        help="The face that carries the dipole, or how to find it. [default: torsion]",
    ),
    mobius: str | None = typer.Option(
        None,
        metavar="angle|area|none",
        help="What the Möbius transformation minimises. [default: angle; of a sphere, area]",
    ),
    align: str | None = typer.Option(
        None,
        metavar="VERTEX|X,Y,Z|FILE",
        help="What lies to the right: a boundary vertex counted from 0, or a direction in space. "
        "[default: the first boundary vertex] Of a sphere, directions in which vertices are to "
        "lie: in each line of FILE a vertex counted from 0, x, y and z.",
    ),
    preset: str | None = typer.Option(
        None, metavar="paper", help="Follow the paper; sets --center and --mobius itself."
    ),
    keep: str | None = typer.Option(
        None,
        metavar="lengths|areas|T|texels<D",
        help="What to keep rather than angles: T from 0 over 0.5, lengths, to 0.99, areas; or the "
        "least T at which densities of texels are within D. [default: angles]",
    ),
    pins: Path | None = typer.Option(
        None,
        metavar="FILE",
        help="With --free, where vertices are to be in the plane, in the unit of IN: in each line "
        "of FILE a vertex counted from 0, x and y.",
    ),
    refine: int | None = typer.Option(
        None,
        metavar="N",
        min=0,
        help="Steps of refinement after the harmonic map, 0 for none. [default: as needed]",
    ),
    refine_norm: float | None = typer.Option(
        None,
        metavar="P",
        min=1,
        max=2,
        help="Refinement lowers the sum of |angle error|^P. [default: 1.5]",
    ),
    refine_seconds: float | None = typer.Option(
        None, metavar="S", min=0, help="Begin no step of refinement after S seconds."
    ),
    disk: bool = typer.Option(
        False, "--disk", help="Texture coordinates in the unit disk, not in [0, 1]^2."
    ),
    bake: int | None = typer.Option(
        None,
        metavar="PIXELS",
        min=1,
        help="Bake the image that the surface shows to its new place, so that it looks as before: "
        "into OUT.glb, or beside OUT.obj, square, with so many pixels a side.",
    ),
) -> dict[str, Any]:
    """Return the flags, `onto`, and those options of the map that were given."""
    onto = {"sphere": sphere, "annulus": annulus, "rectangle": rectangle}
    if len(chosen := [name for name in onto if onto[name]]) > 1:
        raise typer.BadParameter(f"--{' and --'.join(chosen)}: give one of them.")
    options = {
        "merge": False if no_merge else None,
        "outline": outline,
        "fill": fill,
        "seams": seams if seams in (None, "uv", "keep") else _edges("--seams", Path(seams)),
        "forbidden": forbidden and _edges("--forbidden", forbidden),
        "scale_variation": scale_variation,
        "max_charts": max_charts,
        "size": size,
        "padding": padding,
        "density": density,
        "rotate": False if no_rotate else None,
        "corners": rectangle and _numbers(rectangle, int),
        "split": split or None,
        "center": int(center) if center and center.isdecimal() else center,
        "mobius": mobius,
        "align": align and _align(align, sphere=sphere),
        "preset": preset,
        "keep": keep,
        "pins": pins and _vectors("--pins", pins, "xy"),
        "refine": refine,
        "refine_norm": refine_norm,
        "refine_seconds": refine_seconds,
    }
    given: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    if mobius == "none":
        given["mobius"] = None
    flags = {"disk": disk, "clean": clean, "cut": cut, "free": free}
    parts = {"within": within, "only": only, "without": without, "bake": bake}
    return {**flags, **parts, "onto": next(iter(chosen), None), **given}


def _edges(option: str, file: Path) -> list[list[int]]:
    """Read a file of two vertices in each line."""
    return _rows(option, file, (int, int), "two vertices")


def _rows(option: str, file: Path, kinds: tuple[type, ...], what: str) -> list[list[Any]]:
    """Read a file of as many numbers in each line, of these kinds."""
    try:
        lines = filter(None, map(str.split, file.read_text().splitlines()))
        return [[kind(x) for kind, x in zip(kinds, line, strict=True)] for line in lines]
    except OSError:
        raise typer.BadParameter(f"{option}: {file.name!r} is no file that can be read.") from None
    except ValueError:  # also of bytes that are no text
        problem = f"{option}: {file.name!r} must have {what} in each line."
        raise typer.BadParameter(problem) from None


def _align(text: str, *, sphere: bool) -> Any:
    """Read what lies to the right, or of a sphere the file of directions."""
    if sphere:
        return _vectors("--align", Path(text), "xyz")
    return int(text) if text.isdecimal() else _numbers(text, float)


def _vectors(option: str, file: Path, axes: str) -> dict[int, tuple[float, ...]]:
    """Read a vector for each of some vertices."""
    kinds = (int, *[float] * len(axes))
    rows = _rows(option, file, kinds, ", ".join(("a vertex", *axes)))
    vectors = {vertex: tuple(vector) for vertex, *vector in rows}
    if len(vectors) < len(rows):
        raise typer.BadParameter(f"{option}: {file.name!r} names a vertex twice.")
    return vectors


def _numbers(text: str, kind: type) -> list[Any] | str:
    """Read numbers between commas; what is none is left for the map to refuse."""
    try:
        return [kind(number) for number in text.split(",")]
    except ValueError:
        return text


def takes_map_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of a map; it gets them as a dict, its argument `options`."""
    shared = inspect.signature(_map_options, eval_str=True).parameters
    own = inspect.signature(command, eval_str=True).parameters
    parameters = [*(own[name] for name in own if name != "options"), *shared.values()]

    def run(**given: Any) -> None:
        options = _map_options(**{name: given.pop(name) for name in shared})
        command(options, **given)

    # Typer makes its options from these.
    run.__doc__ = command.__doc__
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    run.__dict__["__signature__"] = inspect.Signature(parameters)
    return run
