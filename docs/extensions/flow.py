"""The way of the data, drawn from the steps of `cdcp.py`."""

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

STEPS = (
    ("mesh", "check", "DiskMesh: boundary loop, interior"),
    ("laplacian", "eq. (8)", "L, sparse (n, n)"),
    ("factor", "one factorization", "Factor: two solves"),
    ("center", "eqs. (13)–(15), torsion", "central face"),
    ("dipole", "eq. (18), Theorem 1", "boundary trace h_B"),
    ("circle", "whitening, eqs. (1)–(6), fallbacks", "f_B on the circle"),
    ("extension", "eq. (10)", "f on the disk"),
    ("mobius", "eqs. (19)–(20)", "f, least distortion"),
    ("repair", "mean values", "f, no flipped face"),
    ("refine", "Gauss-Newton, if asked for", "f, refined"),
    ("injectivity", "exact signs", "Certificate"),
    ("result", "", "DiskMap: uv and all about it"),
)
STYLE = {"svg.hashsalt": "flow"}
INK, BOX = "#1d2733", "#e6edf5"


def draw():
    """One box a file, what it does to the right, what it hands on below."""
    figure = Figure(figsize=(6.2, 7.6))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, 6.2), ylim=(len(STEPS) + 0.4, -0.75))
    axes.set_axis_off()
    style = {"color": INK, "va": "center", "fontsize": 10}
    axes.text(1.35, -0.45, "V (n, 3), F (m, 3)", ha="center", **style)
    for row, (module, what, handed_on) in enumerate(STEPS):
        axes.annotate(
            "",
            (1.35, row),
            (1.35, row - (0.25 if row == 0 else 0.42)),
            arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1},
        )
        axes.text(
            1.35,
            row + 0.28,
            f"{module}{'/' if module == 'circle' else '.py'}",
            ha="center",
            family="monospace",
            bbox={"boxstyle": "round,pad=0.45", "facecolor": BOX, "edgecolor": INK},
            **style,
        )
        axes.text(2.5, row + 0.28, handed_on, weight="bold", **style)
        axes.text(6.1, row + 0.28, what, ha="right", **(style | {"fontsize": 8.5}))
    return figure


def _write(app):
    with mpl.rc_context(STYLE):
        target = Path(app.srcdir, "generated", "flow.svg")
        target.parent.mkdir(exist_ok=True)
        draw().savefig(target, facecolor="white", metadata={"Date": None})


def setup(app):
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": False}
