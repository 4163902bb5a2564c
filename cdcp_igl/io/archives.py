"""V, F and uv among other arrays: NumPy's npz files, and MATLAB's mat files up to version 7.

SciPy's reader of mat files from version 5 on ends the process on some damaged ones, as it trusts
the types they state. A mesh needs little of the format: a list of elements, each with its type
and size, packed or not.

References
----------
The MathWorks. MAT-File Format. 2023. mathworks.com/help/pdf_doc/matlab/matfile_format.pdf
"""

from __future__ import annotations

import math
import struct
import warnings
import zlib
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.lib import format as npy
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, size_exponent
from ..errors import Damage, Defect, MeshError

Array = NDArray[Any]
# Arrays by name; None are those that are not asked for, and are not unpacked.
Found = dict[str, Array | None]

NAMES = (("V", "F"), ("v", "f"))
MESH, MAP = frozenset(sum(NAMES, ())), frozenset({"uv", "face_chart"})

# Arrays of a mesh pack to a fifth or a tenth of their size, those of a plane grid to a
# thirteenth; zeros pack to a thousandth, and a file of them that fits into an email would
# fill the memory. Up to a size that is read in a tenth of a second nothing is refused.
MOST_PACKED = 100
NEVER_REFUSED = 1 << 26  # bytes


def _vertices_and_faces(found: Found) -> tuple[Array, Array]:
    for names in NAMES:
        V, F = map(found.get, names)
        if V is None or F is None:
            continue
        for name, array in zip(names, (V, F), strict=True):
            if np.asarray(array).dtype.kind not in "biuf":
                raise Damage(f"{name} is no array of real numbers")
            if array.ndim != 2:
                raise Damage(f"{name} is no table, but has shape {array.shape}")
        if V.shape[0] in (2, 3) and V.shape[1] > 3:
            raise MeshError(Defect.of("shape of V, transposed", shape=V.shape))
        return V, F
    raise Damage(f"it must hold V and F (or v and f), not {', '.join(found) or 'nothing'}")


def _texture(found: Found) -> Floats | None:
    uv, chart = found.get("uv"), found.get("face_chart")
    if uv is None:
        return None
    if uv.dtype.kind not in "iuf" or uv.shape[1:] not in ((2,), (3, 2)):
        raise Damage(f"uv must be (n, 2) or (m, 3, 2), not {uv.shape} of type {uv.dtype}")
    uv = uv.astype(np.float64)
    if chart is None or chart.shape != (len(uv),) or chart.dtype.kind not in "iu" or uv.ndim < 3:
        return uv
    # Charts of a cut surface, each around 0.
    cell = np.ldexp(1.0, size_exponent(np.nan_to_num(uv)) + 1)
    row, column = np.divmod(chart, math.isqrt(int(chart.max(initial=0))) + 1)
    return uv + cell * np.stack([column, row], axis=1)[:, None]


def check_unpacking(name: str, size: int, packed: int) -> None:
    """Refuse what would unpack to much more than a mesh does; sizes in bytes."""
    if size > max(NEVER_REFUSED, MOST_PACKED * packed):
        raise Damage(
            f"{name} would unpack from {packed:,} to {size:,} bytes: more than "
            f"{MOST_PACKED} times its size, which is no mesh"
        )


# -- npz ---------------------------------------------------------------------------------

ENCRYPTED = 1  # flag of a member


def read_npz(path: Path) -> tuple[Array, Array]:
    """V and F of a NumPy archive."""
    return _vertices_and_faces(_arrays_of_npz(path, MESH))


def texture_of_npz(path: Path) -> Floats | None:
    """(n, 2) or (m, 3, 2) the uv of a NumPy archive, if it has them."""
    return _texture(_arrays_of_npz(path, MAP))


def others_of_npz(path: Path) -> list[str]:
    """List the arrays of a NumPy archive that are no mesh and no map."""
    return [name for name in _arrays_of_npz(path, ()) if name not in MESH | MAP]


def _arrays_of_npz(path: Path, wanted: Collection[str]) -> Found:
    try:
        archive = ZipFile(path)
    except BadZipFile:
        raise Damage("it is no zip archive of arrays") from None
    found: Found = {}
    with archive:
        for info in archive.infolist():
            name = info.filename.removesuffix(".npy")
            found[name] = None
            if name in wanted:
                if info.flag_bits & ENCRYPTED:
                    raise Damage(f"{name} is encrypted")
                check_unpacking(name, info.file_size, info.compress_size)
                data = BytesIO(archive.read(info))
                try:
                    found[name] = npy.read_array(data, allow_pickle=False)
                except ValueError:
                    raise Damage(f"{name} is no array of real numbers, or cut off") from None
                if data.read(1):
                    raise Damage(f"{name} has more numbers than its shape says")
    return found


def write_npz(path: Path, V: ArrayLike, F: ArrayLike, uv: ArrayLike) -> None:
    """Write V, F and uv."""
    with path.open("wb") as file:
        np.savez(file, V=V, F=F, uv=uv)


# -- mat ---------------------------------------------------------------------------------

