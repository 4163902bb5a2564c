"""Tables of errors, made by raising each of them.

The inputs are the nasty meshes of the tests and the calls below, so a table cannot say what
the package does not. `tests/test_docs.py` checks that no defect is missing.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import cdcp_igl
from cdcp_igl.io import read_mesh, write_map

ROOT = Path(__file__).parents[2]

FILES = {
    "a name that ends in `.txt`": ("mesh.txt", ""),
    "an off file without its first line": ("mesh.off", "3 1 0\n"),
    "an obj file with a face of two corners": ("mesh.obj", "v 0 0 0\nv 1 0 0\nf 1 2\n"),
}

CALLS = (
    'disk_map(V, F, center="middle")',
    "disk_map(V, F, center=len(F))",
    'disk_map(V, F, mobius="least")',
    "disk_map(V, F, align=interior)",
    "disk_map(flat, F, align=[0, 0, 1])",
    "disk_map(V, F, refine=-1)",
    "disk_map(V, F, refine=1, refine_norm=3)",
    "disk_map(V, F, refine=1, refine_seconds=-1)",
    'disk_map(V, F, preset="fast")',
    'disk_map(V, F, preset="paper", center="heat")',
    "surface_map(V, F, spread=-1)",
    "surface_map(V, F, center=3)",
    "surface_map(V, F, align=0)",
    'cut(V, F, path="around")',
    "rectangle_map(V, F, [0, 1, 2, 3])",
    "disk_map(V, F).invert([0, 0, 0])",
    "disk_map(V, F).remesh(2)",
    "angle_distortion(V, F, uv[:-1])",
    'write_map("map.stl", V, F, uv)',
)


def mesh_errors():
    """Yield (input, MeshError) for every nasty mesh and file."""
    sys.path.insert(0, str(ROOT / "tests"))
    from meshes import NASTY

    for name, (_, V, F, _) in NASTY.items():
        yield name, _raised(cdcp_igl.cdcp, V, F)
    V, F = [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]
    yield "`clean` of faces without area", _raised(cdcp_igl.clean, V, F)
    square = [[0, 0], [1, 0], [1, 1], [0, 1]], [[0, 1, 3], [1, 2, 3]]
    yield "`cut` along a path off the edges", _raised(cdcp_igl.cut, *square, [0, 2])
    with TemporaryDirectory() as folder:
        for name, (file, text) in FILES.items():
            path = Path(folder, file)
            path.write_text(text)
            yield name, _raised(read_mesh, path)


def _raised(function, *arguments):
    try:
        function(*arguments)
    except cdcp_igl.MeshError as error:
        return error
    raise AssertionError(f"{function.__name__}{arguments} raised nothing")


def option_errors():
    """Yield (call, error) for every bad option."""
    V, F, uv = cdcp_igl.datasets.spherical_cap(3)
    known = {name: getattr(cdcp_igl, name) for name in cdcp_igl.__all__}
    known |= {"V": V, "F": F, "uv": uv, "flat": V * [1, 1, 0]}
    known |= {"interior": 0, "write_map": write_map}
    for call in CALLS:
        try:
            eval(call, known)
        except ValueError as error:
            yield call, error
        else:
            raise AssertionError(f"{call} raised nothing")


def _mesh_table():
    inputs, defects = {}, {}
    for name, error in mesh_errors():
        inputs.setdefault(error.defect, []).append(name)
        defects.setdefault(error.defect, error.defects[0])
    rows = ["| defect | raised by, for example | it says | remedy |", "|---|---|---|---|"]
    for name, defect in defects.items():
        cells = (f"**{name}**", "; ".join(inputs[name]), _cell(defect.what), _cell(defect.remedy))
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def _option_table():
    rows = ["| call | it says |", "|---|---|"]
    rows += [f"| `{call}` | {_cell(str(error))} |" for call, error in option_errors()]
    return "\n".join(rows) + "\n"


def _cell(text):
    for special in "|[<":
        text = text.replace(special, "\\" + special)
    return text


def _write(app):
    parts = Path(app.srcdir, "generated", "parts")
    parts.mkdir(parents=True, exist_ok=True)
    (parts / "mesh_errors.md").write_text(_mesh_table(), encoding="utf-8")
    (parts / "option_errors.md").write_text(_option_table(), encoding="utf-8")


def setup(app):
    app.connect("builder-inited", _write)
    return {"parallel_read_safe": False}
