"""Stereolithography files, stl: triangles that share no vertices."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np

from ..arrays import Floats, Ints
from .damage import Damage

FACET = np.dtype([("normal", "<3f4"), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
LOOP = re.compile(rb"outer\s+loop\s" + 3 * rb"\s*vertex\s+(\S+)\s+(\S+)\s+(\S+)\s" + rb"\s*endloop")
FACETS = re.compile(rb"facet\s+normal")
HEADER = 84  # bytes, of which the last four are the number of facets


def read_stl(path: Path) -> tuple[Floats, Ints]:
    """(n, 3) vertices and (m, 3) faces, vertices in equal places merged."""
    data = path.read_bytes()
    # The header of a binary file may begin with "solid" as well; its size tells.
    facets = struct.unpack_from("<I", data, 80)[0] if len(data) >= HEADER else None
    if facets is not None and len(data) == HEADER + facets * FACET.itemsize:
        corners = np.frombuffer(data, FACET, facets, HEADER)["corners"].reshape(-1, 3)
    elif data.lstrip()[:5].lower() == b"solid":
        corners = _corners(data)
    else:
        raise Damage("it is cut off, or no stl file")
    return merge_duplicates(
        corners.astype(np.float64), np.arange(len(corners), dtype=np.int64).reshape(-1, 3)
    )


def _corners(text: bytes) -> Floats:
    """(3m, 3) corners of the facets of a text file."""
    # Before them and behind them comes a name, of any words.
    facets = FACETS.split(text.lower(), maxsplit=1)[-1]
    body, end, _ = facets.rpartition(b"endsolid")
    facets = body if end else facets
    loops = LOOP.findall(facets)
    if not len(loops) == facets.count(b"endloop") == facets.count(b"vertex") / 3:
        raise Damage("a facet has not three corners")
    if not end:
        raise Damage("it is cut off: it has no end")
    try:
        return np.array([float(x) for loop in loops for x in loop]).reshape(-1, 3)
    except ValueError:
        raise Damage("a corner is no number") from None


def merge_duplicates(V: Floats, F: Ints) -> tuple[Floats, Ints]:
    """Merge vertices with exactly equal coordinates, in order of first appearance."""
    order = np.lexsort(V.T)
    leads = np.ones(len(V), dtype=bool)
    leads[1:] = (V[order[1:]] != V[order[:-1]]).any(axis=1)
    # The sort is stable: the first of a group is its first appearance.
    first = np.empty(len(V), dtype=np.int64)
    first[order] = order[leads][np.cumsum(leads) - 1]
    kept = first == np.arange(len(V))
    return V[kept], (np.cumsum(kept) - 1)[first[F]]
