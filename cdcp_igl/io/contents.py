"""What a file has besides a surface: colours, which go elsewhere, too, and what stays behind."""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..arrays import Floats
from ..errors import Damage
from . import glb, ply
from .archives import others_of_mat, others_of_npz
from .reading import DAMAGE
from .text import words_of_lines
from .vtk import others_of_vtk

# Lines of an obj file that say more than where a surface is.
LINES = {
    "materials": rb"^[ \t]*usemtl\s",
    "groups": rb"^[ \t]*g\s",
    "names": rb"^[ \t]*o\s",
    "normals": rb"^[ \t]*vn\s",
    "lines": rb"^[ \t]*l\s",
    "polygons": rb"^[ \t]*f([ \t]+[-/\d]+){4}",
}
SCENE = ("materials", "skins", "animations", "cameras")


class Contents(NamedTuple):
    """Colours (n, 3) or (n, 4) of the vertices of `read_mesh`, sRGB from 0 to 1; and what else."""

    colours: Floats | None
    others: tuple[str, ...]


def contents_of(path: Path) -> Contents:
    """Look at what a file has that `read_mesh` has read, but for texture coordinates."""
    look = LOOKS.get(path.suffix.lower())
    return look(path) if look else Contents(None, ())


def _of_obj(path: Path) -> Contents:
    data = path.read_bytes()
    others = tuple(name for name, line in LINES.items() if re.search(line, data, re.MULTILINE))
    first = re.search(rb"^[ \t]*v[ \t].*", data, re.MULTILINE)
    if not first or len(first[0].partition(b"#")[0].split()) < 7:
        return Contents(None, others)
    colours = array("d")
    for number, words in words_of_lines(path, continued=True):
        if words[0] == "v":
            try:
                red, green, blue = words[4:7]
                colours.extend((float(red), float(green), float(blue)))
            except ValueError:
                raise Damage(f"line {number}: no colour") from None
    whole = np.array(colours).reshape(-1, 3)
    return Contents(np.clip(whole / (255 if whole.max() > 1 else 1), 0, 1), others)


def _of_ply(path: Path) -> Contents:
    data = path.read_bytes()
    _, elements, body = ply.parse_header(data)
    tables, colours = ply.read_tables(data), None
    others = ["comments"] * (b"\ncomment" in data[: len(data) - len(body)])
    known = {
        "vertex": {*"xyz", *ply.COLOURS},
        "face": {*ply.INDICES, "texcoord"},
        "tristrips": None,
    }
    for element in elements:
        if element.name not in known:
            others.append(element.name)
            continue
        ours = known[element.name] or {*ply.INDICES}
        names = [column.name for column in element.properties]
        for pair in ply.TEXTURE:
            ours |= {*pair} if {*pair} <= {*names} else set()
        others += [name for name in names if name not in ours]
        if element.name == "vertex" and {*ply.COLOURS[:3]} <= {*names}:
            there = [name for name in ply.COLOURS if name in names]
            kinds = {column.name: ply.TYPES[column.type] for column in element.properties}
            colours = np.column_stack(
                [tables["vertex"][name].entries / _largest(kinds[name]) for name in there]
            )
    return Contents(colours, tuple(others))


def _largest(kind: str) -> float:
    return 1.0 if kind[0] == "f" else float(np.iinfo(kind).max)


def _of_gltf(path: Path) -> Contents:
    scene, body = glb.scene_and_body(path)
    others = [name for name in SCENE if scene.get(name)]
    found, any_colour = dict[tuple[int, int], Floats](), False
    for part in glb.parts_of(scene, body, path):
        primitive = glb.primitive_of(scene, part)
        attributes = primitive["attributes"]
        others += [name for name in attributes if name not in ("POSITION", "TEXCOORD_0", "COLOR_0")]
        others += ["morph targets"] * bool(primitive.get("targets"))
        colours = np.ones((len(part.positions), 4))
        if "COLOR_0" in attributes:
            given = glb.numbers(scene, attributes["COLOR_0"], body, path)
            colours[:, : given.shape[1]] = given
            any_colour = True
        found.setdefault((part.node, part.accessor), colours)
    others += ["nodes"] * (len({node for node, _ in found}) > 1)
    if not any_colour:
        return Contents(None, tuple(dict.fromkeys(others)))
    colours = np.concatenate([*found.values()])
    colours[:, :3] = glb.srgb(colours[:, :3])
    opaque = colours[:, 3].min() == 1
    return Contents(colours[:, :3] if opaque else colours, tuple(dict.fromkeys(others)))


def _of_arrays(others: Callable[[Path], Iterable[str]], path: Path) -> Contents:
    """Name what a file has, as far as it can be read: more than a surface need not."""
    found = list[str]()
    try:
        found.extend(others(path))  # what comes before an error is found, too
    except (Damage, *DAMAGE):
        found.append("unreadable values")
    return Contents(None, tuple(dict.fromkeys(found)))


LOOKS: dict[str, Callable[[Path], Contents]] = {
    ".glb": _of_gltf,
    ".gltf": _of_gltf,
    ".mat": partial(_of_arrays, others_of_mat),
    ".npz": partial(_of_arrays, others_of_npz),
    ".obj": _of_obj,
    ".ply": _of_ply,
    ".vtk": partial(_of_arrays, others_of_vtk),
    ".vtp": partial(_of_arrays, others_of_vtk),
    ".vtu": partial(_of_arrays, others_of_vtk),
}
