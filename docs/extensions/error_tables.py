"""Tables of errors: the defects of the package, and what bad options raise.

The calls below are made, so a table cannot say what the package does not.
"""

import re
from pathlib import Path

import cdcp_igl
from cdcp_igl.defects import DEFECTS
from cdcp_igl.io import write_map

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
    "surface_map(V, F, scale_variation=-1)",
    "surface_map(V, F, center=3)",
    "surface_map(V, F, align=0)",
    'cut(V, F, path="around")',
    "rectangle_map(V, F, [0, 1, 2, 3])",
    "disk_map(V, F).invert([0, 0, 0])",
    "disk_map(V, F).remesh(2)",
    "angle_distortion(V, F, uv[:-1])",
    'write_map("map.stl", V, F, uv)',
)


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
    rows = ["| defect | it says | remedy | in the shell |", "|---|---|---|---|"]
    for key, row in DEFECTS.items():
        found = f"{{count}} {row.subject[1]} {row.message}" if row.subject else row.message
        said = re.sub(r"\{(\w+)[^}]*\}", r"*\1*", _cell(found))
        name, _, variant = key.partition(", ")
        cells = (
            f"**{name}**{variant and ', ' + variant}",
            said,
            _cell(row.remedy),
            _cell(row.remedy_in_shell) if row.remedy_in_shell != row.remedy else "the same",
        )
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
