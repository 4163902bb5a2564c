"""Patterns to cut, true to scale: svg, and dxf by ezdxf."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..arrays import Floats, Ints
from ..extras import from_extra

PATTERNS = (".dxf", ".svg")
# Of each unit, millimetres and the number that dxf has for it.
UNITS = {"mm": (1.0, 4), "cm": (10.0, 5), "m": (1000.0, 6), "in": (25.4, 1), "ft": (304.8, 2)}
STROKE = 0.25  # mm


class Lines(NamedTuple):
    """What is drawn: closed outlines (k, 2) each, notches and folds (k, 2, 2), and numbers (k,).

    A notch leads from the middle of an edge inwards; its number, as high as the notch is long,
    stands at its end.
    """

    outlines: tuple[Floats, ...]
    notches: Floats
    numbers: Ints
    folds: Floats


def write_svg(path: Path, lines: Lines, unit: str) -> None:
    """Write coordinates in the unit of the surface, and the size of the sheet in millimetres."""
    millimetres, _ = UNITS[unit]
    points = np.concatenate(lines.outlines)
    low, high = points.min(axis=0), points.max(axis=0)
    edge = 2 * STROKE / millimetres
    left, top = low[0] - edge, -high[1] - edge  # y goes down
    width, height = high - low + 2 * edge

    def path_of(points: Floats, end: str = "") -> str:
        steps = " L ".join(f"{x!r},{-y!r}" for x, y in points.tolist())
        return f'<path d="M {steps}{end}"/>'

    groups = {
        'id="outlines" stroke="black"': [path_of(outline, " Z") for outline in lines.outlines],
        'id="folds" stroke="gray"': [path_of(fold) for fold in lines.folds],
        'id="notches" stroke="red"': [path_of(notch) for notch in lines.notches],
        'id="numbers" fill="red" font-family="sans-serif" text-anchor="middle"': [
            f'<text x="{x:.6g}" y="{-y:.6g}" font-size="{size:.6g}">{number}</text>'
            for (x, y), size, number in zip(
                lines.notches[:, 1].tolist(), _sizes(lines), lines.numbers.tolist(), strict=True
            )
        ],
    }
    size = f'width="{float(width) * millimetres!r}mm" height="{float(height) * millimetres!r}mm"'
    box = f"{float(left)!r} {float(top)!r} {float(width)!r} {float(height)!r}"
    stroke = f'fill="none" stroke-width="{STROKE / millimetres:g}"'
    text = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="{box}" {stroke}>',
        *("\n".join([f"<g {name}>", *drawn, "</g>"]) for name, drawn in groups.items() if drawn),
        "</svg>\n",
    ]
    path.write_text("\n".join(text), encoding="utf-8")


def write_dxf(path: Path, lines: Lines, unit: str) -> None:
    """Write layers `outlines`, `folds`, `notches` and `numbers`, and which unit it is."""
    with from_extra("pattern"):
        from ezdxf.filemanagement import new
    drawing = new("R2010", units=UNITS[unit][1])
    model = drawing.modelspace()
    for name, colour in (("outlines", 7), ("folds", 8), ("notches", 1), ("numbers", 1)):
        drawing.layers.add(name, color=colour)
    for outline in lines.outlines:
        model.add_lwpolyline(outline.tolist(), close=True, dxfattribs={"layer": "outlines"})
    for name, segments in (("folds", lines.folds), ("notches", lines.notches)):
        for start, end in segments.tolist():
            model.add_line(start, end, dxfattribs={"layer": name})
    ends = zip(lines.numbers.tolist(), _sizes(lines), lines.notches[:, 1].tolist(), strict=True)
    for number, size, place in ends:
        text = model.add_text(f"{number}", height=size, dxfattribs={"layer": "numbers"})
        text.set_placement(place)
    drawing.saveas(path)


def _sizes(lines: Lines) -> list[float]:
    sizes: list[float] = np.linalg.norm(lines.notches[:, 1] - lines.notches[:, 0], axis=1).tolist()
    return sizes
