"""Folders of small surfaces, for the tests of batches."""

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import commands
import meshes
import numpy as np

import cdcp_igl

WORKERS = Path(__file__).parent / "workers"


def write_surfaces(folder, count, rows=5, columns=6):
    folder.mkdir(parents=True, exist_ok=True)
    for i in range(count):
        V, F = meshes.grid(rows + i % 4, columns, seed=i)
        np.savez(folder / f"surface_{i:03}.npz", V=V, F=F)
    return folder


def write_torn(path):
    """A surface that is no disk."""
    V, F = meshes.grid()
    np.savez(path, V=V, F=F[1:-30])


def batch(files, out, **options):
    """Run a batch in this process."""
    with ThreadPoolExecutor(1) as executor:
        return cdcp_igl.batch(files, out, executor=executor, **options)


def invoke(*arguments):
    """Run ``cdcp-igl batch`` in this process, but for its workers."""
    return commands.invoke("batch", *arguments)


def contents(folder):
    """Bytes of all files that are called like results, whatever is in them."""
    return {path.name: path.read_bytes() for path in Path(folder).glob("[!.]*.npz")}


def lines(folder):
    return [json.loads(line) for line in (Path(folder) / "results.jsonl").read_text().splitlines()]
