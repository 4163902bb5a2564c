"""The command `python -m benchmarks punctures`."""

import numpy as np
import pytest
import surfaces
from typer.testing import CliRunner

from benchmarks.__main__ import app
from benchmarks.measure import punctures
from benchmarks.measure.punctures import Comparison, Row, opened
from cdcp_igl.surface.mesh import DiskMesh


@pytest.mark.parametrize(("kind", "boundary"), [("face", 3), ("vertex", 6), ("2-ring", 12)])
def test_what_is_taken_out(kind, boundary):
    V, F = surfaces.sphere()  # all its vertices but those at the poles have six neighbours
    W, G = opened(V, F, kind, 80)
    assert len(DiskMesh(W, G).loop) == boundary
    assert len(W) == len(V) - {"face": 0, "vertex": 1, "2-ring": 7}[kind]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A closed surface, one with a handle, and results in a folder of their own."""
    monkeypatch.setattr(punctures, "WORK", tmp_path / "work")
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    for name, (V, F) in {"sphere": surfaces.sphere(), "torus": surfaces.torus()}.items():
        np.savez(meshes / f"{name}.npz", V=V, F=F)
    return meshes


def test_a_killed_run_goes_on_where_it_stopped(folder, monkeypatch):
    command = ["punctures", str(folder), "--places", "1"]
    whole = CliRunner().invoke(app, command)
    assert whole.exit_code == 0, whole.output
    assert "torus" not in whole.stdout
    [path] = folder.parent.glob("work/*/punctures-1.jsonl")
    lines = path.read_bytes().splitlines(keepends=True)
    assert len(lines) == len(punctures.RINGS) * len(punctures.METHODS)
    path.write_bytes(b"".join(lines[:-2]) + lines[-2][:9])
    known = path.read_bytes()
    assert CliRunner().invoke(app, [*command, "--jobs", "2"]).stdout == whole.stdout
    assert path.read_bytes().startswith(known[: known.rfind(b"\n")])
    assert len(path.read_bytes().splitlines()) == len(lines)


def test_a_surface_that_has_changed_is_mapped_again(folder):
    command = ["punctures", str(folder), "--places", "1"]
    assert CliRunner().invoke(app, command).exit_code == 0
    V, F = surfaces.sphere(stretch=2)
    np.savez(folder / "sphere.npz", V=V, F=F)
    punctures._surface.cache_clear()
    assert CliRunner().invoke(app, command).exit_code == 0
    [path] = folder.parent.glob("work/*/punctures-1.jsonl")
    rows = len(punctures.RINGS) * len(punctures.METHODS)
    assert len(path.read_bytes().splitlines()) == 2 * rows


def test_a_crash_is_a_row_and_an_exit_code(folder, monkeypatch):
    monkeypatch.setattr(punctures, "SECONDS", 0.0)
    shown = CliRunner().invoke(app, ["punctures", str(folder), "--places", "1"])
    assert shown.exit_code == 1
    assert "sphere less a face" in shown.stdout
    assert "refine=0 hang" in shown.stdout


def row(method, outcome, mean=np.nan):
    return Row("blob", "digest", "face", 0, 7, method, outcome, mean)


@pytest.mark.parametrize(
    ("ours", "others", "fault", "worse", "high"),
    [
        (("map", 2.0), [("map", 1.9), ("MapError",)], False, False, False),
        (("map", 2.0), [("map", 1.6), ("map", 2.2)], False, True, False),
        (("map", 20.0), [("map", 19.0)], False, False, True),
        (("map", 2.0), [("MapError",)], False, False, False),
        (("MapError",), [("map", 3.0)], False, True, False),
        (("MapError",), [("MapError",)], False, False, False),
        (("untyped exception",), [("MapError",)], True, False, False),
        (("not certified", 2.0), [("map", 3.0)], True, False, False),
    ],
)
def test_what_is_wrong(ours, others, fault, worse, high):
    one = Comparison(row("ours", *ours), [row("other", *other) for other in others])
    assert (one.is_fault, one.is_worse, one.is_high) == (fault, worse, high)
    assert str(one).startswith("blob less a face (face 7): ours")
