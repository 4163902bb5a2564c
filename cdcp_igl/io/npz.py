"""NumPy npz archives."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile, ZipInfo

import numpy as np
from numpy.lib import format as npy
from numpy.typing import ArrayLike, NDArray

from .damage import Damage
from .unpacking import check_unpacking

__all__ = ["stored_arrays", "write_npz"]

ENCRYPTED = 1  # flag of a member


def stored_arrays(path: Path, names: tuple[str, ...]) -> dict[str, NDArray[Any] | None]:
    """Those of the arrays that are there; the others by name only, with None."""
    try:
        archive = ZipFile(path)
    except BadZipFile:
        raise Damage("it is no zip archive of arrays") from None
    with archive:
        members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
        return {
            name: _array(archive, name, info) if name in names else None
            for name, info in members.items()
        }


def _array(archive: ZipFile, name: str, info: ZipInfo) -> NDArray[Any]:
    if info.flag_bits & ENCRYPTED:
        raise Damage(f"{name} is encrypted")
    check_unpacking(name, info.file_size, info.compress_size)
    with archive.open(info) as member:
        # Allocate nothing by a header that the data do not bear out.
        version = npy.read_magic(member)
        if version not in ((1, 0), (2, 0)):
            raise Damage(f"{name} is no array of numbers")
        read_header = npy.read_array_header_1_0 if version[0] == 1 else npy.read_array_header_2_0
        shape, _, dtype = read_header(member)
        if dtype.kind not in "biuf":
            raise Damage(f"{name} is no array of real numbers")
        if math.prod(shape) * dtype.itemsize != info.file_size - member.tell():
            raise Damage(f"{name} has not as many numbers as its shape says")
        member.seek(0)
        return npy.read_array(member, allow_pickle=False)


def write_npz(path: Path, V: ArrayLike, F: ArrayLike, uv: ArrayLike) -> None:
    """Write V, F and uv."""
    with path.open("wb") as file:
        np.savez(file, V=V, F=F, uv=uv)
