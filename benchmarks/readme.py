"""The table of measured numbers in the README."""

from __future__ import annotations

import os
import platform
import statistics
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import perf_counter

from cdcp_igl import angle_distortion, cdcp, cholmod, datasets, libigl
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.injectivity import certify
from cdcp_igl.mesh import DiskMesh
from cdcp_igl.reference import METHODS

README = Path(__file__).parents[1] / "README.md"
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"

MODELS = ("chinese_lion", "human_face", "human_brain", "left_hand")
COLUMNS = {
    "**CDCP**": cdcp,
    "**CDCP, refine=5**": partial(cdcp, refine=5),
    "FDCP": METHODS["fdcp"].function,
    "LDCP": METHODS["ldcp"].function,
    "harmonic, arc length": METHODS["harmonic"].function,
    "LSCM, *free boundary*": METHODS["lscm"].function,
}
REPEATS = 3


def write() -> None:
    """Measure and rewrite the table between the two markers of README.md."""
    text = README.read_text(encoding="utf-8")
    head, rest = text.split(BEGIN)
    _, tail = rest.split(END)
    README.write_text(f"{head}{BEGIN}\n{_table()}\n{END}{tail}", encoding="utf-8")


def _table() -> str:
    rows = [
        "| surface | vertices | " + " | ".join(COLUMNS) + " |",
        "|---" * (2 + len(COLUMNS)) + "|",
    ]
    for model in MODELS:
        V, F = datasets.load(model)
        seconds, cells = {}, {}
        for name, method in COLUMNS.items():
            uv, seconds[name] = _timed(method, V, F)
            degrees = angle_distortion(V, F, uv)
            flips = len(certify(DiskMesh(V, F), uv).flipped)
            cells[name] = f"{degrees.mean():.3f} / {degrees.std():.3f}" + (
                f", {flips} flips" if flips else ""
            )
        rows.append(
            f"| {model.replace('_', ' ')} | {len(V):,} | "
            + " | ".join(
                f"{cells[name]} ({seconds[name] / seconds['**CDCP**']:.1f} ×)" for name in COLUMNS
            )
            + " |"
        )
    return "\n".join(
        [
            *rows,
            "",
            "Mean / SD of the angular distortion in degrees, and time as a multiple of CDCP's "
            f"(medians of {REPEATS}, one run, {os.cpu_count()} cores, {platform.machine()}, "
            f"Python {platform.python_version()}, libigl {libigl.VERSION}, scikit-sparse "
            f"{cholmod.VERSION}). No map flips a face unless it says so. LSCM is conformal but "
            "its image is no disk; the harmonic map is a disk but not conformal. Written by "
            "`python -m benchmarks readme`.",
        ]
    )


def _timed(method: Callable[..., Floats], V: Floats, F: Ints) -> tuple[Floats, float]:
    seconds = []
    for _ in range(REPEATS):
        start = perf_counter()
        uv = method(V, F)
        seconds.append(perf_counter() - start)
    return uv, statistics.median(seconds)
