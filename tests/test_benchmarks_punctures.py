"""The command `python -m benchmarks punctures`."""

import numpy as np
import pytest
import surfaces
from benchmark_commands import benchmarks

from benchmarks.measure import punctures
from benchmarks.measure.punctures import Comparison, Row, opened
from cdcp_igl.surface.mesh import DiskMesh


@pytest.mark.parametrize(("kind", "boundary"), [("face", 3), ("vertex", 6), ("2-ring", 12)])
def test_what_is_taken_out(kind, boundary):
    V, F = surfaces.sphere()  # all its vertices but those at the poles have six neighbours
    W, G = opened(V, F, kind, 80)
    assert len(DiskMesh(W, G).loop) == boundary
    assert len(W) == len(V) - {"face": 0, "vertex": 1, "2-ring": 7}[kind]


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The command for a folder with a closed surface and one with a handle; its file, its output.

    One place each.
    """
    folder = tmp_path_factory.mktemp("closed")
    for name, (V, F) in {"sphere": surfaces.sphere(), "torus": surfaces.torus()}.items():
        np.savez(folder / f"{name}.npz", V=V, F=F)
    command = ["punctures", folder, "--places", 1, "--work", folder / "work"]
    shown = benchmarks(*command)
    assert shown.exit_code == 0, shown.output
    assert "torus" not in shown.stdout
    return command, folder / "work" / "punctures-1" / "results.jsonl", shown.stdout


def test_a_killed_run_goes_on_where_it_stopped(measured):
    command, path, shown = measured
    lines = path.read_bytes().splitlines(keepends=True)
    assert len(lines) == len(punctures.RINGS) * len(punctures.METHODS)
    path.write_bytes(b"".join(lines[:-2]) + lines[-2][:9])
    known = path.read_bytes()
    assert benchmarks(*command, "--jobs", 2).stdout == shown
    assert path.read_bytes().startswith(known)
    assert len(path.read_bytes().splitlines()) == len(lines) + 1


def test_a_fault_is_told_and_an_exit_code(measured, tmp_path):
    command, path, _ = measured
    text = path.read_text()
    ours = f'"method": "{punctures.METHODS[0]}", "outcome": '
    assert text.count(f'{ours}"map"') == 3
    (tmp_path / path.parent.name).mkdir()
    (tmp_path / path.parent.name / path.name).write_text(
        text.replace(f'{ours}"map"', f'{ours}"hang"')
    )
    shown = benchmarks(*command[:-1], tmp_path)
    assert shown.exit_code == 1
    assert "sphere less a face" in shown.stdout
    assert f"{punctures.METHODS[0]} hang" in shown.stdout


def row(method, outcome, mean=np.nan):
    return Row("blob", "digest", "face", 0, 7, method, outcome, mean)


@pytest.mark.parametrize(
    ("ours", "others", "fault", "worse"),
    [
        (("map", 2.0), [("map", 1.9), ("MapError",)], False, False),
        (("map", 2.0), [("map", 1.6), ("map", 2.2)], False, True),
        (("map", 2.0), [("MapError",)], False, False),
        (("MapError",), [("map", 3.0)], False, True),
        (("MapError",), [("MapError",)], False, False),
        (("untyped exception",), [("MapError",)], True, False),
        (("not certified", 2.0), [("map", 3.0)], True, False),
    ],
)
def test_what_is_wrong(ours, others, fault, worse):
    one = Comparison(row("ours", *ours), [row("other", *other) for other in others])
    assert (one.is_fault, one.is_worse) == (fault, worse)
    assert str(one).startswith("blob less a face (face 7): ours")
