"""Every option of every map, as its signature has them, through `batch` and the shell."""

from inspect import signature

import numpy as np
import pytest
from batches import batch
from commands import invoke

import cdcp_igl
from cdcp_igl.scale.one_file import MAPS, ONTO, OWN
from cdcp_igl.surface.mesh import DiskMesh

CAP, SQUARE = cdcp_igl.datasets.spherical_cap(5)[:2], cdcp_igl.datasets.square(4)[:2]
DISK = np.column_stack([SQUARE[0][:, :2], np.sin(SQUARE[0]).sum(axis=1) / 3]), SQUARE[1]
RECTANGLE = DiskMesh(*DISK).loop[::8].tolist()
SURFACES = {
    **dict.fromkeys(["disk", "free", "rectangle"], DISK),
    "surface": cdcp_igl.datasets.spheroid(1)[:2],
    "sphere": cdcp_igl.datasets.spheroid(1)[:2],
    "annulus": (CAP[0][1:], CAP[1][CAP[1].min(axis=1) > 0] - 1),
}
# Of each option, for one map or for all that have it: a value that is taken, and one that is not.
VALUES = {
    "center": ("centroid", "middle"),
    "mobius": ("area", "best"),
    "sphere mobius": (None, "angle"),
    "align": ([0.0, 1.0, 0.0], "up"),
    "sphere align": ({3: [1.0, 0.0, 0.0]}, [0.0, 1.0, 0.0]),
    "refine": (1, -1),
    "refine_norm": (1.2, 3.0),
    "refine_seconds": (0.0, -1.0),
    "preset": ("paper", "book"),
    "solver": ("scipy", "umfpack"),
    "boundary_scale": (np.linspace(1, 2, len(DISK[0])), "large"),
    "corners": (dict.fromkeys(RECTANGLE, np.pi / 2), [1, 2, 3]),
    "rectangle corners": (RECTANGLE, [1, 2, 3]),
    "merge": (False, "x"),
    "split": (True, "x"),
    "outline": ("disk", "round"),
    "fill": (False, "x"),
    "scale_variation": (3.0, -1.0),
    "max_charts": (2, 0),
    "seams": ("keep", "x"),
    "forbidden": ([[0, 13], [0, 16]], "x"),
    "size": (64, 0),
    "padding": (1.5, -1.0),
    "density": (20.0, -1.0),
    "rotate": (False, "x"),
    "keep": ("lengths", "volumes"),
    "pins": ({0: (0.0, 0.0), 9: (1.0, 0.0)}, {0: (0.0, 0.0)}),
}
# What is not in the shell, or by a file: an environment variable, or numbers of vertices.
IN_PYTHON = {"solver", "boundary_scale", "free corners", "sphere align", "pins"}
SWITCHES = {
    "merge": "--no-merge",
    "fill": "--no-fill",
    "rotate": "--no-rotate",
    "split": "--split",
}


def options_of(function):
    return [name for name in signature(function).parameters if name not in OWN]


OPTIONS = [(kind, name) for kind in MAPS for name in options_of(MAPS[kind][0])]
NAMES = sorted({name for _, name in OPTIONS})
ABSENT = [(kind, name) for kind in MAPS for name in NAMES if (kind, name) not in OPTIONS]


def value_of(kind, name, which=0):
    """What is asked for, with what the map cannot do without."""
    needed = {"corners": RECTANGLE} if kind == "rectangle" else {}
    if kind == "surface" and name in ("center", "mobius", "preset"):
        needed = {"outline": "disk"}
    values = VALUES.get(f"{kind} {name}") or VALUES[name]
    return needed | {name: values[which]}


def flags_of(kind):
    return {"onto": kind} if kind in ONTO else {"cut": kind == "surface", "free": kind == "free"}


def arguments(kind, options, folder=None):
    """What is said in the shell for some options of a map; `folder` is for a file of edges."""
    of_kind = {"surface": ["--cut"], "disk": [], "rectangle": []}.get(kind, [f"--{kind}"])
    for name, value in options.items():
        if name in SWITCHES:
            of_kind.append(SWITCHES[name])
            continue
        if name == "forbidden" and folder:
            np.savetxt(folder / "edges.txt", value, fmt="%d")
            value = folder / "edges.txt"
        option = "rectangle" if name == "corners" else name.replace("_", "-")
        text = ",".join(map(str, value)) if isinstance(value, list) else str(value).lower()
        of_kind += [f"--{option}", text]
    return of_kind


