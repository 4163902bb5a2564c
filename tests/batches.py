"""Folders of small surfaces, for the tests of batches."""

import json
import subprocess
import sys
from pathlib import Path

import meshes
import numpy as np

import cdcp_igl

ROOT = Path(cdcp_igl.__file__).parents[1]
WORKERS = Path(__file__).parent / "workers"


def write_surfaces(folder, count, rows=5, columns=6):
    folder.mkdir(parents=True, exist_ok=True)
    for i in range(count):
        V, F = meshes.grid(rows + i % 4, columns, seed=i)
        np.savez(folder / f"surface_{i:03}.npz", V=V, F=F)
    return folder


def contents(folder):
    """Bytes of all files that are called like results, whatever is in them."""
    return {path.name: path.read_bytes() for path in Path(folder).glob("[!.]*.npz")}


def lines(folder):
    return [json.loads(line) for line in (Path(folder) / "results.jsonl").read_text().splitlines()]


def command(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "cdcp_igl", "batch", *map(str, arguments)],
        capture_output=True,
        text=True,
        errors="surrogateescape",
        cwd=ROOT,
        **options,
    )
