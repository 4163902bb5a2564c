"""NumPy npz archives and MATLAB mat files that hold V and F."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["read_mat", "read_npz", "write_npz"]

Array = NDArray[Any]


def read_npz(path: Path) -> tuple[Array, Array]:
    """V and F as they are stored; pickled objects are refused."""
    with path.open("rb") as file:
        archive = np.load(file, allow_pickle=False)
        if not isinstance(archive, Mapping):
            raise ValueError("it holds a single array")
        return _pick(archive)


def read_mat(path: Path) -> tuple[Array, Array]:
    """V and F as they are stored."""
    from scipy.io.matlab import MatReadError, loadmat  # slow to import

    with path.open("rb") as file:
        try:
            return _pick(loadmat(file))
        except MatReadError as error:
            raise ValueError(str(error)) from error


def _pick(archive: Mapping[str, Any]) -> tuple[Array, Array]:
    for V, F in (("V", "F"), ("v", "f")):
        if V in archive and F in archive:
            return archive[V], archive[F]
    names = ", ".join(name for name in archive if not name.startswith("__"))
    raise ValueError(f"it must hold V and F (or v and f), not {names or 'nothing'}")


def write_npz(path: Path, V: ArrayLike, F: ArrayLike, uv: ArrayLike) -> None:
    """Write V, F and uv."""
    with path.open("wb") as file:
        np.savez(file, V=V, F=F, uv=uv)
