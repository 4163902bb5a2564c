"""Surfaces and values of neuroimaging, by nibabel: FreeSurfer's files, GIFTI, and flat patches.

References
----------
B. Fischl. FreeSurfer. NeuroImage 62(2), 2012. surfer.nmr.mgh.harvard.edu/fswiki/FileFormats
R. C. Harwell et al. GIFTI surface data format 1.0. 2011. nitrc.org/projects/gifti
"""

from __future__ import annotations

import gzip
import re
import struct
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats, Ints, marked
from ..errors import Damage, spell
from ..extras import from_extra
from ..surface.topology import group_by_edge, heads, tails
from .archives import check_unpacking

Array = NDArray[Any]

TRIANGLES = b"\xff\xff\xfe"
QUADS = {b"\xff\xff\xff": 6, b"\xff\xff\xfd": 12}  # and bytes a vertex
PATCH = b"\xff\xff\xff\xff"  # -1
RECORD = np.dtype([("row", ">i4"), ("position", ">f4", 3)])
SPHERE = 100.0  # FreeSurfer's radius of a sphere, in mm
GZIP = b"\x1f\x8b"
STAMP = "created by cdcp_igl"
# Codes of what an array of a GIFTI file is: positions, triangles, labels.
POINTSET, TRIANGLE, LABEL = 1008, 1009, 1002
FLAT_NAME = re.compile(r"\.patch(\.3d|\.flat)?$")
HEMISPHERE = re.compile(r"^[lr]h\.")


class Values(NamedTuple):
    """Values at vertices that a file holds, and of labels their names.

    Attributes
    ----------
    values : (n,) or (n, k) ndarray
        Real numbers, or labels as integers; of a file of vertices (n,) bool.
    names : dict of int to str
        What the labels are called; empty if they are none.
    """

    values: Array
    names: dict[int, str]


def neuro_type(path: Path) -> str:
    """Type of a file of neuroimaging by its name, as it is written; empty if it is none."""
    name = path.name.lower()
    if name.endswith((".gii", ".gii.gz")):
        return "gifti"
    if FLAT_NAME.search(name):
        return "patch"
    return "freesurfer" if HEMISPHERE.match(name) else ""


def reads_as_neuro(path: Path) -> bool:
    """Whether a file is such a surface: GIFTI by its name, of FreeSurfer by its first bytes."""
    if neuro_type(path) == "gifti":
        return True
    with path.open("rb") as file:
        head = file.read(9)
    if head[:4] == PATCH or head[:3] not in QUADS:
        return head[:4] == PATCH or head[:3] == TRIANGLES
    return path.stat().st_size == _size_of_quads(head)  # values at vertices begin alike


