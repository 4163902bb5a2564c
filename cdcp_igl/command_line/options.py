"""Arguments and options that several commands take, each spelled out once."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import typer

# Those of `io`, spelled out: `--help` shows them, and must not wait for NumPy.
READABLE = (".glb", ".gltf", ".mat", ".npz", ".obj", ".off", ".ply", ".stl", ".vtk", ".vtu")
WRITABLE = (".glb", ".npz", ".obj", ".ply")
PICTURES = (".png", ".svg", ".pdf")
SURFACES = " ".join(READABLE)

INPUTS = typer.Argument(metavar="IN...", help=f"Triangulated surfaces ({SURFACES}).")
QUIET = typer.Option(False, "--quiet", "-q", help="Print nothing but what went wrong.")
FORCE = typer.Option(False, "--force", help="Replace files that are there.")


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
    disk: bool = typer.Option(
        False, "--disk", help="Texture coordinates in the unit disk, not in [0, 1]^2."
    ),
    clean: bool = typer.Option(
        False,
        "--clean",
        help="Clean the surface first and say how: merge equal vertices, drop bad faces, orient, "
        "keep the largest component, fill holes. OUT has what is left of IN, in its order, "
        "without the filling. With --cut, what is left is cut open.",
    ),
    cut: bool = typer.Option(
        False,
        "--cut",
        help="Map a surface that is no disk: closed, with handles, holes or several components. "
        "Equal vertices are merged along seams, it is cut open, and each component mapped; texture "
        "coordinates show the disks side by side. With --free, the charts have free outlines.",
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
    scale_variation: float | None = typer.Option(
        None,
        metavar="S",
        min=0,
        help="With --cut, part a component whose scale varies more than this (the standard "
        "deviation of its logarithm). [default: 1]",
    ),
    max_charts: int | None = typer.Option(
        None, metavar="N", min=1, help="With --cut, so many charts a component at most."
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
        metavar="VERTEX|X,Y,Z",
        help="What lies to the right: a boundary vertex counted from 0, or a direction in space. "
        "[default: the first boundary vertex]",
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
    preset: str | None = typer.Option(
        None, metavar="paper", help="Follow the paper; sets --center and --mobius itself."
    ),
) -> dict[str, Any]:
    """Return the flags, `onto`, and those options of the map that were given."""
    options = {
        "scale_variation": scale_variation,
        "max_charts": max_charts,
        "center": int(center) if center and center.isdecimal() else center,
        "mobius": mobius,
        "align": align and _row_or_direction(align),
        "refine": refine,
        "refine_norm": refine_norm,
        "refine_seconds": refine_seconds,
        "preset": preset,
    }
    given: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    if mobius == "none":
        given["mobius"] = None
    if sphere and annulus:
        raise typer.BadParameter("--sphere and --annulus: give one of them.")
    onto = "sphere" if sphere else "annulus" if annulus else None
    return {"disk": disk, "clean": clean, "cut": cut, "free": free, "onto": onto, **given}


def _row_or_direction(text: str) -> int | list[float] | str:
    """Read VERTEX or X,Y,Z; what is neither is left for the map to refuse."""
    if text.isdecimal():
        return int(text)
    try:
        return [float(number) for number in text.split(",")]
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
