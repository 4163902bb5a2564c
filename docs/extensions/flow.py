"""The way of the data, drawn from the steps of `algorithm.py`."""

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

STEPS = (
    ("surface/mesh.py", "check", "DiskMesh: boundary loop, interior"),
    ("solve/laplacian.py", "eq. (8)", "L, sparse (n, n)"),
    ("solve/factor.py", "one factorization", "factor of L_II"),
    ("steps/center.py", "eqs. (13)–(15), torsion", "central face"),
    ("steps/trace.py", "Theorem 1, by the conjugate", "boundary trace h_B"),
    ("steps/zipper.py", "whitening, eqs. (1)–(6)", "f_B on the circle"),
    ("steps/extension.py", "eq. (10)", "f on the disk"),
    ("steps/straightening.py", "common shear", "f, not sheared as a whole"),
    ("steps/mobius.py", "eqs. (19)–(20)", "f, least distortion"),
    ("steps/repair.py", "mean values", "f, no flipped face"),
    ("certificate.py", "exact signs", "Certificate"),
    ("selection.py", "conformal, or the next way", "the best map"),
    ("steps/refine.py", "Gauss-Newton, if asked for", "f, refined"),
    ("result.py", "", "DiskMap: uv and all about it"),
)
STYLE = {"svg.hashsalt": "flow"}
INK, BOX = "#1d2733", "#e6edf5"


def draw():
    """One box a file, what it does to the right, what it hands on below."""
    figure = Figure(figsize=(6.6, 8.8))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, 6.6), ylim=(len(STEPS) + 0.4, -0.75))
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
            module,
            ha="center",
            family="monospace",
            bbox={"boxstyle": "round,pad=0.45", "facecolor": BOX, "edgecolor": INK},
            **style,
        )
        axes.text(2.75, row + 0.28, handed_on, weight="bold", **style)
        axes.text(6.5, row + 0.28, what, ha="right", **(style | {"fontsize": 8.5}))
    return figure


def _write(app):
    with mpl.rc_context(STYLE):
        target = Path(app.srcdir, "generated", "flow.svg")
        target.parent.mkdir(exist_ok=True)
        draw().savefig(target, facecolor="white", metadata={"Date": None})


def setup(app):
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": False}
