"""The way of the data, drawn from the steps of `algorithm.py`."""

from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

import cdcp_igl

# File, what it does, what it hands on.
STEPS = (
    ("surface/mesh.py", "check", "DiskMesh: boundary loop, interior"),
    ("solve/laplacian.py", "eq. (8)", "L, sparse (n, n)"),
    ("solve/factored.py", "one factorization", "factor of L_II"),
    ("steps/center.py", "eqs. (13)–(15), torsion", "central face"),
    ("steps/trace.py", "Theorem 1, by the conjugate", "boundary trace h_B"),
    ("steps/zipper.py", "whitening, eqs. (1)–(6)", "f_B on the circle"),
    ("solve/factored.py", "eq. (10)", "f on the disk"),
    ("steps/mobius.py", "eqs. (19)–(20)", "f, least distortion"),
    ("verdict/certificate.py", "exact signs", "Certificate"),
    ("result/disk_map.py", "", "DiskMap: uv and all about it"),
)
OTHERS = (
    "maps/problem.py",
    "Where this map is not good:\nother starts, straightening,\n"
    "repair of flipped faces, descent;\nthe best valid map goes on",
)
PAPER = ("steps/center.py", "steps/mobius.py")  # the first and the last step of Algorithm 1
STYLE = {"svg.hashsalt": "flow"}
INK, BOX, BESIDE = "#1d2733", "#e6edf5", "#f5ece6"


def draw():
    """One box a file, what it does to the right, what it hands on; other starts beside."""
    figure = Figure(figsize=(9.2, 6.6))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, 9.2), ylim=(len(STEPS) + 0.1, -0.75))
    axes.set_axis_off()
    style = {"color": INK, "va": "center", "fontsize": 10}
    axes.text(1.35, -0.45, "V (n, 3), F (m, 3)", ha="center", **style)
    for row, (module, what, handed_on) in enumerate(STEPS):
        _arrow(axes, (1.35, row - (0.25 if row == 0 else 0.42)), (1.35, row))
        _box(axes, 1.35, row + 0.28, module, BOX)
        axes.text(2.75, row + 0.2, handed_on, weight="bold", **style)
        axes.text(2.75, row + 0.48, what, **(style | {"fontsize": 8.5}))
    rows = {module: row for row, (module, _, _) in enumerate(STEPS)}
    first, last = (rows[module] for module in PAPER)
    axes.plot([5.35, 5.45, 5.45, 5.35], [first, first, last + 0.6, last + 0.6], color=INK, lw=1)
    axes.text(5.6, (first + last + 0.6) / 2, "Algorithm 1: algorithm.py", **style)
    folder, text = OTHERS
    judged = rows["verdict/certificate.py"] + 0.28
    _box(axes, 6.2, judged, folder, BESIDE)
    axes.text(6.75, judged, text, **(style | {"fontsize": 8.5}))
    _arrow(axes, (4.4, judged - 0.08), (5.8, judged - 0.08))
    _arrow(axes, (5.8, judged + 0.08), (4.4, judged + 0.08))
    return figure


def _box(axes, x, y, text, color):
    frame = {"boxstyle": "round,pad=0.45", "facecolor": color, "edgecolor": INK}
    axes.text(x, y, text, color=INK, ha="center", va="center", family="monospace", bbox=frame)


def _arrow(axes, start, end):
    look = {"arrowstyle": "-|>", "color": INK, "linewidth": 1}
    axes.annotate("", end, start, arrowprops=look)


def missing():
    """Files of the picture that are not there any more."""
    package = Path(cdcp_igl.__file__).parent
    return [
        name for name in (OTHERS[0], *(step[0] for step in STEPS)) if not (package / name).exists()
    ]


def _write(app):
    with mpl.rc_context(STYLE):
        target = Path(app.srcdir, "generated", "flow.svg")
        target.parent.mkdir(exist_ok=True)
        draw().savefig(target, facecolor="white", metadata={"Date": None})


def setup(app):
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": False}
