"""Where records are kept: the folder of a run that goes on, and the files of results.

The work folder is ``build/benchmarks/CODE/`` (not under version control), CODE a digest of the
sources of cdcp_igl and of the versions below it, so that numbers of different code never meet
in one table, whatever the commit is called::

    records.jsonl                one `Record` a line, in the order of measurement
    maps/MODEL--METHOD.npz       uv (n, 2) float64, of the section "tables"

A run that was killed goes on where it stopped: what has a line is not measured again. To start
over, delete the folder. The finished results, ``MACHINE.json``, hold the records of the last
call of each command together with the machine they are from.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

import cdcp_igl
from cdcp_igl.arrays import Floats
from cdcp_igl.io import whole_file

from .lines import Lines
from .record import Record

__all__ = ["PACKAGES", "ROOT", "WORK", "Work", "code", "read_results", "write_results"]

ROOT = Path(__file__).parents[2]
WORK = ROOT / "build" / "benchmarks"
PACKAGES = ("libigl", "numpy", "scikit-sparse", "scipy")


class Work:
    """The folder with what has been measured so far.

    Parameters
    ----------
    folder : Path, optional
        By default that of the present code.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder or WORK / code()
        self._lines = Lines(self.folder / "records.jsonl")

    def records(self) -> list[Record]:
        """All records, in the order of measurement; a half-written last line does not count."""
        return [Record.of_json(row) for row in self._lines.read()]

    def append(self, record: Record, uv: Floats | None = None) -> None:
        """Keep a record, and the map if there is one; once this returns, they are on disk."""
        if uv is not None:
            path = self.map_path(record.model, record.case.method)
            path.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(path) as unfinished:
                np.savez(unfinished, uv=uv)
        self._lines.append(record.row())

    def map_path(self, model: str, method: str) -> Path:
        """Where the map of the section "tables" is kept, if it was valid."""
        name = f"{model}--{method}".translate(str.maketrans("/: ", "___"))
        return self.folder / "maps" / f"{name}.npz"

    def map(self, model: str, method: str) -> Floats | None:
        """(n, 2) map of the section "tables", None where there is none."""
        path = self.map_path(model, method)
        if not path.exists():
            return None
        with np.load(path) as saved:
            return saved["uv"]


@cache
def code() -> str:
    """Digest of the sources of cdcp_igl and the versions of what is below it."""
    digest = hashlib.sha256()
    package = Path(cdcp_igl.__file__).parent
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    digest.update(repr([version(name) for name in PACKAGES]).encode())
    return digest.hexdigest()[:12]


def write_results(path: Path, machine: Mapping[str, Any], records: Sequence[Record]) -> None:
    """Write ``{"machine": ..., "records": [...]}``, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    about = json.dumps(machine, ensure_ascii=False, indent=1)
    rows = ",\n".join(_line(record) for record in records)
    with whole_file(path) as unfinished:
        text = f'{{"machine": {about},\n"records": [\n{rows}\n]}}\n'
        unfinished.write_text(text, encoding="utf-8")


def _line(record: Record) -> str:
    return json.dumps(record.as_json(), ensure_ascii=False, allow_nan=False)


def read_results(path: Path) -> tuple[dict[str, Any], list[Record]]:
    """Read what `write_results` wrote."""
    content = json.loads(path.read_text(encoding="utf-8"))
    return content["machine"], [Record.of_json(row) for row in content["records"]]