def read_neuro(path: Path) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and faces (m, 3) of a surface of FreeSurfer or in GIFTI."""
    if neuro_type(path) == "gifti":
        return gifti_surface(_load(path))
    return _read_freesurfer(path)


def gifti_surface(image: Any) -> tuple[Floats, Ints]:
    """Vertices (n, 3) and faces (m, 3) of a GIFTI image; Damage if it has not one of each."""
    arrays = {}
    if image.darrays and not {a.intent for a in image.darrays} & {POINTSET, TRIANGLE}:
        raise Damage("it holds values, and no surface: give the one that they belong to")
    for intent, what in ((POINTSET, "positions"), (TRIANGLE, "triangles")):
        found = [array.data for array in image.darrays if array.intent == intent]
        if len(found) != 1:
            raise Damage(f"it has {len(found)} arrays of {what}, not one")
        if np.ndim(found[0]) != 2 or found[0].shape[1] != 3:
            raise Damage(f"its {what} have shape {np.shape(found[0])}, not three columns")
        arrays[intent] = found[0]
    return arrays[POINTSET].astype(np.float64), arrays[TRIANGLE].astype(np.int64)


def patch_of(path: Path) -> tuple[Ints, Floats, Bools]:
    """Rows (k,), positions (k, 3) and border (k,) of a patch of FreeSurfer."""
    data = path.read_bytes()
    if data[:4] != PATCH or len(data) < 8:
        raise Damage("it is no patch")
    count = struct.unpack_from(">i", data, 4)[0]
    if len(data) != 8 + count * RECORD.itemsize:
        raise Damage(f"it says that it has {count:,} vertices, and is of another size")
    records = np.frombuffer(data, RECORD, count, 8)
    signed = records["row"].astype(np.int64)
    rows = abs(signed) - 1
    if (rows < 0).any() or len(np.unique(rows)) < count:
        raise Damage("it has a vertex 0, or one twice")
    return rows, records["position"].astype(np.float64), signed < 0


def values_of(path: Path, n: int | None) -> Values:
    """Values at the n vertices of a surface, by the name of the file."""
    name = path.name.lower()
    if neuro_type(path) == "gifti":
        return _gifti_values(_load(path))
    with nibabel_read() as nibabel:
        if name.endswith(".annot"):
            labels, _, names = nibabel.freesurfer.read_annot(path)
            return Values(labels.astype(np.int64), dict(enumerate(text.decode() for text in names)))
        if name.endswith((".mgh", ".mgz")):
            data = np.asarray(nibabel.load(path).dataobj, dtype=np.float64)
            return Values(_alone(data.reshape(-1, data.shape[3] if data.ndim > 3 else 1)), {})
        if name.endswith(".label"):
            return Values(_marked(nibabel.freesurfer.read_label(path), n), {})
        _check_size(path.read_bytes())
        return Values(nibabel.freesurfer.read_morph_data(path).astype(np.float64), {})


def _gifti_values(image: Any) -> Values:
    of_vertices = [a for a in image.darrays if a.intent not in (POINTSET, TRIANGLE)]
    if not of_vertices:
        raise Damage("it has no values at vertices")
    lengths = {len(a.data) for a in of_vertices}
    if len(lengths) > 1:
        raise Damage(f"its arrays have {spell(np.array(sorted(lengths)))} rows")
    columns = _alone(np.column_stack([a.data for a in of_vertices]))
    if of_vertices[0].intent != LABEL:
        return Values(columns.astype(np.float64), {})
    names = image.labeltable.get_labels_as_dict()
    return Values(columns.astype(np.int64), {int(k): str(v) for k, v in names.items()})


def _marked(rows: Ints, n: int | None) -> Bools:
    if n is None:
        raise ValueError("a file of vertices does not say of how many: n is needed")
    if len(rows) and not 0 <= rows.min() <= rows.max() < n:
        raise Damage(f"it names vertex {rows.max():,}, and the surface has {n:,}")
    return marked(n, rows)


def _check_size(data: bytes) -> None:
    """Damage if a file of values, such as lh.sulc, has not as many as it says."""
    if data[:3] == b"\xff\xff\xff" and len(data) >= 15:
        size = 15 + 4 * struct.unpack_from(">i", data, 3)[0]
    else:  # before 2002: numbers of vertices and faces in three bytes, then hundredths
        size = 6 + 2 * int.from_bytes(data[:3], "big")
    if size != len(data):
        raise Damage("it is cut off, or of another type")


def _alone(columns: Array) -> Array:
    return columns[:, 0] if columns.shape[1] == 1 else columns


def write_neuro(
    path: Path, unfinished: Path, P: Floats, F: Ints, vertices: Ints, like: Path | None
) -> None:
    """Write a surface whose vertices lie where a map takes them, P (n, 3), by the name of `path`.

    `vertices` (k,) are those that have a place; the others have no face, and are in no patch. What
    `like` has besides the surface is kept, if it is of the same type.
    """
    kind = neuro_type(path)
    same = like is not None and reads_as_neuro(like) and neuro_type(like) == "gifti"
    if kind == "patch":
        border = _border(F, len(P))[vertices]
        records = np.empty(len(vertices), RECORD)
        records["row"] = np.where(border, -1, 1) * (vertices + 1)
        records["position"] = P[vertices]
        unfinished.write_bytes(PATCH + struct.pack(">i", len(vertices)) + records.tobytes())
    elif kind == "gifti":
        data = _gifti(P, F, like if same else None).to_bytes()
        compressed = path.name.lower().endswith(".gz")
        unfinished.write_bytes(gzip.compress(data, mtime=0) if compressed else data)
    else:
        volume = None
        if like is not None and not same and reads_as_neuro(like):
            with nibabel_read() as nibabel:
                volume = nibabel.freesurfer.read_geometry(like, read_metadata=True)[2]
        _nibabel().freesurfer.write_geometry(unfinished, P, F, STAMP, volume)


def _gifti(P: Floats, F: Ints, like: Path | None) -> Any:
    """Make a GIFTI image of a map, with all else that the file `like` has."""
    gifti = _nibabel().gifti
    image = _load(like) if like else gifti.GiftiImage()
    geometry = "Flat" if not P[:, 2].any() else "Spherical"
    for intent, data in ((POINTSET, P.astype(np.float32)), (TRIANGLE, F.astype(np.int32))):
        at = [array.intent for array in image.darrays].index(intent) if like else -1
        meta = dict(image.darrays[at].meta) if like else {}
        if intent == POINTSET:
            meta["GeometricType"] = geometry
        array = gifti.GiftiDataArray(data, intent=intent, meta=gifti.GiftiMetaData(meta))
        if like:
            image.darrays[at] = array
        else:
            image.add_gifti_data_array(array)
    return image


def _size_of_quads(head: bytes) -> int:
    """Bytes of a surface of quads, by its head (9,)."""
    n, m = (int.from_bytes(head[k : k + 3], "big") for k in (3, 6))
    return 9 + QUADS[head[:3]] * n + 12 * m


def _border(F: Ints, n: int) -> Bools:
    """(n,) vertices at an edge with one face."""
    tail = tails(F, n)
    single = group_by_edge(tail, n).border
    return marked(n, np.append(tail[single], heads(tail)[single]))


def _read_freesurfer(path: Path) -> tuple[Floats, Ints]:
    """Vertices and faces; quads are split as FreeSurfer does."""
    data = path.read_bytes()
    if data[:4] == PATCH:
        raise Damage("it is a patch, which has no faces: map its surface, of which it is a part")
    if data[:3] == TRIANGLES:
        start = data.find(b"\n\n", 3) + 2
        if start < 5 or len(data) < start + 8:
            raise Damage("it is cut off")
        n, m = struct.unpack_from(">ii", data, start)
        if min(n, m) < 0 or len(data) < start + 8 + 12 * n + 12 * m:
            raise Damage(f"it says that it has {n:,} vertices and {m:,} faces, and has fewer")
    with nibabel_read() as nibabel:
        V, F = nibabel.freesurfer.read_geometry(path)
    return V, F.astype(np.int64)


def _load(path: Path) -> Any:
    """Load a GIFTI image."""
    if path.name.lower().endswith(".gz"):
        data = path.read_bytes()
        if data[:2] != GZIP:
            raise Damage("it is not packed by gzip")
        check_unpacking("it", int.from_bytes(data[-4:], "little"), len(data))
    with nibabel_read() as nibabel:
        image = nibabel.load(path)
    if not hasattr(image, "darrays"):
        raise Damage("it is no GIFTI file")
    return image


def _nibabel() -> Any:
    with from_extra("neuro"):
        import nibabel
    return nibabel


@contextmanager
def nibabel_read() -> Iterator[Any]:
    """Let the body read with nibabel, which raises whatever its parsers raise on damage."""
    nibabel = _nibabel()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # such as of a file that says nothing of a volume
            yield nibabel
    except (Damage, FileNotFoundError, PermissionError, MemoryError):
        raise
    except Exception as error:
        raise Damage(f"{error or type(error).__name__}") from None
