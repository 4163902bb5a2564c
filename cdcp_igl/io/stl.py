"""Stereolithography files, stl: triangles that share no vertices."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np

from ..arrays import Floats, Ints, distinct_rows
from ..errors import Damage

FACET = np.dtype([("normal", "<3f4"), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
LOOP = re.compile(rb"outer\s+loop\s" + 3 * rb"\s*vertex\s+(\S+)\s+(\S+)\s+(\S+)\s" + rb"\s*endloop")
FACETS = re.compile(rb"facet\s+normal")
END = re.compile(rb"end *solid")
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
    first, which = distinct_rows(corners)
    rank = np.argsort(np.argsort(first))  # in the order of their first appearance
    return corners[np.sort(first)].astype(np.float64), rank[which].reshape(-1, 3)


def _corners(text: bytes) -> Floats:
    """(3m, 3) corners of the facets of a text file."""
    # Before them and behind them comes a name, of any words.
    *solids, rest = END.split(FACETS.split(text.lower(), maxsplit=1)[-1])
    facets = b"".join(solids) or rest
    loops = LOOP.findall(facets)
    if not len(loops) == facets.count(b"endloop") == facets.count(b"vertex") / 3:
        raise Damage("a facet has not three corners")
    if not solids:
        raise Damage("it is cut off: it has no end")
    try:
        return np.array([float(x) for loop in loops for x in loop]).reshape(-1, 3)
    except ValueError:
        raise Damage("a corner is no number") from None
