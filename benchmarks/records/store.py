"""Where records are kept: the folder of a run that goes on, and the files of results.

The work folder is ``build/benchmarks/CODE/`` (not under version control), CODE a digest of the
sources of cdcp_igl and of the versions below it, so that numbers of different code never meet
in one table, whatever the commit is called::

    results.jsonl                one `Record` a line, in the order of measurement
    results.1-of-4.jsonl         the same of a part of the surfaces, perhaps of another machine
    surfaces/MESH.npz            V and F of every surface, by their digest
    maps/RECORD.npz              uv (n, 2) float64, of the section "tables", by `Record.digest`

The lines are the journals of a batch, `cdcp_igl.scale.batching`. A run that was killed goes on
where it stopped: what has a line is not measured again. To start over, delete the folder. The
finished results, ``MACHINE.json``, hold the records of the last call of each command together with
the machine they are from; ``MACHINE.csv`` has them as a table, without what is no number or word.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import cdcp_igl
from cdcp_igl.arrays import Floats, Ints
from cdcp_igl.io.output import whole_file, write_text
from cdcp_igl.scale.batching.journal import Journal, journal_lines
from cdcp_igl.scale.batching.names import Shard

from .record import Record

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

    def records(self) -> list[Record]:
        """All records, in the order of measurement; what is no record, as half a line, is not."""
        records = []
        for line in journal_lines(self.folder):
            with suppress(json.JSONDecodeError, TypeError):
                records.append(Record.of_json(json.loads(line)))
        return records

    def journal(self, shard: Shard | None = None) -> Journal:
        """Open the file of records to add some; OSError if another run has it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        return Journal(self.folder, shard)

    def surface_path(self, mesh: str) -> Path:
        """Where the surface of a digest is kept."""
        return self.folder / "surfaces" / f"{mesh}.npz"

    def keep_surface(self, mesh: str, V: Floats, F: Ints) -> None:
        """Write a surface down, for the processes that map it and for the figures."""
        _save(self.surface_path(mesh), V=V, F=F)

    def surface(self, mesh: str) -> tuple[Floats, Ints] | None:
        """V (n, 3) and F (m, 3) of a digest, None if it is not there."""
        saved = _saved(self.surface_path(mesh))
        return (saved["V"], saved["F"]) if saved else None

    def keep_map(self, record: Record, uv: Floats) -> None:
        """Write the map of a record down."""
        _save(self.map_path(record), uv=uv)

    def map_path(self, record: Record) -> Path:
        """Where the map of a record of the section "tables" is kept, if it was valid."""
        return self.folder / "maps" / f"{record.digest}.npz"

    def map(self, record: Record) -> Floats | None:
        """(n, 2) map of a record of the section "tables", None where there is none."""
        saved = _saved(self.map_path(record))
        return saved["uv"] if saved else None


def _save(path: Path, **arrays: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as unfinished:
        np.savez(unfinished, **arrays)  # type: ignore[arg-type]


def _saved(path: Path) -> dict[str, np.ndarray] | None:
    if not path.exists():
        return None
    with np.load(path) as file:
        return dict(file)


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
    about = json.dumps(machine, ensure_ascii=False, indent=1)
    rows = ",\n".join(record.line().rstrip() for record in records)
    write_text(path, f'{{"machine": {about},\n"records": [\n{rows}\n]}}\n')


def write_rows(path: Path, records: Sequence[Record]) -> None:
    """Write a table with a row for each record, for other programs."""
    rows = pd.DataFrame([record.row() for record in records])
    write_text(path, rows.drop(columns=["details", "histogram"]).to_csv(index=False))


def read_results(path: Path) -> tuple[dict[str, Any], list[Record]]:
    """Read what `write_results` wrote; ValueError if it is something else."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        return dict(content["machine"]), [Record.of_json(row) for row in content["records"]]
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no file of results: move it, or take another name") from error