@pytest.mark.parametrize(("kind", "name"), OPTIONS)
def test_what_is_right_arrives(kind, name, tmp_path):
    options, (V, F) = value_of(kind, name), SURFACES[kind]
    np.savez(tmp_path / "surface.npz", V=V, F=F)
    expected = MAPS[kind][0](V, F, **options).uv
    out = tmp_path / "map.npz"
    made = batch(tmp_path / "surface.npz", tmp_path / "maps", **flags_of(kind), **options)
    assert made.failed == ()
    assert (made.records[0].charts, made.records[0].boundary != "") == (1, True)
    np.testing.assert_array_equal(np.load(tmp_path / "maps" / "surface.npz")["uv"], expected)
    if not {name, f"{kind} {name}"} & IN_PYTHON:
        said = arguments(kind, options, tmp_path)
        done = invoke("map", tmp_path / "surface.npz", out, *said)
        assert done.exit_code == 0, done.output
        np.testing.assert_array_equal(np.load(out)["uv"], expected)


@pytest.mark.parametrize(("kind", "name"), [*OPTIONS, *ABSENT])
def test_what_is_wrong_is_said_before_anything_is_read(kind, name, tmp_path):
    which = 1 if (kind, name) in OPTIONS else 0
    says = name if which else "no option|are for disks"
    options = value_of(kind, name, which)
    out = tmp_path / "maps"
    with pytest.raises(ValueError, match=says):
        cdcp_igl.batch(tmp_path / "none.obj", out, **flags_of(kind), **options)
    if name not in IN_PYTHON and not (name in SWITCHES and which):
        done = invoke("map", tmp_path / "none.obj", tmp_path / "o.npz", *arguments(kind, options))
        assert done.exit_code == 2
        assert "No such file" not in done.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"refine_secs": 1}, "refine_secs: no option of the disk map; did you mean refine_seconds"),
        ({"job": 2}, "job: no option of batch; did you mean jobs"),
        ({"fill": False}, "fill: no option of the disk map; the surface .cut. map has it"),
        ({"onto": "rectangle"}, "the rectangle map needs corners"),
        ({"onto": "cube"}, 'onto must be "sphere", "annulus", "rectangle" or None, not .cube'),
        ({"onto": "annulus", "clean": True, "free": True}, "^free: no option of the annulus"),
        ({"free": True, "corners": {0: 1.0}, "boundary_scale": [1.0]}, "only one is possible"),
        ({"free": True, "boundary_scale": [1.0], "refine": 1}, "refine moves the boundary"),
        ({"within": 1e-6}, "it needs clean"),
        ({"within": -1, "clean": True}, "within must be 0 or more"),
        ({"free": True, "clean": True, "boundary_scale": [1.0]}, "which clean and parts change"),
    ],
)
def test_what_is_said(tmp_path, options, says):
    with pytest.raises(ValueError, match=says):
        cdcp_igl.batch(tmp_path / "none.obj", tmp_path / "maps", **options)


def test_rows_of_the_file_that_cleaning_moves(tmp_path):
    """Two vertices and faces are dropped; a corner that is dropped is named."""
    V, F = DISK
    folded = np.vstack([[[0, 0, 1], [1, 1, 0]], F + 2])
    np.savez(tmp_path / "folded.npz", V=np.vstack([V[:2] + 9, V]), F=folded)
    corners = [vertex + 2 for vertex in RECTANGLE]
    for flags, given in (
        ({"onto": "rectangle"}, corners),
        ({"free": True}, dict.fromkeys(corners, np.pi / 2)),
    ):
        out = tmp_path / str(len(flags)) / next(iter(flags))
        made = batch(tmp_path / "folded.npz", out, clean=True, corners=given, **flags)
        assert made.failed == ()
        kind = flags.get("onto", "free")
        expected = MAPS[kind][0](V, F, **value_of(kind, "corners")).uv
        np.testing.assert_array_equal(np.load(out / "folded.npz")["uv"], expected)
    [failed] = batch(
        tmp_path / "folded.npz", tmp_path / "o", clean=True, onto="rectangle", corners=[0, 5, 6, 7]
    ).failed
    assert failed.message == "corners is vertex 0, which is not in the cleaned surface"
