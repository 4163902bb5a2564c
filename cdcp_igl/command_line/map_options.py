"""Options of the map, for the commands that make maps."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any

import typer

__all__ = [
    "Align",
    "Center",
    "Mobius",
    "MobiusMethod",
    "Preset",
    "PresetName",
    "Refine",
    "RefineNorm",
    "RefineSeconds",
    "chosen_options",
]


class MobiusMethod(StrEnum):
    """Values of --mobius."""

    angle = "angle"
    area = "area"
    none = "none"


class PresetName(StrEnum):
    """Values of --preset."""

    paper = "paper"


def _center(text: str | None) -> str | int | None:
    if text is None or text in ("torsion", "heat", "centroid"):
        return text
    if not text.isdecimal():
        raise typer.BadParameter("must be torsion, heat, centroid or a face counted from 0.")
    return int(text)


def _align(text: str | None) -> int | list[float] | None:
    if text is None:
        return None
    try:
        if text.isdecimal():
            return int(text)
        x, y, z = map(float, text.split(","))
    except ValueError as error:
        raise typer.BadParameter("must be a vertex counted from 0, or X,Y,Z.") from error
    return [x, y, z]


Center = Annotated[
    str | None,
    typer.Option(
        metavar="torsion|heat|centroid|FACE",
        callback=_center,
        help="The face that carries the dipole, or how to find it. [default: torsion]",
    ),
]
Mobius = Annotated[
    MobiusMethod | None,
    typer.Option(help="What the Möbius transformation minimises. [default: angle]"),
]
Align = Annotated[
    str | None,
    typer.Option(
        metavar="VERTEX|X,Y,Z",
        callback=_align,
        help="What lies to the right: a boundary vertex counted from 0, or a direction in space. "
        "[default: the first boundary vertex]",
    ),
]
Refine = Annotated[
    int, typer.Option(metavar="N", min=0, help="Steps of refinement after the harmonic map.")
]
RefineNorm = Annotated[
    float | None,
    typer.Option(
        metavar="P",
        min=1,
        max=2,
        help="Refinement lowers the sum of |angle error|^P. [default: 1.5]",
    ),
]
RefineSeconds = Annotated[
    float | None,
    typer.Option(metavar="S", min=0, help="Begin no step of refinement after S seconds."),
]
Preset = Annotated[
    PresetName | None, typer.Option(help="Follow the paper; sets --center and --mobius itself.")
]


def chosen_options(
    center: str | int | None,
    mobius: MobiusMethod | None,
    align: object,
    refine: int,
    refine_norm: float | None,
    refine_seconds: float | None,
    preset: PresetName | None,
) -> dict[str, Any]:
    """Return the options of `disk_map` that were given."""
    if preset and (center, mobius) != (None, None):
        raise typer.BadParameter("--preset paper sets --center and --mobius itself.")
    options = {
        "center": center,
        "mobius": mobius and mobius.value,
        "align": align,
        "refine": refine or None,
        "refine_norm": refine_norm,
        "refine_seconds": refine_seconds,
        "preset": preset and preset.value,
    }
    given = {name: value for name, value in options.items() if value is not None}
    if mobius is MobiusMethod.none:
        given["mobius"] = None
    return given