NUMBERS = {
    **{1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4"},
    **{9: "f8", 12: "i8", 13: "u8"},
}
MATRIX, PACKED = 14, 15
# Of a matrix. It may be stored in fewer bytes: MATLAB packs doubles that are small integers.
CLASSES = {
    **{6: "f8", 7: "f4", 8: "i1", 9: "u1", 10: "i2", 11: "u2", 12: "i4", 13: "u4"},
    **{14: "i8", 15: "u8"},
}
COMPLEX = 0x800
HEADING = 1 << 10  # bytes; class, shape and name of a matrix take a tenth of it


class Element(NamedTuple):
    """A piece of a file, or of a matrix."""

    kind: int
    data: memoryview


def read_mat(path: Path) -> tuple[Array, Array]:
    """V and F of a MATLAB file."""
    return _vertices_and_faces(_variables_of_mat(path, MESH))


def texture_of_mat(path: Path) -> Floats | None:
    """(n, 2) or (m, 3, 2) the uv of a MATLAB file, if it has them."""
    return _texture(_variables_of_mat(path, MAP))


def others_of_mat(path: Path) -> list[str]:
    """List the variables of a MATLAB file that are no mesh and no map."""
    names = _variables_of_mat(path, ())
    return [name for name in names if name and name not in MESH | MAP]  # "" is MATLAB's own


def _variables_of_mat(path: Path, wanted: Collection[str]) -> Found:
    data = memoryview(path.read_bytes())
    if len(data) >= 4 and 0 in data[:4]:  # text, without zeros, begins the later versions
        return _variables_of_version_4(path, wanted)
    order = {b"IM": "<", b"MI": ">"}.get(bytes(data[126:128]))
    if order is None:
        raise Damage("it has no MATLAB header")
    if struct.unpack_from(order + "H", data, 124) != (0x100,):
        raise Damage("it is of MATLAB version 7.3, or unknown: save it with the option -v7")
    return dict(_variable(element, order, wanted) for element in _elements(data[128:], order))


def _variables_of_version_4(path: Path, wanted: Collection[str]) -> Found:
    from scipy.io import loadmat, whosmat  # slow to import

    # SciPy reads this version in Python, which checks what a file says of its arrays.
    with warnings.catch_warnings(action="ignore"):  # which are about byte orders of old machines
        arrays = loadmat(path, variable_names=wanted)
        return {name: arrays.get(name) for name, _, _ in whosmat(path)}


def _elements(data: memoryview, order: str) -> Iterator[Element]:
    """Yield the elements one after the other."""
    at = 0
    while at < len(data):
        if at + 8 > len(data):
            raise Damage("it is cut off")
        kind, size = struct.unpack_from(order + "2I", data, at)
        start = at + 8
        if kind >> 16:  # up to four bytes, in the place of their number
            kind, size, start = kind & 0xFFFF, kind >> 16, at + 4
            at += 8
        else:  # what is not packed begins at a multiple of 8
            at = start + (size if kind == PACKED else -(-size // 8) * 8)
        if start + size > len(data) or start + size > at:
            raise Damage("it is cut off, or damaged")
        yield Element(kind, data[start : start + size])


def _variable(element: Element, order: str, wanted: Collection[str]) -> tuple[str, Array | None]:
    """Name, and numbers if they are asked for, of an element of the file."""
    kind, data = element
    size = len(data)
    packed = kind == PACKED
    if packed:
        head = zlib.decompressobj().decompress(data, HEADING)
        if len(head) < 8:
            raise Damage("it is cut off, or damaged")
        kind, size = struct.unpack_from(order + "2I", head)
    if kind != MATRIX:
        return "", None
    name = _heading(memoryview(head)[8:] if packed else data, order)[0]
    if name not in wanted:
        return name, None
    if packed:
        check_unpacking(name, size, len(data))
        whole = zlib.decompressobj()
        data = memoryview(whole.decompress(data, size + 8))[8:]
        if len(data) != size or whole.decompress(whole.unconsumed_tail, 1) or not whole.eof:
            raise Damage("it is damaged: its checksum is wrong")
    return name, _numbers(data, order)


def _heading(data: memoryview, order: str) -> tuple[str, int, tuple[int, ...], Iterator[Element]]:
    """Name, flags and shape of a matrix, and the elements that follow."""
    elements = _elements(data, order)
    flags, shape, name = (next(elements, Element(0, memoryview(b""))).data for _ in range(3))
    if len(flags) != 8 or len(shape) < 8 or len(shape) % 4:
        raise Damage("it is damaged: a matrix has no class, or no shape")
    (number,) = struct.unpack_from(order + "I", flags)
    sizes = struct.unpack(f"{order}{len(shape) // 4}i", shape)
    return bytes(name).rstrip(b"\0").decode("latin-1"), number, sizes, elements


def _numbers(data: memoryview, order: str) -> Array:
    name, flags, shape, rest = _heading(data, order)
    if flags & 0xFF not in CLASSES or flags & COMPLEX:
        raise Damage(f"{name} is no array of real numbers")
    kind, stored = next(rest, Element(0, memoryview(b"")))
    if kind not in NUMBERS:
        raise Damage(f"it is damaged: {name} is of no known type")
    numbers = np.frombuffer(stored, order + NUMBERS[kind])
    if min(shape) < 0 or math.prod(shape) != len(numbers):
        raise Damage(f"it is damaged: {name} has not as many numbers as its shape says")
    return numbers.reshape(shape, order="F").astype(CLASSES[flags & 0xFF])
